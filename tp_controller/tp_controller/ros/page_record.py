"""The command `record` as the page runs it: it finishes its file if the page is killed."""

import ctypes
import signal
import sys

PR_SET_PDEATHSIG = 1


def main() -> int:
    """Record until SIGINT, or the end of the process that has started this one."""
    ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGINT)
    try:
        from tp_controller.ros.record import main as record

        return record()
    except KeyboardInterrupt:
        print('record: ended before it began', file=sys.stderr)
        return 1


if __name__ == '__main__':
    sys.exit(main())

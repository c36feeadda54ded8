"""A bare timer process that tells when the machine did not run it in time.

``python -m tp_sim.faults.pauses [LEAST]`` prints one line for each pause of at least so many
seconds: its begin and end [s] by the wall clock. It asks for the same priority as the nodes.
"""

from __future__ import annotations

import contextlib
import os
import sys
import time

from tp_sim.faults.record import Pause
from tp_sim.harness import Process

TICK = 0.001
"""Time [s] that it sleeps."""
LEAST = 0.002
"""A wake-up that is later [s] is a pause, unless told otherwise."""
PRIORITY = -10


def main() -> None:
    """Sleep again and again, and print pauses."""
    least = float(sys.argv[1]) if len(sys.argv) > 1 else LEAST
    take_priority()
    while True:
        due = time.time() + TICK
        time.sleep(TICK)
        now = time.time()
        if now - due > least:
            print(f'{due!r} {now!r}', flush=True)


def take_priority() -> None:
    """Go before ordinary processes, as the nodes do, if the user may."""
    with contextlib.suppress(OSError):
        os.setpriority(os.PRIO_PROCESS, 0, PRIORITY)


class PauseWatch:
    """The process, and what it told.

    Parameters
    ----------
    least
        Time [s] by which a wake-up is too late.
    """

    def __init__(self, least: float = LEAST) -> None:
        command = [sys.executable, '-m', 'tp_sim.faults.pauses', repr(least)]
        self._process = Process('pauses', command, dict(os.environ))

    def pauses(self, begin: float = 0.0) -> list[Pause]:
        """Pauses that ended after a time [s]."""
        found = []
        for line in self._process.output.splitlines():
            fields = line.split()
            if len(fields) == 2:
                pause = Pause(*map(float, fields))
                if pause.end > begin:
                    found.append(pause)
        return found

    def close(self) -> None:
        """End the process."""
        self._process.kill()


if __name__ == '__main__':
    main()

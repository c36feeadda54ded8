"""A bare timer process that tells when the machine did not run it in time.

``python -m tp_sim.faults.pauses`` prints one line for each pause: its begin and end [s] by the
wall clock. It asks for the same priority as the nodes.
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
"""A wake-up that is later [s] is a pause."""
PRIORITY = -10


def main() -> None:
    """Sleep again and again, and print pauses."""
    take_priority()
    while True:
        due = time.time() + TICK
        time.sleep(TICK)
        now = time.time()
        if now - due > LEAST:
            print(f'{due!r} {now!r}', flush=True)


def take_priority() -> None:
    """Go before ordinary processes, as the nodes do, if the user may."""
    with contextlib.suppress(OSError):
        os.setpriority(os.PRIO_PROCESS, 0, PRIORITY)


class PauseWatch:
    """The process, and what it told."""

    def __init__(self) -> None:
        self._process = Process(
            'pauses', [sys.executable, '-m', 'tp_sim.faults.pauses'], dict(os.environ)
        )

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

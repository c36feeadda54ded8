"""Real time: steps at the pace of the steady clock, in a thread of their own."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable

LONGEST_GAP = 1.0
"""Time [s] that is caught up at most."""
WINDOW = 10.0
"""Time [s] over which late steps are counted."""
FEW = 0.01
"""Share of late steps that is not worth a word."""
LONG = 0.1
"""Time [s] that is worth a word when it is caught up at once."""
SWITCH = 5e-4
"""Time [s] for which another thread may keep the interpreter from this one."""


class RealTime:
    """Takes the steps that are due, again and again, until it is stopped.

    Steps that came late are caught up at once. What is more than `LONGEST_GAP` late is left out.
    Waiting in a thread costs a fraction of what an executor's timer does, and no service that
    is being answered makes a step late.

    Parameters
    ----------
    dt
        Length of a step [s].
    steps
        Takes so many steps, one or more, and publishes the state after the last; the second
        argument is the time [s] of that state by the steady clock, ``time.monotonic``.
    warn
        Says that steps came late.
    """

    def __init__(
        self, dt: float, steps: Callable[[int, float], None], warn: Callable[[str], None]
    ) -> None:
        self._dt = dt
        self._take = steps
        self._warn = warn
        self._stopped = False
        self.failure: BaseException | None = None
        """What ended the thread before its time."""
        self._thread = threading.Thread(target=self._run, name='real_time', daemon=True)
        sys.setswitchinterval(SWITCH)
        self._thread.start()

    def stop(self) -> None:
        """Take no further step."""
        self._stopped = True
        self._thread.join()

    def check(self) -> None:
        """Raise what ended the thread, if anything did."""
        if self.failure is not None:
            raise self.failure

    def _run(self) -> None:
        try:
            self._keep_pace()
        except BaseException as error:
            self.failure = error

    def _keep_pace(self) -> None:
        begin = window = time.monotonic()
        done = late = before = 0
        while not self._stopped:
            now = time.monotonic()
            due = int((now - begin) / self._dt) - done
            if due <= 0:
                time.sleep(max(0.0, begin + (done + 1) * self._dt - now))
                continue
            if due * self._dt > LONGEST_GAP:
                left_out = due - int(LONGEST_GAP / self._dt)
                self._warn(f'late: {left_out * self._dt:.3g} s are left out')
                begin += left_out * self._dt
                due -= left_out
            if due * self._dt > LONG:
                self._warn(f'late: {due * self._dt:.3g} s are caught up at once, {due} steps')
            done += due
            self._take(due, begin + done * self._dt)
            late += due - 1
            if now - window > WINDOW:
                if late > FEW * (done - before):
                    self._warn(
                        f'late: {late} of {done - before} steps were caught up; the machine is '
                        f'busy, or {1.0 / self._dt:g} Hz is too much for it'
                    )
                window, late, before = now, 0, done

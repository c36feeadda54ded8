"""Collision shapes of a URDF, read by a process of its own.

A mesh is loaded in one call that holds up every thread of the process, for up to 0.1 s: too long
beside a control cycle. The other process gives way to this one.
"""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
from collections.abc import Collection, Mapping
from typing import TYPE_CHECKING

from tp_controller.errors import TaskPriorityError

if TYPE_CHECKING:
    from tp_controller.robot import Shape

MODULE = 'tp_controller.shape_process'
COURTESY = 10
"""Added to the niceness of the process."""
TIMEOUT = 60.0
"""Longest time [s] that it may take."""


class ShapesNotRead(TaskPriorityError):
    """The process that reads shapes has failed; its own lines are in the log."""


def described_apart(
    description: str, without: Collection[str] = ()
) -> Mapping[str, tuple[Shape, ...]]:
    """Do what `described_bodies` does, in another process; this thread waits for it.

    Raises
    ------
    InvalidValue
        As `described_bodies`.
    ShapesNotRead
        If the process fails, or does not answer in `TIMEOUT`.
    """
    environment = os.environ | {'PYTHONPATH': os.pathsep.join(filter(None, sys.path))}
    try:
        done = subprocess.run(
            [sys.executable, '-m', MODULE],
            input=pickle.dumps((description, tuple(without))),
            stdout=subprocess.PIPE,
            env=environment,
            timeout=TIMEOUT,
            # A Ctrl-C in the terminal is for this process alone.
            start_new_session=True,
            check=True,
        )
    except (OSError, subprocess.SubprocessError) as error:
        raise ShapesNotRead(f'the shapes of the links could not be read: {error}') from None
    found = pickle.loads(done.stdout)
    if isinstance(found, Exception):
        raise found
    return dict(found)


def _main() -> None:
    # A controller may run with a priority in real time; this may not.
    os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    os.nice(COURTESY)
    from tp_controller.robot.bodies import described_bodies

    # What libraries print is no answer.
    answer = os.fdopen(os.dup(sys.stdout.fileno()), 'wb')
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    description, without = pickle.load(sys.stdin.buffer)
    try:
        found: object = described_bodies(description, without)
    except TaskPriorityError as error:
        found = error
    with answer:
        pickle.dump(found, answer)


if __name__ == '__main__':
    _main()

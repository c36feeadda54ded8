"""A planner in a process of its own: one request at a time, and the newest counts.

`main` reads requests from the standard input and writes replies to the standard output, both
pickled. `RemotePlanner` starts it and talks to it.
"""

from __future__ import annotations

import contextlib
import os
import pickle
import queue
import sys
import threading
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tp_controller.errors import TaskPriorityError
from tp_controller.parameters import Flat
from tp_controller.planning.messages import Failed, Found, Judged, Reply, Request
from tp_controller.planning.planner import Phase, Plan, Planner

Matrix = NDArray[np.float64]

COURTESY = 5
"""Added to the niceness of the process."""
PLACES = 100
"""Points of a way that are shown."""


class _Worker:
    """Answers requests; what takes long to build is kept."""

    def __init__(self) -> None:
        self._key: Any = None
        self._planner: Planner | None = None

    def answer(
        self, request: Request, tell: Callable[[Phase], object], stop: Callable[[], bool]
    ) -> Found | Judged | Failed:
        """Make a plan, or judge what is left of a way."""
        try:
            planner = self._fit(request)
            for name, target in request.targets.items():
                planner.stack.tasks[name].target = target
            if request.rest is not None:
                path, begin = request.rest
                return Judged(planner.is_clear(request.goals, request.q, path, begin))
            plan = planner.plan(
                request.goals, request.q, request.tolerances, request.straight, tell, stop
            )
        except TaskPriorityError as error:
            return Failed(str(error))
        return Found(plan, _places(planner, request, plan))

    def _fit(self, request: Request) -> Planner:
        """Planner for the parameters of a request."""
        key = request.parameters, request.description
        if self._planner is None or key != self._key:
            self._planner = None
            self._planner = Planner(_listed(request.parameters), request.description)
            self._key = key
        return self._planner


def _listed(parameters: Flat) -> dict[str, Any]:
    return {
        key: list(value) if isinstance(value, tuple) else value
        for key, value in parameters.items()
    }


def _places(planner: Planner, request: Request, plan: Plan) -> Matrix:
    """Places (m, 3) [m] of the frame of the first goal that has one along a way."""
    frames = [planner.stack.tasks[name].frame_name for name in request.goals]
    names = [*filter(None, frames), planner.robot.frames[-1]]
    if plan.way is None:
        return np.zeros((0, 3))
    frame = planner.robot.frame(names[0])
    found = []
    for time in np.linspace(0.0, plan.way.duration, PLACES):
        planner.robot.place(plan.way.path.at(float(time))[0])
        found.append(frame.position.copy())
    return np.array(found)


def main() -> None:
    """Answer requests until the standard input ends."""
    # A controller may run with a priority in real time; this may not.
    with contextlib.suppress(OSError):
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    os.nice(COURTESY)
    # What libraries print is no answer.
    answers = os.fdopen(os.dup(sys.stdout.fileno()), 'wb')
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    requests: queue.SimpleQueue[Request | None] = queue.SimpleQueue()

    def read() -> None:
        try:
            while True:
                requests.put(pickle.load(sys.stdin.buffer))
        except (EOFError, OSError, pickle.UnpicklingError):
            requests.put(None)

    def write(number: int, reply: Reply) -> None:
        pickle.dump((number, reply), answers)
        answers.flush()

    threading.Thread(target=read, daemon=True).start()
    worker = _Worker()
    while True:
        request = requests.get()
        while not requests.empty():
            request = requests.get()
        if request is None:
            break
        number = request.number
        found = worker.answer(request, partial(write, number), lambda: not requests.empty())
        write(number, found)
    # OMPL's bindings tell of what they leave at the end of the interpreter.
    os._exit(0)

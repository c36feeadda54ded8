"""A planner in a process of its own: one request at a time, and the newest counts.

`main` reads requests from the standard input and writes replies to the standard output, both
pickled. `RemotePlanner` starts it and talks to it by threads: no call of it waits.
"""

from __future__ import annotations

import contextlib
import os
import pickle
import queue
import subprocess
import sys
import threading
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tp_controller.config import Settings
from tp_controller.config.changes import HIERARCHY
from tp_controller.errors import TaskPriorityError
from tp_controller.parameters import Flat
from tp_controller.planning.planner import Phase, Plan, Planner
from tp_controller.stack import Stack

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]

MODULE = 'tp_controller.planning'
COURTESY = 5
"""Added to the niceness of the process."""
PLACES = 100
"""Points of a way that are shown."""


class Request(NamedTuple):
    """What is asked of a planner."""

    number: int
    """Comes back with every reply."""
    parameters: Flat
    """Parameters of the controller by dotted key, without targets."""
    description: str | None
    """URDF for parameters that name no robot."""
    targets: Mapping[str, Vector]
    """Targets of all tasks that have one, centres of obstacles included."""
    goals: Mapping[str, Vector]
    tolerances: Mapping[str, float]
    q: Vector
    """Configuration (nq,) [rad, m] of the arm at rest."""
    straight: bool
    """Whether the straight way is looked at first."""


class Found(NamedTuple):
    """A plan, with what is shown of it."""

    plan: Plan
    places: Matrix
    """Places (m, 3) [m] of the controlled frame along the way; none without a way."""


class Failed(NamedTuple):
    """Nothing can be planned."""

    text: str


Reply = Phase | Found | Failed


class RemotePlanner:
    """Talks to the process, which is started with the first request, or anew if it has ended."""

    def __init__(self) -> None:
        self._requests: queue.SimpleQueue[Request | None] = queue.SimpleQueue()
        self._replies: queue.SimpleQueue[tuple[int, Reply]] = queue.SimpleQueue()
        self._thread: threading.Thread | None = None
        self._process: subprocess.Popen[bytes] | None = None
        self._number = 0

    def ask(self, request: Request) -> None:
        """Ask for a plan; a request before it is given up."""
        self._number = request.number
        self._requests.put(request)
        if self._thread is None:
            self._thread = threading.Thread(target=self._write, name='planner', daemon=True)
            self._thread.start()

    def take(self) -> list[tuple[int, Reply]]:
        """Replies that have come since the last call, with the numbers of their requests."""
        found = []
        while True:
            try:
                found.append(self._replies.get_nowait())
            except queue.Empty:
                return found

    def close(self) -> None:
        """End the process."""
        if self._thread is not None:
            self._requests.put(None)
            self._thread = None
        process = self._process
        if process is not None:
            process.kill()
            process.wait()

    def _write(self) -> None:
        while (request := self._requests.get()) is not None:
            try:
                process = self._running()
                assert process.stdin is not None
                pickle.dump(request, process.stdin)
                process.stdin.flush()
            except (OSError, ValueError) as error:
                self._replies.put((request.number, Failed(f'the planner has ended: {error}')))

    def _running(self) -> subprocess.Popen[bytes]:
        if self._process is None or self._process.poll() is not None:
            environment = os.environ | {'PYTHONPATH': os.pathsep.join(filter(None, sys.path))}
            self._process = subprocess.Popen(
                [sys.executable, '-m', MODULE],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                env=environment,
                # A Ctrl-C in the terminal is for this process alone.
                start_new_session=True,
            )
            reader = threading.Thread(
                target=self._read, args=(self._process,), name='plans', daemon=True
            )
            reader.start()
        return self._process

    def _read(self, process: subprocess.Popen[bytes]) -> None:
        assert process.stdout is not None
        try:
            while True:
                self._replies.put(pickle.load(process.stdout))
        except Exception:  # whatever breaks the conversation ends it
            self._replies.put((self._number, Failed('the planner has ended')))


class _Worker:
    """Answers requests; what takes long to build is kept."""

    def __init__(self) -> None:
        self._key: Any = None
        self._planner: Planner | None = None

    def answer(
        self, request: Request, tell: Callable[[Phase], object], stop: Callable[[], bool]
    ) -> Found | Failed:
        """Make a plan."""
        try:
            planner = self._fit(request)
            for name, target in request.targets.items():
                planner.stack.tasks[name].target = target
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


def asked_parameters(settings: Settings) -> Flat:
    """Parameters of a request: those of a controller as they are now, without targets."""
    hierarchy = {HIERARCHY: tuple(settings.stack.hierarchy) or ('',)}
    return {
        key: value
        for key, value in (settings.values | hierarchy).items()
        if value not in (None, ()) and not (key.startswith('tasks.') and key.endswith('.target'))
    }


def asked_targets(stack: Stack) -> dict[str, Vector]:
    """Targets of a request: those of all tasks that have one."""
    return {
        name: task.settings[0]
        for name, task in stack.tasks.items()
        if task.target_size and task.settings[0].size
    }


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

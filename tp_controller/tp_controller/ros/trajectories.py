"""``~/<task>/trajectory``: tasks that follow a path in time."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from builtin_interfaces.msg import Time

from tp_controller.errors import InvalidValue
from tp_controller.pace import made_up, pace
from tp_controller.ros.codecs import GOALS, Frames
from tp_controller.ros.release import Release
from tp_controller.ros.state_watch import nanoseconds
from tp_controller.ros.trajectory_messages import Begin
from tp_controller.stack import Stack
from tp_controller.tasks import Task
from tp_controller.trajectory import TaskPath

LATEST = 3600.0
"""Time [s] before its beginning at which a trajectory may come."""


class _Run:
    """A trajectory under way.

    Parameters
    ----------
    path
        What the task follows.
    time
        Time [s] of the path at the next joint state, or at the last one.
    fresh
        Whether the next joint state is its beginning.
    target
        The task's target, by which a new one is noticed.
    """

    def __init__(self, path: TaskPath, time: float, fresh: bool, target: Any) -> None:
        self.path, self.time, self.fresh, self.target = path, time, fresh, target
        self.speed = self.asked = 1.0
        """Shares of its speed that the path has, and that is asked for."""
        self.feedforward: np.ndarray | None = None
        """At full speed; None before it has begun."""
        self.extra = np.zeros(0)
        """What is asked for in addition to it."""


class _Later:
    """A trajectory that begins at a stamp to come.

    Parameters
    ----------
    msg, frames
        The message, and the frames that it may be given in.
    target
        The task's target, by which a new one is noticed.
    """

    def __init__(self, msg: Any, frames: Frames, target: Any) -> None:
        self.msg, self.frames, self.target = msg, frames, target
        self.stamp = nanoseconds(msg.header.stamp)


class Trajectories:
    """Tasks that follow paths; what is there at each joint state is set before the step.

    Parameters
    ----------
    stack
        The tasks.
    stamp
        Stamp of the joint state that was answered last.
    release
        Lets tasks come to rest.
    configured
        Feedforward (k,) of a task outside trajectories.
    longest
        Time [s] for which a point alone goes on at its velocity.
    refuse_at_rest
        Raises InvalidValue for the key that it is called with while the arm is kept at rest.
    failed
        Called with a task and the reason if its trajectory ends because it cannot be followed.
    """

    def __init__(
        self,
        stack: Stack,
        stamp: Callable[[], Time],
        release: Release,
        configured: Callable[[Task], np.ndarray],
        longest: float,
        refuse_at_rest: Callable[[str], None],
        failed: Callable[[Task, str], None],
    ) -> None:
        self._failed = failed
        self._refuse_at_rest = refuse_at_rest
        self._stack, self._stamp, self._release = stack, stamp, release
        self._configured, self._longest = configured, longest
        self._runs: dict[Task, _Run] = {}
        self._later: dict[Task, _Later] = {}
        response = stack.robot.response
        self._lead = float(np.max(response.delay + response.lag))
        """What an arm does late is asked for so much earlier [s]."""

    def runs(self, task: Task) -> bool:
        """Whether a task follows a trajectory."""
        return task in self._runs

    def begin(self, task: Task, msg: Any, frames: Frames) -> None:
        """Follow a trajectory from the next joint state on; an empty one: stop here.

        Raises
        ------
        InvalidValue
            If it cannot be used; what the task does goes on then.
        """
        stack = self._stack
        if not frames.robot_seen:
            raise InvalidValue('trajectory', 'one before the first joint state', 'later ones')
        self._refuse_at_rest('trajectory')
        if stack.level_of(task.name) < 0:
            got = 'one for a task that is not in the hierarchy'
            raise InvalidValue('trajectory', got, 'ones for tasks that are')
        if not msg.points:
            self.end(task)
            self._release.begin(task)
            return
        time = self._time(msg.header.stamp)
        path = self._path(task, msg, frames, max(0.0, time or 0.0))
        if time is not None and time < 0.0:
            # The path is made anew when it begins, from what the task does then.
            self._later[task] = _Later(msg, frames, task.settings[0])
            return
        self._later.pop(task, None)
        self._start(task, path, time)

    def _path(self, task: Task, msg: Any, frames: Frames, now: float) -> TaskPath:
        """Path of a message whose time [s] is ``now`` at the joint state that it begins at."""
        before = self._runs.get(task)
        begin = Begin(now, None, 0.0, 0.0, self._longest)
        if before is not None:
            at = before.time + self._lead
            begin = Begin(now, before.path, at, before.speed, self._longest)
        return GOALS[task.type].path(task, msg, frames, begin)

    def _start(self, task: Task, path: TaskPath, time: float | None) -> None:
        self._release.end(task)
        self._runs[task] = _Run(path, time or 0.0, time is None, task.settings[0])

    def _time(self, stamp: Time) -> float | None:
        """Time [s] since a stamp at the last joint state; None if it is zero, which means now.

        Raises
        ------
        InvalidValue
            For a stamp that the joint states' clock says nothing about.
        """
        if not nanoseconds(stamp):
            return None
        last = nanoseconds(self._stamp())
        time = 1e-9 * (last - nanoseconds(stamp))
        if not last or time < -LATEST:
            got = 'a time, but joint states have no stamp' if not last else f'{-time:.3g} s ahead'
            accepts = f'0 for now, or a time of the joint states up to {LATEST:g} s ahead'
            raise InvalidValue('header.stamp', got, accepts)
        return time

    def end(self, task: Task) -> None:
        """End the trajectory of a task, and one to come; its target stays the last one."""
        self._later.pop(task, None)
        self._end_run(task)

    def _end_run(self, task: Task) -> None:
        if self._runs.pop(task, None) is not None:
            task.feedforward = self._configured(task)

    def end_all(self) -> None:
        """End all trajectories."""
        for task in [*self._runs, *self._later]:
            self.end(task)

    def advance(self, seconds: float) -> None:
        """Let time [s] pass between joint states; negative takes it back."""
        if not (self._runs or self._later):
            return
        for task, later in list(self._later.items()):
            self._safely(task, self._await, task, later, seconds)
        for task, run in list(self._runs.items()):
            self._safely(task, self._advance, task, run, seconds)

    def _safely(self, task: Task, follow: Callable[..., None], *arguments: Any) -> None:
        """Go on; a task whose path leads beyond what can be followed comes to rest."""
        try:
            follow(*arguments)
        except InvalidValue as error:
            self.end(task)
            self._release.begin(task)
            self._failed(task, str(error))

    def _await(self, task: Task, later: _Later, seconds: float) -> None:
        """Begin a trajectory whose time has come, at the joint state that is answered next."""
        target = task.settings[0]
        if task in self._runs or self._release.follows(task) or not later.target.size:
            later.target = target
        if target is not later.target or self._stack.level_of(task.name) < 0:
            self.end(task)
            return
        passed = seconds if np.isfinite(seconds) else 0.0
        time = 1e-9 * (nanoseconds(self._stamp()) - later.stamp) + passed
        if time < 0.0:
            return
        del self._later[task]
        self._start(task, self._path(task, later.msg, later.frames, time), time - passed)

    def _advance(self, task: Task, run: _Run, seconds: float) -> None:
        stack = self._stack
        if task.settings[0] is not run.target or stack.level_of(task.name) < 0:
            # Another target counts from now on.
            self.end(task)
            return
        if run.feedforward is not None and seconds > 0.0:
            requested, achieved = stack.velocities_of(task.name)
            if task.time_scaling:
                wanted = requested - run.extra + task.left_out()
                run.speed, run.asked = pace(run.asked, run.feedforward, wanted, achieved)
            else:
                run.speed = run.asked = 1.0
            run.extra = made_up(run.asked * run.feedforward, requested, achieved)
        if run.fresh:
            run.fresh = False
        elif np.isfinite(seconds):
            run.time += run.speed * seconds
        time = run.time + self._lead
        if time >= run.path.duration:
            task.target = run.path.aim(task, run.path.duration, 0.0).target
            self._end_run(task)
            if task in self._later:
                self._later[task].target = task.settings[0]
            return
        period = stack.safety_filter.period
        aim = run.path.aim(task, time, period if np.isfinite(period) else 0.0)
        if run.feedforward is None:
            run.extra = np.zeros(task.k)
        task.target, task.feedforward = aim.target, run.asked * aim.feedforward + run.extra
        run.target, run.feedforward = task.settings[0], aim.feedforward

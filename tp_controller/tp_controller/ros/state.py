"""The controller's state as a message whose arrays are made once."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from copy import copy

import numpy as np
from numpy.typing import NDArray

from tp_controller.explanation import Explanation, explanations
from tp_controller.ros.serialized import Serialized, field_view
from tp_controller.ros.state_watch import nanoseconds
from tp_controller.stack import Stack
from tp_controller.tasks import SetBasedTask, Task
from tp_interfaces.msg import ControllerState, LevelState, TaskState

Vector = NDArray[np.float64]


EXPLANATION_PERIOD = 99_900_000
"""Time [ns] between explanations: 0.1 s, and what is lost to rounding."""


BLOCKS = ('message', 'joint_names', 'levels_stamp', 'tasks')
"""Fields that begin a block of bytes: warnings and explanations change often, the rest rarely."""


class StateMessage:
    """Keeps a ControllerState equal to a stack.

    Parameters
    ----------
    stack
        The stack that it tells about.

    Attributes
    ----------
    msg
        The message; status, counters and times are set by its owner.
    """

    def __init__(self, stack: Stack) -> None:
        self._stack = stack
        robot = stack.robot
        self.msg = ControllerState()
        self.msg.header.frame_id = robot.base_frame
        self.msg.scale = 1.0
        self.msg.joint_names = list(robot.joints)
        self.msg.position_names = list(robot.coordinates)
        self._position = field_view(self.msg, 'position', robot.nq, math.nan)
        self._command = field_view(self.msg, 'command', robot.n)
        self._tasks: dict[str, _TaskMessage] = {}
        self._explained = -EXPLANATION_PERIOD
        self._explanation: Iterator[None] | None = None
        self.follow_tasks()
        self._serialized = Serialized(self.msg, BLOCKS)

    def task(self, name: str) -> TaskState:
        """Part of the message about one task."""
        return self._tasks[name].msg

    def follow_tasks(self) -> None:
        """Take over tasks that have come or gone."""
        known = self._tasks
        self._tasks = {
            name: known.get(name) or _TaskMessage(task) for name, task in self._stack.tasks.items()
        }
        self.msg.tasks = [entry.msg for entry in self._tasks.values()]
        self.follow_hierarchy()

    def follow_hierarchy(self) -> None:
        """Take over levels after the stack's hierarchy has changed."""
        self._explained, self._explanation = -EXPLANATION_PERIOD, None
        for name, entry in self._tasks.items():
            enabled = self._stack.level_of(name) >= 0
            velocities = self._stack.velocities_of(name) if enabled else None
            entry.set_level(self._stack.place_of(name), velocities)

    def refresh(self, command: Vector) -> None:
        """Fill in what the stack computed in its last step, and the command (n,)."""
        self._position[:] = self._stack.robot.q
        self._command[:] = command
        self.msg.braking = self._stack.braking
        for entry in self._tasks.values():
            entry.refresh()

    def serialized(self) -> bytes:
        """Return the bytes of the message as it is now."""
        return self._serialized.write()

    def explain(self, busy: Callable[[], bool]) -> None:
        """Tell why each level got what it got, piece by piece, ten times a second.

        Parameters
        ----------
        busy
            Called between two pieces; the rest is left to the next call if it returns True.
        """
        if self._explanation is None:
            # By the stamps: a simulation faster than real time is told about as often.
            now = nanoseconds(self.msg.header.stamp)
            if 0 <= now - self._explained < EXPLANATION_PERIOD:
                return
            self._explained = now
            self._explanation = self._explain()
        for _ in self._explanation:
            if busy():
                return
        self._explanation = None

    def forget_explanation(self) -> None:
        """Let an explanation that is under way be."""
        self._explanation = None

    def _explain(self) -> Iterator[None]:
        stamp = copy(self.msg.header.stamp)
        # Zero is sent to an arm that rests, whatever the limits are.
        limits = []
        if self._command.any() or not self._stack.resting:
            limits = self._stack.safety_filter.active_limits(self._command)
        if not (self._stack.resting or self._stack.solver.proven):
            limits.append('the solver: inside all limits, but not proven to be the best answer')
        levels = []
        for level in explanations(self._stack):
            levels.append(_level_message(level))
            yield
        for entry in list(self._tasks.values()):
            if entry.measure():
                yield
        self.msg.levels_stamp, self.msg.levels, self.msg.active_limits = stamp, levels, limits

    def refresh_target(self, name: str, located: bool) -> None:
        """Fill in one task's new target; its error too once the robot is `located`."""
        entry = self._tasks[name]
        entry.refresh_target()
        if located:
            entry.refresh(stepped=False)


def _level_message(level: Explanation) -> LevelState:
    return LevelState(
        tasks=level.tasks,
        rows=level.rows,
        rank=level.rank,
        smallest_singular_value=level.smallest_singular_value,
        shortfall=level.shortfall,
        blocked_by=list(level.lost_to_levels),
        lost_to_levels=list(level.lost_to_levels.values()),
        lost_to_singularity=level.lost_to_singularity,
        lost_to_damping=level.lost_to_damping,
        lost_to_saturation=level.lost_to_saturation,
        lost_to_guard=level.lost_to_guard,
        text=level.text,
    )


class _TaskMessage:
    """A TaskState whose arrays are views into the message."""

    def __init__(self, task: Task) -> None:
        self._task = task
        self._velocities: tuple[Vector, Vector] | None = None
        self.msg = TaskState(
            name=task.name,
            type=task.type,
            frame=task.frame_name,
            relative_to=task.relative_to,
            components=list(task.components),
            target_components=list(task.target_components),
        )
        self._desired = field_view(self.msg, 'desired', task.target_size, math.nan)
        self._current = field_view(self.msg, 'current', task.current.size, math.nan)
        self._error = field_view(self.msg, 'error', task.k, math.nan)
        # To look this up takes longer than most of what is done in a cycle.
        self._set_based = task if isinstance(task, SetBasedTask) else None
        rows = task.k if self._set_based else 0
        self._distance = field_view(self.msg, 'distance', rows, math.nan)
        self._requested = field_view(self.msg, 'requested_velocity', task.k)
        self._achieved = field_view(self.msg, 'achieved_velocity', task.k)
        self.msg.error_norm = math.nan
        self.refresh_target()

    def set_level(self, level: int, velocities: tuple[Vector, Vector] | None) -> None:
        """Put the task on a level, -1 outside the hierarchy, with its velocities if it is on."""
        self._velocities = velocities
        self.msg.level = level
        self.msg.enabled = velocities is not None
        self.msg.active = self.msg.enabled and self._task.active
        self._requested[:] = self._achieved[:] = 0.0

    def refresh_target(self) -> None:
        """Fill in the desired value, if there is one yet."""
        self._revision = self._task.revision
        target = self._task.target
        if target is not None and target.size:
            self._desired[:] = target

    def measure(self) -> bool:
        """Fill in distances that are too far away to be computed in every cycle, if any are."""
        if self._set_based is None:
            return False
        self._distance[:] = self._set_based.distances()
        return True

    def refresh(self, stepped: bool = True) -> None:
        """Fill in the task; `stepped` if the stack has just updated its hierarchy."""
        task = self._task
        # One that is to take its value at the next step as its target has no error until then.
        if (not stepped or self._velocities is None) and len(task.settings[0]) == task.target_size:
            task.update()
        if self._velocities is not None:
            self._requested[:], self._achieved[:] = self._velocities
        if task.revision != self._revision:
            self.refresh_target()
        self._current[:] = task.current
        error = self._error
        error[:] = task.error
        if self._set_based is not None:
            self._distance[:] = self._set_based.distance
            self.msg.active = self.msg.enabled and task.active
        self.msg.error_norm = math.sqrt(error.dot(error))

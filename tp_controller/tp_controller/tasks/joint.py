"""Positions of named joints."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from tp_controller.errors import InvalidValue, listed, plural, shown
from tp_controller.parameters import REQUIRED, TEXTS, Parameter
from tp_controller.robot import Robot
from tp_controller.tasks.base import Task
from tp_controller.tasks.parts import JOINTS, Part

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from tp_controller.tasks.base import Common

Vector = NDArray[np.float64]


class JointTask(Task):
    """Brings named joints to positions.

    ``error = q_des - q`` of the named joints, wrapped for continuous ones alone: another
    joint turned once round is not where it was. ``J`` has the matching unit rows.

    Parameters
    ----------
    name
        Name of the task.
    robot
        The robot that carries the task out.
    joints
        Names of the controlled joints.
    settings
        Gain, target and the like, see `Common`.
    """

    type = 'joint'
    parameters: ClassVar[Mapping[str, Parameter]] = {
        'joints': Parameter(TEXTS, 'Controlled joints', default=REQUIRED)
    }
    target_words = 'position per joint [rad, m]'

    def __init__(
        self, name: str, robot: Robot, joints: Sequence[str], **settings: Unpack[Common]
    ) -> None:
        indices = robot.joint_indices(joints)
        if not indices:
            raise InvalidValue('joints', 'no joint', f'some of {listed(robot.joints)}')
        super().__init__(name, robot, joints)
        self._indices = np.array(indices)
        self._q = robot.q
        self._wrapping = [row for row, i in enumerate(indices) if robot.wrapping[i]]
        self.J[np.arange(self.k), self._indices] = 1.0
        self.set(settings)

    @classmethod
    def from_parameters(cls, name: str, robot: Robot, values: Mapping[str, Any]) -> JointTask:
        """Make the task from checked values."""
        return cls(name, robot, values['joints'])

    @property
    def target_components(self) -> tuple[str, ...]:
        """Names of the joints."""
        return self.components

    @property
    def current(self) -> Vector:
        """Present positions (k,) [rad, m]; a copy."""
        return self._q[self._indices]

    def with_joints(
        self, values: Vector, names: Sequence[str], changes: Sequence[float]
    ) -> Vector:
        """Copy of one value per joint (k,) with those of the named joints changed.

        Raises
        ------
        InvalidValue
            If no joint is named, a name is not one of the task's, stands twice, or names
            and changes differ in number.
        """
        if (
            not 0 < len(names) <= self.k
            or len(names) != len(changes)
            or len(set(names)) != len(names)
        ):
            raise InvalidValue(
                'joints',
                f'{plural(len(names), "name")} {shown(names)} '
                f'with {plural(len(changes), "value")}',
                f'one value for each name, names out of {listed(self.components)}',
            )
        result = values.copy()
        for name, change in zip(names, changes, strict=True):
            if name not in self.components:
                raise InvalidValue('joints', shown(name), f'some of {listed(self.components)}')
            result[self.components.index(name)] = change
        return result

    @property
    def parts(self) -> tuple[Part, ...]:
        """The joints; `J` is constant."""
        return (Part(JOINTS, self._indices.tolist(), wraps=self._wrapping),)

    def part_values(self) -> tuple[Vector, ...]:
        """The target (k,)."""
        return (self._target,)

"""Positions of named joints."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from tp_controller.errors import InvalidValue, listed, plural, shown
from tp_controller.parameters import REQUIRED, TEXTS, Parameter
from tp_controller.robot import Robot
from tp_controller.robot.motions import DIFFERENTIAL, FREE
from tp_controller.rotations import wrap
from tp_controller.tasks.base import Task
from tp_controller.tasks.parts import JOINTS, Part

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from tp_controller.tasks.common import Common

Vector = NDArray[np.float64]


class JointTask(Task):
    """Brings named joints to positions.

    ``error = q_des - q`` of the named joints, wrapped for continuous ones alone: another
    joint turned once round is not where it was. ``J`` has the matching unit rows.

    Of a base, or another joint with a pose, the coordinates ``<joint>/x`` and so on can be named,
    except quaternions, and x and y of a differential drive, which has no velocity across. The rows
    of a position are those of the rotation of the base.

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

    Raises
    ------
    InvalidValue
        If there is no such joint, or it cannot be brought to a position on its own.
    """

    type = 'joint'
    parameters: ClassVar[Mapping[str, Parameter]] = {
        'joints': Parameter(TEXTS, 'Controlled joints, or coordinates of a base', default=REQUIRED)
    }
    target_words = 'position per joint [rad, m]'

    def __init__(
        self, name: str, robot: Robot, joints: Sequence[str], **settings: Unpack[Common]
    ) -> None:
        indices = robot.joint_indices(joints)
        steerable = [name for i, name in enumerate(robot.coordinates) if _steerable(robot, i)]
        if not indices:
            raise InvalidValue('joints', 'no joint', f'some of {listed(steerable)}')
        for index in indices:
            _check_steerable(robot, index, steerable)
        super().__init__(name, robot, joints)
        self._indices = np.array(indices)
        self._q = robot.q
        self._wrapping = [row for row, i in enumerate(indices) if robot.wrapping[i]]
        self._turns = robot.space.bent(indices)
        """Whether a row of `J` changes with the configuration."""
        self.J[:] = robot.space.rates(robot.q)[self._indices]
        self.set(settings)

    @property
    def speed_groups(self) -> tuple[slice, ...]:
        """Every row."""
        return tuple(slice(row, row + 1) for row in range(self.k))

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

    @property
    def wrapping(self) -> tuple[int, ...]:
        """Rows of joints that turn without end."""
        return tuple(self._wrapping)

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
        """The joints, while `J` is constant."""
        if self._turns:
            return ()
        return (Part(JOINTS, self._indices.tolist(), wraps=self._wrapping),)

    def part_values(self) -> tuple[Vector, ...]:
        """The target (k,)."""
        return (self._target,)

    def update(self) -> None:
        """Compute `error` and `J` at the robot's present configuration."""
        if not self._turns:
            super().update()
            return
        np.subtract(self._target, self._q[self._indices], out=self.error)
        for row in self._wrapping:
            self.error[row] = wrap(self.error[row])
        self.J[:] = self.robot.space.rates(self._q)[self._indices]

    @property
    def bend(self) -> Vector:
        """Bounds (k,) on the second derivatives of the variables by unit joint motions."""
        return np.full(self.k, 1.0 if self._turns else 0.0)

    def hessian(self, out: NDArray[np.float64]) -> None:
        """Write the second derivatives (k, n, n) of the variables to ``out``."""
        out[:] = self.robot.space.bends(self._q)[self._indices] if self._turns else 0.0


def _steerable(robot: Robot, index: int) -> bool:
    """Whether a coordinate can be brought to a value on its own."""
    block = robot.space.block_of(index)
    if block is None:
        return True
    place = index - block.q.start
    if block.kind == DIFFERENTIAL:
        return place >= block.positions
    return block.size != FREE or place < block.positions


def _check_steerable(robot: Robot, index: int, steerable: Sequence[str]) -> None:
    if _steerable(robot, index):
        return
    block, name = robot.space.block_of(index), robot.coordinates[index]
    if block is not None and block.kind == DIFFERENTIAL:
        got = f'{shown(name)} of a differential drive, which cannot move across'
        other = 'a position task of a frame in front of the axle'
    else:
        got, other = f'{shown(name)}, a part of a rotation', 'an orientation task'
    raise InvalidValue('joints', got, f'some of {listed(steerable)}, or {other}')

"""Positions of all joints."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, ClassVar

from tp_controller.parameters import Parameter
from tp_controller.robot import Robot
from tp_controller.tasks.joint import JointTask

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from tp_controller.tasks.common import Common


class PostureTask(JointTask):
    """Brings all joints to a posture: a `JointTask` of every joint, in the robot's order.

    On the lowest level it takes up whatever freedom is left. A base, or another joint with a pose,
    has no part in it.

    Parameters
    ----------
    name
        Name of the task.
    robot
        The robot that carries the task out.
    settings
        Gain, target and the like, see `Common`.
    """

    type = 'posture'
    parameters: ClassVar[Mapping[str, Parameter]] = {}

    def __init__(self, name: str, robot: Robot, **settings: Unpack[Common]) -> None:
        super().__init__(name, robot, robot.space.scalars, **settings)

    @classmethod
    def from_parameters(cls, name: str, robot: Robot, values: Mapping[str, Any]) -> PostureTask:
        """Make the task from checked values."""
        return cls(name, robot)

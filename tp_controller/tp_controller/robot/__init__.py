"""Kinematic models of arms."""

from tp_controller.robot.description import dh_description, same_description
from tp_controller.robot.dh import DHParameters, dh_robot
from tp_controller.robot.limits import Limits
from tp_controller.robot.model import Coupling, Frame, Robot
from tp_controller.robot.urdf import read_description, urdf_robot

__all__ = [
    'Coupling',
    'DHParameters',
    'Frame',
    'Limits',
    'Robot',
    'dh_description',
    'dh_robot',
    'read_description',
    'same_description',
    'urdf_robot',
]

"""Kinematic models of arms."""

from tp_controller.robot.dh import DHParameters, dh_robot
from tp_controller.robot.limits import Limits
from tp_controller.robot.model import Frame, Robot

__all__ = ['DHParameters', 'Frame', 'Limits', 'Robot', 'dh_robot']

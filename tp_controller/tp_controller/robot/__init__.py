"""Kinematic models of arms, and the shapes of their links."""

from tp_controller.robot.bodies import Bodies, robot_bodies
from tp_controller.robot.collision import Clearance
from tp_controller.robot.description import dh_description, same_description
from tp_controller.robot.dh import DHParameters, dh_robot
from tp_controller.robot.frames import Coupling, Frame
from tp_controller.robot.limits import Limits
from tp_controller.robot.make import clad
from tp_controller.robot.model import Robot
from tp_controller.robot.motions import BASES
from tp_controller.robot.package_files import read_description
from tp_controller.robot.pairs import link_pairs, obstacle_clearance, self_clearance
from tp_controller.robot.response import Response
from tp_controller.robot.shapes import Shape, capsule, half_space, sphere
from tp_controller.robot.space import Space
from tp_controller.robot.state import State, moved
from tp_controller.robot.urdf import LONGEST_URDF, urdf_robot

__all__ = [
    'BASES',
    'LONGEST_URDF',
    'Bodies',
    'Clearance',
    'Coupling',
    'DHParameters',
    'Frame',
    'Limits',
    'Response',
    'Robot',
    'Shape',
    'Space',
    'State',
    'capsule',
    'clad',
    'dh_description',
    'dh_robot',
    'half_space',
    'link_pairs',
    'moved',
    'obstacle_clearance',
    'read_description',
    'robot_bodies',
    'same_description',
    'self_clearance',
    'sphere',
    'urdf_robot',
]

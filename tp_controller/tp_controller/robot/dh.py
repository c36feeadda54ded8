"""Arms from standard Denavit-Hartenberg parameters.

Frame ``i`` follows from frame ``i - 1`` by ``Rz(theta) Tz(d) Tx(a) Rx(alpha)``; a revolute
joint adds its position to ``theta``, a prismatic one to ``d`` (Siciliano et al., Robotics:
Modelling, Planning and Control, 2009, section 2.8.2).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from tp_controller.errors import InvalidValue, listed, shown
from tp_controller.robot.limits import Limits
from tp_controller.robot.model import Robot

JOINT_TYPES = ('revolute', 'prismatic')


class DHParameters(NamedTuple):
    """Standard Denavit-Hartenberg parameters of n joints."""

    theta: Sequence[float]
    """Angle about the previous z axis (n,) [rad]; the offset of a revolute joint."""
    d: Sequence[float]
    """Length along the previous z axis (n,) [m]; the offset of a prismatic joint."""
    a: Sequence[float]
    """Length along the new x axis (n,) [m]."""
    alpha: Sequence[float]
    """Angle about the new x axis (n,) [rad]."""
    types: Sequence[str]
    """``revolute`` or ``prismatic`` (n,)."""
    base_pose: Sequence[float] = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    """Frame 0 in the base frame: x, y, z [m], roll, pitch, yaw [rad]."""


def dh_robot(
    joints: Sequence[str],
    dh: DHParameters,
    base_frame: str = 'base',
    limits: Limits | None = None,
) -> Robot:
    """Build the kinematic model of a DH arm with the frames ``link_1`` … ``link_n``.

    Parameters
    ----------
    joints
        Joint names (n,), from the base outwards.
    dh
        The parameters of each joint.
    base_frame
        Name of the frame that positions and velocities are expressed in.
    limits
        Joint limits; absent means unlimited.

    Raises
    ------
    InvalidValue
        If a list has not one value per joint or a joint type is unknown.
    """
    n = len(joints)
    for key, values in zip(DHParameters._fields, dh, strict=True):
        needed = 6 if key == 'base_pose' else n
        if len(values) != needed:
            meaning = (
                'x y z [m], roll pitch yaw [rad]'
                if key == 'base_pose'
                else 'one per joint of robot.joints'
            )
            raise InvalidValue(
                f'robot.dh.{key}',
                f'{len(values)} values {shown(values)}',
                f'{needed} values ({meaning})',
            )
    model = pin.Model()
    model.name = 'dh_arm'
    parent = 0
    placement = pin.SE3(
        pin.rpy.rpyToMatrix(np.array(dh.base_pose[3:], dtype=float)),
        np.array(dh.base_pose[:3], dtype=float),
    )
    for i, name in enumerate(joints):
        if dh.types[i] not in JOINT_TYPES:
            raise InvalidValue('robot.dh.types', shown(dh.types[i]), listed(JOINT_TYPES))
        joint = pin.JointModelRZ() if dh.types[i] == 'revolute' else pin.JointModelPZ()
        parent = model.addJoint(parent, joint, placement, name)
        placement = _link(dh.theta[i], dh.d[i], dh.a[i], dh.alpha[i])
        model.addFrame(pin.Frame(f'link_{i + 1}', parent, 0, placement, pin.OP_FRAME))
    return Robot(model, joints, base_frame, limits)


def _link(theta: float, d: float, a: float, alpha: float) -> pin.SE3:
    """Pose of frame i in the moved frame i - 1 with the joint at zero."""
    turn = pin.SE3(pin.utils.rotate('z', float(theta)), np.array([0.0, 0.0, float(d)]))
    return turn * pin.SE3(pin.utils.rotate('x', float(alpha)), np.array([float(a), 0.0, 0.0]))

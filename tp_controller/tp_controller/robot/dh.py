"""Arms from Denavit-Hartenberg parameters.

Frame ``i`` follows from frame ``i - 1`` by ``Rz(theta) Tz(d) Tx(a) Rx(alpha)`` in the standard
convention (Siciliano et al., Robotics: Modelling, Planning and Control, 2009, section 2.8.2)
and by ``Rx(alpha) Tx(a) Rz(theta) Tz(d)`` in the modified one (Craig, Introduction to
Robotics, 2005, section 3.5). A revolute joint adds its position to ``theta``, a prismatic one
to ``d``.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from tp_controller.errors import InvalidValue, listed, shown
from tp_controller.robot.frames import coupled
from tp_controller.robot.limits import Limits
from tp_controller.robot.model import Robot
from tp_controller.robot.motions import BASE, FIXED, FLOATING, SCALAR, WORLD, check_base
from tp_controller.robot.space import Space

Vector = NDArray[np.float64]

CONVENTIONS = ('standard', 'modified')
JOINT_TYPES = ('revolute', 'prismatic')


class DHParameters(NamedTuple):
    """Denavit-Hartenberg parameters of n joints."""

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
    convention: str = 'standard'
    """``standard``, or ``modified`` (Craig), where ``a`` and ``alpha`` belong to the previous
    x axis and come first."""


def dh_robot(
    joints: Sequence[str],
    dh: DHParameters,
    base_frame: str | None = None,
    limits: Limits | None = None,
    base: str = FIXED,
) -> Robot:
    """Build the kinematic model of a DH arm with the frames ``link_1`` … ``link_n``.

    Parameters
    ----------
    joints
        Joint names (n,), from the base outwards.
    dh
        The parameters of each joint.
    base_frame
        Name of the frame that everything is expressed in; when left out ``base``, or ``odom`` if
        the base moves. The frame of a base that moves is ``base``.
    limits
        Limits of the velocities, those of the base first; absent means unlimited.
    base
        What the arm stands on, one of `BASES`.

    Raises
    ------
    InvalidValue
        If a list has not one value per joint or a joint type is unknown.
    """
    check_base(base)
    model = pin.Model()
    model.name = 'dh_arm'
    parent = 0
    placement = pin.SE3.Identity()
    names, kinds = list(joints), [SCALAR] * len(joints)
    links = [f'link_{i + 1}' for i in range(len(joints))]
    start: str | Vector = np.array(dh.base_pose[:3], dtype=float)
    if base != FIXED:
        if BASE in joints:
            raise InvalidValue('robot.joints', f'{shown(BASE)} beside robot.base', 'another name')
        motion = pin.JointModelFreeFlyer() if base == FLOATING else pin.JointModelPlanar()
        parent = model.addJoint(0, motion, placement, BASE)
        model.addFrame(pin.Frame(BASE, parent, 0, placement, pin.OP_FRAME))
        names, kinds, start = [BASE, *names], [base, *kinds], BASE
    for i, (before, after) in enumerate(dh_placements(joints, dh)):
        joint = pin.JointModelRZ() if dh.types[i] == 'revolute' else pin.JointModelPZ()
        parent = model.addJoint(parent, joint, placement * before, joints[i])
        placement = after
        model.addFrame(pin.Frame(links[i], parent, 0, placement, pin.OP_FRAME))
    if base_frame is None:
        base_frame = BASE if base == FIXED else WORLD
    taken = links if base == FIXED else [BASE, *links]
    if base_frame in taken:
        raise InvalidValue(
            'robot.base_frame', shown(base_frame), f'a name that no link has ({listed(taken)})'
        )
    lines = list(zip([start, *links], links, strict=False))
    space = Space(names, kinds)
    coupling = coupled(model, space)
    return Robot(model, space, base_frame, limits, coupling, lines)


def dh_placements(joints: Sequence[str], dh: DHParameters) -> list[tuple[pin.SE3, pin.SE3]]:
    """What comes before and after the motion of each joint, which is along or about z.

    Parameters
    ----------
    joints
        Joint names (n,), from the base outwards.
    dh
        The parameters of each joint.

    Returns
    -------
    list of (pin.SE3, pin.SE3)
        From link i - 1, for the first joint the base, to the joint's z axis; from there,
        moved, to link i.

    Raises
    ------
    InvalidValue
        If a list has not one value per joint or a joint type is unknown.
    """
    n = len(joints)
    if dh.convention not in CONVENTIONS:
        raise InvalidValue('robot.dh.convention', shown(dh.convention), listed(CONVENTIONS))
    for key, values in zip(DHParameters._fields, dh, strict=True):
        if key == 'convention':
            continue
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
    placements = []
    for kind, theta, d, a, alpha in zip(dh.types, dh.theta, dh.d, dh.a, dh.alpha, strict=True):
        if kind not in JOINT_TYPES:
            raise InvalidValue('robot.dh.types', shown(kind), listed(JOINT_TYPES))
        turn, twist = _about_z(theta, d), _about_x(alpha, a)
        modified = dh.convention == 'modified'
        placements.append((twist, turn) if modified else (pin.SE3.Identity(), turn * twist))
    if placements:
        base = pin.SE3(
            pin.rpy.rpyToMatrix(np.array(dh.base_pose[3:], dtype=float)),
            np.array(dh.base_pose[:3], dtype=float),
        )
        placements[0] = (base * placements[0][0], placements[0][1])
    return placements


def _about_z(angle: float, length: float) -> pin.SE3:
    return pin.SE3(pin.utils.rotate('z', float(angle)), np.array([0.0, 0.0, float(length)]))


def _about_x(angle: float, length: float) -> pin.SE3:
    return pin.SE3(pin.utils.rotate('x', float(angle)), np.array([float(length), 0.0, 0.0]))

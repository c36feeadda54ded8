"""Robots made in one call, as `Robot.from_urdf` and `Robot.from_dh` do it."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from functools import partial

from tp_controller.errors import InvalidValue, listed, shown
from tp_controller.robot.bodies import robot_bodies, robot_links
from tp_controller.robot.dh import DHParameters, dh_robot
from tp_controller.robot.limits import Limits
from tp_controller.robot.model import Robot
from tp_controller.robot.motions import FIXED
from tp_controller.robot.package_files import read_description
from tp_controller.robot.srdf import disabled_pairs
from tp_controller.robot.urdf import urdf_robot

Values = float | Sequence[float]
"""One value for all joints or one per joint."""


def clad(
    robot: Robot,
    description: str | None = None,
    link_radius: Sequence[float] | None = None,
    capsules: Mapping[str, Sequence[float]] | None = None,
    srdf: str | None = None,
) -> Robot:
    """Let a robot know the shapes of its links; meshes are read when a task needs them.

    Parameters
    ----------
    robot
        The robot, which is changed.
    description, link_radius, capsules
        As `robot_bodies`.
    srdf
        Path of an SRDF, see `disabled_pairs`.

    Returns
    -------
    Robot
        The same robot.

    Raises
    ------
    InvalidValue
        As `robot_bodies` and `disabled_pairs`.
    """
    if srdf is not None:
        robot.disabled_pairs = disabled_pairs(srdf, robot_links(robot))
    robot_bodies(robot, None, link_radius, capsules)
    robot.body_source = partial(robot_bodies, robot, description, link_radius, capsules)
    return robot


def robot_from_urdf(
    path: str | os.PathLike[str],
    joints: Sequence[str] | None = None,
    base_frame: str | None = None,
    limits: Mapping[str, Values] | None = None,
    rest_positions: Mapping[str, float] | None = None,
    link_radius: Values | None = None,
    srdf: str | None = None,
    base: str = FIXED,
) -> Robot:
    """Make a robot of a URDF file, see `Robot.from_urdf`."""
    text = read_description(os.fspath(path))
    robot = urdf_robot(text, joints, base_frame, _limits(limits), rest_positions, base)
    return clad(robot, text, _values(link_radius), srdf=srdf)


def robot_from_dh(
    a: Sequence[float],
    alpha: Sequence[float] | None = None,
    d: Sequence[float] | None = None,
    theta: Sequence[float] | None = None,
    types: Sequence[str] | None = None,
    joints: Sequence[str] | None = None,
    base_frame: str | None = None,
    limits: Mapping[str, Values] | None = None,
    base_pose: Sequence[float] = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    convention: str = 'standard',
    link_radius: Values | None = None,
    base: str = FIXED,
) -> Robot:
    """Make a robot of Denavit-Hartenberg parameters, see `Robot.from_dh`."""
    n = len(a)
    zeros = [0.0] * n
    names = [f'joint_{i + 1}' for i in range(n)] if joints is None else joints
    dh = DHParameters(
        zeros if theta is None else theta,
        zeros if d is None else d,
        a,
        zeros if alpha is None else alpha,
        ['revolute'] * n if types is None else types,
        base_pose,
        convention,
    )
    robot = dh_robot(names, dh, base_frame, base=base)
    robot.limits = robot.limits.replaced(**_limits(limits))
    return clad(robot, None, _values(link_radius))


def _limits(limits: Mapping[str, Values] | None) -> dict[str, Sequence[float] | None]:
    """Limits by name, one value as a list of one."""
    given = dict(limits or {})
    for key in given.keys() - set(Limits.KEYS):
        raise InvalidValue('robot.limits', shown(key), f'some of {listed(Limits.KEYS)}')
    return {key: _values(value) for key, value in given.items()}


def _values(values: Values | None) -> Sequence[float] | None:
    return [float(values)] if isinstance(values, int | float) else values

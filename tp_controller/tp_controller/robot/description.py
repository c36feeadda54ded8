"""URDF descriptions: made of Denavit-Hartenberg parameters, and compared."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Sequence
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from tp_controller.robot.dh import DHParameters, dh_placements, dh_robot
from tp_controller.robot.limits import Limits
from tp_controller.robot.urdf import UNLIMITED

Vector = NDArray[np.float64]

COLORS = {'bar': '0.6 0.6 0.6 1', 'joint': '0.12 0.47 0.71 1'}


def dh_description(
    joints: Sequence[str],
    dh: DHParameters,
    base_frame: str | None = None,
    limits: Limits | None = None,
) -> str:
    """Describe a DH arm by a URDF, with simple shapes to be seen.

    The links ``link_1`` … ``link_n`` have the poses and Jacobians of `dh_robot`'s frames. The
    origin of a URDF link lies on the axis of its own joint, that of a link in the standard
    convention on the next one's: there joint i moves ``link_i_start``, whose origin is that
    of frame i - 1, and ``link_i`` is fixed to it. A URDF has no limits on acceleration.

    Parameters
    ----------
    joints, dh, base_frame, limits
        As for `dh_robot`.

    Returns
    -------
    str
        The URDF.

    Raises
    ------
    InvalidValue
        As `dh_robot`.
    """
    robot = dh_robot(joints, dh, base_frame, limits)
    links = (robot.base_frame, *robot.frames)
    reach = float(np.hypot(dh.a, dh.d).sum())
    arm = _Chain(robot.base_frame, 0.02 * max(reach, 0.1))
    for i, (before, after) in enumerate(dh_placements(joints, dh)):
        link = f'link_{i + 1}'
        kind, limit = _motion(dh.types[i], robot.limits, i)
        if dh.convention == 'modified':
            # What comes after the motion is about and along the same axis: the order is free.
            arm.extend(joints[i], kind, link, before * after, limit)
        else:
            arm.extend(joints[i], kind, _unused(f'{link}_start', links), before, limit)
            arm.extend(_unused(f'{link}_end', joints), 'fixed', link, after)
    ElementTree.indent(arm.document)
    return ElementTree.tostring(arm.document, encoding='unicode') + '\n'


def same_description(one: str, other: str) -> bool:
    """Whether two descriptions differ in nothing but white space and the like.

    What comes by way of a launch file or a command line often has other line ends.
    """
    if one == other:
        return True
    try:
        first, second = (ElementTree.canonicalize(text, strip_text=True) for text in (one, other))
    except ElementTree.ParseError:
        return False
    return first == second


def _motion(kind: str, limits: Limits, i: int) -> tuple[str, dict[str, float]]:
    """Type of joint i in a URDF, and its limits there."""
    lower, upper = limits.position_min[i], limits.position_max[i]
    limit = {'effort': UNLIMITED, 'velocity': limits.velocity[i]}
    if kind == 'revolute' and math.isinf(lower) and math.isinf(upper):
        # What URDF calls such a joint, and what every tool can show and plan for. It has a
        # price: a task of type `joint` on it takes the shortest way to its target, while the
        # same joint from DH parameters counts whole turns.
        return 'continuous', limit
    # The other types need numbers; `urdf_robot` takes these for no limit, as do people.
    return kind, limit | {'lower': max(lower, -UNLIMITED), 'upper': min(upper, UNLIMITED)}


def _unused(name: str, taken: Collection[str]) -> str:
    while name in taken:
        name += '_'
    return name


class _Chain:
    """A URDF of links one after the other.

    Parameters
    ----------
    base_frame
        Name of the first link.
    radius
        Radius [m] of the bars that are drawn.

    Attributes
    ----------
    document
        The URDF.
    """

    def __init__(self, base_frame: str, radius: float) -> None:
        self.document = Element('robot', name='dh_arm')
        for name, rgba in COLORS.items():
            SubElement(SubElement(self.document, 'material', name=name), 'color', rgba=rgba)
        self._end = SubElement(self.document, 'link', name=base_frame)
        self._radius = radius

    def extend(
        self,
        joint: str,
        kind: str,
        link: str,
        origin: pin.SE3,
        limit: dict[str, float] | None = None,
    ) -> None:
        """Add a link at the end, by a joint along or about z with its origin there."""
        rpy = pin.rpy.matrixToRpy(origin.rotation)
        self._draw_bar(origin.translation)
        parent, self._end = self._end, SubElement(self.document, 'link', name=link)
        element = SubElement(self.document, 'joint', name=joint, type=kind)
        SubElement(element, 'parent', link=str(parent.get('name')))
        SubElement(element, 'child', link=link)
        SubElement(element, 'origin', xyz=_words(origin.translation), rpy=_words(rpy))
        if kind == 'fixed':
            return
        SubElement(element, 'axis', xyz='0 0 1')
        if limit is not None:
            values = {key: repr(float(min(value, UNLIMITED))) for key, value in limit.items()}
            SubElement(element, 'limit', values)
        self._draw_joint(kind)

    def _draw_bar(self, end: Vector) -> None:
        """Draw a bar from the origin of the last link to a point (3,) [m] in it."""
        length = float(np.linalg.norm(end))
        if length > 0.0:
            tilt, turn = math.atan2(math.hypot(end[0], end[1]), end[2]), math.atan2(end[1], end[0])
            size = {'radius': [self._radius], 'length': [length]}
            self._draw('bar', 'cylinder', size, end / 2.0, (0.0, tilt, turn))

    def _draw_joint(self, kind: str) -> None:
        """Draw a joint at the origin of the link that it moves."""
        width = 3.0 * self._radius
        if kind == 'prismatic':
            self._draw('joint', 'box', {'size': [width] * 3})
        else:
            size = {'radius': [width / 2.0], 'length': [1.5 * width]}
            self._draw('joint', 'cylinder', size)

    def _draw(
        self,
        material: str,
        shape: str,
        size: dict[str, list[float]],
        xyz: Iterable[float] = (0.0, 0.0, 0.0),
        rpy: Iterable[float] = (0.0, 0.0, 0.0),
    ) -> None:
        visual = SubElement(self._end, 'visual')
        SubElement(visual, 'origin', xyz=_words(xyz), rpy=_words(rpy))
        words = {key: _words(values) for key, values in size.items()}
        SubElement(SubElement(visual, 'geometry'), shape, words)
        SubElement(visual, 'material', name=material)


def _words(values: Iterable[float]) -> str:
    """Numbers as in a URDF, without the noise in their last digits."""
    return ' '.join(repr(round(float(value), 15) + 0.0) for value in values)

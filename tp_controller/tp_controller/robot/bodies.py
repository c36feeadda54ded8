"""Shapes of an arm's links: given, along the links, or the collision shapes of a URDF."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from xml.etree import ElementTree

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from tp_controller.errors import NO_VALUE, InvalidValue, listed, plural, shown
from tp_controller.robot.model import Robot
from tp_controller.robot.package_files import place_of
from tp_controller.robot.shapes import CAPSULE_WORDS, Shape, capsule, fitted_capsule, read_capsules
from tp_controller.robot.urdf import numbers

Vector = NDArray[np.float64]

LINK_RADIUS = 'robot.link_radius'
CAPSULES = 'robot.capsules.'
"""Beginning of the keys that give links capsules."""

Bodies = Mapping[str, tuple[Shape, ...]]
"""The shapes of every link that has any, in the link's frame; from the base outwards."""


def robot_bodies(
    robot: Robot,
    description: str | None = None,
    link_radius: Sequence[float] | None = None,
    capsules: Mapping[str, Sequence[float]] | None = None,
    read: Callable[[str, Collection[str]], Bodies] | None = None,
) -> Bodies:
    """Shapes of a robot's links.

    Parameters
    ----------
    robot
        The robot.
    description
        Its URDF, if it was built from one: the collision shapes are the bodies. A mesh is
        replaced by a capsule round its vertices.
    link_radius
        Radius [m] of capsules along the links, in place of the description's shapes: one
        value, or one per joint for the link that it moves. A capsule reaches from a link's
        joint to every joint beyond it, that of a last link to its farthest frame; a link of
        no length has none, and neither has what a sliding joint leaves behind.
    capsules
        For links by name, in place of what they would have: seven values a capsule, x y z
        of its start, x y z of its end and its radius [m] in the link's frame.
    read
        Reads the shapes of a description; `described_bodies` when left out.

    Raises
    ------
    InvalidValue
        For a link that the robot does not have, values that make no capsule, or a
        collision shape that cannot be used.
    """
    given = {}
    links = robot_links(robot)
    for link, values in (capsules or {}).items():
        key = f'{CAPSULES}{link}'
        if link not in links:
            raise InvalidValue(key, f'the link {shown(link)}', f'some of {listed(links)}')
        try:
            given[link] = read_capsules(values)
        except InvalidValue as error:
            raise InvalidValue(key, error.got, error.accepts) from None
    if link_radius is not None:
        own: Bodies = _along_links(robot, link_radius)
    else:
        own = {} if description is None else (read or described_bodies)(description, given)
    found = {**own, **given}
    return {link: found[link] for link in links if link in found}


def body_place(robot: Robot, link: str) -> tuple[int, pin.SE3]:
    """Joint that carries a link, 0 for the base, and the link's pose in the joint's frame."""
    if link == robot.base_frame and link not in robot.frames:
        return 0, pin.SE3.Identity()
    frame = robot.model.frames[robot.frame(link).index]
    return frame.parentJoint, frame.placement


def robot_links(robot: Robot) -> tuple[str, ...]:
    """Names of a robot's links, that of the base included, from the base outwards."""
    if robot.base_frame in robot.frames:
        return robot.frames
    return (robot.base_frame, *robot.frames)


def _along_links(robot: Robot, radius: Sequence[float]) -> dict[str, tuple[Shape, ...]]:
    """Capsules from joint to joint."""
    model = robot.model
    count = model.njoints - 1
    if len(radius) not in (1, count):
        accepts = '1 value' if count == 1 else f'1 value or {count}, one per joint'
        raise InvalidValue(
            LINK_RADIUS, f'{plural(len(radius), "value")} {shown(list(radius))}', accepts
        )
    if not all(0.0 < value < math.inf for value in radius):
        raise InvalidValue(LINK_RADIUS, shown(list(radius)), 'numbers above 0')
    bodies = {}
    for joint in range(1, model.njoints):
        carried = [
            (name, model.frames[robot.frame(name).index].placement)
            for name in robot.frames
            if body_place(robot, name)[0] == joint
        ]
        if not carried:
            continue
        ends = [
            model.jointPlacements[other].translation
            for other in range(1, model.njoints)
            if model.parents[other] == joint
        ]
        places = [placement.translation for _, placement in carried]
        ends = ends or [max(places, key=lambda place: float(np.linalg.norm(place)))]
        link, placement = carried[0]
        inside = placement.inverse()
        shapes = tuple(
            capsule(np.zeros(3), end, radius[min(joint, len(radius)) - 1]).moved(inside)
            for end in ends
            if np.linalg.norm(end) > 0.0
        )
        if shapes:
            bodies[link] = shapes
    return bodies


def described_bodies(description: str, without: Collection[str] = ()) -> Bodies:
    """Collision shapes of a description that has been read before, by link.

    Parameters
    ----------
    description
        A URDF that a robot could be made of.
    without
        Links whose shapes are left out.

    Raises
    ------
    InvalidValue
        For a shape that cannot be used.
    """
    bodies = {}
    for link in ElementTree.fromstring(description).findall('link'):
        name = str(link.get('name'))
        if name not in without:
            shapes = _rounded(list(_shapes(name, link)))
            if shapes:
                bodies[name] = tuple(shapes)
    return bodies


def _rounded(shapes: Sequence[Shape]) -> list[Shape]:
    """Shapes with capsules in place of cylinders that have spheres at both ends.

    That is how a URDF says capsule.
    """
    left = list(shapes)
    for shape in shapes:
        if shape.kind != 'cylinder':
            continue
        ends, radius = shape.hull()
        caps, apart = [], 0.0
        for end in ends:
            for other in left:
                off = float(np.linalg.norm(other.pose.translation - end))
                if other.kind == 'sphere' and other.size[0] == radius and off < 0.1 * radius:
                    caps.append(other)
                    apart = max(apart, off)
                    break
        if len(caps) == 2:
            left = [other for other in left if other is not shape and other not in caps]
            left.append(capsule(ends[0], ends[1], radius + apart))
    return left


def _shapes(name: str, link: ElementTree.Element) -> Iterator[Shape]:
    what = f'link {shown(name)} collision'
    for collision in link.findall('collision'):
        kinds = collision.findall('geometry/*')
        if len(kinds) != 1:
            raise _unusable(name, f'{plural(len(kinds), "shape")} in one <collision>')
        origin = collision.find('origin')
        xyz, rpy = (
            np.array(numbers(what, '0 0 0' if origin is None else origin.get(key, '0 0 0'), 3))
            for key in ('xyz', 'rpy')
        )
        pose = pin.SE3(pin.rpy.rpyToMatrix(rpy), xyz)
        yield _shape(name, what, kinds[0]).moved(pose)


def _shape(name: str, what: str, element: ElementTree.Element) -> Shape:
    kind = element.tag
    if kind == 'mesh':
        scale = np.array(numbers(what, element.get('scale', '1 1 1'), 3))
        return fitted_capsule(_vertices(name, element.get('filename', '')) * scale)
    keys = {'box': ['size'], 'sphere': ['radius'], 'cylinder': ['radius', 'length']}
    keys['capsule'] = keys['cylinder']
    if kind not in keys:
        raise _unusable(name, f'a shape <{kind}>')
    size = [
        value
        for key in keys[kind]
        for value in numbers(what, element.get(key, ''), 3 if key == 'size' else 1)
    ]
    if min(size) <= 0.0:
        raise _unusable(name, f'a {kind} of the size {shown(size)}')
    return Shape(kind, tuple(size), pin.SE3.Identity())


def _vertices(name: str, path: str) -> NDArray[np.float64]:
    """Vertices (v, 3) [m] of a mesh."""
    try:
        mesh = coal.MeshLoader().load(str(place_of(path.removeprefix('file://'))))
        vertices = np.array(mesh.vertices(), dtype=float)
    except (InvalidValue, ValueError):
        vertices = np.zeros((0, 3))
    if not len(vertices) or not np.all(np.isfinite(vertices)):
        raise _unusable(name, f'the mesh {shown(path)}, which cannot be read')
    return vertices


def _unusable(name: str, got: str) -> InvalidValue:
    return InvalidValue(
        f'{CAPSULES}{name}',
        f'{NO_VALUE}, and in the URDF {got}',
        f'{CAPSULE_WORDS}; or {LINK_RADIUS} for all links',
    )

"""Arms from a URDF description.

Pinocchio computes the kinematics. What it would answer with a bare exception, or with lines
on the terminal, is looked for first, so that a user gets one line with the reason.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from tp_controller.errors import InvalidValue, listed, shown
from tp_controller.robot.frames import Coupling, coupled
from tp_controller.robot.limits import Limits
from tp_controller.robot.model import Robot
from tp_controller.robot.motions import BASE, FIXED, FLOATING, PLANAR, SCALAR, WORLD, check_base
from tp_controller.robot.package_files import KEY
from tp_controller.robot.space import Space

Vector = NDArray[np.float64]

LONGEST_URDF = 10_000_000
"""Length of a description [characters] that is read."""
SCALARS = ('revolute', 'continuous', 'prismatic')
MOVABLE = (*SCALARS, PLANAR, FLOATING)
TYPES = (*MOVABLE, 'fixed')
KINEMATIC = ('parent', 'child', 'origin', 'axis', 'limit')
UNLIMITED = 1e9
"""Limits of at least this size [rad, m, rad/s, m/s] count as none: URDF requires a number."""


class _Joint(NamedTuple):
    """What the controller needs to know of a joint of a URDF."""

    type: str
    parent: str
    child: str
    limits: dict[str, float]
    mimic: tuple[str, float, float] | None
    """Name of the joint that it follows, multiplier and offset."""


def urdf_robot(
    text: str,
    joints: Sequence[str] | None = None,
    base_frame: str | None = None,
    limits: Mapping[str, Sequence[float] | None] | None = None,
    rest_positions: Mapping[str, float] | None = None,
    base: str = FIXED,
) -> Robot:
    """Build the kinematic model of a URDF; its links are the frames. Meshes are not read.

    Parameters
    ----------
    text
        The description.
    joints
        Controlled joints (n,), in the order of commands; all movable ones that mimic no
        other when left out. Continuous joints count whole turns as nothing.
    base_frame
        Link that everything is expressed in, rigidly connected to the root; the root when
        left out. With a base that moves, the name of the frame that it moves in; ``odom`` when
        left out.
    limits
        Limits in place of the description's, see `Limits`; those of the base first.
    rest_positions
        Positions [rad, m] of joints that are not controlled; zero when left out. Planar and
        floating ones rest at their origin.
    base
        What the root stands on, one of `BASES`: by a joint ``base``, whose velocities come first.

    Raises
    ------
    InvalidValue
        If the description is not one, or has not the joints or links asked for.
    """
    check_base(base)
    root, found = _read(text, base, base_frame)
    leaders = [name for name, j in found.items() if j.type in MOVABLE and j.mimic is None]
    if not leaders:
        raise InvalidValue(KEY, 'a robot without a movable joint', 'one or more movable joints')
    front = [] if base == FIXED else [BASE]
    own_joints = [name for name in leaders if name not in front]
    joints = own_joints if joints is None else list(joints)
    for name in joints:
        if name not in own_joints:
            what = 'which mimics another' if name in found and found[name].mimic else ''
            raise InvalidValue(
                'robot.joints', f'{shown(name)} {what}'.strip(), f'some of {listed(own_joints)}'
            )
    joints = [*front, *joints]
    rest = dict(rest_positions or {})
    for name in rest:
        if name not in leaders or name in joints or found[name].type not in SCALARS:
            free = [
                leader
                for leader in leaders
                if leader not in joints and found[leader].type in SCALARS
            ]
            raise InvalidValue('robot.rest_positions', shown(name), f'some of {listed(free)}')
    try:
        model = pin.buildModelFromXML(ElementTree.tostring(root, encoding='unicode'))
    except ValueError:
        raise InvalidValue(KEY, 'a text that Pinocchio cannot read', 'a URDF') from None
    space = Space(
        joints,
        [base if name == BASE and front else _kind(found[name]) for name in joints],
        [found[name].type == 'continuous' for name in joints],
    )
    model, coupling = _coupled(model, found, space, rest)
    base_frame = base_frame if base_frame is not None else _root_link(found, root)
    _move_base(model, base_frame)
    own = _limits(found, space, limits or {})
    lines = [
        (joint.parent, joint.child)
        for joint in found.values()
        if joint.type not in (PLANAR, FLOATING)
    ]
    return Robot(model, space, base_frame, own, coupling, lines)


def _kind(joint: _Joint) -> str:
    return SCALAR if joint.type in SCALARS else joint.type


def _put_on_base(root: ElementTree.Element, base: str, frame: str) -> None:
    """Let the root link of a description move in a frame, by a joint in front of it."""
    children = {child.get('link') for child in root.iterfind('joint/child')}
    link = next(
        (link.get('name') for link in root.findall('link') if link.get('name') not in children),
        None,
    )
    ElementTree.SubElement(root, 'link', name=frame)
    kind = FLOATING if base == FLOATING else PLANAR
    joint = ElementTree.SubElement(root, 'joint', name=BASE, type=kind)
    ElementTree.SubElement(joint, 'parent', link=frame)
    ElementTree.SubElement(joint, 'child', link=str(link))


def _read(
    text: str, base: str, base_frame: str | None
) -> tuple[ElementTree.Element, dict[str, _Joint]]:
    """Kinematic part of a description: the elements for Pinocchio, and the joints by name."""
    if len(text) > LONGEST_URDF:
        accepts = f'a URDF of up to {LONGEST_URDF} characters'
        raise InvalidValue(KEY, f'{len(text)} characters', accepts)
    try:
        root = ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        raise InvalidValue(KEY, f'malformed XML ({error})', 'a URDF') from None
    if root.tag != 'robot':
        raise InvalidValue(KEY, f'a document <{root.tag}>', 'a URDF, <robot>')
    if not root.get('name'):
        root.set('name', 'robot')
    if base != FIXED:
        _put_on_base(root, base, WORLD if base_frame is None else base_frame)
    links = [link.get('name') for link in root.findall('link')]
    joints: dict[str, _Joint] = {}
    for element in root.findall('joint'):
        name = element.get('name')
        if not name or name in joints:
            raise InvalidValue(
                KEY, f'a joint named {shown(name)}', 'every joint with its own name'
            )
        joints[name] = _joint(name, element, links)
    if not links or len(set(links)) != len(links):
        raise InvalidValue(KEY, f'links {shown(links)}', 'every link with its own name')
    _check_tree(joints, links)
    # Geometry is not needed; a continuous joint is a revolute one that counts its turns.
    for child in list(root):
        if child.tag not in ('link', 'joint'):
            root.remove(child)
    for link in root.findall('link'):
        for part in list(link):
            link.remove(part)
    for element in root.findall('joint'):
        if element.get('type') == 'continuous':
            element.set('type', 'revolute')
            for limit in element.findall('limit'):
                element.remove(limit)
        if element.get('type') in (PLANAR, FLOATING):
            for part in element.findall('limit') + element.findall('axis'):
                element.remove(part)
            continue
        if element.get('type') != 'fixed' and element.find('limit') is None:
            ElementTree.SubElement(element, 'limit', lower='-1e9', upper='1e9')
        for limit in element.findall('limit'):
            limit.set('effort', '0')
            limit.set('velocity', limit.get('velocity', '0'))
        for part in list(element):
            if part.tag not in KINEMATIC:
                element.remove(part)
    return root, joints


def _joint(name: str, element: ElementTree.Element, links: Sequence[str | None]) -> _Joint:
    kind = element.get('type', '')
    if kind not in TYPES:
        raise InvalidValue(KEY, f'joint {shown(name)} of type {shown(kind)}', listed(TYPES))
    ends = []
    for tag in ('parent', 'child'):
        end = element.find(tag)
        link = end.get('link') if end is not None else None
        if link not in links:
            raise InvalidValue(
                KEY, f'joint {shown(name)} with {tag} {shown(link)}', 'the name of a link'
            )
        ends.append(str(link))
    origin = element.find('origin')
    for attribute in ('xyz', 'rpy'):
        if origin is not None and origin.get(attribute) is not None:
            numbers(f'joint {shown(name)} origin', str(origin.get(attribute)), 3)
    axis = element.find('axis')
    direction = '1 0 0' if axis is None else axis.get('xyz', '')
    if kind in SCALARS and not any(numbers(f'joint {shown(name)} axis', direction, 3)):
        raise InvalidValue(KEY, f'joint {shown(name)} axis {shown(direction)}', 'a direction')
    if kind == PLANAR and axis is not None:
        # Tools take the plane for x and y, whatever the axis.
        x, y, z = numbers(f'joint {shown(name)} axis', direction, 3)
        if x or y or not z > 0.0:
            got = f'planar joint {shown(name)} axis {shown(direction)}'
            raise InvalidValue(KEY, got, '0 0 1, or no axis')
    limit = element.find('limit')
    limits = {
        key: numbers(f'joint {shown(name)} limit', value, 1)[0]
        for key, value in (limit.attrib if limit is not None else {}).items()
        if key in ('lower', 'upper', 'velocity')
    }
    if (
        kind in ('continuous', PLANAR, FLOATING)
        or limits.get('lower', 0.0) == limits.get('upper', 0.0) == 0.0
    ):
        limits.pop('lower', None)
        limits.pop('upper', None)
    if limits.get('velocity', 0.0) <= 0.0:
        limits.pop('velocity', None)
    limits = {key: value for key, value in limits.items() if abs(value) < UNLIMITED}
    mimic = element.find('mimic') if kind in SCALARS else None
    follows = None
    if mimic is not None:
        multiplier, offset = (
            numbers(f'joint {shown(name)} mimic', mimic.get(key, default), 1)[0]
            for key, default in (('multiplier', '1'), ('offset', '0'))
        )
        follows = (mimic.get('joint', ''), multiplier, offset)
    return _Joint(kind, ends[0], ends[1], limits, follows)


def numbers(what: str, text: str, count: int) -> list[float]:
    """Numbers of an attribute.

    Raises
    ------
    InvalidValue
        If it is anything else than that many finite numbers.
    """
    try:
        # Python takes 1_0 for a number, URDF does not.
        values = [float(word) for word in text.replace('_', '?').split()]
    except ValueError:
        values = []
    if len(values) != count or not all(math.isfinite(value) for value in values):
        raise InvalidValue(KEY, f'{what} {shown(text)}', f'{count} finite numbers')
    return values


def _check_tree(joints: Mapping[str, _Joint], links: Sequence[str | None]) -> None:
    parents: dict[str, str] = {}
    for name, joint in joints.items():
        if joint.child in parents:
            raise InvalidValue(KEY, f'{shown(joint.child)} as a child twice', 'a tree of links')
        parents[joint.child] = joint.parent
        if joint.mimic is not None:
            leader = joints.get(joint.mimic[0])
            if leader is None or leader.type not in SCALARS or leader.mimic is not None:
                raise InvalidValue(
                    KEY,
                    f'joint {shown(name)} mimicking {shown(joint.mimic[0])}',
                    'the name of a movable joint that mimics no other',
                )
    roots = [link for link in links if link not in parents]
    reached = set(roots)
    while True:
        more = {c for c, p in parents.items() if p in reached} - reached
        if not more:
            break
        reached |= more
    if len(roots) != 1 or len(reached) != len(links):
        raise InvalidValue(KEY, f'links with the roots {shown(roots)}', 'one tree of links')


def _root_link(joints: Mapping[str, _Joint], root: ElementTree.Element) -> str:
    children = {joint.child for joint in joints.values()}
    return next(
        str(link.get('name')) for link in root.findall('link') if link.get('name') not in children
    )


def _coupled(
    model: pin.Model, found: Mapping[str, _Joint], space: Space, rest: Mapping[str, float]
) -> tuple[pin.Model, Coupling | None]:
    """Model with the other joints locked, and how its joints follow the controlled ones."""
    locked = []
    reference = pin.neutral(model)
    followers = {}
    for name, joint in found.items():
        if joint.type not in MOVABLE:
            continue
        leader, multiplier, offset = joint.mimic or (name, 1.0, 0.0)
        if leader in space.joints:
            followers[name] = (leader, multiplier, offset)
            continue
        index = model.getJointId(name)
        locked.append(index)
        if joint.type in SCALARS:
            reference[model.joints[index].idx_q] = multiplier * rest.get(leader, 0.0) + offset
    if locked:
        model = pin.buildReducedModel(model, locked, reference)
    return model, coupled(model, space, followers)


def _move_base(model: pin.Model, base_frame: str) -> None:
    """Express a model in a link that is rigidly connected to its root."""
    links = [frame for frame in model.frames if frame.type == pin.BODY]
    found = [frame for frame in links if frame.name == base_frame and frame.parentJoint == 0]
    if not found:
        rigid = [frame.name for frame in links if frame.parentJoint == 0]
        raise InvalidValue('robot.base_frame', shown(base_frame), f'one of {listed(rigid)}')
    shift = pin.SE3(found[0].placement).inverse()
    for index in range(1, model.njoints):
        if model.parents[index] == 0:
            model.jointPlacements[index] = shift * model.jointPlacements[index]
    for frame in model.frames:
        if frame.parentJoint == 0:
            frame.placement = shift * frame.placement


def _limits(
    found: Mapping[str, _Joint], space: Space, instead: Mapping[str, Sequence[float] | None]
) -> Limits:
    """Limits of the description, those of mimic joints included, replaced by what is given."""
    names = space.joints
    joints = [found[name] for name in names]
    limits = Limits(space.nv, ranged=space.ranged)
    speed = _column(joints, 'velocity', math.inf)
    low, high = _column(joints, 'lower', -math.inf), _column(joints, 'upper', math.inf)
    for follower in found.values():
        if follower.mimic is None or follower.mimic[0] not in names or not follower.mimic[1]:
            continue
        leader, multiplier, offset = follower.mimic
        i, own = names.index(leader), follower.limits
        speed[i] = min(speed[i], own.get('velocity', math.inf) / abs(multiplier))
        ends = sorted(
            (own.get(key, absent) - offset) / multiplier
            for key, absent in (('lower', -math.inf), ('upper', math.inf))
        )
        # A follower whose range does not overlap with the leader's has a mistaken one.
        if max(low[i], ends[0]) < min(high[i], ends[1]):
            low[i], high[i] = max(low[i], ends[0]), min(high[i], ends[1])
    speed, low, high = (space.spread(column) for column in (speed, low, high))
    for column in (speed, low, high):
        column.flags.writeable = False
    limits.velocity, limits.position_min, limits.position_max = speed, low, high
    return limits.replaced(**instead)


def _column(joints: Sequence[_Joint], key: str, absent: float) -> Vector:
    return np.array([joint.limits.get(key, absent) for joint in joints])

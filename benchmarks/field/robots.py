"""Robots of the comparison as URDF text that every side can read.

Meshes and everything else that has no part in kinematics is taken out. Shapes are spheres on
links, because every library of the comparison reads them.
"""

import copy
import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from tp_controller.robot import read_description

PANDA = 'package://example-robot-data/robots/panda_description/urdf/panda.urdf'
HAND = 'panda_hand_tcp'
UNLIMITED = 1e9
"""Stands for no limit, because URDF requires a number."""
KEPT = ('link', 'joint')
NAMES = {'link': ('name',), 'joint': ('name',), 'parent': ('link',), 'child': ('link',)}
"""Attributes that are names, by element."""
SPHERES = {
    'panda_link2': [(0.0, -0.06, 0.0, 0.09), (0.0, -0.17, 0.0, 0.08)],
    'panda_link3': [(0.0, 0.0, -0.07, 0.08), (0.08, 0.04, 0.0, 0.075)],
    'panda_link4': [(-0.05, 0.05, 0.0, 0.08), (-0.08, 0.14, 0.02, 0.075)],
    'panda_link5': [(0.0, 0.03, -0.2, 0.075), (0.0, 0.07, -0.09, 0.07)],
    'panda_link6': [(0.06, 0.0, 0.0, 0.09)],
    'panda_hand': [(0.0, -0.06, 0.02, 0.05), (0.0, 0.06, 0.02, 0.05)],
}
"""Spheres around the links of the Panda: centre and radius [m] in the link's frame."""


class Arm(NamedTuple):
    """A robot and how its joints are called."""

    urdf: str
    joints: tuple[str, ...]


def panda(shapes: Mapping[str, Sequence[tuple[float, ...]]] | None = None) -> Arm:
    """Panda without fingers; with spheres (x, y, z, radius) [m] on some of its links."""
    robot = Element('robot', name='panda')
    robot.extend(_panda_parts())
    for link in robot.iter('link'):
        for sphere in (shapes or {}).get(link.get('name', ''), ()):
            link.append(collision('sphere', sphere[:3], radius=sphere[3]))
    return Arm(_text(robot), tuple(f'panda_joint{i + 1}' for i in range(7)))


def two_pandas() -> Arm:
    """Upper body of 14 joints: two Pandas that lean outwards on one post."""
    robot = Element('robot', name='upper_body')
    SubElement(robot, 'link', name='body')
    joints: list[str] = []
    for side, sign in (('left_', 1.0), ('right_', -1.0)):
        for part in _panda_parts():
            for element in part.iter():
                for key in NAMES.get(element.tag, ()):
                    element.set(key, side + str(element.get(key)))
            robot.append(part)
        shoulder = {'xyz': f'0 {0.15 * sign} 0.8', 'rpy': f'{-0.8 * sign} 0 0'}
        _joint(robot, f'{side}shoulder', 'fixed', 'body', f'{side}panda_link0', shoulder)
        joints += [f'{side}panda_joint{i + 1}' for i in range(7)]
    return Arm(_text(robot), tuple(joints))


def planar(n: int = 3, length: float = 0.5) -> Arm:
    """Planar arm of ``n`` equal links; its last frame is ``tip``."""
    along = {'xyz': f'{length} 0 0'}
    origins: list[dict[str, str]] = [{}, *([along] * (n - 1))]
    return _chain('planar', origins, along)


def spatial(n: int, seed: int = 0) -> Arm:
    """Random chain of ``n`` turning joints, about 1.5 m long; its last frame is ``tip``."""
    random = np.random.default_rng(seed)
    origins = []
    for _ in range(n):
        xyz = random.uniform(0.2, 1.0, 3) * 2.0 / n
        turn = random.choice([0.0, math.pi / 2, -math.pi / 2])
        origins.append({'xyz': ' '.join(f'{x:.6f}' for x in xyz), 'rpy': f'{turn:.6f} 0 0'})
    return _chain('chain', origins, {'xyz': '0.05 0 0'})


def bare(urdf: str, limits: Mapping[str, tuple[float, float, float]]) -> Arm:
    """Return an arm without shapes whose joints have these ends and speeds; others are held.

    Parameters
    ----------
    urdf
        Description.
    limits
        Lower and upper end [rad] and speed [rad/s] by joint, in the order of the joints;
        infinite ends become so wide that they count as none.
    """
    robot = Element('robot', name='arm')
    for part in ElementTree.fromstring(urdf):
        if part.tag not in KEPT:
            continue
        kept = copy.deepcopy(part)
        for tag in ('visual', 'collision', 'safety_controller', 'dynamics', 'mimic'):
            for element in kept.findall(tag):
                kept.remove(element)
        if kept.tag == 'joint' and kept.get('type') != 'fixed':
            ends = limits.get(str(kept.get('name')))
            kept.set('type', 'fixed' if ends is None else 'revolute')
            for element in kept.findall('limit'):
                kept.remove(element)
            if ends is not None:
                lower, upper, speed = (str(min(max(x, -UNLIMITED), UNLIMITED)) for x in ends)
                values = {'lower': lower, 'upper': upper, 'velocity': speed, 'effort': '100'}
                SubElement(kept, 'limit', values)
        robot.append(kept)
    return Arm(_text(robot), tuple(limits))


def without_limits(arm: Arm) -> Arm:
    """Return the same arm with limits so wide that they count as none."""
    robot = ElementTree.fromstring(arm.urdf)
    for limit in robot.iter('limit'):
        for key, value in (('lower', -1), ('upper', 1), ('velocity', 1)):
            limit.set(key, str(value * UNLIMITED))
    return Arm(_text(robot), arm.joints)


def write_with_world(urdf: str, world: Sequence[Mapping[str, Any]], path: Path) -> None:
    """Write a URDF whose root link has the shapes of the surroundings as links."""
    robot = ElementTree.fromstring(urdf)
    children = {child.get('link') for child in robot.iter('child')}
    root = next(
        str(link.get('name')) for link in robot.iter('link') if link.get('name') not in children
    )
    for shape in world:
        link = SubElement(robot, 'link', name=shape['name'])
        size = {key: shape[key] for key in ('radius', 'size') if key in shape}
        link.append(collision(shape['shape'], (0.0, 0.0, 0.0), **size))
        origin = {'xyz': ' '.join(map(str, shape['center']))}
        _joint(robot, f'{shape["name"]}_joint', 'fixed', root, shape['name'], origin)
    path.write_text(_text(robot), encoding='utf-8')


def collision(shape: str, center: Sequence[float], **size: Any) -> Element:
    """Collision element of a sphere or a box."""
    element = Element('collision')
    SubElement(element, 'origin', xyz=' '.join(map(str, center)))
    values = {
        key: str(value) if np.isscalar(value) else ' '.join(map(str, value))
        for key, value in size.items()
    }
    SubElement(SubElement(element, 'geometry'), shape, values)
    return element


def _panda_parts() -> Iterator[Element]:
    """Links and joints of the Panda, without fingers and without shapes."""
    for part in ElementTree.fromstring(read_description(PANDA)):
        if part.tag not in KEPT or 'finger' in str(part.get('name')):
            continue
        kept = copy.deepcopy(part)
        for tag in ('visual', 'collision', 'safety_controller', 'dynamics'):
            for element in kept.findall(tag):
                kept.remove(element)
        yield kept


def _chain(name: str, origins: Sequence[Mapping[str, str]], last: Mapping[str, str]) -> Arm:
    robot = Element('robot', name=name)
    SubElement(robot, 'link', name='base')
    before, joints = 'base', []
    for i, origin in enumerate(origins):
        link = f'link_{i + 1}'
        _link(robot, link)
        joints.append(f'joint_{i + 1}')
        joint = _joint(robot, joints[-1], 'revolute', before, link, origin)
        SubElement(joint, 'axis', xyz='0 0 1')
        SubElement(joint, 'limit', lower='-2.5', upper='2.5', velocity='2.0', effort='100')
        before = link
    _link(robot, 'tip')
    _joint(robot, 'tip_joint', 'fixed', before, 'tip', last)
    return Arm(_text(robot), tuple(joints))


def _link(robot: Element, name: str) -> None:
    """Add a link with some mass: MuJoCo simulates, too, and refuses links without any."""
    inertial = SubElement(SubElement(robot, 'link', name=name), 'inertial')
    SubElement(inertial, 'mass', value='1')
    moments = {'ixx': '0.01', 'iyy': '0.01', 'izz': '0.01'}
    SubElement(inertial, 'inertia', moments, ixy='0', ixz='0', iyz='0')


def _joint(
    robot: Element, name: str, kind: str, parent: str, child: str, origin: Mapping[str, str]
) -> Element:
    joint = SubElement(robot, 'joint', name=name, type=kind)
    SubElement(joint, 'origin', {'xyz': '0 0 0', 'rpy': '0 0 0'} | dict(origin))
    SubElement(joint, 'parent', link=parent)
    SubElement(joint, 'child', link=child)
    return joint


def _text(robot: Element) -> str:
    return ElementTree.tostring(robot, encoding='unicode')

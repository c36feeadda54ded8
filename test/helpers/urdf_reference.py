"""Random URDF trees, and a reader of them that shares nothing with the library."""

from xml.etree import ElementTree

import numpy as np
from hypothesis import strategies as st

TYPES = ('revolute', 'continuous', 'prismatic', 'fixed')
number = st.floats(-1.0, 1.0).map(lambda value: round(value, 4))
angle = st.floats(-3.0, 3.0).map(lambda value: round(value, 4))
AXES = [(1, 0, 0), (0, 1, 0), (0, 0, 1), (0, 0, -1), (1, 1, 0), (0.5, -2, 1)]


def words(values):
    return ' '.join(str(value) for value in values)


@st.composite
def descriptions(draw):
    """URDF of a tree with 1 to 9 joints, one of them at least movable, and a few mimics."""
    count = draw(st.integers(1, 9))
    # Names whose alphabetical order is not that of the tree.
    names = draw(st.permutations([f'joint_{chr(97 + i)}' for i in range(count)]))
    robot = ElementTree.Element('robot', name='random')
    ElementTree.SubElement(robot, 'link', name='link_0')
    leaders = []
    for i, name in enumerate(names):
        ElementTree.SubElement(robot, 'link', name=f'link_{i + 1}')
        kind = draw(st.sampled_from(TYPES if leaders or i < count - 1 else TYPES[:3]))
        joint = ElementTree.SubElement(robot, 'joint', name=name, type=kind)
        parent = draw(st.integers(max(0, i - 2), i))
        ElementTree.SubElement(joint, 'parent', link=f'link_{parent}')
        ElementTree.SubElement(joint, 'child', link=f'link_{i + 1}')
        xyz, rpy = draw(st.tuples(number, number, number)), draw(st.tuples(angle, angle, angle))
        ElementTree.SubElement(joint, 'origin', xyz=words(xyz), rpy=words(rpy))
        if kind == 'fixed':
            continue
        ElementTree.SubElement(joint, 'axis', xyz=words(draw(st.sampled_from(AXES))))
        if kind != 'continuous':
            ElementTree.SubElement(joint, 'limit', lower='-2', upper='3', velocity='1.5')
        if leaders and draw(st.integers(0, 3)) == 0:
            leader = draw(st.sampled_from(leaders))
            ElementTree.SubElement(joint, 'mimic', joint=leader, multiplier='-0.5', offset='0.2')
        else:
            leaders.append(name)
    return ElementTree.tostring(robot, encoding='unicode'), leaders


def rotation(axis, angle):
    """Rotation matrices (..., 3, 3) about an axis (3,) by angles (...), by Rodrigues' formula."""
    x, y, z = np.asarray(axis, dtype=float) / np.linalg.norm(axis)
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    angle = np.asarray(angle)[..., None, None]
    return np.eye(3) + np.sin(angle) * K + (1.0 - np.cos(angle)) * K @ K


def joint_elements(text):
    """Joint elements by the name of their child link, parents before children."""
    left = {j.find('child').get('link'): j for j in ElementTree.fromstring(text).findall('joint')}
    ordered = {}
    while left:
        for child, joint in list(left.items()):
            if joint.find('parent').get('link') not in left:
                ordered[child] = left.pop(child)
    return ordered


def attribute(joint, tag, name, default):
    """Numbers of an attribute of a part of a joint."""
    part = joint.find(tag)
    text = default if part is None else part.get(name, default)
    return np.array([float(word) for word in text.split()])


def unit_axis(joint):
    axis = attribute(joint, 'axis', 'xyz', '1 0 0')
    return axis / np.linalg.norm(axis)


def leader_of(joint):
    """Name of the joint whose position moves this one, the multiplier and the offset."""
    mimic = joint.find('mimic')
    if mimic is None:
        return joint.get('name'), 1.0, 0.0
    return (
        mimic.get('joint'),
        float(mimic.get('multiplier', '1')),
        float(mimic.get('offset', '0')),
    )


def poses(text, positions):
    """Pose (..., 4, 4) of every link in the root link.

    The joints are at ``positions`` by name, numbers or arrays (...) of one shape; at zero
    when not named.
    """
    joints = joint_elements(text)
    shape = np.broadcast_shapes(*(np.shape(position) for position in positions.values()))
    links = [link.get('name') for link in ElementTree.fromstring(text).findall('link')]
    result = {link: np.zeros((*shape, 4, 4)) + np.eye(4) for link in links if link not in joints}
    for child, joint in joints.items():
        T = np.zeros((*shape, 4, 4)) + np.eye(4)
        roll, pitch, yaw = attribute(joint, 'origin', 'rpy', '0 0 0')
        T[..., :3, :3] = (
            rotation([0, 0, 1], yaw) @ rotation([0, 1, 0], pitch) @ rotation([1, 0, 0], roll)
        )
        T[..., :3, 3] = attribute(joint, 'origin', 'xyz', '0 0 0')
        if joint.get('type') != 'fixed':
            leader, multiplier, offset = leader_of(joint)
            position = multiplier * np.asarray(positions.get(leader, 0.0)) + offset
            motion = np.zeros((*shape, 4, 4)) + np.eye(4)
            if joint.get('type') == 'prismatic':
                motion[..., :3, 3] = position[..., None] * unit_axis(joint)
            else:
                motion[..., :3, :3] = rotation(unit_axis(joint), position)
            T = T @ motion
        result[child] = result[joint.find('parent').get('link')] @ T
    return result


def jacobian(text, poses, link, names):
    """Jacobian (..., 6, n) of the twist [v; ω] of a link, from the poses of all links.

    A column is the velocity that a unit speed of the named joint gives: about an axis z
    through o a point p moves with z × (p - o), along the axis with z.
    """
    joints = joint_elements(text)
    p = poses[link][..., :3, 3]
    J = np.zeros((*p.shape[:-1], 6, len(names)))
    while link in joints:
        joint = joints[link]
        leader, multiplier, _ = leader_of(joint)
        if joint.get('type') != 'fixed' and leader in names:
            # Turning about its axis or sliding along it, a joint leaves the axis as it is.
            z = multiplier * (poses[link][..., :3, :3] @ unit_axis(joint))
            column = J[..., names.index(leader)]
            if joint.get('type') == 'prismatic':
                column[..., :3] += z
            else:
                column[..., :3] += np.cross(z, p - poses[link][..., :3, 3])
                column[..., 3:] += z
        link = joint.find('parent').get('link')
    return J

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
    """Rotation matrix by Rodrigues' formula."""
    x, y, z = np.asarray(axis, dtype=float) / np.linalg.norm(axis)
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * K + (1.0 - np.cos(angle)) * K @ K


def poses(text, positions):
    """Pose (4, 4) of every link in the root link, with the joints at positions by name."""
    root = ElementTree.fromstring(text)
    result = {'link_0': np.eye(4)}
    joints = {joint.get('name'): joint for joint in root.findall('joint')}
    # The generator writes every parent before its children.
    for name, joint in joints.items():
        origin = joint.find('origin')
        roll, pitch, yaw = map(float, origin.get('rpy').split())
        T = np.eye(4)
        T[:3, :3] = rotation([0, 0, 1], yaw) @ rotation([0, 1, 0], pitch)
        T[:3, :3] = T[:3, :3] @ rotation([1, 0, 0], roll)
        T[:3, 3] = [float(word) for word in origin.get('xyz').split()]
        if joint.get('type') != 'fixed':
            mimic = joint.find('mimic')
            position = positions.get(name, 0.0)
            if mimic is not None:
                leader = positions.get(mimic.get('joint'), 0.0)
                position = float(mimic.get('multiplier')) * leader + float(mimic.get('offset'))
            axis = np.array([float(word) for word in joint.find('axis').get('xyz').split()])
            motion = np.eye(4)
            if joint.get('type') == 'prismatic':
                motion[:3, 3] = axis / np.linalg.norm(axis) * position
            else:
                motion[:3, :3] = rotation(axis, position)
            T = T @ motion
        parent = joint.find('parent').get('link')
        result[joint.find('child').get('link')] = result[parent] @ T
    return result

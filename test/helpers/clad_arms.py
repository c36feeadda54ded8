"""Hypothesis strategies for arms with capsules on their links, and for obstacles."""

import numpy as np
import pinocchio as pin
from hypothesis import strategies as st
from random_stacks import arms, planar_arms, positive_vectors, vectors
from references import dh_poses, rotation
from small_arms import robot_of
from urdf_reference import descriptions, poses

from tp_controller.robot import Limits, Shape, urdf_robot

SIZES = {'sphere': 1, 'cylinder': 2, 'box': 3, 'half_space': 0}


def matrix(turn, place):
    """Pose (4, 4) of a rotation vector and a point."""
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation(turn), place
    return pose


@st.composite
def obstacles(draw, kinds=tuple(SIZES)):
    kind = draw(st.sampled_from(kinds))
    size = tuple(draw(positive_vectors(SIZES[kind], 0.1, 0.8)))
    return (kind, size), matrix(draw(vectors(3, 3)), draw(vectors(3, 2)))


def shape_of(obstacle):
    (kind, size), pose = obstacle
    return Shape(kind, size, pin.SE3(pose))


@st.composite
def capsules(draw, links):
    """Parameter ``capsules`` for some of the links, at least two of them if there are."""
    some = draw(st.lists(st.sampled_from(links), min_size=min(2, len(links)), unique=True))
    return {
        link: draw(vectors(6, 0.5)) + draw(positive_vectors(1, 0.02, 0.2))
        for link in sorted(some, key=links.index)
    }


@st.composite
def clad_arms(draw):
    """A robot, its capsules by link, and a function from q to the poses of its links."""
    kind = draw(st.sampled_from(['spatial', 'planar', 'tree']))
    if kind == 'tree':
        text, joints = draw(descriptions())
        robot = urdf_robot(text, joints)

        def places(q):
            return poses(text, dict(zip(joints, q, strict=True)))
    else:
        block = draw(arms(2, 6) if kind == 'spatial' else planar_arms(2, 6))
        robot = robot_of(block)

        def places(q):
            found = dh_poses(block['dh'], q)
            return {f'link_{i + 1}': pose for i, pose in enumerate(found)}

    robot.limits = Limits(robot.n, position_min=[-5.0], position_max=[5.0])
    return robot, draw(capsules(list(robot.frames))), places

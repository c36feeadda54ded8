"""Arms of known shape, as parameter dictionaries and as robots."""

import math

from tp_controller.robot import DHParameters, dh_robot


def planar_block(*lengths):
    """Block ``robot`` of a planar arm with revolute joints."""
    n = len(lengths)
    zeros = [0.0] * n
    return {
        'joints': [f'joint_{i + 1}' for i in range(n)],
        'dh': {
            'theta': zeros,
            'd': zeros,
            'a': list(lengths),
            'alpha': zeros,
            'types': ['revolute'] * n,
        },
    }


def wrist_block():
    """Block ``robot`` of a wrist with a short tool; R = Rz(q1) Ry(q2) Rz(q3)."""
    half = math.pi / 2
    zeros = [0.0] * 3
    return {
        'joints': ['roll', 'pitch', 'yaw'],
        'dh': {
            'theta': zeros,
            'd': zeros,
            'a': [0.0, 0.0, 0.3],
            'alpha': [-half, half, 0.0],
            'types': ['revolute'] * 3,
        },
    }


def robot_of(block):
    return dh_robot(block['joints'], DHParameters(**block['dh']))


def planar_robot(*lengths):
    return robot_of(planar_block(*lengths))


def wrist():
    return robot_of(wrist_block())

"""The arm of the fault table: planar, three joints, limits of speed, acceleration and range."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from tp_sim.faults.judge import STILL, Allowed

JOINTS = ('joint_1', 'joint_2', 'joint_3')
LENGTHS = (0.75, 0.5, 0.5)
START = (0.0, 0.6, 0.3)
ELSEWHERE = (1.2, -0.9, 0.8)
GOALS = ((0.3, 1.2), (1.0, 0.5), (1.1, -0.6))
"""Positions of the end [m]; from each to the next one the arm moves at full speed."""
RATE, SPEED, ACCELERATION = 200.0, 1.0, 4.0
OLDEST, HOLD = 0.1, 0.3
"""``timeouts.joint_state`` and ``command_timeout`` [s].

The driver waits longer than the controller, and than the arm needs to brake: else the arm would
stop at once, and then move on with the commands of braking.
"""


def parameters(start: Sequence[float] = START, rate: float = RATE) -> dict[str, Any]:
    """Parameters of both nodes, as `tp_sim.harness.read_document` has them."""
    return {
        '/**': {
            'rate': rate,
            'robot': {
                'joints': list(JOINTS),
                'dh': {
                    'theta': [0.0] * 3,
                    'd': [0.0] * 3,
                    'a': list(LENGTHS),
                    'alpha': [0.0] * 3,
                    'types': ['revolute'] * 3,
                },
                'limits': {
                    'velocity': [SPEED],
                    'acceleration': [ACCELERATION],
                    'position_min': [-3.0],
                    'position_max': [3.0],
                },
            },
        },
        'tp_sim': {'initial_positions': list(start), 'command_timeout': HOLD},
        'tp_controller': {
            'timeouts': {'joint_state': OLDEST},
            'hierarchy': ['ee_position', 'posture'],
            'tasks': {
                'ee_position': {
                    'type': 'position',
                    'frame': 'link_3',
                    'axes': 'xy',
                    'gain': [4.0],
                },
                'posture': {'type': 'posture'},
            },
        },
    }


def allowed(rate: float = RATE) -> Allowed:
    """What may be sent to it."""
    return Allowed(
        np.full(3, SPEED), np.full(3, ACCELERATION), 1.0 / rate, oldest=OLDEST, hold=HOLD
    )


def moves(velocity: Sequence[float]) -> bool:
    """Whether a joint velocity (3,) [rad/s] is more than rounding."""
    return bool(np.max(np.abs(velocity)) > STILL * SPEED)


def end_position(q: Sequence[float]) -> np.ndarray:
    """Position (2,) of the end [m] at joint positions (3,) [rad]."""
    angles = np.cumsum(q)
    lengths = np.array(LENGTHS)
    return np.array([lengths @ np.cos(angles), lengths @ np.sin(angles)])

"""Arms with delay, lag and noise, by the real nodes in real time."""

import numpy as np
from sensor_msgs.msg import JointState

from tp_sim.harness import ClosedLoop

RATE = 100.0
RADIUS = 0.2
BALL = {
    'type': 'obstacle',
    'frame': 'link_3',
    'axes': 'xy',
    'center': [5.0, 5.0],
    'radius': RADIUS,
}
CHANGES = {
    '/**': {
        'rate': RATE,
        'command': {'type': 'joint_state'},
        'robot': {
            'limits': {'velocity': [1.0], 'acceleration': [2.0]},
            'delay': 2 / RATE,
            'lag': 0.02,
            'noise': 5e-4,
            'hold': 0.03,
        },
    },
    'tp_sim': {'plant': {'delay': 2, 'lag': [0.02], 'noise': [5e-4]}},
    'tp_controller': {
        'start': 'hold',
        # Joint states do not stop because the machine is busy.
        'timeouts': {'joint_state': 60.0},
        'hierarchy': ['ball', 'ee_position', 'joint_1_position'],
        'tasks': {'ball': BALL},
    },
}


def test_a_late_arm_leaves_an_obstacle_that_came_into_it(config):
    with ClosedLoop(config / 'a4_position_joint.yaml', CHANGES, lockstep=False) as loop:
        client = loop.client
        commands = client.collect(JointState, 'joint_velocity_command')
        client.wait_for(lambda: len(commands) > 0, 'commands')
        aside = np.array([0.5 * RADIUS, 0.0])
        center = client.task('ee_position').current + aside
        loop.send_goal('ball', center.tolist())

        def distance():
            return np.linalg.norm(client.task('ee_position').current - center)

        assert distance() < 0.75 * RADIUS
        client.wait_for(lambda: distance() > RADIUS, 'the way out')

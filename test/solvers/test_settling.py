"""Goals that cannot be had end in rest, and bounds do not break priorities."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from random_stacks import arms, examples, parameters, planar_arms, states
from small_arms import planar_block

from tp_controller import build_settings
from tp_controller.config import read_parameter_file

SECONDS, WATCHED = 5.0, 3.0
STEP = 1e-6


def out_of_reach(scheme, damping):
    return {
        'rate': 100.0,
        'robot': planar_block(0.75, 0.5, 0.5) | {'limits': {'velocity': [4.0]}},
        'solver': scheme | {'damping': damping},
        'hierarchy': ['hand', 'first'],
        'tasks': {
            'hand': {'type': 'position', 'frame': 'link_3', 'axes': 'xy', 'target': [1.0, 2.3]},
            'first': {'type': 'joint', 'joints': ['joint_1'], 'target': [0.0], 'gain': [3.0]},
        },
    }


def chase(block, q, seconds):
    """Shares of the velocity limits (steps, n) of every command."""
    stack = build_settings(block).stack
    period, shares = 1.0 / block['rate'], []
    for _ in range(round(seconds / period)):
        command = stack.step(q).command
        shares.append(command / stack.robot.limits.velocity)
        q = q + period * command
    return np.array(shares)


@pytest.mark.parametrize(
    ('scheme', 'damping'),
    [
        ({'saturation': 'uniform'}, 0.1),
        ({'saturation': 'null_space'}, 0.0),
        ({'saturation': 'null_space'}, 0.1),
        ({'type': 'hqp'}, 0.1),
    ],
    ids=['uniform', 'pinv', 'dls', 'hqp'],
)
def test_a_goal_out_of_reach_ends_in_rest(scheme, damping):
    block = out_of_reach(scheme, damping)
    block['tasks']['hand']['gain'] = [3.0]
    assert_at_rest(chase(block, np.array([0.0, 0.6, 0.3]), SECONDS + WATCHED), block['rate'])


def assert_at_rest(shares, rate):
    later = shares[round(SECONDS * rate) :]
    assert np.abs(later).max() < 1e-3
    signs = np.sign(np.where(np.abs(later) > 1e-9, later, 0.0))
    assert np.count_nonzero(signs[1:] * signs[:-1] < 0.0) <= 2


@pytest.mark.parametrize(
    'target',
    [[0.3, 0.87], [1.5, 1.2], [-0.5, 0.3], [0.4, -1.9]],
    ids=['inside', 'beyond', 'behind', 'aside'],
)
def test_the_program_rests_where_ranges_stop_levels(target):
    """Three levels, of which the ends of ranges and one-sided rows leave little."""
    ends = {'frame': 'link_3', 'gain': [3.0]}
    block = {
        'rate': 100.0,
        'robot': planar_block(0.75, 0.5, 0.5),
        'solver': {'type': 'hqp'},
        'hierarchy': ['ends', 'hand', 'turn', 'first'],
        'tasks': {
            'ends': {'type': 'joint_limits', 'joints': ['joint_3'], 'max': [0.8], 'min': [-0.5]},
            'hand': {'type': 'position', 'axes': 'xy', 'target': target, **ends},
            'turn': {'type': 'orientation', 'axes': 'z', 'target': [0.3], **ends},
            'first': {'type': 'joint', 'joints': ['joint_1'], 'target': [0.0], 'gain': [2.0]},
        },
    }
    block['robot']['limits'] = {
        'velocity': [2.0],
        'acceleration': [20.0],
        'position_min': [-0.4, -0.2, -3.0],
        'position_max': [0.7, 0.9, 3.0],
    }
    assert_at_rest(chase(block, np.array([0.3, 0.6, 0.3]), SECONDS + WATCHED), block['rate'])


@pytest.mark.parametrize('goal', [(0.35, -0.98, -0.78), (-0.66, -1.1, -0.21), (0.8, -1.01, 0.16)])
def test_the_program_rests_on_a_real_arm(config, goal):
    values = read_parameter_file(config / 'panda.yaml', 'tp_controller')
    values |= {
        'solver.type': 'hqp',
        'tasks.hand_position.target': list(goal),
        'robot.limits.acceleration': [30.0],
    }
    q = np.array([0.0, -0.6, 0.0, -2.0, 0.0, 1.6, 0.8])
    shares = chase(values, q, SECONDS + WATCHED)
    assert_at_rest(shares, values['rate'])


@pytest.mark.parametrize('goal', [(-0.96, 1.52, -0.87), (-0.41, 1.84, -0.67)])
def test_the_program_rests_where_the_level_above_misses_a_little(goal):
    """Two hands hold an object, which damping lets give way a little while one cannot reach."""
    left, right = 'left_gripper_base_link', 'right_gripper_base_link'
    elbows = [0.0, -0.55, 0.0, 0.75, 0.0, 1.26, 0.0]
    sides = ('s0', 's1', 'e0', 'e1', 'w0', 'w1', 'w2')
    hand = {'type': 'position', 'frame': right, 'gain': [3.0], 'target': goal}
    block = {
        'rate': 100.0,
        'robot': {
            'urdf': 'package://example-robot-data/robots/baxter_description/urdf/baxter.urdf',
            'joints': [f'{side}_{joint}' for side in ('left', 'right') for joint in sides],
        },
        'solver': {'type': 'hqp'},
        'hierarchy': ['object', 'hand', 'posture'],
        'tasks': {
            'object': {'type': 'pose', 'frame': left, 'relative_to': right, 'gain': [3.0]},
            'hand': hand,
            'posture': {'type': 'posture', 'target': elbows * 2, 'gain': [2.0]},
        },
    }
    shares = chase(block, np.array(elbows * 2), 10.0 + WATCHED)
    assert_at_rest(shares[round((10.0 - SECONDS) * block['rate']) :], block['rate'])


def test_the_published_laws_alone_reverse_at_every_step_there():
    """What settling is for; with settling on, the same run is the one above."""
    block = out_of_reach({'settle': False, 'saturation': 'uniform'}, 0.1)
    block['tasks']['hand']['gain'] = [3.0]
    later = chase(block, np.array([0.0, 0.6, 0.3]), 10.0)[-100:]
    assert np.abs(later).max() > 0.5
    assert np.count_nonzero(later[1:] * later[:-1] < 0.0) > 50


@given(parameters(robots=arms(min_joints=2) | planar_arms(min_joints=2), max_levels=3), st.data())
@examples(40)
def test_second_derivatives_are_those_of_the_jacobians(block, data):
    """Symmetric parts, by central differences; rotations apart, whose rows are no gradients."""
    stack = build_settings(block).stack
    q = data.draw(states(stack.robot.n))
    for task in stack.tasks.values():
        if task.type != 'position':
            continue
        hessian = np.zeros((task.k, stack.robot.n, stack.robot.n))
        stack.robot.update(q)
        task.update()
        task.hessian(hessian)
        for i in range(stack.robot.n):
            columns = []
            for sign in (1.0, -1.0):
                away = q.copy()
                away[i] += sign * STEP
                stack.robot.update(away)
                task.update()
                columns.append(task.J.copy())
            slope = (columns[0] - columns[1]) / (2.0 * STEP)
            np.testing.assert_allclose(hessian[:, :, i], slope, atol=1e-6)
        sizes = np.linalg.norm(hessian, 2, axis=(1, 2))
        assert np.all(sizes <= task.bend * (1.0 + 1e-9))


@given(parameters(robots=arms(min_joints=2) | planar_arms(min_joints=2), max_levels=3), st.data())
@examples(40)
def test_second_derivatives_that_are_known_beforehand_change_no_bit(block, data):
    """They are filled when they first count, and from then on before the resolution."""
    stack, other = (build_settings(block).stack for _ in range(2))
    q = data.draw(states(stack.robot.n))
    for _ in range(3):
        if other.solver._set is not None:
            other.solver._set._needed[0] = 1.0
        command = stack.step(q).command
        assert command.tobytes() == other.step(q).command.tobytes()
        q = q + 0.01 * command


def test_settling_adds_nothing_where_every_level_gets_what_it_asks_for(config):
    values = read_parameter_file(config / 'panda.yaml', 'tp_controller')
    values |= {'hierarchy': ['hand_position', 'hand_orientation']}
    settled, plain = build_settings(values).stack, build_settings(values).stack
    plain.settle = False
    robot, rng, compared = plain.robot, np.random.default_rng(2), 0
    for _ in range(200):
        q = rng.uniform(robot.limits.position_min, robot.limits.position_max)
        there = q + rng.uniform(-0.02, 0.02, robot.n)
        commands = []
        for stack in (plain, settled):
            stack.robot.update(there)
            for task in stack.tasks.values():
                task.hold()
            stack.rest()
            commands.append(stack.step(q).command.copy())
        J = [plain.tasks[name].J for name in plain.hierarchy]
        _, s, Vt = np.linalg.svd(J[0])
        least = min(s[-1], np.linalg.svd(J[1] @ Vt[3:].T, compute_uv=False)[-1])
        if least > 0.15:
            compared += 1
            np.testing.assert_array_equal(commands[1], commands[0])
    assert compared > 50


@pytest.mark.parametrize('limit', [20.0, 5.0, 2.0, 0.5])
@pytest.mark.parametrize(
    ('scheme', 'inverse'), [('recursive', 'dls'), ('recursive', 'adaptive'), ('hqp', 'adaptive')]
)
def test_lower_levels_cost_higher_ones_nothing_at_any_limit(config, limit, scheme, inverse):
    """Three levels on the Panda, moving already, at limits of speed, acceleration and range."""
    values = read_parameter_file(config / 'panda.yaml', 'tp_controller')
    values |= {
        'solver.type': scheme,
        'solver.inverse': inverse,
        'robot.limits.velocity': [limit],
        'robot.limits.acceleration': [4.0 * limit],
    }
    rng = np.random.default_rng(1)
    stacks = [
        build_settings(values | {'hierarchy': values['hierarchy'][:count]}).stack
        for count in (1, 2, 3)
    ]
    robot = stacks[0].robot
    for _ in range(150):
        q = rng.uniform(robot.limits.position_min, robot.limits.position_max)
        before = rng.uniform(-0.5, 0.5, robot.n) * limit
        targets = {
            'hand_position': rng.normal(size=3),
            'hand_orientation': rng.normal(size=4),
            'posture': rng.normal(size=robot.n),
        }
        got = []
        for stack in stacks:
            for name, target in targets.items():
                stack.tasks[name].target = target
            stack.rest()
            # The velocity that acceleration limits start from.
            stack.safety_filter._before[:] = before
            got.append([level.achieved.copy() for level in stack.step(q).levels])
        for fewer, more in pairwise(got):
            for alone, together in zip(fewer, more, strict=False):
                size = max(1.0, float(np.abs(alone).max()))
                assert np.abs(together - alone).max() <= 1e-6 * size


@pytest.mark.parametrize(
    'scheme', [{'type': 'recursive'}, {'type': 'hqp'}], ids=['recursive', 'hqp']
)
@pytest.mark.parametrize('angle', [1.0, 2.0, 2.8])
def test_a_rotation_that_cannot_be_had_converges_at_its_gain(scheme, angle):
    """One joint turns about z, the target is turned mostly about another axis."""
    axis = np.array([0.95, 0.0, np.sqrt(1.0 - 0.95**2)])
    block = {
        'rate': 100.0,
        'robot': planar_block(0.5) | {'limits': {'acceleration': [20.0]}},
        'solver': scheme,
        'hierarchy': ['turn'],
        'tasks': {
            'turn': {
                'type': 'orientation',
                'frame': 'link_1',
                'target': [*np.sin(angle / 2.0) * axis, np.cos(angle / 2.0)],
                'gain': [3.0],
            }
        },
    }
    stack, q, commands = build_settings(block).stack, np.zeros(1), []
    for _ in range(300):
        commands.append(float(stack.step(q).command[0]))
        q = q + 0.01 * commands[-1]
    # The best that one joint can do: the quaternion's twist about z.
    best = 2.0 * np.arctan2(np.sin(angle / 2.0) * axis[2], np.cos(angle / 2.0))
    assert abs(q[0] - best) < 1e-3
    rate = -np.log(commands[200] / commands[150]) / 0.5
    assert 2.8 < rate < 3.4

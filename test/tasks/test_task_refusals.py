import numpy as np
import pytest
from small_arms import planar_robot, wrist

from tp_controller import InvalidValue
from tp_controller.robot import Robot
from tp_controller.tasks import JointTask, OrientationTask, PoseTask, PositionTask

NAN, INF = float('nan'), float('inf')
MATRIX = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]


def task_of(kind):
    robot = wrist()
    return {
        'position': lambda: PositionTask('t', robot, 'link_3', 'xyz'),
        'angle': lambda: OrientationTask('t', robot, 'link_3', 'z'),
        'rotation': lambda: OrientationTask('t', robot, 'link_3', 'xyz'),
        'pose': lambda: PoseTask('t', robot, 'link_3', 'x', 'xy'),
        'joint': lambda: JointTask('t', robot, ['roll', 'yaw']),
    }[kind]()


GOOD = {
    'position': {'target': [1.0, 2.0, 3.0], 'gain': MATRIX, 'feedforward': [0.1, 0.2, 0.3]},
    'angle': {'target': [1.0], 'gain': [2.0], 'feedforward': [0.1]},
    'rotation': {'target': [0.6, 0.0, 0.0, 0.8], 'gain': [2.0], 'feedforward': [0.1, 0.2, 0.3]},
    'pose': {
        'target': [1.0, 0.6, 0.0, 0.0, 0.8],
        'gain': [2.0, 3.0, 4.0],
        'feedforward': [0.1, 0.2, 0.3],
    },
    'joint': {'target': [1.0, 2.0], 'gain': [2.0, 3.0], 'feedforward': [0.1, 0.2]},
}

REFUSED = [
    ('position', 'target', [1.0, 2.0], '3 values (position per axis [m])'),
    ('position', 'target', [], '3 values'),
    ('position', 'target', [1.0, 2.0, 3.0, 4.0], '3 values'),
    ('position', 'target', [1.0, NAN, 3.0], 'finite numbers'),
    ('position', 'target', [1.0, INF, 3.0], 'finite numbers'),
    ('position', 'target', [1.0, -INF, 3.0], 'finite numbers'),
    ('angle', 'target', [0.0, 0.0, 0.0, 1.0], '1 value (angle [rad])'),
    ('angle', 'target', [NAN], 'finite numbers'),
    ('rotation', 'target', [1.0], '4 values (quaternion x y z w)'),
    ('rotation', 'target', [0.0, 0.0, 0.0, 0.0], 'a quaternion that is not zero'),
    ('rotation', 'target', [0.0, 0.0, NAN, 1.0], 'finite numbers'),
    ('rotation', 'target', [0.0, 0.0, INF, 1.0], 'finite numbers'),
    ('pose', 'target', [1.0, 0.5], 'position per axis [m], then quaternion x y z w'),
    ('pose', 'target', [1.0, 0.0, 0.0, 0.0, 0.0], 'a quaternion that is not zero'),
    ('pose', 'target', [NAN, 0.0, 0.0, 0.0, 1.0], 'finite numbers'),
    ('pose', 'target', [1.0, 0.0, 0.0, 0.0, INF], 'finite numbers'),
    ('joint', 'target', [1.0, 2.0, 3.0], '2 values (position per joint [rad, m])'),
    ('joint', 'target', [1.0, NAN], 'finite numbers'),
    ('position', 'gain', [], '1, 3 or 9 values'),
    ('position', 'gain', [1.0, 1.0], '1, 3 or 9 values'),
    ('position', 'gain', [1.0] * 4, '1, 3 or 9 values'),
    ('position', 'gain', [1.0] * 8, 'a 3x3 matrix row by row'),
    ('position', 'gain', [NAN], 'finite numbers'),
    ('position', 'gain', [1.0, INF, 1.0], 'finite numbers'),
    ('position', 'gain', [-1.0], 'values of at least 0'),
    ('position', 'gain', [1.0, -1e-6, 1.0], 'values of at least 0'),
    ('position', 'gain', [1.0, 3.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0], 'a positive matrix'),
    ('position', 'gain', [-value for value in MATRIX], 'a positive matrix'),
    ('angle', 'gain', [1.0, 1.0], '1 value'),
    ('angle', 'gain', [-1.0], 'values of at least 0'),
    ('position', 'feedforward', [1.0], '3 values (x, y, z)'),
    ('rotation', 'feedforward', [1.0, 1.0, 1.0, 1.0], '3 values (rx, ry, rz)'),
    ('pose', 'feedforward', [1.0, 1.0], '3 values (x, rx, ry)'),
    ('pose', 'feedforward', [1.0, 1.0, NAN], 'finite numbers'),
    ('joint', 'feedforward', [1.0], '2 values (roll, yaw)'),
    ('joint', 'feedforward', [1.0, INF], 'finite numbers'),
    ('position', 'target', [1.0, 2.0, 3e9], 'numbers up to 1e+09 in size'),
    ('pose', 'target', [-1e300, 0.0, 0.0, 0.0, 1.0], 'numbers up to 1e+09 in size'),
    ('angle', 'target', [1e300], 'numbers up to 1e+09 in size'),
    ('joint', 'target', [1.0, 3e9], 'numbers up to 1e+09 in size'),
    ('position', 'feedforward', [0.0, 1e300, 0.0], 'numbers up to 1e+09 in size'),
    ('joint', 'feedforward', [0.0, -3e9], 'numbers up to 1e+09 in size'),
]


@pytest.mark.parametrize(('kind', 'name', 'values', 'accepts'), REFUSED)
@pytest.mark.parametrize('form', [list, np.array])
def test_a_bad_value_is_refused_and_nothing_changes(kind, name, values, accepts, form):
    task = task_of(kind)
    for good, value in GOOD[kind].items():
        setattr(task, good, value)
    state = settings_of(task)
    with pytest.raises(InvalidValue) as caught:
        setattr(task, name, form(values))
    assert caught.value.key == name
    assert accepts in caught.value.accepts
    for before, after in zip(state, settings_of(task), strict=True):
        np.testing.assert_array_equal(before, after)


def settings_of(task):
    """All that counts of a task: its settings and what follows from them."""
    task.robot.update(np.array([0.3, 0.7, -0.4]))
    task.update()
    velocity = np.empty(task.k)
    task.desired_velocity(velocity)
    return task.target, task.gain, task.feedforward, task.error.copy(), velocity


@pytest.mark.parametrize('name', ['target', 'gain', 'feedforward'])
def test_a_check_alone_changes_nothing(name):
    task = task_of('pose')
    task.target = [0.0, 0.0, 0.0, 0.0, 1.0]
    before = getattr(task, name)
    getattr(task, f'check_{name}')(GOOD['pose'][name])
    np.testing.assert_array_equal(getattr(task, name), before)


def test_a_wrong_number_of_values_is_told_with_the_values():
    with pytest.raises(InvalidValue) as caught:
        task_of('position').target = [1.5, 2.5]
    assert caught.value.got == '2 values [1.5, 2.5]'


@pytest.mark.parametrize(
    'make',
    [
        lambda robot: PositionTask('t', robot, 'link_4'),
        lambda robot: OrientationTask('t', robot, 'link_4'),
        lambda robot: PoseTask('t', robot, 'link_4'),
    ],
)
def test_an_unknown_frame_is_refused_with_the_known_frames(make):
    with pytest.raises(InvalidValue) as caught:
        make(wrist())
    assert caught.value.key == 'frame'
    assert "'link_4'" in caught.value.got
    assert caught.value.accepts == 'one of link_1, link_2, link_3'


@pytest.mark.parametrize('axes', ['', 'w', 'xw', 'xx', 'XY', 'x y', 'x,y', 'zyxz'])
@pytest.mark.parametrize(
    ('key', 'make'),
    [
        ('axes', lambda robot, axes: PositionTask('t', robot, 'link_3', axes)),
        ('axes', lambda robot, axes: OrientationTask('t', robot, 'link_3', axes)),
        ('position_axes', lambda robot, axes: PoseTask('t', robot, 'link_3', axes, 'z')),
        ('orientation_axes', lambda robot, axes: PoseTask('t', robot, 'link_3', 'xy', axes)),
    ],
)
def test_axes_are_letters_out_of_xyz_each_at_most_once(key, make, axes):
    with pytest.raises(InvalidValue, match='letters out of xyz') as caught:
        make(wrist(), axes)
    assert caught.value.key == key
    assert repr(axes) in caught.value.got


@pytest.mark.parametrize(
    ('joints', 'got', 'accepts'),
    [
        ([], 'no joint', 'some of roll, pitch, yaw'),
        (['elbow'], "'elbow'", 'some of roll, pitch, yaw'),
        (['roll', 'roll'], "['roll', 'roll']", 'every joint once'),
    ],
)
def test_a_joint_task_needs_known_joints_each_once(joints, got, accepts):
    with pytest.raises(InvalidValue) as caught:
        JointTask('t', wrist(), joints)
    assert (caught.value.key, caught.value.got, caught.value.accepts) == ('joints', got, accepts)


@pytest.mark.parametrize(
    ('names', 'changes', 'accepts'),
    [
        ([], [], 'one value for each name'),
        (['roll'], [1.0, 2.0], 'one value for each name'),
        (['roll', 'yaw'], [1.0], 'one value for each name'),
        (['roll', 'roll'], [1.0, 2.0], 'one value for each name'),
        (['pitch'], [1.0], 'some of roll, yaw'),
    ],
)
def test_changes_of_joints_need_one_value_for_each_name_of_the_task(names, changes, accepts):
    with pytest.raises(InvalidValue) as caught:
        task_of('joint').with_joints(np.zeros(2), names, changes)
    assert caught.value.key == 'joints'
    assert accepts in caught.value.accepts
    assert 'roll, yaw' in caught.value.accepts
    assert '1 names' not in caught.value.got
    assert '1 values' not in caught.value.got


def test_joints_whose_names_begin_with_q_are_no_quaternions():
    robot = Robot(planar_robot(1.0, 1.0).model, ['q1', 'qx'])
    task = JointTask('t', robot, ['qx', 'q1'])
    with pytest.raises(InvalidValue, match='numbers up to 1e'):
        task.target = [1e300, 0.0]


def test_the_size_of_a_quaternion_does_not_count():
    task = task_of('rotation')
    task.target = [3e200, 0.0, 0.0, 4e200]
    np.testing.assert_allclose(task.target, [0.6, 0.0, 0.0, 0.8])

import pytest

from tp_controller import InvalidValue
from tp_controller.robot import DHParameters, Limits, dh_robot

JOINTS = ('shoulder', 'elbow')
DH = {
    'theta': [0.0, 0.0],
    'd': [0.0, 0.0],
    'a': [1.0, 1.0],
    'alpha': [0.0, 0.0],
    'types': ['revolute', 'prismatic'],
    'base_pose': [0.0] * 6,
}


def arm(joints=JOINTS, base_frame='base', **changes):
    return dh_robot(joints, DHParameters(**DH | changes), base_frame)


@pytest.mark.parametrize('key', ['theta', 'd', 'a', 'alpha', 'types'])
@pytest.mark.parametrize('count', [0, 1, 3])
def test_a_dh_list_of_the_wrong_length_is_refused_by_its_key(key, count):
    with pytest.raises(InvalidValue) as caught:
        arm(**{key: [*DH[key], DH[key][0]][:count]})
    assert caught.value.key == f'robot.dh.{key}'
    assert f'{count} value' in caught.value.got
    assert caught.value.accepts == '2 values (one per joint of robot.joints)'


@pytest.mark.parametrize('count', [0, 3, 5, 7])
def test_a_base_pose_needs_six_values(count):
    with pytest.raises(InvalidValue, match='roll pitch yaw') as caught:
        arm(base_pose=[0.0] * count)
    assert caught.value.key == 'robot.dh.base_pose'
    assert caught.value.accepts.startswith('6 values')


def test_an_unknown_joint_type_is_refused_with_the_known_ones():
    with pytest.raises(InvalidValue) as caught:
        arm(types=['revolute', 'helical'])
    assert caught.value.key == 'robot.dh.types'
    assert "'helical'" in caught.value.got
    assert caught.value.accepts == 'revolute, prismatic'


def test_joints_need_different_names():
    with pytest.raises(InvalidValue) as caught:
        arm(joints=('elbow', 'elbow'))
    assert caught.value.key == 'robot.joints'
    assert 'every joint once' in caught.value.accepts


def test_an_arm_needs_a_joint():
    with pytest.raises(InvalidValue) as caught:
        arm(joints=(), **{key: [] for key in DH if key != 'base_pose'})
    assert caught.value.key == 'robot.joints'


def test_the_base_frame_cannot_have_the_name_of_a_link():
    with pytest.raises(InvalidValue) as caught:
        arm(base_frame='link_2')
    assert caught.value.key == 'robot.base_frame'
    assert 'link_1, link_2' in caught.value.accepts


@pytest.mark.parametrize('name', ['link_3', 'link_0', 'base', ''])
def test_an_unknown_frame_is_refused_with_the_known_ones(name):
    with pytest.raises(InvalidValue) as caught:
        arm().frame(name)
    assert repr(name) in caught.value.got
    assert caught.value.accepts == 'one of link_1, link_2'


def test_an_unknown_joint_is_refused_with_the_known_ones():
    with pytest.raises(InvalidValue) as caught:
        arm().joint_indices(['elbow', 'wrist'])
    assert "'wrist'" in caught.value.got
    assert caught.value.accepts == 'some of shoulder, elbow'


def test_a_joint_named_twice_is_refused():
    with pytest.raises(InvalidValue, match='every joint once'):
        arm().joint_indices(['elbow', 'elbow'])


def test_joint_indices_follow_the_order_asked_for():
    assert arm().joint_indices(['elbow', 'shoulder']) == [1, 0]


@pytest.mark.parametrize('key', Limits.KEYS)
@pytest.mark.parametrize('values', [[], [1.0, 1.0], [1.0] * 4])
def test_a_limit_needs_one_value_or_one_per_joint(key, values):
    with pytest.raises(InvalidValue) as caught:
        Limits(3, **{key: values})
    assert caught.value.key == f'robot.limits.{key}'
    assert f'{len(values)} value' in caught.value.got
    assert caught.value.accepts.startswith('1 value or 3')


@pytest.mark.parametrize('key', Limits.KEYS)
@pytest.mark.parametrize('value', [float('nan'), float('inf'), float('-inf')])
def test_a_limit_that_is_given_is_finite(key, value):
    with pytest.raises(InvalidValue) as caught:
        Limits(2, **{key: [1.0, value]})
    assert caught.value.key == f'robot.limits.{key}'


@pytest.mark.parametrize('key', ['velocity', 'acceleration'])
@pytest.mark.parametrize('value', [0.0, -1.0])
def test_a_limit_on_a_magnitude_is_above_zero(key, value):
    with pytest.raises(InvalidValue, match='above 0') as caught:
        Limits(2, **{key: [1.0, value]})
    assert caught.value.key == f'robot.limits.{key}'


@pytest.mark.parametrize('low', [1.0, 1.5])
def test_a_position_range_is_not_empty(low):
    with pytest.raises(InvalidValue) as caught:
        Limits(2, position_min=[0.0, low], position_max=[1.0])
    assert caught.value.key == 'robot.limits.position_min'
    assert 'position_max [1.0, 1.0]' in caught.value.got

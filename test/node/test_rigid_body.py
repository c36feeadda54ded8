"""Joints of rigid bodies with velocity servos."""

import numpy as np
import pinocchio as pin
import pytest

from tp_controller import read_parameter_file
from tp_controller.config import build_robot, describe_robot
from tp_controller.errors import InvalidValue
from tp_controller.robot import Limits, dh_robot, read_description, urdf_robot
from tp_controller.robot.description import dh_description
from tp_controller.robot.dh import DHParameters
from tp_sim.plant import Plant
from tp_sim.plant_settings import PlantSettings
from tp_sim.rigid_body import RigidBodies, ServoSettings
from tp_sim.settings import read_simulator_parameters

UR5 = 'package://example-robot-data/robots/ur_description/urdf/ur5_robot.urdf'
H = 1e-3
PENDULUM = """<robot name="pendulum"><link name="base"/><link name="rod"><inertial>
<origin xyz="0 0 -0.5"/><mass value="2"/>
<inertia ixx="0.1" iyy="0.1" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="hinge" type="revolute"><parent link="base"/><child link="rod"/><axis xyz="0 1 0"/>
<limit lower="-2" upper="2" velocity="5" effort="{effort}"/></joint></robot>"""
INERTIA = 0.1 + 2.0 * 0.5**2
"""Of the pendulum about its hinge."""


def pendulum(urdf_effort=0.0, q=0.0, text=PENDULUM, **settings):
    text = text.format(effort=urdf_effort)
    settings = {'rotor_inertia': 0.0, 'bandwidth': 100.0, **settings}
    return RigidBodies(urdf_robot(text), text, [q], ServoSettings(**settings))


def arm(config, name, **settings):
    values = read_simulator_parameters(read_parameter_file(config / f'{name}.yaml', 'tp_sim'))
    robot = build_robot(values)
    start = values['initial_positions'] or [0.0] * robot.n
    return RigidBodies(robot, describe_robot(values), start, ServoSettings(**settings))


def test_without_torque_the_arm_falls_as_pinocchio_says():
    text = read_description(UR5)
    model = pin.buildModelFromXML(text)
    q = np.random.default_rng(0).uniform(-1.0, 1.0, model.nq)
    settings = ServoSettings(rotor_inertia=0.0, effort=1e-9)
    joints = RigidBodies(urdf_robot(text), text, q, settings)
    joints.step(np.zeros(model.nv), H)
    expected = pin.aba(model, model.createData(), q, np.zeros(model.nv), np.zeros(model.nv))
    assert joints.qd / H == pytest.approx(expected, abs=1e-5)


@pytest.mark.parametrize('base', ['rod', 'tilted'])
def test_gravity_points_down_in_the_root_whatever_the_base_frame_is(base):
    extra = """<link name="tilted"/><joint name="tilt" type="fixed"><parent link="base"/>
    <child link="tilted"/><origin rpy="1.2 0.3 0" xyz="0.1 0.2 0.3"/></joint></robot>"""
    text = PENDULUM.format(effort=0).replace('</robot>', extra)
    robot = urdf_robot(text, base_frame='base' if base == 'rod' else base)
    joints = RigidBodies(robot, text, [0.3], ServoSettings(rotor_inertia=0.0, effort=1e-9))
    joints.step(np.zeros(1), H)
    assert joints.qd / H == pytest.approx(-2.0 * 9.81 * 0.5 * np.sin(0.3) / INERTIA)


def test_one_joint_alone_follows_with_the_bandwidth():
    joints = pendulum(bandwidth=50.0, q=1.0)
    speeds = []
    for _ in range(100):
        joints.step(np.array([0.5]), H)
        speeds.append(joints.qd[0])
    k = np.arange(1, 101)
    assert np.array(speeds) == pytest.approx(0.5 * (1.0 - (1.0 + 50.0 * H) ** -k))
    # That is the lag of 1 / bandwidth but for the step of integration.
    assert np.array(speeds) == pytest.approx(0.5 * (1.0 - np.exp(-50.0 * H * k)), abs=5e-3)


def test_torque_is_limited_by_the_effort_of_the_urdf():
    joints = pendulum(urdf_effort=12.0)
    joints.step(np.array([5.0]), H)
    # It hangs straight down: no torque of gravity.
    assert joints.qd / H == pytest.approx(12.0 / INERTIA)
    assert pendulum(effort=3.0, urdf_effort=12.0)._effort == [3.0]
    too_weak = pendulum(urdf_effort=5.0, q=1.0)
    for _ in range(300):
        too_weak.step(np.zeros(1), H)
    assert too_weak.q[0] < 0.9


@pytest.mark.parametrize('friction', ['viscous_friction', 'coulomb_friction'])
def test_the_integral_part_overcomes_friction(friction):
    def end(**settings):
        joints = pendulum(**settings)
        for _ in range(1000):
            joints.step(np.array([0.3]), H)
        return joints.qd[0]

    loss = 3.0
    expected = {
        'viscous_friction': 0.3 * 100.0 * INERTIA / (100.0 * INERTIA + loss),
        'coulomb_friction': 0.3 - loss / (100.0 * INERTIA),
    }
    assert end(integral=0.0, **{friction: loss}) == pytest.approx(expected[friction], rel=1e-6)
    assert end(**{friction: loss}) == pytest.approx(0.3, rel=1e-3)
    assert end() == pytest.approx(0.3, rel=1e-9)


def test_coulomb_friction_holds_a_joint_that_is_pulled_less():
    stuck = pendulum(effort=1e-9, q=0.1, coulomb_friction=2.0)
    free = pendulum(effort=1e-9, q=0.1, coulomb_friction=0.5)
    for _ in range(200):
        stuck.step(np.zeros(1), H)
        free.step(np.zeros(1), H)
    assert abs(stuck.qd[0]) < 1e-3
    assert abs(free.qd[0]) > 0.05


@pytest.mark.parametrize('name', ['panda', 'ur5', 'kinova'])
@pytest.mark.parametrize('friction', [0.0, 1.0])
def test_real_arms_follow_without_tuning(config, name, friction):
    joints = arm(config, name, viscous_friction=friction, coulomb_friction=friction)
    speed = 0.3 * joints.limits.velocity
    trace = []
    # A tenth of a second to get fast: the wrists of the UR5 have no more torque than for that.
    ramp = np.minimum(1.0, np.arange(1, 101) / 20)
    for share in np.concatenate([ramp, 1.0 - ramp]):
        joints.step(share * speed, 0.005)
        trace.append(joints.qd / speed)
    trace = np.array(trace)
    assert np.all(trace[60:100] > 0.9)
    assert trace.max() < 1.1
    assert np.abs(trace[160:]).max() < 0.05
    behind = (0.5 * speed - (joints.q - arm(config, name).q)) / speed
    assert np.abs(behind).max() < 0.05


@pytest.mark.parametrize('name', ['panda', 'ur5', 'kinova'])
def test_the_lag_that_an_arm_names_bounds_what_it_lags_behind(config, name):
    joints = arm(config, name)
    lag, start, t = joints.lag, joints.q, 0.1
    speed = 0.05 * joints.limits.velocity
    for _ in range(20):
        joints.step(speed, t / 20)
    behind = t - (joints.q - start) / speed
    assert np.all(behind > 0.0)
    assert np.all(behind < 1.1 * lag)


def test_ends_of_ranges_stop_a_joint_dead_or_do_not_exist():
    text = PENDULUM.format(effort=0)
    for stops, end in ((True, 2.0), (False, 2.45)):
        joints = RigidBodies(urdf_robot(text), text, [1.5], ServoSettings(), stops)
        for _ in range(500):
            joints.step(np.array([2.0]), H)
        assert joints.q[0] == 2.0 if stops else joints.q[0] > end
        assert bool(joints.qd[0]) != stops


def test_a_high_bandwidth_and_long_steps_stay_stable(config):
    joints = arm(config, 'panda', bandwidth=1e4, coulomb_friction=5.0)
    speed = 0.2 * joints.limits.velocity
    for _ in range(20):
        joints.step(speed, 0.05)
    assert joints.qd == pytest.approx(speed, rel=0.02)


def test_the_same_commands_give_the_same_motion_after_a_reset(config):
    plant = Plant(arm(config, 'panda'), PlantSettings(delay=1, lag=0.01))
    ends = []
    for _ in range(2):
        plant.reset()
        for _ in range(20):
            plant.step(0.2 * plant.joints.limits.velocity, 0.005)
        ends.append(np.concatenate([plant.q, plant.qd]))
    assert np.array_equal(ends[0], ends[1])
    plant.blocked = True
    plant.step(np.ones(7), 0.005)
    assert np.array_equal(plant.q, ends[0][:7])


def test_an_arm_without_masses_is_refused():
    dh = DHParameters([0.0] * 2, [0.0] * 2, [1.0] * 2, [0.0] * 2, ['revolute'] * 2)
    text = dh_description(['a', 'b'], dh)
    with pytest.raises(InvalidValue, match='move no mass \\(a, b\\); accepts kinematic, or'):
        RigidBodies(dh_robot(['a', 'b'], dh, None, Limits(2)), text, [0.0, 0.0])


@pytest.mark.parametrize(
    ('old', 'new', 'reason'),
    [
        ('value="2"', 'value="-2"', 'a mass of -2 kg'),
        ('value="2"', 'value="heavy"', 'finite numbers'),
        ('iyy="0.1"', 'iyy="-9"', 'a body can have'),
    ],
)
def test_inertias_that_no_body_has_are_refused(old, new, reason):
    with pytest.raises(InvalidValue, match=reason) as caught:
        pendulum(text=PENDULUM.replace(old, new))
    assert caught.value.key == 'robot.urdf'


@pytest.mark.parametrize(
    ('key', 'value'),
    [('bandwidth', 0.0), ('effort', [0.0]), ('rotor_inertia', [1.0, 2.0]), ('effort', -1.0)],
)
def test_servos_that_cannot_be_are_refused(key, value):
    with pytest.raises(InvalidValue) as caught:
        pendulum(**{key: value})
    assert caught.value.key == f'plant.{key}'

"""Configuration spaces: integrate, difference and Jacobians of robots whose base moves."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from poses import arm_pose, full_twist, moved, pose, sizes

from tp_controller.robot import Robot, Space
from tp_controller.tasks import JointTask

BASES = ('planar', 'differential', 'floating')
numbers = st.floats(-2.0, 2.0)
seeds = st.integers(0, 2**32 - 1)


def robot_of(rng, kind):
    """Arm of one to four joints, some of them sliding and tilted, on a base."""
    n = int(rng.integers(1, 5))
    return Robot.from_dh(
        a=rng.uniform(-0.6, 0.6, n),
        alpha=rng.uniform(-2.0, 2.0, n),
        d=rng.uniform(-0.3, 0.3, n),
        types=rng.choice(['revolute', 'prismatic'], n).tolist(),
        base=kind,
        base_pose=rng.uniform(-0.5, 0.5, 6),
    )


def somewhere(robot, rng):
    q = robot.integrate(robot.neutral, rng.uniform(-2.0, 2.0, robot.n))
    return robot.integrate(q, rng.uniform(-2.0, 2.0, robot.n))


@pytest.mark.parametrize('kind', BASES)
@given(seed=seeds)
def test_a_constant_twist_leads_where_the_exponential_says(kind, seed):
    rng = np.random.default_rng(seed)
    robot = robot_of(rng, kind)
    nq, nv = sizes(kind)
    q, way = somewhere(robot, rng), rng.uniform(-4.0, 4.0, robot.n)
    after = robot.integrate(q, way)
    assert pose(after[:nq]) == pytest.approx(moved(kind, q[:nq], way[:nv]), abs=1e-9)
    assert after[nq:] == pytest.approx(q[nq:] + way[nv:], abs=1e-12)
    robot.update(after)
    assert robot.frame('base').position == pytest.approx(pose(after[:nq])[:3, 3], abs=1e-9)
    assert robot.frame('base').rotation == pytest.approx(pose(after[:nq])[:3, :3], abs=1e-9)


@pytest.mark.parametrize('kind', BASES)
@given(seed=seeds)
def test_difference_undoes_integrate(kind, seed):
    rng = np.random.default_rng(seed)
    robot = robot_of(rng, kind)
    q, way = somewhere(robot, rng), rng.uniform(-1.7, 1.7, robot.n)
    assert robot.difference(q, robot.integrate(q, way)) == pytest.approx(way, abs=1e-8)


@pytest.mark.parametrize('kind', ['planar', 'floating'])
@given(seed=seeds)
def test_integrate_undoes_difference(kind, seed):
    rng = np.random.default_rng(seed)
    robot = robot_of(rng, kind)
    nq, _ = sizes(kind)
    before, after = somewhere(robot, rng), somewhere(robot, rng)
    found = robot.integrate(before, robot.difference(before, after))
    assert pose(found[:nq]) == pytest.approx(pose(after[:nq]), abs=1e-7)
    assert found[nq:] == pytest.approx(after[nq:], abs=1e-9)


def test_a_differential_drive_is_not_led_to_the_side():
    robot = Robot.from_dh(a=[0.5], base='differential')
    assert robot.difference(robot.neutral, np.array([0.0, 0.3, 0.0, 0.1])) == pytest.approx(
        [0.0, 0.0, 0.1]
    )


@given(seed=seeds)
def test_both_signs_of_a_quaternion_are_the_same_configuration(seed):
    rng = np.random.default_rng(seed)
    robot = robot_of(rng, 'floating')
    before, after = somewhere(robot, rng), somewhere(robot, rng)
    other = after.copy()
    other[3:7] *= -rng.uniform(0.5, 2.0)
    assert robot.difference(before, other) == pytest.approx(
        robot.difference(before, after), abs=1e-9
    )
    robot.update(after)
    place = robot.frame(robot.frames[-1]).position.copy()
    robot.update(other)
    assert robot.frame(robot.frames[-1]).position == pytest.approx(place, abs=1e-12)


@pytest.mark.parametrize('kind', BASES)
@given(seed=seeds)
def test_jacobian_and_hessian_are_the_derivatives_along_integrate(kind, seed):
    rng = np.random.default_rng(seed)
    robot = robot_of(rng, kind)
    frame, q, step = robot.frame(robot.frames[-1]), somewhere(robot, rng), 1e-6
    robot.update(q)
    J, H, R = frame.jacobian.copy(), frame.hessian.copy(), frame.rotation.copy()
    for i in range(robot.n):
        ends = []
        for sign in (1.0, -1.0):
            way = np.zeros(robot.n)
            way[i] = sign * step
            robot.update(robot.integrate(q, way))
            ends.append((frame.position.copy(), frame.rotation.copy(), frame.jacobian.copy()))
        (p1, R1, J1), (p0, R0, J0) = ends
        spin = (R1 - R0) / (2.0 * step) @ R.T
        assert J[:3, i] == pytest.approx((p1 - p0) / (2.0 * step), abs=1e-7)
        assert J[3:, i] == pytest.approx([spin[2, 1], spin[0, 2], spin[1, 0]], abs=1e-7)
        assert H[:, :, i] == pytest.approx((J1 - J0) / (2.0 * step), abs=1e-6)


@pytest.mark.parametrize('kind', BASES)
@given(seed=seeds)
def test_rates_of_the_coordinates_are_their_derivatives_and_lead_back_to_velocities(kind, seed):
    rng = np.random.default_rng(seed)
    robot = robot_of(rng, kind)
    q, qd, step = somewhere(robot, rng), rng.uniform(-1.0, 1.0, robot.n), 1e-6
    rates = robot.space.rates(q) @ qd
    ends = [robot.integrate(q, sign * step * qd) for sign in (1.0, -1.0)]
    assert rates == pytest.approx((ends[0] - ends[1]) / (2.0 * step), abs=1e-7)
    assert robot.space.velocity(q, rates) == pytest.approx(qd, abs=1e-9)


@pytest.mark.parametrize('kind', BASES)
@given(seed=seeds)
def test_no_frame_moves_faster_or_bends_more_than_its_reach_says(kind, seed):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 4))
    robot = Robot.from_dh(a=rng.uniform(-0.6, 0.6, n), alpha=rng.uniform(-2.0, 2.0, n), base=kind)
    name = str(rng.choice(robot.frames))
    frame, reach = robot.frame(name), robot.reach(name)
    q, way, step = somewhere(robot, rng), rng.uniform(-1.0, 1.0, robot.n), 1e-4
    robot.update(q)
    assert np.all(np.linalg.norm(frame.jacobian[:3], axis=0) <= reach + 1e-9)
    places = []
    for sign in (-1.0, 0.0, 1.0):
        robot.update(robot.integrate(q, sign * step * way))
        places.append(frame.position.copy())
    second = np.linalg.norm(places[0] - 2.0 * places[1] + places[2]) / step**2
    bound = np.minimum.outer(reach, reach) * np.outer(np.abs(way), np.abs(way))
    assert second <= bound.sum() + 1e-5


@pytest.mark.parametrize('kind', BASES)
@given(seed=seeds)
def test_a_frame_is_no_farther_off_than_the_bounds_per_coordinate_say(kind, seed):
    rng = np.random.default_rng(seed)
    robot = Robot.from_dh(a=[0.5, 0.4], alpha=[0.7, 0.0], base=kind)
    one, other = somewhere(robot, rng), somewhere(robot, rng)
    if seed % 2:
        other = robot.integrate(one, rng.uniform(-0.1, 0.1, robot.n))
    places = []
    for q in (one, other):
        robot.update(q)
        places.append(robot.frame('link_2').position.copy())
    reach = robot.space.coordinate_reach(robot.reach('link_2')[None])[0]
    assert np.linalg.norm(places[1] - places[0]) <= reach @ np.abs(other - one) + 1e-9


@pytest.mark.parametrize('kind', ['planar', 'floating'])
@given(seed=seeds)
def test_rows_of_a_base_position_have_their_derivatives(kind, seed):
    rng = np.random.default_rng(seed)
    robot = robot_of(rng, kind)
    names = ['base/y', 'joint_1', 'base/x'] + (['base/yaw'] if kind == 'planar' else ['base/z'])
    target = rng.uniform(-1.0, 1.0, len(names))
    task = JointTask('base', robot, names, target=target)
    q, step = somewhere(robot, rng), 1e-5

    def at(way):
        robot.update(robot.integrate(q, way))
        task.update()
        return task.error.copy(), task.J.copy()

    error, J = at(np.zeros(robot.n))
    own = q[[robot.coordinates.index(name) for name in names]]
    wrapped = np.angle(np.exp(1j * (target - own)))
    turns = np.array(['yaw' in name for name in names])
    assert error == pytest.approx(np.where(turns, wrapped, target - own), abs=1e-12)
    H = np.zeros((len(names), robot.n, robot.n))
    task.hessian(H)
    for i in range(robot.n):
        way = np.zeros(robot.n)
        way[i] = step
        (e1, J1), (e0, J0) = at(way), at(-way)
        assert J[:, i] == pytest.approx(-(e1 - e0) / (2.0 * step), abs=1e-8)
    # The second derivative along a constant velocity.
    qd = rng.uniform(-1.0, 1.0, robot.n)
    (_, J1), (_, J0) = at(step * qd), at(-step * qd)
    assert np.einsum('kij,i,j->k', H, qd, qd) == pytest.approx(
        (J1 - J0) @ qd / (2.0 * step), abs=1e-6
    )


def test_names_say_what_is_what():
    robot = Robot.from_dh(a=[0.5, 0.4], base='differential')
    assert robot.joints == ('base/forward', 'base/yaw', 'joint_1', 'joint_2')
    assert robot.coordinates == ('base/x', 'base/y', 'base/yaw', 'joint_1', 'joint_2')
    assert (robot.nq, robot.nv, robot.n) == (5, 4, 4)
    assert robot.neutral == pytest.approx(np.zeros(5))
    floating = Robot.from_dh(a=[0.5], base='floating')
    assert floating.neutral == pytest.approx([0, 0, 0, 0, 0, 0, 1, 0])
    assert floating.coordinates[3:7] == ('base/qx', 'base/qy', 'base/qz', 'base/qw')


@given(st.lists(numbers, min_size=6, max_size=6))
def test_a_robot_of_plain_joints_adds_and_subtracts(values):
    space = Space(['a', 'b', 'c'])
    q, way = np.array(values[:3]), np.array(values[3:])
    assert np.array_equal(space.integrate(q, way), q + way)
    assert np.array_equal(space.difference(q, way), way - q)


def test_a_continuous_joint_has_the_shorter_difference():
    space = Space(['a', 'b'], None, [True, False])
    found = space.difference(np.array([3.0, 3.0]), np.array([-3.0, -3.0]))
    assert found == pytest.approx([2.0 * np.pi - 6.0, -6.0])


def test_the_end_of_an_arm_is_where_the_pose_of_its_base_puts_it():
    robot = Robot.from_dh(a=[0.5, 0.4], base='floating', base_pose=[0.1, 0.2, 0.3, 0, 0, 0.4])
    rng = np.random.default_rng(3)
    q = somewhere(robot, rng)
    robot.update(q)
    foot = pose([0.1, 0.2, 0.4])
    foot[2, 3] = 0.3
    expected = pose(q[:7]) @ foot @ arm_pose(q[7:], [0.5, 0.4])
    assert robot.frame('link_2').position == pytest.approx(expected[:3, 3])
    assert robot.frame('link_2').rotation == pytest.approx(expected[:3, :3])
    # The twist of a base is along its own axes.
    twist = full_twist('floating', rng.uniform(-1.0, 1.0, 6))
    robot.update(q)
    R = robot.frame('base').rotation
    found = robot.frame('base').jacobian[:, :6] @ twist
    assert found == pytest.approx(np.concatenate([R @ twist[:3], R @ twist[3:]]))

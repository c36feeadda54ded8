"""Positions as commands: exact at the start, never a jump, rest when the arm does not follow."""

import math

import numpy as np
import pytest
from small_arms import planar_block

from tp_controller import InvalidValue, UnusableState, build_settings, read_parameter_file
from tp_controller.position_reference import OTHER_ORDER, PositionReference
from tp_controller.robot import Limits
from tp_sim.integrator import Integrator
from tp_sim.plant import Plant
from tp_sim.plant_settings import PlantSettings

RATE = 100.0
T = 1.0 / RATE
SPEED, ACCELERATION, END = 1.0, 4.0, 1.5
TOLERANCE = 0.02


class Loop:
    """Two joints under position control, and what is sent to them."""

    def __init__(self, target=(1.0, -0.8), response=None, start=(0.3, -0.2), **plant):
        limits = {'velocity': [SPEED], 'acceleration': [ACCELERATION]}
        limits |= {'position_min': [-END], 'position_max': [END]}
        joints = ['joint_1', 'joint_2']
        task = {'type': 'joint', 'joints': joints, 'target': list(target), 'gain': [3.0]}
        robot = planar_block(1.0, 1.0) | {'limits': limits} | (response or {})
        self.stack = build_settings(
            {'robot': robot, 'rate': RATE, 'hierarchy': ['joints'], 'tasks': {'joints': task}}
        ).stack
        self.reference = PositionReference(self.stack, [TOLERANCE])
        self.plant = Plant(Integrator(start, Limits(2, velocity=[5.0])), PlantSettings(**plant))
        self.sent, self.notices = [], set()

    def step(self, elapsed=T):
        """One cycle; its positions."""
        step = self.reference.answer(self.plant.measured()[0], elapsed)
        self.sent.append(self.reference.after(step.command).copy())
        self.reference.advance()
        self.plant.follow(self.sent[-1], T)
        if self.reference.notice:
            self.notices.add(self.reference.notice)
        return self.sent[-1]

    def run(self, seconds):
        for _ in range(round(seconds * RATE)):
            self.step()

    def assert_smooth(self):
        """Speeds, accelerations and ranges of what was sent."""
        sent = np.array(self.sent)
        speed = np.diff(sent, axis=0, prepend=sent[:1]) / T
        assert np.abs(speed).max() <= SPEED + 1e-9
        assert np.abs(np.diff(speed, axis=0)).max() <= ACCELERATION * T + 1e-9
        assert np.abs(sent).max() <= END


LATE = {'delay': 3, 'lag': 0.04}
TOLD = {'delay': [0.03], 'lag': [0.04]}


@pytest.mark.parametrize(
    ('response', 'plant'),
    [({}, {}), (TOLD, LATE), ({}, {'lag': 0.015}), ({'noise': [0.002]}, {'noise': 0.002})],
    ids=['ideal', 'late and told', 'late and not told', 'noisy'],
)
@pytest.mark.parametrize('target', [(1.0, -0.8), (3.0, -3.0)], ids=['inside', 'beyond the range'])
def test_it_begins_where_the_arm_is_and_keeps_every_limit(target, response, plant):
    loop = Loop(target, response, **plant)
    measured = loop.plant.measured()[0]
    assert np.array_equal(loop.step(), measured)
    loop.run(6.0)
    loop.assert_smooth()
    assert not loop.notices
    assert loop.plant.q == pytest.approx(np.clip(target, -END, END), abs=2e-3)


def test_a_declared_delay_is_no_reason_to_overshoot():
    loop = Loop(response=TOLD, **LATE)
    loop.run(6.0)
    assert np.array(loop.sent)[:, 0].max() <= 1.0 + 1e-6


def test_a_blocked_arm_brings_it_to_rest_near_and_then_back_to_where_the_arm_is():
    loop = Loop()
    loop.run(0.3)
    loop.plant.blocked = True
    place = loop.plant.q
    for _ in range(200):
        loop.step()
        braking = SPEED**2 / ACCELERATION
        assert np.abs(loop.sent[-1] - place).max() < TOLERANCE + 0.05 * SPEED + braking
    assert loop.notices
    begins = [sent for sent in loop.sent[31:] if np.array_equal(sent, place)]
    assert begins
    loop.plant.blocked = False
    loop.run(5.0)
    assert not loop.reference.notice
    assert loop.plant.q == pytest.approx([1.0, -0.8], abs=1e-3)


@pytest.mark.parametrize('after', [0.0, 0.6], ids=['from rest', 'from full speed'])
def test_an_arm_whose_drives_are_off_is_not_left_far_behind(after):
    loop = Loop((1.4, -1.4))
    loop.run(after)
    follow, loop.plant.follow = loop.plant.follow, lambda *_: None
    gap = 0.0
    for _ in range(round(3.0 * RATE)):
        gap = max(gap, np.abs(loop.step() - loop.plant.q).max())
    # The time until it counts as standing, and two steps until that is seen.
    assert TOLERANCE < gap <= TOLERANCE + SPEED * (0.05 + 2.0 * T)
    assert len(loop.notices) > 1
    loop.plant.follow = follow
    loop.run(3.0)
    assert loop.plant.q == pytest.approx([1.4, -1.4], abs=0.01)


def test_an_arm_moved_by_hand_is_not_called_back():
    loop = Loop((0.3, -0.2))
    loop.run(0.5)
    rest = loop.sent[-1]
    # Its servo is off: it goes where it is pushed to.
    loop.plant.follow = lambda *_: None
    for k in range(1, 61):
        loop.plant.reset([0.3 + 0.005 * k, -0.2])
        assert np.array_equal(loop.step(), rest)
    for _ in range(round(0.45 * RATE)):
        assert np.array_equal(loop.step(), rest)
    loop.run(0.1)
    assert any(np.array_equal(sent, loop.plant.q) for sent in loop.sent[-10:])


def test_a_jump_is_believed_when_a_second_state_says_so():
    loop = Loop((0.3, -0.2))
    loop.run(0.2)
    rest = loop.sent[-1]
    loop.plant.reset([-1.0, 1.0])
    loop.plant.follow = lambda *_: None
    assert np.array_equal(loop.step(), rest)
    assert np.array_equal(loop.step(), [-1.0, 1.0])


def test_a_reader_with_another_order_of_joints_moves_the_arm_once():
    loop = Loop((0.3, -0.2))
    follow = loop.plant.follow
    loop.plant.follow = lambda positions, period: follow(positions[::-1], period)
    loop.run(3.0)
    # Begun anew wherever the arm is, they would go on being exchanged.
    assert np.array_equal(np.unique(loop.sent, axis=0), [[0.3, -0.2]])
    assert loop.plant.q == pytest.approx([-0.2, 0.3], abs=1e-3)
    assert OTHER_ORDER in loop.reference.notice
    # After a pause another reader may be there.
    loop.reference.pause()
    assert loop.step() == pytest.approx([-0.2, 0.3], abs=1e-3)


@pytest.mark.parametrize('there', [(0.31, -0.2), (-1.0, 1.0)], ids=['near', 'elsewhere'])
def test_after_a_pause_it_goes_on_or_begins_where_the_arm_is(there):
    loop = Loop((0.3, -0.2))
    loop.run(0.2)
    rest = loop.sent[-1]
    loop.reference.pause()
    loop.plant.reset(there)
    assert np.array_equal(loop.step(5.0), rest if there[1] == -0.2 else there)


def test_what_cannot_be_believed_moves_nothing():
    loop = Loop()
    with pytest.raises(UnusableState, match='no joint can be at'):
        loop.reference.answer(np.array([1e7, 0.0]), T)
    assert not loop.reference.begun


def test_a_state_that_comes_again_gets_the_same_positions():
    loop = Loop()
    loop.run(0.3)
    before = loop.plant.measured()[0]
    sent = loop.step()
    loop.stack.undo()
    loop.reference.undo()
    step = loop.reference.answer(before, T)
    assert np.array_equal(loop.reference.after(step.command), sent)


def test_states_that_come_too_fast_do_not_make_it_faster():
    loop = Loop((1.4, -1.4))
    while loop.plant.q[0] < 0.6:
        loop.step(0.5 * T)
    sent = np.array(loop.sent[-20:])
    assert np.abs(np.diff(sent, axis=0)).max() <= 0.55 * T * SPEED


def test_turns_are_counted_on_where_states_are_wrapped():
    urdf = """<robot name="r"><link name="base"/><link name="tool"/>
      <joint name="turn" type="continuous"><parent link="base"/><child link="tool"/>
      <axis xyz="0 0 1"/><limit velocity="1" effort="1"/></joint></robot>"""
    task = {'type': 'joint', 'joints': ['turn'], 'target': [-2.5], 'gain': [3.0]}
    stack = build_settings(
        {'robot_description': urdf, 'rate': RATE, 'hierarchy': ['turn'], 'tasks': {'turn': task}}
    ).stack
    reference = PositionReference(stack, [TOLERANCE])
    sent = [np.array([3.0])]
    for _ in range(200):
        measured = (sent[-1] + math.pi) % math.tau - math.pi
        sent.append(reference.after(reference.answer(measured, T).command).copy())
        reference.advance()
    assert not reference.notice
    assert np.abs(np.diff(sent, axis=0)).max() <= T + 1e-9
    # The short way, beyond half a turn.
    assert sent[-1] == pytest.approx(math.tau - 2.5, abs=0.01)


def test_a_base_that_moves_and_wrong_tolerances_are_refused(config):
    settings = build_settings(read_parameter_file(config / 'mobile_planar.yaml', 'tp_controller'))
    with pytest.raises(InvalidValue, match=r'command\.type: got positions for a base that moves'):
        PositionReference(settings.stack, [TOLERANCE])
    with pytest.raises(InvalidValue, match=r'command\.tolerance: .* 1 value or 2, one per joint'):
        PositionReference(Loop().stack, [0.1, 0.1, 0.1])

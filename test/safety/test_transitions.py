"""Transitions: after a change of the stack the command changes by little in a step."""

from pathlib import Path

import numpy as np
import pytest

from tp_controller import (
    InvalidValue,
    Inverse,
    JointTask,
    ObstacleTask,
    PositionTask,
    PostureTask,
    Robot,
    Stack,
    UnusableState,
    build_settings,
    read_parameter_file,
    solver_of,
)
from tp_controller.config import check_changes, controller_schema
from tp_controller.robot import Limits
from tp_controller.transition import largest_change

BENCHMARKS = Path(__file__).resolve().parents[2] / 'benchmarks'
RATE, TIME = 100.0, 0.5
Q = np.array([0.1, 0.6, 0.3])


class Run:
    """An ideal planar arm that notes the largest change of its command as a share of the bound."""

    def __init__(self, limits=None, solver='recursive', time=TIME, more=(), **settings):
        self.robot = Robot.from_dh(
            a=[0.75, 0.5, 0.5], limits=limits or {'velocity': 1.0}, joints=['a', 'b', 'c']
        )
        self.tip = PositionTask(
            'tip', self.robot, 'link_3', axes='xy', target=[1.2, 0.9], gain=3.0
        )
        self.bend = JointTask('bend', self.robot, ['b'], target=[-1.0], gain=3.0)
        self.rest = PostureTask('rest', self.robot, target=[-2.0, 1.0, -1.0], gain=3.0)
        self.more = [task(self.robot) for task in more]
        tasks = [*self.more, self.tip, self.bend, self.rest]
        self.stack = Stack(
            self.robot,
            [*self.more, self.tip, self.bend],
            solver_of(solver, 3, **settings),
            rate=RATE,
            tasks=tasks,
            transition_time=time,
        )
        self.q, self.before, self.share = Q.copy(), np.zeros(3), 0.0

    def step(self, count=1, free=False):
        self.bound = largest_change(self.robot.limits, 1.0 / RATE, TIME)
        for _ in range(count):
            command = self.stack.step(self.q).command
            if not free:
                self.share = max(self.share, (np.abs(command - self.before) / self.bound).max())
            self.q, self.before = self.q + command / RATE, command
        return self.before

    def settle(self):
        """Step until the transition is over; how many steps that took."""
        for i in range(300):
            if not self.stack.in_transition:
                return i
            self.step()
        raise AssertionError('no end')


def test_the_bound_is_two_full_speeds_in_the_time_or_the_limit_of_acceleration():
    limits = Limits(2, velocity=[1.0, 2.0], acceleration=[9.0, 3.0])
    np.testing.assert_allclose(largest_change(limits, 0.01, 0.5), [0.04, 0.03])
    np.testing.assert_allclose(largest_change(Limits(1), 0.01, 0.5), [0.04])


CHANGES = {
    'hierarchy': lambda run: setattr(run.stack, 'hierarchy', ['rest', 'tip']),
    'off': lambda run: setattr(run.tip, 'enabled', False),
    'all off': lambda run: run.stack.rearrange(enabled={'tip': False, 'bend': False}),
    'none': lambda run: setattr(run.stack, 'hierarchy', []),
    'gain': lambda run: setattr(run.tip, 'gain', 0.2),
    'solver': lambda run: setattr(run.stack, 'solver', 'weighted'),
    'limits': lambda run: run.stack.prepare_limits(Limits(3, velocity=[1.5]))(),
}


@pytest.mark.parametrize('saturation', ['null_space', 'uniform'])
@pytest.mark.parametrize('change', CHANGES)
def test_a_change_takes_its_time_and_ends_in_what_the_new_stack_does_by_itself(change, saturation):
    run = Run(saturation=saturation)
    run.step(20, free=True)
    CHANGES[change](run)
    assert run.stack.in_transition
    steps = run.settle()
    assert run.share <= 1.0 + 1e-9
    assert TIME * RATE <= steps <= 2 * TIME * RATE
    other = Run(saturation=saturation, time=0.0)
    other.step(20, free=True)
    CHANGES[change](other)
    other.q = run.q
    np.testing.assert_allclose(run.step(), other.step(), atol=1e-9)


@pytest.mark.parametrize('change', ['hierarchy', 'off', 'none', 'solver'])
def test_without_the_time_the_command_jumps(change):
    run = Run(time=0.0)
    run.step(20, free=True)
    CHANGES[change](run)
    assert not run.stack.in_transition
    run.step()
    assert run.share > 3.0


def test_targets_are_ordinary_motion():
    run = Run()
    run.tip.target = [0.2, 1.2]
    assert not run.stack.in_transition


def test_a_narrower_limit_of_acceleration_needs_no_transition():
    run = Run({'velocity': 1.0, 'acceleration': 3.0})
    run.step(20, free=True)
    run.stack.hierarchy = ['rest']
    assert not run.stack.in_transition
    run.step(100)
    assert run.share <= 1.0 + 1e-9


def test_a_change_during_a_transition_goes_on_from_the_present_command():
    run = Run()
    run.step(20, free=True)
    for hierarchy in (['rest'], ['tip'], ['bend', 'rest'], [], ['tip', 'rest']):
        run.stack.hierarchy = hierarchy
        run.step(5)
    assert run.share <= 1.0 + 1e-9
    run.settle()
    assert run.share <= 1.0 + 1e-9


@pytest.mark.parametrize('solver', ['recursive', 'hqp'])
def test_a_level_above_the_change_never_sees_it(solver):
    run = Run({'velocity': 3.0}, solver, inverse=Inverse('pinv'))
    run.tip.gain = 1.0
    run.step(30)
    for i in range(100):
        if i % 5 == 0:
            run.stack.hierarchy = ['tip', ['bend', 'rest'][i // 5 % 2]]
        tip = run.stack.step(run.q).levels[0]
        np.testing.assert_allclose(tip.achieved, tip.requested, atol=1e-9)
        run.stack.undo()
        run.step()
        assert run.stack.in_transition
    assert run.share <= 1.0 + 1e-9


def test_ends_of_ranges_and_distances_hold_at_once_and_beyond_the_bound_joints_only_brake():
    rng = np.random.default_rng(3)
    ranges = {'velocity': 1.0, 'position_min': -2.0, 'position_max': 2.0}

    def ball(robot):
        return ObstacleTask('ball', robot, 'link_3', [0.4, 1.1], 0.3, axes='xy', period=1.0 / RATE)

    run = Run(ranges, more=[ball])
    ball, stack = run.more[0], run.stack
    for _ in range(60):
        run.tip.target = rng.uniform(-1.6, 1.6, 2)
        names = [name for name in ('tip', 'bend', 'rest') if rng.integers(2)]
        stack.hierarchy = ['ball', *rng.permutation(names)]
        for _ in range(rng.integers(1, 40)):
            before = run.before
            command = run.step()
            assert ball.distance.min() >= 0.0
            assert np.all(np.abs(run.q) <= 2.0)
            over = stack.in_transition & (np.abs(command - before) > run.bound * (1 + 1e-9))
            assert np.all(np.abs(command)[over] < np.abs(before)[over])


def test_an_arm_that_does_not_follow_brakes_at_once():
    run = Run()
    for _ in range(20):
        run.q = run.q + run.stack.step(run.q, 1.0 / RATE).command / RATE
    run.stack.hierarchy = ['rest']
    with pytest.raises(UnusableState):
        run.stack.step(run.q + 1.0, 1.0 / RATE)
    assert not run.stack.answer.any()
    assert not run.stack.velocities_of('rest')[1].any()


def test_a_step_that_is_taken_back_leaves_the_transition_as_it_was():
    run = Run()
    run.step(20, free=True)
    run.stack.hierarchy = ['rest']
    for _ in range(60):
        first = run.stack.step(run.q).command
        run.stack.undo()
        np.testing.assert_array_equal(run.stack.step(run.q).command, first)
        problem = run.stack.problem(run.q)
        assert np.all(problem.high - problem.low >= 0.0)
        run.q = run.q + first / RATE


# Tasks that are off


def test_a_task_that_is_off_is_as_if_it_were_not_listed():
    run, other = Run(time=0.0), Run(time=0.0)
    run.stack.hierarchy = ['tip + bend', 'rest']
    run.tip.enabled = False
    other.stack.hierarchy = ['bend', 'rest']
    assert run.stack.hierarchy == ('tip + bend', 'rest')
    assert [len(level) for level in run.stack.members] == [1, 1]
    assert [run.stack.level_of(name) for name in ('tip', 'bend', 'rest')] == [-1, 0, 1]
    assert run.stack.place_of('tip') == 0
    np.testing.assert_array_equal(run.step(), other.step())
    run.bend.enabled = False
    assert [run.stack.level_of(name) for name in ('bend', 'rest')] == [-1, 1]
    other.stack.hierarchy = ['rest']
    np.testing.assert_array_equal(run.step(), other.step())
    run.rest.enabled = False
    assert run.stack.resting
    assert not run.step().any()
    run.rest.enabled = True
    assert run.step().any()


def test_a_task_can_be_off_from_the_start():
    robot = Robot.from_dh(a=[0.75, 0.5, 0.5])
    tip = PositionTask('tip', robot, 'link_3', axes='xy', enabled=False)
    assert Stack(robot, [tip]).resting
    with pytest.raises(InvalidValue, match='enabled: got 1; accepts true or false'):
        tip.enabled = 1


def test_what_cannot_be_resolved_leaves_everything_as_it_was():
    run = Run(solver='augmented', time=0.0)
    run.bend.inverse = run.bend.inverse._replace(damping=0.5)
    run.stack.hierarchy = ['tip']
    with pytest.raises(InvalidValue, match='inverts them together'):
        run.stack.hierarchy = ['tip', 'bend']
    run.stack.rearrange(['tip', 'bend'], {'bend': False})
    with pytest.raises(InvalidValue, match='inverts them together'):
        run.bend.enabled = True
    assert not run.bend.enabled
    assert run.stack.level_of('tip') == 0


def test_parameters_switch_tasks_and_solver_in_one_and_warn_of_what_is_kept_no_more():
    file = Path(__file__).parents[2] / 'config' / 'b1_obstacles.yaml'
    settings = build_settings(read_parameter_file(file, 'tp_controller'))
    changes = {'tasks.obstacle_1.enabled': False, 'solver.type': 'hqp', 'transition_time': 2.0}
    warnings = check_changes(settings, controller_schema(settings.values), changes)()
    assert 'obstacle_1 leaves the hierarchy' in warnings[0]
    assert settings.stack.solver.type == 'hqp'
    assert settings.stack.transition_time == 2.0
    assert settings.stack.hierarchy[0] == 'obstacle_1'
    assert settings.stack.in_transition


# Random changes all the time


@pytest.mark.parametrize('arm', ['planar', 'Panda'])
@pytest.mark.parametrize('limited', [False, True])
def test_random_changes_all_the_time_stay_within_the_bound(arm, limited, monkeypatch):
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    import transitions

    found = transitions.run(arm, limited, {'planar': 10.0, 'Panda': 4.0}[arm], 0.05, 5)
    assert found.share <= 1.0 + 1e-6
    assert found.acceleration <= 1.0 + 1e-6
    assert found.room >= 0.0
    assert found.astray == 0
    assert len(found.changes) >= 5

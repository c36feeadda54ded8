"""Ways gone by the stack: a posture in the place of the goals' levels, and back."""

from pathlib import Path

import numpy as np
import pytest

from tp_controller import (
    InvalidValue,
    PositionTask,
    PostureTask,
    Stack,
    build_settings,
    explain_step,
    read_parameter_file,
)
from tp_controller.planning import Kind, Planner
from tp_controller.planning.excursion import Excursion
from tp_controller.planning.timing import timed
from tp_controller.robot.draws import random_configuration

CONFIG = Path(__file__).resolve().parents[2] / 'config'
DT = 0.005


def parameters(name):
    return read_parameter_file(CONFIG / f'{name}.yaml', 'tp_controller')


def stuck_draw(planner, task):
    """Start and goal that the straight way does not lead to, and the plan around."""
    stack, rng = planner.stack, np.random.default_rng(5)
    while True:
        start, end = (random_configuration(stack.robot, rng) for _ in range(2))
        stack.robot.update(end)
        goals = {task: stack.tasks[task].current}
        plan = planner.plan(goals, start, {task: 1e-3})
        if plan.kind is Kind.AROUND:
            return start, goals, plan


def test_a_goal_that_gets_stuck_is_reached_around_within_all_limits():
    planner = Planner(parameters('panda_pose'))
    start, goals, plan = stuck_draw(planner, 'hand_pose')
    stack = build_settings(parameters('panda_pose')).stack
    limits = stack.robot.limits
    stack.tasks['hand_pose'].target = goals['hand_pose']
    hierarchy = stack.hierarchy
    excursion = Excursion(stack, ['hand_pose'])
    excursion.follow(plan.way.path)
    q, last = start.copy(), np.zeros(7)
    for _ in range(4000):
        excursion.advance(DT)
        if excursion.over:
            excursion.end()
        command = stack.step(q).command
        assert np.all(np.abs(command) <= limits.velocity + 1e-9)
        assert np.all(np.abs(command - last) <= limits.acceleration * DT + 1e-9)
        last = command
        q = q + DT * command
        assert np.all((limits.position_min - 1e-9 <= q) & (q <= limits.position_max + 1e-9))
        if not excursion.acts and np.linalg.norm(stack.tasks['hand_pose'].error) < 1e-4:
            break
    assert np.linalg.norm(stack.tasks['hand_pose'].error) < 1e-4
    assert stack.hierarchy == hierarchy
    assert stack.stand_in is None


def test_levels_above_are_not_disturbed_on_the_way():
    stack = build_settings(parameters('panda_pose')).stack
    robot = stack.robot
    hand, rest = PositionTask('hand', robot, 'panda_link4', gain=2.0), PostureTask('rest', robot)
    goal = PositionTask('goal', robot, 'panda_hand_tcp')
    stack = Stack(robot, [hand, goal, rest], rate=200.0, transition_time=0.2)
    q = np.array([0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785])
    robot.update(q)
    hand.target = hand.current
    excursion = Excursion(stack, ['goal'])
    other = q + np.array([0.0, 0.0, 0.0, 0.4, 0.8, 0.3, 0.2])
    excursion.task.target = other
    for _ in range(600):
        q = q + DT * stack.step(q).command
        assert np.linalg.norm(hand.error) < 1e-6
    # What the level above leaves free has moved.
    assert abs(q[4] - other[4]) < 0.05


def test_the_arm_rests_before_a_way_is_followed():
    stack = build_settings(parameters('panda_pose')).stack
    q = np.array([0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785])
    stack.tasks['hand_pose'].target = [0.5, 0.3, 0.3, 1.0, 0.0, 0.0, 0.0]
    Excursion(stack, ['hand_pose'])
    for _ in range(5):
        assert not stack.step(q).command.any()


def test_all_that_tells_about_the_stack_works_meanwhile():
    stack = build_settings(parameters('panda_table')).stack
    q = np.array([0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785])
    excursion = Excursion(stack, ['hand_position'])
    stack.step(q)
    assert stack.level_of('hand_position') == -1
    assert stack.place_of('hand_position') == 3
    assert stack.level_of('table') == 1
    assert [level.tasks for level in explain_step(stack)][-1] == (excursion.task.name,)
    stack.tasks['ball'].enabled = False
    stack.tasks['hand_position'].gain = 2.0
    stack.step(q)
    assert excursion.acts
    stack.hierarchy = ['ranges', 'hand_position', 'posture']
    stack.step(q)
    assert excursion.acts
    assert [tasks[0].name for tasks in stack.members] == ['ranges', excursion.task.name]
    excursion.end()
    stack.step(q)
    assert stack.hierarchy == ('ranges', 'hand_position', 'posture')
    assert stack.level_of('hand_position') == 1


def test_set_based_tasks_below_the_goals_stay():
    stack = build_settings(parameters('panda_table')).stack
    stack.hierarchy = ['hand_position', 'table + pillar', 'posture']
    Excursion(stack, ['hand_position'])
    names = [[task.name for task in level] for level in stack.members]
    assert names == [['table', 'pillar'], ['way_around']]


def test_a_name_that_the_stack_has_is_refused_and_changes_nothing():
    stack = build_settings(parameters('panda_pose')).stack
    task = PostureTask('posture', stack.robot)
    with pytest.raises(InvalidValue):
        stack.take_over(task, ['hand_pose'])
    assert stack.stand_in is None


def test_the_way_waits_while_no_joint_states_come():
    stack = build_settings(parameters('panda_pose')).stack
    q = np.array([0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785])
    excursion = Excursion(stack, ['hand_pose'])
    excursion.follow(timed(np.array([q, q + 0.5]), stack.robot.limits))
    for _ in range(5):
        excursion.advance(DT)
        q = q + DT * stack.step(q).command
    before = excursion.time
    excursion.advance(1.0)
    assert excursion.time - before <= 0.1 + 1e-9


def test_a_way_that_is_held_up_is_told():
    planner = Planner(parameters('panda_pose'))
    start, _, plan = stuck_draw(planner, 'hand_pose')
    stack = build_settings(parameters('panda_pose')).stack
    excursion = Excursion(stack, ['hand_pose'])
    excursion.follow(plan.way.path)
    stack.hold()
    for _ in range(3000):
        excursion.advance(DT)
        stack.step(start)
        if excursion.stuck:
            break
    assert excursion.stuck
    assert not excursion.over

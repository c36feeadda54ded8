"""Kinds of tasks, solvers and objectives of other packages."""

import logging
import os
import subprocess
import sys
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import yaml
from hypothesis import assume, given
from own_task_package import install
from random_stacks import arms, examples, states
from small_arms import robot_of
from test_library_without_ros import BLOCKED, PACKAGES

from tp_controller import InvalidValue, Stack, Task, plugins
from tp_controller.objectives import OBJECTIVE_TYPES
from tp_controller.plugins import Registered, Registry, check_class
from tp_controller.solvers import SOLVER_TYPES
from tp_controller.tasks import TASK_TYPES, PostureTask

REPOSITORY = Path(__file__).resolve().parents[2]
sys.path.append(str(REPOSITORY / 'examples' / 'own_task'))
from own_task.frame_distance import FrameDistanceTask  # noqa: E402

STEP = 1e-6


@pytest.fixture(scope='module')
def installed(repository, tmp_path_factory):
    return install(repository, tmp_path_factory.mktemp('own'))


def run(folder, script):
    """Run a script in a python that has a folder first in its path; its output, and its log."""
    result = subprocess.run(
        [sys.executable, '-c', BLOCKED + script],
        env=os.environ | {'PYTHONPATH': os.pathsep.join([str(folder), PACKAGES, *sys.path])},
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert result.returncode == 0, result.stderr
    return result.stdout, result.stderr


def parameters(**changes):
    text = (REPOSITORY / 'examples' / 'own_task' / 'stack.yaml').read_text(encoding='utf-8')
    blocks = yaml.safe_load(text)
    shared, own = (blocks[node]['ros__parameters'] for node in ('/**', '/**/tp_controller'))
    return shared | own | changes


@given(arms(min_joints=3), states(9))
@examples(60)
def test_the_jacobian_and_hessian_of_the_example_are_derivatives_of_its_distance(block, q):
    robot = robot_of(block)
    n, q = robot.n, q[: robot.n]
    task = FrameDistanceTask('apart', robot, f'link_{n}', 'link_1', target=[0.0])
    robot.update(q)
    assume(task.current[0] > 0.05)
    hessian = np.zeros((1, n, n))
    task.hessian(hessian)
    task.update()
    J = task.J.copy()
    slope, bend = np.zeros(n), np.zeros((n, n))
    for i in range(n):
        for sign in (1.0, -1.0):
            robot.update(q + sign * STEP * np.eye(n)[i])
            task.update()
            slope[i] += sign * task.current[0] / (2.0 * STEP)
            bend[:, i] += sign * task.J[0] / (2.0 * STEP)
    scale = max(1.0, float(np.abs(hessian).max()))
    np.testing.assert_allclose(J[0], slope, atol=1e-7 * scale)
    np.testing.assert_allclose(hessian[0], bend, atol=1e-6 * scale**2)


def test_the_example_reaches_its_target_in_a_stack():
    from tp_controller import Robot

    robot = Robot.from_dh([0.75, 0.5, 0.5], limits={'velocity': 1.0})
    apart = FrameDistanceTask('apart', robot, 'link_3', 'link_1', target=[0.6], gain=3.0)
    stack, q = Stack(robot, [apart, PostureTask('posture', robot)], rate=50.0), np.full(3, 0.4)
    for _ in range(300):
        q += stack.step(q).command / 50.0
    assert abs(apart.error[0]) < 1e-6
    with pytest.raises(InvalidValue, match='at least 0'):
        apart.target = [-1.0]


def test_an_installed_task_type_is_used_by_name(installed):
    block = parameters()
    block['tasks']['apart']['target'] = [0.6]
    output, log = run(
        installed,
        f"""
import numpy
from tp_controller import build_settings
stack = build_settings({block!r}).stack
stack.step(numpy.array([0.0, 0.6, 0.3]))
print(type(stack.tasks['apart']).__name__, stack.tasks['apart'].target[0])
""",
    )
    assert output.split() == ['FrameDistanceTask', '0.6']
    assert log == ''


def test_the_message_about_an_unknown_type_lists_installed_ones(installed):
    block = parameters()
    block['tasks']['apart']['type'] = 'frame_distances'
    output, _ = run(
        installed,
        f"""
from tp_controller import InvalidValue, build_settings
try:
    build_settings({block!r})
except InvalidValue as error:
    print(error)
""",
    )
    assert output.startswith("tasks.apart.type: got 'frame_distances'; accepts one of position, ")
    assert output.rstrip().endswith(', frame_distance')


MODULE = """
from tp_controller import PostureTask
from tp_controller.solvers import RecursiveSolver
class Fine(PostureTask):
    type = 'fine'
class Other(PostureTask):
    type = 'other'
class Clashing(PostureTask):
    type = 'position'
class Taken(PostureTask):
    type = 'taken'
    parameters = {'gain': None}
class Plain:
    type = 'plain'
class Scheme(RecursiveSolver):
    type = 'mine'
"""

POINTS = """
[console_scripts]
something = bad_kinds:main

[tp_controller.tasks]
gone = no_such_module:Task
broken = bad_module:Task
exits = exiting_module:Task
missing = bad_kinds:Missing
position = bad_kinds:Clashing
misnamed = bad_kinds:Other
plain = bad_kinds:Plain
taken = bad_kinds:Taken
fine = bad_kinds:Fine

[tp_controller.solvers]
mine = bad_kinds:Scheme
"""


def test_a_kind_that_cannot_be_used_has_one_line_in_the_log_and_stops_no_other(tmp_path):
    (tmp_path / 'bad_kinds.py').write_text(MODULE)
    (tmp_path / 'bad_module.py').write_text('raise OSError("two\\nlines")\n')
    (tmp_path / 'exiting_module.py').write_text('raise SystemExit(3)\n')
    for name, text in (('bad_kinds', POINTS), ('unreadable', '[tp_controller.tasks]\nno sense')):
        folder = tmp_path / f'{name}-1.0.dist-info'
        folder.mkdir()
        (folder / 'entry_points.txt').write_text(text)
    output, log = run(
        tmp_path,
        """
from tp_controller.solvers import SOLVER_TYPES
from tp_controller.tasks import TASK_TYPES
print(TASK_TYPES['position'].__name__, list(TASK_TYPES)[-1], list(SOLVER_TYPES)[-1])
""",
    )
    assert output.split() == ['PositionTask', 'fine', 'mine']
    lines = log.splitlines()
    expected = {
        'gone': 'ModuleNotFoundError',
        'broken': 'OSError: two lines',
        'exits': 'SystemExit: 3',
        'missing': 'AttributeError',
        'position': 'got a second kind of that name',
        'misnamed': "got Other with type 'other'; accepts type = 'misnamed'",
        'plain': 'got Plain; accepts a class derived from Task',
        'taken': 'got parameters gain',
    }
    assert len(lines) == len(expected) + 1
    assert 'unreadable' in lines[0]
    for line, (name, reason) in zip(lines[1:], expected.items(), strict=True):
        beginning = f'tp_controller.tasks {name} of the package bad_kinds is left out: '
        assert line.startswith(beginning + reason), line


def test_nothing_is_looked_for_as_long_as_only_own_kinds_are_asked_for(monkeypatch):
    def refuse():
        raise AssertionError('looked for other packages')

    monkeypatch.setattr(plugins, 'registered', refuse)
    registry = Registry(
        'tp_controller.tasks', {'posture': PostureTask}, partial(check_class, Task)
    )
    assert registry['posture'] is PostureTask
    assert 'posture' in registry
    with pytest.raises(AssertionError):
        registry.get('other')


def test_a_kind_is_looked_for_once(monkeypatch, caplog):
    calls = []

    def found():
        calls.append(1)
        return (Registered('package', 'group', 'gone', 'no_such_module:Task'),)

    monkeypatch.setattr(plugins, 'registered', found)
    registry = Registry('group', {'posture': PostureTask}, partial(check_class, Task))
    with caplog.at_level(logging.WARNING, 'tp_controller'):
        assert list(registry) == ['posture']
        assert len(registry) == 1
        assert registry.get('other') is None
    assert calls == [1]
    assert len(caplog.records) == 1


def test_a_class_of_this_process_can_be_added_once():
    registry = Registry('group', {'posture': PostureTask}, partial(check_class, Task))
    registry.add('frame_distance', FrameDistanceTask)
    assert list(registry) == ['posture', 'frame_distance']
    with pytest.raises(InvalidValue, match='a second kind of that name'):
        registry.add('frame_distance', FrameDistanceTask)
    with pytest.raises(InvalidValue, match=r'Task without .*current'):
        registry.add('task', Task)


def test_the_entry_points_found_are_those_of_importlib(installed):
    output, _ = run(
        installed,
        """
from importlib.metadata import entry_points
from tp_controller.objectives import OBJECTIVE_TYPES
from tp_controller.plugins import registered
groups = ['tp_controller.tasks', 'tp_controller.goals']
expected = {(p.group, p.name, p.value) for group in groups for p in entry_points(group=group)}
assert {(p.group, p.name, p.value) for p in registered()} == expected
print(len(expected))
""",
    )
    assert output.split() == ['2']


def test_the_page_on_own_kinds_has_every_group():
    page = (REPOSITORY / 'docs' / 'own_kinds.md').read_text(encoding='utf-8')
    for registry in (TASK_TYPES, SOLVER_TYPES, OBJECTIVE_TYPES):
        assert f'| `{registry.group}` |' in page

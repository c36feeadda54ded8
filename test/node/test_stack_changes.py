"""Changes of a running stack over real services: in one, as a transition, and saved."""

import numpy as np
import pytest
from rcl_interfaces.srv import GetParameters

from tp_controller import build_settings, read_parameter_file
from tp_controller.robot import Limits
from tp_controller.transition import largest_change
from tp_interfaces.srv import Change, Save
from tp_sim.harness import ClosedLoop
from tp_sim.harness.record import stamp_ns


@pytest.fixture(scope='module')
def loop(config):
    patient = {'tp_controller': {'timeouts': {'joint_state': 60.0}}}
    with ClosedLoop(config / 'b3_pressed.yaml', patient) as loop:
        yield loop


def change(loop, text):
    return loop.client.call(Change, 'tp_controller/change', Change.Request(parameters=text))


def save(loop, path, overwrite=False):
    request = Save.Request(path=str(path), overwrite=overwrite)
    return loop.client.call(Save, 'tp_controller/save', request)


def get(loop, name):
    request = GetParameters.Request(names=[name])
    return loop.client.call(GetParameters, 'tp_controller/get_parameters', request).values[0]


def test_several_changes_in_one_are_a_transition_and_can_be_saved(loop, tmp_path):
    loop.reset()
    loop.send_goal('ee_position', [0.7, 0.9])
    loop.run(0.5)
    # A state that is answered again has not been moved by the first answer.
    commands = {}
    loop.client.on_state.append(lambda msg: commands.update({stamp_ns(msg): msg.command}))
    response = change(
        loop,
        """
        transition_time: 1.0
        solver: {type: hqp, saturation: uniform}
        tasks:
          obstacle_3: null
          joint_1_range: {enabled: false}
          elbow: {type: joint, joints: [joint_2], target: [0.5], gain: [2.0]}
        hierarchy: [obstacle_1, joint_1_range, elbow, ee_position]
        """,
    )
    assert (response.success, response.message) == (True, '')
    loop.step(5)
    assert 'transition' in loop.state.message
    tasks = {task.name: task for task in loop.state.tasks}
    assert 'obstacle_3' not in tasks
    assert (tasks['elbow'].level, tasks['elbow'].enabled) == (2, True)
    assert (tasks['joint_1_range'].level, tasks['joint_1_range'].enabled) == (1, False)
    assert (tasks['obstacle_2'].level, tasks['obstacle_2'].enabled) == (-1, False)
    assert get(loop, 'solver.type').string_value == 'hqp'
    loop.run(2.0)
    assert 'transition' not in loop.state.message
    assert loop.client.task('elbow').error_norm < 0.02
    limits = Limits(3, velocity=[1.5], acceleration=[10.0])
    changes = np.abs(np.diff(np.array(list(commands.values())), axis=0))
    assert np.all(changes <= largest_change(limits, 1.0 / 60.0, 1.0) * (1.0 + 1e-9))

    path = tmp_path / 'saved.yaml'
    assert save(loop, path).success
    refused = save(loop, path)
    assert not refused.success
    assert 'which exists; accepts a new file, or overwrite: true' in refused.message
    assert save(loop, path, overwrite=True).success
    values = read_parameter_file(path, 'tp_controller')
    stack = build_settings(values).stack
    assert stack.hierarchy == ('obstacle_1', 'joint_1_range', 'elbow', 'ee_position')
    assert values['tasks.ee_position.target'] == [0.7, 0.9]
    assert not stack.tasks['joint_1_range'].enabled
    with ClosedLoop(path, {'tp_sim': {'initial_positions': [0.0, 0.7, 0.8]}}) as other:
        names = [task.name for task in loop.state.tasks]
        assert [task.name for task in other.state.tasks] == names


def test_one_bad_change_refuses_them_all(loop):
    before = [task.name for task in loop.state.tasks], loop.client.task('ee_position').level
    response = change(
        loop, '{tasks: {ball: {type: posture}, obstacle_2: null}, hierarchy: [nose]}'
    )
    assert not response.success
    assert response.message.startswith("hierarchy: got 'nose'; accepts names out of")
    loop.step(1)
    assert ([task.name for task in loop.state.tasks], loop.client.task('ee_position').level) == (
        before
    )
    response = change(loop, '[1, 2]')
    assert response.message.startswith("parameters: got '[1, 2]'; accepts YAML of what stands")


def test_tasks_are_switched_by_parameter_and_without_any_the_arm_rests(loop):
    loop.set_parameters({f'tasks.{name}.enabled': False for name in ('elbow', 'ee_position')})
    loop.set_parameters({'tasks.obstacle_1.enabled': False, 'hierarchy': ['elbow', 'ee_position']})
    loop.run(2.0)
    assert loop.state.message.startswith('every task of the hierarchy is off: at rest')
    loop.set_parameters({'tasks.ee_position.enabled': True})
    loop.step(1)
    assert loop.client.task('ee_position').enabled
    assert loop.client.task('ee_position').level == 1

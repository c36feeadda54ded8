"""Tasks added to a running controller and removed from it, over real services."""

import pytest
from rcl_interfaces.srv import GetParameters
from visualization_msgs.msg import MarkerArray

from tp_interfaces.srv import AddTask, RemoveTask
from tp_sim.harness import ClosedLoop

BALL = '{type: obstacle, frame: link_3, axes: xy, center: [-0.1, 0.4], radius: 0.2}'


@pytest.fixture(scope='module')
def loop(config):
    with ClosedLoop(config / 'b1_obstacles.yaml') as loop:
        yield loop


def add(loop, name='ball', parameters=BALL, level=0):
    request = AddTask.Request(name=name, parameters=parameters, level=level)
    return loop.client.call(AddTask, 'tp_controller/add_task', request)


def remove(loop, name='ball'):
    return loop.client.call(RemoveTask, 'tp_controller/remove_task', RemoveTask.Request(name=name))


def hierarchy(loop):
    request = GetParameters.Request(names=['hierarchy'])
    response = loop.client.call(GetParameters, 'tp_controller/get_parameters', request)
    return list(response.values[0].string_array_value)


def names(loop):
    return [task.name for task in loop.client.state.tasks]


def test_an_obstacle_comes_moves_and_goes_while_the_arm_runs(loop):
    loop.reset()
    loop.send_goal('ee_position', [-0.1, 0.4])
    loop.run(6.0)
    inside = loop.client.task('ee_position').error_norm
    before = names(loop)
    response = add(loop)
    assert (response.success, response.message) == (True, '')
    loop.step(1)
    ball = loop.client.task('ball')
    assert ball.level == 0
    assert ball.enabled
    assert hierarchy(loop)[0] == 'ball'
    loop.run(6.0)
    assert loop.client.task('ball').distance[0] > 0.0
    assert loop.client.task('ee_position').error_norm > max(inside, 0.15)
    loop.send_goal('ball', [-0.5, 0.2])
    assert list(loop.client.task('ball').desired) == [-0.5, 0.2]
    assert remove(loop).success
    loop.run(6.0)
    assert names(loop) == before
    assert loop.client.task('ee_position').error_norm == pytest.approx(inside, abs=0.01)
    assert add(loop, level=4).success
    loop.step(1)
    assert loop.client.task('ball').level == 4
    assert remove(loop).success


def test_the_parameters_of_an_added_task_come_and_go_with_it(loop):
    assert add(loop, level=-1).success
    loop.step(1)
    assert loop.client.task('ball').level == -1
    loop.set_parameters({'tasks.ball.gain': [2.0]})
    with pytest.raises(Exception, match='a change while running'):
        loop.set_parameters({'tasks.ball.radius': 0.3})
    assert remove(loop).success
    with pytest.raises(Exception, match='unknown parameter'):
        loop.set_parameters({'tasks.ball.gain': [2.0]})


def test_markers_of_an_obstacle_go_with_it(loop):
    def obstacles():
        arrays = loop.client.collect(MarkerArray, 'tp_controller/markers')
        loop.client.wait_for(lambda: bool(arrays), 'markers')
        return [m for m in arrays[-1].markers if m.ns == 'obstacle' and m.action == m.ADD]

    assert len(obstacles()) == 3
    assert add(loop).success
    assert len(obstacles()) == 4
    assert remove(loop).success
    assert len(obstacles()) == 3


def test_a_task_of_the_file_goes_and_another_one_of_its_name_comes(loop):
    assert remove(loop, 'obstacle_3').success
    assert add(loop, 'obstacle_3').success
    request = GetParameters.Request(names=['tasks.obstacle_3.radius'])
    response = loop.client.call(GetParameters, 'tp_controller/get_parameters', request)
    assert response.values[0].double_value == 0.2
    loop.step(1)
    assert loop.client.task('obstacle_3').level == 0


@pytest.mark.parametrize(
    ('changes', 'message'),
    [
        ({'name': 'obstacle_1'}, 'tasks.obstacle_1: got a second task of that name'),
        ({'name': 'a b'}, "tasks.a b: got a task called 'a b'"),
        ({'parameters': ''}, "parameters: got ''; accepts YAML of a task"),
        ({'parameters': '{type: ['}, 'parameters: got '),
        ({'parameters': '{type: ball}'}, "tasks.ball.type: got 'ball'; accepts one of"),
        ({'parameters': BALL.replace('0.2}', '-0.2}')}, 'tasks.ball.radius: got -0.2'),
        ({'parameters': BALL.replace('link_3', 'hand')}, "tasks.ball.frame: got 'hand'"),
        ({'parameters': '{center: 2001-99-99}'}, 'parameters: got '),
        ({'parameters': '{type: obstacle, type: position}'}, "parameters: got '{type: obstacle"),
        ({'parameters': '{[a]: 1}'}, "parameters: got '{[a]: 1}': a key that is not a text"),
        ({'parameters': '&a {type: obstacle, b: *a}'}, 'parameters: got an alias'),
        ({'parameters': '[' * 5000}, 'parameters: got more than 8 blocks inside each other'),
        ({'parameters': f'[{"a," * 9000}]'}, 'parameters: got more than 5000 values'),
        ({'parameters': f'{{type: {"a" * 70000}}}'}, 'parameters: got 70008 characters'),
        ({'name': 'b' * 300}, 'tasks.bbb'),
        ({'level': 9}, 'level: got 9; accepts -1 (idle) or 0 (highest) to 4 (lowest)'),
    ],
)
def test_what_cannot_be_added_is_refused_and_changes_nothing(loop, changes, message):
    before = names(loop)
    response = add(loop, **changes)
    assert not response.success
    assert response.message.startswith(message)
    assert '\n' not in response.message
    loop.step(1)
    assert names(loop) == before


def test_what_cannot_be_removed_is_refused(loop):
    response = remove(loop, 'cube')
    assert not response.success
    assert response.message.startswith("name: got 'cube'; accepts one of obstacle_1")


def test_without_its_last_task_the_hierarchy_is_empty_and_takes_another_one(loop):
    before = hierarchy(loop)
    loop.set_parameters({'hierarchy': ['']})
    assert add(loop).success
    loop.step(1)
    assert hierarchy(loop) == ['ball']
    assert 'no task' not in loop.state.message
    assert remove(loop).success
    loop.run(1.0)
    assert hierarchy(loop) == ['']
    assert loop.state.message.startswith('no task in the hierarchy: at rest')
    loop.set_parameters({'hierarchy': before})


def test_what_makes_the_arm_less_safe_is_a_warning(loop):
    def warnings():
        return [line for line in loop.controller.output.splitlines() if 'less safe' in line]

    loop.set_parameters({'hierarchy': ['obstacle_1', 'obstacle_2', 'ee_position']})
    count = len(warnings())
    loop.set_parameters({'robot.limits.velocity': [5.0]})
    assert 'robot.limits.velocity is wider: joint_1' in warnings()[-1]
    assert remove(loop, 'obstacle_1').success
    assert 'obstacle_1 leaves the hierarchy' in warnings()[-1]
    assert add(loop, 'first', '{type: posture}', 0).success
    assert 'obstacle_2 loses priority to first' in warnings()[-1]
    assert remove(loop, 'first').success
    loop.set_parameters({'robot.limits.velocity': [1.0]})
    assert len(warnings()) == count + 3


def test_requests_wait_for_each_other_and_a_first_one_reads_meshes(config):
    text = '{type: obstacle, whole_arm: true, center: [0.5, 0.3, 0.9], radius: 0.1}'
    with ClosedLoop(config / 'panda.yaml', lockstep=False) as loop:
        client = loop.client
        service = client.node.create_client(AddTask, 'tp_controller/add_task')
        client.wait_for(service.service_is_ready, 'the service')
        futures = [
            service.call_async(AddTask.Request(name=name, parameters=text, level=0))
            for name in ('one', 'two', 'two')
        ]
        client.wait_for(lambda: all(future.done() for future in futures), 'the answers')
        assert [future.result().success for future in futures] == [True, True, False]
        assert 'a second task of that name' in futures[2].result().message

        def levels():
            return {task.name: task.level for task in loop.state.tasks}

        # States from before may still come in.
        wanted = {'two': 0, 'one': 1, 'hand_position': 2}
        client.wait_for(lambda: wanted.items() <= levels().items(), 'their levels')

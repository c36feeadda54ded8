"""The page's server beside running nodes; a bare connection stands in for the browser."""

import signal

import numpy as np
import pytest
from page_client import PageClient

from tp_controller.errors import InvalidValue
from tp_controller.recording import Recording
from tp_controller.view.page import Page
from tp_interfaces.srv import AddTask, RemoveTask
from tp_sim.harness import ClosedLoop, NodeProcess, PrivateDomain


@pytest.fixture(scope='module')
def loop(config):
    with ClosedLoop(config / 'a4_position_joint.yaml', lockstep=False) as loop:
        yield loop


def started(environment, *arguments):
    page = NodeProcess(
        'tp_controller', 'view', None, environment, arguments=['--port', '0', *arguments]
    )
    page.wait_for_output('view: http', timeout=60.0)
    return page, page.output.split('view: ')[1].split()[0]


@pytest.fixture(scope='module')
def page(loop):
    page, address = started(loop.environment)
    client = PageClient(address)
    client.wait_for(lambda: client.element('TransformControlsMessage'))
    client.wait_for(lambda: client.element('GuiSliderMessage', 'joint_1'))
    client.address, client.process = address, page
    yield client
    client.close()
    assert page.stop() == 0
    assert 'Traceback' not in page.output


def drag(client, position, phase='Update'):
    name = client.element('TransformControlsMessage')['name']
    pose = {'wxyz': (1.0, 0.0, 0.0, 0.0), 'position': position} if phase == 'Update' else {}
    client.send(type=f'TransformControls{phase}Message', name=name, owner='', **pose)


def test_a_dragged_target_is_an_ordinary_goal_and_other_browsers_see_it(loop, page):
    other = PageClient(page.address)
    drag(page, (), 'DragStart')
    drag(page, (0.9, 0.6, 0.0))
    drag(page, (0.8, 0.7, 0.3))
    drag(page, (), 'DragEnd')
    loop.client.wait_for(
        lambda: np.allclose(loop.client.task('ee_position').desired, [0.8, 0.7]), 'the goal'
    )
    moves = [0.8, 0.7]
    other.wait_for(
        lambda: any(
            np.allclose(m['position'][:2], moves)
            for m in other.messages
            if m['type'] == 'SetPositionMessage' and m['name'] == '/targets/ee_position'
        )
    )
    other.close()


def test_a_slider_moves_a_joint(loop, page):
    page.set(page.element('GuiSliderMessage', 'joint_1'), 0.3)
    loop.client.wait_for(
        lambda: np.allclose(loop.client.task('joint_1_position').desired, [0.3]), 'the goal'
    )


def test_a_task_that_comes_while_it_runs_is_drawn_beside_the_arm(loop, page):
    request = AddTask.Request(name='ball', level=0)
    request.parameters = '{type: obstacle, frame: link_3, axes: xy, center: [-1, 1], radius: 0.2}'
    page.messages.clear()
    assert loop.client.call(AddTask, 'tp_controller/add_task', request).success
    page.wait_for(lambda: page.element('TransformControlsMessage'))
    page.wait_for(lambda: page.element('GuiSliderMessage', 'joint_1'))
    page.wait_for(lambda: page.element('GuiTextMessage', 'gain [1/s]'))
    names = {message.get('name') for message in page.messages if 'props' in message}
    assert '/obstacles/ball/solid' in names
    assert '/arm/bone_0' not in names


def test_a_refused_change_is_told(page):
    gain = page.element('GuiTextMessage', 'gain [1/s]')
    form = next(
        m for m in page.messages
        if m['type'] == 'GuiFormMessage' and m['uuid'] == gain['container_uuid']
    )  # fmt: skip
    page.set(gain, '1 2 3 4 5')
    page.send(type='GuiFormSubmitMessage', uuid=form['uuid'])
    page.wait_for(lambda: 'NotificationShowMessage' in page.kinds())
    told = page.element('NotificationShowMessage')
    assert 'refused: tasks.' in str(told)


def test_a_task_that_becomes_one_of_another_type_takes_goals(loop, page):
    call = loop.client.call
    assert call(
        RemoveTask, 'tp_controller/remove_task', RemoveTask.Request(name='joint_1_position')
    ).success
    request = AddTask.Request(name='joint_1_position', level=1)
    request.parameters = '{type: orientation, frame: link_2, axes: z}'
    page.messages.clear()
    assert call(AddTask, 'tp_controller/add_task', request).success
    page.wait_for(lambda: '/targets/joint_1_position' in str(page.messages))
    assert page.process.running


def test_hold_that_is_pressed_again_goes_on_holding(loop, page):
    client = PageClient(page.address)
    client.wait_for(lambda: client.element('GuiButtonMessage', 'Resume'))
    for _ in range(2):
        client.set(client.element('GuiButtonMessage', 'Hold'), True)
        loop.client.wait_for(lambda: loop.state.held, 'the hold')
        client.wait_for(lambda: 'held by ~/hold' in str(client.messages))
        client.messages[:] = [m for m in client.messages if m['type'] == 'GuiButtonMessage']
    client.receive(1.0)
    assert loop.state.held
    client.set(client.element('GuiButtonMessage', 'Resume'), True)
    loop.client.wait_for(lambda: not loop.state.held, 'its end')
    client.close()


def test_a_recording_starts_and_ends_with_a_button(loop, tmp_path):
    page, address = started(loop.environment, '--folder', str(tmp_path))
    client = PageClient(address)
    client.wait_for(lambda: client.element('GuiButtonMessage', 'Start recording'))
    button = client.element('GuiButtonMessage', 'Start recording')
    name = client.element('GuiTextMessage', 'name')

    def press(name_, said):
        client.messages.clear()
        client.set(name, name_)
        client.set(button, True)
        client.wait_for(lambda: said in str(client.messages))

    try:
        press('../run', "refused: file: got '../run'")
        path = tmp_path / 'first.mcap'
        press('first', 'Stop recording')
        # The page waits for as long as nothing is in the file.
        loop.client.wait_for(lambda: path.exists() and path.stat().st_size > 40_000, 'the file')
        press('first', f'recorded: {path}')
        assert Recording(path).complete
        assert Recording(path).controller == '/tp_controller'
        press('first', 'which exists')
        second = tmp_path / 'second.mcap'
        press('second.mcap', 'Stop recording')
        loop.client.wait_for(
            lambda: second.exists() and second.stat().st_size > 40_000, 'the second file'
        )
    finally:
        client.close()
        assert page.stop() == 0
    # The page finishes its file before it ends.
    assert Recording(second).complete


def test_pages_of_other_sites_are_not_let_in(page):
    client = PageClient(page.address, origin='http://example.org')
    client.receive(20.0)
    assert client.closed
    assert not client.messages


def test_a_page_to_be_shared_has_no_control(loop):
    page, address = started(loop.environment, '--read-only', '--host', '0.0.0.0')
    client = PageClient(address)
    try:
        client.wait_for(lambda: 'RUNNING' in client.text())
        client.wait_for(lambda: 'position* of `link_3`' in client.text())
        controls = {'GuiButtonMessage', 'GuiButtonGroupMessage', 'GuiSliderMessage',
                    'GuiTextMessage', 'TransformControlsMessage'}  # fmt: skip
        assert not controls & client.kinds()
        assert 'open to the network: whoever reaches this machine can watch' in page.output
        goals = loop.client.node.get_publishers_info_by_topic('/tp_controller/ee_position/goal')
        assert f'tp_view_{page.pid}' not in {info.node_name for info in goals}
    finally:
        client.close()
        assert page.stop() == 0


def test_it_waits_for_a_controller_and_survives_its_restarts(config):
    domain = PrivateDomain()
    file = config / 'a4_position_joint.yaml'
    page, address = started(domain.environment())
    client = PageClient(address)
    simulator = NodeProcess('tp_sim', 'simulator', file, domain.environment())
    try:
        client.wait_for(lambda: 'waiting for /tp_controller: no state' in client.text())
        controller = NodeProcess('tp_controller', 'controller', file, domain.environment())
        client.wait_for(lambda: client.element('GuiSliderMessage', 'joint_1'))
        controller.signal(signal.SIGKILL)
        controller.wait()
        client.messages.clear()
        client.wait_for(lambda: 'waiting for /tp_controller: no state' in client.text())
        # With a joint more: it is not drawn as the robot of before.
        simulator.stop()
        other = config / 'c1_algorithmic_singularity.yaml'
        simulator = NodeProcess('tp_sim', 'simulator', other, domain.environment())
        controller = NodeProcess('tp_controller', 'controller', other, domain.environment())
        client.wait_for(lambda: '/arm/bone_3' in str(client.messages))
        controller.stop()
    finally:
        client.close()
        simulator.stop()
        assert page.stop() == 0
        domain.close()
    assert 'Traceback' not in page.output


def test_what_cannot_be_used_is_told_in_one_line(loop):
    arguments = ['--host', '192.0.2.1']
    page = NodeProcess('tp_controller', 'view', None, loop.environment, arguments=arguments)
    assert page.wait(60.0) == 2
    assert page.output.startswith("view: host: got '192.0.2.1' (")
    assert page.output.count('\n') == 1
    with pytest.raises(InvalidValue, match='port: got 70000; accepts a number from 0'):
        Page(port=70000)
    page = NodeProcess(
        'tp_controller', 'view', None, loop.environment, arguments=['--simulator', 'a b']
    )
    assert page.wait(60.0) == 2
    assert page.output.startswith('view: Invalid service name: ')
    assert page.output.count('\n') == 1

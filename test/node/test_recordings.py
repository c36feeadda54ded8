"""Recordings of real nodes: complete, readable by others, and replayed to the last bit."""

import os
import signal
import subprocess

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from page_client import PageClient
from std_srvs.srv import SetBool

from tp_controller import state_words as words
from tp_controller.config import build_settings, read_parameter_file
from tp_controller.errors import InvalidValue
from tp_controller.recording import Recording, RecordingWriter, run_of
from tp_controller.ros.replay import report
from tp_controller.ros.replaying import Replay
from tp_interfaces.srv import AddTask, RemoveTask
from tp_sim.harness import ClosedLoop, NodeProcess, executable_path

NODE = '/arm/tp_controller'
TURN = '{type: orientation, frame: link_2, axes: z, target: [0.0], gain: [2.0]}'


def command(loop, *arguments):
    return NodeProcess('tp_controller', 'record', None, loop.environment, (), arguments)


def readable(path):
    """Whether states are on the disk."""
    try:
        return bool(Recording(path).states())
    except InvalidValue:
        return False


def move(loop):
    """Everything that can move the arm, one after the other."""
    loop.run(0.3)
    loop.send_goal('ee_position', [0.3, 1.2])
    loop.send_feedforward('ee_position', [0.05, 0.0])
    loop.run(0.8)
    loop.set_parameters({'hierarchy': ['joint_1_position', 'ee_position']})
    loop.run(0.2)
    loop.set_parameters({'tasks.ee_position.gain': [3.0], 'solver.type': 'hqp'})
    loop.run(0.2)
    hold = 'tp_controller/hold'
    loop.client.call(SetBool, hold, SetBool.Request(data=True))
    loop.run(0.2)
    loop.client.call(SetBool, hold, SetBool.Request(data=False))
    loop.reach({'ee_position': [0.8, 0.9]}, tolerance=0.2)
    request = AddTask.Request(name='turn', parameters=TURN, level=1)
    assert loop.client.call(AddTask, 'tp_controller/add_task', request).success
    loop.run(0.5)
    loop.client.call(RemoveTask, 'tp_controller/remove_task', RemoveTask.Request(name='turn'))
    loop.run(0.2)


@pytest.fixture(scope='module')
def made(config, tmp_path_factory):
    """A run that was recorded twice: from its start by the harness, and by the command."""
    folder = tmp_path_factory.mktemp('recordings')
    whole, late = folder / 'whole.mcap', folder / 'late.mcap'
    # Braking in a pause of this test is not replayed.
    patience = {'tp_controller': {'timeouts': {'joint_state': 60.0}}}
    with ClosedLoop(
        config / 'a4_position_joint.yaml', patience, namespace='arm', record=whole
    ) as loop:
        process = command(loop, str(late), '--controller', NODE)
        loop.client.wait_for(lambda: NODE in process.output, 'record')
        killed = folder / 'killed.mcap'
        victim = command(loop, str(killed), '--controller', NODE)
        for path in (late, killed):
            loop.client.wait_for(lambda path=path: loop.step(5) or readable(path), 'its file')
        os.kill(victim.pid, signal.SIGKILL)
        move(loop)
        kept = loop.record
        process.interrupt()
        loop.client.wait_for(lambda: not process.running, 'the end of record')
        assert process.wait() == 0
        output = process.output
    return whole, late, kept, output


def test_a_recording_has_what_the_harness_saw(made):
    whole, _, kept, _ = made
    recording = Recording(whole)
    run = run_of(recording.states())
    assert recording.complete
    count = len(kept.time)
    assert run.time.size >= count
    assert np.array_equal(run.q[:count], kept.q)
    assert np.array_equal(run.command[:count], kept.qd)
    for name, errors in kept.error.items():
        assert np.array_equal(run.task(name).error[:count], errors)


def test_another_reader_finds_messages_with_their_definitions(made):
    with made[0].open('rb') as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        assert reader.get_header().profile == 'ros2'
        found = {}
        for schema, channel, _, message in reader.iter_decoded_messages():
            assert channel.message_encoding == 'cdr'
            assert schema.encoding == 'ros2msg'
            found.setdefault(channel.topic, []).append(message)
        attached = {attachment.name for attachment in reader.iter_attachments()}
    assert attached == {'parameters.yaml', 'robot.urdf'}
    topics = ['joint_states', 'joint_velocity_command', 'robot_description']
    topics += [f'tp_controller/{name}' for name in ('state', 'ee_position/goal', 'markers')]
    assert {f'/arm/{name}' for name in topics} | {'/diagnostics', '/parameter_events'} <= set(
        found
    )
    assert found['/arm/tp_controller/ee_position/goal'][0].point.y == 1.2
    assert '<robot' in found['/arm/robot_description'][0].data
    commands = found['/arm/joint_velocity_command']
    states = {(s.header.stamp.sec, s.header.stamp.nanosec): s for s in found[f'{NODE}/state']}
    # Zero commands of the end answer no joint state.
    for sent in commands[:-20]:
        state = states[sent.header.stamp.sec, sent.header.stamp.nanosec]
        assert list(sent.name) == list(state.joint_names)


def test_its_parameters_build_the_same_stack(made, config):
    recording = Recording(made[0])
    given = read_parameter_file(config / 'a4_position_joint.yaml', 'tp_controller')
    given['timeouts.joint_state'] = 60.0
    asked, found = build_settings(given), build_settings(recording.parameters)
    assert found.values == asked.values
    assert recording.controller == NODE


def test_the_command_records_late_topics_too_and_says_what_is_there(made):
    _, late, _, output = made
    recording = Recording(late)
    assert recording.complete
    assert f'{NODE}/turn/goal' in recording.types
    assert f'record: {late}: {recording.contents.text}' in output
    assert f'{NODE}/state' in output
    run = run_of(recording.states())
    assert {task.name for task in run.tasks} >= {'ee_position', 'joint_1_position', 'turn'}


def test_a_replay_of_everything_is_equal_to_the_last_bit(made):
    replay = Replay(Recording(made[0]))
    answers = list(replay.answers())
    assert len(answers) > 150
    assert report(answers, replay.joints) == [
        f'replay: {len(answers)} commands, all equal to the last bit'
    ]
    assert not replay.notes


def test_the_replay_of_another_stack_tells_the_first_difference(made, tmp_path):
    # The gain is 1.0 in the file, as a text of the attachment that is not compressed.
    changed = tmp_path / 'changed.mcap'
    data = made[0].read_bytes()
    assert data.count(b'gain: [1.0]') == 2
    changed.write_bytes(data.replace(b'gain: [1.0]', b'gain: [1.5]'))
    process = subprocess.run(
        [executable_path('tp_controller', 'replay'), str(changed)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert process.returncode == 1, process.stderr
    first = process.stdout.splitlines()
    assert first[0].startswith('replay: ')
    assert first[1].startswith('  first at 0.000 s, cycle 1: joint_')


def test_the_page_shows_any_moment_of_it_and_plays(made):
    page = NodeProcess(
        'tp_controller', 'view', None, dict(os.environ), (), [str(made[0]), '--port', '0']
    )
    page.wait_for_output('view: http', timeout=60.0)
    client = PageClient(page.output.split('view: ')[1].split()[0])
    slider = client.wait_for(lambda: client.element('GuiSliderMessage', 'time [s]'))
    run = run_of(Recording(made[0]).states())
    assert slider['props']['max'] == pytest.approx(run.time[-1], abs=1e-3)
    middle = len(run.time) // 2
    client.set(slider, float(run.time[middle]) + 0.001)
    left = f'{words.number(run.task("ee_position").error_norm[middle])}'
    client.wait_for(lambda: f'ee_position · error {left}' in str(client.messages))
    assert 'read-only' in client.text()
    button = client.element('GuiButtonMessage', 'Play')
    client.set(button, True)
    label = {'uuid': button['uuid'], 'updates': {'label': 'Pause'}}
    client.wait_for(lambda: any(label.items() <= message.items() for message in client.messages))
    client.close()
    assert page.stop() == 0
    assert 'Traceback' not in page.output


def test_a_recording_of_a_real_time_run_is_replayed_too(config, tmp_path):
    path = tmp_path / 'real.mcap'
    with ClosedLoop(config / 'b1_obstacles.yaml', lockstep=False, record=path) as loop:
        loop.send_goal('ee_position', [-0.9, 0.9])
        loop.run(0.5)
    replay = Replay(Recording(path))
    answers = list(replay.answers())
    # A command that came too late was braking, which no state tells.
    assert all(answer.same for answer in answers) or replay.notes


@pytest.mark.parametrize('share', [0.3, 0.6, 0.99])
def test_a_file_that_breaks_off_is_read_up_to_there(made, tmp_path, share):
    path = tmp_path / 'part.mcap'
    data = made[0].read_bytes()
    path.write_bytes(data[: int(share * len(data))])
    recording = Recording(path)
    assert not recording.complete
    part, whole = run_of(recording.states()), run_of(Recording(made[0]).states())
    count = len(part.time)
    # The last state that is left may be one of several about its joint state.
    assert np.array_equal(part.command[: count - 1], whole.command[: count - 1])
    assert count > (share - 0.3) * len(whole.time)


def test_a_recording_whose_process_is_killed_can_be_read(made):
    recording = Recording(made[0].with_name('killed.mcap'))
    assert not recording.complete
    assert recording.states()


def test_what_cannot_be_used_is_one_line_and_leaves_no_file(tmp_path):
    there = tmp_path / 'there.mcap'
    there.write_bytes(b'something else')
    with pytest.raises(InvalidValue, match='no MCAP file'):
        Recording(there)
    with pytest.raises(InvalidValue, match='a readable file'):
        Recording(tmp_path / 'nothing.mcap')
    with pytest.raises(InvalidValue, match='which exists; accepts a new file, or --overwrite'):
        RecordingWriter(there)
    with pytest.raises(InvalidValue, match=r'accepts a file that ends in \.mcap'):
        RecordingWriter(tmp_path / 'run.bag')
    assert there.read_bytes() == b'something else'
    words = ['--seconds', '0.2', '--controller', '/nobody']
    result = subprocess.run(
        [executable_path('tp_controller', 'record'), str(tmp_path / 'none.mcap'), *words],
        capture_output=True,
        text=True,
        check=False,
    )
    assert result.returncode == 1, result.stderr
    assert 'record: no state of /nobody, no file' in result.stderr
    assert [path.name for path in tmp_path.iterdir()] == ['there.mcap']


@pytest.mark.parametrize(
    'arguments', [['--seconds', 'abc'], ['--seconds', '0'], ['--controller', 'a b']]
)
def test_arguments_that_cannot_be_used_are_told_in_one_line(arguments, tmp_path):
    file = tmp_path / 'run.mcap'
    process = subprocess.run(
        [executable_path('tp_controller', 'record'), str(file), *arguments],
        capture_output=True,
        text=True,
        check=False,
    )
    assert process.returncode == 2
    assert process.stderr.startswith('record: ')
    assert process.stderr.count('\n') == 1
    assert not file.exists()

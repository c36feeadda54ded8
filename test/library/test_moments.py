"""States of a recording are found by their time, whatever the file's length, and soon."""

import numpy as np
import pytest
from made_recording import make_recording
from mcap.reader import make_reader

from tp_controller.errors import InvalidValue
from tp_controller.recording import Moments, Recording, RecordingWriter, run_of
from tp_controller.recording.index import read_part
from tp_controller.recording.moments import PARTS, STATES
from tp_controller.recording.writer import FROM
from tp_controller.ros.message_definitions import full_definition

STATE = 'tp_interfaces/msg/ControllerState'


@pytest.fixture(scope='module')
def path(tmp_path_factory):
    folder = tmp_path_factory.mktemp('moments')
    goals = [(0.5, 'ee_position', [0.3, 1.2])]
    return make_recording(folder / 'run.mcap', 'a4_position_joint', 6.0, goals)


@pytest.fixture(scope='module')
def run(path):
    return run_of(Recording(path).states())


@pytest.fixture(params=[1.0, 0.7], ids=['whole', 'broken off'])
def part(request, path, tmp_path):
    data = path.read_bytes()
    file = tmp_path / 'run.mcap'
    file.write_bytes(data[: int(request.param * len(data))])
    recording = Recording(file)
    assert recording.complete == (request.param == 1.0)
    return recording


def test_the_state_of_any_time_is_that_of_the_last_cycle(part, run):
    moments = Moments(part)
    kept = run_of(part.states())
    assert moments.seconds == pytest.approx(kept.time[-1])
    times = np.random.default_rng(1).uniform(0.0, moments.seconds, 60)
    for time in [*times, 0.0, -1.0, moments.seconds, moments.seconds + 1.0]:
        i = max(int(np.searchsorted(kept.time, time, 'right')) - 1, 0)
        found = moments.at(float(time))
        assert found.time == pytest.approx(run.time[i])
        assert np.array_equal(found.state.position, run.q[i])


def test_what_was_before_comes_in_order_and_no_finer_than_asked(path, run):
    found = list(Moments(Recording(path)).before(4.0, 2.5, 0.1))
    times = np.array([moment.time for moment in found])
    assert times[0] == pytest.approx(1.6, abs=0.02)
    assert times[-1] == pytest.approx(4.0, abs=0.02)
    assert np.all(np.diff(times) > 0.08)
    for moment in found:
        i = int(np.argmin(np.abs(run.time - moment.time)))
        assert np.array_equal(moment.state.command, run.command[i])


def test_the_index_says_the_same_as_all_messages(path, tmp_path, monkeypatch):
    quick = Recording(path)
    monkeypatch.setattr('tp_controller.recording.reader.read_index', lambda _: None)
    slow = Recording(path)
    assert quick.complete
    assert (quick.types, quick.contents) == (slow.types, slow.contents)
    assert quick.parameter_text == slow.parameter_text
    assert (quick.facts, quick.state) == (slow.facts, slow.state)


def test_of_a_long_recording_little_is_read_and_kept(path, tmp_path, monkeypatch):
    long, count = tmp_path / 'long.mcap', 20_000
    data = bytearray(first_state(path))
    with RecordingWriter(long) as writer:
        topic = writer.add_topic('/tp_controller/state', STATE, full_definition(STATE), '', FROM)
        for i in range(count):
            now = 1_000_000_000 + i * 10_000_000
            data[4:12] = np.array([now // 10**9, now % 10**9], dtype='<u4').tobytes()
            writer.write(topic, bytes(data), now, now)
    reads = []

    def read(path, part):
        reads.append(part)
        return read_part(path, part)

    monkeypatch.setattr('tp_controller.recording.moments.read_part', read)
    recording = Recording(long)
    moments = Moments(recording)
    assert recording.contents.counts == {'/tp_controller/state': count}
    assert len(reads) <= 2
    assert len(recording.parts('/tp_controller/state')[topic]) > 500
    assert moments.at(150.0).time == pytest.approx(150.0, abs=0.01)
    assert len(reads) < 20
    for time in np.linspace(0.0, moments.seconds, 300):
        assert moments.at(float(time)).time == pytest.approx(time, abs=0.01)
    assert len(moments._read) <= PARTS
    assert len(list(moments.before(moments.seconds, 60.0, 0.01))) > STATES
    assert len(moments._states) <= STATES


def first_state(path):
    with path.open('rb') as file:
        _, _, message = next(make_reader(file).iter_messages(['/tp_controller/state']))
    return message.data


def test_a_recording_without_a_cycle_is_told(tmp_path):
    path = tmp_path / 'empty.mcap'
    with RecordingWriter(path) as writer:
        writer.add_topic('/tp_controller/state', STATE, full_definition(STATE), '', FROM)
    with pytest.raises(InvalidValue, match='no cycle'):
        Moments(Recording(path))

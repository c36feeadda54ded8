"""Pictures of a recording show what is in the file."""

import subprocess
import sys

import numpy as np
import pytest
from made_recording import NODE_NAME, make_recording
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from PIL import Image

from tp_controller.errors import InvalidValue
from tp_controller.plots import arm, draw_animation, draw_plots, figures, save
from tp_controller.plots.animation import check_animation
from tp_controller.plots.curves import goal_times, least_distance
from tp_controller.plots.moments import Scene
from tp_controller.plots.report import run_and_stack
from tp_controller.plots.style import RED
from tp_controller.recording import Recording, run_of

GOALS = [(0.0, 'ee_position', [-0.9, 0.9]), (1.2, 'ee_position', [1.2, 0.6])]


@pytest.fixture(scope='module')
def recording(tmp_path_factory):
    path = tmp_path_factory.mktemp('plots') / 'run.mcap'
    return Recording(make_recording(path, 'b1_obstacles', 2.0, GOALS))


@pytest.fixture(scope='module')
def messages(recording):
    """States as another reader finds them."""
    with recording.path.open('rb') as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        return [
            message for _, _, _, message in reader.iter_decoded_messages([f'{NODE_NAME}/state'])
        ]


@pytest.fixture(scope='module')
def drawn(recording):
    return figures(*run_and_stack(recording))


def lines(figure, panel):
    return [line.get_ydata() for line in figure.axes[panel].get_lines()]


def has(figure, panel, values):
    return any(
        np.shape(line) == np.shape(values) and np.array_equal(line, values, equal_nan=True)
        for line in lines(figure, panel)
    )


def test_errors_and_distances_are_those_of_the_messages(drawn, messages):
    norms = [state.tasks[3].error_norm for state in messages]
    assert messages[0].tasks[3].name == 'ee_position'
    assert has(drawn['errors'], 3, norms)
    for i in range(3):
        assert has(drawn['distances'], i, [state.tasks[i].distance[0] for state in messages])
    times = drawn['errors'].axes[3].get_lines()[0].get_xdata()
    stamps = [state.header.stamp.sec + 1e-9 * state.header.stamp.nanosec for state in messages]
    np.testing.assert_allclose(times, np.array(stamps) - stamps[0], atol=1e-6)


def test_joints_are_those_of_the_messages_with_the_limits_of_the_file(drawn, messages):
    positions = np.array([state.position for state in messages])
    commands = np.array([state.command for state in messages])
    changes = np.vstack([np.full(3, np.nan), 60.0 * np.diff(commands, axis=0)])
    for i in range(3):
        assert has(drawn['joints'], 3 * i, positions[:, i])
        assert has(drawn['joints'], 3 * i + 1, commands[:, i])
        limits = [line[0] for line in lines(drawn['joints'], 3 * i + 1) if len(line) == 2]
        assert sorted(limits) == [-1.5, 1.5]
        shown = lines(drawn['joints'], 3 * i + 2)[0]
        np.testing.assert_allclose(shown, changes[:, i], atol=1e-4)


def test_levels_and_timing_are_those_of_the_messages(drawn, messages):
    explained = {
        (state.levels_stamp.sec, state.levels_stamp.nanosec): state.levels
        for state in messages
        if state.levels
    }
    for i in range(4):
        assert has(drawn['levels'], 0, [float(levels[i].rank) for levels in explained.values()])
    assert has(drawn['timing'], 0, [state.scale for state in messages])
    assert has(drawn['timing'], 1, [1e3 * state.command_age for state in messages])


def test_every_axis_has_its_unit(drawn):
    for name, figure in drawn.items():
        for axes in figure.axes:
            spec = axes.get_subplotspec()
            last = spec.rowspan.stop == spec.get_gridspec().nrows
            for label in [axes.get_ylabel()] * spec.is_first_col() + [axes.get_xlabel()] * last:
                assert label.rstrip().endswith(']'), (name, label)


def test_a_negative_distance_is_red(recording):
    run, stack = run_and_stack(recording)
    course = np.full(len(run.time), 0.2)
    course[40:60] = -0.1
    first = run.tasks[0]._replace(distance=course[:, None])
    figure = figures(run._replace(tasks=(first, *run.tasks[1:])), stack)['distances']
    red = [line for line in figure.axes[0].get_lines() if line.get_color() == RED]
    below = np.where(course < 0.0, course, np.nan)
    np.testing.assert_array_equal(red[0].get_ydata(), below)
    assert 'least -0.1 m' in figure.axes[0].get_title(loc='left')


def test_pictures_of_the_arm_show_ends_targets_and_obstacles_then(recording):
    run, stack = run_and_stack(recording)
    scene = Scene(run, stack)
    assert scene.planar
    assert goal_times(run) == [72]
    stills = scene.stills(5)
    assert {0, 71, 119} <= set(stills)
    assert len(stills) == 5
    stack.robot.update(run.q[71])
    tip = stack.robot.frame('link_3').position
    np.testing.assert_allclose(scene.skeleton(71)[-1, 1], tip, atol=1e-12)
    np.testing.assert_allclose(scene.targets(71)[0].place[:2], [-0.9, 0.9])
    np.testing.assert_allclose(scene.targets(119)[0].place[:2], [1.2, 0.6])
    assert scene.obstacles(0)['obstacle_1'].size[0] == 0.5
    np.testing.assert_allclose(scene.obstacles(0)['obstacle_1'].pose.translation, [0, 1, 0])
    assert len(arm(run, stack).axes) == 6


def test_distances_that_do_not_count_are_left_out(recording):
    course = run_of(recording.states()).tasks[0]
    task = course._replace(distance=np.array([[np.inf, 0.3], [np.inf, np.inf]]))
    np.testing.assert_array_equal(least_distance(task), [0.3, np.nan])


def test_pictures_come_in_every_format(recording, drawn, tmp_path):
    for file_format, begin in (('svg', b'<?xml'), ('pdf', b'%PDF')):
        path = tmp_path / f'timing.{file_format}'
        save(drawn['timing'], path)
        assert path.read_bytes().startswith(begin)
    written = draw_plots(recording, tmp_path / 'new')
    names = {'errors', 'joints', 'distances', 'levels', 'timing', 'arm'}
    assert {path.stem for path in written} == names
    assert all(path.read_bytes().startswith(b'\x89PNG') for path in written)


def test_an_animation_shows_the_run_and_needs_ffmpeg_for_mp4(recording, tmp_path, monkeypatch):
    run, stack = run_and_stack(recording)
    draw_animation(run, stack, tmp_path / 'arm.gif', seconds=0.3)
    picture = Image.open(tmp_path / 'arm.gif')
    assert picture.n_frames == 3
    assert picture.info['duration'] == 100
    assert picture.convert('RGB').getpixel((0, 0)) == (255, 255, 255)
    monkeypatch.setattr('shutil.which', lambda _: None)
    with pytest.raises(InvalidValue, match=r'no ffmpeg on this machine; accepts a \.gif'):
        check_animation(tmp_path / 'arm.mp4')
    with pytest.raises(InvalidValue, match=r'accepts a file that ends in \.gif or \.mp4'):
        check_animation(tmp_path / 'arm.avi')


def test_the_arm_in_three_dimensions_with_its_obstacles(tmp_path):
    goal = [(0.0, 'hand_position', [0.45, 0.25, 0.3])]
    path = make_recording(tmp_path / 'panda.mcap', 'panda_table', 0.2, goal)
    run, stack = run_and_stack(Recording(path))
    scene = Scene(run, stack)
    assert not scene.planar
    assert {shape.kind for shape in scene.obstacles(0).values()} == {'half_space', 'box', 'sphere'}
    figure = arm(run, stack)
    assert [axes.get_zlabel() for axes in figure.axes] == ['z [m]'] * len(figure.axes)


def test_the_command_refuses_in_one_line(tmp_path):
    words = [sys.executable, '-m', 'tp_controller.plots', str(tmp_path / 'none.mcap')]
    result = subprocess.run(words, capture_output=True, text=True, check=False)
    assert result.returncode == 2
    assert result.stderr.splitlines() == [
        f'plot: {tmp_path / "none.mcap"}: got No such file or directory; accepts a readable file'
    ]


def test_a_run_without_a_cycle_is_refused():
    with pytest.raises(ValueError, match='no cycle'):
        run_of([])

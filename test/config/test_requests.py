"""Changes that are asked for as one, and the present stack as a parameter file."""

from pathlib import Path

import pytest

from tp_controller import InvalidValue, build_settings, read_parameter_file
from tp_controller.config import (
    build_addition,
    check_changes,
    check_request,
    controller_schema,
    parameter_text,
    present_parameters,
    read_text,
    split_request,
    write_text,
)

CONFIG = Path(__file__).parents[2] / 'config'
BALL = {'type': 'obstacle', 'frame': 'link_3', 'axes': 'xy', 'center': [1.0, 1.0], 'radius': 0.2}


def planar():
    return build_settings(read_parameter_file(CONFIG / 'b1_obstacles.yaml', 'tp_controller'))


def checked(settings, parameters):
    """Changes of parameters that a request leads to."""
    request = split_request(parameters, settings.stack.tasks)
    made = [build_addition(settings, name, block) for name, block in request.additions.items()]
    return check_request(settings, controller_schema(settings.values), request, made)


def test_a_request_has_the_form_of_a_parameter_file():
    text = """
        solver: {damping: 0.2}
        tasks:
          obstacle_2: null
          obstacle_1: {enabled: false, gain: [2.0]}
          ball: {type: obstacle, frame: link_3, axes: xy, center: [1.0, 1.0], radius: 0.2}
        hierarchy: [ball, obstacle_1, ee_position]
    """
    found = split_request(read_text(text), planar().stack.tasks)
    assert found.additions == {'ball': BALL}
    assert found.removals == ['obstacle_2']
    assert found.changes == {
        'solver.damping': 0.2,
        'tasks.obstacle_1.enabled': False,
        'tasks.obstacle_1.gain': [2.0],
        'hierarchy': ['ball', 'obstacle_1', 'ee_position'],
    }


def test_a_task_that_goes_leaves_the_hierarchy_and_one_that_comes_is_idle_unless_it_is_listed():
    settings = planar()
    found = checked(settings, {'tasks': {'obstacle_2': None, 'ball': BALL}})
    assert found == {'hierarchy': ('obstacle_1', 'obstacle_3', 'ee_position')}
    assert checked(settings, {'tasks': {'ball': BALL}}) == {}
    listed = {'tasks': {'ball': BALL}, 'hierarchy': ['ball', 'ee_position']}
    assert checked(settings, listed) == {'hierarchy': ('ball', 'ee_position')}
    assert checked(settings, {'hierarchy': []}) == {'hierarchy': ()}


@pytest.mark.parametrize(
    ('parameters', 'message'),
    [
        ({'tasks': {'cube': None}}, 'tasks.cube: got null for a task that is not there'),
        ({'tasks': {'obstacle_1': 3}}, 'tasks.obstacle_1: got 3; accepts parameters of a task'),
        (
            {'tasks': {'obstacle_1': None}, 'tasks.obstacle_1.gain': [1.0]},
            'tasks.obstacle_1: got null and changes',
        ),
        (
            {'tasks': {'obstacle_1': None}, 'hierarchy': ['obstacle_1', 'ee_position']},
            "hierarchy: got 'obstacle_1'",
        ),
        ({'tasks': {'cube': {'gain': [1.0]}}}, 'tasks.cube.type: got no value'),
        ({'tasks': {'obstacle_1': {'radius': 0.3}}}, 'tasks.obstacle_1.radius: got a change'),
        ({'solver': {'damping': None}}, 'solver.damping: got None'),
        ({'tasks': {'ball': BALL}, 'solver.damping': -1.0}, 'solver.damping: got -1.0'),
    ],
)
def test_what_cannot_be_done_is_refused_and_changes_nothing(parameters, message):
    settings = planar()
    before = dict(settings.values), list(settings.stack.tasks), settings.stack.hierarchy
    with pytest.raises(InvalidValue) as caught:
        checked(settings, parameters)
    assert str(caught.value).startswith(message)
    assert (dict(settings.values), list(settings.stack.tasks), settings.stack.hierarchy) == before


@pytest.mark.parametrize('path', sorted(CONFIG.glob('*.yaml')), ids=lambda path: path.stem)
def test_a_saved_stack_is_the_same_when_it_is_loaded(path, tmp_path):
    settings = build_settings(read_parameter_file(path, 'tp_controller'))
    settings.values['start'] = 'target'
    saved = tmp_path / 'saved.yaml'
    write_text(parameter_text(present_parameters(settings), 'tp_controller'), str(saved), False)
    loaded = build_settings(read_parameter_file(saved, 'tp_controller'))
    assert loaded.values == settings.values
    assert loaded.stack.hierarchy == settings.stack.hierarchy
    # What the simulator needs of it is for every node.
    assert read_parameter_file(saved, 'tp_sim').keys() <= loaded.values.keys()


def test_what_has_changed_since_the_start_is_saved_targets_too(tmp_path):
    settings = planar()
    changes = {'tasks.obstacle_1.enabled': False, 'hierarchy': [''], 'solver.inverse': 'pinv'}
    check_changes(settings, controller_schema(settings.values), changes)()
    settings.stack.tasks['obstacle_2'].target = [1e-9, 2.0]
    settings.stack.tasks['ee_position'].target = [0.25, 1.0]
    text = parameter_text(present_parameters(settings), 'tp_controller')
    (tmp_path / 'a.yaml').write_text(text)
    loaded = build_settings(read_parameter_file(tmp_path / 'a.yaml', 'tp_controller'))
    tasks = loaded.stack.tasks
    assert tasks['obstacle_2'].center.tolist() == [1e-9, 2.0]
    assert tasks['ee_position'].target.tolist() == [0.25, 1.0]
    assert not tasks['obstacle_1'].enabled
    assert loaded.stack.hierarchy == ()
    assert loaded.stack.solver.inverse.type == 'pinv'


def test_texts_that_ros_would_take_for_something_else_are_in_quotes():
    text = parameter_text({'tasks.y.axes': 'y', 'hierarchy': ('on', '1.0')}, 'arm')
    assert 'axes: "y"' in text
    assert 'hierarchy: ["on", "1.0"]' in text
    assert '/**/arm:' in text


def test_a_file_is_written_as_a_whole_and_replaced_only_when_that_is_said(tmp_path):
    path = tmp_path / 'a.yaml'
    write_text('one', str(path), False)
    with pytest.raises(InvalidValue, match='which exists; accepts a new file, or overwrite: true'):
        write_text('two', str(path), False)
    assert path.read_text() == 'one'
    write_text('two', str(path), True)
    assert path.read_text() == 'two'
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize(
    ('path', 'fragment'),
    [
        ('a.yaml', 'accepts an absolute path that ends in .yaml or .yml'),
        ('/tmp/a.txt', 'accepts an absolute path that ends in .yaml or .yml'),
        ('/tmp/a\0.yaml', 'accepts an absolute path that ends in .yaml or .yml'),
        ('/nowhere/a.yaml', 'No such file or directory; accepts a file that can be written'),
        ('/proc/a.yaml', 'accepts a file that can be written'),
        (f'/tmp/{"a" * 300}.yaml', 'File name too long'),
    ],
)
def test_where_nothing_can_be_written_one_line_says_why(path, fragment):
    with pytest.raises(InvalidValue) as caught:
        write_text('', path, True)
    assert fragment in str(caught.value)
    assert '\n' not in str(caught.value)

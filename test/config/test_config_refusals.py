import pytest
from planar_config import changed, dotted_parameters, nested_parameters

from tp_controller import InvalidValue, TaskPriorityError, build_settings

NAN, INF = float('nan'), float('inf')
NUMBERS = [
    'robot.dh.theta',
    'robot.dh.d',
    'robot.dh.a',
    'robot.dh.alpha',
    'robot.dh.base_pose',
    'robot.limits.velocity',
    'robot.limits.position_min',
    'robot.limits.position_max',
    'robot.limits.acceleration',
    'tasks.tip.target',
    'tasks.tip.gain',
    'tasks.tip.feedforward',
]
NUMBER = ['solver.damping', 'timeouts.joint_state', 'timeouts.feedforward']
TEXTS = ['robot.joints', 'robot.dh.types', 'hierarchy', 'tasks.elbow.joints']
TEXT = ['robot.base_frame', 'solver.type', 'command.type', 'tasks.tip.type', 'tasks.tip.frame']
REQUIRED = [
    *('robot.joints', 'robot.dh.theta', 'robot.dh.d', 'robot.dh.a', 'robot.dh.alpha'),
    *('robot.dh.types', 'hierarchy', 'tasks.tip.type', 'tasks.tip.frame', 'tasks.elbow.joints'),
]


def refusal(changes):
    with pytest.raises(InvalidValue) as caught:
        build_settings(changed(changes))
    assert isinstance(caught.value, TaskPriorityError)
    error = caught.value
    assert str(error) == f'{error.key}: got {error.got}; accepts {error.accepts}'
    assert '\n' not in str(error)
    return error


def test_the_parameters_that_the_table_changes_are_accepted():
    build_settings(dotted_parameters())


@pytest.mark.parametrize('key', NUMBERS)
@pytest.mark.parametrize('value', [['1.0'], [True], [None], [[1.0]], 'one', True, [1.0, '2']])
def test_what_is_no_list_of_numbers_is_refused_by_its_key(key, value):
    error = refusal({key: value})
    assert error.key == key
    assert error.accepts.startswith('a list of numbers')


@pytest.mark.parametrize('key', NUMBERS)
@pytest.mark.parametrize('value', [NAN, INF, -INF])
def test_a_list_with_a_number_that_is_not_finite_is_refused_by_its_key(key, value):
    error = refusal({key: [1.0, value, 1.0]})
    assert error.key == key
    assert 'finite' in error.accepts
    assert repr(value) in error.got


@pytest.mark.parametrize('key', NUMBER)
@pytest.mark.parametrize('value', ['0.1', True, False, [0.1], {}.keys(), NAN, INF, -1.0, -1])
def test_what_is_no_number_in_range_is_refused_by_its_key(key, value):
    error = refusal({key: value})
    assert error.key == key
    assert error.accepts.startswith('a number')


@pytest.mark.parametrize('key', TEXTS)
@pytest.mark.parametrize('value', [1, [1.0], True, ['joint_1', 2, 'joint_3'], [['joint_1']]])
def test_what_is_no_list_of_texts_is_refused_by_its_key(key, value):
    error = refusal({key: value})
    assert error.key == key
    assert error.accepts.startswith(('a list of texts', 'one of revolute, prismatic'))


@pytest.mark.parametrize('key', TEXT)
@pytest.mark.parametrize('value', [1, 1.5, True, ['link_3']])
def test_what_is_no_text_is_refused_by_its_key(key, value):
    error = refusal({key: value})
    assert error.key == key
    assert error.accepts.startswith(('a text', 'one of'))


@pytest.mark.parametrize('key', REQUIRED)
def test_a_required_parameter_that_is_missing_is_named(key):
    error = refusal({key: None})
    assert (error.key, error.got) == (key, 'no value')


DH = ['theta', 'd', 'a', 'alpha']
TABLE = [
    *(({f'robot.dh.{k}': [0.0] * 2}, f'robot.dh.{k}', ['2 values', '3 values']) for k in DH),
    *(({f'robot.dh.{k}': [0.0] * 4}, f'robot.dh.{k}', ['4 values', '3 values']) for k in DH),
    *(({f'robot.dh.{k}': []}, f'robot.dh.{k}', ['0 values', '3 values']) for k in DH),
    ({'robot.dh.types': ['revolute']}, 'robot.dh.types', ['1 value', '3 values']),
    ({'robot.dh.types': ['fixed'] * 3}, 'robot.dh.types', ['fixed', 'revolute, prismatic']),
    ({'robot.dh.base_pose': [0.0] * 3}, 'robot.dh.base_pose', ['3 values', '6 values', 'yaw']),
    ({'robot.joints': ['a', 'a', 'b']}, 'robot.joints', ["['a', 'a', 'b']", 'once']),
    ({'robot.joints': ['a', 'b']}, 'robot.dh.theta', ['3 values', '2 values', 'robot.joints']),
    ({'robot.base_frame': 'link_1'}, 'robot.base_frame', ["'link_1'", 'link_2']),
    ({'robot.limits.velocity': [1.0] * 2}, 'robot.limits.velocity', ['2 values', '3, one per']),
    ({'robot.limits.velocity': []}, 'robot.limits.velocity', ['0 values', '1 value or 3']),
    ({'robot.limits.velocity': [0.0]}, 'robot.limits.velocity', ['[0.0]', 'above 0']),
    ({'robot.limits.velocity': [1, -1, 1]}, 'robot.limits.velocity', ['-1', 'above 0']),
    ({'robot.limits.acceleration': [-1]}, 'robot.limits.acceleration', ['-1', 'above 0']),
    (
        {'robot.limits.position_min': [1.0], 'robot.limits.position_max': [2.0, 1.0, 2.0]},
        'robot.limits.position_min',
        ['[1.0, 1.0, 1.0]', '[2.0, 1.0, 2.0]', 'below position_max'],
    ),
    (
        {'robot.limits.position_max': [1.0] * 4},
        'robot.limits.position_max',
        ['4 values', '1 value or 3'],
    ),
    ({'solver.type': 'magic'}, 'solver.type', ["'magic'", 'recursive']),
    ({'command.type': 'twist'}, 'command.type', ["'twist'", 'joint_state', 'float64_multi']),
    ({'timeouts.joint_state': 0.0}, 'timeouts.joint_state', ['0.0', 'a number above 0']),
    ({'solver.damping': -0.1}, 'solver.damping', ['-0.1', 'a number of at least 0']),
    ({'tasks.tip.type': 'velocity'}, 'tasks.tip.type', ["'velocity'", 'position', 'joint']),
    ({'tasks.tip.frame': 'link_4'}, 'tasks.tip.frame', ["'link_4'", 'link_1, link_2, link_3']),
    ({'tasks.tip.axes': 'xw'}, 'tasks.tip.axes', ["'xw'", 'letters out of xyz']),
    ({'tasks.place.position_axes': 'q'}, 'tasks.place.position_axes', ["'q'", 'letters out']),
    ({'tasks.place.orientation_axes': ''}, 'tasks.place.orientation_axes', ["''", 'letters']),
    ({'tasks.elbow.joints': ['knee']}, 'tasks.elbow.joints', ["'knee'", 'joint_1, joint_2']),
    ({'tasks.elbow.joints': []}, 'tasks.elbow.joints', ['no joint', 'joint_1, joint_2']),
    ({'tasks.elbow.joints': ['joint_2'] * 2}, 'tasks.elbow.joints', ['every joint once']),
    ({'tasks.tip.gain': [1.0] * 3}, 'tasks.tip.gain', ['3 values', '1, 2 or 4 values']),
    ({'tasks.tip.gain': [-1.0]}, 'tasks.tip.gain', ['[-1.0]', 'at least 0']),
    ({'tasks.tip.gain': [1.0, 9.0, 0.0, 1.0]}, 'tasks.tip.gain', ['9.0', 'positive matrix']),
    ({'tasks.tip.gain': []}, 'tasks.tip.gain', ['0 values', '1, 2 or 4 values']),
    ({'tasks.tip.feedforward': [1.0]}, 'tasks.tip.feedforward', ['1 value', '2 values (x, y)']),
    ({'tasks.tip.target': [1.0] * 3}, 'tasks.tip.target', ['3 values', '2 values', '[m]']),
    ({'tasks.turn.target': [0.0] * 4}, 'tasks.turn.target', ['4 values', '1 value (angle']),
    ({'tasks.spare.target': [0.0] * 4}, 'tasks.spare.target', ['quaternion', 'not zero']),
    ({'tasks.spare.target': [1.0]}, 'tasks.spare.target', ['1 value', 'quaternion x y z w']),
    ({'tasks.place.target': [1.0] * 2}, 'tasks.place.target', ['2 values', '3 values', 'angle']),
    ({'tasks.elbow.target': [1.0] * 2}, 'tasks.elbow.target', ['2 values', '1 value']),
    ({'hierarchy': ['', 'tip']}, 'hierarchy', ["''", 'tip, turn, place']),
    ({'hierarchy': ['tip', 'nose']}, 'hierarchy', ["'nose'", 'tip, turn, place']),
    ({'hierarchy': ['tip', 'tip']}, 'hierarchy', ["'tip' twice", 'every task once']),
    ({'hierarchy': ['tip + turn', 'turn']}, 'hierarchy', ["'turn' twice", 'every task once']),
    ({'tasks.*': None}, 'hierarchy', ["'tip'", 'nothing']),
    ({'tasks.2nd.type': 'joint'}, 'tasks.2nd', ["'2nd'", 'begin with a letter']),
    ({'tasks.a-b.type': 'joint'}, 'tasks.a-b', ["'a-b'", 'letters, digits and _']),
    ({'tasks..type': 'joint'}, 'tasks.', ["''", 'letters, digits and _']),
    ({'tasks.new.frame': 'link_1'}, 'tasks.new.type', ['no value', 'position, orientation']),
    ({'tasks.new': 3}, 'tasks.new.type', ['no value', 'position, orientation']),
    ({'solver.dampling': 0.1}, 'solver.dampling', ['solver.damping (did you mean that?)']),
    ({'robot.dh.tehta': [0.0]}, 'robot.dh.tehta', ['robot.dh.theta (did you mean that?)']),
    ({'tasks.tip.gian': [1.0]}, 'tasks.tip.gian', ['tasks.tip.gain (did you mean that?)']),
    ({'hierarhcy': ['tip']}, 'hierarhcy', ['hierarchy (did you mean that?)']),
    ({'tasks.tip.joints': ['joint_1']}, 'tasks.tip.joints', ['tasks.tip.axes']),
    ({'tasks.turn.position_axes': 'x'}, 'tasks.turn.position_axes', ['tasks.turn.axes']),
    ({'robot.velocity': [1.0]}, 'robot.velocity', ['robot.limits.velocity (did you mean that?)']),
    ({'speed.limit': 1.0}, 'speed.limit', ['; accepts robot.…, robot_description, command.…, s']),
    ({'solver.objective.positions': [0.0]}, 'solver.objective.type', ['no value', 'posture']),
    (
        {'solver.objective.type': 'posture', 'solver.objective.positions': [0.0]},
        'solver.objective.positions',
        ['1 value [0.0]', '3 values'],
    ),
    ({'solver.joint_weights': [1, -2, 1]}, 'solver.joint_weights', ['[1.0, -2.0, 1.0]', 'above']),
    ({'robot.mass': 1.0}, 'robot.mass', ['an unknown parameter', 'robot.joints']),
    ({'tasks': 3}, 'tasks', ['an unknown parameter']),
    ({'robot_description': '<robot/>'}, 'robot.dh.theta', ['beside robot_description']),
    ({'robot.urdf': 'arm.urdf'}, 'robot.dh.theta', ['beside robot.urdf', 'one of the two']),
    (
        {'robot.dh.*': None, 'robot.urdf': 'arm.urdf', 'robot_description': '<robot/>'},
        'robot.urdf',
        ['beside robot_description'],
    ),
    ({'robot.dh.*': None}, 'robot', ['no value', 'robot.dh, robot.urdf or robot_description']),
    ({'robot.dh.*': None, 'robot.dh.tehta': [0.0]}, 'robot.dh.tehta', ['robot.dh.theta (did']),
    ({'robot.dh.*': None, 'robot_description': ''}, 'robot_description', ['malformed XML']),
    ({'robot.dh.*': None, 'robot_description': 3}, 'robot_description', ['3', 'a text']),
    ({'robot.dh.*': None, 'robot.mass': 1.0}, 'robot.mass', ['an unknown parameter']),
    ({'robot.dh.*': None, 'hierarchy': ['nose']}, 'hierarchy', ["'nose'", 'tip, turn']),
]


@pytest.mark.parametrize(('changes', 'key', 'fragments'), TABLE, ids=lambda x: str(x)[:40])
def test_a_refusal_names_the_full_key_what_it_got_and_what_it_accepts(changes, key, fragments):
    error = refusal(changes)
    assert error.key == key
    for fragment in fragments:
        assert fragment in str(error)


def test_what_only_another_task_has_is_not_proposed():
    tasks = {'tasks.best.type': 'manipulability', 'tasks.best.frame': 'link_3'}
    error = refusal(tasks | {'tasks.best.target': [1.0]})
    assert error.key == 'tasks.best.target'
    assert 'tasks.tip' not in error.accepts
    assert 'tasks.best.frame' in error.accepts


def test_a_key_that_is_no_text_is_refused():
    block = nested_parameters()
    block['tasks'][1] = {'type': 'joint'}
    with pytest.raises(InvalidValue, match='texts as keys') as caught:
        build_settings(block)
    assert caught.value.key == 'tasks.1'


@pytest.mark.parametrize('key', ['solver.damping', 'tasks.tip.gain', 'tasks.tip.target'])
def test_a_whole_number_beyond_the_range_of_floats_is_refused(key):
    value = 10**400
    assert refusal({key: value if key in NUMBER else [value, 1]}).key == key


def test_a_long_value_is_cut_in_the_message():
    error = refusal({'robot.dh.theta': [0.123456789] * 1000})
    assert error.got.startswith('1000 values [0.123456789, ')
    assert len(str(error)) < 250


def test_nothing_is_unlimited_by_an_empty_list():
    assert refusal({'robot.limits.position_min': []}).key == 'robot.limits.position_min'


@pytest.mark.parametrize('name', ['Tip_2', 'x', 'link2_orientation'])
def test_a_task_may_have_any_name_that_can_stand_in_a_topic(name):
    block = changed({f'tasks.{name}.type': 'joint', f'tasks.{name}.joints': ['joint_1']})
    assert name in build_settings(block).stack.tasks

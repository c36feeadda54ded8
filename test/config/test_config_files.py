from pathlib import Path

import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from planar_config import nested_parameters

from tp_controller import InvalidValue, build_settings, read_parameter_file
from tp_controller.config import read_blocks, read_task
from tp_controller.parameters import flatten

CONFIG = Path(__file__).resolve().parents[2] / 'config'

BLOCKS = """\
/**:
  ros__parameters:
    shared: 1
    both: everyone
    robot: {base_frame: base, joints: [a, b]}
arm:
  ros__parameters:
    both: arm
    robot:
      base_frame: world
    deep.er.key: 0.5
other:
  ros__parameters:
    shared: 2
"""


@pytest.fixture
def file_of(tmp_path):
    """Write a parameter file and give its path."""

    def write(text):
        path = tmp_path / 'parameters.yaml'
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return path

    return write


def refusal(path, node='arm'):
    with pytest.raises(InvalidValue) as caught:
        read_parameter_file(path, node)
    assert '\n' not in str(caught.value)
    return caught.value


def under_node(parameters):
    """Text of a file with one parameter block, given as lines."""
    return 'arm:\n  ros__parameters:\n' + ''.join(f'    {line}\n' for line in parameters)


def test_the_block_of_a_node_overrides_the_block_of_every_node(file_of):
    assert read_parameter_file(file_of(BLOCKS), 'arm') == {
        'shared': 1,
        'both': 'arm',
        'robot.base_frame': 'world',
        'robot.joints': ['a', 'b'],
        'deep.er.key': 0.5,
    }


def test_a_node_without_a_block_gets_the_block_of_every_node(file_of):
    flat = read_parameter_file(file_of(BLOCKS), 'somebody')
    assert flat['both'] == 'everyone'
    assert flat['robot.base_frame'] == 'base'


def test_a_file_for_another_node_alone_gives_nothing(file_of):
    assert read_parameter_file(file_of('other: {ros__parameters: {a: 1}}'), 'arm') == {}


def test_a_path_may_be_a_text(file_of):
    assert read_parameter_file(str(file_of(BLOCKS)), 'other')['shared'] == 2


@pytest.mark.parametrize('name', ['arm', '/arm', '/**', '/**/arm', '/*/arm'])
def test_a_block_counts_by_the_name_of_the_node_or_by_wildcards(file_of, name):
    assert read_parameter_file(file_of(f'{name}: {{ros__parameters: {{a: 1}}}}'), 'arm') == {
        'a': 1
    }


@pytest.mark.parametrize('name', ['left/arm', '/left/arm', '/arm/camera', '/**/other', 'forearm'])
def test_a_block_of_another_node_or_of_one_namespace_does_not_count(file_of, name):
    assert read_parameter_file(file_of(f'{name}: {{ros__parameters: {{a: 1}}}}'), 'arm') == {}


@pytest.mark.parametrize(
    ('text', 'value'),
    [
        ('1e-3', 0.001),
        ('[0.5, 1e-3, -2.5e3]', [0.5, 0.001, -2500.0]),
        ('1.E+2', 100.0),
        ('.5e1', 5.0),
        ('y', True),
        ('N', False),
        ("'y'", 'y'),
        ('xy', 'xy'),
        ('e3', 'e3'),
    ],
)
def test_values_are_what_ros_takes_them_for(file_of, text, value):
    found = read_parameter_file(file_of(under_node([f'key: {text}'])), 'arm')
    assert found == {'key': value}
    assert type(found['key']) is type(value)


def test_parameters_of_ros_itself_are_left_out(file_of):
    own = ['use_sim_time: true', 'start_type_description_service: false']
    path = file_of(under_node([*own, 'qos_overrides: {/clock: {depth: 1}}', 'rate: 50.0']))
    assert read_parameter_file(path, 'arm') == {'rate': 50.0}


def test_keys_are_texts(file_of):
    path = file_of(under_node(['tasks: {y: {gain: [1.0]}, on: {gain: [2.0]}}']))
    assert read_parameter_file(path, 'arm') == {'tasks.y.gain': [1.0], 'tasks.on.gain': [2.0]}


def test_later_blocks_override_earlier_ones(file_of):
    text = 'arm: {ros__parameters: {a: 1}}\n/**: {ros__parameters: {a: 2, b: 3}}'
    assert read_parameter_file(file_of(text), 'arm') == {'a': 2, 'b': 3}


def test_all_blocks_of_a_file_can_be_read_as_they_stand_there(file_of):
    blocks = read_blocks(file_of(BLOCKS))
    assert list(blocks) == ['/**', 'arm', 'other']
    assert blocks['arm'] == {'both': 'arm', 'robot': {'base_frame': 'world'}, 'deep.er.key': 0.5}


@pytest.mark.parametrize(
    ('text', 'line'),
    [
        ('arm: {ros__parameters: {a: 1}}\narm: {ros__parameters: {b: 1}}\n', 2),
        ('arm:\n  ros__parameters:\n    gain: 1\n    target: 2\n    gain: 3\n', 5),
    ],
)
def test_a_key_that_stands_twice_is_refused_with_its_line(file_of, text, line):
    error = refusal(file_of(text))
    assert 'a second time' in error.got
    assert f'in line {line}, column ' in error.got


def test_a_file_with_all_parameters_builds_a_stack(file_of):
    text = yaml.safe_dump({'tp_controller': {'ros__parameters': nested_parameters()}})
    flat = read_parameter_file(file_of(text), 'tp_controller')
    assert flat == flatten(nested_parameters())
    assert build_settings(flat).stack.hierarchy == ('tip + elbow', 'turn', 'place')


@pytest.mark.parametrize('path', sorted(CONFIG.glob('*.yaml')), ids=lambda path: path.stem)
def test_every_file_of_the_config_folder_builds_a_stack(path):
    assert build_settings(read_parameter_file(path, 'tp_controller')).stack.hierarchy


@pytest.mark.parametrize(
    ('text', 'line'),
    [
        ('arm:\n  ros__parameters:\n    gain: [1.0, 2.0', 3),
        ('arm:\n  ros__parameters:\n    name: "cut', 3),
        ('arm:\n  ros__parameters:\n    a: 1\n   b: 2\n', 4),
        ('arm:\n  ros__parameters: {a: 1,\n', 3),
        ('arm:\n\tros__parameters:\n', 2),
        ('arm:\n  ros__parameters:\n    a: b: c\n', 3),
    ],
)
def test_broken_yaml_is_refused_with_its_line(file_of, text, line):
    path = file_of(text)
    error = refusal(path)
    assert error.key == str(path)
    assert error.accepts == 'YAML'
    assert f'in line {line}, column ' in error.got


@pytest.mark.parametrize('text', ['', '# nothing\n', '- a\n- b\n', 'text', '3', 'null'])
def test_a_document_that_is_no_mapping_is_refused(file_of, text):
    path = file_of(text)
    error = refusal(path)
    assert error.key == str(path)
    assert 'ros__parameters' in error.accepts


@pytest.mark.parametrize('name', ['arm', '/**', 'other'])
@pytest.mark.parametrize(
    'block',
    ['', '3', '[1, 2]', '{parameters: {a: 1}}', '{ros__parameters: 3}', '{ros__parameters: [a]}'],
)
def test_a_block_without_ros_parameters_is_refused_by_its_name(file_of, name, block):
    path = file_of(f'{name}: {block}\n')
    error = refusal(path)
    assert error.key == f'{path}: {name}'
    assert 'ros__parameters' in error.accepts


def test_a_missing_file_is_refused_by_its_path(tmp_path):
    error = refusal(tmp_path / 'absent.yaml')
    assert error.key == str(tmp_path / 'absent.yaml')
    assert 'No such file' in error.got
    assert error.accepts == 'a readable file'


def test_a_folder_is_refused_by_its_path(tmp_path):
    assert refusal(tmp_path).key == str(tmp_path)


def test_bytes_that_are_no_text_are_refused(file_of):
    assert 'UTF-8' in refusal(file_of(b'arm: \xff\xfe\n')).got


@pytest.mark.parametrize(
    ('line', 'key', 'fragments'),
    [
        ('gain: [1, 2.0]', 'gain', ['mixes whole numbers and decimals', 'write 1.0 for 1']),
        ('gain: [1.0, a]', 'gain', ['mixes kinds', 'one kind in a list']),
        ('gain: [true, 1]', 'gain', ['mixes kinds', 'one kind in a list']),
        ('tasks: {tip: {gain: [1.0, 2]}}', 'tasks.tip.gain', ['[1.0, 2]', 'one kind']),
        ('gain: []', 'gain', ['an empty list', 'leave the key out']),
        ('tasks: {tip: {target: []}}', 'tasks.tip.target', ['an empty list', 'at least one']),
        ('gain:', 'gain', ['no value', 'leave the key out']),
        ('gain: ~', 'gain', ['no value', 'leave the key out']),
        ('1: 2', '1', ['texts as keys']),
    ],
)
def test_what_ros_would_refuse_is_refused_with_its_key(file_of, line, key, fragments):
    error = refusal(file_of(under_node([line])))
    assert error.key == key
    for fragment in fragments:
        assert fragment in str(error)


YAML_WORDS = st.sampled_from(
    [
        '{',
        '}',
        '[',
        ']',
        ',',
        ': ',
        '- ',
        '\n',
        ' ',
        '&a ',
        '*a',
        '<<',
        '? ',
        '!!set ',
        '"',
        'type',
    ]
)


@given(st.lists(YAML_WORDS | st.text(max_size=3), max_size=60).map(''.join))
@settings(max_examples=100, deadline=None)
def test_whatever_text_is_sent_for_a_task_is_read_or_refused(text):
    try:
        found = read_task(text)
    except InvalidValue as error:
        found = {error.key: str(error)}
        if '\n' in str(error):
            found = None
    assert isinstance(found, dict)

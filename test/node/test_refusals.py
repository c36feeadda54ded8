"""Parameter files that cannot be used: one line, exit status 2, within five seconds of work."""

from resource import RUSAGE_CHILDREN, getrusage

import pytest

from tp_sim.harness import NodeProcess, PrivateDomain, edited, read_document, write_document

NAN = float('nan')


def task(**changes):
    return {'tp_controller': {'tasks': {'ee_position': changes}}}


def robot(**changes):
    return {'/**': {'robot': changes}}


def robot_left_out(changes):
    return {'/**': {'robot': None}, 'tp_controller': changes}


POSITIONS = {
    '/**': {
        'robot': {'base': 'planar', 'base_frame': 'odom'},
        'command': {'type': 'joint_state_position'},
    },
}

CONTROLLER = [
    (POSITIONS, 'command.type', 'positions for a base that moves', 'a type of velocities'),
    (task(frame='link_9'), 'tasks.ee_position.frame', "'link_9'", 'link_1, link_2, link_3'),
    (task(target=[NAN, 0.5]), 'tasks.ee_position.target', 'nan', 'finite'),
    (task(target=[1.0]), 'tasks.ee_position.target', '1 value [1.0]', '2 values'),
    (task(gain=[1.0, 2.0, 3.0]), 'tasks.ee_position.gain', '3 values', '1, 2 or 4 values'),
    (task(gain='high'), 'tasks.ee_position.gain', "'high'", 'a list of numbers'),
    (task(type='positon'), 'tasks.ee_position.type', "'positon'", 'position, orientation'),
    (task(typ='position'), 'tasks.ee_position.typ', 'unknown parameter', 'type'),
    (
        {'tp_controller': {'tasks': {'joint_1_position': {'joints': ['joint_7']}}}},
        'tasks.joint_1_position.joints',
        "'joint_7'",
        'joint_1, joint_2, joint_3',
    ),
    ({'tp_controller': {'hierarchy': ['ee_position'] * 2}}, 'hierarchy', 'twice', 'once'),
    ({'tp_controller': {'hierarchy': ['hand']}}, 'hierarchy', "'hand'", 'ee_position'),
    ({'tp_controller': {'hierarchy': None}}, 'hierarchy', 'no value', 'a list of texts'),
    ({'tp_controller': {'hierarchy': []}}, 'hierarchy', 'an empty list', '[""] for no task'),
    ({'tp_controller': {'solver': {'damping': -1.0}}}, 'solver.damping', '-1.0', 'at least 0'),
    ({'tp_controller': {'solver': {'damping': True}}}, 'solver.damping', 'True', 'a number'),
    ({'tp_controller': {'slver': {'damping': 0.1}}}, 'slver.damping', 'unknown', 'solver.damping'),
    (robot(joints=['a', 'b', 'a']), 'robot.joints', "['a', 'b', 'a']", 'every joint once'),
    (robot(dh={'a': [0.75, 0.5]}), 'robot.dh.a', '2 values', '3 values'),
    (robot(limits={'velocity': [0.0]}), 'robot.limits.velocity', '[0.0]', 'above 0'),
    (robot(dh={'a': [0.75, 0.5, 1]}), 'robot.dh.a', 'mixes whole numbers', 'write 1.0 for 1'),
    ({'/**': {'robot_description': '<robot/>'}}, 'robot.dh.theta', 'beside robot_desc', 'one of'),
    (
        {'/**': {'robot': None, 'robot_description': '<robot'}},
        'robot_description',
        'malformed XML',
        'a URDF',
    ),
    # A controller without a robot would wait for one; this is wrong with every robot.
    (
        robot_left_out({'solver': {'dampling': 0.1}}),
        'solver.dampling',
        'unknown',
        'solver.damping',
    ),
    (robot_left_out({'hierarchy': ['hand']}), 'hierarchy', "'hand'", 'ee_position'),
]

SIMULATOR = [
    (
        POSITIONS | {'tp_sim': {'initial_positions': None}},
        'command.type',
        'positions for a base that moves',
        'a type of velocities',
    ),
    ({'tp_sim': {'rate': 0.0}}, 'rate', '0.0', 'above 0'),
    ({'tp_sim': {'initial_positions': [0.0, 0.6]}}, 'initial_positions', '2 values', '3'),
    (
        robot(limits={'position_max': [0.1]}),
        'initial_positions',
        '[0.0, 0.6, 0.3]',
        'positions from',
    ),
    ({'tp_sim': {'rat': 60.0}}, 'rat', 'unknown parameter', 'rate'),
    ({'tp_sim': {'paused': True}}, 'paused', 'true without lockstep', 'lockstep: true'),
    ({'/**': {'robot': None}, 'tp_sim': {'rate': 0.0}}, 'rate', '0.0', 'above 0'),
]


@pytest.fixture(scope='module')
def domain():
    domain = PrivateDomain()
    yield domain
    domain.close()


def refusal(package, executable, path, domain, *ros_arguments):
    """The single line with which an executable refuses a parameter file."""
    before = getrusage(RUSAGE_CHILDREN)
    process = NodeProcess(package, executable, path, domain.environment(), ros_arguments)
    status = process.wait(60.0)
    # A busy machine takes longer for it.
    after = getrusage(RUSAGE_CHILDREN)
    assert after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime < 5.0
    output = process.output
    assert status == 2, output
    lines = output.strip().splitlines()
    assert len(lines) == 1, output
    return lines[0]


def check(line, node, key, got, accepts):
    assert line.startswith(f'{node}: ')
    assert f'{key}: got ' in line
    assert got in line.split('; accepts ')[0]
    assert accepts in line.split('; accepts ')[1]


@pytest.mark.parametrize(('changes', 'key', 'got', 'accepts'), CONTROLLER)
def test_the_controller_names_key_value_and_what_it_accepts(
    config, tmp_path, domain, changes, key, got, accepts
):
    path = tmp_path / 'bad.yaml'
    write_document(edited(read_document(config / 'a4_position_joint.yaml'), changes), path)
    check(refusal('tp_controller', 'controller', path, domain), 'tp_controller', key, got, accepts)


@pytest.mark.parametrize(('changes', 'key', 'got', 'accepts'), SIMULATOR)
def test_the_simulator_names_key_value_and_what_it_accepts(
    config, tmp_path, domain, changes, key, got, accepts
):
    path = tmp_path / 'bad.yaml'
    write_document(edited(read_document(config / 'a4_position_joint.yaml'), changes), path)
    check(refusal('tp_sim', 'simulator', path, domain), 'tp_sim', key, got, accepts)


@pytest.mark.parametrize(
    ('package', 'executable'), [('tp_controller', 'controller'), ('tp_sim', 'simulator')]
)
def test_truncated_yaml_is_refused_with_its_line(config, tmp_path, domain, package, executable):
    text = (config / 'a4_position_joint.yaml').read_text()
    path = tmp_path / 'truncated.yaml'
    path.write_text(text[: text.index('0.5, 0.5]') + 4])
    line = refusal(package, executable, path, domain)
    assert str(path) in line
    assert 'line' in line


def test_a_missing_parameter_file_is_refused_by_name(tmp_path, domain):
    line = refusal('tp_controller', 'controller', tmp_path / 'nothing.yaml', domain)
    assert 'nothing.yaml' in line


def test_a_task_listed_twice_in_the_file_is_refused(config, tmp_path, domain):
    text = (config / 'a4_position_joint.yaml').read_text()
    path = tmp_path / 'twice.yaml'
    path.write_text(text.replace('joint_1_position:\n', 'ee_position:\n'))
    line = refusal('tp_controller', 'controller', path, domain)
    assert "'ee_position' a second time in line" in line


def test_an_empty_list_on_the_command_line_is_refused(config, domain):
    path = config / 'a4_position_joint.yaml'
    rule = ('-p', 'tp_controller:hierarchy:=[]')
    line = refusal('tp_controller', 'controller', path, domain, *rule)
    check(line, 'tp_controller', 'hierarchy', 'an empty list', 'at least one value')


def test_a_file_without_a_block_for_the_node_is_refused_with_its_blocks(config, tmp_path, domain):
    path = tmp_path / 'rate_apart.yaml'
    text = (config / 'a4_position_joint.yaml').read_text().replace('    rate: 60.0\n', '')
    block = '/**/tp_sim:\n  ros__parameters:\n'
    assert block in text
    path.write_text(text.replace(block, f'{block}    rate: 60.0\n'))
    line = refusal('tp_sim', 'simulator', path, domain, '-r', '__node:=sim_2')
    assert 'rate: got no value' in line
    assert '/**/tp_sim' in line


def test_a_missing_key_of_a_task_is_not_blamed_on_the_blocks(config, tmp_path, domain):
    path = tmp_path / 'bad.yaml'
    document = edited(read_document(config / 'a4_position_joint.yaml'), task(frame=None))
    write_document(document, path)
    line = refusal('tp_controller', 'controller', path, domain)
    assert line.endswith('tasks.ee_position.frame: got no value; accepts a text')


def test_without_a_parameter_file_the_first_missing_key_is_named(domain):
    line = refusal('tp_controller', 'controller', None, domain)
    assert 'hierarchy: got no value' in line
    assert '--params-file' in line

"""Launch files: what they name is there, and what they start.

The package ``launch`` has no wheel; a stand-in takes its place.
"""

import ast
from pathlib import Path

import pytest
import yaml
from ament_index_python.packages import (
    PackageNotFoundError,
    get_package_prefix,
    get_package_share_directory,
)
from launch_stand_in import stand_in, started

from tp_controller.errors import InvalidValue

FILES = [('tp_controller', 'robot.launch.py'), ('tp_sim', 'simulation.launch.py')]


def nodes(package, name):
    """Source of a launch file as it is installed, and its nodes: constant arguments by name."""
    text = (Path(get_package_share_directory(package)) / 'launch' / name).read_text()
    calls = [call for call in ast.walk(ast.parse(text)) if isinstance(call, ast.Call)]
    found = [
        {
            word.arg: word.value.value
            for word in call.keywords
            if isinstance(word.value, ast.Constant)
        }
        for call in calls
        if getattr(call.func, 'id', '') == 'Node'
    ]
    return text, found


@pytest.mark.parametrize(('package', 'name'), FILES)
def test_every_executable_of_these_packages_is_there(package, name):
    _, found = nodes(package, name)
    own = [node for node in found if node['package'].startswith('tp_')]
    assert own
    for node in own:
        folder = Path(get_package_prefix(node['package'])) / 'lib' / node['package']
        assert (folder / node['executable']).exists()


@pytest.mark.parametrize(('package', 'name'), FILES)
def test_packages_that_are_started_are_dependencies(package, name, repository):
    _, found = nodes(package, name)
    manifest = (repository / package / 'package.xml').read_text()
    for other in {node['package'] for node in found} - {package}:
        assert f'<exec_depend>{other}</exec_depend>' in manifest


def test_rviz_shows_the_topics_of_the_nodes():
    share = Path(get_package_share_directory('tp_sim'))
    text, _ = nodes('tp_sim', 'simulation.launch.py')
    assert "'rviz' / 'controller.rviz'" in text
    assert (Path(get_package_share_directory('tp_controller')) / 'config/panda.yaml').exists()
    manager = yaml.safe_load((share / 'rviz' / 'controller.rviz').read_text())[
        'Visualization Manager'
    ]
    shown = {
        display[key]['Value']
        for display in manager['Displays']
        for key in ('Topic', 'Description Topic')
        if key in display
    }
    assert shown == {'tp_controller/markers', 'robot_description'}
    sent = {tool['Topic']['Value'] for tool in manager['Tools'] if 'Topic' in tool}
    assert sent == {'clicked_point', 'goal_pose'}
    assert all(topic in text for topic in sent)


@pytest.fixture
def launched(monkeypatch):
    """What a launch file starts with these arguments, by the names of the executables."""
    stand_in(monkeypatch)
    return started


@pytest.fixture
def packages(monkeypatch):
    """Make packages be there, or not."""
    found = get_package_share_directory

    def tell(**there):
        def directory(package):
            if not there.get(package, True):
                raise PackageNotFoundError(package)
            return '/' if package in there else found(package)

        monkeypatch.setattr('ament_index_python.packages.get_package_share_directory', directory)

    return tell


def test_a_simulation_has_rviz_where_that_is_installed(launched, packages, config):
    simulation = ('tp_sim', 'simulation.launch.py')
    file = str(config / 'a4_position_joint.yaml')
    packages(robot_state_publisher=True, rviz2=True)
    nodes = launched(*simulation, config=file)
    assert list(nodes) == ['simulator', 'controller', 'robot_state_publisher', 'rviz2']
    assert nodes['rviz2'].arguments[-1] == 'base'
    assert list(launched(*simulation, config=file, rviz='false')) == ['simulator', 'controller']

    # A launch that names a missing package leaves the nodes before it without a parent.
    packages(robot_state_publisher=True, rviz2=False)
    nodes = launched(*simulation, config=file)
    assert list(nodes) == ['LogInfo', 'simulator', 'controller']
    assert nodes['LogInfo'].msg == 'without RViz: package rviz2 is not installed'
    with pytest.raises(InvalidValue, match='rviz: got true without package rviz2'):
        launched(*simulation, config=file, rviz='true')


def test_a_tool_of_rviz_drives_a_task_that_there_is(launched, config):
    simulation = ('tp_sim', 'simulation.launch.py')
    file = str(config / 'a4_position_joint.yaml')
    nodes = launched(*simulation, config=file, rviz='false', point_task='ee_position')
    assert nodes['controller'].remappings == [('~/ee_position/goal', 'clicked_point')]
    with pytest.raises(InvalidValue, match="point_task: got 'hand'; accepts one of ee_position"):
        launched(*simulation, config=file, point_task='hand')


def test_the_controller_of_a_robot_needs_its_file(launched, config):
    robot = ('tp_controller', 'robot.launch.py')
    nodes = launched(*robot, config=str(config / 'panda.yaml'), velocity_command='/v')
    assert ('joint_velocity_command', '/v') in nodes['controller'].remappings
    with pytest.raises(InvalidValue, match=r"config: got 'my_arm\.yaml'"):
        launched(*robot, config='my_arm.yaml')

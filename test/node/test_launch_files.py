"""Launch files: what they name is there. The package ``launch`` has no wheel to run them with."""

import ast
from pathlib import Path

import pytest
import yaml
from ament_index_python.packages import get_package_prefix, get_package_share_directory

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
    for started in {node['package'] for node in found} - {package}:
        assert f'<exec_depend>{started}</exec_depend>' in manifest


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

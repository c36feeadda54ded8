"""The wheel that ``pip install ./tp_controller`` makes: the library, without ROS."""

import subprocess
import sys
import zipfile
from email import message_from_string
from shutil import copytree

import pytest
from test_library_without_ros import BLOCKED

import tp_controller
from tp_controller.compiled import library_path

NEEDED = {'coal', 'daqp', 'numba', 'numpy', 'pin', 'pyyaml'}


@pytest.fixture(scope='module')
def wheel(repository, tmp_path_factory):
    folder = tmp_path_factory.mktemp('wheel')
    command = [sys.executable, '-m', 'pip', 'wheel', '--no-deps', '--no-build-isolation']
    subprocess.run(
        [*command, '--no-index', '-q', '-w', folder, repository / 'tp_controller'],
        check=True,
        capture_output=True,
        timeout=60,
    )
    (path,) = folder.glob('*.whl')
    return path


@pytest.fixture(scope='module')
def metadata(wheel):
    with zipfile.ZipFile(wheel) as file:
        (name,) = [name for name in file.namelist() if name.endswith('.dist-info/METADATA')]
        return message_from_string(file.read(name).decode())


def test_it_is_called_tp_controller_and_has_the_version_of_package_xml(
    repository, wheel, metadata
):
    assert wheel.name.endswith('-py3-none-any.whl')
    assert metadata['Name'].replace('_', '-') == 'tp-controller'
    manifest = (repository / 'tp_controller' / 'package.xml').read_text(encoding='utf-8')
    assert f'<version>{metadata["Version"]}</version>' in manifest


def test_it_asks_for_what_the_library_imports(metadata):
    wanted = [line for line in metadata.get_all('Requires-Dist') if 'extra' not in line]
    assert {line.split('>')[0].lower() for line in wanted} == NEEDED


def test_it_has_type_information_and_nothing_of_ros(wheel):
    with zipfile.ZipFile(wheel) as file:
        names = file.namelist()
    assert 'tp_controller/py.typed' in names
    assert 'tp_controller/solvers/kernel.py' in names
    assert not [name for name in names if '/ros/' in name or 'test' in name or 'share' in name]
    assert not [name for name in names if name.endswith('entry_points.txt')]


def test_what_is_in_it_imports_without_ros(wheel, tmp_path):
    with zipfile.ZipFile(wheel) as file:
        file.extractall(tmp_path)
    # To compile anew would take minutes; this shows, too, that the sources are the same.
    made = library_path()
    copytree(made, tmp_path / 'tp_controller' / '__pycache__' / made.name)
    script = """
import tp_controller
assert tp_controller.__file__.startswith(FOLDER), tp_controller.__file__
robot = tp_controller.Robot.from_dh([1.0, 1.0], limits={'velocity': 1.0})
task = tp_controller.PositionTask('tip', robot, 'link_2', 'xy', target=[1.0, 0.5])
stack = tp_controller.Stack(robot, [task])
print(*stack.step([0.3, 0.6]).command)
"""
    done = subprocess.run(
        [sys.executable, '-c', f'FOLDER = {str(tmp_path)!r}\n{BLOCKED}{script}'],
        env={'PYTHONPATH': str(tmp_path)},
        cwd=tmp_path,
        check=True,
        capture_output=True,
        text=True,
    )
    assert len(done.stdout.split()) == 2
    assert not done.stderr


def test_nothing_is_left_beside_the_sources(repository, wheel):
    assert not (repository / 'tp_controller' / 'build').exists()


def test_the_public_names_are_all_there():
    for name in tp_controller.__all__:
        assert getattr(tp_controller, name) is not None

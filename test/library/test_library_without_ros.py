"""The library part in a python of its own, in which nothing of ROS can be imported."""

import os
import subprocess
import sys
from pathlib import Path

import tp_controller

PACKAGES = str(Path(tp_controller.__file__).parents[1])
CONFIG = Path(__file__).resolve().parents[2] / 'config'

BLOCKED = """
import sys

ROS = ('rclpy', 'rpyutils', 'rosidl_', 'rosgraph_msgs', 'ament_', 'builtin_interfaces',
       'unique_identifier_msgs', 'action_msgs', 'geometry_msgs', 'sensor_msgs', 'std_msgs',
       'std_srvs', 'rcl_interfaces', 'lifecycle_msgs', 'diagnostic_msgs',
       'visualization_msgs', 'trajectory_msgs',
       'tp_interfaces', 'tp_sim')

class Blocker:
    def find_spec(self, name, path=None, target=None):
        if name.startswith(ROS):
            raise ImportError(f'{name} belongs to ROS')

sys.meta_path.insert(0, Blocker())
"""


def run(script):
    result = subprocess.run(
        [sys.executable, '-c', BLOCKED + script],
        env=os.environ | {'PYTHONPATH': os.pathsep.join([PACKAGES, *sys.path])},
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert result.returncode == 0, result.stderr
    return result.stdout


def test_every_module_outside_the_ros_subpackage_imports_without_ros():
    names = run("""
import importlib, pkgutil
import tp_controller

for module in pkgutil.walk_packages(tp_controller.__path__, 'tp_controller.'):
    if 'ros' not in module.name.split('.'):
        importlib.import_module(module.name)
        print(module.name)
assert not [name for name in sys.modules if name.startswith((*ROS, 'tp_controller.ros.'))]
""").split()
    expected = {'robot.dh', 'tasks.pose', 'solvers.recursive', 'stack', 'config.files'}
    assert {f'tp_controller.{name}' for name in expected} < set(names)


def test_the_blocker_of_these_tests_does_block_ros():
    run("""
for name in ('rclpy', 'geometry_msgs.msg', 'tp_interfaces.msg', 'tp_controller.ros.controller'):
    try:
        __import__(name)
    except ImportError:
        continue
    raise AssertionError(f'{name} was imported')
""")


def test_a_stack_takes_a_step_without_ros():
    output = run(f"""
import numpy
from tp_controller import build_settings, read_parameter_file

parameters = read_parameter_file({str(CONFIG / 'a3_position_orientation.yaml')!r}, 'tp_controller')
print(build_settings(parameters).stack.step(numpy.array([0.0, 0.6, 0.3])).command.size)
""")
    assert output.split() == ['3']


def test_importing_the_package_alone_loads_neither_numpy_nor_pinocchio():
    run("""
import tp_controller
assert not {'numpy', 'pinocchio'} & set(sys.modules)
""")


def test_the_package_offers_what_it_lists_and_nothing_else():
    run("""
import tp_controller
for name in tp_controller.__all__:
    assert getattr(tp_controller, name).__name__ == name
try:
    tp_controller.nothing
except AttributeError as error:
    assert 'nothing' in str(error)
else:
    raise AssertionError('no AttributeError')
""")

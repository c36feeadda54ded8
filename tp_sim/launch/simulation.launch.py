r"""Simulator, controller and RViz.

Examples::

    ros2 launch tp_sim simulation.launch.py
    ros2 launch tp_sim simulation.launch.py config:=config/a4_position_joint.yaml \
        point_task:=ee_position

The second moves the arm to where the tool "Publish Point" clicks.
"""

from pathlib import Path

from ament_index_python.packages import PackageNotFoundError, get_package_share_directory
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, LogInfo, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from tp_controller.config import (
    build_robot,
    describe_robot,
    read_parameter_file,
    read_parameters,
    task_names,
)
from tp_controller.errors import InvalidValue

CONFIG = Path(get_package_share_directory('tp_controller')) / 'config' / 'panda.yaml'
RVIZ = Path(get_package_share_directory('tp_sim')) / 'rviz' / 'controller.rviz'

ARGUMENTS = (
    ('config', str(CONFIG), 'parameter file of both nodes'),
    ('namespace', '', 'namespace of all nodes'),
    ('rviz', 'auto', 'true or false: whether RViz is started; auto: if it is installed'),
    ('rviz_config', str(RVIZ), 'what RViz shows'),
    ('point_task', '', 'task whose goal is the point that is clicked in RViz'),
    ('pose_task', '', 'task whose goal is the 2D goal pose of RViz'),
)
TOOLS = (('point_task', 'clicked_point'), ('pose_task', 'goal_pose'))
FOR_RVIZ = ('robot_state_publisher', 'rviz2')


def generate_launch_description():
    """Start all nodes on one parameter file."""
    return LaunchDescription(
        [
            *(
                DeclareLaunchArgument(
                    name,
                    default_value=default,
                    description=text,
                    choices=('auto', 'true', 'false') if name == 'rviz' else None,
                )
                for name, default, text in ARGUMENTS
            ),
            OpaqueFunction(function=_nodes),
        ]
    )


def _nodes(context):
    given = {name: LaunchConfiguration(name).perform(context) for name, _, _ in ARGUMENTS}
    values = read_parameters(read_parameter_file(given['config'], 'tp_controller'))
    tasks = task_names(values)
    for name, _ in TOOLS:
        if given[name] and given[name] not in tasks:
            raise InvalidValue(name, repr(given[name]), f'one of {", ".join(tasks)}')
    common = {'namespace': given['namespace'], 'output': 'screen'}
    goals = [(f'~/{given[task]}/goal', topic) for task, topic in TOOLS if given[task]]
    nodes = [
        Node(
            package='tp_sim',
            executable='simulator',
            parameters=[given['config']],
            **common,
        ),
        Node(
            package='tp_controller',
            executable='controller',
            parameters=[given['config']],
            remappings=goals,
            **common,
        ),
    ]
    if given['rviz'] == 'false':
        return nodes
    # A package that is missing ends a launch when the nodes before it run already.
    missing = [package for package in FOR_RVIZ if not _is_installed(package)]
    if missing and given['rviz'] == 'true':
        raise InvalidValue('rviz', f'true without package {missing[0]}', 'auto or false')
    if missing:
        return [LogInfo(msg=f'without RViz: package {missing[0]} is not installed'), *nodes]
    return [
        *nodes,
        Node(
            package='robot_state_publisher',
            executable='robot_state_publisher',
            parameters=[{'robot_description': describe_robot(values)}],
            # The simulator publishes the description already.
            remappings=[('robot_description', 'robot_state_publisher/robot_description')],
            **common,
        ),
        Node(
            package='rviz2',
            executable='rviz2',
            arguments=['-d', given['rviz_config'], '-f', build_robot(values).base_frame],
            **common,
        ),
    ]


def _is_installed(package):
    try:
        get_package_share_directory(package)
    except PackageNotFoundError:
        return False
    return True

r"""The controller of a real robot.

Example, with ros2_control's forward_command_controller::

    ros2 launch tp_controller robot.launch.py config:=my_arm.yaml \
        velocity_command:=/velocity_controller/commands
"""

from pathlib import Path

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from tp_controller.errors import InvalidValue

ARGUMENTS = (
    ('config', None, 'parameter file of the controller'),
    ('namespace', '', 'namespace of this robot'),
    ('joint_states', 'joint_states', 'topic of the joint states'),
    ('velocity_command', 'joint_velocity_command', 'topic of commands that are velocities'),
    ('position_command', 'joint_position_command', 'topic of commands that are positions'),
    ('robot_description', 'robot_description', 'topic of a URDF that the file does not name'),
    (
        'autostart',
        '',
        'true or false: whether the controller activates itself; else as in the file',
    ),
    ('use_sim_time', '', 'true or false: whether time comes from /clock; else as in the file'),
    ('log_level', 'info', 'what the log has: debug, info, warn, error or fatal'),
)
SWITCHES = ('autostart', 'use_sim_time')


def generate_launch_description():
    """Start the controller; its end ends the launch."""
    return LaunchDescription(
        [
            *(
                DeclareLaunchArgument(
                    name,
                    default_value=default,
                    description=text,
                    choices=('', 'true', 'false') if name in SWITCHES else None,
                )
                for name, default, text in ARGUMENTS
            ),
            OpaqueFunction(function=_nodes),
        ]
    )


def _nodes(context):
    given = {name: LaunchConfiguration(name).perform(context) for name, _, _ in ARGUMENTS}
    if not Path(given['config']).is_file():
        raise InvalidValue('config', repr(given['config']), 'a parameter file')
    # Only what was given: the file counts else.
    values = {name: given[name] == 'true' for name in SWITCHES if given[name]}
    return [
        Node(
            package='tp_controller',
            executable='controller',
            # With its name the values count for this node alone, and win over the file.
            name='tp_controller',
            namespace=given['namespace'],
            parameters=[given['config'], *([values] if values else [])],
            remappings=[
                ('joint_states', given['joint_states']),
                ('joint_velocity_command', given['velocity_command']),
                ('joint_position_command', given['position_command']),
                ('robot_description', given['robot_description']),
            ],
            ros_arguments=['--log-level', given['log_level']],
            output='screen',
            emulate_tty=True,
        )
    ]

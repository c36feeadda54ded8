r"""The controller of a real robot.

Example, with ros2_control's forward_command_controller::

    ros2 launch tp_controller robot.launch.py config:=my_arm.yaml \
        velocity_command:=/velocity_controller/commands
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

ARGUMENTS = (
    ('config', None, 'parameter file of the controller'),
    ('namespace', '', 'namespace of this robot'),
    ('joint_states', 'joint_states', 'topic of the joint states'),
    ('velocity_command', 'joint_velocity_command', 'topic of commands that are velocities'),
    ('position_command', 'joint_position_command', 'topic of commands that are positions'),
    ('robot_description', 'robot_description', 'topic of a URDF that the file does not name'),
    ('autostart', 'true', 'whether the controller configures and activates itself'),
    ('use_sim_time', 'false', 'whether time comes from /clock'),
    ('log_level', 'info', 'what the log has: debug, info, warn, error or fatal'),
)


def generate_launch_description():
    """Start the controller; its end ends the launch."""
    controller = Node(
        package='tp_controller',
        executable='controller',
        namespace=LaunchConfiguration('namespace'),
        parameters=[
            LaunchConfiguration('config'),
            {
                name: ParameterValue(LaunchConfiguration(name), value_type=bool)
                for name in ('autostart', 'use_sim_time')
            },
        ],
        remappings=[
            ('joint_states', LaunchConfiguration('joint_states')),
            ('joint_velocity_command', LaunchConfiguration('velocity_command')),
            ('joint_position_command', LaunchConfiguration('position_command')),
            ('robot_description', LaunchConfiguration('robot_description')),
        ],
        ros_arguments=['--log-level', LaunchConfiguration('log_level')],
        output='screen',
        emulate_tty=True,
    )
    return LaunchDescription(
        [
            *(
                DeclareLaunchArgument(name, default_value=default, description=text)
                for name, default, text in ARGUMENTS
            ),
            controller,
        ]
    )

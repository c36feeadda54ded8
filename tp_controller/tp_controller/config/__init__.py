"""From the dictionary of a parameter file to a robot, tasks and a stack."""

from tp_controller.config.additions import build_addition, check_removal, remove
from tp_controller.config.build import (
    Settings,
    arm_joints,
    build_robot,
    build_settings,
    build_stack,
    describe_robot,
    know_rate,
    read_parameters,
)
from tp_controller.config.changes import check_changes
from tp_controller.config.files import empty_list, read_blocks, read_parameter_file, read_task
from tp_controller.config.schema import (
    AUTOSTART,
    HOLD,
    PRESENT,
    RESUME,
    SHARED,
    START,
    TARGETS,
    controller_schema,
    robot_source,
    shared_schema,
)

__all__ = [
    'AUTOSTART',
    'HOLD',
    'PRESENT',
    'RESUME',
    'SHARED',
    'START',
    'TARGETS',
    'Settings',
    'arm_joints',
    'build_addition',
    'build_robot',
    'build_settings',
    'build_stack',
    'check_changes',
    'check_removal',
    'controller_schema',
    'describe_robot',
    'empty_list',
    'know_rate',
    'read_blocks',
    'read_parameter_file',
    'read_parameters',
    'read_task',
    'remove',
    'robot_source',
    'shared_schema',
]

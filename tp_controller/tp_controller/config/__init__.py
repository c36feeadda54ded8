"""From the dictionary of a parameter file to a robot, tasks and a stack."""

from tp_controller.config.additions import build_addition, remove
from tp_controller.config.build import (
    Settings,
    arm_joints,
    build_robot,
    build_settings,
    build_stack,
    build_task,
    describe_robot,
    know_rate,
    read_parameters,
)
from tp_controller.config.changes import check_changes
from tp_controller.config.files import (
    empty_list,
    parse_parameters,
    read_blocks,
    read_parameter_file,
    read_task,
    read_text,
)
from tp_controller.config.requests import Request, check_request, remaining, split_request
from tp_controller.config.saving import parameter_text, present_parameters, write_text
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
    task_names,
    task_schema,
)

__all__ = [
    'AUTOSTART',
    'HOLD',
    'PRESENT',
    'RESUME',
    'SHARED',
    'START',
    'TARGETS',
    'Request',
    'Settings',
    'arm_joints',
    'build_addition',
    'build_robot',
    'build_settings',
    'build_stack',
    'build_task',
    'check_changes',
    'check_request',
    'controller_schema',
    'describe_robot',
    'empty_list',
    'know_rate',
    'parameter_text',
    'parse_parameters',
    'present_parameters',
    'read_blocks',
    'read_parameter_file',
    'read_parameters',
    'read_task',
    'read_text',
    'remaining',
    'remove',
    'robot_source',
    'shared_schema',
    'split_request',
    'task_names',
    'task_schema',
    'write_text',
]

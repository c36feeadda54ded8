"""Units of what tasks have, for pictures and pages."""

from __future__ import annotations

from tp_controller.robot import Robot

UNITS = {
    'position': 'm',
    'orientation': 'rad',
    'gaze': 'rad',
    'obstacle': 'm',
    'self_collision': 'm',
}
"""Units of the tasks that do not mix metres and radians."""
ON_JOINTS = ('joint', 'joint_limits', 'posture')
MIXED = 'm, rad'


def unit(task_type: str, robot: Robot) -> str:
    """Unit of a task's error; of one on joints that of the robot's joints."""
    if task_type in ON_JOINTS:
        slides = robot.sliding
        return 'm' if slides.all() else MIXED if slides.any() else 'rad'
    return UNITS.get(task_type, MIXED)


def speed(unit_of_error: str) -> str:
    """Unit of the speed of what has a unit."""
    return ', '.join(f'{name}/s' for name in unit_of_error.split(', '))

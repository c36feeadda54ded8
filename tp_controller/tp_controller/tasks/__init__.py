"""Tasks by the type names of parameter files."""

from collections.abc import Mapping
from typing import Any

from tp_controller.errors import InvalidValue, listed
from tp_controller.plugins import Registry, check_class
from tp_controller.tasks.base import Task
from tp_controller.tasks.clearance import ClearanceTask
from tp_controller.tasks.common import COMMON, Common
from tp_controller.tasks.frame import FrameTask
from tp_controller.tasks.gaze import GazeTask
from tp_controller.tasks.joint import JointTask
from tp_controller.tasks.joint_limits import JointLimitsTask
from tp_controller.tasks.manipulability import ManipulabilityTask
from tp_controller.tasks.obstacle import ObstacleTask
from tp_controller.tasks.orientation import OrientationTask
from tp_controller.tasks.pose import PoseTask
from tp_controller.tasks.position import PositionTask
from tp_controller.tasks.posture import PostureTask
from tp_controller.tasks.self_collision import SelfCollisionTask
from tp_controller.tasks.set_based import SetBasedTask
from tp_controller.tasks.task_settings import TaskSettings
from tp_controller.tasks.thresholds import Switching
from tp_controller.tasks.whole_arm import Measures, WholeArmTask

_OWN: tuple[type[Task], ...] = (
    PositionTask,
    OrientationTask,
    PoseTask,
    GazeTask,
    JointTask,
    PostureTask,
    ManipulabilityTask,
    JointLimitsTask,
    ObstacleTask,
    SelfCollisionTask,
)


def _check(name: str, kind: Any) -> None:
    check_class(Task, name, kind)
    parameters = getattr(kind, 'parameters', None)
    if not isinstance(parameters, Mapping):
        raise InvalidValue(name, 'no parameters', 'a dictionary of Parameter')
    if taken := parameters.keys() & COMMON:
        got = f'parameters {listed(sorted(taken))}'
        raise InvalidValue(name, got, 'names that no other task has for something else')


TASK_TYPES: Registry[type[Task]] = Registry(
    'tp_controller.tasks', {task.type: task for task in _OWN}, _check
)
"""Task classes by the ``type`` of parameter files; other packages may add some."""

__all__ = [
    'COMMON',
    'TASK_TYPES',
    'ClearanceTask',
    'Common',
    'FrameTask',
    'GazeTask',
    'JointLimitsTask',
    'JointTask',
    'ManipulabilityTask',
    'Measures',
    'ObstacleTask',
    'OrientationTask',
    'PoseTask',
    'PositionTask',
    'PostureTask',
    'SelfCollisionTask',
    'SetBasedTask',
    'Switching',
    'Task',
    'TaskSettings',
    'WholeArmTask',
]

"""Tasks by the type names of parameter files."""

from tp_controller.tasks.base import COMMON, Common, Task
from tp_controller.tasks.clearance import ClearanceTask
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
from tp_controller.tasks.set_based import SetBasedTask, Switching
from tp_controller.tasks.whole_arm import Measures, WholeArmTask

TASK_TYPES: dict[str, type[Task]] = {
    task.type: task
    for task in (
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
}
"""Task classes by the ``type`` of parameter files."""

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
    'WholeArmTask',
]

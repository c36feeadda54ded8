"""Task-priority control of robot arms; no ROS is imported here.

The ROS 2 nodes are in `tp_controller.ros`. The names below are loaded on first use, so that
an executable can take charge of its signals before numpy and Pinocchio are read.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from tp_controller.blending import Blend, blend
    from tp_controller.config import build_settings, read_parameter_file
    from tp_controller.errors import InvalidValue, TaskPriorityError, UnusableState
    from tp_controller.explanation import Explanation, explain, explain_step
    from tp_controller.objectives import (
        JointRangeObjective,
        ManipulabilityObjective,
        Objective,
        PostureObjective,
    )
    from tp_controller.problem import Level, Problem
    from tp_controller.robot import DHParameters, Limits, Response, Robot, State
    from tp_controller.safety_filter import SafetyFilter
    from tp_controller.solution import LevelSolution, Solution, solve
    from tp_controller.solvers import Inverse, Solver, solver_of
    from tp_controller.stack import Stack
    from tp_controller.step_results import LevelResult, Step
    from tp_controller.tasks import (
        FrameTask,
        GazeTask,
        JointLimitsTask,
        JointTask,
        ManipulabilityTask,
        Measures,
        ObstacleTask,
        OrientationTask,
        PoseTask,
        PositionTask,
        PostureTask,
        SelfCollisionTask,
        SetBasedTask,
        Switching,
        Task,
        WholeArmTask,
    )

__all__ = [
    'Blend',
    'DHParameters',
    'Explanation',
    'FrameTask',
    'GazeTask',
    'InvalidValue',
    'Inverse',
    'JointLimitsTask',
    'JointRangeObjective',
    'JointTask',
    'Level',
    'LevelResult',
    'LevelSolution',
    'Limits',
    'ManipulabilityObjective',
    'ManipulabilityTask',
    'Measures',
    'Objective',
    'ObstacleTask',
    'OrientationTask',
    'PoseTask',
    'PositionTask',
    'PostureObjective',
    'PostureTask',
    'Problem',
    'Response',
    'Robot',
    'SafetyFilter',
    'SelfCollisionTask',
    'SetBasedTask',
    'Solution',
    'Solver',
    'Stack',
    'State',
    'Step',
    'Switching',
    'Task',
    'TaskPriorityError',
    'UnusableState',
    'WholeArmTask',
    'blend',
    'build_settings',
    'explain',
    'explain_step',
    'read_parameter_file',
    'solve',
    'solver_of',
]

_MODULES = (
    'errors',
    'robot',
    'objectives',
    'solvers',
    'problem',
    'solution',
    'tasks',
    'safety_filter',
    'explanation',
    'blending',
    'step_results',
    'stack',
    'config',
)
"""Modules that the names come from, the quickest to load first."""


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    for module in _MODULES:
        found = importlib.import_module(f'{__name__}.{module}')
        if hasattr(found, name):
            globals()[name] = getattr(found, name)
            return globals()[name]
    raise AttributeError(name)

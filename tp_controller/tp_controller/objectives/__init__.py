"""Functions of the configuration that redundancy is used for."""

from functools import partial

from tp_controller.objectives.base import Objective
from tp_controller.objectives.joint_range import JointRangeObjective
from tp_controller.objectives.manipulability import ManipulabilityObjective
from tp_controller.objectives.posture import PostureObjective
from tp_controller.plugins import Registry, check_class

_OWN: tuple[type[Objective], ...] = (
    PostureObjective,
    JointRangeObjective,
    ManipulabilityObjective,
)

OBJECTIVE_TYPES: Registry[type[Objective]] = Registry(
    'tp_controller.objectives',
    {objective.type: objective for objective in _OWN},
    partial(check_class, Objective),
)
"""Objective classes by ``solver.objective.type``; other packages may add some."""

__all__ = [
    'OBJECTIVE_TYPES',
    'JointRangeObjective',
    'ManipulabilityObjective',
    'Objective',
    'PostureObjective',
]

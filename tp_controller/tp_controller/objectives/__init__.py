"""Functions of the configuration that redundancy is used for."""

from tp_controller.objectives.base import Objective
from tp_controller.objectives.joint_range import JointRangeObjective
from tp_controller.objectives.manipulability import ManipulabilityObjective
from tp_controller.objectives.posture import PostureObjective

OBJECTIVE_TYPES: dict[str, type[Objective]] = {
    objective.type: objective
    for objective in (PostureObjective, JointRangeObjective, ManipulabilityObjective)
}
"""Objective classes by the ``solver.objective.type`` of parameter files."""

__all__ = [
    'OBJECTIVE_TYPES',
    'JointRangeObjective',
    'ManipulabilityObjective',
    'Objective',
    'PostureObjective',
]

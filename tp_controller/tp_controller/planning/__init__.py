"""Ways to goals: configurations that have them, and ways in joint space to these. Without ROS."""

from tp_controller.planning.ahead import Ahead, look_ahead
from tp_controller.planning.planner import Kind, Phase, Plan, Planner
from tp_controller.planning.search import Answer, Solution, solve
from tp_controller.planning.way import Way, find_way

__all__ = [
    'Ahead',
    'Answer',
    'Kind',
    'Phase',
    'Plan',
    'Planner',
    'Solution',
    'Way',
    'find_way',
    'look_ahead',
    'solve',
]

"""Ways to goals: configurations that have them, and paths in joint space to these. Without ROS."""

from tp_controller.planning.search import Answer, Solution, solve

__all__ = ['Answer', 'Solution', 'solve']

"""What the harness raises."""

from tp_controller.errors import TaskPriorityError


class HarnessError(TaskPriorityError):
    """A node that did not start, died or did not answer in time."""


class GoalRejected(TaskPriorityError):
    """A goal, feedforward or parameter that the controller refused, with its reason."""

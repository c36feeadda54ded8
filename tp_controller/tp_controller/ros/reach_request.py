"""What a request to ``~/reach`` asks for, checked as a whole."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from tp_controller.errors import InvalidValue, listed, shown
from tp_controller.progress import Progress
from tp_controller.ros.codecs import codec_of
from tp_controller.ros.task_inputs import TaskInputs
from tp_controller.stack import Stack
from tp_controller.tasks import Task
from tp_interfaces.action import Reach


def read_request(
    request: Reach.Goal, stack: Stack, inputs: TaskInputs
) -> tuple[list[Task], list[NDArray[np.float64]], Progress]:
    """Read a request to tasks of a stack, as its inputs read goals; nothing changes.

    Returns
    -------
    tuple
        Tasks, their targets, and what judges their errors.

    Raises
    ------
    InvalidValue
        If a part of it cannot be used.
    """
    if not request.goals:
        raise InvalidValue('goals', 'none', 'one for each task')
    if len(request.goals) > len(stack.tasks):
        raise InvalidValue('goals', f'{len(request.goals)}', 'one for each task')
    limit = request.time_limit
    if not 0.0 <= limit < math.inf:
        raise InvalidValue('time_limit', shown(limit), 'seconds, 0 for none')
    tasks: list[Task] = []
    for goal in request.goals:
        task = _task(goal.task, stack)
        if task in tasks:
            raise InvalidValue('goals.task', f'{shown(goal.task)} twice', 'every task once')
        tasks.append(task)
    tolerances = [goal.tolerance or request.tolerance for goal in request.goals]
    progress = Progress(tolerances, limit or math.inf)
    targets = []
    for task, goal in zip(tasks, request.goals, strict=True):
        try:
            targets.append(inputs.read_goal(task, goal.values, goal.frame_id))
        except InvalidValue as error:
            raise error if error.key == task.name else error.under(task.name) from None
    return tasks, targets, progress


def _task(name: str, stack: Stack) -> Task:
    """Task of a name that can be sent to a goal."""
    able = [
        name
        for name, task in stack.tasks.items()
        if codec_of(task) is not None and not task.set_based
    ]
    if name not in able:
        task = stack.tasks.get(name)
        got = shown(name) if task is None else f'{name}, which is of type {task.type}'
        raise InvalidValue('goals.task', got, f'one of {listed(able)}')
    if not stack.is_listed(name):
        got = f'{name}, which is not in the hierarchy and would never be reached'
        raise InvalidValue('goals.task', got, f'one of {listed(stack.hierarchy)}')
    return stack.tasks[name]

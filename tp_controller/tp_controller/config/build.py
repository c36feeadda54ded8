"""Objects from checked parameter values."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from tp_controller.config.schema import INVERSE, OBJECTIVE, REST, controller_schema, task_names
from tp_controller.errors import InvalidValue
from tp_controller.objectives import OBJECTIVE_TYPES, Objective
from tp_controller.parameters import Flat, flatten, read_all
from tp_controller.robot import (
    DHParameters,
    Limits,
    Robot,
    dh_robot,
    read_description,
    urdf_robot,
)
from tp_controller.solvers import SOLVER_TYPES, Inverse
from tp_controller.stack import Stack
from tp_controller.tasks import TASK_TYPES, Task


class Settings(NamedTuple):
    """Everything that a controller is configured with."""

    values: Flat
    """Every parameter by dotted key, defaults filled in."""
    stack: Stack
    """The stack of tasks on its robot."""


def build_settings(parameters: Mapping[str, Any]) -> Settings:
    """Build a controller's stack from its parameters.

    Parameters
    ----------
    parameters
        The dictionary under ``ros__parameters``, nested or with dotted keys.

    Raises
    ------
    InvalidValue
        For anything that cannot be used, naming the full key.
    """
    flat = flatten(parameters)
    values = read_all(flat, controller_schema(flat))
    robot = build_robot(values)
    values['robot.joints'], values['robot.base_frame'] = robot.joints, robot.base_frame
    stack = build_stack(robot, values)
    for name, task in stack.tasks.items():
        values[f'tasks.{name}.feedforward'] = tuple(task.feedforward)
    return Settings(values, stack)


def build_robot(values: Flat) -> Robot:
    """Build the robot of checked ``robot.…`` values."""
    joints = values['robot.joints']
    if values['robot.urdf'] is not None:
        return urdf_robot(
            read_description(values['robot.urdf']),
            joints,
            values['robot.base_frame'],
            {key: values[f'robot.limits.{key}'] for key in Limits.KEYS},
            {key.removeprefix(REST): values[key] for key in values if key.startswith(REST)},
        )
    dh = DHParameters(*(values[f'robot.dh.{key}'] for key in DHParameters._fields))
    limits = Limits(len(joints), **{key: values[f'robot.limits.{key}'] for key in Limits.KEYS})
    return dh_robot(joints, dh, values['robot.base_frame'], limits)


def build_stack(robot: Robot, values: Flat) -> Stack:
    """Build the stack of checked values on a robot."""
    tasks = [_task(name, robot, values) for name in task_names(values)]
    solver = SOLVER_TYPES[values['solver.type']](
        robot.n,
        Inverse(*(values[f'solver.{key}'] for key in INVERSE)),
        values['solver.joint_weights'],
        _objective(robot, values),
    )
    return Stack(robot, tasks, values['hierarchy'], solver)


def _objective(robot: Robot, values: Flat) -> Objective | None:
    kind = values['solver.objective.type']
    if kind is None:
        return None
    own = {key.removeprefix(OBJECTIVE): values[key] for key in values if key.startswith(OBJECTIVE)}
    try:
        objective = OBJECTIVE_TYPES[kind].from_parameters(robot, own)
    except InvalidValue as error:
        raise error.under('solver.objective') from None
    objective.gain = own['gain']
    return objective


def _task(name: str, robot: Robot, values: Flat) -> Task:
    prefix = f'tasks.{name}.'
    own = {key.removeprefix(prefix): values[key] for key in values if key.startswith(prefix)}
    try:
        task = TASK_TYPES[own['type']].from_parameters(name, robot, own)
        task.gain = own['gain']
        task.weight = own['weight']
        task.inverse = Inverse(*(own[key] for key in INVERSE))
        if own['feedforward'] is not None:
            task.feedforward = own['feedforward']
        if own['target'] is not None:
            task.target = own['target']
    except InvalidValue as error:
        raise error.under(f'tasks.{name}') from None
    return task

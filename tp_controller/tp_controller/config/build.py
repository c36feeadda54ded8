"""Objects from checked parameter values."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from tp_controller.config.schema import (
    DESCRIPTION,
    HOLD,
    INVERSE,
    OBJECTIVE,
    REST,
    START,
    URDF,
    controller_schema,
    robot_source,
    task_names,
)
from tp_controller.errors import NO_VALUE, InvalidValue
from tp_controller.hierarchy import split_hierarchy
from tp_controller.objectives import OBJECTIVE_TYPES, Objective
from tp_controller.parameters import Flat, flatten, read_all
from tp_controller.robot import (
    DHParameters,
    Limits,
    Response,
    Robot,
    clad,
    dh_description,
    dh_robot,
    read_description,
    urdf_robot,
)
from tp_controller.robot.bodies import CAPSULES, LINK_RADIUS
from tp_controller.robot.motions import BASE, FIXED
from tp_controller.robot.response import KEYS as RESPONSE
from tp_controller.robot.srdf import SRDF
from tp_controller.solvers import SOLVER_TYPES, Inverse, Solver
from tp_controller.stack import Stack
from tp_controller.tasks import TASK_TYPES, Task

BASE_KIND = 'robot.base'
RANGE = ('position_min', 'position_max')
"""Limits that make a range."""


class Settings(NamedTuple):
    """Everything that a controller is configured with."""

    values: Flat
    """Every parameter by dotted key, defaults filled in."""
    stack: Stack
    """The stack of tasks on its robot."""


def build_settings(
    parameters: Mapping[str, Any], description: str | None = None, find_rate: bool = False
) -> Settings:
    """Build a controller's stack from its parameters.

    Parameters
    ----------
    parameters
        The dictionary under ``ros__parameters``, nested or with dotted keys. Without `start`,
        which the controller's node sets to ``hold``, tasks go to their targets.
    description
        URDF of the robot for parameters that name none.
    find_rate
        Whether the rate, if it is left out, is told to the stack before it moves anything,
        see `know_rate`. Ranges of the description are then no reason to refuse; those of the
        parameters are.

    Raises
    ------
    InvalidValue
        For anything that cannot be used, naming the full key; for ranges without ``rate``,
        which nobody would keep.
    """
    values = read_parameters(parameters)
    robot = build_robot(values, description)
    if not find_rate or any(values[f'robot.limits.{key}'] is not None for key in RANGE):
        robot.limits.check_period(robot.joints, _period(values))
    values['robot.joints'], values['robot.base_frame'] = (
        arm_joints(robot, values),
        robot.base_frame,
    )
    stack = build_stack(robot, values)
    for name, task in stack.tasks.items():
        values[f'tasks.{name}.feedforward'] = tuple(task.feedforward)
    if flatten(parameters).get(START) == HOLD:
        stack.forget_targets()
    return Settings(values, stack)


def know_rate(settings: Settings, rate: float) -> None:
    """Tell a stack that was built without ``rate`` what it is [Hz], before it moves anything."""
    settings.values['rate'] = rate
    settings.stack.know_period(1.0 / rate)


def read_parameters(parameters: Mapping[str, Any]) -> Flat:
    """Check a controller's parameters as far as that is possible without its robot.

    Parameters
    ----------
    parameters
        The dictionary under ``ros__parameters``, nested or with dotted keys.

    Returns
    -------
    dict
        Every parameter by dotted key, defaults filled in.

    Raises
    ------
    InvalidValue
        For anything that cannot be used, naming the full key.
    """
    flat = flatten(parameters)
    values = read_all(flat, controller_schema(flat))
    split_hierarchy(values['hierarchy'], task_names(values))
    return values


def describe_robot(values: Flat, received: str | None = None) -> str:
    """URDF of checked ``robot.…`` values: given, read from a file, or made of DH parameters.

    Parameters
    ----------
    values
        The values by dotted key.
    received
        URDF for values that name no robot.

    Raises
    ------
    InvalidValue
        If there is none, or the DH parameters cannot be used.
    """
    source = robot_source(values)
    if source is None:
        if received is None:
            raise InvalidValue('robot', NO_VALUE, 'robot.dh, robot.urdf or robot_description')
        return received
    if source == URDF:
        return read_description(values[URDF])
    if source == DESCRIPTION:
        return values[DESCRIPTION]
    # A description is that of the arm alone, which the same parameter puts on its base.
    robot = _dh_robot(values)
    joints, dh, base_frame = _dh_arm(values)
    if robot.space.blocks:
        base_frame = BASE
    return dh_description(joints, dh, base_frame, robot.limits.part(robot.n - len(joints)))


def arm_joints(robot: Robot, values: Flat) -> tuple[str, ...]:
    """Names of the controlled joints as in ``robot.joints``, without that of ``robot.base``."""
    return robot.space.joints[0 if values[BASE_KIND] == FIXED else 1 :]


def build_robot(values: Flat, received: str | None = None) -> Robot:
    """Build the robot of checked ``robot.…`` values.

    Parameters
    ----------
    values
        The values by dotted key.
    received
        URDF for values that name no robot.

    Raises
    ------
    InvalidValue
        As `describe_robot`; if the description cannot be used.
    """
    robot = _described(values, received)
    robot.response = Response.of(robot.n, **{key: values[f'robot.{key}'] for key in RESPONSE})
    return robot


def _described(values: Flat, received: str | None) -> Robot:
    source = robot_source(values)
    if source not in (URDF, DESCRIPTION, None):
        return _clad(_dh_robot(values), None, values)
    text = describe_robot(values, received)
    limits = {key: values[f'robot.limits.{key}'] for key in Limits.KEYS}
    rest = {key.removeprefix(REST): values[key] for key in values if key.startswith(REST)}
    try:
        robot = urdf_robot(
            text,
            values['robot.joints'],
            values['robot.base_frame'],
            limits,
            rest,
            values[BASE_KIND],
        )
        return _clad(robot, text, values)
    except InvalidValue as error:
        if error.key == URDF and source != URDF:
            raise InvalidValue(DESCRIPTION, error.got, error.accepts) from None
        raise


def _clad(robot: Robot, description: str | None, values: Flat) -> Robot:
    capsules = {
        key.removeprefix(CAPSULES): values[key] for key in values if key.startswith(CAPSULES)
    }
    clad(robot, description, values[LINK_RADIUS], capsules, values[SRDF])
    return robot


def _dh_robot(values: Flat) -> Robot:
    robot = dh_robot(*_dh_arm(values), base=values[BASE_KIND])
    limits = {key: values[f'robot.limits.{key}'] for key in Limits.KEYS}
    robot.limits = robot.limits.replaced(**limits)
    return robot


def _dh_arm(values: Flat) -> tuple[Sequence[str], DHParameters, str | None]:
    """Joints, parameters and base frame, arguments of `dh_robot` and `dh_description`."""
    dh = DHParameters(*(values[f'robot.dh.{key}'] for key in DHParameters._fields))
    return values['robot.joints'], dh, values['robot.base_frame']


def build_stack(robot: Robot, values: Flat) -> Stack:
    """Build the stack of checked values on a robot."""
    tasks = [build_task(name, robot, values) for name in task_names(values)]
    solver = build_solver(robot, values)
    named = {task.name: task for task in tasks}
    levels = [
        [named[name] for name in names] for names in split_hierarchy(values['hierarchy'], named)
    ]
    return Stack(
        robot,
        levels,
        solver,
        values['rate'],
        tasks,
        values['solver.settle'],
        values['transition_time'],
    )


def build_solver(robot: Robot, values: Flat) -> Solver:
    """Build the solver of checked values.

    Raises
    ------
    InvalidValue
        If they do not suit the robot or each other.
    """
    return SOLVER_TYPES[values['solver.type']](
        robot.n,
        Inverse(*(values[f'solver.{key}'] for key in INVERSE)),
        values['solver.joint_weights'],
        _objective(robot, values),
        values['solver.saturation'],
    )


def _period(values: Flat) -> float:
    return math.inf if values['rate'] is None else 1.0 / values['rate']


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


def build_task(name: str, robot: Robot, values: Flat) -> Task:
    """Build a task of checked values on a robot.

    Raises
    ------
    InvalidValue
        If they do not suit the robot.
    """
    prefix = f'tasks.{name}.'
    own = {key.removeprefix(prefix): values[key] for key in values if key.startswith(prefix)}
    try:
        own['period'] = _period(values)
        task = TASK_TYPES[own['type']].from_parameters(name, robot, own)
        task.period = own['period']
        task.enabled = own['enabled']
        task.gain = own['gain']
        task.weight = own['weight']
        task.time_scaling = own.get('time_scaling', False)
        task.around = own.get('around', False)
        task.inverse = Inverse(*(own[key] for key in INVERSE))
        if own.get('max_speed') is not None:
            task.max_speed = own['max_speed']
        if own['feedforward'] is not None:
            task.feedforward = own['feedforward']
        if own.get('target') is not None:
            task.target = own['target']
    except InvalidValue as error:
        # The shapes of links are the robot's.
        raise (error if error.key.startswith('robot.') else error.under(f'tasks.{name}')) from None
    return task

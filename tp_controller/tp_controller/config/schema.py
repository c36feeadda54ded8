"""The parameters of the controller, and those that the simulator shares with it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from tp_controller.errors import NO_VALUE, InvalidValue
from tp_controller.objectives import OBJECTIVE_TYPES
from tp_controller.parameters import (
    BOOLEAN,
    NUMBER,
    NUMBERS,
    REQUIRED,
    TEXT,
    TEXTS,
    Parameter,
    check_name,
)
from tp_controller.robot.bodies import CAPSULES, LINK_RADIUS
from tp_controller.robot.dh import CONVENTIONS, JOINT_TYPES
from tp_controller.robot.motions import BASES, FIXED
from tp_controller.robot.srdf import SRDF
from tp_controller.solvers import DEFAULT, INVERSES, SATURATIONS, SOLVER_TYPES
from tp_controller.tasks import COMMON, TASK_TYPES

URDF = 'robot.urdf'
DESCRIPTION = 'robot_description'
START = 'start'
HOLD, TARGET = STARTS = ('hold', 'target')
RESUME = 'resume'
AUTOSTART = 'autostart'
PRESENT, TARGETS = RESUMES = ('present', 'targets')
VELOCITY_TYPES = ('joint_state', 'float64_multi_array')
POSITION_TYPES = ('joint_state_position', 'float64_multi_array_position')
COMMAND_TYPES = VELOCITY_TYPES + POSITION_TYPES

SHARED: Mapping[str, Parameter] = {
    'robot.joints': Parameter(
        TEXTS,
        'Names of the controlled joints; required with dh, all movable ones with a URDF',
        default=REQUIRED,
    ),
    'robot.urdf': Parameter(
        TEXT, 'Description in place of dh: a path, or package://<package>/<path>'
    ),
    SRDF: Parameter(
        TEXT,
        'SRDF whose disable_collisions self_collision leaves out: a path, or '
        'package://<package>/<path>',
    ),
    'robot_description': Parameter(
        TEXT, 'URDF in place of both; without any of the three, taken from the topic of that name'
    ),
    'robot.dh.theta': Parameter(
        NUMBERS, 'DH angle [rad] per joint; the offset of a revolute one', default=REQUIRED
    ),
    'robot.dh.d': Parameter(
        NUMBERS, 'DH offset [m] per joint; the offset of a prismatic one', default=REQUIRED
    ),
    'robot.dh.a': Parameter(NUMBERS, 'DH link length [m] per joint', default=REQUIRED),
    'robot.dh.alpha': Parameter(NUMBERS, 'DH link twist [rad] per joint', default=REQUIRED),
    'robot.dh.types': Parameter(
        TEXTS, 'Kind of each joint', default=REQUIRED, choices=JOINT_TYPES
    ),
    'robot.dh.base_pose': Parameter(
        NUMBERS,
        'DH frame 0 in the base frame: x y z [m], roll pitch yaw [rad]',
        default=(0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    ),
    'robot.dh.convention': Parameter(
        TEXT, 'Order of the four parameters', default='standard', choices=CONVENTIONS
    ),
    'robot.base': Parameter(
        TEXT,
        'What the arm stands on; of a base that moves the velocities come first',
        default=FIXED,
        choices=BASES,
    ),
    'robot.base_frame': Parameter(
        TEXT,
        'Frame of positions and velocities; base with dh, the root link with a URDF, odom with a '
        'base that moves',
    ),
    'robot.limits.velocity': Parameter(
        NUMBERS,
        'Largest speed [rad/s, m/s], one value or one per velocity: those of a base that moves, '
        'then one per joint',
        above=0.0,
        runtime=True,
    ),
    'robot.limits.position_min': Parameter(
        NUMBERS, 'Lower end of the range [rad, m], one value or one per joint', runtime=True
    ),
    'robot.limits.position_max': Parameter(
        NUMBERS, 'Upper end of the range [rad, m], one value or one per joint', runtime=True
    ),
    'robot.limits.acceleration': Parameter(
        NUMBERS,
        'Largest acceleration [rad/s², m/s²], one value or one per velocity; needs rate',
        above=0.0,
        runtime=True,
    ),
    'robot.delay': Parameter(
        NUMBERS,
        'Time [s] from a joint state to when the command that answers it acts, one value or one '
        'per velocity; 0 if it acts at once',
        minimum=0.0,
    ),
    'robot.lag': Parameter(
        NUMBERS,
        'Time constant [s] with which velocities follow the command, one value or one per '
        'velocity',
        minimum=0.0,
    ),
    'robot.noise': Parameter(
        NUMBERS,
        'Amplitude [rad, m] of the noise in measured positions, one value or one per velocity',
        minimum=0.0,
    ),
    'robot.hold': Parameter(
        NUMBER,
        'Time [s] for which the arm may go on with a command because the next is late or lost',
        default=0.0,
        minimum=0.0,
    ),
    LINK_RADIUS: Parameter(
        NUMBERS,
        'Radius [m] of capsules along the links, one value or one per joint, a base that moves '
        "first, in place of the URDF's collision shapes",
        above=0.0,
    ),
    'command.type': Parameter(
        TEXT,
        'Message that carries the command, and whether velocities or positions are in it',
        default='joint_state',
        choices=COMMAND_TYPES,
    ),
}
"""Parameters that both nodes read."""

CONTROLLER: Mapping[str, Parameter] = {
    **SHARED,
    'solver.type': Parameter(
        TEXT,
        'How the levels are resolved',
        default='recursive',
        choices=SOLVER_TYPES,
        runtime=True,
    ),
    'solver.inverse': Parameter(
        TEXT,
        'Damped least squares, pseudo-inverse, or damping near singularities only',
        default=DEFAULT.type,
        choices=INVERSES,
        runtime=True,
    ),
    'solver.damping': Parameter(
        NUMBER,
        'λ of the damped least squares, in the units of the singular values of J',
        default=DEFAULT.damping,
        minimum=0.0,
        runtime=True,
    ),
    'solver.singular_region': Parameter(
        NUMBER,
        'ε, the singular value below which adaptive damping sets in',
        default=DEFAULT.region,
        above=0.0,
        runtime=True,
    ),
    'solver.joint_weights': Parameter(
        NUMBERS,
        'W of the norm qdᵀ W qd to minimise: one value, one per joint, or a full matrix',
        runtime=True,
    ),
    'solver.saturation': Parameter(
        TEXT,
        'At the limits: hold joints and scale only what is infeasible, lowest levels first, or '
        'scale the whole command, whatever the priorities',
        default=SATURATIONS[0],
        choices=SATURATIONS,
        runtime=True,
    ),
    'solver.settle': Parameter(
        BOOLEAN,
        'Whether goals that cannot be had end in rest, with levels of strict priority; else the '
        'published laws alone',
        default=True,
        runtime=True,
    ),
    'solver.objective.type': Parameter(
        TEXT,
        'What projected_gradient and extended_jacobian make large',
        choices=OBJECTIVE_TYPES,
    ),
    'rate': Parameter(
        NUMBER,
        'Joint states per second [Hz]; position and acceleration limits, those of a URDF too, '
        'and set-based tasks need it',
        above=0.0,
    ),
    'command.tolerance': Parameter(
        NUMBERS,
        'With positions: deviation [rad, m] from what was sent, beyond delay and lag, at which '
        'the arm is brought to rest, one value or one per joint',
        default=(0.02,),
        above=0.0,
    ),
    'timeouts.joint_state': Parameter(
        NUMBER,
        'Age [s] at which a joint state moves nothing; without newer ones the arm is braked '
        'to rest',
        default=0.1,
        above=0.0,
    ),
    'timeouts.feedforward': Parameter(
        NUMBER,
        'Age [s] after which a feedforward message gives way to the configured value',
        default=0.5,
        above=0.0,
    ),
    START: Parameter(
        TEXT,
        'First targets of the tasks in the hierarchy: hold takes their values at the first joint '
        'state, so that the arm stays where it is until a goal comes; target those of the file',
        default=STARTS[0],
        choices=STARTS,
    ),
    AUTOSTART: Parameter(
        BOOLEAN,
        'Whether the controller configures and activates itself; if not, the services of a '
        'managed node do (ros2 lifecycle)',
        default=True,
    ),
    RESUME: Parameter(
        TEXT,
        'Targets after ~/hold and after deactivation: present lets the tasks of the hierarchy '
        'take their values then, so that the arm stays where it is until a goal comes; targets '
        'those from before; goals that came meanwhile always count',
        default=PRESENT,
        choices=RESUMES,
        runtime=True,
    ),
    'transition_time': Parameter(
        NUMBER,
        'Time [s] of transitions: for so long after a change of the stack the command changes by '
        'at most 2 · velocity limit · period / transition_time in a step; 0 lets changes act at '
        'once; needs rate',
        default=0.5,
        minimum=0.0,
        runtime=True,
    ),
    'hierarchy': Parameter(
        TEXTS,
        'Task names, highest priority first; "a + b" puts two on one level; [""] for none: the '
        'arm rests',
        default=REQUIRED,
        runtime=True,
    ),
}
"""Parameters of the controller, those of its tasks excepted."""


OBJECTIVE_GAIN = Parameter(
    NUMBER, 'Factor κ of the gradient', default=1.0, above=0.0, runtime=True
)
"""Parameter ``solver.objective.gain`` of every objective."""

INVERSE = ('inverse', 'damping', 'singular_region')
"""Keys of an inverse, under ``solver`` and under every task."""

OBJECTIVE = 'solver.objective.'
"""Beginning of the keys of an objective."""

DH = 'robot.dh.'
"""Beginning of the keys that describe a robot by Denavit-Hartenberg parameters."""
REST = 'robot.rest_positions.'
"""Beginning of the keys that hold joints of a URDF which are not controlled."""


def robot_source(flat: Mapping[str, Any]) -> str | None:
    """Key of the values that describe the robot, None if the description is yet to come.

    Returns
    -------
    str or None
        `URDF`, `DESCRIPTION` or one that begins with `DH`.

    Raises
    ------
    InvalidValue
        If there is more than one.
    """
    dh = [key for key in flat if key.startswith(DH) and flat[key] is not None]
    given = dh[:1] + [key for key in (URDF, DESCRIPTION) if flat.get(key) is not None]
    if len(given) > 1:
        raise InvalidValue(given[0], f'a value beside {given[1]}', 'one of the two')
    return given[0] if given else None


def shared_schema(flat: Mapping[str, Any]) -> dict[str, Parameter]:
    """Parameters that both nodes read, for a robot by dh or by a URDF.

    Raises
    ------
    InvalidValue
        As `robot_source`.
    """
    given = Parameter(
        NUMBERS, 'Capsules of a link: x y z of the start, x y z of the end, radius [m], and so on'
    )
    schema = {**SHARED, **{key: given for key in flat if key.startswith(CAPSULES)}}
    if (robot_source(flat) or '').startswith(DH):
        return schema
    for key in ('robot.joints', *(key for key in SHARED if key.startswith(DH))):
        schema[key] = replace(schema[key], default=None)
    held = Parameter(NUMBER, 'Position [rad, m] of a joint that is not controlled')
    return schema | {key: held for key in flat if key.startswith(REST)}


def task_names(flat: Mapping[str, Any]) -> list[str]:
    """Names of the tasks that have a ``tasks.<name>.…`` key, in their first order."""
    return list(dict.fromkeys(key.split('.')[1] for key in flat if key.startswith('tasks.')))


def controller_schema(flat: Mapping[str, Any]) -> dict[str, Parameter]:
    """Parameters of a controller with the tasks that the values name.

    Parameters
    ----------
    flat
        Values by dotted key.

    Raises
    ------
    InvalidValue
        For a task name that cannot stand in a topic name, or a task without a known type.
    """
    own = {key: p for key, p in CONTROLLER.items() if key not in SHARED}
    schema = shared_schema(flat) | own
    key = f'{OBJECTIVE}type'
    if flat.get(key) is not None:
        objective = OBJECTIVE_TYPES[schema[key].read(key, flat[key])]
        schema[f'{OBJECTIVE}gain'] = OBJECTIVE_GAIN
        schema |= {f'{OBJECTIVE}{leaf}': p for leaf, p in objective.parameters.items()}
    elif any(name.startswith(OBJECTIVE) for name in flat if flat[name] is not None):
        raise InvalidValue(key, NO_VALUE, schema[key].accepts)
    for name in task_names(flat):
        schema |= task_schema(name, flat)
    return schema


def task_schema(name: str, flat: Mapping[str, Any]) -> dict[str, Parameter]:
    """Parameters of one task, by dotted key.

    Raises
    ------
    InvalidValue
        For a name that cannot stand in a topic name, or no known type.
    """
    check_name(name)
    kind = Parameter(TEXT, COMMON['type'].description, REQUIRED, choices=TASK_TYPES)
    key = f'tasks.{name}.type'
    if flat.get(key) is None:
        raise InvalidValue(key, NO_VALUE, kind.accepts)
    task_type = TASK_TYPES[kind.read(key, flat[key])]
    leaves = {**COMMON, 'type': kind, **task_type.parameters}
    return {
        f'tasks.{name}.{leaf}': parameter
        for leaf, parameter in leaves.items()
        if leaf not in task_type.without
    }

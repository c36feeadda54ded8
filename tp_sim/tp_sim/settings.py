"""Parameters of the simulator."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

from tp_controller.config import SHARED, arm_joints, build_robot, describe_robot, shared_schema
from tp_controller.errors import InvalidValue
from tp_controller.parameters import (
    BOOLEAN,
    NUMBER,
    NUMBERS,
    REQUIRED,
    TEXT,
    Flat,
    Parameter,
    flatten,
    read_all,
)
from tp_controller.robot import Limits, Robot, Space
from tp_sim.integrator import Integrator, Vector
from tp_sim.plant import Joints, Plant
from tp_sim.plant_settings import PlantSettings
from tp_sim.rigid_body import RigidBodies, ServoSettings

KINEMATIC, RIGID_BODY = 'kinematic', 'rigid_body'
IDEAL = PlantSettings()
SERVO = ServoSettings()
PER_JOINT = ('lag', 'noise', 'scale', 'quantum')
"""Parameters ``plant.…`` with one value or one per joint."""

PLANT: Mapping[str, Parameter] = {
    'plant.type': Parameter(
        TEXT,
        'Joints that have the commanded velocity, or rigid bodies with velocity servos; the '
        'second needs a URDF with inertias',
        default=KINEMATIC,
        choices=(KINEMATIC, RIGID_BODY),
    ),
    **{
        f'plant.{key}': Parameter(
            NUMBERS if key in PER_JOINT else NUMBER,
            description + (', one value or one per joint' if key in PER_JOINT else ''),
            default=(getattr(IDEAL, key),) if key in PER_JOINT else getattr(IDEAL, key),
            minimum=None if key == 'scale' else 0.0,
            above=0.0 if key == 'scale' else None,
            runtime=True,
        )
        for key, description in (
            ('delay', 'Whole cycles after which a command acts'),
            ('lag', 'Time constant [s] of a first-order lag of the velocity'),
            ('noise', 'Largest noise [rad, m] of a measured position, uniform'),
            ('scale', 'Measured over true position and velocity'),
            ('quantum', 'Step [rad, m] that measured positions are rounded to'),
            ('command_loss', 'Probability that a command is lost; the last one stays in force'),
            ('state_loss', 'Probability that a joint state is lost; below 1 in lockstep'),
            ('seed', 'Of the noise and the losses; a new one begins them anew'),
        )
    },
    'plant.blocked': Parameter(
        BOOLEAN, 'The joints stand still; joint states go on', default=False, runtime=True
    ),
    'plant.silent': Parameter(
        BOOLEAN,
        'The joints go on, joint states pause; not in lockstep',
        default=False,
        runtime=True,
    ),
}
"""Parameters of every simulated arm."""

RIGID: Mapping[str, Parameter] = {
    'plant.bandwidth': Parameter(
        NUMBER,
        'Rigid bodies: rate [1/s] at which a joint alone approaches the command; '
        f'{SERVO.bandwidth:g} when left out',
        above=0.0,
    ),
    'plant.integral': Parameter(
        NUMBER,
        "Rigid bodies: rate [1/s] of the servos' integral part; when left out, a tenth of the "
        'bandwidth if there is friction, else 0',
        minimum=0.0,
    ),
    'plant.rotor_inertia': Parameter(
        NUMBERS,
        'Rigid bodies: inertia [kg m², kg] of the motors seen from the joints, one value or one '
        f'per joint; {SERVO.rotor_inertia:g} when left out',
        minimum=0.0,
    ),
    'plant.viscous_friction': Parameter(
        NUMBERS,
        'Rigid bodies: friction per speed [N m s/rad, N s/m], one value or one per joint; none '
        'when left out',
        minimum=0.0,
    ),
    'plant.coulomb_friction': Parameter(
        NUMBERS,
        'Rigid bodies: friction against any motion [N m, N], one value or one per joint; none '
        'when left out',
        minimum=0.0,
    ),
    'plant.effort': Parameter(
        NUMBERS,
        'Rigid bodies: largest torque [N m, N] of the motors, one value or one per joint; the '
        "URDF's effort when left out",
        above=0.0,
    ),
}
"""Further parameters of a rigid-body arm."""

SIMULATOR: Mapping[str, Parameter] = {
    'command.type': replace(
        SHARED['command.type'],
        description='Message that carries the command; what is published when left out',
        default=None,
    ),
    'rate': Parameter(NUMBER, 'Joint states per second [Hz]', default=REQUIRED, above=0.0),
    'initial_positions': Parameter(
        NUMBERS,
        'First position [rad, m] per joint, behind those of a base that moves: x y yaw, or x y z '
        'and a quaternion x y z w; zero when left out',
    ),
    'command_timeout': Parameter(
        NUMBER, 'Time [s] without a command after which the joints stop', default=0.1, above=0.0
    ),
    'lockstep': Parameter(
        BOOLEAN,
        'Publish, wait for the command that answers this stamp, integrate, repeat',
        default=False,
    ),
    'paused': Parameter(
        BOOLEAN, 'Start lockstep at a halt; ~/step and ~/pause go on from there', default=False
    ),
    **PLANT,
    **RIGID,
}
"""Parameters of the simulator node beside the shared ones."""


def simulator_schema(flat: Mapping[str, Any]) -> dict[str, Parameter]:
    """Parameters of the simulator; the simulated joints are the plant, their limits are fixed.

    Raises
    ------
    InvalidValue
        As `shared_schema`.
    """
    shared = {key: replace(p, runtime=False) for key, p in shared_schema(flat).items()}
    return {**shared, **SIMULATOR}


class SimulatorSettings(NamedTuple):
    """Everything that a simulator is configured with."""

    values: Flat
    """Every parameter by dotted key, defaults filled in."""
    space: Space
    """Configuration space, with the names of coordinates (nq,) and velocities (n,)."""
    base_frame: str
    """Name of the base frame."""
    integrator: Integrator
    """Ideal joints at the initial positions."""
    plant: Plant
    """The simulated arm; of a kinematic one the joints are those of `integrator`."""
    description: str
    """URDF of the robot."""


def read_simulator_parameters(parameters: Mapping[str, Any]) -> Flat:
    """Check the simulator's parameters as far as that is possible without its robot.

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
    values = read_all(flat, simulator_schema(flat))
    if values['paused'] and not values['lockstep']:
        raise InvalidValue('paused', 'true without lockstep', 'true only with lockstep: true')
    for key in RIGID:
        if values[key] is not None and values['plant.type'] != RIGID_BODY:
            raise InvalidValue(key, 'a value', f'one with plant.type: {RIGID_BODY} only')
    check_plant_values(values)
    return values


def check_plant_values(values: Mapping[str, Any]) -> None:
    """Check ``plant.…`` values against each other, as far as that needs no robot.

    Raises
    ------
    InvalidValue
        As `PlantSettings.check`; in lockstep if no joint state would ever come.
    """
    plant_settings(values).check()
    if values['lockstep'] and values['plant.state_loss'] == 1.0:
        raise InvalidValue('plant.state_loss', '1', 'a number below 1 in lockstep')
    if values['lockstep'] and values['plant.silent']:
        raise InvalidValue('plant.silent', 'true', 'false in lockstep, which ~/pause stops')


def plant_settings(values: Mapping[str, Any]) -> PlantSettings:
    """Settings of a plant out of read parameters by dotted key."""
    found = PlantSettings(*(values[f'plant.{key}'] for key in PlantSettings._fields))
    # Numbers of a parameter file may be whole or not; `check` looks at that.
    return found._replace(
        **{
            key: int(value)
            for key, value in (('delay', found.delay), ('seed', found.seed))
            if value == int(value)
        }
    )


def _servo_settings(values: Mapping[str, Any]) -> ServoSettings:
    given = {key: values[f'plant.{key}'] for key in ServoSettings._fields}
    return ServoSettings(**{key: value for key, value in given.items() if value is not None})


def build_plant(
    values: Flat, robot: Robot, description: str, q: Sequence[float] | Vector, stops: bool = True
) -> Plant:
    """Build a simulated arm of read parameters.

    Parameters
    ----------
    values
        The parameters by dotted key.
    robot, description
        The robot, and the URDF that it is made of.
    q
        First configuration (nq,) [rad, m].
    stops
        Whether the ranges of the joints end in hard stops; False lets joints leave them and be
        faster than their limits, to see how far a controller drives them.

    Raises
    ------
    InvalidValue
        For anything that cannot be used, naming the full key.
    """
    joints: Joints
    if values['plant.type'] == RIGID_BODY:
        joints = RigidBodies(robot, description, q, _servo_settings(values), stops)
    else:
        limits = robot.limits if stops else Limits(robot.n, ranged=robot.space.ranged)
        joints = Integrator(q, limits, robot.space)
    plant = Plant(joints, plant_settings(values), values['command_timeout'])
    plant.blocked = values['plant.blocked']
    return plant


def build_simulator_settings(
    parameters: Mapping[str, Any], description: str | None = None
) -> SimulatorSettings:
    """Build the simulated joints from the simulator's parameters.

    Parameters
    ----------
    parameters
        The dictionary under ``ros__parameters``, nested or with dotted keys.
    description
        URDF of the robot for parameters that name none.

    Raises
    ------
    InvalidValue
        For anything that cannot be used, naming the full key.
    """
    values = read_simulator_parameters(parameters)
    robot = build_robot(values, description)
    text = describe_robot(values, description)
    values['robot.joints'], values['robot.base_frame'] = (
        arm_joints(robot, values),
        robot.base_frame,
    )
    q = values['initial_positions']
    integrator = Integrator(robot.neutral if q is None else q, robot.limits, robot.space)
    plant = build_plant(values, robot, text, integrator.q)
    if isinstance(plant.joints, Integrator):
        integrator = plant.joints
    return SimulatorSettings(values, robot.space, robot.base_frame, integrator, plant, text)

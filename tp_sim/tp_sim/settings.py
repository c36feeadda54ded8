"""Parameters of the simulator."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, NamedTuple

from tp_controller.config import SHARED, build_robot, describe_robot, shared_schema
from tp_controller.errors import InvalidValue
from tp_controller.parameters import (
    BOOLEAN,
    NUMBER,
    NUMBERS,
    REQUIRED,
    Flat,
    Parameter,
    flatten,
    read_all,
)
from tp_sim.integrator import Integrator

SIMULATOR: Mapping[str, Parameter] = {
    'command.type': replace(
        SHARED['command.type'],
        description='Message that carries the command; what is published when left out',
        default=None,
    ),
    'rate': Parameter(NUMBER, 'Joint states per second [Hz]', default=REQUIRED, above=0.0),
    'initial_positions': Parameter(
        NUMBERS, 'First position [rad, m] per joint; zero when left out'
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
    joints: tuple[str, ...]
    """Joint names (n,)."""
    base_frame: str
    """Name of the base frame."""
    integrator: Integrator
    """The joints."""
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
    return values


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
    values['robot.joints'], values['robot.base_frame'] = robot.joints, robot.base_frame
    q = values['initial_positions']
    integrator = Integrator([0.0] * robot.n if q is None else q, robot.limits)
    return SimulatorSettings(values, robot.joints, robot.base_frame, integrator, text)

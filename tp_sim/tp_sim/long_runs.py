"""Long runs to random goals, and what is seen in them.

They compute what the nodes do in lockstep, without processes and topics. Goals are drawn from
the positions that the controlled frames can have, and from 0.7 to 1.3 times as far away, so
that many lie inside obstacles or out of reach. The joints have no hard stops: nothing but the
controller keeps them inside their limits. They carry out every command exactly, or are as
``plant.…`` of the simulator's parameters and the arguments say. What is reported of distances
and ranges is true, not what the controller measures.
"""

from __future__ import annotations

import math
import os
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tp_controller.config import build_robot, build_settings, describe_robot, read_parameter_file
from tp_controller.config.build import read_parameters
from tp_controller.errors import InvalidValue, UnusableState
from tp_controller.robot import Limits, Robot
from tp_controller.robot.draws import random_configuration
from tp_controller.robot.response import KEYS
from tp_controller.tasks import PositionTask
from tp_sim.integrator import Integrator
from tp_sim.plant import Plant
from tp_sim.plant_settings import PlantSettings
from tp_sim.rigid_body import RigidBodies
from tp_sim.settings import build_plant, build_simulator_settings, read_simulator_parameters
from tp_sim.watch import Outcome, Watch

Vector = NDArray[np.float64]

SECONDS_PER_GOAL = 10.0
UNLIKELY = 1e-9
"""Probability of more losses in a row than the controller is told of."""


def run_all(
    path: Path,
    schemes: Sequence[str] | None,
    steps: int,
    seed: int,
    plants: Mapping[str, Mapping[str, Any]],
    declared: bool = True,
) -> dict[str, dict[str, Outcome]]:
    """Run every scheme on a parameter file with every plant, each in a process of its own.

    Parameters
    ----------
    path
        The file.
    schemes
        Values of ``solver.type``; None for that of the file.
    steps, seed
        As for `run`.
    plants
        Parameters ``plant.…`` in place of the file's, by any name.
    declared
        As for `run`.

    Returns
    -------
    dict
        What was seen, by plant and scheme.

    Raises
    ------
    TaskPriorityError
        If the file or a plant cannot be used.
    """
    values = read_parameter_file(path, 'tp_controller')
    simulated = read_parameter_file(path, 'tp_sim')
    names = schemes or [read_parameters(values)['solver.type']]
    for name in names:
        build_settings(values | {'solver.type': name})
    for given in plants.values():
        q = build_simulator_settings(simulated | dict(given)).integrator.q
    jobs = [(plant, name) for plant in plants for name in names]
    with ProcessPoolExecutor(min(len(jobs), os.cpu_count() or 1)) as pool:
        runs = [
            pool.submit(
                run,
                values | {'solver.type': name},
                q,
                steps,
                seed,
                None,
                simulated | dict(plants[plant]),
                declared,
            )
            for plant, name in jobs
        ]
        found: dict[str, dict[str, Outcome]] = {plant: {} for plant in plants}
        for (plant, name), job in zip(jobs, runs, strict=True):
            found[plant][name] = job.result()
        return found


def run(
    values: dict[str, Any],
    q: Vector,
    steps: int,
    seed: int = 0,
    targets: Iterable[Sequence[Vector]] | None = None,
    simulated: Mapping[str, Any] | None = None,
    declared: bool = True,
) -> Outcome:
    """Send an arm to goals, with a new one every 10 s.

    Parameters
    ----------
    values
        Parameters of the controller.
    q
        First configuration (nq,) [rad, m].
    steps
        How many steps.
    seed
        Of the random goals.
    targets
        Goals of all position tasks, one after the other, in place of random ones.
    simulated
        Parameters of the simulator, of which those of the arm count; None for joints that carry
        out every command exactly.
    declared
        Whether the controller is told what the arm is like, see `declaration`. False: it takes
        the arm for an ideal one.

    Raises
    ------
    InvalidValue
        If the parameters cannot be used, have no rate or no task that takes a position.
    """
    rate = read_parameters(values)['rate']
    if rate is None:
        raise InvalidValue('rate', 'no value', 'a number above 0')
    plant = _plant(simulated, values, q)
    values = {key: value for key, value in values.items() if declared or not _tells(key)}
    if declared:
        values |= declaration(plant, 1.0 / rate)
    stack, truth = (build_settings(values).stack for _ in range(2))
    goals = [task for task in stack.tasks.values() if isinstance(task, PositionTask)]
    period = stack.safety_filter.period
    if not goals:
        raise InvalidValue('tasks', 'no position task', 'one that is sent to random goals')
    if targets is None:
        elsewhere = build_robot(read_parameters(values))
        targets = _places(elsewhere, goals, np.random.default_rng(seed))
    places = iter(targets)
    watch = Watch(stack, truth)
    started, every = time.perf_counter(), max(1, round(SECONDS_PER_GOAL / period))
    since = 1
    for i in range(steps):
        if i % every == 0:
            if i:
                watch.count_goal(plant.q)
            for task, target in zip(goals, next(places), strict=True):
                task.target = target
        watch.see_place(plant.q)
        command = None
        if not plant.state_lost():
            measured, speed = plant.measured()
            try:
                command = stack.step(measured, since * period, speed).command
            except UnusableState as error:
                command = np.zeros(stack.robot.n) if error.command is None else error.command
            astray = bool(stack.arm.notice)
            moves = plant.qd if astray or plant.timed_out else None
            watch.see_command(command, astray, i % every > every // 2, moves)
            since = 0
        since += 1
        plant.step(command, period)
    watch.count_goal(plant.q)
    return watch.outcome(time.perf_counter() - started, _allowance(plant.settings))


def _plant(simulated: Mapping[str, Any] | None, controlled: Mapping[str, Any], q: Vector) -> Plant:
    if simulated is None:
        space = build_robot(read_parameters(controlled)).space
        return Plant(Integrator(q, Limits(space.nv, ranged=space.ranged), space))
    values = read_simulator_parameters(simulated)
    robot = build_robot(values)
    return build_plant(values, robot, describe_robot(values), q, stops=False)


def _tells(key: str) -> bool:
    return key.startswith('robot.') and key.removeprefix('robot.') in KEYS


def _allowance(settings: PlantSettings) -> float:
    """Largest error [rad, m] of a measured position, but for its scale."""
    noise, quantum = np.asarray(settings.noise), np.asarray(settings.quantum)
    return float(np.max(noise + 0.5 * quantum))


def declaration(plant: Plant, period: float) -> dict[str, Any]:
    """Parameters ``robot.…`` that tell a controller what its arm is like.

    Without losses there is nothing to hold. With losses, a command may stay in force for as
    long as so many in a row may be lost with a probability of 1e-9, or for the simulator's
    ``command_timeout``, if that is less. The lag of rigid bodies is `RigidBodies.lag`. A wrong
    scale cannot be told.

    Parameters
    ----------
    plant
        The arm.
    period
        Time [s] of a step.

    Returns
    -------
    dict
        The parameters by dotted key; empty for an ideal arm.
    """
    given, n = plant.settings, plant.qd.size
    lag = np.broadcast_to(np.asarray(given.lag, dtype=float), (n,))
    if isinstance(plant.joints, RigidBodies):
        lag = lag + plant.joints.lag
    told: dict[str, Any] = {
        'robot.delay': [given.delay * period],
        'robot.lag': lag.tolist(),
        'robot.noise': [_allowance(given)],
        'robot.hold': 0.0,
    }
    lost = 1.0 - (1.0 - given.command_loss) * (1.0 - given.state_loss)
    if lost > 0.0:
        longest = math.inf if plant.command_timeout is None else plant.command_timeout
        in_a_row = math.ceil(math.log(UNLIKELY) / math.log(lost)) if lost < 1.0 else math.inf
        told['robot.hold'] = min(longest, in_a_row * period)
    return told if any(np.any(np.asarray(value)) for value in told.values()) else {}


def _places(
    robot: Robot, tasks: Sequence[PositionTask], rng: np.random.Generator
) -> Iterator[list[Vector]]:
    while True:
        robot.update(random_configuration(robot, rng))
        far = rng.choice([1.0, rng.uniform(0.7, 1.3)])
        yield [far * robot.frame(task.frame_name).position[task.twist_rows] for task in tasks]

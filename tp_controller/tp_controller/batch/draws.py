"""Random starts, goals and gains of the runs of a batch."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tp_controller.batch.loop import fresh_stack
from tp_controller.config import Settings
from tp_controller.errors import InvalidValue
from tp_controller.robot.draws import random_configuration
from tp_controller.stack import Stack
from tp_controller.tasks import SetBasedTask

if TYPE_CHECKING:
    from tp_controller.batch.plan import Batch

Vector = NDArray[np.float64]

TRIES = 1000
"""Configurations drawn until one keeps all distances."""
START, GOAL, GAIN = range(3)
"""What is drawn, each from a generator of its own."""


class Draw(NamedTuple):
    """What is random in one run."""

    start: Vector
    """First configuration (nq,) [rad, m]."""
    goals: dict[str, Vector]
    """Target (target_size,) by task."""
    gain: float
    """Factor on the gains of these tasks."""


class Draws:
    """Draws the runs of a batch, each from its number alone.

    Parameters
    ----------
    batch
        The batch.
    settings
        The controller; its stack must not have made a step, and only its robot moves.
    """

    def __init__(self, batch: Batch, settings: Settings) -> None:
        self._batch = batch
        self._robot = settings.stack.robot
        self._tasks = settings.stack.tasks
        self._bounds = [
            task
            for level in settings.stack.members
            for task in level
            if isinstance(task, SetBasedTask)
        ]

    def draw(self, run: int) -> Draw:
        """Draw run number ``run``.

        The goals are the values that the tasks have at one random configuration, so that they
        can all be reached together. This configuration and a random start keep every distance
        of the hierarchy's set-based tasks above zero.

        Raises
        ------
        InvalidValue
            If no such configuration is found.
        """
        batch = self._batch
        start = self._free(run, START) if batch.start is None else np.array(batch.start)
        self._robot.update(self._free(run, GOAL))
        goals = {name: np.array(self._tasks[name].current) for name in batch.goals}
        return Draw(start, goals, float(self._generator(run, GAIN).uniform(*batch.gain)))

    def apply(self, draw: Draw, stack: Stack) -> None:
        """Give a stack the goals and gains of a draw.

        Raises
        ------
        InvalidValue
            If a gain is too large for the rate.
        """
        for name, goal in draw.goals.items():
            task = stack.tasks[name]
            task.target = goal
            if draw.gain != 1.0:
                try:
                    task.gain = (draw.gain * task.gain).ravel().tolist()
                except InvalidValue as error:
                    raise error.under(f'tasks.{name}') from None

    def _generator(self, run: int, what: int) -> np.random.Generator:
        sequence = np.random.SeedSequence(self._batch.seed, spawn_key=(run, what))
        return np.random.default_rng(sequence)

    def _free(self, run: int, what: int) -> Vector:
        rng, robot = self._generator(run, what), self._robot
        for _ in range(TRIES):
            q = random_configuration(robot, rng)
            if not self._bounds:
                return q
            robot.update(q)
            if all(_distance(task) > 0.0 for task in self._bounds):
                return q
        raise InvalidValue(
            'hierarchy',
            f'{TRIES} random configurations, none of which keeps every distance',
            'set-based tasks without links that always touch',
        )


def _distance(task: SetBasedTask) -> float:
    distances = np.empty(task.k)
    task.probe(distances)
    return float(distances.min())


def draw_run(batch: Batch, scheme: str, run: int) -> tuple[Stack, Draw]:
    """Build the controller of one run of a batch, with its goals and gains, and its draw.

    It is for a look at a single run: ``close_loop(stack, draw.start, batch.steps,
    batch.errors)`` repeats what the batch did, bit by bit.

    Parameters
    ----------
    batch
        The batch.
    scheme
        One of its schemes.
    run
        Number of the run, from 0.
    """
    settings = batch.settings(scheme)
    draws = Draws(batch, settings)
    draw = draws.draw(run)
    stack = fresh_stack(settings.stack.robot, settings.values)
    draws.apply(draw, stack)
    return stack, draw

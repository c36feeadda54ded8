"""Where the arm starts, what touches, and targets that it cannot reach."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import chain
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tp_controller.checks.findings import Finding, warning
from tp_controller.checks.levels import REST
from tp_controller.checks.samples import Samples, distances_at, guards
from tp_controller.errors import listed
from tp_controller.robot import Robot, moved
from tp_controller.snapshot import unchanged
from tp_controller.stack import Stack
from tp_controller.tasks import ClearanceTask, JointLimitsTask, JointTask, Task

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]

STEPS = 60
"""Steps of one search at most, from each random configuration."""
FOUND = 1e-4
"""Error norm [m, rad] at which a target counts as reached."""
LONGEST_STEP = 0.5
"""Largest change [rad, m] of a joint in one step."""
STALLED, PROGRESS = 10, 0.99
"""A search ends that has not made the error smaller, by this factor, in so many steps."""
DAMPING = 1e-6
"""λ² of the steps, as a share of the size of the Jacobian squared."""
NAMED = 5
"""Pairs of shapes that are named."""


def start(stack: Stack, q: Vector) -> Iterator[Finding]:
    """Joints out of range and boundaries that are crossed at the first configuration (nq,)."""
    robot, key = stack.robot, 'initial_positions'
    positions, limits = robot.space.positions(q), robot.limits
    outside = []
    for i, joint in enumerate(robot.joints):
        low, high = limits.position_min[i], limits.position_max[i]
        if robot.space.ranged[i] and not low <= positions[i] <= high:
            outside.append(joint)
            yield warning(
                key, f'{joint} starts at {positions[i]:g}', f'{low:g} to {high:g}, its range'
            )
    for task in guards(stack):
        distance = distances_at(stack, [q])[task.name][0]
        kept = task.kept_distance if isinstance(task, ClearanceTask) else 0.0
        # A task moves pairs that are nearer than this apart, or waits until they are.
        near = np.flatnonzero(distance < kept)
        if isinstance(task, JointLimitsTask):
            near = np.array([i for i in near if task.components[i] not in outside], dtype=int)
        if near.size:
            order = near[np.argsort(distance[near])]
            touch = 'overlap or cross the boundary' if distance[near].min() < 0.0 else 'are near'
            yield warning(
                f'tasks.{task.name}',
                f'these {touch} at {key}: {_named(task.components, distance, order)}',
                f'distances of {kept:.3g} and more',
            )


def always_touching(samples: Samples) -> Iterator[Finding]:
    """Rows of set-based tasks that no configuration keeps."""
    for task in guards(samples.stack):
        distance = samples.distances[task.name]
        worst = distance.max(axis=0)
        touching = np.flatnonzero(worst < 0.0)
        if touching.size:
            yield warning(
                f'tasks.{task.name}',
                f'these overlap at all {len(distance)} random configurations: '
                f'{_named(task.components, worst, touching)}',
                'links that can be apart (ignore, pairs or links leave others out)',
            )


def _named(names: Sequence[str], distance: Vector, rows: NDArray[np.intp]) -> str:
    more = f' and {len(rows) - NAMED} more' if len(rows) > NAMED else ''
    return listed(f'{names[i]} ({distance[i]:.3g})' for i in rows[:NAMED]) + more


class Search(NamedTuple):
    """What a search for a configuration with no error found."""

    error: float
    """Least error norm [m, rad]."""
    reached: int
    """Starts from which the targets were reached, until one kept every distance."""
    blocked: tuple[str, ...]
    """Set-based tasks that were crossed at these; empty if one keeps every distance."""


def targets(samples: Samples) -> Iterator[Finding]:
    """Targets of the file that no configuration was found for: alone, then together."""
    stack, sought = samples.stack, f'in a search from {len(samples.configurations)} random '
    sought += 'configurations'
    good = []
    for name, task in stack.tasks.items():
        if task.set_based or task.target is None or not task.target.size:
            continue
        key = f'tasks.{name}.target'
        if isinstance(task, JointTask) and (outside := _outside(task)):
            yield warning(key, f'out of range: {listed(outside)}', 'positions inside the ranges')
            continue
        found = search(samples, [task])
        if not found.reached:
            yield warning(
                key,
                f'no configuration found that has it, {sought}; the nearest is '
                f'{found.error:.3g} off',
                'a target that the arm can have (--frames prints where frames are)',
            )
        elif found.blocked:
            yield warning(
                key,
                f'{listed(found.blocked)} crossed at all {found.reached} configurations found '
                f'that have it, {sought}',
                'a target that can be had with every distance kept',
            )
        elif stack.level_of(name) >= 0 and task.type not in REST:
            good.append(task)
    if len(good) > 1 and not (found := search(samples, good)).reached:
        names = listed(task.name for task in good)
        yield warning(
            'hierarchy',
            f'no configuration found that has the targets of {names} together, {sought}; the '
            f'nearest is {found.error:.3g} off',
            'targets that go together; else the lower ones get what is left',
        )


def _outside(task: JointTask) -> list[str]:
    """Joints whose target is out of their range."""
    assert task.target is not None
    robot, found = task.robot, []
    for name, value in zip(task.target_components, task.target, strict=True):
        if name not in robot.joints:
            continue
        i = robot.joints.index(name)
        low, high = robot.limits.position_min[i], robot.limits.position_max[i]
        if not low <= value <= high:
            found.append(f'{name} {value:g} (range {low:g} to {high:g})')
    return found


def search(samples: Samples, tasks: Sequence[Task]) -> Search:
    """Look for a configuration at which tasks have their targets, by damped Newton steps.

    Ranges are kept; other tasks do not count, and distances only afterwards.

    Parameters
    ----------
    samples
        Configurations to begin at; the stack stays as it is.
    tasks
        The tasks, with targets.
    """
    stack, starts = samples.stack, samples.configurations
    # What always touches is told elsewhere.
    counts = {name: found.max(axis=0) > 0.0 for name, found in samples.distances.items()}
    best, reached = np.inf, 0
    blocked: dict[str, None] = {}
    memory = chain.from_iterable(task.memory for task in tasks)
    with unchanged(*memory), moved(stack.robot, starts[0]):
        for q in starts:
            error, end = _descend(stack.robot, tasks, q)
            best = min(best, error)
            if error > FOUND:
                continue
            reached += 1
            crossed = [
                name
                for name, distance in distances_at(stack, [end]).items()
                if (distance[0][counts[name]] < 0.0).any()
            ]
            if not crossed:
                return Search(best, reached, ())
            blocked |= dict.fromkeys(crossed)
    return Search(best, reached, tuple(blocked))


def _descend(robot: Robot, tasks: Sequence[Task], q: Vector) -> tuple[float, Vector]:
    """Error norm and configuration (nq,) that steps from one lead to."""
    low, high, ranged = robot.limits.position_min, robot.limits.position_max, robot.space.ranged
    q, best = q.copy(), np.inf
    mark, since = np.inf, 0
    for step in range(STEPS):
        robot.update(q)
        for task in tasks:
            task.update()
        error = np.concatenate([task.error for task in tasks])
        best = min(best, float(np.linalg.norm(error)))
        if best < PROGRESS * mark:
            mark, since = best, step
        if best <= FOUND or step - since >= STALLED:
            break
        J, positions = np.vstack([task.J for task in tasks]), robot.space.positions(q)
        way = _newton(J, error)
        # Joints at an end of their range stay there.
        stuck = ranged & (((positions <= low) & (way < 0.0)) | ((positions >= high) & (way > 0.0)))
        if stuck.any():
            J[:, stuck] = 0.0
            way = _newton(J, error)
        way *= min(1.0, LONGEST_STEP / max(float(np.abs(way).max()), 1e-12))
        way[ranged] = np.clip(positions + way, low, high)[ranged] - positions[ranged]
        q = robot.integrate(q, way)
    return best, q


def _newton(J: Matrix, error: Vector) -> Vector:
    """Damped least-squares step (n,) towards no error."""
    damping = DAMPING * max(float(np.sum(J * J)), 1e-12)
    return J.T @ np.linalg.solve(J @ J.T + damping * np.eye(len(J)), error)

"""Whether straight ways in joint space keep distances, and tasks that have to hold on the way."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from tp_controller.interpolation import VectorPath
from tp_controller.planning.ahead import HOLDS
from tp_controller.planning.conditions import Conditions

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]

SHORTEST = 0.01
"""Least way [rad, m] of a joint between two looks at the distances,"""
LONGEST = 0.1
"""and the largest one where tasks have to hold on the way."""
SEEN = 0.15
"""Distances [m] beyond what is kept that are computed; of larger ones this is taken."""
FINE = 0.04
"""Largest way [rad, m] of a joint between two points of a way on which tasks hold."""
NEARER = 0.9
"""The projection of a middle is nearer to both ends than this share of their distance."""
ROUNDING = 1e-6


class Clear:
    """Judges configurations and straight ways between them.

    A configuration has to keep every distance; at the start, what is kept may be nearer: that is
    kept then. Between two configurations the distance of row i changes by at most ``reach_i |q' -
    q|``, so the next look is as far away as the distances allow (conservative advancement), and
    never nearer than `SHORTEST`.

    Tasks of levels above all goals that have no error at the start hold on the way: every
    configuration is projected to the nearest one without error, by the steps of `Descent`. A
    straight way then stands for the projection of its points, which must follow each other
    closely.

    Parameters
    ----------
    conditions
        The goals and what has to hold, entered.

    Attributes
    ----------
    holding
        Tasks that hold on the way.
    looks
        Number of configurations looked at.
    """

    def __init__(self, conditions: Conditions) -> None:
        self.conditions, self.robot = conditions, conditions.robot
        self._guards = conditions.ends.guards
        stack = conditions.stack
        highest = min(stack.level_of(task.name) for task in conditions.goals)
        above = [task for task in conditions.held if stack.level_of(task.name) < highest]
        norms = conditions.part(above, ()).error_norms(conditions.q)
        self.holding = [task for task in above if norms[task.name] <= HOLDS]
        self._descent = conditions.part(self.holding, ()) if self.holding else None
        self.looks = 0
        self._kept: list[Vector] = []
        self._distance = [np.empty(task.k) for task in self._guards]
        self.robot.update(conditions.q)
        for task, distance in zip(self._guards, self._distance, strict=True):
            task.probe(distance, task.kept + SEEN)
            self._kept.append(np.minimum(task.kept, distance) - ROUNDING)

    def project(self, q: Vector) -> Vector | None:
        """Nearest configuration (nq,) at which tasks hold that have to; None without one."""
        if self._descent is None:
            return q
        found, error = self._descent.run(q)
        return found if error <= ROUNDING else None

    def room(self, q: Vector) -> float:
        """By how much [m] the nearest row is farther than it has to be, up to `SEEN`."""
        self._look(q)
        return self._room

    def _look(self, q: Vector, way: Vector | None = None) -> float:
        """Share of a way (n,) from q (nq,) that is certainly clear; negative if q is not."""
        self.looks += 1
        self.robot.place(q)
        share, self._room = math.inf, SEEN
        for task, kept, distance in zip(self._guards, self._kept, self._distance, strict=True):
            task.probe(distance, task.kept + SEEN)
            room = np.minimum(distance - kept, SEEN)
            self._room = min(self._room, float(room.min()))
            if way is None:
                continue
            rates = task.reach @ np.abs(way)
            with np.errstate(divide='ignore', invalid='ignore'):
                shares = np.where(rates > 0.0, room / rates, math.inf)
            share = min(share, float(shares.min()))
        return share if self._room >= 0.0 else -1.0

    def is_clear(self, q: Vector) -> bool:
        """Whether a configuration (nq,) keeps everything."""
        x = self.robot.space.positions(q)
        conditions = self.conditions
        inside = np.all(x >= conditions.low - ROUNDING) and np.all(x <= conditions.high + ROUNDING)
        return bool(inside) and self._look(q) >= 0.0

    def way(self, first: Vector, last: Vector) -> Matrix | None:
        """Configurations (m, nq) of the way from one configuration to another, both included.

        Returns
        -------
        Matrix or None
            Two configurations where the way is straight; None if it is not clear.
        """
        if self._descent is not None:
            return self._projected(first, last)
        space = self.robot.space
        way = space.difference(first, last)
        size = float(np.abs(way).max(initial=0.0))
        if not self.is_clear(last):
            return None
        share, least = 0.0, SHORTEST / max(size, 1e-12)
        while share < 1.0:
            free = self._look(space.integrate(first, share * way), way)
            if free < 0.0:
                return None
            share += max(free, least)
        return np.array([first, last])

    def along(self, path: VectorPath, begin: float) -> bool:
        """Whether a way in time is clear from a time [s] on."""
        # Between two points in time velocities change at a constant rate.
        speed = np.abs([path.at(float(time))[1] for time in path.times]).max(axis=0)
        least = SHORTEST / max(float(speed.max(initial=0.0)), 1e-12)
        time, end = begin, float(path.times[-1])
        while time < end:
            # The share of the way of one second.
            free = self._look(path.at(time)[0], speed)
            if free < 0.0:
                return False
            time += max(free, least)
        return self._look(path.at(end)[0]) >= 0.0

    def fine(self, points: Matrix) -> Matrix | None:
        """Points (m, nq) of a way with projected ones in between, where tasks hold on it.

        What is straight between two of them is beside the projection by no more than the stack
        takes back. None if one in between is not clear.
        """
        return points if self._descent is None else self._filled(points, FINE)

    def _filled(self, points: Matrix, longest: float) -> Matrix | None:
        """Points (m, nq) with the projections of middles in between, until none is farther.

        None if one is not clear, or the projection jumps.
        """
        space, found = self.robot.space, [points[0]]
        ahead = list(points[:0:-1])
        while ahead:
            way = space.difference(found[-1], ahead[-1])
            size = np.abs(way).max(initial=0.0)
            if size <= longest:
                found.append(ahead.pop())
                continue
            q = self.project(space.integrate(found[-1], 0.5 * way))
            if q is None:
                return None
            sides = [np.abs(space.difference(q, end)).max() for end in (found[-1], ahead[-1])]
            if max(sides) >= NEARER * size or not self.is_clear(q):
                return None
            ahead.append(q)
        return np.array(found)

    def _projected(self, first: Vector, last: Vector) -> Matrix | None:
        ends = self.project(first), self.project(last)
        if ends[0] is None or ends[1] is None or not self.is_clear(ends[1]):
            return None
        return self._filled(np.array(ends), LONGEST)

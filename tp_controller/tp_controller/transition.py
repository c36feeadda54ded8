"""Transitions: for a time after the stack has changed, the command changes by little in a step.

The methods of the literature blend task velocities (Lee, Mansard and Park 2012), projectors
(Keith, Wieber, Mansard and Kheddar 2011) or the velocities of whole hierarchies (An and Lee 2015).
Here the change of every joint's velocity is bounded for a time, as by a limit of acceleration,
inside the resolution of the levels. So priorities are strict all the time, whatever changes, and
a further change goes on from the command that there is.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from tp_controller.robot import Limits
from tp_controller.solvers import Bounds

Vector = NDArray[np.float64]

SWING = 2.0
"""Largest change that fits into a transition, in limits of velocity: from full speed to full
speed the other way."""
UNLIMITED = 1.0
"""Velocity [rad/s, m/s] that counts as the limit of a joint without one."""
MET = 1e-9
"""A velocity [rad/s, m/s] this near to a bound is at it."""
SAME = 1e-6
"""Times [steps] that differ by less than this are the same."""

Fill = Callable[[Vector, Bounds], None]
"""Fills the bounds of a step for limits of acceleration (n,)."""


def largest_change(limits: Limits, period: float, time: float) -> Vector:
    r"""Bound on the change of the command in one step of a transition.

    .. math:: \min(2 v T / T_t,\, a T)

    with the limits v of velocity and a of acceleration, the period T and the time T_t of the
    transition.

    Parameters
    ----------
    limits
        Limits of the joints; 1 rad/s or m/s counts where there is none of velocity.
    period
        Time [s] of one step.
    time
        Time [s] of the transition, above 0.

    Returns
    -------
    Vector
        The bound (n,) [rad/s, m/s].
    """
    speed = np.where(np.isfinite(limits.velocity), limits.velocity, UNLIMITED)
    change: Vector = np.minimum(SWING * speed * period / time, limits.acceleration * period)
    return change


class Transition:
    """Narrows the bounds of the joints while a transition is under way.

    It ends when its time is over and the answer is within the narrow bounds by itself, so that
    the step after it is an ordinary one.

    Attributes
    ----------
    under_way
        Whether the bounds are narrower than the limits.
    yields
        Whether the limits alone bounded the last step, as it had to brake.
    """

    def __init__(self) -> None:
        self.under_way = False
        self._left = 0
        self._past = False, 0
        self._time = self._period = 0.0
        self._steps = 0
        self._limits: Limits | None = None
        self._hard = self._soft = Bounds.of_speed(np.zeros(0))
        self._change = self._most = np.zeros(0)
        self._step, self.yields = 0.0, False
        self._fill: Fill = _nothing

    def begin(self, limits: Limits, period: float, time: float) -> None:
        """Begin a transition, or go on with one that is under way for so much longer.

        Nothing begins where limits of acceleration bound the change by as much already.

        Parameters
        ----------
        limits, period
            Limits of the joints and time [s] of one step, infinite if unknown.
        time
            Time [s] of the transition; 0 to let changes come at once.
        """
        self.under_way = False
        self._past = False, 0
        if not (time > 0.0 and math.isfinite(period)):
            return
        if not self._narrows(limits, period, time):
            return
        self._left = self._steps = math.ceil(time / period - SAME)
        self.under_way = True
        self._past = True, self._left
        self._time, self._period, self._limits = time, period, None

    @staticmethod
    def _narrows(limits: Limits, period: float, time: float) -> bool:
        allowed = limits.acceleration * period
        return bool((largest_change(limits, period, time) < allowed).any())

    def keep(self) -> None:
        """Let `undo` lead to the present state."""
        self._past = self.under_way, self._left

    def undo(self) -> None:
        """Go back by a step."""
        self.under_way, self._left = self._past

    def narrowed(
        self, hard: Bounds, before: Vector, limits: Limits, step: float, fill: Fill
    ) -> Bounds:
        """Bounds of this step, inside those by the limits.

        Joints brake for the ends of their ranges as if the narrow change were their limit of
        acceleration. Where that is not enough any more the limits count.

        Parameters
        ----------
        hard
            Bounds by the limits.
        before
            Velocities (n,) of the last step.
        limits
            Limits of the joints.
        step
            Time [s] from this command to the next.
        fill
            Fills bounds for other limits of acceleration (n,).
        """
        if limits is not self._limits:
            self._limits = limits
            self._change = largest_change(limits, self._period, self._time)
            self._most = limits.acceleration * self._period
            arrays = np.zeros((4, before.size))
            self._soft = hard._replace(
                range_lower=arrays[0],
                range_upper=arrays[1],
                soon_lower=arrays[2],
                soon_upper=arrays[3],
                onward=True,
            )
        self._hard, self._step, self._fill = hard, step, fill
        self._soft = self._soft._replace(change=hard.change, before=before, step=hard.step)
        self.yields = False
        return self._narrow()

    def give_way(self) -> None:
        """Let the limits alone bound this step, for braking; nothing without a transition."""
        if self.under_way:
            self.yields = True
            self._narrow()

    def _allowed(self) -> Vector:
        """By how much the command may change (n,) in this step."""
        return self._most if self.yields else self._change

    def _narrow(self) -> Bounds:
        soft, hard = self._soft, self._hard
        acceleration = self._allowed() / self._step
        acceleration.flags.writeable = False
        self._fill(acceleration, soft)
        for soon in (soft.soon_lower, soft.soon_upper):
            np.maximum(soon, hard.soon_lower, out=soon)
            np.minimum(soon, hard.soon_upper, out=soon)
        return soft

    @property
    def bounds(self) -> Bounds:
        """Bounds of this step."""
        return self._soft

    def acceleration(self, before: Vector) -> Vector:
        """Limits of acceleration (n,) that lead from the last velocities (n,) to the bounds.

        What a limit takes from one joint is no reason for the others to change more slowly.
        """
        lower, upper = self._soft.soon_lower - before, before - self._soft.soon_upper
        change = np.maximum(self._allowed(), np.maximum(lower, upper))
        acceleration: Vector = change / self._period
        acceleration.flags.writeable = False
        return acceleration

    def pass_by(self, wish: Vector) -> None:
        """Let a step pass; the transition may end with it.

        Parameters
        ----------
        wish
            Velocities (n,) that the levels ask for inside the bounds.
        """
        self._left -= 1
        # An arm that keeps braking for a distance would never come to an ordinary step.
        goes_on = self._left > -self._steps if self.yields else self._meets(wish)
        if self._left <= 0 and not goes_on:
            self.under_way = False

    def _meets(self, wish: Vector) -> bool:
        """Whether a velocity is at a bound that the limits do not set."""
        soft, hard = self._soft, self._hard
        low = (wish <= soft.soon_lower + MET) & (soft.soon_lower > hard.soon_lower)
        high = (wish >= soft.soon_upper - MET) & (soft.soon_upper < hard.soon_upper)
        return bool((low | high).any())


def _nothing(acceleration: Vector, bounds: Bounds) -> None:
    """Fill no bounds."""

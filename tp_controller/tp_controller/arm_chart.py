"""Positions of a model of the arm as configurations, and the other way round."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from tp_controller.arm_model import ArmModel
from tp_controller.robot.space import Space
from tp_controller.winding import widen, wound

Vector = NDArray[np.float64]

FARTHEST = 1e6
"""Position [rad, m] that no joint has."""


class ArmChart:
    """Positions of scalar joints, and of poses the ways from the pose that was measured last.

    Parameters
    ----------
    space
        Configuration space of the robot.
    model
        The model, whose positions are moved to a new origin with every measured pose.

    Attributes
    ----------
    flat
        Whether positions are configurations.
    plain
        Whether a measured configuration is taken as it is: it has no poses, and no turns.
    """

    def __init__(self, space: Space, model: ArmModel) -> None:
        self.space, self._model = space, model
        self._anchor, self._past_anchor = np.array([space.neutral] * 2)
        self.flat = not space.blocks
        self.plain = self.flat and not any(space.wrapping)
        # Where a pose gets to depends on the order of the commands that are under way.
        self._winds = not (self.flat or model.exact)
        self._late_place: Vector | None = None

    @property
    def reference(self) -> Vector:
        """Configuration (nq,) where the arm gets to; overwritten by the next state."""
        if self.flat:
            return self._model.state.z
        if not self._winds:
            return self.space.point(self._anchor, self._model.state.z)
        if self._late_place is None:
            self._late_place = self._wound()
        return self._late_place

    def configuration(self, positions: Vector) -> Vector:
        """Configuration (nq,) with positions (n,) of the model."""
        if self.flat:
            return positions
        if np.array_equal(positions, self._model.state.z):
            return self.reference
        return self.space.point(self._anchor, positions)

    def placed(self, q: Vector, known: bool, doubted: bool) -> Vector:
        """Positions (n,) of a measured configuration (nq,); those of poses count from there on.

        Turns are counted as the model does. A place that no joint can have is infinitely far.

        Parameters
        ----------
        q
            The configuration.
        known
            Whether the model has a position.
        doubted
            Whether there is a measured position that is not believed yet.
        """
        space, state = self.space, self._model.state
        self.forget()
        if known:
            q = space.unwrapped(q, state.p)
        if self.flat:
            return q
        x = space.chart(q, q)
        for block in space.blocks:
            if np.max(np.abs(q[block.q])) > FARTHEST:
                x[block.v] = math.inf
        if not np.isfinite(x).all():
            return x
        found = space.chart(q, space.point(self._anchor, state.p))
        if np.array_equal(state.q, state.p):
            state.q[:] = found
        else:
            state.q[:] = space.chart(q, space.point(self._anchor, state.q))
        state.p[:] = found
        if doubted:
            state.candidate[:] = space.chart(q, space.point(self._anchor, state.candidate))
        self._anchor[:] = q
        return x

    def forget(self) -> None:
        """Forget where the arm gets to, as the model goes on."""
        self._late_place = None

    def _wound(self) -> Vector:
        """Where the arm (nq,) gets to with what was sent, one command after the other."""
        model = self._model
        start = self.space.point(self._anchor, model.state.p)
        lagging = self.space.integrate(start, model.response.lag * model.state.v)
        under_way = model.now, model.times, model.commands, model.head, model.response.delay
        return wound(self.space, lagging, *under_way)

    def widen(self, way: Vector, tube: Vector) -> None:
        """Widen the tube (n,) around a way (n,) by what the order of velocities changes."""
        if not self.flat:
            widen(self.space, way, tube)

    def keep(self) -> None:
        """Let `undo` lead to the present origin."""
        self._past_anchor[:] = self._anchor

    def undo(self) -> None:
        """Go back to the origin that was kept."""
        self._anchor[:] = self._past_anchor

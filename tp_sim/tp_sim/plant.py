"""Joints that are not ideal: delay, lag, imperfect measurements, losses; no ROS is here."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from tp_controller.errors import InvalidValue, shown
from tp_controller.robot import Limits, Space
from tp_sim.plant_settings import PlantSettings

Vector = NDArray[np.float64]

ROUNDING = 1e-9
"""Share of a step by which a time may seem longer than it is."""
LEAST_LAG = 1e-9
"""A lag [s] below this one is none."""


class Joints(Protocol):
    """Joints that carry out velocity commands, as `tp_sim.integrator.Integrator` does."""

    limits: Limits
    space: Space
    servo_lag: float
    """Time constant [s] with which a joint alone follows the command."""
    stiffness: float
    """Share of a deviation from a commanded position that is made up for in a step."""

    @property
    def q(self) -> Vector:
        """Configuration (nq,) [rad, m]; a copy."""

    @property
    def qd(self) -> Vector:
        """Velocities (n,) [rad/s, m/s] after the last step; a copy."""

    def check(self, q: Sequence[float] | Vector, key: str = ...) -> Vector:
        """Copy of a configuration (nq,) that the joints can have."""

    def reset(self, q: Sequence[float] | Vector | None = None) -> None:
        """Stand still at a configuration (nq,), at the initial one when none is given."""

    def step(self, qd: Vector, dt: float) -> None:
        """Move for ``dt`` [s] with velocities (n,) as the command."""


class Plant:
    r"""Joints behind a line that delays and loses, with sensors that err.

    A command goes through four things: it may be lost, then the last one that arrived stays in
    force; without any for longer than ``command_timeout`` the command in force is zero; it acts
    ``delay`` steps later; the velocity ``v`` follows it, held to the velocity limits, as

    .. math:: lag \dot v = u - v

    which is integrated exactly over a step, during which ``u`` is constant. The joints then
    move as their own class says, `Integrator` with its hard stops at the ends of the ranges. A
    joint that a stop has halted starts again from standstill.

    With the default settings the result is that of the joints alone, bit by bit.

    Commands may be positions instead, see `follow`.

    Parameters
    ----------
    joints
        The joints.
    settings
        What the arm is like.
    command_timeout
        Time [s] without a command, counted in steps, after which the command in force is zero;
        None for never.

    Raises
    ------
    InvalidValue
        As `configure`.

    Attributes
    ----------
    blocked
        While true the joints stand still whatever the command; states go on.
    """

    def __init__(
        self,
        joints: Joints,
        settings: PlantSettings | None = None,
        command_timeout: float | None = None,
    ) -> None:
        self.joints = joints
        self.command_timeout = command_timeout
        self.blocked = False
        self._n = joints.limits.velocity.size
        self._heard, self._speed, self._noise = np.zeros((3, self._n))
        self._line: deque[Vector] = deque()
        self._state_lost = False
        self._silence = 0.0
        self.settings = PlantSettings()
        self._seed(self.settings.seed)
        self.configure(settings or self.settings)
        self._rest()

    def check(self, settings: PlantSettings) -> None:
        """Check settings without taking them.

        Raises
        ------
        InvalidValue
            For a negative or non-finite value, a scale that is not above zero, a loss outside
            0 to 1 or a wrong number of values.
        """
        settings.check()
        for key in ('lag', 'noise', 'quantum', 'scale'):
            values = settings.spread(key, self._n)
            if key == 'scale' and not np.all(values > 0.0):
                raise InvalidValue('plant.scale', shown(settings.scale), 'numbers above 0')

    def configure(self, settings: PlantSettings) -> None:
        """Be like this from the next step on. A new seed begins the random numbers anew.

        Raises
        ------
        InvalidValue
            As `check`; nothing changes then.
        """
        self.check(settings)
        self._lag, self._amplitude, self._quantum, self._scale = (
            settings.spread(key, self._n) for key in ('lag', 'noise', 'quantum', 'scale')
        )
        self._lags, self._noisy = bool(self._lag.any()), bool(self._amplitude.any())
        self._scaled, self._rounded = bool(np.any(self._scale != 1.0)), bool(self._quantum.any())
        if settings.seed != self.settings.seed:
            self._seed(settings.seed)
        self.settings = settings

    def _seed(self, seed: int) -> None:
        # One stream for each use: a loss more does not change the noise.
        streams = np.random.SeedSequence(seed).spawn(3)
        self._noises, self._commands, self._states = map(np.random.default_rng, streams)

    def _rest(self) -> None:
        self._heard[:] = self._speed[:] = 0.0
        self._line.clear()
        self._line.extend(np.zeros(self._n) for _ in range(self.settings.delay))
        self._silence = 0.0
        self._aim: Vector | None = None
        self._state_lost = False
        self._sense()

    @property
    def q(self) -> Vector:
        """True configuration (nq,) [rad, m]; a copy."""
        return self.joints.q

    @property
    def qd(self) -> Vector:
        """True velocities (n,) [rad/s, m/s] at the end of the last step; a copy."""
        return self._speed.copy()

    @property
    def timed_out(self) -> bool:
        """Whether no command has arrived for longer than ``command_timeout``."""
        timeout = self.command_timeout
        return timeout is not None and self._silence > timeout * (1.0 + ROUNDING)

    def step(self, command: Vector | None, dt: float) -> None:
        """Move for ``dt`` [s] after a command.

        Parameters
        ----------
        command
            Velocities (n,) [rad/s, m/s] that were sent; None if none was, the last one that
            arrived stays in force.
        dt
            Length of the step [s].
        """
        if command is not None and not self._lost(self._commands, self.settings.command_loss):
            self._heard[:] = command
            self._silence = 0.0
        elif self.command_timeout is not None:
            self._silence += dt
            if self.timed_out:
                self._heard[:] = 0.0
        self._go_on(dt)

    def follow(self, positions: Vector | None, dt: float) -> None:
        r"""Move for ``dt`` [s] as an arm that is commanded positions.

        Its servo gives the joints the velocity that takes them from the last commanded position
        ``a`` to this one ``b``, and makes up for what they are away from ``a``:

        .. math:: u = \frac{b - a}{dt} + k \frac{a - d}{dt}

        where ``d`` is where the joints get to with what they were given until now, and ``k`` is
        1 for joints that do as they are told. A velocity limit is not exceeded; delay and lag
        are those of velocities. Without a command the joints go to the last one, for ever.

        Parameters
        ----------
        positions
            Positions (n,) [rad, m] that were sent; None if none were.
        dt
            Length of the step [s].
        """
        there = self._destination(dt)
        before = there if self._aim is None else self._aim
        lost = self._lost(self._commands, self.settings.command_loss)
        aim = before if positions is None or lost else positions.copy()
        speed = (aim - before + self.joints.stiffness * (before - there)) / dt
        limit = self.joints.limits.velocity
        self._heard[:] = np.clip(speed, -limit, limit)
        if positions is not None and not lost:
            self._aim = aim
        self._go_on(dt)

    def _destination(self, dt: float) -> Vector:
        """Positions (n,) that the joints get to with the velocities of the steps until now."""
        there = self.joints.space.positions(self.joints.q) + self.joints.servo_lag * self.joints.qd
        if self._lags:
            there += self._lag * self._speed
        delay = self.settings.delay
        for velocity in list(self._line)[-delay:] if delay else ():
            there += dt * velocity
        return there

    def _go_on(self, dt: float) -> None:
        """Move for ``dt`` [s] with what is in force."""
        self._line.append(self._heard.copy())
        while len(self._line) > self.settings.delay + 1:
            self._line.popleft()
        self._move(self._line[0], dt)
        self._state_lost = self._lost(self._states, self.settings.state_loss)
        self._sense()

    def _move(self, command: Vector, dt: float) -> None:
        if self.blocked:
            self.joints.reset(self.joints.q)
            self._speed[:] = 0.0
            return
        if not self._lags:
            self.joints.step(command, dt)
            self._speed[:] = self.joints.qd
            return
        limit = self.joints.limits.velocity
        aim = np.clip(command, -limit, limit)
        steps = np.divide(dt, self._lag, out=np.full(self._n, np.inf), where=self._lag > LEAST_LAG)
        behind = self._speed - aim
        # Mean over the step of what is left of the difference, and what is left at its end.
        mean = np.clip(aim - behind * np.expm1(-steps) / steps, -limit, limit)
        self.joints.step(mean, dt)
        qd = self.joints.qd
        self._speed[:] = np.where(qd == mean, aim + behind * np.exp(-steps), 0.0)

    @staticmethod
    def _lost(stream: np.random.Generator, probability: float) -> bool:
        return probability > 0.0 and stream.random() < probability

    def _sense(self) -> None:
        if self._noisy:
            self._noise[:] = self._amplitude * self._noises.uniform(-1.0, 1.0, self._n)

    def measured(self) -> tuple[Vector, Vector]:
        """Configuration (nq,) [rad, m] and velocities (n,) [rad/s, m/s] as sensors report them.

        Positions are the true ones times ``scale``, plus noise, rounded to whole ``quantum``.
        The noise is uniform between ``-noise`` and ``noise`` and new in each step, so that a
        position is never wrong by more than ``noise + quantum / 2``. Velocities are the true
        ones times ``scale``, without noise. Between two steps the answer stays the same. Of a pose
        the noise is a short way along each of its velocities; scale and quantum leave it alone.
        """
        pose, qd = self.joints.q, self._speed.copy()
        space = self.joints.space
        q = space.positions(pose)
        if self._scaled:
            q *= self._scale
            qd *= self._scale
        if self._noisy:
            q += self._noise
        if self._rounded:
            whole = np.divide(q, self._quantum, out=np.zeros(self._n), where=self._quantum > 0.0)
            q = np.where(self._quantum > 0.0, self._quantum * np.round(whole), q)
        if space.blocks:
            q = space.point(pose, np.where(space.ranged, q, self._noise))
        return q, qd

    def state_lost(self) -> bool:
        """Whether the state after the last step does not arrive; the first state does."""
        return self._state_lost

    def reset(self, q: Sequence[float] | Vector | None = None) -> None:
        """Stand still at a configuration (nq,) with no command under way; random numbers go on.

        Raises
        ------
        InvalidValue
            As `Integrator.check`; nothing changes then.
        """
        self.joints.reset(q)
        self._rest()

"""Joint positions by name out of joint states."""

from __future__ import annotations

import math
from array import array
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from builtin_interfaces.msg import Time
from numpy.typing import NDArray
from sensor_msgs.msg import JointState

from tp_controller.errors import InvalidValue, listed, shown

STATES = 100
"""So many joint states are counted to find their rate."""
SLOW = 0.8
"""A rate below this share of the configured one, or as far above it, is told."""


class JointStateValues(NamedTuple):
    """What the controller uses of a joint state."""

    stamp: Time
    name: Sequence[str]
    position: array[float]
    velocity: array[float]


class RateCheck:
    """Finds joint states that do not come as often as the parameter ``rate`` says.

    Limits of position and acceleration hold for steps of ``1 / rate`` only.

    Parameters
    ----------
    rate
        The parameter [Hz].
    """

    def __init__(self, rate: float) -> None:
        self._rate = rate
        self.restart()

    def restart(self) -> None:
        """Begin to count anew."""
        self._count: int | None = None
        self._begin = 0.0

    def see(self, received: int, now: float) -> str | None:
        """Find what is wrong with the last hundred joint states.

        Parameters
        ----------
        received
            Joint states so far, answered or not.
        now
            Time [s] of the newest, by its stamp if it has one.

        Returns
        -------
        str or None
            What to warn of, empty if nothing; None until the next hundred are there.
        """
        if self._count is None or now < self._begin:
            self._count, self._begin = received, now
        count, passed = received - self._count, now - self._begin
        if count < STATES:
            return None
        self._count, self._begin = received, now
        found = count / passed if passed > 0.0 else self._rate
        if SLOW * self._rate <= found <= self._rate / SLOW:
            return ''
        return (
            f'joint states come at {found:.4g} Hz, rate is {self._rate:g}: limits of position, '
            'acceleration and distance are kept for that rate only'
        )


class JointStateReader:
    """Reads values per joint from messages in any order, with extra joints or without.

    Parameters
    ----------
    joints
        Names (n,) of the joints to read.
    what
        What the message is, for error messages.
    field
        ``position`` or ``velocity``: which array of the message to read.
    """

    def __init__(
        self, joints: Sequence[str], what: str = 'joint state', field: str = 'position'
    ) -> None:
        self._joints = joints
        self._what = what
        self._field = field
        self._names: Sequence[str] | None = None
        self._indices = np.zeros(0, dtype=int)

    def read(self, msg: JointState | JointStateValues, out: NDArray[np.float64]) -> None:
        """Write the values (n,) in joint order to ``out``.

        Raises
        ------
        InvalidValue
            If a joint is missing or stands twice, there are not as many values as names,
            or a value is not finite. Nothing is written then.
        """
        if msg.name != self._names:
            self._indices = self._find(msg.name)
            self._names = msg.name
        values = getattr(msg, self._field)
        if len(values) != len(msg.name):
            raise InvalidValue(
                f'{self._what} {self._field}',
                f'{len(values)} values for {len(msg.name)} names',
                'one value for each name',
            )
        picked = np.frombuffer(values).take(self._indices)
        if not _finite(picked):
            raise InvalidValue(f'{self._what} {self._field}', shown(picked), 'finite numbers')
        out[:] = picked

    def read_velocity(self, msg: JointState | JointStateValues, out: NDArray[np.float64]) -> bool:
        """Write the velocities (n,) of a message that was just read to ``out``, if it has them.

        Returns
        -------
        bool
            Whether it has, one for each name and all finite.
        """
        values = msg.velocity
        if len(values) != len(msg.name):
            return False
        np.frombuffer(values).take(self._indices, out=out, mode='clip')
        return _finite(out)

    def _find(self, names: Sequence[str]) -> NDArray[np.int_]:
        for joint in self._joints:
            count = names.count(joint)
            if count != 1:
                what = f'no {joint!r}' if count == 0 else f'{joint!r} {count} times'
                raise InvalidValue(
                    f'{self._what} name',
                    f'{what} in {shown(list(names))}',
                    f'each of {listed(self._joints)} once',
                )
        return np.array([names.index(joint) for joint in self._joints])


def _finite(values: NDArray[np.float64]) -> bool:
    """Whether all values are finite; numpy needs five times as long for a few."""
    return all(map(math.isfinite, values.tolist()))

"""Links kept clear of each other."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from tp_controller.errors import InvalidValue, listed, shown
from tp_controller.parameters import BOOLEAN, TEXTS, Parameter
from tp_controller.robot import Robot, self_clearance
from tp_controller.tasks.clearance import ClearanceTask
from tp_controller.tasks.thresholds import THRESHOLDS, Switching

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from tp_controller.tasks.common import Common

Vector = NDArray[np.float64]

SHOWN = 10
"""Pairs in contact beyond these many are counted, not named one by one."""


class SelfCollisionTask(ClearanceTask):
    """Keeps links of the arm clear of each other, one row per pair.

    Pairs that are in contact at the first configuration, nearer than what the task keeps, often
    are so always: their shapes are larger than the links, or joined. They are named, and unless
    ``push_apart`` is set their rows ask for nothing before they have been farther apart once.
    Meanwhile only the safety filter keeps those that have a gap from touching; those
    that overlap are not kept at all, and their distance is infinite.

    Parameters
    ----------
    name
        Name of the task.
    robot
        The robot, with `bodies`.
    pairs
        Names of two links each, with a space in between; when left out, all links that have
        another one with a shape between them.
    ignore
        Pairs that are left out, in the same way.
    push_apart
        Whether pairs in contact at the first configuration are pushed apart at once.
    period
        Time [s] of one step; infinite if unknown.
    switching
        How the rows come in and go out.
    settings
        Gain, target and the like, see `Common`.

    Raises
    ------
    InvalidValue
        If a pair is not two links with shapes and a joint in between, no pair is left, or
        as `SetBasedTask`.
    """

    type = 'self_collision'
    parameters: ClassVar[Mapping[str, Parameter]] = {
        'pairs': Parameter(
            TEXTS,
            'Pairs of links, as "link_2 link_5"; all that are not neighbours when left out',
        ),
        'ignore': Parameter(TEXTS, 'Pairs of links that are left out'),
        'push_apart': Parameter(
            BOOLEAN,
            'Whether pairs in contact at the first joint state are pushed apart at once; else '
            'they are kept only after they have been apart',
            default=False,
        ),
        **THRESHOLDS,
    }
    without = ('target', 'max_speed', 'time_scaling', 'around')
    target_words = ''

    def __init__(
        self,
        name: str,
        robot: Robot,
        pairs: Sequence[str] | None = None,
        ignore: Sequence[str] = (),
        period: float = math.inf,
        switching: Switching = Switching(),  # noqa: B008 - a value
        push_apart: bool = False,
        **settings: Unpack[Common],
    ) -> None:
        chosen = None if pairs is None else _split('pairs', pairs)
        clearance = self_clearance(robot, robot.bodies, chosen, _split('ignore', ignore))
        super().__init__(name, clearance, period, switching)
        self._ignored = tuple(ignore)
        self._push_apart = push_apart
        # Rows that wait until they are apart, and those of them that are not kept meanwhile.
        self._waits: NDArray[np.bool_] = np.zeros(self.k, dtype=bool)
        self._loose = self._waits.copy()
        self._any_waits = False
        self.set(settings)

    @classmethod
    def from_parameters(
        cls, name: str, robot: Robot, values: Mapping[str, Any]
    ) -> SelfCollisionTask:
        """Make the task from checked values."""
        return cls(
            name,
            robot,
            values['pairs'],
            values['ignore'] or (),
            values['period'],
            Switching.of(values),
            values['push_apart'],
        )

    @property
    def target_components(self) -> tuple[str, ...]:
        """Nothing: there is no target."""
        return ()

    def contact_text(self, rows: NDArray[np.intp]) -> str:
        """One line about the rows that are in contact at the first configuration."""
        order = rows[np.argsort(self.distance[rows])]
        names, links = self.clearance.names, self.clearance.links
        found = [f'{names[i]} ({self.distance[i]:.3g} m)' for i in order[:SHOWN]]
        if len(order) > SHOWN:
            found.append(f'and {len(order) - SHOWN} more')
        overlap = [i for i in order if self.distance[i] <= 0.0]
        pairs = [' '.join(str(link) for link in links[i]) for i in overlap or order]
        quoted = ', '.join(f'"{pair}"' for pair in (*self._ignored, *pairs))
        fate = (
            'pushed apart'
            if self._push_apart
            else 'not pushed apart, nor guarded where they overlap, before they have been apart'
        )
        return (
            f'nearer than {self.kept_distance:.3g} m at the first joint state, {fate}: '
            f'{listed(found)}; for those that always touch: ignore: [{quoted}]'
        )

    def _look_for_contacts(self) -> NDArray[np.bool_]:
        near = super()._look_for_contacts()
        if not self._push_apart:
            self._waits[:] = near
            self._loose[:] = near & (self.distance <= 0.0)
            self._any_waits = bool(near.any())
        return near

    @property
    def kept(self) -> Vector:
        """Distance (k,) [m] that each row keeps; of rows that wait only that they do not touch."""
        return np.where(self._waits, 0.0, super().kept)

    def measure(self) -> None:
        """Fill the distances of rows that may be in, and their derivative."""
        super().measure()
        if self._any_waits:
            self._part()

    def _part(self) -> None:
        """Let rows that have come apart be kept; the distance of others may not count yet."""
        apart = self._waits & (self.distance > self.kept_distance)
        if apart.any():
            names = ', '.join(self.clearance.names[i] for i in np.flatnonzero(apart))
            self._notices.append(f'tasks.{self.name}: apart, and kept from now on: {names}')
            self._waits &= ~apart
            self._loose &= ~apart
            self._any_waits = bool(self._waits.any())
            self._contact = self._contact if self._any_waits else ''
        self.distance[self._loose] = math.inf

    def update(self) -> None:
        """Compute `distance`, `error` and `J` at the robot's present configuration."""
        super().update()
        if self._any_waits:
            self.on[self._waits] = False
            self.error[self._waits] = 0.0
            self.J[self._waits] = 0.0

    def probe(self, out: Vector, enough: Vector | None = None) -> None:
        """Write the distances (k,) at the robot's present configuration to ``out``."""
        super().probe(out, enough)
        if self._any_waits:
            out[self._loose] = math.inf

    def distances(self) -> Vector:
        """Every distance (k,) that counts, however far away; of the others infinity."""
        found = super().distances()
        if self._any_waits:
            found[self._loose] = math.inf
        return found


def _split(key: str, texts: Sequence[str]) -> list[tuple[str, str]]:
    pairs = []
    for text in texts:
        names = text.split()
        if len(names) != 2:
            raise InvalidValue(key, shown(text), 'two names of links with a space in between')
        pairs.append((names[0], names[1]))
    return pairs

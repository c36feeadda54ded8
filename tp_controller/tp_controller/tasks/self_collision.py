"""Links kept clear of each other."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

from tp_controller.errors import InvalidValue, shown
from tp_controller.parameters import TEXTS, Parameter
from tp_controller.robot import Robot, self_clearance
from tp_controller.tasks.clearance import ClearanceTask
from tp_controller.tasks.set_based import THRESHOLDS, Switching


class SelfCollisionTask(ClearanceTask):
    """Keeps links of the arm clear of each other, one row per pair.

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
    period
        Time [s] of one step; infinite if unknown.
    switching
        How the rows come in and go out.

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
        **THRESHOLDS,
    }
    without = ('target',)
    target_words = ''

    def __init__(
        self,
        name: str,
        robot: Robot,
        pairs: Sequence[str] | None = None,
        ignore: Sequence[str] = (),
        period: float = math.inf,
        switching: Switching = Switching(),  # noqa: B008 - a value
    ) -> None:
        chosen = None if pairs is None else _split('pairs', pairs)
        clearance = self_clearance(robot, robot.bodies, chosen, _split('ignore', ignore))
        super().__init__(name, clearance, period, switching)

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
        )

    @property
    def target_components(self) -> tuple[str, ...]:
        """Nothing: there is no target."""
        return ()


def _split(key: str, texts: Sequence[str]) -> list[tuple[str, str]]:
    pairs = []
    for text in texts:
        names = text.split()
        if len(names) != 2:
            raise InvalidValue(key, shown(text), 'two names of links with a space in between')
        pairs.append((names[0], names[1]))
    return pairs

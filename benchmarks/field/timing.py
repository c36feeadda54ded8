"""Time of a step: blocks of all sides in turn, so that all see the same machine."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from field.cases import Case
from field.processes import LIBRARIES, Library, NotInstalled, Side
from field.serving import CannotDo

BUDGET = 20.0
"""Time [s] after which a side has no further turn in a case."""


WARM_UP = 100
"""Steps before the first timed one."""


class Times(NamedTuple):
    """Durations of one side in one case."""

    durations: np.ndarray
    """Processor time [µs] of every step that succeeded or failed."""
    failed: int
    """Steps without an answer, quadratic programs without a solution for example."""
    reason: str
    """Last error."""

    @property
    def median(self) -> float:
        """Median [µs]."""
        return float(np.median(self.durations))

    @property
    def late(self) -> float:
        """99 % [µs]."""
        return float(np.percentile(self.durations, 99))


Found = dict[tuple[str, str], Times | str]
"""Times by label of a library and problem, or why there are none."""


def open_sides(
    case: Case, problem: str, libraries: Sequence[Library] = LIBRARIES
) -> tuple[dict[str, Side], dict[str, str]]:
    """Sides that are ready for a problem, and why the others are not."""
    scenario, sides, missing = case.write(), {}, {}
    for library in libraries:
        try:
            side = Side(library, scenario)
        except NotInstalled as error:
            missing[library.label] = f'not installed: {error}'
            continue
        try:
            side.ask('time', problem, 0, 1)
        except (CannotDo, RuntimeError) as error:
            missing[library.label] = str(error)
            side.stop()
            continue
        sides[library.label] = side
    return sides, missing


def measure(case: Case, steps: int, libraries: Sequence[Library] = LIBRARIES) -> Found:
    """Measure all libraries and problems in turn over all states of a case.

    Parameters
    ----------
    case
        What is measured.
    steps
        Steps in a block.
    libraries
        Whose time is measured.
    """
    sides, missing = open_sides(case, next(iter(case.problems)), libraries)
    turns = [(label, problem) for problem in case.problems for label in sides]
    for label, problem in turns:
        sides[label].ask('time', problem, 0, min(WARM_UP, len(case.states)))
    durations: dict[tuple[str, str], list[int]] = {turn: [] for turn in turns}
    failed, reasons = dict.fromkeys(turns, 0), dict.fromkeys(turns, '')
    for block, start in enumerate(range(0, len(case.states), steps)):
        # Each begins as often as the others.
        first = block % max(1, len(turns))
        for turn in turns[first:] + turns[:first]:
            if sum(durations[turn]) > BUDGET * 1e9:
                continue
            stop = min(start + steps, len(case.states))
            answer = sides[turn[0]].ask('time', turn[1], start, stop)
            durations[turn] += answer['durations']
            failed[turn] += answer['failed']
            reasons[turn] = answer['reason'] or reasons[turn]
    for side in sides.values():
        side.stop()
    found: Found = {
        (label, problem): reason for label, reason in missing.items() for problem in case.problems
    }
    for turn in turns:
        found[turn] = Times(np.array(durations[turn]) * 1e-3, failed[turn], reasons[turn])
    return found

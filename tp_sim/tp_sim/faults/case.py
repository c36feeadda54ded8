"""A case of the table and what came of it."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from tp_sim.faults.judge import Findings
from tp_sim.faults.pauses import PauseWatch
from tp_sim.faults.record import longest, paused
from tp_sim.faults.rig import Judged, Rig
from tp_sim.harness import HarnessError


@dataclass(frozen=True)
class Case:
    """One row of the table.

    Attributes
    ----------
    name
        For ``--only``.
    done
        What is done, in words.
    allowed
        What is allowed beyond what is allowed in every case, in words.
    run
        Does it, with a rig whose nodes run; ends with `Rig.recover`.
    recovery
        Longest time [s] until the arm moves again.
    started
        Whether `run` wants the nodes to run already.
    """

    name: str
    done: str
    run: Callable[[Rig], None]
    allowed: str = ''
    recovery: float = 1.0
    started: bool = True


@dataclass
class Outcome:
    """What came of a case.

    Attributes
    ----------
    case
        The case.
    found
        What was seen of the commands.
    recovery, way
        Times [s] until the arm moved again, and until it was at its goal.
    pause
        Longest time [s] for which the machine did not run a process that was ready.
    load
        Load of the machine, of the last minute.
    seconds
        How long the case took.
    notes
        What is worth telling.
    printed
        What the processes printed.
    record
        Joint states sent, commands and motions.
    """

    case: Case
    found: Findings
    recovery: float = math.nan
    way: float = math.nan
    pause: float = 0.0
    load: float = 0.0
    seconds: float = 0.0
    notes: list[str] = field(default_factory=list)
    printed: str = ''
    record: dict[str, list[tuple[Any, ...]]] = field(default_factory=dict)

    @property
    def passed(self) -> bool:
        """Whether nothing was wrong."""
        return not self.found.wrong


def run_case(case: Case, judged: Judged, watch: PauseWatch) -> Outcome:
    """Start the nodes, do what the case says, and judge."""
    begin, steady = time.time(), time.monotonic()
    rig = Rig(judged, watch, started=case.started)
    try:
        try:
            if case.started:
                rig.move(1.0)
            case.run(rig)
            rig.stop()
        except HarnessError as error:
            rig.wrong.append(str(error))
        found = rig.findings(begin)
        pauses = watch.pauses(begin)
        excused = paused(pauses, rig.well, rig.well + rig.recovery)
        if rig.recovery > case.recovery + excused:
            found.wrong.append(
                f'moved again after {rig.recovery:.3g} s, {case.recovery:g} s are allowed'
            )
        elif math.isnan(rig.recovery) and not found.wrong:
            found.wrong.append('recovery was not tried')
        printed = '\n'.join(f'{p.name}: {p.output}' for p in rig.processes)
        return Outcome(
            case,
            found,
            rig.recovery,
            rig.way,
            longest(pauses),
            os.getloadavg()[0],
            time.monotonic() - steady,
            rig.notes,
            printed,
            {
                'sent': [tuple(item) for item in rig.relay.sent],
                'commands': [tuple(item) for item in rig.relay.commands],
                'motions': [tuple(item) for item in rig.relay.motions],
            },
        )
    finally:
        rig.close()

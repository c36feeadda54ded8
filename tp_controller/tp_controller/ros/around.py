"""Goals that are reached around: the arm rests, a process plans, and the stack follows the way."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from tp_controller.config import Settings
from tp_controller.errors import plural
from tp_controller.interpolation import VectorPath
from tp_controller.planning.excursion import Excursion
from tp_controller.planning.messages import (
    Failed,
    Found,
    Judged,
    Request,
    asked_parameters,
    asked_targets,
)
from tp_controller.planning.planner import Kind, Phase
from tp_controller.planning.remote import SILENCE, RemotePlanner
from tp_controller.ros.log import Log
from tp_controller.ros.situation import Situation

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]

RESTS = 1e-3
"""Command [rad/s, m/s] up to which the arm rests."""
AGAIN = 5
"""How often a way is looked for, as obstacles move or the arm is held up, before it is given
up."""


class End(Enum):
    """How it ends."""

    THERE = 'there'
    """The goals' levels act again: the straight way leads to the goals, or the way has ended."""
    NONE = 'none'
    """No way was found; the arm rests."""


class Around:
    """One excursion at a time, from its beginning to its end.

    Parameters
    ----------
    settings
        What the controller runs on.
    description
        URDF of the robot for parameters that name none.
    command
        The command sent last (n,) [rad/s, m/s]; it is kept up to date.
    log
        Has a line for every plan.
    rearranged
        Called when other levels act than before.

    Attributes
    ----------
    phase
        What is done at present, in a word; empty if nothing is.
    places
        Places (m, 3) [m] of the controlled frame along the way; none without a way.
    """

    def __init__(
        self,
        settings: Settings,
        description: str | None,
        command: Vector,
        log: Log,
        rearranged: Callable[[], None],
    ) -> None:
        self._settings, self._stack = settings, settings.stack
        self._description, self._command, self._log = description, command, log
        self._rearranged = rearranged
        self._planner = RemotePlanner()
        self._number = 0
        self._asked = self._waits = False
        self._found: Found | None = None
        """A way to be followed, if it is still clear."""
        self._path: VectorPath
        self._excursion: Excursion | None = None
        self._goals: dict[str, Vector] = {}
        self._tolerances: dict[str, float] = {}
        self._straight, self._left = True, AGAIN
        self._seen = Situation(self._stack)
        self._ended: Callable[[End, str], None] = _unused
        self.phase = ''
        self.places: Matrix = np.zeros((0, 3))

    @property
    def active(self) -> bool:
        """Whether an excursion is under way."""
        return self._excursion is not None

    @property
    def text(self) -> str:
        """What is done at present, in words; empty if nothing is."""
        return f'around for {", ".join(self._goals)}: {self.phase}' if self.phase else ''

    @property
    def time_left(self) -> float:
        """Time [s] to the end of the way; infinite before it is known."""
        excursion = self._excursion
        if excursion is None or not excursion.follows:
            return math.inf
        return excursion.time_left

    def prepare(self) -> None:
        """Let the planner's process start and build what it needs, before anything is asked."""
        self._planner.ask(self._request())

    def begin(
        self,
        goals: Mapping[str, Vector],
        tolerances: Mapping[str, float],
        straight: bool,
        ended: Callable[[End, str], None],
    ) -> None:
        """Bring the arm to rest and look for a way to goals, in place of what was under way.

        Parameters
        ----------
        goals
            Target (target_size,) by task; the tasks have them already.
        tolerances
            Error norm [m, rad] by task that counts as reached.
        straight
            Whether the straight way may be taken.
        ended
            Called when it has ended, with the reason in words.

        Raises
        ------
        InvalidValue
            If the solver cannot resolve the levels.
        """
        self.end()
        self._goals, self._tolerances = dict(goals), dict(tolerances)
        self._straight, self._ended, self._left = straight, ended, AGAIN
        self._excursion = Excursion(self._stack, list(goals))
        self._rearranged()
        self._look_again()

    def end(self) -> None:
        """Let the goals' levels act again."""
        if self._excursion is not None:
            self._excursion.end()
            self._excursion = None
            self._rearranged()
        self._number += 1
        self.phase, self.places = '', np.zeros((0, 3))

    def close(self) -> None:
        """Plan no longer."""
        self._planner.close()

    def advance(self, seconds: float) -> None:
        """Let time [s] pass between joint states; negative takes it back."""
        if self._excursion is not None:
            self._excursion.advance(seconds)

    def look(self) -> None:
        """Go on; to be called after every answer while `active`."""
        excursion = self._excursion
        if excursion is None:
            return
        if self._seen.rearranged:
            self._look_again()
        elif not self._asked:
            self._ask()
        else:
            self._hear(excursion)
            if excursion is self._excursion and excursion.follows:
                self._follow(excursion)

    def _hear(self, excursion: Excursion) -> None:
        """Do what the planner says."""
        for number, reply in self._planner.take():
            if number != self._number or not self._waits:
                continue
            if isinstance(reply, Phase):
                self.phase = reply.value
                continue
            self._waits = False
            if isinstance(reply, Judged):
                self._go_on(excursion, reply.clear)
            else:
                self._take(excursion, reply)
            return
        if self._waits and self._planner.silent:
            self._planner.kill()
            self._fail(excursion, f'the planner has not answered for {SILENCE:g} s')

    def _fail(self, excursion: Excursion, why: str) -> None:
        """Do without an answer: whether a way is clear is not known then."""
        self._waits = False
        if excursion.follows:
            self._look_again()
        else:
            self._give_up(why)

    def _look_again(self) -> None:
        """Bring the arm to rest; what is planned then is for the situation as it is by now."""
        assert self._excursion is not None
        self._excursion.stay()
        self._number += 1
        self._asked = self._waits = False
        self._found = None
        self.phase, self.places = Phase.AHEAD.value, np.zeros((0, 3))
        self._seen = Situation(self._stack)

    def _ask(self) -> None:
        """Ask the planner once the arm rests."""
        assert self._excursion is not None
        if np.abs(self._command).max() > RESTS:
            self._excursion.stay()
            return
        self._asked = True
        self._send(self._request())

    def _send(self, request: Request) -> None:
        """Ask the planner about the situation as it is by now."""
        self._seen, self._waits = Situation(self._stack), True
        self._planner.ask(request)

    def _judge(self, path: VectorPath, begin: float) -> None:
        """Ask whether a way is clear from a time [s] on it."""
        self._number += 1
        self._send(self._request()._replace(rest=(path, begin)))

    def _request(self) -> Request:
        return Request(
            self._number,
            asked_parameters(self._settings),
            self._description,
            asked_targets(self._stack),
            self._goals,
            self._tolerances,
            self._stack.robot.q.copy(),
            self._straight,
        )

    def _take(self, excursion: Excursion, reply: Found | Failed) -> None:
        """Do what was planned."""
        if isinstance(reply, Failed):
            self._fail(excursion, reply.text)
            return
        plan = reply.plan
        if plan.kind is Kind.NONE and self._seen.moved and self._left > 1:
            self._left -= 1
            self._look_again()
            return
        self._log.info(f'around for {", ".join(self._goals)}: {plan.text}')
        if plan.kind is Kind.STRAIGHT:
            self._finish()
        elif plan.way is None:
            self._give_up(plan.text)
        elif self._seen.moved:
            self._found = reply
            self._judge(plan.way.path, 0.0)
        else:
            self._begin(excursion, reply)

    def _go_on(self, excursion: Excursion, clear: bool) -> None:
        """Follow a way that was judged, or look for another one."""
        if not clear:
            self._look_again()
        elif self._found is not None:
            self._begin(excursion, self._found)

    def _begin(self, excursion: Excursion, found: Found) -> None:
        """Follow a way from its beginning."""
        assert found.plan.way is not None
        self._path, self._found = found.plan.way.path, None
        excursion.follow(self._path)
        self.phase, self.places = 'following', found.places

    def _follow(self, excursion: Excursion) -> None:
        if excursion.over:
            self._finish()
        elif excursion.stuck:
            self._left -= 1
            if self._left <= 0:
                self._give_up(f'held up on the way, {plural(AGAIN, "time")}')
            else:
                self._look_again()
        elif not self._waits and self._seen.moved:
            self._judge(self._path, excursion.time)

    def _finish(self) -> None:
        ended = self._ended
        self.end()
        ended(End.THERE, '')

    def _give_up(self, why: str) -> None:
        ended = self._ended
        self.end()
        ended(End.NONE, why)


def _unused(*_: object) -> None:
    """Nobody waits."""

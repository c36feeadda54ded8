"""Lockstep: a state, the command that answers it, one step of integration, repeat."""

from __future__ import annotations

import time
from collections.abc import Callable

from rclpy.node import Node
from rclpy.task import Future

PATIENCE = 20
"""Repetitions of an unanswered state before it is said that nobody answers, and shown anew."""
MOST_LOST = 1000
"""So many states in a row may be lost."""


class Lockstep:
    """Decides when to publish a state and when to move on.

    The time of the states starts at the wall clock and advances by whole steps. A run of
    N steps publishes the present state, integrates each answer, and ends when the state
    after step N has been answered too; goals that came between two runs are therefore in
    the first command of the second one.

    A state that is lost is not published: the next step follows at once, with the command in
    force. The state at the end of a run is never lost, so a run always ends.

    Parameters
    ----------
    node
        The node whose executor waits for the end of a run.
    publish
        Publishes the present state with a stamp [ns].
    listeners
        Counts those who listen to the states.
    move
        Integrates the newest command for one step and returns its length [ns].
    lost
        Tells whether the state after the step is lost.
    paused
        Whether to wait for `begin` or `resume` before the first state.
    """

    def __init__(
        self,
        node: Node,
        publish: Callable[[int], None],
        listeners: Callable[[], int],
        move: Callable[[], int],
        lost: Callable[[], bool],
        paused: bool,
    ) -> None:
        self._node = node
        self._publish = publish
        self._count_listeners = listeners
        self._move = move
        self._is_lost = lost
        self._now = time.time_ns()
        self._waiting = False
        """Whether the newest state has no answer yet."""
        self._steps_left: int | None = 0
        """Steps to go in this run; None runs on without end."""
        self._finished: Future | None = None
        self._listened = False
        """Whether anybody was there to hear the newest state."""
        self._patience = PATIENCE
        self._first = self._now
        """Stamp with which the newest state was shown first."""
        self._told = False
        if not paused:
            self.resume()

    def begin(self, steps: int) -> Future | None:
        """Start a run; return its end as a future, or None when one is under way.

        The future's result tells whether the run came to its end.
        """
        if self._waiting:
            return None
        self._steps_left = steps
        self._finished = Future(executor=self._node.executor)
        self._show()
        return self._finished

    def resume(self) -> None:
        """Run on without end."""
        self._steps_left = None
        if not self._waiting:
            self._show()

    def pause(self) -> None:
        """End the run at the present state."""
        self._steps_left = 0
        self._waiting = False
        self._finish(False)

    def answered(self, stamp: int | None) -> None:
        """Go on after a command.

        Parameters
        ----------
        stamp
            Stamp [ns] of the state that it answers, None if commands carry no stamp.
        """
        if not self._waiting:
            return
        if stamp is not None:
            if not self._first <= stamp <= self._now:
                return
            self._now = stamp
        self._waiting = False
        if self._steps_left == 0:
            self._finish(True)
            return
        for _ in range(MOST_LOST):
            if self._steps_left is not None:
                self._steps_left -= 1
            self._now += self._move()
            if self._steps_left == 0 or not self._is_lost():
                break
        self._show()

    def jumped(self) -> None:
        """Take note that the joints were put somewhere else."""
        self._now += 1
        if self._waiting:
            self._show()

    def repeat(self, always: bool) -> bool:
        """Publish an unanswered state once more.

        A controller may refuse copies, or a state that came too late. So after a while it is shown
        anew, with a stamp that is newer by the least there is.

        Parameters
        ----------
        always
            False: only if somebody listens and nobody did when it was published.

        Returns
        -------
        bool
            Whether it has just become clear that nobody answers.
        """
        if not self._waiting:
            return False
        self._patience -= 1
        if self._patience == 0:
            self._patience = PATIENCE
            self._now += 1
            always = True
            told, self._told = self._told, True
        else:
            told = True
        if always or (not self._listened and self._count_listeners()):
            self._publish_now()
        return not told

    def _show(self) -> None:
        self._waiting, self._told = True, False
        self._patience = PATIENCE
        self._first = self._now
        self._publish_now()

    def _publish_now(self) -> None:
        self._listened = self._count_listeners() > 0
        self._publish(self._now)

    def _finish(self, complete: bool) -> None:
        if self._finished is not None:
            self._finished.set_result(complete)
            self._finished = None

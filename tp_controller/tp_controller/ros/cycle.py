"""The cycle: the newest joint state in, a command out; to rest when none comes."""

from __future__ import annotations

import math
import time
from collections.abc import Callable

from tp_controller.errors import UnusableState
from tp_controller.position_reference import PositionReference
from tp_controller.ros.answered_time import AnsweredTime
from tp_controller.ros.braking_to_rest import CUT, BrakingToRest
from tp_controller.ros.commands import CommandPublisher
from tp_controller.ros.cycle_warnings import CycleWarnings
from tp_controller.ros.intake import Intake
from tp_controller.ros.log import Log
from tp_controller.ros.rate import RateEstimate
from tp_controller.ros.state_choice import StateChoice
from tp_controller.ros.state_watch import Arrival, StateWatch
from tp_controller.ros.warnings import Warnings
from tp_controller.stack import Stack
from tp_controller.step_results import Step
from tp_interfaces.msg import ControllerState

TRIES = 3
"""Steps for one command, with newer states each, until it is not late."""
LONGEST_END = 10.0
"""Time [s] that a controller gives to braking when it is deactivated,"""
LEAST_PATIENCE = 0.05
"""and time [s] for which it then waits for a joint state at least."""
ANSWERING = (ControllerState.RUNNING, ControllerState.HELD)
"""Status while joint states are answered."""


class ControlFailed(Exception):
    """The cycle itself failed; its cause says why."""


class Cycle:
    """Answers joint states, and brakes the arm when none comes.

    Parameters
    ----------
    stack
        Computes the commands.
    intake, watch
        Where joint states come from, and who judges them.
    commands
        Where commands go.
    state
        Status, counters and times are kept there.
    warnings, logger
        Where is told what happens.
    rate
        The parameter [Hz]; None if unknown.
    limit
        Age [s] at which a joint state may not move anything.
    answered
        Has to know how much time has passed.
    before
        Called at the start of every cycle with the time [s] that it may take.
    found_rate
        Called with a rate [Hz] that the parameters do not tell, when it is found from the
        joint states: the stack then has to know it. The arm rests until then. None if no rate
        has to be found.
    reference
        Of an arm that takes positions: the stack answers it in place of what is measured.

    Attributes
    ----------
    braking
        Brakes the arm when `look` has found that no joint state comes.
    choice
        Chooses the joint states that are answered.
    duration
        Time [s] that other work may take between two joint states.
    refused
        Whether the last state could not be used, and was answered by braking.
    """

    def __init__(
        self,
        stack: Stack,
        intake: Intake,
        watch: StateWatch,
        commands: CommandPublisher,
        state: ControllerState,
        warnings: Warnings,
        logger: Log,
        rate: float | None,
        limit: float,
        answered: AnsweredTime,
        before: Callable[[float], object],
        found_rate: Callable[[float], object] | None = None,
        reference: PositionReference | None = None,
    ) -> None:
        self._stack, self._intake, self._watch, self._commands = stack, intake, watch, commands
        self._state, self._warnings, self._logger = state, warnings, logger
        self._limit, self._answered, self._before = limit, answered, before
        self._found_rate, self._reference = found_rate, reference
        self._rate_estimate = RateEstimate() if found_rate else None
        self.braking = BrakingToRest(stack, commands, state, limit, reference)
        self.choice = StateChoice(
            stack.robot, intake, watch, commands, state, warnings, limit, self.braking.lost
        )
        self._cycle_warnings = CycleWarnings(stack, watch, state, warnings)
        self._use_rate(rate)
        self.refused = False
        self._step_time: float | None = None

    def _use_rate(self, rate: float | None) -> None:
        period = 1.0 / rate if rate else math.inf
        self._cycle_warnings.know_rate(rate)
        if rate:
            self.choice.know_period(period)
            self.braking.know_period(period)
        self.duration = 0.25 * min(period, self._limit)

    @property
    def running(self) -> bool:
        """Whether joint states are being answered."""
        return self._state.status in ANSWERING

    def work(self) -> bool:
        """Answer the newest joint state that waits.

        Returns
        -------
        bool
            Whether there was one and it was answered.

        Raises
        ------
        ControlFailed
            If the computation fails in a way that nobody expects.
        """
        if time.monotonic() < self.ready_at:
            return False
        try:
            arrival = self.choice.take(self.running)
            return arrival is not None and self._answer(arrival)
        except Exception as error:
            raise ControlFailed(f'{type(error).__name__}: {error}') from error
        finally:
            self._state.skipped = self.choice.unanswered + self._watch.lost
            self._state.overtaken = self._watch.overtaken

    @property
    def ready_at(self) -> float:
        """Steady time until which a state has to wait; see `BrakingToRest.ready_at`."""
        return self.braking.ready_at if self._watch.paced else -math.inf

    def _answer(self, arrival: Arrival) -> bool:
        """Send the command that answers a state, or a newer one if that took too long."""
        told, state = self._cycle_warnings, self._state
        if self._commands.waiting:
            self._commands.moving = self._reference is None and self.choice.moves
        if self._commands.withheld:
            return False
        told.begin()
        self._before(self.duration)
        start = time.perf_counter()
        scale = state.scale
        passed = 0.0
        for tries_left in range(TRIES - 1, -1, -1):
            again = self._watch.is_resend(arrival)
            if again and self._age(arrival) > self._oldest():
                return False
            elapsed = 0.0 if again else self._elapsed(arrival)
            self._answered.advance(elapsed - passed)
            passed = elapsed
            step_time = self._time_of_step(arrival, elapsed, again)
            refusal: UnusableState | None = None
            try:
                step = self._step(step_time)
                command, scale = step.command, step.scale
            except UnusableState as error:
                refusal, command = error, error.command
            if again or self._age(arrival) <= told.limit or not tries_left:
                break
            newer = self.choice.take(self.running, again=True)
            if newer is None:
                break
            self._stack.undo()
            self.choice.unanswered += self._watch.differ(arrival, newer)
            arrival = newer
        if self._rate_estimate:
            self._stay(self._rate_estimate, arrival)
        if command is not None:
            self._commands.prepare(command, arrival.msg.stamp)
        # Before the first command the arm is at rest, and much is loaded that is slow.
        oldest = self._oldest() if state.cycles else self._limit
        if not again and self._age(arrival) > oldest:
            self._stack.undo()
            self._too_late(arrival, passed, step_time)
            return False
        if command is not None:
            self._commands.send_prepared()
        state.solve_time = time.perf_counter() - start
        self._note_answer(arrival, again, step_time)
        self.refused = refusal is not None
        if refusal is not None:
            told.restart()
            state.ignored_states += 1
            if not self._stack.arm.notice:
                self._warnings.warn('commands', f'no command: {refusal}')
        else:
            velocity = self._commands.velocity
            told.see(arrival, elapsed, again, self.running, self.choice.q, velocity)
            # A simulation that waits has carried every command out.
            self._stack.arm.late = state.command_age if self._watch.paced else 0.0
            self.braking.seen()
        state.cycles += 1
        state.header.stamp = arrival.msg.stamp
        state.scale = scale
        if not self.running and not self.refused:
            state.status = ControllerState.RUNNING
            line = 'running, held at rest' if self._stack.held else 'running'
            if not self._warnings.clear('stale', line):
                self._logger.info(line)
            self.show_held()
        return True

    def _step(self, step_time: float | None) -> Step:
        """Compute the command that answers the state that was read last."""
        reference, choice = self._reference, self.choice
        if reference is None:
            return self._stack.step_in_place(choice.q, step_time, choice.qd)
        return reference.answer(choice.q, step_time)

    def show_held(self) -> None:
        """Tell whether the arm is held at rest."""
        self._state.held = self._stack.held
        if self.running:
            held = self._stack.held
            self._state.status = ControllerState.HELD if held else ControllerState.RUNNING

    def _age(self, arrival: Arrival) -> float:
        """Present age [s] of a state."""
        return arrival.age + time.monotonic() - arrival.taken

    def _time_of_step(self, arrival: Arrival, elapsed: float, again: bool) -> float | None:
        """Time [s] that the arm carried the last command out; None if nobody knows.

        For a state that was sent again, the stack goes back to before it.
        """
        if again:
            if not self.braking.newest:
                # Who sends a state again has not moved since.
                self._stack.undo()
                if self._reference is not None:
                    self._reference.undo()
                return self._step_time
            elapsed = self._elapsed(arrival)
        return elapsed if math.isfinite(elapsed) else None

    def _note_answer(self, arrival: Arrival, again: bool, step_time: float | None) -> None:
        """Take note that a state was answered by the last command."""
        self.braking.answered(arrival.taken, again)
        self._step_time = step_time
        self.choice.answered(arrival, again)
        followed = self._stack.arm if self._reference is None else self._reference
        if notice := followed.notice:
            self._warnings.warn('arm', f'{notice}: the arm is braked')

    def _stay(self, estimate: RateEstimate, arrival: Arrival) -> None:
        """Stay at rest for one more joint state, or know the rate from it."""
        self._stack.stay()
        rate = estimate.see(arrival.msg.stamp)
        if rate is not None and self._found_rate:
            self._rate_estimate = None
            self._use_rate(rate)
            self._found_rate(rate)
            if self._reference is not None:
                self._reference.know_period()

    def _oldest(self) -> float:
        """Age [s] of a state whose command may still be sent."""
        if self._watch.real_time:
            return min(self._cycle_warnings.limit, self._limit)
        return self._limit

    def _too_late(self, arrival: Arrival, passed: float, step_time: float | None) -> None:
        """Brake for one step, as there was no time to find a better command."""
        self._state.ignored_states += 1
        age = self._age(arrival)
        problem = f'no command: its joint state was {1e3 * age:.3g} ms old by then'
        self._warnings.warn('commands', problem)
        if not self.running or age > self._limit:
            self._answered.advance(-passed)
            return
        self._cycle_warnings.restart()
        if self._reference is None:
            command = self._stack.brake(step_time, self.choice.q, self.choice.qd)
        else:
            command = self._reference.brake()
        self._commands.send(command)
        self._stack.arm.late = age
        self._note_answer(arrival, False, step_time)
        self.choice.braked()

    def _elapsed(self, arrival: Arrival) -> float:
        """Time [s] since the state that was answered before; since braking if that came after.

        Infinite for the first state.
        """
        return min(self._watch.elapsed(arrival), self.braking.elapsed(arrival.taken))

    # Rest

    def look(self) -> bool:
        """See whether joint states have stopped; to be called every `braking.look_period`.

        Returns
        -------
        bool
            Whether they have, since the last call: braking has to begin.
        """
        cause = self.braking.look()
        if not cause or not self.running:
            return False
        self._cycle_warnings.restart_all(stopped=True)
        self._state.status = ControllerState.STALE
        if self._reference is not None:
            self._reference.pause()
        self.braking.zeros = 0
        self._warnings.warn('stale', f'{cause}: braking to rest', lasting=True)
        return True

    def begin(self) -> None:
        """Wait for joint states of an arm that stands still; nothing is sent before one comes."""
        self.braking.stand()
        self._cycle_warnings.restart_all()
        self._state.status = ControllerState.WAITING

    def end(self) -> str:
        """Brake to rest, by joint states as long as they come, and then answer none any more.

        Returns
        -------
        str
            How the arm came to rest.
        """
        begin = seen = time.monotonic()
        patience = min(self._limit, max(4.0 * self.braking.period, LEAST_PATIENCE))
        moves = self.running and not self._stack.at_rest
        while self.running and not self._stack.at_rest:
            now = time.monotonic()
            if now - seen > patience or now - begin > LONGEST_END:
                break
            self._intake.wait(patience)
            if self.work():
                seen = time.monotonic()
        braked = time.monotonic() - begin
        told = self.braking.finish()
        self._state.status = ControllerState.INACTIVE
        if not moves or braked < self.braking.period or told.startswith(CUT):
            return told
        return f'braked to rest in {braked:.2g} s'

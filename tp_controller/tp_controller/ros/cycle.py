"""The cycle: the newest joint state in, a command out; to rest when none comes."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence

import numpy as np

from tp_controller.errors import InvalidValue, UnusableState
from tp_controller.oscillation import OscillationWatch
from tp_controller.position_reference import PositionReference
from tp_controller.ros.answered_time import AnsweredTime
from tp_controller.ros.commands import CommandPublisher
from tp_controller.ros.copies import Copies
from tp_controller.ros.intake import Intake
from tp_controller.ros.joint_states import JointStateReader, RateCheck
from tp_controller.ros.lateness import Lateness
from tp_controller.ros.log import Log
from tp_controller.ros.rate import RateEstimate
from tp_controller.ros.robot_node import HEARTBEAT
from tp_controller.ros.state_watch import Arrival, StateWatch
from tp_controller.ros.warnings import Warnings
from tp_controller.stack import Stack
from tp_controller.step_results import Step
from tp_interfaces.msg import ControllerState

TRIES = 3
"""Steps for one command, with newer states each, until it is not late."""
ZEROS = 10
"""Zero commands that follow braking at once; further ones follow with every sign of life."""
CUT = 'braking cut'
"""How a line begins that tells of braking which took too long."""
LONGEST_BRAKING = 1.0
"""Time [s] that a controller which ends gives to braking."""
LONGEST_END = 10.0
"""Time [s] that it gives to braking when it is deactivated,"""
LEAST_PATIENCE = 0.05
"""and time [s] for which it then waits for a joint state at least."""
BRAKING_PERIOD = 0.01
"""Time [s] between commands of braking where no rate is known."""
STOPPED = 0.2
"""Time [s] beyond the limit of age without any command after which the arm is not braked: zero."""
AFTER_BRAKING = 0.8
"""Least time [periods] between a command of braking and one that answers a joint state."""
AT_REST = 1e-3
"""Velocity [rad/s, m/s] of a joint that counts as at rest."""
OSCILLATION_PERIOD = 0.5
"""Time [s] after which an oscillation that goes on is told again."""
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
        self._stack = stack
        self._intake = intake
        self._watch = watch
        self._commands = commands
        self._state = state
        self._warnings = warnings
        self._logger = logger
        self._limit = limit
        self._answered = answered
        self._before = before
        self._found_rate = found_rate
        self._reference = reference
        self._rate_estimate = RateEstimate() if found_rate else None
        self._reader = JointStateReader(stack.robot.coordinates)
        self._q, self._rates = np.zeros((2, stack.robot.nq))
        self._qd: np.ndarray | None = None
        self._copies = Copies(watch, limit)
        self._use_rate(rate)
        self.look_period = min(0.25 * limit, HEARTBEAT)
        """Time [s] between two looks at whether joint states have stopped."""
        self.zeros = 0
        """Zero commands since the arm came to rest; see `brake`."""
        self.behind = False
        """Whether states were skipped for the last one."""
        self.refused = False
        """Whether the last state could not be used, and was answered by braking."""
        self._unanswered = 0
        self._braked = self._moved = -math.inf
        self._step_time: float | None = None
        self._last_seen = self._looked = time.monotonic()
        self._refused = 0
        self._oscillation = OscillationWatch(stack)
        self._oscillation_told = -math.inf
        self._awake_since = -math.inf
        self._paused = 0.0

    def _use_rate(self, rate: float | None) -> None:
        self._period = 1.0 / rate if rate else math.inf
        self._lateness = Lateness(self._period)
        if rate:
            self._copies.know_period(self._period)
        self._rate_check = RateCheck(rate) if rate else None
        self.braking_period = self._period if rate else BRAKING_PERIOD
        """Time [s] between commands of braking."""
        self.duration = 0.25 * min(self._period, self._limit)
        """Time [s] that other work may take between two joint states."""

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
            arrivals = self._intake.take()
            if not arrivals:
                self._note_others()
                return False
            arrival = self._choose(arrivals)
            return arrival is not None and self._answer(arrival)
        except Exception as error:
            raise ControlFailed(f'{type(error).__name__}: {error}') from error
        finally:
            self._count()

    def _note_others(self) -> None:
        """Tell of joint states of other devices while none of the robot comes."""
        msg, self._intake.others.newest = self._intake.others.newest, None
        if msg is None or self.running:
            return
        try:
            self._reader.read(msg, self._q)
        except InvalidValue as error:
            self._state.ignored_states += 1
            self._warnings.warn('joint states', f'joint state ignored: {error}')

    @property
    def ready_at(self) -> float:
        """Time until which a state has to wait, by the steady clock.

        A command of braking has just been sent, and two commands would change the velocity in
        one period.
        """
        known = self._watch.paced and math.isfinite(self._period)
        if not known or self._moved >= self._braked:
            return -math.inf
        return self._braked + AFTER_BRAKING * self._period

    def _count(self) -> None:
        state, watch = self._state, self._watch
        state.skipped = self._unanswered + watch.lost
        state.overtaken = watch.overtaken

    def _choose(self, arrivals: Sequence[Arrival]) -> Arrival | None:
        """Newest state that can be used, read; those before it are skipped."""
        if note := self._watch.note():
            self._warnings.warn('clock', note)
        for older in range(len(arrivals) - 1, -1, -1):
            arrival = arrivals[older]
            if arrival.age > self._limit:
                self._state.ignored_states += older + 1
                self._warnings.warn(
                    'old states', f'joint state ignored: {arrival.age:.3g} s old when it came'
                )
                return None
            if self._stands(arrival):
                self._state.ignored_states += older + 1
                self._warnings.warn(
                    'old states',
                    'joint state ignored: the same one, stamp and all, comes again and again '
                    'while the arm is moved by it',
                )
                return None
            try:
                self._measure(arrival)
            except InvalidValue as error:
                self._state.ignored_states += 1
                self._warnings.warn('joint states', f'joint state ignored: {error}')
                continue
            skipped = sum(self._watch.differ(other, arrival) for other in arrivals[:older])
            self._unanswered += skipped
            self.behind = skipped > 0
            return arrival
        return None

    def _stands(self, arrival: Arrival) -> bool:
        """Whether copies of one state have come for too long while the arm is moved by it."""
        copies = self._copies
        stood = copies.stood
        if not copies.too_long(arrival, self._moves_an_arm, self.running):
            return False
        if not stood:
            # Nothing has been seen of the arm: braking has to begin.
            self._last_seen = -math.inf
        return True

    def _moves_an_arm(self) -> bool:
        """Whether the last command is a motion, and somebody listens to it."""
        return bool(self._commands.velocity.any()) and self._commands.heard

    def _moves(self) -> bool:
        """Whether the arm itself says that it moves."""
        return self._qd is not None and bool(np.max(np.abs(self._qd)) > AT_REST)

    def _measure(self, arrival: Arrival) -> None:
        """Read what the arm does at present; all that is measured enters here."""
        self._reader.read(arrival.msg, self._q)
        found = self._reader.read_velocity(arrival.msg, self._rates)
        self._qd = self._stack.robot.space.velocity(self._q, self._rates) if found else None

    def _answer(self, arrival: Arrival) -> bool:
        """Send the command that answers a state, or a newer one if that took too long."""
        lateness, state = self._lateness, self._state
        if self._commands.waiting:
            self._commands.moving = self._reference is None and self._moves()
        if self._commands.withheld:
            return False
        lateness.begin()
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
            step_time = self._time_of_step(arrival, again)
            refusal: UnusableState | None = None
            try:
                step = self._step(step_time)
                command, scale = step.command, step.scale
            except UnusableState as error:
                refusal, command = error, error.command
            if again or self._age(arrival) <= lateness.limit or not tries_left:
                break
            newer = self._choose(self._intake.take())
            if newer is None:
                break
            self._stack.undo()
            self._unanswered += self._watch.differ(arrival, newer)
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
            self._oscillation.restart()
            state.ignored_states += 1
            if not self._stack.arm.notice:
                self._warnings.warn('commands', f'no command: {refusal}')
        else:
            self._note_time(arrival, again, elapsed)
            if not again:
                self._note_oscillation(elapsed)
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
        reference = self._reference
        if reference is None:
            return self._stack.step_in_place(self._q, step_time, self._qd)
        return reference.answer(self._q, step_time)

    def show_held(self) -> None:
        """Tell whether the arm is held at rest."""
        self._state.held = self._stack.held
        if self.running:
            held = self._stack.held
            self._state.status = ControllerState.HELD if held else ControllerState.RUNNING

    def _age(self, arrival: Arrival) -> float:
        """Present age [s] of a state."""
        return arrival.age + time.monotonic() - arrival.taken

    def _time_of_step(self, arrival: Arrival, again: bool) -> float | None:
        """Time [s] that the arm carried the last command out; None if nobody knows.

        For a state that was sent again, the stack goes back to before it.
        """
        if again and self._moved > self._braked:
            # Who sends a state again has not moved since.
            self._stack.undo()
            if self._reference is not None:
                self._reference.undo()
            return self._step_time
        elapsed = self._elapsed(arrival)
        return elapsed if math.isfinite(elapsed) else None

    def _note_answer(self, arrival: Arrival, again: bool, step_time: float | None) -> None:
        """Take note that a state was answered by the last command."""
        if not again or self._braked > self._moved:
            self._moved = arrival.taken
        self._step_time = step_time
        self._copies.answered(arrival, again)
        if not again:
            self._watch.answered(arrival)
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
            return min(self._lateness.limit, self._limit)
        return self._limit

    def _too_late(self, arrival: Arrival, passed: float, step_time: float | None) -> None:
        """Brake for one step, as there was no time to find a better command."""
        self._state.ignored_states += 1
        age = self._age(arrival)
        self._warnings.warn(
            'commands',
            f'no command: its joint state was {1e3 * age:.3g} ms old by then',
        )
        if not self.running or age > self._limit:
            self._answered.advance(-passed)
            return
        self._oscillation.restart()
        if self._reference is None:
            command = self._stack.brake(step_time, self._q, self._qd)
        else:
            command = self._reference.brake()
        self._commands.send(command)
        self._stack.arm.late = age
        self._note_answer(arrival, False, step_time)
        self._copies.braked()

    def _elapsed(self, arrival: Arrival) -> float:
        """Time [s] since the state that was answered before; since braking if that came after.

        Infinite for the first state.
        """
        elapsed = self._watch.elapsed(arrival)
        if self._braked > self._moved:
            return min(elapsed, max(0.0, arrival.taken - self._braked))
        return elapsed

    def _note_oscillation(self, elapsed: float) -> None:
        """Tell of joints that reverse again and again, and that they do no longer."""
        if self._oscillation.see(self._q, self._commands.velocity, elapsed):
            now = time.monotonic()
            if now - self._oscillation_told >= OSCILLATION_PERIOD:
                self._oscillation_told = now
                self._warnings.warn('oscillation', str(self._oscillation.found))
        elif self._oscillation_told > -math.inf:
            self._oscillation_told = -math.inf
            self._warnings.clear('oscillation')

    def _note_time(self, arrival: Arrival, again: bool, elapsed: float) -> None:
        state, lateness = self._state, self._lateness
        # The first steps after a rest move little, and load what is used for the first time.
        late = lateness.end(arrival.age, arrival.taken, self.running and not again)
        # A simulation that waits has carried every command out.
        self._stack.arm.late = lateness.age if self._watch.paced else 0.0
        if late:
            self._warnings.warn('late', late)
        elif self.running and lateness.limit < elapsed < math.inf and lateness.on_time:
            self._warnings.warn(
                'sender',
                f'joint states came {1e3 * elapsed:.3g} ms apart, period is '
                f'{1e3 * self._period:.3g} ms: their sender is late',
            )
        state.overruns = lateness.overruns
        state.command_age = lateness.age
        state.largest_command_age = lateness.largest
        if self._rate_check and not again:
            problem = self._rate_check.see(self._watch.received, self._watch.time(arrival))
            if problem:
                self._warnings.warn('rate', problem, lasting=True)
            elif problem is not None:
                self._warnings.clear('rate')
        self._last_seen = time.monotonic()
        self._refused = state.ignored_states

    # Rest

    def look(self) -> bool:
        """See whether joint states have stopped; to be called every `look_period`.

        Returns
        -------
        bool
            Whether they have, since the last call: braking has to begin.
        """
        now = time.monotonic()
        pause, self._looked = now - self._looked, now
        if pause > self.look_period + 0.5 * self._limit:
            # States may wait that came meanwhile: those of the last moment are still good.
            self._awake_since, self._paused = now, pause
        if not self.running:
            return False
        grace = max(2.0 * self.braking_period, 0.02)
        if now <= max(self._last_seen + self._limit, self._awake_since + grace):
            return False
        if self._rate_check:
            self._rate_check.restart()
            self._warnings.clear('rate')
        self._oscillation.restart()
        self._state.status = ControllerState.STALE
        if self._reference is not None:
            self._reference.pause()
        self.zeros = 0
        refused = self._state.ignored_states > self._refused
        cause = f'no {"usable " if refused else ""}joint state for {self._limit:g} s'
        if self._awake_since > self._last_seen:
            cause = f'the process was not scheduled for {self._paused:.3g} s'
        elif self._commands.withheld:
            cause = 'commands are withheld'
        self._warnings.warn('stale', f'{cause}: braking to rest', lasting=True)
        return True

    def brake(self) -> None:
        """Send the next command of braking to rest; once at rest, a zero command."""
        now = time.monotonic()
        last = max(self._moved, self._braked)
        passed = now - last if math.isfinite(last) else 0.0
        if self._reference is not None:
            # An arm that takes positions waits where it was told to go.
            passed = self._reference.step
        if self._reference is None and passed > self._limit + STOPPED:
            # Its driver has stopped the arm, or it is high time: braking would move it again.
            self._stack.rest()
            self._commands.send(0.0)
        else:
            self._commands.send(self._stack.brake(passed))
        self._braked = now
        self.zeros = 0 if self._commands.velocity.any() else self.zeros + 1

    def begin(self) -> None:
        """Wait for joint states of an arm that stands still; nothing is sent before one comes."""
        self._stack.rest()
        self._oscillation.restart()
        if self._reference is not None:
            self._reference.stop()
        if self._rate_check:
            self._rate_check.restart()
        self.zeros = 0
        self._moved, self._braked = -math.inf, time.monotonic()
        self._state.status = ControllerState.WAITING

    def end(self) -> str:
        """Brake to rest, by joint states as long as they come, and then answer none any more.

        Returns
        -------
        str
            How the arm came to rest.
        """
        begin = seen = time.monotonic()
        patience = min(self._limit, max(4.0 * self.braking_period, LEAST_PATIENCE))
        moves = self.running and not self._stack.at_rest
        while self.running and not self._stack.at_rest:
            now = time.monotonic()
            if now - seen > patience or now - begin > LONGEST_END:
                break
            self._intake.wait(patience)
            if self.work():
                seen = time.monotonic()
        braked = time.monotonic() - begin
        told = self.rest()
        self._state.status = ControllerState.INACTIVE
        if not moves or braked < self.braking_period or told.startswith(CUT):
            return told
        return f'braked to rest in {braked:.2g} s'

    def ignore(self) -> None:
        """Let joint states pass that nobody answers."""
        self._intake.take()

    def rest(self) -> str:
        """Brake to rest and give zero commands time to arrive, for the end of the process.

        Returns
        -------
        str
            How the arm came to rest.
        """
        begin = now = time.monotonic()
        self.zeros = steps = 0
        rest = math.inf
        while self.zeros < ZEROS and now - rest < 0.2:
            if now - begin > LONGEST_BRAKING and self.zeros == 0:
                self._stack.rest()
                self._commands.send(0.0)
                self._commands.wait_until_arrived()
                return f'{CUT} after {LONGEST_BRAKING:g} s, {self._commands.rest} sent'
            self.brake()
            now = time.monotonic()
            steps += self.zeros == 0
            if self.zeros == 1:
                rest = now
            time.sleep(max(0.0, min(self.braking_period, HEARTBEAT)))
        self._commands.wait_until_arrived()
        if not steps:
            return f'{self._commands.rest} sent'
        return f'braked to rest in {rest - begin:.2g} s'

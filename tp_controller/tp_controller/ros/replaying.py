"""The controller's own parts, without a node, fed with a recording."""

from __future__ import annotations

import itertools
import math
import time
from array import array
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any, NamedTuple, cast

import numpy as np
from builtin_interfaces.msg import Time
from numpy.typing import NDArray

from tp_controller.config import HOLD, START, build_settings
from tp_controller.errors import InvalidValue
from tp_controller.recording import Recording
from tp_controller.recording.course import nanoseconds
from tp_controller.ros.control import Control
from tp_controller.ros.intake import Intake
from tp_controller.ros.joint_states import JointStateValues
from tp_controller.ros.lag import Lag
from tp_controller.ros.other_devices import OtherDevices
from tp_controller.ros.replayed_inputs import ReplayedInputs
from tp_controller.ros.state_watch import Arrival, StateWatch
from tp_controller.ros.warnings import Warnings
from tp_interfaces.msg import ControllerState

Vector = NDArray[np.float64]


class Answer(NamedTuple):
    """A cycle, as it was and as it is now."""

    cycle: int
    """Number of the cycle since the controller's start."""
    stamp: int
    """Stamp [ns] of the joint state that it answered."""
    recorded: Vector
    """Command (n,) [rad/s, m/s] that was sent."""
    replayed: Vector
    """Command (n,) [rad/s, m/s] that is found now."""

    @property
    def same(self) -> bool:
        """Whether both are equal to the last bit."""
        return self.recorded.tobytes() == self.replayed.tobytes()


class _Middleware:
    """Stands in for a node: what is published goes nowhere."""

    def create_publisher(self, *_: Any, **__: Any) -> Any:
        return SimpleNamespace(
            publish=_ignore,
            topic_name='',
            wait_for_all_acked=_ignore,
            get_subscription_count=lambda: 1,
        )

    def get_clock(self) -> Any:
        return SimpleNamespace(now=lambda: SimpleNamespace(to_msg=Time))


class _Intake:
    """Gives the one joint state that is put in."""

    topic = ''

    def __init__(self) -> None:
        self.waiting: list[Arrival] = []
        self.others = OtherDevices(())

    def take(self) -> list[Arrival]:
        found, self.waiting = self.waiting, []
        return found

    def waits(self) -> bool:
        return False

    def wait(self, _: float) -> None:
        """Nothing comes by itself."""


class Replay:
    """Answers the joint states of a recording anew, with the controller's own cycle.

    Parameters
    ----------
    recording
        The recording.

    Raises
    ------
    InvalidValue
        If it has no parameters, or no joint states with stamps.

    Attributes
    ----------
    notes
        What was seen that a recording does not have, and may make a difference.
    """

    def __init__(self, recording: Recording) -> None:
        if not recording.parameter_text:
            raise InvalidValue(
                str(recording.path), 'no parameters', 'a recording that has them attached'
            )
        parameters = {START: HOLD, **recording.parameters}
        settings = build_settings(parameters, recording.description, find_rate=True)
        values, stack = settings.values, settings.stack
        rate = values['rate']
        period = 1.0 / rate if rate else math.inf
        self._recording, self._stack = recording, stack
        warnings = Warnings(_ignore, _ignore)
        watch = StateWatch(math.inf, period)
        self._pace, self._paced = Lag(values['timeouts.joint_state']), False
        self._intake = _Intake()
        middleware: Any = _Middleware()
        log: Any = SimpleNamespace(info=_ignore, warning=_ignore)
        control = Control(
            middleware,
            settings,
            cast(Intake, self._intake),
            watch,
            # Nothing is late: the time that this computer takes is not that of the recording.
            math.inf,
            warnings,
            log,
            _ignore,
            _ignore,
        )
        self._state, self._inputs = control.state, control.inputs
        self._commands, self._cycle = control.commands, control.cycle
        self._inputs.active = True
        self._cycle.begin()
        self._given = ReplayedInputs(recording, settings, self._state, self._inputs)
        self._joint_states = _JointStates(recording)
        self.notes = self._given.notes

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the commanded velocities."""
        return tuple(self._stack.robot.joints)

    def answers(self) -> Iterator[Answer]:
        """Every recorded cycle that can be made again; notes are complete at the end."""
        cycles = first = 0
        braked = 0
        for entry in self._recording.messages([self._recording.state]):
            recorded, sent = entry.message, entry.sent
            if cycles and recorded.status == ControllerState.STALE:
                braked = sent
            if not recorded.cycles or recorded.cycles == cycles:
                continue
            if not cycles:
                self._given.begin(recorded)
                if recorded.cycles > 1:
                    self._note(f'the recording begins at cycle {recorded.cycles}')
            elif recorded.cycles < cycles:
                self._note('the controller was started anew: the replay ends there')
                return
            elif recorded.cycles > cycles + 1:
                self._note('some cycles published no state and are left out')
            cycles = recorded.cycles
            stamp = nanoseconds(recorded.header.stamp)
            arrival = self._joint_states.find(stamp, sent)
            if arrival is None:
                self._note(
                    'some joint states are not in the recording: the configurations of the '
                    'state take their place'
                )
                arrival = _from_state(recorded, stamp, sent)
            first = first or stamp
            if braked:
                arrival = self._begin_anew(arrival, braked)
                when = 1e-9 * (stamp - first)
                self._note(
                    f'no joint states before {when:.3f} s: the arm was braked meanwhile, and is '
                    'taken to have come to rest'
                )
                braked = 0
            self._given.before(recorded, sent)
            self._answer(arrival)
            # Commands of a simulation that waited for them were not late.
            self._pace.age(1e-9 * stamp, 1e-9 * arrival.sent)
            self._paced |= self._pace.steady
            self._stack.arm.late = recorded.command_age if self._paced else 0.0
            velocity = self._commands.velocity.copy()
            yield Answer(recorded.cycles, stamp, np.array(recorded.command), velocity)

    def _begin_anew(self, arrival: Arrival, braked: int) -> Arrival:
        """Let the arm rest, as after braking at a time [ns]; return when the state is taken."""
        self._cycle.begin()
        gap = max(1e-9 * (arrival.sent - braked), 0.0)
        return arrival._replace(taken=arrival.taken + gap)

    def _answer(self, arrival: Arrival) -> None:
        self._intake.waiting = [arrival]
        self._cycle.work()
        self._inputs.robot_seen()
        if self._inputs.release:
            self._inputs.release.look()
        self._state.refresh(self._commands.velocity)

    def _note(self, text: str) -> None:
        self.notes[text] = None


def _from_state(recorded: Any, stamp: int, sent: int) -> Arrival:
    """Joint state that a state tells of: what was measured, of an arm without delay and lag."""
    when = recorded.header.stamp
    values = JointStateValues(
        Time(sec=when.sec, nanosec=when.nanosec),
        recorded.position_names,
        array('d', recorded.position),
        array('d'),
    )
    return Arrival(values, stamp, sent, time.monotonic(), 0.0)


class _JointStates:
    """Joint states of a recording by their stamps."""

    def __init__(self, recording: Recording) -> None:
        self._found: dict[int, list[tuple[int, JointStateValues]]] = {}
        for entry in recording.messages([recording.joint_states]):
            msg = entry.message
            stamp = msg.header.stamp
            values = JointStateValues(
                Time(sec=stamp.sec, nanosec=stamp.nanosec),
                msg.name,
                array('d', msg.position),
                array('d', msg.velocity),
            )
            self._found.setdefault(nanoseconds(stamp), []).append((entry.sent, values))
        if not any(self._found):
            got = 'no joint states with stamps'
            raise InvalidValue(str(recording.path), got, 'a recording that has them')

    def find(self, stamp: int, sent: int) -> Arrival | None:
        """Newest joint state of a stamp that was there when its answer was sent."""
        found = self._found.get(stamp)
        if not stamp or not found:
            return None
        earlier = itertools.takewhile(lambda entry: entry[0] <= sent, found)
        *_, (when, values) = itertools.chain(found[:1], earlier)
        return Arrival(values, stamp, when, time.monotonic(), 0.0)


def _ignore(*_: Any) -> None:
    """Do nothing."""

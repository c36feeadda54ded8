"""Which joint state is the newest, how old it is, and how much time has passed since the last.

Three clocks tell of a joint state: its stamp, the time at which the middleware sent it, and the
steady clock of this process when it was taken. A stamp may be zero, constant, of a simulation,
or of a clock that was set; so each says only what the others do not contradict.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from builtin_interfaces.msg import Time

from tp_controller.ros.joint_states import JointStateValues
from tp_controller.ros.lag import Lag

BACK = 5
"""So many states in a row with stamps before the newest one: their clock was set back."""
LEAP = 2.0
"""Stamps that gain so much [s] on the other clocks from one state to the next were set."""
DAY = 86_400_000_000_000
"""Stamps that differ by less [ns] from the clock of their sender are of that clock."""
CONSTANT = 3
"""So many states in a row that changed, but not their stamp: the stamp says nothing."""


class Arrival(NamedTuple):
    """A joint state that was taken from the middleware."""

    msg: JointStateValues
    stamp: int
    """Its stamp [ns]; 0 if it has none."""
    sent: int
    """Time [ns] of the sender's clock when it was sent; 0 if unknown."""
    taken: float
    """Steady time [s] when it was taken."""
    age: float
    """Time [s] from its sending, beyond the least that a state needs, until it was taken."""


def nanoseconds(stamp: Time) -> int:
    """Stamp as one number [ns]."""
    return int(stamp.sec * 1_000_000_000 + stamp.nanosec)


class StateWatch:
    """Order, age and resends of joint states.

    Parameters
    ----------
    limit
        Age [s] at which a state may not move anything: ``timeouts.joint_state``.
    period
        Time [s] between states; infinite if unknown.
    wall
        Steady time of what is sent when the clock of this machine is zero [s]: senders' clocks
        are taken to agree with it until states show for a while that they do not.

    Attributes
    ----------
    period
        Time [s] between states.
    received
        States so far, lost ones included.
    lost
        States that the middleware dropped because they were not taken in time.
    overtaken
        States that came after newer ones.
    paced
        Whether states were ever known to come in real time, see `real_time`.
    """

    def __init__(self, limit: float, period: float, wall: float = math.inf) -> None:
        self._limit = limit
        self.period = period
        self._sent, self._stamps = Lag(limit, wall), Lag(limit)
        self.received = self.lost = self.overtaken = 0
        self.paced = False
        self.single_publisher = False
        """Whether messages are known to come from one publisher: gaps in their numbers tell."""
        self._number: int | None = None
        self._newest = 0
        self._before: JointStateValues | None = None
        self._back: list[Arrival] = []
        self._constant = 0
        self._answered: Arrival | None = None
        self._notes: list[str] = []

    def arrive(
        self, msg: JointStateValues, info: dict[str, int | None], now: float, idle: float
    ) -> Arrival | None:
        """Judge a state that was just taken.

        Parameters
        ----------
        msg, info
            The state, and what the middleware says about it.
        now
            Steady time [s].
        idle
            How long ago [s] no state was waiting: the bound on its age if no clock tells more.

        Returns
        -------
        Arrival or None
            The state with its age; None if it was overtaken by a newer one.
        """
        self._count(info.get('publication_sequence_number'))
        stamp, sent = nanoseconds(msg.stamp), info.get('source_timestamp') or 0
        ages = []
        if sent > 0:
            ages.append(self._sent.age(1e-9 * sent, now))
            if self._sent.set_back:
                by = self._sent.set_back
                self._notes.append(
                    'the clock of who sends joint states is behind, or was set back, '
                    f'by {by:.3g} s'
                )
        stands = self._see_whether_it_stands(msg, stamp)
        if stamp and not (stands and self._is_answered(msg, stamp)):
            age = self._stamps.age(1e-9 * stamp, now, stands)
            self.paced |= self._stamps.steady
            if self._stamps.steady and not self._says_nothing:
                ages.append(age)
        arrival = Arrival(msg, stamp, sent, now, max(ages) if ages else idle)
        if stamp and stamp < self._newest and not self._went_back(arrival):
            self.overtaken += 1
            return None
        self._back.clear()
        self._newest = stamp
        return arrival

    @property
    def real_time(self) -> bool:
        """Whether states are known to come in real time: their stamps run like the steady clock.

        Those of a simulation that waits for its answers do not, and its states do not age.
        """
        return self._stamps.steady

    @property
    def _says_nothing(self) -> bool:
        """Whether stamps stay while the states change."""
        return self._constant >= CONSTANT

    def _see_whether_it_stands(self, msg: JointStateValues, stamp: int) -> bool:
        """Whether a stamp is that of the state before; counts those whose content changed."""
        before, self._before = self._before, msg
        if before is None or stamp != self._newest or not stamp:
            self._constant = 0
            return False
        if not _same(msg, before):
            self._constant += 1
        return True

    def _is_answered(self, msg: JointStateValues, stamp: int) -> bool:
        """Whether this is the state that was answered last, stamp and content."""
        last = self._answered
        return last is not None and stamp == last.stamp and _same(msg, last.msg)

    def _count(self, number: int | None) -> None:
        self.received += 1
        # A number that is not supported is the largest one there is.
        if number is None or number >= 2**63 or not self.single_publisher:
            self._number = None
            return
        if self._number is not None and number > self._number + 1:
            self.lost += number - self._number - 1
            self.received += number - self._number - 1
        self._number = number

    def _went_back(self, arrival: Arrival) -> bool:
        """Whether stamps before the newest one are here to stay: the clock was set back.

        States that were overtaken come at once; those of a clock come as it runs.
        """
        if self._back and arrival.stamp < self._back[-1].stamp:
            self._back.clear()
        self._back.append(arrival)
        first = self._back[0]
        if len(self._back) < BACK or arrival.taken - first.taken < 0.5e-9 * (
            arrival.stamp - first.stamp
        ):
            return False
        by = 1e-9 * (self._newest - first.stamp)
        self._stamps = Lag(self._limit)
        self._notes.append(f'stamps of joint states went back by {by:.3g} s and stay there')
        return True

    def note(self) -> str:
        """What was found about the clocks since the last call; empty if nothing."""
        if not self._notes:
            return ''
        text = ', '.join(self._notes)
        self._notes.clear()
        return text

    def differ(self, older: Arrival, newer: Arrival) -> bool:
        """Whether a state that is left out is no copy of the newer one, nor of one answered."""
        if not older.stamp:
            return True
        last = self._answered
        return older.stamp != newer.stamp and (last is None or older.stamp != last.stamp)

    def is_resend(self, arrival: Arrival) -> bool:
        """Whether a state is the one that was answered last, sent again: no time has passed.

        Stamp and content are the same then. Where the stamp says nothing, a copy comes sooner
        than the next state would.
        """
        last = self._answered
        if last is None or not self._is_answered(arrival.msg, arrival.stamp):
            return False
        if arrival.stamp and not self._says_nothing:
            return True
        return self.between(last, arrival) < 0.5 * min(self.period, self._limit)

    def of_wall_clock(self, arrival: Arrival) -> bool:
        """Whether the stamp of a state is a time of its sender's clock, not of a simulation."""
        return arrival.stamp > 0 < arrival.sent and abs(arrival.sent - arrival.stamp) < DAY

    def elapsed(self, arrival: Arrival) -> float:
        """Time [s] between the state that was answered last and this one; infinite without one.

        By the stamps, where these do not contradict what else is known: a simulation may be
        faster or slower than the steady clock.
        """
        last = self._answered
        if last is None:
            return math.inf
        between = self.between(last, arrival)
        if arrival.stamp > last.stamp > 0:
            passed = 1e-9 * (arrival.stamp - last.stamp)
            ahead = passed - between
            leap = max(LEAP, 10.0 * self.period)
            if abs(ahead) < self._limit if self._stamps.steady else ahead < leap:
                return passed
        return between

    def time(self, arrival: Arrival) -> float:
        """Time [s] of a state by the best clock that tells of it."""
        if arrival.stamp and not self._says_nothing:
            return 1e-9 * arrival.stamp
        return 1e-9 * arrival.sent if arrival.sent else arrival.taken

    def answered(self, arrival: Arrival) -> None:
        """Take note that a state was answered."""
        self._answered = arrival

    def between(self, last: Arrival, arrival: Arrival) -> float:
        """Time [s] between two states, by what is known beside their stamps."""
        taken = arrival.taken - last.taken
        sent = 1e-9 * (arrival.sent - last.sent)
        usable = last.sent > 0 and arrival.sent > 0 and abs(sent - taken) < self._limit
        return max(0.0, sent if usable else taken)


def _same(one: JointStateValues, other: JointStateValues) -> bool:
    return bool(one.position == other.position and one.velocity == other.velocity)

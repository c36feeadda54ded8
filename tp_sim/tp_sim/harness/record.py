"""What a closed loop did, cycle by cycle."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tp_controller.errors import listed
from tp_interfaces.msg import ControllerState
from tp_sim.harness.errors import HarnessError

Array = NDArray[np.float64]


class Record(NamedTuple):
    """Trajectory of N cycles of n joints; every task's entries by its name."""

    time: Array
    """Time of the joint state (N,) [s], from 0."""
    q: Array
    """Joint positions (N, n) [rad, m]."""
    qd: Array
    """Commanded joint velocities (N, n) [rad/s, m/s]."""
    scale: Array
    """Factor that brought each command into the velocity limits (N,)."""
    solve_time: Array
    """Time that each command took to compute [s] (N,)."""
    desired: dict[str, Array]
    """Desired values (N, target size)."""
    current: dict[str, Array]
    """Present values (N, target size)."""
    error: dict[str, Array]
    """Task errors (N, k), desired - current."""
    error_norm: dict[str, Array]
    """Norms of the task errors (N,)."""
    distance: dict[str, Array]
    """Distances of set-based tasks from their boundaries (N, k) [m, rad]; others (N, 0)."""
    active: dict[str, Array]
    """Whether each task acts (N,)."""
    requested: dict[str, Array]
    """Desired task velocities (N, k); zero outside the hierarchy."""
    achieved: dict[str, Array]
    """Task velocities of the commands (N, k); zero outside the hierarchy."""

    def time_below(self, task: str, bound: float) -> float:
        """First time [s] from which on the task's error norm stays below a bound.

        Raises
        ------
        HarnessError
            If the last error is not below it.
        """
        norms = self.error_norm[task]
        above = np.flatnonzero(norms >= bound)
        if above.size == 0:
            return float(self.time[0])
        if above[-1] + 1 == norms.size:
            raise HarnessError(f'{task}: the error is never below {bound:g} to the end')
        return float(self.time[above[-1] + 1])


def stamp_ns(msg: ControllerState) -> int:
    """Stamp [ns] of the joint state that a controller state answers."""
    return msg.header.stamp.sec * 1_000_000_000 + msg.header.stamp.nanosec


class Recorder:
    """Collects the controller states of cycles, one for each joint state."""

    def __init__(self) -> None:
        self.cycles = 0
        """Cycles of the controller up to the newest one here."""
        self._states: dict[int, ControllerState] = {}

    def add(self, msg: ControllerState) -> None:
        """Keep a state, in place of an earlier one with the same stamp."""
        if msg.cycles > self.cycles:
            self.cycles = msg.cycles
            self._states[stamp_ns(msg)] = msg

    def clear(self) -> None:
        """Forget everything so far."""
        self._states.clear()

    @property
    def newest(self) -> int:
        """Stamp [ns] of the last cycle, 0 before the first."""
        return next(reversed(self._states), 0)

    @property
    def time(self) -> float:
        """Time [s] from the first to the last cycle."""
        return (self.newest - next(iter(self._states), 0)) * 1e-9

    def __len__(self) -> int:
        return len(self._states)

    def record(self) -> Record:
        """Arrays of all cycles so far.

        Raises
        ------
        HarnessError
            If there has been no cycle.
        """
        if not self._states:
            raise HarnessError(f'no cycle is recorded; fields would be {listed(Record._fields)}')
        stamps = np.array(list(self._states))
        states = list(self._states.values())
        names = [task.name for task in states[0].tasks]

        def each(field: str) -> dict[str, Array]:
            return {
                name: np.array([getattr(state.tasks[i], field) for state in states])
                for i, name in enumerate(names)
            }

        return Record(
            time=(stamps - stamps[0]) * 1e-9,
            q=np.array([state.position for state in states]),
            qd=np.array([state.command for state in states]),
            scale=np.array([state.scale for state in states]),
            solve_time=np.array([state.solve_time for state in states]),
            desired=each('desired'),
            current=each('current'),
            error=each('error'),
            error_norm=each('error_norm'),
            distance=each('distance'),
            active=each('active'),
            requested=each('requested_velocity'),
            achieved=each('achieved_velocity'),
        )

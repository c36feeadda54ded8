"""Errors on a circle that the hand follows by a trajectory, with the real nodes.

``python benchmarks/circle.py --realtime`` in real time, without it in lockstep.
"""

import argparse
from pathlib import Path

import numpy as np
from builtin_interfaces.msg import Duration
from geometry_msgs.msg import Transform, Twist, Vector3
from rich.console import Console
from rich.table import Table
from trajectory_msgs.msg import MultiDOFJointTrajectory, MultiDOFJointTrajectoryPoint

from tp_sim.harness import ClosedLoop

CONFIG = Path(__file__).resolve().parent.parent / 'config'
RADIUS, PERIOD = 0.1, 5.0
"""Of the circle [m, s]."""
POINTS = 100
LEAD = 300_000_000
"""Time [ns] from the message to the beginning."""
ARMS = {
    'panda.yaml': ('hand_position', {}),
    'a1_position.yaml': ('ee_position', {'/**': {'rate': 200.0}}),
}
STEADY = {'tp_controller': {'start': 'hold'}}
PATIENT = {'tp_controller': {'start': 'hold', 'timeouts': {'joint_state': 60.0}}}


def place(start: np.ndarray, time: float) -> np.ndarray:
    """Point (3,) of the circle in x and y at a time."""
    angle = 2.0 * np.pi * time / PERIOD
    return start + RADIUS * np.array([np.cos(angle) - 1.0, np.sin(angle), 0.0])


def velocity(time: float) -> np.ndarray:
    """Velocity (3,) there."""
    angle = 2.0 * np.pi * time / PERIOD
    return 2.0 * np.pi * RADIUS / PERIOD * np.array([-np.sin(angle), np.cos(angle), 0.0])


def trajectory(start: np.ndarray, begin: int, velocities: bool) -> MultiDOFJointTrajectory:
    """Once round, from a time [ns] on; the last point is at rest."""
    msg = MultiDOFJointTrajectory()
    msg.header.stamp.sec, msg.header.stamp.nanosec = divmod(begin, 10**9)
    for i in range(POINTS + 1):
        time = PERIOD * i / POINTS
        at = divmod(round(1e9 * time), 10**9)
        point = MultiDOFJointTrajectoryPoint(time_from_start=Duration(sec=at[0], nanosec=at[1]))
        point.transforms = [Transform(translation=Vector3(**_xyz(place(start, time))))]
        if velocities:
            speed = velocity(time) if i < POINTS else np.zeros(3)
            point.velocities = [Twist(linear=Vector3(**_xyz(speed)))]
        msg.points.append(point)
    return msg


def _xyz(values: np.ndarray) -> dict[str, float]:
    return dict(zip('xyz', values.tolist(), strict=True))


def errors(name: str, realtime: bool, velocities: bool) -> np.ndarray:
    """Distances (N,) [m] from the circle's point of the same time, cycle by cycle."""
    task, changes = ARMS[name]
    changes = changes | (STEADY if realtime else PATIENT)
    with ClosedLoop(CONFIG / name, changes, lockstep=not realtime) as loop:
        loop.run(1.0)
        current = np.array(loop.client.task(task).current)
        start = np.pad(current, (0, 3 - current.size))
        stamp = loop.state.header.stamp
        begin = stamp.sec * 10**9 + stamp.nanosec + LEAD
        found = []

        def note(state) -> None:
            time = 1e-9 * (state.header.stamp.sec * 10**9 + state.header.stamp.nanosec - begin)
            if 0.0 <= time <= PERIOD:
                now = next(t for t in state.tasks if t.name == task).current
                found.append(np.linalg.norm(now - place(start, time)[: current.size]))

        loop.client.on_state.append(note)
        before = loop.client.task(task)
        loop.client.publish(
            f'tp_controller/{task}/trajectory', trajectory(start, begin, velocities)
        )
        if not realtime:
            loop.client.wait_for(
                lambda: loop.client.task(task).accepted_goals > before.accepted_goals, 'it'
            )
        loop.run(PERIOD + 1.0)
        return np.array(found)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--realtime', action='store_true')
    arguments = parser.parse_args()
    table = Table(title=f'Circle of {RADIUS} m in {PERIOD} s: distance from it [mm]')
    for column in ('arm', 'points with', 'RMS', 'largest', 'cycles'):
        table.add_column(column, justify='left' if column in ('arm', 'points with') else 'right')
    for name in ARMS:
        for velocities in (True, False):
            e = 1e3 * errors(name, arguments.realtime, velocities)
            words = 'velocities' if velocities else 'positions alone'
            rms = float(np.sqrt(np.mean(e**2)))
            table.add_row(name, words, f'{rms:.3f}', f'{e.max():.2f}', str(e.size))
    Console().print(table)


if __name__ == '__main__':
    main()

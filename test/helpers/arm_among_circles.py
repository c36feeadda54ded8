"""The planar arm of `b3_pressed.yaml` among its three circles, fast and patient with tests."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from tp_sim.harness import ClosedLoop

PATIENT = {'timeouts': {'joint_state': 60.0}}
"""Joint states do not stop because the test is slow."""
FAST = {'robot': {'limits': {'velocity': [3.0], 'acceleration': [10.0]}}}
TASKS = {'ee_position': {'gain': [4.0]}, 'posture': {'type': 'posture', 'gain': [4.0]}}
LEVELS = ['joint_1_range', 'obstacle_1', 'obstacle_2', 'obstacle_3', 'ee_position', 'posture']
FREE = [1.0, 0.6]
"""A goal that the straight way leads to."""


@contextmanager
def arm_among_circles(config: Path, **tasks: Mapping[str, Any]) -> Iterator[ClosedLoop]:
    """Run the nodes in lockstep, with limits of range, speed and acceleration.

    Parameters
    ----------
    config
        Folder of the parameter files.
    tasks
        More tasks by name.
    """
    controller = PATIENT | {'tasks': TASKS | tasks, 'hierarchy': LEVELS}
    changes = {'/**': FAST, 'tp_controller': controller}
    with ClosedLoop(config / 'b3_pressed.yaml', changes) as loop:
        yield loop

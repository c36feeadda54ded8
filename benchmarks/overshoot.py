"""How far a joint goes beyond its target, in real time, by the real nodes.

A planar arm with limits of acceleration gets a target 1 rad away for its first joint, with a gain
of K·dt = 0.5. The arm is ideal, or late and noisy with the controller told of it or not.

    python benchmarks/overshoot.py
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table
from sensor_msgs.msg import JointState

from tp_sim.harness import (
    Client,
    NodeProcess,
    PrivateDomain,
    edited,
    read_document,
    write_document,
)

CONFIG = Path(__file__).resolve().parent.parent / 'config' / 'a4_position_joint.yaml'
RATE = 60.0
SECONDS = 6.0
"""Time [s] for the motion."""
WAY = 1.0
"""To the target [rad]."""
TASK = 'joint_1_position'
LATE = {'delay': 2, 'lag': [0.03], 'noise': [1e-3]}
TOLD = {'delay': [2.0 / RATE], 'lag': [0.03], 'noise': [1e-3]}
CASES: dict[str, tuple[dict[str, Any], dict[str, Any], bool]] = {
    'ideal': ({'delay': 0}, {}, True),
    'ideal, solver.settle: false': ({'delay': 0}, {}, False),
    'delay 33 ms, lag 30 ms, noise 1e-3, told': (LATE, TOLD, True),
    'delay 33 ms, lag 30 ms, noise 1e-3, not told': (LATE, {}, True),
}
"""What the arm is like, what the controller is told of it, and `solver.settle`."""


def chase(plant: dict[str, Any], told: dict[str, Any], settle: bool) -> tuple[float, float, int]:
    """Overshoot and last error [rad], and reversals in the last 100 commands."""
    changes = {
        '/**': {'robot': {'limits': {'acceleration': [5.0], 'velocity': [4.0]}, **told}},
        'tp_sim': {'plant': plant},
        'tp_controller': {
            'hierarchy': [TASK],
            'solver': {'settle': settle},
            'tasks': {TASK: {'gain': [0.5 * RATE]}},
        },
    }
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / 'parameters.yaml'
        write_document(edited(read_document(CONFIG), changes), path)
        domain = PrivateDomain()
        nodes = [NodeProcess('tp_sim', 'simulator', path, domain.environment())]
        client = Client(domain)
        states = client.collect(JointState, 'tp_sim/true_joint_states')
        commands = client.collect(JointState, 'joint_velocity_command')
        nodes.append(NodeProcess('tp_controller', 'controller', path, domain.environment()))
        try:
            client.wait_for(lambda: bool(commands and states), 'commands')
            client.spin_for(1.0)
            target = states[-1].position[0] + WAY
            client.send_goal(TASK, [target])
            client.spin_for(SECONDS)
        finally:
            for node in reversed(nodes):
                node.stop()
            client.close()
            domain.close()
    q = np.array([state.position[0] for state in states])
    last = np.array([command.velocity[0] for command in commands[-100:]])
    reversals = int(np.count_nonzero(last[1:] * last[:-1] < 0.0))
    return float(max(q.max() - target, 0.0)), float(abs(q[-1] - target)), reversals


def main() -> None:
    table = Table(title='A joint with K·dt = 0.5 and 5 rad/s²', title_style='bold')
    for column in ('arm', 'overshoot [mrad]', 'last error [mrad]', 'reversals at rest'):
        table.add_column(column, justify='left' if column == 'arm' else 'right')
    for name, case in CASES.items():
        overshoot, error, reversals = chase(*case)
        table.add_row(name, f'{1e3 * overshoot:.2f}', f'{1e3 * error:.2f}', str(reversals))
    Console(width=max(100, Console().width)).print(table)


if __name__ == '__main__':
    main()

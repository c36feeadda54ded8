"""Time of one step on a 7-joint Panda, beside Pink's differential inverse kinematics.

Both get the same configurations, hand pose and posture: here three levels of priority, in
Pink (https://github.com/stephane-caron/pink) a frame task and a posture task in one quadratic
program for DAQP. Each side runs in a process and a Python environment of its own. They take
turns in short blocks, so that both see the same machine.
"""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from tp_controller.robot import read_description, urdf_robot
from tp_controller.rotations import quaternion_from_rotation

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent
PINK = ROOT / '.venv-pink'
URDF = 'package://example-robot-data/robots/panda_description/urdf/panda.urdf'
JOINTS = [f'panda_joint{i + 1}' for i in range(7)]
FRAME = 'panda_hand_tcp'
GOAL = [0.4, -0.4, 0.3, -2.0, 0.2, 1.8, 1.0]
"""Configuration [rad] whose hand pose is the goal."""
POSTURE = [0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785]
VARIANTS = ('own', 'pink', 'pink without limits')
SHARE = 0.5
"""Largest share of Pink's time, median against median, that a step may take."""
LABELS = {
    'own': 'this project',
    'pink': 'Pink with its limits',
    'pink without limits': 'Pink without limits',
}


class Side:
    """A process that times blocks of steps on request."""

    def __init__(self, python: str, script: str, scenario: Path, **environment: str) -> None:
        # One thread each: small matrices gain nothing from more, and their waiting disturbs.
        threads = {f'{name}_NUM_THREADS': '1' for name in ('OMP', 'OPENBLAS', 'MKL', 'NUMBA')}
        self._process = subprocess.Popen(
            [python, HERE / script, scenario],
            env=environment | threads,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        self._script = script
        self._answer()

    def durations(self, variant: str, start: int, stop: int) -> list[int]:
        """Durations [ns] of the steps at some of the configurations."""
        print(f'{variant} {start} {stop}', file=self._process.stdin, flush=True)
        return json.loads(self._answer())

    def stop(self) -> None:
        """End the process."""
        self._process.stdin.close()
        self._process.wait()

    def _answer(self) -> str:
        line = self._process.stdout.readline()
        if not line:
            raise RuntimeError(f'{self._script} ended early; its last words are above')
        return line


def run(blocks: int, steps: int) -> bool:
    """Measure and print; return whether a step takes at most half of Pink's time."""
    scenario = _write_scenario(blocks * steps)
    plain = {
        name: value
        for name, value in os.environ.items()
        # Pink's environment is complete without the libraries of this one.
        if name not in ('PYTHONPATH', 'LD_LIBRARY_PATH')
    }
    own = Side(sys.executable, 'step_own.py', scenario, **os.environ)
    pink = Side(_pink_python(), 'step_pink.py', scenario, **plain)
    durations: dict[str, list[int]] = {variant: [] for variant in VARIANTS}
    for block in range(blocks):
        # Each begins as often as the others.
        turn = block % len(VARIANTS)
        for variant in VARIANTS[turn:] + VARIANTS[:turn]:
            side = own if variant == 'own' else pink
            durations[variant] += side.durations(variant, block * steps, (block + 1) * steps)
    own.stop()
    pink.stop()
    return _print(durations)


def _write_scenario(count: int) -> Path:
    """Write what both sides need to know; return where."""
    folder = ROOT / 'out' / 'step_time'
    folder.mkdir(parents=True, exist_ok=True)
    text = read_description(URDF)
    (folder / 'panda.urdf').write_text(text, encoding='utf-8')
    robot = urdf_robot(text, JOINTS)
    robot.update(np.array(GOAL))
    hand = robot.frame(FRAME)
    # A smooth way through most of the range of every joint, like that of an arm at work.
    lower, upper = robot.limits.position_min, robot.limits.position_max
    phases = np.outer(np.arange(count) * 1e-3, np.linspace(0.7, 1.3, robot.n)) + np.arange(robot.n)
    scenario: dict[str, Any] = {
        'urdf': str(folder / 'panda.urdf'),
        'joints': JOINTS,
        'frame': FRAME,
        'goal': [*hand.position, *quaternion_from_rotation(hand.rotation)],
        'posture': POSTURE,
        'gain': 1.0,
        'path': ((lower + upper) / 2 + 0.4 * (upper - lower) * np.sin(phases)).tolist(),
    }
    path = folder / 'scenario.json'
    path.write_text(json.dumps(scenario), encoding='utf-8')
    return path


def _pink_python() -> str:
    """Python of an environment with Pink, which is made when it is not there yet."""
    python = PINK / 'bin' / 'python'
    wanted, lock = HERE / 'pink.txt', ROOT / 'requirements' / 'lock.txt'
    state = f'{PINK}\n{wanted.read_text(encoding="utf-8")}{lock.read_text(encoding="utf-8")}'
    made = PINK / 'state'
    if not made.exists() or made.read_text(encoding='utf-8') != state:
        print('installing Pink into .venv-pink', flush=True)
        subprocess.run([sys.executable, '-m', 'venv', '--clear', PINK], check=True)
        subprocess.run(
            [python, '-m', 'pip', 'install', '--quiet', '-r', wanted, '-c', lock], check=True
        )
        made.write_text(state, encoding='utf-8')
    return str(python)


def _print(durations: dict[str, list[int]]) -> bool:
    count = len(durations['own'])
    table = Table(title=escape(f'Time of a step [µs], Panda with 7 joints, {count} steps each'))
    for column in ('side', 'median', '99 %', 'this project / it'):
        table.add_column(column, justify='left' if column == 'side' else 'right')
    medians = {variant: np.median(times) * 1e-3 for variant, times in durations.items()}
    for variant, times in durations.items():
        table.add_row(
            LABELS[variant],
            f'{medians[variant]:.1f}',
            f'{np.percentile(times, 99) * 1e-3:.1f}',
            f'{medians["own"] / medians[variant]:.2f}',
        )
    console = Console(width=100)
    console.print(table)
    console.print(f'({os.cpu_count()} cores, one thread each)')
    return bool(medians['own'] <= SHARE * medians['pink'])

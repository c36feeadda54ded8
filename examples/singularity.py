"""Through a stretched arm with the pseudo-inverse, constant and adaptive damping.

The target of the tip goes out on a straight line from the base, past the point where the arm
is stretched, and back, with its velocity as feedforward. This prints what every inverse makes
of it and draws the run with the damping of the parameter file:

    python examples/singularity.py

It is also an example of the library without ROS: a stack answers configurations.
"""

import argparse
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure
from rich.console import Console
from rich.table import Table

from tp_controller import build_settings, read_parameter_file
from tp_sim.settings import build_simulator_settings

ROOT = Path(__file__).resolve().parent.parent
CONFIG = ROOT / 'config' / 'singularity.yaml'
PICTURE = ROOT / 'docs' / 'images' / 'singularity.png'

PERIOD = 6.0
"""Time [s] to go out and come back."""
BEYOND = 0.005
"""How far the target goes past the reach of the stretched arm [m]."""
DAMPINGS = (0.05, 0.1, 0.2)
REGIONS = (0.1, 0.2, 0.4)


class Run(NamedTuple):
    """What happened at every step."""

    time: np.ndarray
    """(N,) [s]."""
    error: np.ndarray
    """Distance from the target (N,) [m]."""
    wanted: np.ndarray
    """Largest joint speed as a share of its limit, before scaling to the limits (N,)."""
    scale: np.ndarray
    """Factor of that scaling (N,)."""
    singular_value: np.ndarray
    """Smallest singular value of the task's Jacobian (N,) [m]."""
    command: np.ndarray
    """Joint velocity (N, n) [rad/s]."""

    @property
    def rms_error(self):
        """Root of the mean square of the error [m]."""
        return float(np.sqrt(np.mean(self.error**2)))

    @property
    def largest_acceleration(self):
        """Largest change of a joint velocity from one step to the next by its time [rad/s²]."""
        return float(np.abs(np.diff(self.command, axis=0)).max() / self.time[1])


def run(inverse, damping=None, region=None, beyond=BEYOND, period=PERIOD, config=CONFIG):
    """Lead the target out and back once.

    Parameters
    ----------
    inverse
        ``pinv``, ``dls`` or ``adaptive``.
    damping, region
        λ and ε; those of the parameter file when left out.
    beyond
        How far the target goes past the reach [m].
    period
        Time [s] out and back.
    """
    given = {'inverse': inverse, 'damping': damping, 'singular_region': region}
    changes = {f'solver.{key}': value for key, value in given.items() if value is not None}
    settings = build_settings(read_parameter_file(config, 'tp_controller') | changes)
    simulator = build_simulator_settings(read_parameter_file(config, 'tp_sim'))
    stack, integrator, dt = settings.stack, simulator.integrator, 1.0 / simulator.values['rate']
    tip = stack.tasks['tip']
    stack.step(integrator.q)
    start = tip.current
    direction = start / np.linalg.norm(start)
    way = sum(settings.values['robot.dh.a']) + beyond - np.linalg.norm(start)
    rows = []
    for i in range(round(period / dt) + 1):
        angle = 2.0 * np.pi * i * dt / period
        tip.target = start + 0.5 * way * (1.0 - np.cos(angle)) * direction
        tip.feedforward = np.pi / period * way * np.sin(angle) * direction
        step = stack.step(integrator.q)
        share = np.max(np.abs(step.command) / stack.robot.limits.velocity)
        smallest = np.linalg.svd(tip.J, compute_uv=False)[-1]
        rows.append((i * dt, np.linalg.norm(tip.error), share / step.scale, step.scale, smallest))
        rows[-1] += (step.command.copy(),)
        integrator.step(step.command, dt)
    return Run(*map(np.array, zip(*rows, strict=True)))


def draw(path, beyond, period):
    """Draw error, speed and singular value with the damping of the parameter file as a PNG."""
    runs = {
        'pseudo-inverse': (run('pinv', beyond=beyond, period=period), '0.6', 0.9),
        'constant damping': (run('dls', beyond=beyond, period=period), 'tab:orange', 1.8),
        'adaptive damping': (run('adaptive', beyond=beyond, period=period), 'tab:blue', 1.8),
    }
    figure = Figure(figsize=(8.0, 7.4), layout='constrained')
    error, speed, singular = figure.subplots(3, 1, sharex=True)
    for name, (result, color, width) in runs.items():
        style = {'color': color, 'linewidth': width, 'label': name}
        error.plot(result.time, 1e3 * result.error, **style)
        speed.plot(result.time, result.wanted * result.scale, **style)
        singular.plot(result.time, result.singular_value, **style)
    solver = read_parameter_file(CONFIG, 'tp_controller')
    damping, region = solver['solver.damping'], solver['solver.singular_region']
    title = f'target up to {1e3 * beyond:g} mm out of reach; λ = {damping:g} m, ε = {region:g} m'
    error.set_title(title, loc='left', fontsize=10)
    error.set_ylabel('tracking error [mm]')
    peak = runs['pseudo-inverse'][0].wanted.max()
    title = f'as commanded; the pseudo-inverse asked for up to {peak:.0f} times the limit'
    speed.set_title(title, loc='left', fontsize=10)
    speed.set_ylabel('largest joint speed / limit')
    speed.axhline(1.0, color='tab:red', linestyle='--', linewidth=1.0, label='limit')
    singular.axhline(region, color='0.4', linestyle=':', linewidth=1.2)
    singular.annotate('ε', (0.0, region), (4, 3), textcoords='offset points', color='0.3')
    singular.set_ylabel('smallest singular value [m]')
    singular.set_xlabel('time [s]')
    for axes in (error, speed, singular):
        axes.grid(alpha=0.3)
        axes.set_ylim(bottom=0.0)
    speed.set_ylim(top=1.1)
    singular.set_xlim(0.0, period)
    handles, labels = speed.get_legend_handles_labels()
    figure.legend(handles, labels, loc='outside upper center', ncols=4, fontsize=10, frameon=False)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=130)


def table(beyond, period):
    """Figures of every inverse, for several λ and ε."""
    result = Table(
        title=f'Out to {1e3 * beyond:g} mm past the stretched arm and back in {period:g} s'
    )
    for column in (
        'inverse', 'λ', 'ε', 'largest speed / limit', 'scaled [%]',
        'largest error [mm]', 'RMS error [mm]', 'largest acceleration [rad/s²]',
    ):  # fmt: skip
        result.add_column(column, justify='left' if column == 'inverse' else 'right')
    result.add_row('pinv', '', '', *_figures(run('pinv', beyond=beyond, period=period)))
    for damping in DAMPINGS:
        result.add_section()
        constant = run('dls', damping, beyond=beyond, period=period)
        result.add_row('dls', f'{damping:g}', '', *_figures(constant))
        for region in REGIONS:
            adaptive = run('adaptive', damping, region, beyond=beyond, period=period)
            result.add_row('adaptive', f'{damping:g}', f'{region:g}', *_figures(adaptive))
    return result


def _figures(result):
    return (
        f'{result.wanted.max():.2f}',
        f'{100.0 * np.mean(result.scale < 1.0):.1f}',
        f'{1e3 * result.error.max():.2f}',
        f'{1e3 * result.rms_error:.2f}',
        f'{result.largest_acceleration:.1f}',
    )


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--beyond', type=float, default=BEYOND, help='past the reach [m]')
    parser.add_argument('--period', type=float, default=PERIOD, help='out and back [s]')
    parser.add_argument('--out', type=Path, default=PICTURE, help='picture to write')
    arguments = parser.parse_args()
    console = Console(width=100)
    console.print(table(arguments.beyond, arguments.period))
    draw(arguments.out, arguments.beyond, arguments.period)
    console.print(f'drawn with the damping of {CONFIG.name}: {arguments.out}')


if __name__ == '__main__':
    main()

"""Pictures of a batch: success, time, clearance and the worst use of limits."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from tp_controller.batch.table import about, column

if TYPE_CHECKING:
    import pyarrow as pa

Rows = list[dict[str, Any]]
COLORS: Sequence[Any] = mpl.color_sequences['tab10']
Z = 1.96
"""Standard deviations of a 95 % interval."""
BINS, RUNS_PER_BIN = 10, 20
"""Most intervals of gain that the success is shown for, and runs in each of them on average."""
LIMITS = {
    'velocity_use': 'velocity',
    'range_use': 'range',
    'acceleration_use': 'acceleration',
}


def draw_plots(table: pa.Table, folder: Path) -> None:
    """Draw the four pictures of a batch as PNG files in a folder.

    Parameters
    ----------
    table
        Table of a batch, as from `run_batch` or `read_runs`.
    folder
        Where ``success.png``, ``time.png``, ``clearance.png`` and ``limits.png`` are written.
    """
    rows = table.to_pylist()
    facts = about(table)
    by_scheme = {name: [row for row in rows if row['scheme'] == name] for name in facts['schemes']}
    draw_success(by_scheme, facts, folder / 'success.png')
    draw_time(by_scheme, facts, folder / 'time.png')
    draw_clearance(by_scheme, folder / 'clearance.png')
    draw_limits(by_scheme, folder / 'limits.png')


def wilson(reached: int, count: int) -> tuple[float, float]:
    """95 % interval of a share, after Wilson (1927).

    Parameters
    ----------
    reached, count
        ``reached`` of ``count`` independent trials were successes.

    Returns
    -------
    tuple
        Lower and upper end.
    """
    share, spread = reached / count, Z * Z / count
    middle = (share + 0.5 * spread) / (1.0 + spread)
    half = Z * math.sqrt(share * (1.0 - share) / count + 0.25 * Z * Z / count**2) / (1.0 + spread)
    return max(middle - half, 0.0), min(middle + half, 1.0)


def draw_success(by_scheme: Mapping[str, Rows], facts: Mapping[str, Any], path: Path) -> None:
    """Draw the share of runs that reached their goals, and by gain where gains are random."""
    low, high = facts['gain']
    panels = 2 if high > low else 1
    bins = min(max(facts['runs'] // RUNS_PER_BIN, 1), BINS)
    figure = Figure(figsize=(2.0 + 4.0 * panels, 4.0), layout='constrained')
    axes = figure.subplots(1, panels, squeeze=False)[0]
    for i, (scheme, rows) in enumerate(by_scheme.items()):
        _bar(axes[0], i, rows, scheme, COLORS[i % len(COLORS)])
        if panels == 2:
            _by_gain(axes[1], rows, np.linspace(low, high, bins + 1), COLORS[i % len(COLORS)])
    axes[0].set_yticks(range(len(by_scheme)), list(by_scheme))
    axes[0].set_ylim(len(by_scheme) - 0.4, -0.6)
    axes[0].set_xlim(0.0, 100.0)
    axes[0].set_xlabel('runs that reached their goals [%]')
    axes[0].grid(axis='x', alpha=0.3)
    if panels == 2:
        axes[1].set_ylim(0.0, 103.0)
        axes[1].set_xlim(low, high)
        axes[1].set_xlabel('factor on the gains')
        axes[1].set_ylabel('reached [%]')
        axes[1].grid(alpha=0.3)
    seconds = (facts['steps'] - 1) * facts['period']
    figure.suptitle(
        f'{facts["runs"]} runs of {seconds:g} s; bars: 95 % interval\n'
        f'reached: errors at the end within {facts["tolerance"]:g} [m, rad]',
        fontsize=10,
    )
    figure.savefig(path, dpi=130)


def _bar(axes: Axes, place: int, rows: Rows, scheme: str, color: Any) -> None:
    reached = sum(row['reached'] for row in rows)
    share = reached / len(rows)
    low, high = wilson(reached, len(rows))
    ends = [[100.0 * (share - low)], [100.0 * (high - share)]]
    axes.barh(place, 100.0 * share, color=color, alpha=0.7, height=0.6, label=scheme)
    axes.errorbar(100.0 * share, place, xerr=np.abs(ends), color='0.2', capsize=3)
    axes.text(2.0, place, f'{100.0 * share:.1f}', va='center')


def _by_gain(axes: Axes, rows: Rows, edges: Any, color: Any) -> None:
    gains = np.array([row['gain'] for row in rows])
    reached = np.array([row['reached'] for row in rows])
    bins = np.clip(np.digitize(gains, edges) - 1, 0, len(edges) - 2)
    used = [i for i in range(len(edges) - 1) if np.any(bins == i)]
    middles = [0.5 * (edges[i] + edges[i + 1]) for i in used]
    shares = [100.0 * np.mean(reached[bins == i]) for i in used]
    axes.plot(middles, shares, marker='o', color=color)


def draw_time(by_scheme: Mapping[str, Rows], facts: Mapping[str, Any], path: Path) -> None:
    """Draw the share of runs that had reached their goals, over time."""
    figure = Figure(figsize=(6.5, 4.0), layout='constrained')
    axes = figure.subplots()
    seconds = (facts['steps'] - 1) * facts['period']
    for i, (scheme, rows) in enumerate(by_scheme.items()):
        times = np.sort(column(rows, 'time_to_reach'))
        shares = 100.0 * np.arange(1, len(times) + 1) / len(rows)
        steps = np.concatenate([[0.0], times, [seconds]])
        heights = np.concatenate([[0.0], shares, shares[-1:] if len(shares) else [0.0]])
        axes.step(steps, heights, where='post', color=COLORS[i % len(COLORS)], label=scheme)
    axes.set_xlim(0.0, seconds)
    axes.set_ylim(0.0, 103.0)
    axes.set_xlabel('time [s]')
    axes.set_ylabel('runs that stay at their goals [%]')
    axes.grid(alpha=0.3)
    axes.legend()
    figure.savefig(path, dpi=130)


def draw_clearance(by_scheme: Mapping[str, Rows], path: Path) -> None:
    """Draw how the least distances of the runs are distributed."""
    figure = Figure(figsize=(6.5, 4.0), layout='constrained')
    axes = figure.subplots()
    _shares(axes, by_scheme, 'clearance', 'no task of the hierarchy keeps a distance')
    _mark(axes, 0.0, 'contact')
    axes.set_xlabel('least distance of a run [m]')
    axes.set_ylabel('runs with at most this distance [%]')
    figure.savefig(path, dpi=130)


def draw_limits(by_scheme: Mapping[str, Rows], path: Path) -> None:
    """Draw how the worst use of velocity, range and acceleration limits is distributed."""
    figure = Figure(figsize=(11.0, 4.0), layout='constrained')
    for axes, (name, words) in zip(
        figure.subplots(1, 3, sharey=True), LIMITS.items(), strict=True
    ):
        _shares(axes, by_scheme, name, f'no limit of {words}')
        _mark(axes, 1.0, 'limit')
        most = max([1.0, *(use for rows in by_scheme.values() for use in column(rows, name))])
        axes.set_xlim(0.0, 1.05 * most)
        axes.set_xlabel(f'worst {words} / limit')
    figure.axes[0].set_ylabel('runs with at most this use [%]')
    figure.savefig(path, dpi=130)


def _mark(axes: Axes, value: float, text: str) -> None:
    axes.axvline(value, color='0.3', linestyle='--', linewidth=1.0)
    axes.annotate(
        text,
        (value, 0.5),
        xycoords=('data', 'axes fraction'),
        xytext=(-4, 0),
        textcoords='offset points',
        rotation=90,
        ha='right',
        va='center',
        color='0.3',
        fontsize=9,
    )


def _shares(axes: Axes, by_scheme: Mapping[str, Rows], name: str, otherwise: str) -> None:
    """Draw the cumulative distribution of a column for every scheme."""
    axes.set_ylim(0.0, 103.0)
    axes.grid(alpha=0.3)
    drawn = False
    for i, (scheme, rows) in enumerate(by_scheme.items()):
        values = np.sort(column(rows, name))
        if not len(values):
            continue
        shares = 100.0 * np.arange(1, len(values) + 1) / len(values)
        axes.step(
            np.concatenate([values[:1], values]),
            np.concatenate([[0.0], shares]),
            where='post',
            color=COLORS[i % len(COLORS)],
            label=scheme,
        )
        drawn = True
    if drawn:
        axes.legend(loc='upper left')
    else:
        axes.text(0.5, 0.5, otherwise, transform=axes.transAxes, ha='center', color='0.4')

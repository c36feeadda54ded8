"""Plots of the comparison."""

from collections.abc import Mapping
from pathlib import Path

import matplotlib as mpl
import numpy as np

mpl.use('Agg')

import matplotlib.pyplot as plt

from field.cases import Case
from field.leak import LIMITS, STACKS, Leak
from field.processes import LIBRARIES
from field.scaling import Curve
from field.timing import Times

COLORS = {
    'recursive': '#08519c',
    'hqp': '#6baed6',
    'OInK': '#d94801',
    'PlaCo': '#31a354',
    'Pink': '#dd1c77',
    'mink': '#756bb1',
}


def plot_times(
    found: Mapping[str, Mapping[str, Times | str]], cases: list[Case], path: Path
) -> None:
    """Median as a bar and 99 % as a line above it, by case and library."""
    figure, axes = plt.subplots(figsize=(10, 4.8), layout='constrained')
    width = 0.8 / len(LIBRARIES)
    for i, library in enumerate(LIBRARIES):
        for j, case in enumerate(cases):
            times, place = found[case.name][library.label], j + (i - 2.5) * width
            if isinstance(times, str):
                where = {'ha': 'center', 'rotation': 90, 'fontsize': 8}
                axes.text(place, 11.0, 'not possible', color=COLORS[library.label], **where)
                continue
            label = library.label if j == 0 else None
            axes.bar(place, times.median, width, color=COLORS[library.label], label=label)
            axes.plot([place, place], [times.median, times.late], color='0.35', linewidth=1)
            axes.plot(place, times.late, '_', color='0.35', markersize=6)
    axes.set_yscale('log')
    axes.set_ylim(bottom=10.0)
    axes.set_xticks(range(len(cases)), [short_title(case) for case in cases], fontsize=9)
    axes.set_ylabel('processor time of a step [µs]')
    axes.set_title('Median (bar) and 99 % (line)', fontsize=10)
    axes.grid(axis='y', alpha=0.3)
    axes.legend(ncols=len(LIBRARIES), loc='upper left', fontsize=9, frameon=False)
    axes.set_ylim(top=axes.get_ylim()[1] * 3.0)
    _save(figure, path)


def short_title(case: Case) -> str:
    """Title of a case in short lines."""
    titles = {
        'planar': 'planar 3R',
        'panda_free': 'Panda',
        'panda_limits': 'Panda,\nlimits',
        'panda_moving': 'Panda,\nlimits and\nacceleration',
        'panda_spheres': 'Panda,\nlimits and\n3 spheres',
        'panda_table': 'Panda,\nwhole arm\nand table',
        'body': 'upper body,\n14 joints,\n6 levels',
    }
    return titles[case.name]


def plot_leaks(found: Mapping[str, Mapping[tuple[str, float], Leak] | str], path: Path) -> None:
    """Share of draws whose first level changes by more than 1 %, by limit."""
    figure, plots = plt.subplots(
        1, len(STACKS), figsize=(10, 3.8), sharey=True, layout='constrained'
    )
    for axes, stack in zip(plots, STACKS, strict=True):
        for library in LIBRARIES:
            leaks = found[library.label]
            if isinstance(leaks, str):
                continue
            shares = [100.0 * leaks[stack, limit].share for limit in LIMITS]
            # Ours lie on one line.
            style = {'recursive': '-', 'hqp': '--'}.get(library.label, '-')
            axes.plot(
                range(len(LIMITS)),
                shares,
                style,
                marker='o' if library.strict else 's',
                color=COLORS[library.label],
                label=library.label + ('' if library.strict else ' (weights)'),
            )
        axes.set_xticks(range(len(LIMITS)), [f'{limit:g}' for limit in LIMITS])
        axes.set_xlabel('velocity limit [rad/s]')
        axes.set_title(f'levels: {stack}', fontsize=10)
        axes.grid(alpha=0.3)
    plots[0].set_ylabel('draws that change the first level\nby more than 1 % [%]')
    plots[-1].legend(fontsize=8, loc='center right')
    _save(figure, path)


def plot_scaling(curves: Mapping[str, Curve], path: Path) -> None:
    """Median of a step against joints, levels and rows, with 99 % as a band."""
    figure, plots = plt.subplots(1, len(curves), figsize=(10, 3.6), layout='constrained')
    for axes, (name, curve) in zip(plots, curves.items(), strict=True):
        for label, points in curve.items():
            sizes = np.array(sorted(points))
            middle = [points[size].median * 1e-3 for size in sizes]
            late = [points[size].late * 1e-3 for size in sizes]
            axes.plot(sizes, middle, 'o-', color=COLORS[label], label=label, markersize=4)
            axes.fill_between(sizes, middle, late, color=COLORS[label], alpha=0.2, linewidth=0)
        axes.set_xlabel(name)
        axes.set_ylim(bottom=0.0)
        axes.grid(alpha=0.3)
    plots[0].set_ylabel('processor time of a step [ms]')
    plots[0].legend(fontsize=9)
    _save(figure, path)


def _save(figure: plt.Figure, path: Path) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=110)
    plt.close(figure)

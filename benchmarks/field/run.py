"""The comparison in one run: times, priority leak and cost; tables and plots for the page."""

import os
import platform
from pathlib import Path

from field import leak, plots, report, scaling, timing
from field.cases import all_cases
from field.processes import LIBRARIES, ROOT

PAGE = ROOT / 'docs' / 'benchmarks.md'
IMAGES = ROOT / 'docs' / 'images'


def run(blocks: int, steps: int, draws: int, page: Path = PAGE) -> None:
    """Measure, print and write the page.

    Parameters
    ----------
    blocks
        Blocks of every library in every case.
    steps
        Steps in a block.
    draws
        Random draws of the leak, at every limit.
    page
        Page with the markers.
    """
    report.write_blocks(
        page,
        {
            'machine': machine(blocks * steps, draws),
            'times': run_times(blocks, steps),
            'leak': run_leak(draws),
            'scaling': run_scaling(steps),
        },
    )


def run_times(blocks: int, steps: int) -> str:
    """Time of a step in every case; the tables for the page."""
    cases = all_cases(blocks * steps)
    found, parts = {}, []
    for case in cases:
        measured = timing.measure(case, steps)
        found[case.name] = {label: times for (label, _), times in measured.items()}
        rows, notes = report.time_rows(found[case.name])
        report.show(case.title, report.HEADERS, rows)
        print(*notes, sep='\n')
        parts += [f'### {case.title}', report.markdown(report.HEADERS, rows), '\n'.join(notes)]
    plots.plot_times(found, cases, IMAGES / 'benchmark_times.png')
    return '\n' + '\n\n'.join(part for part in parts if part) + '\n'


def run_leak(draws: int) -> str:
    """Priority leak; the tables for the page."""
    found, parts = leak.measure(draws), []
    for stack in leak.STACKS:
        rows, notes = report.leak_rows(found, stack)
        title = f'Levels {stack}'
        report.show(f'Priority leak: {title.lower()}', report.leak_headers(), rows)
        parts += [f'### {title}', report.markdown(report.leak_headers(), rows), '\n'.join(notes)]
    plots.plot_leaks(found, IMAGES / 'benchmark_leak.png')
    return '\n' + '\n\n'.join(part for part in parts if part) + '\n'


def run_scaling(count: int) -> str:
    """Cost against joints, levels and rows; the table for the page."""
    curves = {
        'joints': scaling.against_joints(count),
        'levels of 3 rows': scaling.against_levels(count, stacked=False),
        'rows on one level': scaling.against_levels(count, stacked=True),
    }
    headers = ['against', 'solver', 'size', 'median [µs]', '99 % [µs]']
    rows = report.scaling_rows(curves)
    report.show('Cost of a step of ours', headers, rows)
    plots.plot_scaling(curves, IMAGES / 'benchmark_scaling.png')
    return '\n' + report.markdown(headers, rows) + '\n'


def machine(count: int, draws: int) -> str:
    """What the figures were measured with."""
    name = platform.processor() or platform.machine()
    info = Path('/proc/cpuinfo')
    if info.exists():
        lines = info.read_text(encoding='utf-8').splitlines()
        names = [line.split(':', 1)[1].strip() for line in lines if line.startswith('model name')]
        name = names[0] if names else name
    pins = [
        line
        for library in LIBRARIES
        if library.environment
        for line in (ROOT / 'benchmarks' / f'{library.environment}.txt').read_text().splitlines()
        if line.startswith(('roboplan-oink', 'placo', 'pin-pink', 'mink'))
    ]
    return (
        f'{name}, {os.cpu_count()} cores, Python {platform.python_version()}; '
        f'{count} states in every case and {draws} draws of the leak at every limit. '
        f'Versions: {", ".join(pins)}.'
    )

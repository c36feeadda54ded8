"""Tables of the comparison: printed, and written between markers of a page."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from field.leak import LIMITS, Leak
from field.processes import LIBRARIES
from field.scaling import Curve
from field.timing import Times

NONE = '–'
HEADERS = ('library', 'median [µs]', '99 % [µs]', 'recursive / it', 'hqp / it', 'no answer')


def time_rows(found: Mapping[str, Times | str]) -> tuple[list[list[str]], list[str]]:
    """Rows of one case's table, and notes on what is missing.

    Parameters
    ----------
    found
        Times by label, or why there are none.
    """
    whole = max(
        (len(times.durations) for times in found.values() if isinstance(times, Times)), default=0
    )
    medians = {label: times.median for label, times in found.items() if isinstance(times, Times)}
    rows, notes = [], []
    for library in LIBRARIES:
        label = library.label
        times = found[label]
        if isinstance(times, str):
            rows.append([label, *[NONE] * (len(HEADERS) - 1)])
            notes.append(f'{label}: {times}.')
            continue
        ratios = [
            f'{medians[own] / times.median:.2f}' if own in medians else NONE
            for own in ('recursive', 'hqp')
        ]
        lost = f'{100.0 * times.failed / len(times.durations):.1f} %' if times.failed else '0'
        rows.append([label, f'{times.median:.1f}', f'{times.late:.1f}', *ratios, lost])
        if times.failed:
            notes.append(f'{label} without an answer: {shortened(times.reason)}')
        if len(times.durations) < whole:
            notes.append(f'{label}: timed for {len(times.durations)} of {whole} steps.')
    return rows, notes


def leak_rows(
    found: Mapping[str, Mapping[tuple[str, float], Leak] | str], stack: str
) -> tuple[list[list[str]], list[str]]:
    """Rows of the leak's table of one stack: share above 1 %, median, largest at every limit."""
    rows, notes = [], []
    for library in LIBRARIES:
        leaks = found[library.label]
        if isinstance(leaks, str):
            rows.append([library.label, *[NONE] * (len(LIMITS) + 1)])
            notes.append(f'{library.label}: {leaks}.')
            continue
        cells, lost, drawn, reason = [], 0, 0, ''
        for limit in LIMITS:
            leak = leaks[stack, limit]
            lost, drawn = lost + leak.failed, drawn + leak.failed + len(leak.changes)
            cells.append(leak_cell(leak))
            reason = leak.reason or reason
        rows.append([library.label, *cells, f'{100.0 * lost / drawn:.1f} %' if lost else '0'])
        if lost:
            notes.append(f'{library.label} without an answer: {shortened(reason)}')
    return rows, notes


def leak_cell(leak: Leak) -> str:
    """Share of draws above 1 %, then median and largest change."""
    if not len(leak.changes):
        return NONE
    middle, most = float(np.median(leak.changes)), float(leak.changes.max())
    return f'{100.0 * leak.share:.0f} % ({middle:.1g}, {most:.1g})'


def leak_headers() -> list[str]:
    """Headers of the leak's table."""
    return ['library', *(f'{limit:g} rad/s' for limit in LIMITS), 'no answer']


def scaling_rows(curves: Mapping[str, Curve]) -> list[list[str]]:
    """Rows of the table of costs: smallest and largest size of every curve."""
    rows = []
    for name, curve in curves.items():
        for label, points in curve.items():
            for size in (min(points), max(points)):
                times = points[size]
                rows.append([name, label, str(size), f'{times.median:.1f}', f'{times.late:.1f}'])
    return rows


def shortened(text: str, most: int = 110) -> str:
    """First line of a message."""
    line = text.strip().splitlines()[0]
    return line if len(line) <= most else f'{line[:most]} …'


def show(title: str, headers: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Print a table."""
    table = Table(title=title, title_style='bold')
    for i, header in enumerate(headers):
        table.add_column(header, justify='right' if i else 'left')
    for row in rows:
        table.add_row(*row)
    Console(width=max(110, Console().width)).print(table)


def markdown(headers: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return the same table for a page."""
    lines = [headers, ['---', *['---:'] * (len(headers) - 1)], *rows]
    return '\n'.join(f'| {" | ".join(line)} |' for line in lines)


def replace_block(text: str, name: str, body: str) -> str:
    """Put a body between the markers ``<!-- name -->`` and ``<!-- end of name -->``.

    Raises
    ------
    ValueError
        If the text does not have both, in this order.
    """
    first, last = f'<!-- {name} -->', f'<!-- end of {name} -->'
    before, found, rest = text.partition(first)
    _, closed, after = rest.partition(last)
    if not found or not closed:
        raise ValueError(f'no block between {first} and {last}')
    return f'{before}{first}\n{body}\n{last}{after}'


def write_blocks(page: Path, blocks: Mapping[str, str]) -> None:
    """Write bodies between the markers of a page."""
    text = page.read_text(encoding='utf-8')
    for name, body in blocks.items():
        text = replace_block(text, name, body)
    page.write_text(text, encoding='utf-8')

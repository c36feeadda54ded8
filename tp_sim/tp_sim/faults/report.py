"""The table in the terminal and on a page of the documentation."""

from __future__ import annotations

import math
import os
import platform
from collections.abc import Callable, Sequence
from pathlib import Path

from rich.markup import escape
from rich.table import Table

from tp_controller.errors import InvalidValue
from tp_sim.faults.case import Outcome

BEGIN, END = '<!-- begin: {} -->', '<!-- end: {} -->'

COLUMNS: tuple[tuple[str, Callable[[Outcome], str]], ...] = (
    ('case', lambda row: row.case.name),
    ('speed', lambda row: f'{row.found.speed:.3f}'),
    ('change', lambda row: f'{row.found.change:.3f}' if row.found.change else '–'),
    ('data [ms]', lambda row: f'{1e3 * row.found.age:.0f}'),
    ('gap [ms]', lambda row: f'{1e3 * row.found.gap:.0f}'),
    ('moves [s]', lambda row: seconds(row.recovery)),
    ('goal [s]', lambda row: seconds(row.way)),
    ('pause [ms]', lambda row: f'{1e3 * row.pause:.0f}'),
    ('', lambda row: 'passed' if row.passed else 'FAILED'),
)


def seconds(value: float) -> str:
    """Time [s] in few digits, a dash if there is none."""
    return '–' if math.isnan(value) else f'{value:.2f}'


def terminal_table(rows: Sequence[Outcome]) -> Table:
    """Table of the cases so far."""
    table = Table(title='Faults, each with real nodes in real time', title_style='bold')
    for name, _ in COLUMNS:
        table.add_column(name, justify='left' if name in ('case', '') else 'right', no_wrap=True)
    for row in rows:
        cells = [escape(value(row)) for _, value in COLUMNS]
        table.add_row(*cells, style=None if row.passed else 'red')
    return table


def page_table(rows: Sequence[Outcome]) -> str:
    """Table of all cases in Markdown."""
    names = (
        'case',
        'what is done',
        'allowed beside the rules',
        *(name for name, _ in COLUMNS[1:]),
    )
    right = {name for name, _ in COLUMNS[1:-1]}
    lines = [
        f'| {" | ".join(names)} |',
        f'|{"|".join("---:" if name in right else "---" for name in names)}|',
    ]
    for row in rows:
        first, *others = (value(row) for _, value in COLUMNS)
        cells = (f'`{first}`', row.case.done, row.case.allowed, *others)
        lines.append(f'| {" | ".join(cells)} |')
    notes = [f'- `{row.case.name}`: {"; ".join(row.notes)}' for row in rows if row.notes]
    failed = [f'- `{row.case.name}`: {text}' for row in rows for text in row.found.wrong]
    load = max((row.load for row in rows), default=0.0)
    passed = sum(row.passed for row in rows)
    minutes = sum(row.seconds for row in rows) / 60.0
    end = (
        f'{passed} of {len(rows)} passed, in {minutes:.0f} minutes on '
        f'{os.cpu_count()} cores ({platform.machine()}, load up to {load:.1f}).'
    )
    parts = ['\n'.join(lines), end]
    parts += ['\n'.join(part) for part in (notes, failed) if part]
    return '\n\n'.join(parts)


def write_section(path: Path, name: str, text: str) -> None:
    """Replace what stands between the marks of a name on a page.

    Raises
    ------
    InvalidValue
        If the page cannot be read or has no such marks.
    """
    begin, end = BEGIN.format(name), END.format(name)
    try:
        page = path.read_text(encoding='utf-8')
    except OSError as error:
        raise InvalidValue(str(path), error.strerror or 'no file', 'a page to write to') from None
    before, mark, rest = page.partition(begin)
    _, other, after = rest.partition(end)
    if not mark or not other:
        raise InvalidValue(str(path), 'no marks', f'{begin} and {end}')
    path.write_text(f'{before}{begin}\n\n{text}\n\n{end}{after}', encoding='utf-8')

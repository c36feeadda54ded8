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


def page_table(rows: Sequence[Outcome], before: str = '') -> str:
    """Table of cases in Markdown.

    Parameters
    ----------
    rows
        Cases that were run.
    before
        What stood there before: lines of other cases stay.
    """
    columns = [name for name, _ in COLUMNS[1:]]
    names = ('case', 'what is done', 'allowed beside the rules', *columns)
    right = set(columns[:-1])
    lines = {_key(line): line for line in before.splitlines() if line.startswith(('| `', '- `'))}
    for row in rows:
        first, *others = (value(row) for _, value in COLUMNS)
        cells = (f'`{first}`', row.case.done, row.case.allowed, *others)
        lines[f'| `{first}`'] = f'| {" | ".join(cells)} |'
        told = '; '.join([*row.notes, *row.found.wrong])
        lines[f'- `{first}`'] = f'- `{first}`: {told}' if told else ''
    table = [line for line in lines.values() if line.startswith('|')]
    notes = [line for line in lines.values() if line.startswith('-')]
    passed = sum(line.endswith('| passed |') for line in table)
    load = max((row.load for row in rows), default=0.0)
    head = [
        f'| {" | ".join(names)} |',
        f'|{"|".join("---:" if name in right else "---" for name in names)}|',
    ]
    end = (
        f'{passed} of {len(table)} passed, on {os.cpu_count()} cores ({platform.machine()}) with '
        f'a load of up to {load:.0f}.'
    )
    return '\n\n'.join('\n'.join(part) for part in ([*head, *table], [end], notes) if part)


def _key(line: str) -> str:
    """Kind and case of a line on the page."""
    return '`'.join(line.split('`')[:2]) + '`'


def read_section(path: Path, name: str) -> str:
    """What stands between the marks of a name on a page; see `write_section`."""
    return _parts(path, name)[1]


def write_section(path: Path, name: str, text: str) -> None:
    """Replace what stands between the marks of a name on a page.

    Raises
    ------
    InvalidValue
        If the page cannot be read or has no such marks.
    """
    before, _, after = _parts(path, name)
    path.write_text(f'{before}\n\n{text}\n\n{after}', encoding='utf-8')


def _parts(path: Path, name: str) -> tuple[str, str, str]:
    """Page until the first mark of a name, what is between the two, and the rest."""
    begin, end = BEGIN.format(name), END.format(name)
    try:
        page = path.read_text(encoding='utf-8')
    except OSError as error:
        raise InvalidValue(str(path), error.strerror or 'no file', 'a page to write to') from None
    before, mark, rest = page.partition(begin)
    between, other, after = rest.partition(end)
    if not mark or not other:
        raise InvalidValue(str(path), 'no marks', f'{begin} and {end}')
    return before + mark, between, other + after

"""Tables of what benchmarks/reach.py has found, printed or written into docs/real_arms.md."""

from __future__ import annotations

import io
import json
import math
from pathlib import Path
from typing import Any

from draws import ARMS
from rich.console import Console
from rich.table import Table

PAGE = Path(__file__).resolve().parent.parent / 'docs' / 'real_arms.md'
WIDTH = 108
OWN = {
    'arrived': 'reached',
    'late': 'late',
    'end': 'end',
    'singular': 'singular',
    'other': 'other',
    'no ends': 'no ends',
    'from it': 'from it',
}
"""Heads of the first table by key."""
OTHERS = ('OInK', 'PlaCo', 'Pink')
SAID = (
    '{count} draws per arm; position alone: within 1 mm. Not reached in time: late, there after '
    '40 s; end, a joint was held at the end of its range in the last second; singular, in the '
    'region where damping acts. No ends: the same draws where joints have speeds but no ends. '
    'From it: the same goals from the posture.'
)
SAID_OF_OTHERS = (
    'Reached: as above. Around: with a way around, in up to 30 s; then, for the goals that the '
    'straight way does not lead to, medians of the time to find configurations, the time to plan '
    'a way, and the length of the motion over that of the straight line in joint space. OInK, '
    'PlaCo and Pink: 10 s per goal with the same gains, ranges and speeds, and no limits of '
    'acceleration, which PlaCo does not have; –: the levels cannot be had.'
)
IMPOSSIBLE = {('OInK', 'position, orientation')}
"""All six rows of a frame are projected out below a position of OInK: nothing is left of the
orientation."""


def _kept(folder: Path) -> dict[str, Any]:
    found = {}
    for arm in ARMS:
        path = folder / f'{arm}.json'
        if path.exists():
            found[arm] = json.loads(path.read_text(encoding='utf-8'))
    return found


def _tables(console: Console, kept: dict[str, Any]) -> None:
    """Print both tables."""
    first = Table(title='Goals reached within 1 mm and 0.1° in 10 s [%]')
    second = Table(title='With a way around, and by other libraries [%]')
    for table in (first, second):
        table.add_column('arm')
        table.add_column('over the posture', no_wrap=True)
    for head in OWN.values():
        first.add_column(head, justify='right')
    for head in ('reached', 'around', 'find [s]', 'plan [s]', 'length', *OTHERS):
        second.add_column(head, justify='right')
    for arm, found in kept.items():
        for levels, own in found['own'].items():
            first.add_row(ARMS[arm], levels, *(f'{own[key]:.1f}' for key in OWN))
            cells = [f'{own["arrived"]:.1f}', f'{own["around"]:.1f}']
            cells += [_number(own[key], 3) for key in ('find', 'plan')]
            cells += [_number(own['length'], 2)]
            cells += [_share(name, levels, found['others']) for name in OTHERS]
            second.add_row(ARMS[arm], levels, *cells)
        first.add_section()
        second.add_section()
    counts = sorted({found['count'] for found in kept.values()})
    console.print(first)
    console.print(SAID.format(count=' or '.join(map(str, counts))))
    console.print()
    console.print(second)
    console.print(SAID_OF_OTHERS)


def _number(value: float, digits: int) -> str:
    return '–' if math.isnan(value) else f'{value:.{digits}f}'


def _share(name: str, levels: str, others: dict[str, Any]) -> str:
    share = others.get(name, {}).get(levels, 'not tried')
    if isinstance(share, str) or (name, levels) in IMPOSSIBLE:
        return '–'
    return f'{share:.1f}'


def show(folder: Path) -> None:
    """Print the tables of all arms that are kept."""
    _tables(Console(width=WIDTH), _kept(folder))


def write(folder: Path) -> None:
    """Put the tables in place of the first fence of text in the page.

    Raises
    ------
    SystemExit
        If a part is missing.
    """
    kept = _kept(folder)
    whole = [arm for arm, one in kept.items() if len(one['own']) == 3 and len(one['others']) == 3]
    if missing := [arm for arm in ARMS if arm not in whole]:
        raise SystemExit(f'not written: not all is tried of {", ".join(missing)}')
    console = Console(width=WIDTH, file=io.StringIO(), record=True)
    _tables(console, kept)
    text = PAGE.read_text(encoding='utf-8')
    begin, end = '```text\n', '\n```\n'
    before, rest = text.split(begin, 1)
    after = rest.split(end, 1)[1]
    lines = '\n'.join(line.rstrip() for line in console.export_text().splitlines())
    PAGE.write_text(f'{before}{begin}{lines}{end}{after}', encoding='utf-8')

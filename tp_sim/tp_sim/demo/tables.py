"""Tables in the terminal."""

from __future__ import annotations

from rich.markup import escape
from rich.table import Table

from tp_sim.demo.script import Leg


def outcome_table(legs: list[Leg], tolerance: float) -> Table:
    """Table of the error of every task at the end of every goal."""
    title = f'Error norm [m, rad] at the end of each goal; reached within {tolerance:g}'
    table = Table(title=escape(title))
    table.add_column('goal')
    names = list(dict.fromkeys(name for leg in legs for name in leg.errors))
    for name in names:
        table.add_column(name, justify='right')
    table.add_column('reached')
    for leg in legs:
        cells = [f'{leg.errors[name]:.5f}' if name in leg.errors else '' for name in names]
        verdict = '[green]yes[/green]' if leg.reached(tolerance) else '[red]no[/red]'
        table.add_row(leg.text, *cells, verdict)
    return table


def reason_lines(legs: list[Leg], tolerance: float) -> list[str]:
    """One line for every goal that was not reached: why."""
    return [
        f'goal {number} not reached: {escape(leg.reason(tolerance))}'
        for number, leg in enumerate(legs, start=1)
        if not leg.reached(tolerance)
    ]

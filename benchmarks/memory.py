"""Resident memory of both nodes over many cycles in lockstep."""

from pathlib import Path

from rich.console import Console
from rich.markup import escape
from rich.table import Table
from std_srvs.srv import SetBool

from tp_sim.harness import ClosedLoop

CONFIG = Path(__file__).resolve().parent.parent / 'config' / 'a4_position_joint.yaml'
MEGABYTE = 1e6
LARGEST_GROWTH = 5.0
"""Megabytes."""


def run(cycles: int) -> bool:
    """Measure and print; return whether the memory stays flat."""
    rows = []
    with ClosedLoop(CONFIG) as loop:
        loop.client.on_state[:] = []
        loop.client.call(SetBool, 'tp_sim/pause', SetBool.Request(data=False))
        for tenth in range(11):
            # The first tenth is left out of the growth: buffers fill and caches warm up.
            due = cycles * tenth // 10
            loop.client.wait_for(lambda due=due: loop.state.cycles >= due, 'cycles', 600.0)
            memory = [
                process.resident_memory / MEGABYTE for process in (loop.controller, loop.simulator)
            ]
            rows.append((loop.state.cycles, *memory))
    table = Table(title=escape(f'Resident memory [MB] over {cycles} cycles in lockstep'))
    for column in ('cycles', 'controller', 'simulator'):
        table.add_column(column, justify='right')
    for count, *memory in rows:
        table.add_row(str(count), *(f'{value:.1f}' for value in memory))
    growth = [max(column[1:]) - column[1] for column in zip(*rows, strict=True)][1:]
    console = Console(width=100)
    console.print(table)
    console.print(
        f'Growth after the first tenth: controller {growth[0]:.1f} MB, '
        f'simulator {growth[1]:.1f} MB'
    )
    return max(growth) < LARGEST_GROWTH

"""Thousands of closed loops without ROS: random starts, goals, gains and schemes on all cores."""

from tp_controller.batch.draws import Draw, draw_run
from tp_controller.batch.engine import run_batch
from tp_controller.batch.loop import Trace, close_loop, fresh_stack
from tp_controller.batch.plan import Batch, plan_batch
from tp_controller.batch.table import read_runs, write_runs

__all__ = [
    'Batch',
    'Draw',
    'Trace',
    'close_loop',
    'draw_run',
    'fresh_stack',
    'plan_batch',
    'read_runs',
    'run_batch',
    'write_runs',
]

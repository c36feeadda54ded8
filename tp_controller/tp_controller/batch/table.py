"""Results of a batch as a table, and as a Parquet file."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tp_controller.errors import InvalidValue

if TYPE_CHECKING:
    import pyarrow as pa

    from tp_controller.batch.plan import Batch

FILE = 'runs.parquet'
PLOTS = ('success.png', 'time.png', 'clearance.png', 'limits.png')
KEY = b'tp_controller.batch'
"""Metadata of a file that this package wrote: what was run, as JSON."""


def table_of(batch: Batch, rows: Sequence[dict[str, Any]]) -> pa.Table:
    """Make a table of rows, with the batch in its metadata.

    Parameters
    ----------
    batch
        What was run.
    rows
        One dictionary per run, by column.
    """
    import pyarrow as pa

    values = pa.list_(pa.field('element', pa.float64()))
    fields = [
        ('seed', pa.int64()),
        ('run', pa.int64()),
        ('scheme', pa.string()),
        ('gain', pa.float64()),
        ('start', values),
        ('goal', values),
        ('reached', pa.bool_()),
        ('time_to_reach', pa.float64()),
        *((f'error_{name}', pa.float64()) for name in batch.errors),
        ('clearance', pa.float64()),
        ('velocity_use', pa.float64()),
        ('range_use', pa.float64()),
        ('acceleration_use', pa.float64()),
        ('braked', pa.int64()),
        ('refused', pa.int64()),
        ('reversals', pa.int64()),
    ]
    about = {
        'schemes': batch.schemes,
        'runs': batch.runs,
        'seed': batch.seed,
        'steps': batch.steps,
        'period': batch.period,
        'goals': batch.goals,
        'gain': batch.gain,
        'tolerance': batch.tolerance,
        'start': batch.start,
        'parameters': batch.values,
    }
    schema = pa.schema(fields, metadata={KEY: json.dumps(about).encode()})
    return pa.Table.from_pylist(list(rows), schema)


def check_folder(folder: Path) -> None:
    """Check that results may be written to a folder, before anything is run.

    Files of an earlier batch are written over; others are not.

    Raises
    ------
    InvalidValue
        If it is a file, cannot be made or written to, or has files of these names that are not
        of a batch.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        reason = 'a file' if folder.is_file() else str(error.strerror)
        raise InvalidValue(f'out: {folder}', reason, 'a folder, or a name for one') from None
    if not os.access(folder, os.W_OK):
        raise InvalidValue(f'out: {folder}', 'no permission to write', 'a folder to write to')
    found = [name for name in (FILE, *PLOTS) if (folder / name).exists()]
    if found and not (found[0] == FILE and is_ours(folder / FILE)):
        raise InvalidValue(
            f'out: {folder / found[0]}',
            'a file that no batch wrote',
            'a new or empty folder, or that of an earlier batch',
        )


def is_ours(path: Path) -> bool:
    """Whether a file is the result of a batch."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        return KEY in (pq.read_schema(path).metadata or {})
    except (OSError, pa.ArrowException):
        return False


def write_runs(table: pa.Table, path: Path) -> None:
    """Write the table of a batch as a Parquet file, at once or not at all."""
    import pyarrow.parquet as pq

    part = path.with_name(f'.{path.name}.part')
    pq.write_table(table, part)
    part.replace(path)


def read_runs(path: Path) -> pa.Table:
    """Read the table of a batch.

    Raises
    ------
    InvalidValue
        If the file is not the result of a batch.
    """
    import pyarrow.parquet as pq

    if not is_ours(path):
        raise InvalidValue(str(path), 'no table of a batch', f'a {FILE} that a batch wrote')
    return pq.read_table(path)


def about(table: pa.Table) -> dict[str, Any]:
    """What was run, from the metadata of a table."""
    return json.loads(table.schema.metadata[KEY])


def column(rows: Iterable[dict[str, Any]], name: str) -> list[Any]:
    """Values of a column that are there."""
    return [row[name] for row in rows if row[name] is not None]

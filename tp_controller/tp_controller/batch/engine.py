"""Runs a batch with Dask: in processes of this machine, or on a cluster."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from tp_controller.batch.measures import Row, Runner
from tp_controller.batch.plan import Batch
from tp_controller.batch.table import table_of
from tp_controller.errors import InvalidValue, shown

if TYPE_CHECKING:
    import pyarrow as pa

PATIENCE = 10.0
"""Time [s] to find a cluster, and then a worker of it."""
PARTS, LONGEST_PART = 16, 50
"""Parts of the work per worker, so that all end together; most runs in one of them."""
KEPT = 8
"""Controllers that a worker keeps."""
ADDRESS = 'the address of a Dask scheduler that runs, such as tcp://127.0.0.1:8786'

_own = threading.local()
"""Controllers of this thread: a cluster's worker may have several threads."""


def run_batch(
    batch: Batch,
    scheduler: str | None = None,
    workers: int | None = None,
    progress: Callable[[int], None] | None = None,
) -> pa.Table:
    """Run a batch.

    The result depends on the batch alone: not on the number of workers, nor on who does what.
    A script that calls this without ``scheduler`` needs the usual
    ``if __name__ == '__main__':``, because the workers are new processes that import it.

    Parameters
    ----------
    batch
        The batch.
    scheduler
        Address of a Dask scheduler; None for processes of this machine, which end with the
        batch. The cluster's workers need the same version of this package.
    workers
        Number of processes of this machine, one per core when left out.
    progress
        Called with the number of runs that have just been done.

    Returns
    -------
    pyarrow.Table
        One row per scheme and run, in this order; columns as in docs/batches.md.

    Raises
    ------
    InvalidValue
        If ``scheduler`` or ``workers`` cannot be used; if the connection to the scheduler is
        lost, or workers end again and again.
    """
    check_engine(scheduler, workers)
    with _connected(scheduler, workers) as client:
        from distributed import as_completed
        from distributed.client import FutureCancelledError
        from distributed.comm import CommClosedError
        from distributed.scheduler import KilledWorker

        threads = max(sum(client.nthreads().values()), 1)
        parts = _parts(batch, threads)
        futures = [client.submit(run_part, batch, *part, pure=False) for part in parts]
        rows: dict[tuple[int, int], Row] = {}
        try:
            for future in as_completed(futures, loop=client.loop):
                found = future.result()
                for row in found:
                    rows[batch.schemes.index(row['scheme']), row['run']] = row
                if progress is not None:
                    progress(len(found))
        except KilledWorker:
            reason = 'workers that ended several times in the same runs'
            raise InvalidValue('workers', reason, 'workers with enough memory') from None
        except (FutureCancelledError, CommClosedError):
            reason = f'{shown(scheduler)}, then no answer any more'
            raise InvalidValue('scheduler', reason, ADDRESS) from None
        finally:
            client.cancel(futures)
    return table_of(batch, [rows[key] for key in sorted(rows)])


def check_engine(scheduler: str | None, workers: int | None) -> None:
    """Check what can be checked without a connection.

    Raises
    ------
    InvalidValue
        If ``scheduler`` or ``workers`` cannot be used.
    """
    if workers is not None:
        if scheduler is not None:
            accepts = 'no number together with scheduler: the cluster has its own workers'
            raise InvalidValue('workers', shown(workers), accepts)
        if isinstance(workers, bool) or not isinstance(workers, int) or workers < 1:
            raise InvalidValue('workers', shown(workers), 'a whole number of at least 1')
    if scheduler is not None and '://' not in scheduler:
        raise InvalidValue('scheduler', shown(scheduler), ADDRESS)


def run_part(batch: Batch, scheme: str, first: int, last: int) -> list[Row]:
    """Make runs ``first`` to ``last - 1`` of a batch under a scheme; called by the workers."""
    runner = _runner(batch, scheme)
    return [runner.run(run) for run in range(first, last)]


def _runner(batch: Batch, scheme: str) -> Runner:
    """Controller of a batch and scheme, built once in each thread."""
    kept: dict[str, Runner] = _own.__dict__
    key = f'{scheme} {batch!r}'
    if key not in kept:
        if len(kept) >= KEPT:
            kept.clear()
        kept[key] = Runner(batch, scheme)
    return kept[key]


def _parts(batch: Batch, threads: int) -> list[tuple[str, int, int]]:
    size = -(-batch.runs * len(batch.schemes) // (PARTS * threads))
    size = min(max(size, 1), LONGEST_PART)
    return [
        (scheme, first, min(first + size, batch.runs))
        for scheme in batch.schemes
        for first in range(0, batch.runs, size)
    ]


@contextmanager
def _connected(scheduler: str | None, workers: int | None) -> Iterator[Any]:
    """Client of a cluster that has a worker; an own cluster ends with it."""
    import dask
    from dask.system import CPU_COUNT
    from distributed import Client, LocalCluster

    if scheduler is None:
        with (
            # Sampling the workers' stacks costs some per cent of their time.
            dask.config.set({'distributed.worker.profile.enabled': False}),
            LocalCluster(
                n_workers=workers or CPU_COUNT,
                threads_per_worker=1,
                memory_limit=0,
                dashboard_address='127.0.0.1:0',
                silence_logs=logging.CRITICAL,
            ) as cluster,
            Client(cluster) as client,
        ):
            yield client
        return
    try:
        client = Client(scheduler, timeout=PATIENCE, set_as_default=False)
    except (OSError, ValueError) as error:
        reason = 'no answer' if isinstance(error, OSError) else str(error)
        raise InvalidValue('scheduler', f'{shown(scheduler)}: {reason}', ADDRESS) from None
    with client:
        _check_workers(client, scheduler)
        yield client


def _check_workers(client: Any, scheduler: str) -> None:
    accepts = 'a cluster with workers that can import this version of tp_controller'
    try:
        client.wait_for_workers(1, timeout=PATIENCE)
        client.submit(_probe, pure=False).result(PATIENCE)
    except TimeoutError:
        raise InvalidValue('scheduler', f'{shown(scheduler)} without workers', accepts) from None
    except Exception as error:
        reason = f'{shown(scheduler)}: {type(error).__name__} in a worker: {error}'
        raise InvalidValue('scheduler', ' '.join(reason.split()), accepts) from None


def _probe() -> None:
    """Tell by being called that a worker can import this module."""

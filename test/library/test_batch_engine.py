"""Batches on Dask: the same results from any number of workers, and what a user can get wrong."""

import socket
import subprocess
import sys
from pathlib import Path

import pyarrow.parquet as pq
import pytest
from distributed import LocalCluster

import tp_controller
from tp_controller import InvalidValue, read_parameter_file
from tp_controller.batch import plan_batch, read_runs, run_batch, write_runs
from tp_controller.batch.command import main
from tp_controller.batch.engine import run_part
from tp_controller.batch.plots import wilson
from tp_controller.batch.table import FILE, PLOTS, check_folder, table_of

RUNS, SEED = 5, 2
QUIET = {'dashboard_address': '127.0.0.1:0'}
SCHEMES = ['recursive', 'hqp']
OPTIONS = ['--runs', str(RUNS), '--seed', str(SEED), '--seconds', '0.3', '--gain', '0.5', '2']
COLUMNS = [
    'seed',
    'run',
    'scheme',
    'gain',
    'start',
    'goal',
    'reached',
    'time_to_reach',
    'error_ee_position',
    'clearance',
    'velocity_use',
    'range_use',
    'acceleration_use',
    'braked',
    'refused',
    'reversals',
]


@pytest.fixture(scope='module')
def file(config):
    return config / 'b3_pressed.yaml'


@pytest.fixture(scope='module')
def batch(file):
    values = read_parameter_file(file, 'tp_controller')
    return plan_batch(values, SCHEMES, RUNS, SEED, 0.3, gain=(0.5, 2.0))


@pytest.fixture(scope='module')
def expected(batch):
    """Table of the batch, made in this process without Dask."""
    rows = [row for scheme in SCHEMES for row in run_part(batch, scheme, 0, RUNS)]
    return table_of(batch, rows)


@pytest.fixture(scope='module')
def cluster():
    """Cluster of two workers with one thread each, in threads of this process."""
    with LocalCluster(
        n_workers=2, threads_per_worker=1, processes=False, protocol='tcp', **QUIET
    ) as running:
        yield running


def test_processes_of_this_machine_and_a_cluster_give_the_same_table(batch, expected, cluster):
    done = []
    assert run_batch(batch, cluster.scheduler_address, progress=done.append).equals(expected)
    assert sum(done) == RUNS * len(SCHEMES)
    assert run_batch(batch, workers=1).equals(expected)


def test_a_worker_with_several_threads_gives_the_same_table(batch, expected):
    with LocalCluster(n_workers=1, threads_per_worker=3, processes=False, **QUIET) as running:
        assert run_batch(batch, running.scheduler_address).equals(expected)


def test_the_command_writes_a_table_and_plots(file, cluster, expected, tmp_path, capsys):
    out = tmp_path / 'new' / 'folder'
    arguments = ['--config', str(file), '--out', str(out), '--schemes', *SCHEMES, *OPTIONS]
    arguments += ['--scheduler', cluster.scheduler_address]
    assert main(arguments) == 0
    captured = capsys.readouterr()
    assert f'{RUNS * len(SCHEMES)} of {RUNS * len(SCHEMES)} runs' in captured.err
    assert f'b3_pressed.yaml: {RUNS} runs of 0.3 s' in captured.out
    assert '190 cycles in' in captured.out
    table = read_runs(out / FILE)
    assert table.column_names == COLUMNS
    assert table.equals(expected)
    assert pq.read_table(out / FILE).num_rows == RUNS * len(SCHEMES)
    for name in PLOTS:
        assert (out / name).read_bytes().startswith(b'\x89PNG')
    assert sorted(path.name for path in out.iterdir()) == sorted([FILE, *PLOTS])
    check_folder(out)  # an earlier batch may be written over


def test_files_of_others_are_not_written_over(file, tmp_path, capsys, expected):
    arguments = ['--config', str(file), '--runs', '1', '--out']
    (tmp_path / 'success.png').write_text('mine')
    assert main([*arguments, str(tmp_path)]) == 2
    error = capsys.readouterr().err
    assert error == (
        f'batch: out: {tmp_path}/success.png: got a file that no batch wrote; accepts a new or '
        'empty folder, or that of an earlier batch\n'
    )
    foreign = tmp_path / 'foreign'
    foreign.mkdir()
    pq.write_table(expected.replace_schema_metadata({}), foreign / FILE)
    assert main([*arguments, str(foreign)]) == 2
    assert f'{foreign}/{FILE}: got a file that no batch wrote' in capsys.readouterr().err
    assert main([*arguments, str(tmp_path / 'success.png')]) == 2
    assert 'got a file; accepts a folder' in capsys.readouterr().err
    with pytest.raises(InvalidValue, match='no table of a batch'):
        read_runs(foreign / FILE)
    with pytest.raises(InvalidValue, match='no table of a batch'):
        read_runs(tmp_path / 'success.png')


def test_a_table_that_was_written_is_read_again(expected, tmp_path):
    write_runs(expected, tmp_path / FILE)
    assert read_runs(tmp_path / FILE).equals(expected, check_metadata=True)


def closed_port():
    with socket.socket() as free:
        free.bind(('127.0.0.1', 0))
        return free.getsockname()[1]


@pytest.mark.parametrize(
    ('given', 'message'),
    [
        (['--runs', '0'], 'batch: runs: got 0; accepts a whole number of at least 1'),
        (['--schemes', 'fast'], "batch: schemes: got 'fast'; accepts some of recursive, "),
        (['--workers', '0'], 'batch: workers: got 0; accepts a whole number of at least 1'),
        (['--scheduler', 'here'], "batch: scheduler: got 'here'; accepts the address of a Dask"),
        (['--scheduler', 'no://1'], "batch: scheduler: got 'no://1': "),
        (['--scheduler', 'tcp://a:1', '--workers', '2'], 'batch: workers: got 2; accepts no num'),
        (['--scheduler', 'tcp://127.0.0.1:{port}'], 'no answer; accepts the address of a Dask'),
        (['--runs', 'many'], "batch: argument --runs: invalid int value: 'many' (--help"),
        (['--config', 'none.yaml'], 'batch: none.yaml: got No such file or directory; accepts'),
        (['--config', '{no_rate}'], 'no_rate.yaml: rate: got no value; accepts a number above 0'),
    ],
)
def test_what_a_user_gets_wrong_is_one_line(given, message, file, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr('tp_controller.batch.engine.PATIENCE', 0.5)
    text = file.with_name('a1_position.yaml').read_text().replace('    rate: 60.0', '')
    (tmp_path / 'no_rate.yaml').write_text(text)
    places = {'port': closed_port(), 'no_rate': tmp_path / 'no_rate.yaml'}
    arguments = [text.format(**places) for text in given]
    try:
        status = main(['--config', str(file), '--out', str(tmp_path / 'out'), *arguments])
    except SystemExit as exit_:
        status = exit_.code
    captured = capsys.readouterr()
    assert status == 2
    assert captured.out == ''
    assert message in captured.err
    assert captured.err.splitlines()[-1].startswith('batch: ')


def test_a_cluster_without_workers_is_refused(batch, monkeypatch):
    monkeypatch.setattr('tp_controller.batch.engine.PATIENCE', 0.5)
    with (
        LocalCluster(n_workers=0, processes=False, **QUIET) as empty,
        pytest.raises(InvalidValue, match='without workers; accepts a cluster with workers'),
    ):
        run_batch(batch, empty.scheduler_address)


def test_a_scheduler_that_is_lost_is_one_line(batch):
    with LocalCluster(n_workers=1, threads_per_worker=1, processes=False, **QUIET) as running:

        def lose(_):
            running.close()

        with pytest.raises(InvalidValue, match='then no answer any more; accepts the address'):
            run_batch(batch, running.scheduler_address, progress=lose)


def test_dask_arrow_and_matplotlib_are_loaded_by_a_batch_only():
    script = """
import sys, tp_controller.batch
print(*(name for name in ('dask', 'distributed', 'pyarrow', 'matplotlib') if name in sys.modules))
"""
    code = [sys.executable, '-c', script]
    done = subprocess.run(code, capture_output=True, text=True, timeout=60, check=True)
    assert done.stdout == '\n'
    package = Path(tp_controller.__file__).parent
    for path in package.rglob('*.py'):
        if path.parent.name != 'batch':
            assert 'tp_controller.batch' not in path.read_text(encoding='utf-8'), path


def test_the_interval_of_a_share():
    assert wilson(50, 100) == pytest.approx((0.4038, 0.5962), abs=1e-4)
    assert wilson(0, 10) == pytest.approx((0.0, 0.2775), abs=1e-4)

"""What a recording costs the controller, and how large it is.

    python benchmarks/record_cost.py [CONFIG] [--rounds 4] [--seconds 8]

The loop runs at 500 Hz, with somebody who listens to the state all the time. Rounds without and
with `record` take turns, so that what else the machine does counts for both.
"""

import argparse
import os
import statistics
import tempfile
import time
from pathlib import Path

from view_cost import RATE, ROOT, TICKS, cpu_time, goal

from tp_controller.recording import Recording
from tp_sim.harness import ClosedLoop, NodeProcess


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('config', nargs='?', default=str(ROOT / 'config' / 'panda.yaml'))
    parser.add_argument('--rounds', type=int, default=4)
    parser.add_argument('--seconds', type=float, default=8.0)
    given = parser.parse_args()
    with (
        tempfile.TemporaryDirectory() as folder,
        ClosedLoop(given.config, {'/**': {'rate': RATE}}, lockstep=False) as loop,
    ):
        loop.client.wait_for(lambda: loop.state.cycles > 100, 'the loop')
        path = Path(folder) / 'run.mcap'
        found = {False: [], True: []}
        for number in range(2 * given.rounds):
            on = bool(number % 2)
            found[on].append(look(loop, path if on else None, given.seconds))
        print(f'{Path(given.config).name} at {RATE:g} Hz, load {os.getloadavg()[0]:.1f}')
        for i, what in enumerate(('cpu of a cycle [µs]', 'solve time [µs]', 'age [µs]')):
            without, recorded = (statistics.median(row[i] for row in found[on]) for on in (0, 1))
            print(f'{what:22}{without:9.1f} without{recorded:9.1f} recorded '
                  f'({100 * (recorded / without - 1):+.1f} %)')  # fmt: skip
        share = statistics.median(row[3] for row in found[True])
        print(f'{"recorder: share of a core [%]":33}{100 * share:6.1f}')
        recording = Recording(path)
        size = path.stat().st_size / recording.contents.seconds
        print(f'{"size per second [kB]":33}{1e-3 * size:6.0f}')


def look(loop, path, seconds):
    """Cpu time of a cycle, medians of solve time and age [µs], share of a core of the recorder."""
    recorder = None
    if path is not None:
        words = [str(path), '--overwrite']
        recorder = NodeProcess('tp_controller', 'record', None, loop.environment, arguments=words)
        recorder.wait_for_output('Ctrl-C ends it', timeout=60.0)
        loop.client.spin_for(1.0)
    solve, age = [], []

    def note(state):
        solve.append(state.solve_time)
        age.append(state.command_age)

    loop.client.on_state.append(note)
    loop.send_goal(*goal(loop, path is not None))
    begin, cpu, cycles = time.monotonic(), cpu_time(loop), loop.state.cycles
    own = 0.0 if recorder is None else cpu_of(recorder)
    loop.client.spin_for(seconds)
    passed = time.monotonic() - begin
    share = (cpu_time(loop) - cpu) / (loop.state.cycles - cycles)
    loop.client.on_state.remove(note)
    used = 0.0
    if recorder is not None:
        used = (cpu_of(recorder) - own) / passed
        recorder.stop()
    return (
        1e6 * share,
        1e6 * statistics.median(solve),
        1e6 * statistics.median(age),
        used,
    )


def cpu_of(process):
    """Cpu time of a process so far [s]."""
    fields = Path(f'/proc/{process.pid}/stat').read_text().rpartition(')')[2].split()
    return (int(fields[11]) + int(fields[12])) / TICKS


if __name__ == '__main__':
    main()

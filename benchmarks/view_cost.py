"""What the page in the browser costs the controller, and whether its memory stays flat.

    python benchmarks/view_cost.py [CONFIG] [--rounds 6] [--seconds 10] [--minutes 0] [--browser]

The loop runs at 500 Hz. Rounds without and with the page take turns, so that what else the
machine does counts for both. A connection takes all that a browser would get; a browser's own
pictures are another program's time; with --browser a headless Chromium shows the page, too, and
the pictures that it draws are counted.
"""

import argparse
import os
import statistics
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / 'test' / 'helpers'))

from page_client import PageClient  # noqa: E402

from tp_sim.harness import ClosedLoop, NodeProcess  # noqa: E402
from tp_sim.harness.browser import Browser, text_element  # noqa: E402

RATE = 500.0
TICKS = os.sysconf('SC_CLK_TCK')


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('config', nargs='?', default=str(ROOT / 'config' / 'panda.yaml'))
    parser.add_argument('--rounds', type=int, default=6)
    parser.add_argument('--seconds', type=float, default=10.0)
    parser.add_argument('--minutes', type=float, default=0.0, help='of a look at the memory')
    parser.add_argument('--browser', action='store_true', help='a Chromium shows the page, too')
    given = parser.parse_args()
    with ClosedLoop(given.config, {'/**': {'rate': RATE}}, lockstep=False) as loop:
        loop.client.wait_for(lambda: loop.state.cycles > 100, 'the loop')
        found = {False: [], True: []}
        for number in range(2 * given.rounds):
            found[bool(number % 2)].append(look(loop, bool(number % 2), given))
        print(f'{Path(given.config).name} at {RATE:g} Hz, load {os.getloadavg()[0]:.1f}')
        for i, what in enumerate(('cpu of a cycle [µs]', 'solve time [µs]', 'age [µs]')):
            without, with_page = (statistics.median(row[i] for row in found[on]) for on in (0, 1))
            print(f'{what:22}{without:9.1f} without{with_page:9.1f} with the page '
                  f'({100 * (with_page / without - 1):+.1f} %)')  # fmt: skip
        print(f'pictures per second   {statistics.median(row[3] for row in found[True]):9.1f}')
        if given.browser:
            drawn = statistics.median(row[4] for row in found[True])
            print(f'drawn by the browser  {drawn:9.1f} a second')
        if given.minutes:
            watch_memory(loop, given.minutes)


def look(loop, with_page, given):
    """Cpu time of a cycle, medians of solve time and age [µs], packets and pictures per second."""
    page, client = started(loop) if with_page else (None, None)
    browser = opened(page) if with_page and given.browser else None
    solve, age = [], []

    def note(state):
        solve.append(state.solve_time)
        age.append(state.command_age)

    loop.client.on_state.append(note)
    loop.send_goal(*goal(loop, with_page))
    begin, cpu, cycles = time.monotonic(), cpu_time(loop), loop.state.cycles
    packets = 0
    while time.monotonic() - begin < given.seconds:
        loop.client.spin_for(0.02)
        if client is not None:
            packets += client.receive(0.005)
            client.messages.clear()
    passed = time.monotonic() - begin
    share = (cpu_time(loop) - cpu) / (loop.state.cycles - cycles)
    loop.client.on_state.remove(note)
    drawn = browser.evaluate('window.drawn') if browser else 0
    if browser is not None:
        browser.close()
    if page is not None:
        client.close()
        page.stop()
    return (
        1e6 * share,
        1e6 * statistics.median(solve),
        1e6 * statistics.median(age),
        packets / passed,
        drawn / passed,
    )


def opened(page):
    """A browser that shows the page, and counts the pictures that it draws."""
    browser = Browser(820, 480)
    browser.open(page.output.split('view: ')[1].split()[0])
    browser.find(text_element('Plots'))
    # WebGL is told to draw many things in one picture.
    browser.evaluate(
        '(() => { window.drawn = 0; let due = true; const kind = WebGL2RenderingContext.prototype;'
        " for (const name of ['drawElements', 'drawArrays']) { const own = kind[name];"
        ' kind[name] = function (...given) { if (due) { due = false; window.drawn += 1;'
        ' requestAnimationFrame(() => due = true); } return own.apply(this, given); }; } })()'
    )
    return browser


def started(loop):
    """Page and a connection to it, once it draws."""
    page = NodeProcess('tp_controller', 'view', None, loop.environment, arguments=['--port', '0'])
    page.wait_for_output('view: http', timeout=60.0)
    client = PageClient(page.output.split('view: ')[1].split()[0])
    client.wait_for(lambda: client.element('TransformControlsMessage'))
    return page, client


def goal(loop, other):
    """Two goals in turn for the first task that takes positions."""
    task = next(task for task in loop.state.tasks if task.type == 'position')
    return task.name, [value + (0.1 if other else -0.1) for value in task.current]


def cpu_time(loop):
    """Cpu time of the controller's process so far [s]."""
    fields = Path(f'/proc/{loop.controller.pid}/stat').read_text().rpartition(')')[2].split()
    return (int(fields[11]) + int(fields[12])) / TICKS


def watch_memory(loop, minutes):
    """Print the page's memory every half minute."""
    page, client = started(loop)
    begin = time.monotonic()
    due = 0.0
    while (passed := time.monotonic() - begin) < 60.0 * minutes:
        if passed >= due:
            print(f'{passed:6.0f} s {page.resident_memory / 2**20:8.1f} MiB', flush=True)
            due += 30.0
            loop.send_goal(*goal(loop, int(due / 30.0) % 2))
        loop.client.spin_for(0.02)
        client.receive(0.02)
        client.messages.clear()
    client.close()
    page.stop()


if __name__ == '__main__':
    main()

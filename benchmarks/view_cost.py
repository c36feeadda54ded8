"""What the page in the browser costs the controller, and whether its memory stays flat.

    python benchmarks/view_cost.py [CONFIG] [--rounds 6] [--seconds 10] [--minutes 0] [--browser]

The loop runs at 500 Hz. Rounds without and with the page take turns, so that what else the
machine does counts for both. A connection takes all that a browser would get; a browser's own
pictures are another program's time; with --browser a headless Chromium shows the page, too, and
the pictures that it draws are counted, and those in which something is elsewhere than before.
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
PERIOD = 1.5
"""Time [s] between two goals: the arm moves all the time."""
SETTLED = 6.0
"""Time [s] until a browser has everything."""
COUNT = """(() => {
  window.drawn = window.moved = 0;
  let last = -1, sum = 0, before = 0;
  const kind = WebGL2RenderingContext.prototype;
  const place = kind.uniformMatrix4fv;
  kind.uniformMatrix4fv = function (...given) {
    // The matrices of everything that is drawn: another sum is another picture.
    given[2].forEach((value, i) => sum += (1 + 0.1 * i) * value);
    return place.apply(this, given);
  };
  for (const name of ['drawElements', 'drawArrays', 'drawElementsInstanced',
                      'drawArraysInstanced']) {
    const own = kind[name];
    kind[name] = function (...given) {
      // All that is drawn at one time of the page's clock is one picture.
      const now = document.timeline.currentTime;
      if (now !== last) {
        window.drawn += 1;
        window.moved += Math.abs(sum - before) > 1e-9;
        [last, before, sum] = [now, sum, 0];
      }
      return own.apply(this, given);
    };
  }
})()"""
TICKS = os.sysconf('SC_CLK_TCK')


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('config', nargs='?', default=str(ROOT / 'config' / 'panda.yaml'))
    parser.add_argument('--rounds', type=int, default=6)
    parser.add_argument('--seconds', type=float, default=10.0)
    parser.add_argument('--minutes', type=float, default=0.0, help='of a look at the memory')
    parser.add_argument('--browser', action='store_true', help='a Chromium shows the page, too')
    parser.add_argument(
        '--size', type=int, nargs=2, default=(820, 480), help='of its page [pixels]'
    )
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
        if not given.browser:
            sent = statistics.median(row[3] for row in found[True])
            print(f'pictures per second   {sent:9.1f}')
        else:
            drawn, moved, spent = (
                statistics.median(row[i] for row in found[True]) for i in (4, 5, 6)
            )
            print(
                f'drawn by the browser  {drawn:9.1f} a second, {moved:.1f} with the arm elsewhere'
            )
            print(f'cpu of the browser    {spent:9.1f} ms a picture')
        if given.minutes:
            watch_memory(loop, given.minutes)


def look(loop, with_page, given):
    """Cpu time of a cycle, medians of solve time and age [µs]; what the page does."""
    page, client = started(loop) if with_page else (None, None)
    browser = opened(page, given.size) if with_page and given.browser else None
    if browser is not None:
        # It stands in for nobody any more. Meshes are read and sent meanwhile.
        client.close()
        client = None
        loop.client.spin_for(SETTLED)
    solve, age = [], []

    def note(state):
        solve.append(state.solve_time)
        age.append(state.command_age)

    loop.client.on_state.append(note)
    begin, cpu, cycles = time.monotonic(), cpu_time(loop.controller.pid), loop.state.cycles
    packets, goals = 0, 0
    if browser is not None:
        browser.evaluate('window.drawn = window.moved = 0')
        browser_cpu = family_time(browser.pid)
    while time.monotonic() - begin < given.seconds:
        if time.monotonic() - begin >= goals * PERIOD:
            goals += 1
            loop.send_goal(*goal(loop, goals % 2))
        loop.client.spin_for(0.02)
        if client is not None:
            packets += client.receive(0.005)
            client.messages.clear()
    passed = time.monotonic() - begin
    share = (cpu_time(loop.controller.pid) - cpu) / (loop.state.cycles - cycles)
    loop.client.on_state.remove(note)
    drawn, moved = browser.evaluate('[window.drawn, window.moved]') if browser else (0, 0)
    per_picture = 0.0
    if browser is not None:
        per_picture = (family_time(browser.pid) - browser_cpu) / max(drawn, 1)
        browser.close()
    if page is not None:
        if client is not None:
            client.close()
        page.stop()
    return (
        1e6 * share,
        1e6 * statistics.median(solve),
        1e6 * statistics.median(age),
        packets / passed,
        drawn / passed,
        moved / passed,
        1e3 * per_picture,
    )


def opened(page, size):
    """A browser that shows the page, and counts the pictures that it draws."""
    browser = Browser(*size)
    browser.open(page.output.split('view: ')[1].split()[0])
    browser.find(text_element('Plots'))
    browser.evaluate(COUNT)
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


def cpu_time(pid):
    """Cpu time of a process so far [s]."""
    fields = Path(f'/proc/{pid}/stat').read_text().rpartition(')')[2].split()
    return (int(fields[11]) + int(fields[12])) / TICKS


def family_time(pid):
    """Cpu time [s] of a process and of all that it has started and that still run."""
    total, left = 0.0, [pid]
    while left:
        pid = left.pop()
        total += cpu_time(pid)
        for thread in Path(f'/proc/{pid}/task').iterdir():
            left += map(int, (thread / 'children').read_text().split())
    return total


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

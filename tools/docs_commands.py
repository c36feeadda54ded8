"""Runs the commands that pages show and that the tests leave out as too long, in short forms.

Writes what came of them to docs/commands.md. ``--only TEXT`` runs those with a text, and prints.
"""

import argparse
import os
import re
import shlex
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / 'docs' / 'commands.md'
sys.path.insert(0, str(ROOT / 'test' / 'helpers'))

from shown_commands import commands  # noqa: E402
from shown_programs import LONG, ended, left_out, short, workplace  # noqa: E402

from tp_sim.harness import HarnessError  # noqa: E402

LONGEST = 300.0
"""Time [s] that a short form may take, also on a machine with other work."""
BEGIN, END = '<!-- begin: tools/docs_commands.py -->', '<!-- end -->'
NOT_HERE = (
    ('--scheduler', 'needs other machines'),
    ('benchmarks/run.py', 'writes docs/benchmarks.md, with other libraries: `make bench`'),
)
STATUS = (
    ('--undeclared', {1}, 'shows what goes wrong'),
    ('benchmarks/soak.py', {0, 1}, '1 if the machine was busy'),
    ('benchmarks/task_changes.py --realtime', {0, 1}, '1 if the machine was busy'),
)
"""Statuses other than 0 that commands may end with, and what they mean."""


def main() -> int:
    """Run them; status 1 if one failed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--only', default='', metavar='TEXT', help='commands with this text')
    only = parser.parse_args().only
    rows, failed = [], 0
    done: dict[str, str] = {}
    with tempfile.TemporaryDirectory() as folder:
        place = workplace(ROOT, Path(folder))
        for command, page in _long_commands().items():
            if only not in command:
                continue
            text = short(command)
            if text not in done:
                why = next((reason for part, reason in NOT_HERE if part in text), '')
                done[text] = why or _outcome(text, place)
                failed += done[text].startswith('failed')
            rows.append(f'| [{page}]({page}) | `{text}` | {done[text]} |')
            print(rows[-1], flush=True)
    if not only:
        _write(rows)
    return int(failed > 0)


def _long_commands() -> dict[str, str]:
    """Commands and the first page that shows each."""
    found: dict[str, str] = {}
    for path in sorted((ROOT / 'docs').glob('*.md')):
        for command in commands(path.read_text(encoding='utf-8')):
            plain = shlex.join(shlex.split(command, comments=True))
            if path != PAGE and left_out(plain, LONG):
                found.setdefault(plain, path.name)
    return found


def _outcome(command: str, place: Path) -> str:
    accepted, meaning = {0}, ''
    for part, statuses, text in STATUS:
        if part in command:
            accepted, meaning = statuses, text
    begin = time.monotonic()
    try:
        status, output = ended(command, dict(os.environ), place, LONGEST)
    except (AssertionError, HarnessError) as error:
        print(error, file=sys.stderr)
        return 'failed'
    if status not in accepted:
        print(output, file=sys.stderr)
        return f'failed: status {status}'
    spent = f'{time.monotonic() - begin:.0f} s'
    return f'{spent}, status {status} ({meaning})' if meaning else spent


def _write(rows: list[str]) -> None:
    """Write the table to the page."""
    machine = f'One run on {os.cpu_count()} cores, load {os.getloadavg()[1]:.1f}:'
    table = '\n'.join([machine, '', '| page | run as | outcome |', '|---|---|---|', *rows])
    page = re.sub(
        f'{BEGIN}.*{END}',
        lambda _: f'{BEGIN}\n\n{table}\n\n{END}',
        PAGE.read_text(encoding='utf-8'),
        flags=re.DOTALL,
    )
    PAGE.write_text(page, encoding='utf-8')


if __name__ == '__main__':
    sys.exit(main())

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
sys.path.insert(0, str(ROOT / 'test' / 'helpers'))

from shown_commands import commands  # noqa: E402
from shown_programs import LONG, left_out, run, short, workplace  # noqa: E402

LONGEST = 100.0
"""Time [s] that a short form may take."""
BEGIN, END = '<!-- begin: tools/docs_commands.py -->', '<!-- end -->'
NOT_HERE = (
    ('--scheduler', 'needs other machines'),
    ('benchmarks/run.py', 'needs the other libraries, and minutes: `make bench`'),
    ('benchmarks/reach.py --count', 'needs the other libraries, and minutes'),
    ('benchmarks/view_cost.py', 'needs a browser'),
    ('first_motion.py', 'minutes, the shortest form too'),
    ('benchmarks/soak.py', 'judges the machine as well: on a quiet one'),
    ('chatter.py', 'has no short form'),
    ('overshoot.py', 'has no short form'),
    ('c3_repeatability', 'has no short form'),
)
STATUS = {'--undeclared': 1}
"""Statuses other than 0 of commands that show what goes wrong."""


def main() -> int:
    """Run them; status 1 if one failed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--only', default='')
    only = parser.parse_args().only
    found, rows, failed = {}, [], 0
    for path in sorted((ROOT / 'docs').glob('*.md')):
        for command in commands(path.read_text(encoding='utf-8')):
            plain = shlex.join(shlex.split(command, comments=True))
            if left_out(plain, LONG) and only in plain:
                found.setdefault(plain, path.name)
    with tempfile.TemporaryDirectory() as folder:
        place = workplace(ROOT, Path(folder))
        for command, page in found.items():
            text = short(command)
            why = next((reason for part, reason in NOT_HERE if part in text), '')
            outcome = why or _outcome(text, place)
            failed += outcome.startswith('failed')
            rows.append(f'| [{page}]({page}) | `{text}` | {outcome} |')
            print(rows[-1], flush=True)
    if not only:
        path = ROOT / 'docs' / 'commands.md'
        table = '\n'.join(['| page | run as | outcome |', '|---|---|---|', *rows])
        page = re.sub(
            f'{BEGIN}.*{END}',
            lambda _: f'{BEGIN}\n\n{table}\n\n{END}',
            path.read_text(encoding='utf-8'),
            flags=re.DOTALL,
        )
        path.write_text(page, encoding='utf-8')
    return int(failed > 0)


def _outcome(command: str, place: Path) -> str:
    begin = time.monotonic()
    status = next((status for text, status in STATUS.items() if text in command), 0)
    try:
        run(command, dict(os.environ), place, status, LONGEST)
    except Exception as error:
        print(error, file=sys.stderr)
        return 'failed'
    return f'{time.monotonic() - begin:.0f} s' + f', status {status}' * bool(status)


if __name__ == '__main__':
    sys.exit(main())

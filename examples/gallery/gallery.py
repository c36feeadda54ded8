"""Draw the experiments: one picture of each, and a page with all of them.

    python examples/gallery/gallery.py                 # all, and docs/gallery.md
    python examples/gallery/gallery.py a5 --out FOLDER # some

Each is computed by the library in closed loop with an ideal arm, without nodes.
"""

import argparse
import sys
from pathlib import Path

from pictures import PICTURES, draw

from tp_controller.plots import save

ROOT = Path(__file__).resolve().parents[2]
IMAGES = ROOT / 'docs' / 'images'
PAGE = ROOT / 'docs' / 'gallery.md'
INTRODUCTION = """\
# Gallery

`make figures` draws all pictures of this page and writes it. Each experiment is computed by the
library in closed loop with an ideal arm; [experiments.md](experiments.md) runs the same files as
nodes, and [recordings.md](recordings.md) draws what those do.

Where an arm is drawn, black is the arm at the end and grey the arm before. The orange line is the
path of its end, and a cross is a target.
"""


def page() -> str:
    """Text of the page."""
    parts = [INTRODUCTION]
    for name, function in PICTURES.items():
        text = ' '.join(function.__doc__.split())
        parts.append(f'## {heading(name)}\n\n{text}\n')
        parts.append(f'![{text}](images/gallery_{name}.png)\n')
        parts.append(f'```\npython examples/gallery/gallery.py {name}\n```\n')
    return '\n'.join(parts)


def heading(name: str) -> str:
    """Head of a picture's part of the page."""
    words = {'schemes': 'Schemes side by side', 'limits': 'Priorities at the limits'}
    return words.get(name, name.upper())


def main() -> int:
    """Draw what is asked for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('names', nargs='*', metavar='NAME', help=f'of {", ".join(PICTURES)}')
    parser.add_argument('--out', type=Path, default=IMAGES, help='folder (%(default)s)')
    given = parser.parse_args()
    unknown = [name for name in given.names if name not in PICTURES]
    if unknown:
        parser.error(f'{unknown[0]}: one of {", ".join(PICTURES)}')
    given.out.mkdir(parents=True, exist_ok=True)
    for name in given.names or PICTURES:
        path = given.out / f'gallery_{name}.png'
        save(draw(name), path)
        print(f'{path} {path.stat().st_size // 1000} kB', flush=True)
    if not given.names and given.out == IMAGES:
        PAGE.write_text(page(), encoding='utf-8')
        print(PAGE)
    return 0


if __name__ == '__main__':
    sys.exit(main())

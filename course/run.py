"""Run the code of notebooks without Jupyter: as they are, then with the solutions filled in.

    python course/run.py [--without-library] [--pictures FOLDER] [NOTEBOOK ...]
    python course/run.py --clear [NOTEBOOK ...]

For every notebook it tells the time, the figures that differ from the expected ones, and the
exercises whose check accepts an empty answer or refuses the solution. It ends with status 1 if
there was any of them. `--clear` runs nothing: it takes outputs and counts out of the files.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import itertools
import json
import os
import re
import sys
import time
from pathlib import Path
from typing import Any, NamedTuple

HERE = Path(__file__).resolve().parent
MISSING = ('tp_controller', 'pinocchio', 'numba')
"""What is not there in a browser."""


class Cell(NamedTuple):
    """A cell of a notebook."""

    kind: str
    """``markdown`` or ``code``."""
    text: str
    exercise: str | None
    """Number of the exercise that the cell is the answer to."""


def cells(path: Path) -> list[Cell]:
    """Cells of a notebook, in order."""
    found = json.loads(path.read_text(encoding='utf-8'))['cells']
    return [
        Cell(cell['cell_type'], ''.join(cell['source']), cell['metadata'].get('exercise'))
        for cell in found
    ]


def solutions(path: Path) -> dict[str, str]:
    """Solutions of a notebook by the numbers of their exercises; under '' what they import."""
    text = (HERE / 'solutions' / f'{path.stem}.py').read_text(encoding='utf-8')
    parts = re.split(r'^# %% (\S+)$', text, flags=re.MULTILINE)
    return {'': parts[0], **dict(zip(parts[1::2], parts[2::2], strict=True))}


class Result(NamedTuple):
    """What a notebook did."""

    output: str
    """Everything that it printed."""
    differs: list[str]
    """Figures that are not the expected ones."""
    compared: int
    """How many figures were compared."""
    empty: dict[str, bool]
    """Whether the check of each exercise accepted the notebook as it is."""
    solved: dict[str, bool]
    """Whether it accepted the solution."""


def run(path: Path, pictures: Path | None = None) -> Result:
    """Run a notebook as it is, then every answer and check again with the solutions.

    Parameters
    ----------
    path
        The notebook.
    pictures
        Folder for its figures; they are not kept when left out.
    """
    import matplotlib.pyplot as plt

    import lab
    from checks.judge import RESULTS

    RESULTS.clear()
    lab.COMPARED.clear()
    namespace: dict[str, Any] = {'__name__': path.stem}
    code = [cell for cell in cells(path) if cell.kind == 'code']
    output = io.StringIO()
    with contextlib.redirect_stdout(output):
        for number, cell in enumerate(code, 1):
            _run(cell.text, f'{path.name}, code cell {number}', namespace)
            if pictures is not None:
                for figure in plt.get_fignums():
                    plt.figure(figure).savefig(pictures / f'{path.stem}_{number}_{figure}.png')
            plt.close('all')
        empty = dict(RESULTS)
        answers = solutions(path)
        _run(answers[''], f'solutions of {path.name}', namespace)
        for cell, check in itertools.pairwise(code):
            if cell.exercise is not None:
                _run(answers[cell.exercise], f'solution {cell.exercise}', namespace)
                _run(check.text, f'check of {cell.exercise}', namespace)
    differs = [
        f'{what}: {value:.6g}, not {fig}' for what, value, fig, fits in lab.COMPARED if not fits
    ]
    return Result(output.getvalue(), differs, len(lab.COMPARED), empty, dict(RESULTS))


def _run(text: str, name: str, namespace: dict[str, Any]) -> None:
    exec(compile(text, name, 'exec'), namespace)


class Missing:
    """Finder of modules that says of some that they are missing."""

    def find_spec(self, name: str, path: object = None, target: object = None) -> None:
        """Refuse the modules that are not there in a browser."""
        if name.partition('.')[0] in MISSING:
            raise ModuleNotFoundError(f'No module named {name!r}', name=name)


def clear(path: Path) -> None:
    """Take outputs, counts and what Jupyter adds to a notebook out of its file."""
    content = json.loads(path.read_text(encoding='utf-8'))
    content['metadata'] = {
        'kernelspec': {'display_name': 'Python 3', 'language': 'python', 'name': 'python3'},
        'language_info': {'name': 'python'},
    }
    content['nbformat'], content['nbformat_minor'] = 4, 5
    for number, cell in enumerate(content['cells'], 1):
        cell['id'] = f'cell-{number:02d}'
        kept = {
            key: cell['metadata'][key] for key in ('exercise', 'tags') if key in cell['metadata']
        }
        cell['metadata'] = kept
        cell['source'] = ''.join(cell['source']).splitlines(keepends=True)
        if cell['cell_type'] == 'code':
            cell['execution_count'], cell['outputs'] = None, []
    content['cells'] = [dict(sorted(cell.items())) for cell in content['cells']]
    text = json.dumps(dict(sorted(content.items())), indent=1, ensure_ascii=False)
    path.write_text(text + '\n', encoding='utf-8')


def main() -> int:
    """Run notebooks; return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('notebooks', nargs='*', type=Path, help='all when left out')
    parser.add_argument('--without-library', action='store_true', help='plain numpy alone')
    parser.add_argument('--pictures', type=Path, help='folder for the figures')
    parser.add_argument('--output', action='store_true', help='print what the notebooks print')
    parser.add_argument('--clear', action='store_true', help='take outputs out of the files')
    arguments = parser.parse_args()
    notebooks = arguments.notebooks or sorted(HERE.glob('*.ipynb'))
    if arguments.clear:
        for path in notebooks:
            clear(path)
        return 0
    os.environ['MPLBACKEND'] = 'agg'
    sys.path.insert(0, str(HERE))
    if arguments.without_library:
        sys.meta_path.insert(0, Missing())  # type: ignore[arg-type]
    if arguments.pictures is not None:
        arguments.pictures.mkdir(parents=True, exist_ok=True)
    mistakes = []
    for path in notebooks:
        started = time.process_time()
        result = run(path, arguments.pictures)
        if arguments.output:
            print(result.output)
        seconds = time.process_time() - started
        mistakes += [f'{path.name}: {text}' for text in result.differs]
        for number, right in result.empty.items():
            if right:
                mistakes.append(f'{path.name}: check {number} accepts an empty answer')
            if not result.solved[number]:
                mistakes.append(f'{path.name}: check {number} refuses the solution')
        print(
            f'{path.name}: {result.compared} figures, {len(result.empty)} exercises, '
            f'{seconds:.1f} s'
        )
    for mistake in mistakes:
        print(mistake, file=sys.stderr)
    return bool(mistakes)


if __name__ == '__main__':
    sys.exit(main())

"""Sides of the comparison: one process each, in a Python environment of its own."""

import contextlib
import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any, NamedTuple

from field.serving import CannotDo

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]


class Library(NamedTuple):
    """A library that is compared."""

    label: str
    script: str
    variant: str
    environment: str | None
    """Name of its environment ``.venv-<name>`` and requirement file; ours has none."""
    strict: bool
    """Whether its levels are strict, not weighted."""


LIBRARIES = (
    Library('recursive', 'side_own.py', 'recursive', None, True),
    Library('hqp', 'side_own.py', 'hqp', None, True),
    Library('OInK', 'side_oink.py', '', 'oink', True),
    Library('PlaCo', 'side_placo.py', '', 'placo', False),
    Library('Pink', 'side_pink.py', '', 'pink', False),
    Library('mink', 'side_mink.py', '', 'mink', False),
)


class NotInstalled(Exception):
    """The environment of a library cannot be made on this machine."""


class Side:
    """A process that runs blocks of steps on request.

    Parameters
    ----------
    library
        Whose process it is.
    scenario
        Path of the scenario that it reads.

    Raises
    ------
    NotInstalled
        If the library's environment cannot be made.
    """

    def __init__(self, library: Library, scenario: Path) -> None:
        # One thread each: small matrices gain nothing from more, and their waiting disturbs.
        threads = {f'{name}_NUM_THREADS': '1' for name in ('OMP', 'OPENBLAS', 'MKL', 'NUMBA')}
        environment = dict(os.environ)
        python = sys.executable
        if library.environment:
            # Theirs is complete without the libraries of ours.
            for name in ('PYTHONPATH', 'LD_LIBRARY_PATH'):
                environment.pop(name, None)
            python = python_of(library.environment)
        self.library = library
        self._log = (scenario.parent / f'{library.label}.log').open('w', encoding='utf-8')
        self._process = subprocess.Popen(
            [python, HERE / library.script, scenario],
            env=environment | threads,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._log,
            text=True,
        )

    def ask(self, kind: str, problem: str, start: int, stop: int) -> dict[str, Any]:
        """Run steps; the answer has ``durations`` [ns], ``failed`` and maybe ``velocities``.

        Raises
        ------
        CannotDo
            If the library cannot do what the problem needs.
        RuntimeError
            If the process ended.
        """
        request = {
            'kind': kind,
            'variant': self.library.variant,
            'problem': problem,
            'start': start,
            'stop': stop,
        }
        with contextlib.suppress(BrokenPipeError):
            print(json.dumps(request), file=self._process.stdin, flush=True)
        line = self._process.stdout.readline()
        if not line:
            raise RuntimeError(f'{self.library.label} ended early: see {self._log.name}')
        answer = json.loads(line)
        if 'cannot' in answer:
            raise CannotDo(answer['cannot'])
        return answer

    def stop(self) -> None:
        """End the process."""
        self._process.stdin.close()
        self._process.wait()
        self._log.close()


def python_of(name: str) -> str:
    """Python of an environment, which is made when it is not there yet.

    Raises
    ------
    NotInstalled
        If it cannot be made; the message is pip's last line.
    """
    place = ROOT / f'.venv-{name}'
    python, made = place / 'bin' / 'python', place / 'state'
    wanted = HERE.parent / f'{name}.txt'
    state = f'{place}\n{sys.version}\n{wanted.read_text(encoding="utf-8")}'
    if made.exists() and made.read_text(encoding='utf-8') == state:
        return str(python)
    print(f'installing {wanted.name} into {place.name}', flush=True)
    for command in (
        [sys.executable, '-m', 'venv', '--clear', place],
        [python, '-m', 'pip', 'install', '--quiet', '-r', wanted],
    ):
        done = subprocess.run(
            [str(part) for part in command], capture_output=True, text=True, check=False
        )
        if done.returncode:
            lines = (done.stderr or done.stdout).strip().splitlines() or ['no message']
            raise NotInstalled(lines[-1])
    made.write_text(state, encoding='utf-8')
    return str(python)

"""Compiled functions out of the library are those that numba compiles."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from tp_controller import compiled

STEPS = """
import sys
import numpy as np
from tp_controller import compiled
if sys.argv[1] == 'library':
    assert compiled.use_library()
from tp_controller import build_settings, read_parameter_file
changes = {'start': 'target', 'solver.type': sys.argv[3]}
settings = build_settings(read_parameter_file(sys.argv[2], 'tp_controller') | changes)
stack, q = settings.stack, np.array(
    read_parameter_file(sys.argv[2], 'tp_sim')['initial_positions'], dtype=float)
period = 1.0 / settings.values['rate']
for _ in range(200):
    q = q + stack.step(q, period).command * period
    print(*map(float.hex, q))
print(*sorted(name for name in ('numba', 'llvmlite') if name in sys.modules))
"""


@pytest.mark.parametrize(
    ('name', 'scheme'), [('a4_position_joint', 'hqp'), ('panda_table', 'recursive')]
)
def test_steps_are_the_same(config, compiled_library, name, scheme):
    numba, library = (
        _steps(kind, config / f'{name}.yaml', scheme) for kind in ('numba', 'library')
    )
    assert library[-1] == ''
    assert numba[-1] == 'llvmlite numba'
    found, expected = (
        np.array([[float.fromhex(value) for value in line.split()] for line in lines[:-1]])
        for lines in (library, numba)
    )
    assert np.abs(expected[-1] - expected[0]).max() > 0.01
    assert np.abs(found - expected).max() < 1e-12


def test_modules_have_compiled_functions_of_compiled_alone():
    # Another import of numba would load it into the nodes.
    own = {'compiled.py', 'compile_ahead.py'}
    for path in compiled.PACKAGE.rglob('*.py'):
        if path.name not in own:
            text = path.read_text(encoding='utf-8')
            assert 'import numba' not in text, path
            assert 'from numba' not in text, path
            assert ('@njit' not in text) or path in set(compiled.sources()), path


def test_a_library_is_of_the_very_sources(monkeypatch, tmp_path):
    source = tmp_path / 'kernel.py'
    monkeypatch.setattr(compiled, 'sources', lambda: [source])
    paths = []
    for text in ('a = 1', 'a = 2', 'a = 1'):
        source.write_text(text, encoding='utf-8')
        paths.append(compiled.library_path())
    assert paths[0] == paths[2] != paths[1]
    assert not compiled.use_library()


def _steps(kind: str, path: Path, scheme: str) -> list[str]:
    done = subprocess.run(
        [sys.executable, '-c', STEPS, kind, path, scheme],
        capture_output=True,
        text=True,
        check=True,
    )
    return done.stdout.removesuffix('\n').split('\n')

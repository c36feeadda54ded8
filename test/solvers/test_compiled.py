"""Compiled functions come out of a library that is made of the very sources."""

import platform
import shutil
import subprocess
import sys

import numpy as np
import pytest

from tp_controller import compiled
from tp_controller.tasks import damper

NARROW = """
import sys
import numpy as np
from tp_controller.tasks import damper
edge = np.zeros(2)
damper.narrow(np.array([[1.0, 2.0], [0.5, 0.1]]), np.ones(2), np.zeros(2), 0.1, 0.05, edge)
print(*edge.tolist(), 'numba' in sys.modules)
"""


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


def test_constants_that_compiled_functions_use_are_among_the_sources():
    assert compiled.PACKAGE / 'tasks' / 'parts.py' in compiled.sources()


@pytest.mark.skipif(platform.machine() != 'x86_64', reason='levels of x86-64 only')
def test_nothing_is_compiled_for_what_a_virtual_machine_hides():
    assert compiled.level(f'{compiled.NEEDED} avx512f') == compiled.LEVEL
    assert compiled.level(compiled.NEEDED.replace('fma', '')) == compiled.level('') == ''
    # The name of the host stands for AVX-512, whether the machine shows it or not.
    parts = [*compiled.library().glob(f'*{compiled.SUFFIX}')]
    assert parts
    for part in parts:
        code = subprocess.run(['objdump', '-d', part], check=True, capture_output=True, text=True)
        assert 'zmm' not in code.stdout, part


def test_this_process_uses_the_library():
    assert compiled.library() == compiled.library_path()
    assert type(damper.narrow).__name__ == 'builtin_function_or_method'


@pytest.mark.parametrize('can_be_made', [True, False])
def test_a_library_is_made_at_the_first_import_or_numba_compiles(tmp_path, can_be_made):
    package = tmp_path / 'tp_controller'
    (package / 'tasks').mkdir(parents=True)
    needed = [
        '__init__.py',
        'tasks/__init__.py',
        'array_types.py',
        'compiled.py',
        'tasks/damper.py',
    ]
    makers = ['prepared.py', 'prepared_callers.py', 'compile_ahead.py']
    for name in [*needed, *(makers if can_be_made else [])]:
        if name.endswith('__init__.py'):
            (package / name).touch()
        else:
            shutil.copy(compiled.PACKAGE / name, package / name)
    first, second = (
        subprocess.run(
            [sys.executable, '-c', NARROW],
            env={'PYTHONPATH': str(tmp_path), 'PATH': '/usr/bin:/bin'},
            capture_output=True,
            text=True,
            check=True,
        )
        for _ in range(2)
    )
    edge = np.zeros(2)
    damper.narrow(np.array([[1.0, 2.0], [0.5, 0.1]]), np.ones(2), np.zeros(2), 0.1, 0.05, edge)
    assert first.stdout.split() == second.stdout.split()
    assert first.stdout.split() == [*map(str, edge.tolist()), str(not can_be_made)]
    assert 'once' in first.stderr
    if can_be_made:
        assert not second.stderr
    else:
        assert 'numba compiles the solver instead (' in first.stderr
        assert 'compile_ahead' in first.stderr

"""Compiled functions, out of a library of machine code that is made once of their sources.

The library is a folder with one file of machine code for each module. `compile_ahead` makes it at
set-up, or else when the first module with compiled functions is imported. Where that cannot be
done, for want of a C compiler say, numba compiles when modules are imported. Arguments are checked
by numba alone: functions of the library take for granted that arrays have the type that the
signature names.
"""

from __future__ import annotations

import hashlib
import os
import platform
import re
import subprocess
import sys
import sysconfig
from collections.abc import Callable, Iterable, Iterator
from functools import cache
from importlib.machinery import ExtensionFileLoader
from importlib.util import module_from_spec, spec_from_loader
from pathlib import Path
from types import ModuleType
from typing import Any

PACKAGE = Path(__file__).parent
MAKERS = ('compiled.py', 'compile_ahead.py', 'prepared_callers.py')
"""What makes the library, beside its sources."""
IMPORT = b'\nfrom tp_controller.compiled import '
"""What a module with compiled functions has in it."""
FROM = re.compile(rb'^from (tp_controller\.[.\w]+) import', re.MULTILINE)
SUFFIX = sysconfig.get_config_var('EXT_SUFFIX')

LEVEL = 'x86-64-v3'
"""Level of the x86-64 instruction set that is made use of where the processor has it."""
NEEDED = 'abm avx avx2 bmi1 bmi2 cx16 f16c fma lahf_lm movbe popcnt sse4_1 sse4_2 ssse3 xsave'
"""What that level consists of, by the names of /proc/cpuinfo."""

LEAN: dict[str, Any] = {'_nrt': False, 'error_model': 'numpy'}
"""Options of numba for functions that make no arrays: views of arrays are not counted, which takes
a third of the time of small matrices, and a division by zero is infinite."""

COMPILING = 'TP_CONTROLLER_COMPILING'
"""Variable of the environment of processes that make the library."""

collected: list[tuple[Callable[..., Any], Any, bool]] = []
"""In a process that makes the library: functions with signatures, of all modules imported, and
whether they are called as `Prepared`."""


@cache
def library() -> Path | None:
    """Folder of the library of these sources, which is made if need be.

    Returns
    -------
    Path or None
        None if it cannot be made, and in processes that make it.
    """
    if COMPILING in os.environ:
        return None
    path = library_path()
    if not path.is_dir():
        print('tp_controller: compiles its solver, once; two minutes', file=sys.stderr)
        paths = [str(PACKAGE.parent), *filter(None, [os.environ.get('PYTHONPATH')])]
        done = subprocess.run(
            [sys.executable, '-m', 'tp_controller.compile_ahead'],
            env=os.environ | {COMPILING: '1', 'PYTHONPATH': os.pathsep.join(paths)},
            check=False,
            capture_output=True,
            text=True,
        )
        if done.returncode:
            why = done.stderr.strip().rpartition('\n')[2]
            print(f'tp_controller: numba compiles the solver instead ({why})', file=sys.stderr)
            return None
    return path


def library_path() -> Path:
    """Where the library of these sources is, for this kind of processor and this Python."""
    return PACKAGE / '__pycache__' / f'compiled_{key(sources())}'


def key(paths: Iterable[Path]) -> str:
    """What machine code of these sources depends on: their text, kind of processor and Python.

    Also that of what makes it.
    """
    digest = hashlib.sha256(f'{platform.machine()} {processor()} {SUFFIX}'.encode())
    for path in [*sorted(paths), *(PACKAGE / name for name in MAKERS)]:
        if path.is_file():
            digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def sources() -> set[Path]:
    """Modules with compiled functions, and those that they import names from."""
    return {needed for path in modules() for needed in imported(path)}


def modules() -> Iterator[Path]:
    """Modules with compiled functions, and the types that these name."""
    for folder, folders, files in os.walk(PACKAGE):
        folders[:] = [name for name in folders if name != '__pycache__']
        for name in files:
            path = Path(folder, name)
            if name.endswith('.py') and IMPORT in path.read_bytes():
                yield path


def imported(path: Path) -> set[Path]:
    """What the machine code of a module is made of: it and what it imports, directly or not."""
    found: set[Path] = set()
    left = [path]
    while left:
        path = left.pop()
        if path in found or not path.is_file():
            continue
        found.add(path)
        text = path.read_bytes()
        if IMPORT in text:
            names = (name.decode().split('.')[1:] for name in FROM.findall(text))
            left.extend(PACKAGE.joinpath(*name).with_suffix('.py') for name in names)
    return found - {Path(__file__)}


def njit(
    *signature: Any, prepared: bool = False, **options: Any
) -> Callable[[Callable[..., Any]], Any]:
    """Decorate a function that is to be compiled; as ``numba.njit``.

    The library has those with a signature. The others are for these to call. Those that are
    ``prepared`` are called by `Prepared` only.
    """
    if library() is not None:
        return _out_of_library
    import numba

    if COMPILING not in os.environ:
        return numba.njit(*signature, **options)

    def compile_when_called(function: Callable[..., Any]) -> Any:
        collected.extend((function, types, prepared) for types in signature)
        # Nothing of it is used by another process.
        return numba.njit(**options | {'cache': False})(function)

    return compile_when_called


def _out_of_library(function: Callable[..., Any]) -> Any:
    part = _parts().get(part_name(function.__module__))
    return getattr(part, function.__name__, function)


@cache
def _parts() -> dict[str, ModuleType]:
    """Machine code of all modules that have functions with a signature.

    All at once: another process may put a library of newer sources in the place of this one.
    """
    folder = library()
    assert folder is not None
    found = {}
    for file in folder.glob(f'*{SUFFIX}'):
        name = file.name.removesuffix(SUFFIX)
        loader = ExtensionFileLoader(name, str(file))
        spec = spec_from_loader(name, loader)
        assert spec is not None
        found[name] = module_from_spec(spec)
        loader.exec_module(found[name])
    if not found:
        raise ImportError(f'{folder}: the compiled functions are gone; start again')
    return found


def part_name(name: str) -> str:
    """Name of a module's machine code in the library."""
    return f'{name}.compiled'.replace('.', '_')


def inner(function: Callable[..., Any]) -> Any:
    """Decorate a function without a signature that compiled ones call, and Python never does."""
    return njit(cache=True, no_cpython_wrapper=True, no_cfunc_wrapper=True, **LEAN)(function)


class _AnyType:
    """Stands in for all types of numba, which the library knows already."""

    def __getitem__(self, _: Any) -> _AnyType:
        return self

    def __call__(self, *_: Any, **__: Any) -> _AnyType:
        return self

    def __getattr__(self, _: str) -> _AnyType:
        return self


def __getattr__(name: str) -> Any:
    """Types of numba."""
    if name not in ('boolean', 'float64', 'int32', 'int64', 'types', 'void'):
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    if library() is not None:
        return _AnyType()
    import numba

    return getattr(numba, name)


@cache
def processor() -> str:
    """Kind of processor that the library is made for, by LLVM's name; empty: any of its family.

    The name of the host would not do: LLVM takes for granted that it has all that such a processor
    can do, and a virtual machine may hide a part of it.
    """
    try:
        with open('/proc/cpuinfo', 'rb') as file:
            lines = file.read().partition(b'\n\n')[0].splitlines()
    except OSError:
        return ''
    flags = next((line for line in lines if line.startswith(b'flags')), b'')
    return level(flags.decode())


def level(flags: str) -> str:
    """The kind of processor that has these abilities, by the names of /proc/cpuinfo."""
    return LEVEL if set(NEEDED.split()) <= set(flags.split()) else ''


if __name__ == '__main__':
    print(library_path(), library_path().is_dir())

"""Makes the library of compiled functions: ``python -m tp_controller.compile_ahead``.

It has every function with a signature, and takes one to two minutes on two cores. Modules that are
as they were in the library before are not compiled again. Needs a C compiler and Python's headers.
"""

from __future__ import annotations

import fcntl
import importlib
import inspect
import os
import shutil
import tempfile
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from tp_controller import compiled
from tp_controller.prepared_callers import prepared_caller


def build() -> Path:
    """Make the library of these sources, unless it is there; remove those of others.

    Returns
    -------
    Path
        Where it is.
    """
    path = compiled.library_path()
    path.parent.mkdir(exist_ok=True)
    with (path.parent / 'compiled.lock').open('w') as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        found = path.parent.glob('compiled_*')
        # Another Python has a library of its own.
        others = [old for old in found if old != path and any(old.glob(f'*{compiled.SUFFIX}'))]
        if not path.is_dir():
            with tempfile.TemporaryDirectory(dir=path.parent) as made:
                folder = Path(made, path.name)
                folder.mkdir()
                _fill(folder, others)
                # Whole or not at all: another process may start meanwhile.
                folder.rename(path)
        for old in others:
            shutil.rmtree(old)
    return path


def _fill(folder: Path, others: list[Path]) -> None:
    """Compile all compiled.modules, on all cores; those that take longest first."""
    groups: list[list[Path]] = []
    for path in sorted(compiled.modules(), key=lambda path: path.stat().st_size, reverse=True):
        if not _copied(path, folder, others):
            # A process compiles anew what a module calls: modules of one chain share one.
            needed = compiled.imported(path)
            group = next((group for group in groups if group[0] in needed), None)
            if group is None:
                groups.append([path])
            else:
                group.append(path)
    os.environ[compiled.COMPILING] = '1'
    # A fork would have compiled.modules that are imported already.
    with ProcessPoolExecutor(mp_context=get_context('spawn')) as pool:
        for _ in pool.map(_compile, groups, [folder] * len(groups)):
            pass


def _copied(path: Path, folder: Path, others: list[Path]) -> bool:
    """Take over a module from another library, if it is made of the same sources."""
    name = f'{compiled.key(compiled.imported(path))}.key'
    (folder / name).touch()
    for other in others:
        if (other / name).exists():
            for file in other.glob(f'{compiled.part_name(_module(path))}.*'):
                shutil.copy(file, folder)
            return True
    return False


def _compile(paths: list[Path], folder: Path) -> None:
    """Compile the functions of compiled.modules that have a signature."""
    # numba compiles ahead by this class, of which mypy knows nothing.
    compiler: Any = importlib.import_module('numba.pycc').CC
    for path in paths:
        name = _module(path)
        importlib.import_module(name)
        library = compiler(compiled.part_name(name), source_module=__name__)
        library.target_cpu = compiled.processor()
        found = [entry for entry in compiled.collected if entry[0].__module__ == name]
        for function, types, prepared in found:
            signature = types[0] if isinstance(types, list) else types
            if prepared:
                caller, signature = prepared_caller(lean(function), signature)
            else:
                caller = _caller(function)
            caller.__name__ = caller.__qualname__ = function.__name__
            library.export(function.__name__, signature)(caller)
        if found:
            library.output_dir, library.output_file = (
                str(folder),
                f'{compiled.part_name(name)}{compiled.SUFFIX}',
            )
            library.compile()


def lean(function: Callable[..., Any]) -> Any:
    """Compile a function when it is called, without counts of its views of arrays."""
    return importlib.import_module('numba').njit(**compiled.LEAN)(function)


def _caller(function: Callable[..., Any]) -> Callable[..., Any]:
    """Function that calls another one, compiled as lean as inner ones.

    Exported functions themselves have to count their arguments.
    """
    names = ', '.join(inspect.signature(function).parameters)
    caller: Callable[..., Any] = eval(f'lambda {names}: lean({names})', {'lean': lean(function)})
    return caller


def _module(path: Path) -> str:
    return '.'.join(path.relative_to(compiled.PACKAGE.parent).with_suffix('').parts)


if __name__ == '__main__':
    print(build())

"""Makes the library of compiled functions: ``python -m tp_controller.compile_ahead``.

It has every function with a signature, and takes less than a minute. Needs a C compiler and the
headers of Python.
"""

from __future__ import annotations

import importlib
import tempfile
from pathlib import Path
from typing import Any

from numba.core.dispatcher import Dispatcher

from tp_controller.compiled import PACKAGE, library_path, sources, symbol


def build() -> Path:
    """Make the library of these sources, unless it is there; remove those of others.

    Returns
    -------
    Path
        Where it is.
    """
    path = library_path()
    for old in path.parent.glob('compiled_*'):
        if old != path:
            old.unlink()
    if path.exists():
        return path
    # numba compiles ahead by this class, of which mypy knows nothing.
    compiler: Any = importlib.import_module('numba.pycc').CC
    library = compiler(path.name.partition('.')[0], source_module=__name__)
    library.target_cpu = 'host'
    for function in _functions():
        (signature,) = function.nopython_signatures
        library.export(symbol(function.py_func), signature)(function.py_func)
    with tempfile.TemporaryDirectory(dir=path.parent) as folder:
        library.output_dir, library.output_file = folder, path.name
        library.compile()
        # Whole or not at all: a node may start meanwhile.
        Path(folder, path.name).rename(path)
    return path


def _functions() -> list[Dispatcher]:
    """All functions with a signature."""
    found = []
    for path in sorted(sources()):
        parts = path.relative_to(PACKAGE.parent).with_suffix('').parts
        module = importlib.import_module('.'.join(parts))
        for function in vars(module).values():
            here = isinstance(function, Dispatcher) and function.__module__ == module.__name__
            if here and not function._can_compile:
                found.append(function)
    return found


if __name__ == '__main__':
    print(build())

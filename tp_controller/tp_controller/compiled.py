"""Compiled functions: by numba when they are imported, or out of a library that it filled ahead.

`njit` and the types are those of numba, unless `use_library` was called before the first module
with compiled functions is imported. The functions then come from a library of machine code, which
``python -m tp_controller.compile_ahead`` makes of the same sources; numba and LLVM, 130 MB and a
second, are not loaded. The nodes do that. Arguments are checked by numba alone: functions of the
library take for granted that arrays have the type that the signature names.
"""

from __future__ import annotations

import hashlib
import os
import sysconfig
from collections.abc import Callable, Iterator
from importlib.machinery import ExtensionFileLoader
from importlib.util import module_from_spec, spec_from_loader
from pathlib import Path
from types import ModuleType
from typing import Any

PACKAGE = Path(__file__).parent
IMPORT = b'\nfrom tp_controller.compiled import '
"""What a module with compiled functions has in it."""

_libraries: list[ModuleType] = []
"""The library in use, if one is."""


def use_library() -> bool:
    """Take compiled functions out of the library from now on, if there is one of these sources.

    Returns
    -------
    bool
        Whether there is one; without it numba compiles them, or loads them from its cache.
    """
    path = library_path()
    if not path.exists():
        return False
    name = path.name.partition('.')[0]
    loader = ExtensionFileLoader(name, str(path))
    spec = spec_from_loader(name, loader)
    assert spec is not None
    library = module_from_spec(spec)
    loader.exec_module(library)
    _libraries.append(library)
    return True


def library_in_use() -> bool:
    """Whether compiled functions come from the library."""
    return bool(_libraries)


def library_path() -> Path:
    """Where the library of these sources for this processor and this Python is, if it was made."""
    key = hashlib.sha256(_processor())
    for path in sorted(sources()):
        key.update(path.read_bytes())
    suffix = sysconfig.get_config_var('EXT_SUFFIX')
    return PACKAGE / '__pycache__' / f'compiled_{key.hexdigest()[:16]}{suffix}'


def sources() -> Iterator[Path]:
    """Modules with compiled functions, and the types that these name."""
    for folder, folders, files in os.walk(PACKAGE):
        folders[:] = [name for name in folders if name != '__pycache__']
        for name in files:
            path = Path(folder, name)
            if name.endswith('.py') and IMPORT in path.read_bytes():
                yield path


def symbol(function: Callable[..., Any]) -> str:
    """Name of a function in the library."""
    return f'{function.__module__}.{function.__name__}'.replace('.', '_')


def njit(*signature: Any, **options: Any) -> Callable[[Callable[..., Any]], Any]:
    """Decorate a function that is to be compiled; as ``numba.njit``.

    The library has those with a signature. The others are for these to call.
    """
    if not _libraries:
        import numba

        return numba.njit(*signature, **options)
    return lambda function: getattr(_libraries[-1], symbol(function), function)


def inner(function: Callable[..., Any]) -> Any:
    """Decorate a function without a signature that compiled ones call, and Python never does."""
    return njit(cache=True, no_cpython_wrapper=True, no_cfunc_wrapper=True)(function)


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
    if _libraries:
        return _AnyType()
    import numba

    return getattr(numba, name)


def _processor() -> bytes:
    """What the processor can do: code that was compiled for one may not run on another."""
    try:
        with open('/proc/cpuinfo', 'rb') as file:
            lines = file.read().partition(b'\n\n')[0].splitlines()
    except OSError:
        return b''
    return b'\n'.join(line for line in lines if line.startswith((b'model name', b'flags')))

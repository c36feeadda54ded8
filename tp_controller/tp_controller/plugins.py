"""Kinds of tasks, solvers, objectives and goals that other packages add, by entry points."""

from __future__ import annotations

import inspect
import logging
import os
import sys
from collections.abc import Callable, Iterator, Mapping
from configparser import ConfigParser
from configparser import Error as ConfigError
from functools import cache
from typing import Any, NamedTuple, TypeVar

from tp_controller.errors import InvalidValue, listed

T = TypeVar('T')

PREFIX = 'tp_controller.'
"""Beginning of the groups of entry points that are looked for."""

log = logging.getLogger('tp_controller')


class Registry(Mapping[str, T]):
    """Kinds by name: those of this package, and those that other packages register.

    Other packages are looked for when a name is asked for that this package does not have, or
    when all names are. A kind that cannot be used is left out with one line in the log.

    Parameters
    ----------
    group
        Group of entry points; the name of an entry point is that of the kind.
    own
        The kinds of this package; they keep their names.
    check
        Raises `InvalidValue` for what is no such kind, given its name and the object.
    """

    def __init__(
        self, group: str, own: Mapping[str, T], check: Callable[[str, Any], None]
    ) -> None:
        self.group = group
        self._kinds = dict(own)
        self._check = check
        self._looked = False

    def add(self, name: str, kind: T) -> None:
        """Register a kind of this process.

        Raises
        ------
        InvalidValue
            If the name is taken, or it is no such kind.
        """
        self._look()
        self._add(name, kind)

    def __getitem__(self, name: str) -> T:
        if name not in self._kinds:
            self._look()
        return self._kinds[name]

    def __iter__(self) -> Iterator[str]:
        self._look()
        return iter(tuple(self._kinds))

    def __len__(self) -> int:
        self._look()
        return len(self._kinds)

    def __bool__(self) -> bool:
        return True

    def __repr__(self) -> str:
        return f'<{self.group}: {listed(self)}>'

    def _look(self) -> None:
        if self._looked:
            return
        self._looked = True
        for found in registered():
            if found.group != self.group:
                continue
            try:
                self._add(found.name, found.load())
            except (Exception, SystemExit) as error:
                # Somebody else's mistake must not stop what does not need it.
                reason = ' '.join(f'{type(error).__name__}: {error}'.split())
                if isinstance(error, InvalidValue):
                    reason = f'got {error.got}; accepts {error.accepts}'
                log.warning('%s is left out: %s', found, reason)

    def _add(self, name: str, kind: T) -> None:
        if name in self._kinds:
            accepts = f'a name other than {listed(self._kinds)}'
            raise InvalidValue(f'{self.group}.{name}', 'a second kind of that name', accepts)
        self._check(name, kind)
        self._kinds[name] = kind


def check_class(base: type, name: str, kind: Any) -> None:
    """Check that a class can be used as a kind: derived from a base, and of this ``type``.

    Raises
    ------
    InvalidValue
        If it cannot.
    """
    what = getattr(kind, '__name__', repr(kind))
    if not (inspect.isclass(kind) and issubclass(kind, base)):
        raise InvalidValue(name, what, f'a class derived from {base.__name__}')
    if missing := getattr(kind, '__abstractmethods__', None):
        raise InvalidValue(name, f'{what} without {listed(sorted(missing))}', 'all of them')
    if getattr(kind, 'type', None) != name:
        got = f'{what} with type {getattr(kind, "type", None)!r}'
        raise InvalidValue(name, got, f'type = {name!r}')


class Registered(NamedTuple):
    """One entry point of an installed package."""

    package: str
    group: str
    name: str
    value: str

    def load(self) -> Any:
        """Import the object that it names."""
        from importlib.metadata import EntryPoint

        return EntryPoint(self.name, self.value, self.group).load()

    def __str__(self) -> str:
        return f'{self.group} {self.name} of the package {self.package}'


@cache
def registered() -> tuple[Registered, ...]:
    """Entry points of all installed packages in the groups that begin with `PREFIX`.

    They are read from the files beside the packages: importlib.metadata would read all groups of
    all packages, which takes ten times as long.
    """
    texts: dict[str, str] = {}
    for folder in dict.fromkeys(sys.path):
        for package, path in _metadata(folder or os.curdir):
            if package in texts:
                continue  # hidden by one that is earlier in the path
            try:
                with open(path, encoding='utf-8') as file:
                    texts[package] = file.read()
            except (OSError, UnicodeDecodeError):
                texts[package] = ''
    found: list[Registered] = []
    for package, text in texts.items():
        if f'[{PREFIX}' in text:
            found += _entries(package, text)
    return tuple(found)


def _metadata(folder: str) -> Iterator[tuple[str, str]]:
    """Names of the packages in a folder of the path, and where their entry points would be."""
    try:
        with os.scandir(folder) as entries:
            names = sorted(entry.name for entry in entries)
    except OSError:
        return
    for name in names:
        if name.endswith(('.dist-info', '.egg-info')):
            package = name.rpartition('.')[0].partition('-')[0].replace('.', '_').lower()
            yield package, os.path.join(folder, name, 'entry_points.txt')
        elif name == 'EGG-INFO':
            yield os.path.basename(folder), os.path.join(folder, name, 'entry_points.txt')


def _entries(package: str, text: str) -> Iterator[Registered]:
    parser = ConfigParser(delimiters=('=',), interpolation=None)
    parser.optionxform = str  # type: ignore[assignment, method-assign]
    try:
        parser.read_string(text)
    except ConfigError as error:
        log.warning('entry points of %s cannot be read: %s', package, ' '.join(str(error).split()))
        return
    for group in parser.sections():
        if group.startswith(PREFIX):
            for name, value in parser.items(group):
                yield Registered(package, group, name, value)

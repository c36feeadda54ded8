"""Errors that a user can cause, each with what, where and what is accepted."""

from __future__ import annotations

from typing import Any


class TaskPriorityError(Exception):
    """Root of every error that this package raises on purpose."""


class InvalidValue(TaskPriorityError):
    """A parameter, goal or argument that cannot be used.

    Parameters
    ----------
    key
        Name of the offending value, dotted as in a parameter file.
    got
        What was found, as text.
    accepts
        What would be accepted, as text.
    """

    def __init__(self, key: str, got: str, accepts: str) -> None:
        self.key = key
        self.got = got
        self.accepts = accepts
        super().__init__(f'{key}: got {got}; accepts {accepts}')

    def __reduce__(self) -> tuple[type[InvalidValue], tuple[str, str, str]]:
        """Make it again from its parts, in another process too."""
        return InvalidValue, (self.key, self.got, self.accepts)

    def under(self, prefix: str) -> InvalidValue:
        """Return the same error for ``prefix.key``."""
        return InvalidValue(f'{prefix}.{self.key}', self.got, self.accepts)

    def within(self, place: str) -> InvalidValue:
        """Return the same error for the key in a file."""
        return InvalidValue(f'{place}: {self.key}', self.got, self.accepts)


NO_VALUE = 'no value'
"""What was got of a required parameter that is missing."""


class UnusableState(TaskPriorityError):
    """A joint state from which no finite command follows.

    Parameters
    ----------
    message
        What is wrong.
    command
        Velocities (n,) of braking, None if the positions are not known.
    """

    def __init__(self, message: str, command: Any = None) -> None:
        super().__init__(message)
        self.command = command


def shown(value: Any, longest: int = 80) -> str:
    """Text of a value for an error message, cut when it is long."""
    # What is cut away is not put into words before.
    if hasattr(value, 'tolist'):
        value = (value[: longest + 1] if getattr(value, 'ndim', 1) else value).tolist()
    elif isinstance(value, str | list):
        value = value[: longest + 1]
    elif isinstance(value, tuple):
        value = list(value[: longest + 1])
    text = repr(value)
    return text if len(text) <= longest else f'{text[: longest - 3]}...'


def plural(count: int, word: str) -> str:
    """Count with the word for one thing, or for several."""
    return f'{count} {word}' if count == 1 else f'{count} {word}s'


def listed(names: Any) -> str:
    """Comma-separated names for the 'accepts' part of a message."""
    return ', '.join(str(name) for name in names) or 'nothing'

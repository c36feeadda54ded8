"""What a check finds."""

from __future__ import annotations

from typing import NamedTuple

from tp_controller.errors import InvalidValue

ERROR, WARNING, NOTE = SEVERITIES = ('error', 'warning', 'note')
"""What a controller refuses; what will hardly work as meant; what is good to know."""


class Finding(NamedTuple):
    """One thing that was found."""

    severity: str
    """One of `SEVERITIES`."""
    key: str
    """Full dotted key of the parameter that it is about."""
    got: str
    """What was found."""
    accepts: str = ''
    """What would be accepted; empty if that is part of what was found."""

    def __str__(self) -> str:
        accepts = f'; accepts {self.accepts}' if self.accepts else ''
        return f'{self.severity}: {self.key}: {self.got}{accepts}'

    @classmethod
    def of(cls, error: InvalidValue) -> Finding:
        """Make an error of an exception."""
        return cls(ERROR, error.key, f'got {error.got}', error.accepts)


def warning(key: str, got: str, accepts: str = '') -> Finding:
    """Make a warning."""
    return Finding(WARNING, key, got, accepts)


def note(key: str, got: str, accepts: str = '') -> Finding:
    """Make a note."""
    return Finding(NOTE, key, got, accepts)

"""Description of parameters, and values read by it."""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any

from tp_controller.errors import NO_VALUE, InvalidValue, listed, shown

NUMBER = 'number'
NUMBERS = 'numbers'
TEXT = 'text'
TEXTS = 'texts'
BOOLEAN = 'boolean'

REQUIRED = object()
"""Default of a parameter that has to be given."""

NAME = re.compile(r'[A-Za-z][A-Za-z0-9_]{0,79}')
"""What a task may be called: its name becomes part of topic names."""


def check_name(name: str) -> None:
    """Check what a task is called.

    Raises
    ------
    InvalidValue
        For a name that cannot stand in a topic name.
    """
    if not NAME.fullmatch(name):
        raise InvalidValue(
            f'tasks.{name[:80]}',
            f'a task called {shown(name)}',
            'names of up to 80 letters, digits and _ that begin with a letter',
        )


@dataclass(frozen=True)
class Parameter:
    """One parameter: what it is, what it accepts and what it is when left out."""

    kind: str
    description: str
    default: Any = None
    """Value when left out; None if there is none, `REQUIRED` if it has to be given."""
    minimum: float | None = None
    above: float | None = None
    """Exclusive lower bound."""
    choices: Collection[str] = ()
    runtime: bool = False
    """Whether it may change while the node runs."""

    @property
    def accepts(self) -> str:
        """The accepted values in words."""
        words = {
            NUMBER: 'a number',
            NUMBERS: 'a list of numbers',
            TEXT: 'a text',
            TEXTS: 'a list of texts',
            BOOLEAN: 'true or false',
        }[self.kind]
        if self.choices:
            words = f'one of {listed(self.choices)}'
        elif self.minimum is not None:
            words += f' of at least {self.minimum:g}'
        elif self.above is not None:
            words += f' above {self.above:g}'
        return words

    def read(self, key: str, value: Any) -> Any:
        """Check a value and bring it to its plain form.

        Returns
        -------
        float, str, bool or a tuple of the first two
            A list parameter given as one value becomes a tuple of one.

        Raises
        ------
        InvalidValue
            If the value is not of the parameter's kind or outside its range.
        """
        if self.kind == NUMBER:
            return self._number(key, value, value)
        if self.kind == BOOLEAN:
            if not isinstance(value, bool):
                raise InvalidValue(key, shown(value), self.accepts)
            return value
        if self.kind == TEXT:
            return self._text(key, value, value)
        read_item = self._number if self.kind == NUMBERS else self._text
        if isinstance(value, str | bool | int | float):
            return (read_item(key, value, value),)
        try:
            items = list(value)
        except TypeError:
            raise InvalidValue(key, shown(value), self.accepts) from None
        return tuple(read_item(key, item, items) for item in items)

    def _number(self, key: str, item: Any, value: Any) -> float:
        if isinstance(item, bool) or not isinstance(item, int | float):
            # The ros2 command line makes a text of a list that mixes 1 and 2.5.
            mixed = isinstance(value, str) and value.startswith('[')
            hint = ' (of one kind: write 1.0 for 1)' if mixed else ''
            raise InvalidValue(key, shown(value), self.accepts + hint)
        try:
            number = float(item)
        except OverflowError:
            number = math.inf
        if not math.isfinite(number):
            finite = 'finite' if self.kind == NUMBER else 'all finite'
            raise InvalidValue(key, shown(value), f'{self.accepts}, {finite}')
        too_low = self.minimum is not None and number < self.minimum
        if too_low or (self.above is not None and number <= self.above):
            raise InvalidValue(key, shown(value), self.accepts)
        return number

    def _text(self, key: str, item: Any, value: Any) -> str:
        if not isinstance(item, str) or (self.choices and item not in self.choices):
            quote = isinstance(item, bool)
            hint = ' (in quotes: YAML takes y, n, on and off for true and false)' if quote else ''
            raise InvalidValue(key, shown(value), self.accepts + hint)
        return item


Flat = dict[str, Any]
"""Parameter values by full dotted key."""


def flatten(nested: Mapping[str, Any], prefix: str = '') -> Flat:
    """Dotted keys of a nested dictionary, as ROS 2 makes them of a parameter file.

    Raises
    ------
    InvalidValue
        If a key is not a text, a block is empty, or a key is given both nested and dotted.
    """
    flat: Flat = {}
    for key, value in nested.items():
        name = f'{prefix}{key}'
        if not isinstance(key, str):
            raise InvalidValue(name, f'a key {shown(key)}', 'texts as keys')
        if isinstance(value, Mapping) and not value:
            raise InvalidValue(name, 'an empty block', 'parameters (or leave the block out)')
        found = flatten(value, f'{name}.') if isinstance(value, Mapping) else {name: value}
        for twice in flat.keys() & found.keys():
            raise InvalidValue(twice, 'two values, nested and dotted', 'one of the two')
        flat.update(found)
    return flat


def read_all(flat: Mapping[str, Any], schema: Mapping[str, Parameter]) -> Flat:
    """Check values against a schema and fill in the defaults.

    Parameters
    ----------
    flat
        Values by dotted key.
    schema
        Parameters by dotted key.

    Returns
    -------
    dict
        A value for every key of the schema.

    Raises
    ------
    InvalidValue
        For a key that the schema does not have, a value that its parameter does not
        accept, or a required value that is missing.
    """
    values, errors = read_each(flat, schema)
    if errors:
        raise errors[0]
    return values


def read_each(
    flat: Mapping[str, Any], schema: Mapping[str, Parameter]
) -> tuple[Flat, list[InvalidValue]]:
    """Check values as `read_all`, but go on after an error.

    Returns
    -------
    dict
        A value for every key of the schema that has an acceptable one.
    list
        The errors, those of unknown keys first.
    """
    errors = [
        InvalidValue(key, 'an unknown parameter', alternatives(key, schema))
        for key in flat
        if key not in schema
    ]
    values: Flat = {}
    for key, parameter in schema.items():
        if flat.get(key) is None and parameter.default is not REQUIRED:
            values[key] = parameter.default
            continue
        try:
            if flat.get(key) is None:
                raise InvalidValue(key, NO_VALUE, parameter.accepts)
            values[key] = parameter.read(key, flat[key])
        except InvalidValue as error:
            errors.append(error)
    return values, errors


def alternatives(key: str, schema: Mapping[str, Parameter], brief: bool = True) -> str:
    """Keys that may have been meant: a close one first, then those beside it.

    Where there are neither, these are all keys, `brief` by their beginnings only.
    """
    beside = [name for name in schema if _block(name) == _block(key)]
    # What another task has is not meant; it may have a type of its own.
    meant = beside + [name for name in schema if not (beside and name.startswith('tasks.'))]
    close = difflib.get_close_matches(key, meant, n=1, cutoff=0.8)
    others = [name for name in beside if name not in close]
    hint = [f'{close[0]} (did you mean that?)'] if close else []
    if not beside and not close:
        others = list(dict.fromkeys(_beginning(name) if brief else name for name in schema))
    return listed(hint + others)


def _block(key: str) -> str:
    return key.rpartition('.')[0]


def _beginning(key: str) -> str:
    first, dot, _ = key.partition('.')
    return f'{first}.…' if dot else first

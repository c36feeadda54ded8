"""Parameter files without ROS."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar

import yaml

from tp_controller.errors import InvalidValue, shown
from tp_controller.parameters import Flat, flatten

WILDCARDS = ('*', '**')
ROS_OWN = ('use_sim_time', 'start_type_description_service', 'qos_overrides.')
"""Parameters that ROS 2 itself puts on every node."""
BOOLEAN, TEXT = 'tag:yaml.org,2002:bool', 'tag:yaml.org,2002:str'

LONGEST = 64 * 1024
"""Length of a text [characters] that a running controller reads."""
DEEPEST = 8
"""Blocks and lists inside each other in such a text."""
MOST = 5000
"""Values, keys included, in such a text."""
TASK = 'YAML of a task, such as {type: obstacle, frame: link_3, ...}'
CHANGE = 'YAML of what stands under ros__parameters, such as {hierarchy: [tip], ...}'


class _StrictLoader(yaml.SafeLoader):
    """Plain YAML, in which a key may stand only once."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        seen: set[Any] = set()
        for key_node, _ in node.value:
            if not isinstance(key_node, yaml.ScalarNode):
                raise yaml.constructor.ConstructorError(
                    None, None, 'a key that is not a text', key_node.start_mark
                )
            if key_node.value in seen:
                raise yaml.constructor.ConstructorError(
                    None, None, f'{key_node.value!r} a second time', key_node.start_mark
                )
            seen.add(key_node.value)
        return super().construct_mapping(node, deep)


# 1e-3 is a number in ROS 2, to PyYAML a text.
_StrictLoader.add_implicit_resolver(
    'tag:yaml.org,2002:float',
    re.compile(r'[-+]?([0-9]+(\.[0-9]*)?|\.[0-9]+)[eE][-+]?[0-9]+$'),
    list('-+.0123456789'),
)


class _RosLoader(_StrictLoader):
    """Takes plain texts for truth values where ROS 2 does."""

    bool_values: ClassVar[dict[str, bool]] = {
        **yaml.SafeLoader.bool_values,
        'y': True,
        'n': False,
    }

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        for key_node, _ in node.value:
            # Keys are texts to ROS 2.
            if key_node.tag == BOOLEAN:
                key_node.tag = TEXT
        return super().construct_mapping(node, deep)


_RosLoader.add_implicit_resolver(BOOLEAN, re.compile('[yYnN]$'), list('yYnN'))


class _BoundedLoader(_StrictLoader):
    """YAML of bounded depth and count, without aliases: looked at while it is parsed."""

    def __init__(self, text: str, accepts: str) -> None:
        super().__init__(text)
        self._depth = self._count = 0
        self._accepts = accepts

    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        if self.check_event(yaml.AliasEvent):
            raise InvalidValue('parameters', 'an alias', 'every value written out')
        self._depth += 1
        self._count += 1
        if self._depth > DEEPEST + 1:
            got = f'more than {DEEPEST} blocks inside each other'
            raise InvalidValue('parameters', got, self._accepts)
        if self._count > MOST:
            raise InvalidValue('parameters', f'more than {MOST} values', self._accepts)
        node = super().compose_node(parent, index)
        self._depth -= 1
        return node


def read_task(text: str) -> dict[str, Any]:
    """Parameters of a task from a YAML text that anyone may have sent.

    Parameters
    ----------
    text
        YAML of what stands under ``tasks.<name>`` in a parameter file.

    Returns
    -------
    dict
        The parameters, nested as they are there.

    Raises
    ------
    InvalidValue
        As `read_text`.
    """
    return read_text(text, TASK)


def read_text(text: str, accepts: str = CHANGE) -> dict[str, Any]:
    """Parameters from a YAML text that anyone may have sent.

    Parameters
    ----------
    text
        The text.
    accepts
        What it should be, in words.

    Raises
    ------
    InvalidValue
        If the text is longer than `LONGEST`, holds more than `MOST` values, blocks deeper than
        `DEEPEST` or an alias, is not YAML, or not a block.
    """
    if len(text) > LONGEST:
        raise InvalidValue(
            'parameters', f'{len(text)} characters', f'up to {LONGEST} characters of {accepts}'
        )
    try:
        loader = _BoundedLoader(text, accepts)
        try:
            block = loader.get_single_data()
        finally:
            loader.dispose()
    except (yaml.YAMLError, ValueError) as error:
        problem = ' '.join(str(getattr(error, 'problem', error)).split())
        raise InvalidValue('parameters', f'{shown(text)}: {problem}', accepts) from None
    if not isinstance(block, dict) or not block:
        raise InvalidValue('parameters', shown(text), accepts)
    return block


def read_parameter_file(path: str | Path, node: str) -> Flat:
    """Parameters that a ROS 2 parameter file gives to a node of that name.

    Parameters
    ----------
    path
        The YAML file.
    node
        Name of the node. Blocks named so, ``/**`` or ``/**/<node>`` count, later ones over
        earlier ones; blocks of one namespace do not.

    Returns
    -------
    dict
        Values by dotted key, without those of ROS 2 itself, such as ``use_sim_time``.

    Raises
    ------
    InvalidValue
        As `read_blocks`.
    """
    return _merged(read_blocks(path), node)


def parse_parameters(text: str, place: str, node: str) -> Flat:
    """Read parameters as `read_parameter_file` from the text of such a file, found in a place.

    Raises
    ------
    InvalidValue
        As `read_blocks`.
    """
    return _merged(_parse(text, place), node)


def _merged(blocks: Mapping[str, Mapping[str, Any]], node: str) -> Flat:
    """Values by dotted key of the blocks that are for a node, without those of ROS 2 itself."""
    merged: Flat = {}
    for name, block in blocks.items():
        *namespace, last = name.strip('/').split('/')
        if last in (node, *WILDCARDS) and set(namespace) <= set(WILDCARDS):
            merged.update(flatten(block))
    return {key: value for key, value in merged.items() if not key.startswith(ROS_OWN)}


def read_blocks(path: str | Path) -> dict[str, Mapping[str, Any]]:
    """Parameters of every block of a ROS 2 parameter file, nested as they are there.

    Raises
    ------
    InvalidValue
        If the file cannot be read, is not YAML, or has not the form of a parameter file;
        for a list that ROS 2 refuses: an empty one or one that mixes kinds.
    """
    try:
        text = Path(path).read_text(encoding='utf-8')
    except OSError as error:
        raise InvalidValue(str(path), str(error.strerror), 'a readable file') from None
    except UnicodeDecodeError:
        raise InvalidValue(str(path), 'bytes that are not UTF-8', 'a YAML file') from None
    return _parse(text, str(path))


def _parse(text: str, path: str) -> dict[str, Mapping[str, Any]]:
    """Blocks of the text of a parameter file, see `read_blocks`."""
    try:
        document = yaml.load(text, Loader=_RosLoader)
    except yaml.YAMLError as error:
        mark = getattr(error, 'problem_mark', None)
        where = f' in line {mark.line + 1}, column {mark.column + 1}' if mark else ''
        problem = getattr(error, 'problem', None) or 'an error'
        raise InvalidValue(path, f'{problem}{where}', 'YAML') from None
    accepts = 'blocks by node name (or /**), each with ros__parameters'
    if not isinstance(document, Mapping):
        raise InvalidValue(path, shown(document), accepts)
    blocks = {}
    for name, block in document.items():
        parameters = block.get('ros__parameters') if isinstance(block, Mapping) else None
        if not isinstance(parameters, Mapping):
            raise InvalidValue(f'{path}: {name}', shown(block), accepts)
        for key, value in flatten(parameters).items():
            _check_as_ros(key, value)
        blocks[str(name)] = parameters
    return blocks


def _check_as_ros(key: str, value: Any) -> None:
    """Refuse what ROS 2's own parser refuses, with a reason."""
    if value is None:
        raise InvalidValue(key, 'no value', 'a value (or leave the key out)')
    if not isinstance(value, list):
        return
    if not value:
        raise empty_list(key)
    kinds = {type(item) for item in value}
    if kinds == {int, float}:
        raise InvalidValue(
            key,
            f'{shown(value)}, which mixes whole numbers and decimals',
            'one kind in a list: write 1.0 for 1',
        )
    if len(kinds) > 1:
        raise InvalidValue(key, f'{shown(value)}, which mixes kinds', 'one kind in a list')


def empty_list(key: str) -> InvalidValue:
    """Error for a parameter whose value is a list of nothing, which ROS 2 cannot read."""
    accepts = 'at least one value (or leave the key out)'
    if key.rpartition('.')[2] == 'hierarchy':
        accepts = 'at least one value ([""] for no task)'
    return InvalidValue(key, 'an empty list', accepts)

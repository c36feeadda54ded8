"""The present stack as a parameter file."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from tp_controller.config.build import Settings
from tp_controller.config.changes import HIERARCHY
from tp_controller.config.schema import shared_schema
from tp_controller.errors import InvalidValue, shown
from tp_controller.parameters import Flat

SUFFIXES = ('.yaml', '.yml')


def present_parameters(settings: Settings) -> Flat:
    """Every parameter as it is now, by dotted key; a copy.

    Targets are those that the tasks have now, by goals too, and centres of obstacles likewise.
    Parameters without a value are left out.
    """
    found = dict(settings.values)
    for name, task in settings.stack.tasks.items():
        key = f'tasks.{name}.{task.target_key}'
        if task.target is not None and key in found:
            found[key] = tuple(task.target.tolist())
    found[HIERARCHY] = tuple(settings.stack.hierarchy) or ('',)
    return {key: value for key, value in found.items() if value not in (None, ())}


def parameter_text(parameters: Flat, node: str) -> str:
    """Text of a parameter file, which ROS 2 and `read_parameter_file` read.

    Parameters
    ----------
    parameters
        Values by dotted key.
    node
        Name of the node. What a simulator of the robot needs too is for every node.
    """
    shared = {*shared_schema(parameters), 'rate'}
    blocks = {
        '/**': {key: parameters[key] for key in parameters if key in shared},
        f'/**/{node}': {key: parameters[key] for key in parameters if key not in shared},
    }
    document = {name: {'ros__parameters': _nested(block)} for name, block in blocks.items()}
    return yaml.dump(document, Dumper=_Dumper, sort_keys=False, allow_unicode=True, width=99)


def write_text(text: str, path: str, overwrite: bool) -> None:
    """Write a parameter file, all of it or nothing.

    Parameters
    ----------
    text
        What to write.
    path
        An absolute path that ends in one of `SUFFIXES`.
    overwrite
        Whether a file that is there already may be replaced.

    Raises
    ------
    InvalidValue
        If there is such a file, or it cannot be written.
    """
    target = Path(path)
    if not target.is_absolute() or target.suffix not in SUFFIXES or '\0' in path:
        raise InvalidValue('path', shown(path), 'an absolute path that ends in .yaml or .yml')
    part = target.with_name(f'.{target.name}.{os.getpid()}.part')
    try:
        if not overwrite and os.path.lexists(target):
            raise FileExistsError
        try:
            with part.open('x', encoding='utf-8') as file:
                file.write(text)
                file.flush()
                os.fsync(file.fileno())
            # A link fails where a file has come meanwhile; to replace one does not.
            (os.replace if overwrite else os.link)(part, target)
        finally:
            part.unlink(missing_ok=True)
    except FileExistsError:
        got, accepts = f'{shown(path)}, which exists', 'a new file, or overwrite: true'
        raise InvalidValue('path', got, accepts) from None
    except OSError as error:
        got = f'{shown(path)}: {error.strerror}'
        raise InvalidValue('path', got, 'a file that can be written') from None


class _Dumper(yaml.SafeDumper):
    """Texts in quotes, as ROS 2 takes y, on and 1e3 for other things; lists in one line."""

    def ignore_aliases(self, data: Any) -> bool:
        """Write equal values out again: ROS 2 reads no aliases."""
        return True


def _text(dumper: yaml.SafeDumper, value: str) -> yaml.ScalarNode:
    style = '|' if '\n' in value else '"'
    return dumper.represent_scalar('tag:yaml.org,2002:str', value, style=style)


def _mapping(dumper: yaml.SafeDumper, block: dict[str, Any]) -> yaml.MappingNode:
    node = dumper.represent_mapping('tag:yaml.org,2002:map', block, flow_style=False)
    for key, _ in node.value:
        key.style = None
    return node


def _list(dumper: yaml.SafeDumper, items: list[Any]) -> yaml.SequenceNode:
    return dumper.represent_sequence('tag:yaml.org,2002:seq', items, flow_style=True)


_Dumper.add_representer(str, _text)
_Dumper.add_representer(list, _list)
_Dumper.add_representer(dict, _mapping)


def _nested(flat: Mapping[str, Any]) -> dict[str, Any]:
    nested: dict[str, Any] = {}
    for key, value in flat.items():
        *blocks, leaf = key.split('.')
        place = nested
        for block in blocks:
            place = place.setdefault(block, {})
        place[leaf] = [_plain(item) for item in value] if isinstance(value, tuple) else value
    return nested


def _plain(item: Any) -> Any:
    """Value of a list without numpy's own kinds of numbers."""
    return float(item) if isinstance(item, float) else item

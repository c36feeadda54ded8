"""Parameter files as dictionaries: blocks by node name, each with its parameters."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from tp_controller.config import read_blocks

Document = Mapping[str, Any]
"""Parameters by node name or ``/**``, nested."""

ANY_NAMESPACE = '/**/'


def read_document(path: str | Path) -> Document:
    """Read the blocks of a ROS 2 parameter file.

    A block for a node in any namespace, ``/**/tp_controller``, goes by the node's name.

    Raises
    ------
    InvalidValue
        As `read_blocks`.
    """
    document: dict[str, Any] = {}
    for name, block in read_blocks(path).items():
        node = name.removeprefix(ANY_NAMESPACE)
        document[node] = edited(document.get(node, {}), block)
    return document


def write_document(document: Document, path: str | Path) -> None:
    """Write blocks as a ROS 2 parameter file for nodes in any namespace."""
    blocks = {
        name if name.startswith('/') else ANY_NAMESPACE + name: {'ros__parameters': dict(block)}
        for name, block in document.items()
    }
    Path(path).write_text(yaml.safe_dump(blocks, sort_keys=False), encoding='utf-8')


def edited(document: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """Copy of nested dictionaries with changes put in; a value of None removes its key."""
    result = dict(document)
    for key, change in changes.items():
        if change is None:
            result.pop(key, None)
        elif isinstance(change, Mapping):
            result[key] = edited(result.get(key, {}), change)
        else:
            result[key] = change
    return result

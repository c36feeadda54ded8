"""Parameter files as dictionaries: blocks by node name, each with its parameters."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

Document = Mapping[str, Any]
"""Parameters by block name, such as ``/**`` or ``tp_controller``, nested."""


def read_document(path: str | Path) -> Document:
    """Read the blocks of a ROS 2 parameter file."""
    blocks = yaml.safe_load(Path(path).read_text(encoding='utf-8'))
    return {name: block['ros__parameters'] for name, block in blocks.items()}


def write_document(document: Document, path: str | Path) -> None:
    """Write blocks as a ROS 2 parameter file."""
    blocks = {name: {'ros__parameters': dict(block)} for name, block in document.items()}
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

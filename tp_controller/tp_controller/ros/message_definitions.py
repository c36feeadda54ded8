"""Definitions of messages as texts, from the ``.msg`` files that their packages install."""

from __future__ import annotations

import importlib
import re
from functools import cache
from pathlib import Path
from typing import Any

from ament_index_python.packages import PackageNotFoundError, get_package_share_directory

from tp_controller.errors import InvalidValue, shown

SEPARATOR = '=' * 80
NESTED = re.compile(r'([a-z][a-z0-9_]*)/([A-Z]\w*)')
"""A message inside another, as its class tells the types of its fields."""


@cache
def message_class(message_type: str) -> Any:
    """Class of a type such as ``sensor_msgs/msg/JointState``.

    Raises
    ------
    InvalidValue
        If its package is not installed, or it is no message.
    """
    package, _, name = message_type.partition('/msg/')
    try:
        return getattr(importlib.import_module(f'{package}.msg'), name)
    except (ImportError, AttributeError, ValueError):
        accepts = 'messages of packages that are installed'
        raise InvalidValue('type', shown(message_type), accepts) from None


@cache
def full_definition(message_type: str) -> str:
    """Text of a message's file, followed by those of all messages in it.

    Raises
    ------
    InvalidValue
        If the package is not installed, or has no such file.
    """
    package, _, name = message_type.partition('/msg/')
    parts = [_own_definition(package, name)]
    for other in _inside(package, name):
        text = _own_definition(*other)
        parts.append(f'{SEPARATOR}\nMSG: {"/".join(other)}\n{text}')
    return '\n'.join(parts)


def _inside(package: str, name: str) -> list[tuple[str, str]]:
    """Messages inside a message, each once."""
    found: dict[tuple[str, str], None] = {}
    ahead = [(package, name)]
    while ahead:
        fields = message_class('/msg/'.join(ahead.pop(0))).get_fields_and_field_types()
        for kind in fields.values():
            for nested in NESTED.findall(kind):
                if nested not in found:
                    found[nested] = None
                    ahead.append(nested)
    return list(found)


def _own_definition(package: str, name: str) -> str:
    try:
        share = Path(get_package_share_directory(package))
        return (share / 'msg' / f'{name}.msg').read_text(encoding='utf-8')
    except (PackageNotFoundError, OSError):
        accepts = 'messages whose .msg file is installed'
        raise InvalidValue('type', shown(f'{package}/msg/{name}'), accepts) from None

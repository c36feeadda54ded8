"""Recursive task-priority control of robot arms; no ROS is imported here.

The ROS 2 nodes are in `tp_controller.ros`. The names below are loaded on first use, so that
an executable can take charge of its signals before numpy and Pinocchio are read.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from tp_controller.config import build_settings, read_parameter_file
    from tp_controller.errors import InvalidValue, TaskPriorityError, UnusableState
    from tp_controller.stack import LevelResult, Stack, Step

__all__ = [
    'InvalidValue',
    'LevelResult',
    'Stack',
    'Step',
    'TaskPriorityError',
    'UnusableState',
    'build_settings',
    'read_parameter_file',
]


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    for module in ('errors', 'stack', 'config'):
        found = importlib.import_module(f'{__name__}.{module}')
        if hasattr(found, name):
            return getattr(found, name)
    raise AttributeError(name)

"""Files of packages: in the share folders of ROS packages, or of Python wheels."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from pathlib import Path

from tp_controller.errors import InvalidValue, shown

KEY = 'robot.urdf'
LONGEST_PATH = 400
"""So many characters of a path are shown."""
PACKAGE = 'package://'


def read_description(path: str) -> str:
    """Text of a URDF file.

    Parameters
    ----------
    path
        A path, or ``package://<package>/<path>`` in the share folder of a ROS package or of
        a wheel such as example-robot-data.

    Raises
    ------
    InvalidValue
        If there is no such package or file.
    """
    place = place_of(path)
    try:
        return place.read_text(encoding='utf-8')
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, 'strerror', None) or 'bytes that are not UTF-8'
        raise InvalidValue(
            KEY, f'{shown(path, LONGEST_PATH)} ({reason})', 'a readable URDF file'
        ) from None


def place_of(path: str) -> Path:
    """Where a file is: a path, or ``package://<package>/<path>`` as for `read_description`.

    Raises
    ------
    InvalidValue
        If there is no such package.
    """
    if not path.startswith(PACKAGE):
        return Path(path).expanduser()
    package, _, rest = path.removeprefix(PACKAGE).partition('/')
    return _share(package) / rest


def _share(package: str) -> Path:
    """Share folder of a package."""
    for prefix in _prefixes():
        share = prefix / 'share' / package
        if share.is_dir():
            return share
    raise InvalidValue(
        KEY, f'the package {shown(package)}', 'a package in AMENT_PREFIX_PATH or of this Python'
    )


def _prefixes() -> Iterator[Path]:
    """Folders that packages are installed into: those of ROS first, then those of Python."""
    yield from map(Path, filter(None, os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep)))
    # Wheels of robotics libraries, Pinocchio's among them, share a prefix beside the modules.
    yield from (Path(folder) / 'cmeel.prefix' for folder in sys.path)
    yield Path(sys.prefix)

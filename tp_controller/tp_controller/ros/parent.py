"""A process that ``ros2 run`` or ``ros2 launch`` has started ends with it.

A Ctrl-C in the terminal reaches both. ``kill`` reaches ``ros2`` alone, which then ends at once and
leaves what it has started behind: an arm that goes on, and nobody in front of it.
"""

from __future__ import annotations

import ctypes
import os
import signal
from itertools import pairwise
from pathlib import Path

_PR_SET_PDEATHSIG = 1
_VERBS = ('run', 'launch')


def end_with_ros2() -> None:
    """Have this process get SIGTERM when the ``ros2`` that has started it ends."""
    parent = os.getppid()
    if not _is_ros2(parent):
        return
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)
    if os.getppid() != parent:
        # It ended meanwhile.
        os.kill(os.getpid(), signal.SIGTERM)


def _is_ros2(process: int) -> bool:
    """Whether a process is the command ``ros2 run`` or ``ros2 launch``."""
    try:
        words = Path(f'/proc/{process}/cmdline').read_bytes().decode(errors='replace').split('\0')
    except OSError:
        return False
    # The interpreter may come first.
    return any(
        os.path.basename(word) == 'ros2' and verb in _VERBS for word, verb in pairwise(words[:4])
    )

"""Work that takes long, kept from the cycle: by a thread of its own, or in pieces."""

from __future__ import annotations

import sys
from collections.abc import Callable, Generator, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any, TypeVar

from rclpy.node import Node

T = TypeVar('T')

SWITCH_INTERVAL = 0.0001
"""Longest time [s] for which the thread keeps the cycle waiting."""


class Apart:
    """Does one piece of work after the other; joint states are answered meanwhile.

    Parameters
    ----------
    node
        The controller's node.
    """

    def __init__(self, node: Node) -> None:
        self._node = node
        self._thread = ThreadPoolExecutor(1, 'services')
        sys.setswitchinterval(SWITCH_INTERVAL)

    async def run(self, work: Callable[[], T]) -> T:
        """Do work in the thread."""
        future = self._thread.submit(work)
        future.add_done_callback(lambda _: _wake(self._node))
        while not future.done():
            await _Pause()
        return future.result()

    def begin(self, work: Callable[[], object]) -> None:
        """Do work in the thread, for which nobody waits."""
        self._thread.submit(work)

    async def in_pieces(self, pieces: Iterator[None]) -> None:
        """Do work between cycles, with a pause after each piece."""
        for _ in pieces:
            await _Pause(self._node)


class _Pause:
    """A moment in which the executor does what else there is to do.

    Parameters
    ----------
    node
        Node whose executor is not to wait for anything then; None if it may wait.
    """

    def __init__(self, node: Node | None = None) -> None:
        if node is not None:
            _wake(node)

    def __await__(self) -> Generator[Any, None, None]:
        yield


def _wake(node: Node) -> None:
    if node.executor is not None:
        node.executor.wake()

"""Waiting for answers of other nodes."""

from __future__ import annotations

import time
from collections.abc import Callable

import rclpy
from rclpy.node import Node


def spin_until(node: Node, timeout: float, condition: Callable[[], bool], otherwise: str) -> None:
    """Spin a node until a condition holds.

    Raises
    ------
    TimeoutError
        If it does not within a time [s]: ``otherwise`` says what that means.
    """
    end = time.monotonic() + timeout
    while not condition():
        if time.monotonic() > end:
            raise TimeoutError(f'{otherwise} (waited {timeout:g} s)')
        rclpy.spin_once(node, timeout_sec=0.1)

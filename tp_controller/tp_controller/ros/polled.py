"""Subscriptions that are read when it suits, not by an executor."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

from rclpy.callback_groups import CallbackGroup
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.subscription import Subscription


class Polled(CallbackGroup):
    """Callback group of a subscription that no executor executes: `take` reads it.

    Its events are not executed either: with one of them in its wait set, an executor wakes at
    every message.
    """

    def can_execute(self, entity: Any) -> bool:
        """Whether an executor may execute it: never."""
        return False

    def beginning_execution(self, entity: Any) -> bool:
        """Let it begin."""
        return True

    def ending_execution(self, entity: Any) -> None:
        """Let it end."""


def subscribe(
    node: Node, message_type: type, topic: str, qos: QoSProfile | int, raw: bool = False
) -> Subscription:
    """Subscribe to a topic that is polled; `raw` messages are taken as bytes."""
    return node.create_subscription(
        message_type, topic, _ignore, qos, callback_group=Polled(), raw=raw
    )


def take(subscription: Subscription) -> Any:
    """Take the next message of a polled subscription, None if there is none."""
    with subscription.handle:
        found = subscription.handle.take_message(subscription.msg_type, subscription.raw)
    return None if found is None else found[0]


def taker(subscription: Subscription) -> Callable[[], tuple[Any, dict[str, Any]] | None]:
    """Make what takes the next message of a polled subscription, and what is known about it.

    It returns None if there is no message. Whoever calls it again and again saves half the time
    of `take`; the subscription must not be destroyed by another thread.
    """
    return partial(subscription.handle.take_message, subscription.msg_type, subscription.raw)


def _ignore(_: Any) -> None:
    """Stand in for a callback."""

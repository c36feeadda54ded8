"""Other nodes that publish what only one may publish."""

from __future__ import annotations

from rclpy.node import Node

from tp_controller.ros.warnings import Warnings


class Neighbours:
    """Finds second publishers of the command and of the joint states.

    Parameters
    ----------
    node
        The controller's node.
    command_topic, state_topic
        Full names of the topics.
    warnings
        Where they are told.
    """

    def __init__(
        self, node: Node, command_topic: str, state_topic: str, warnings: Warnings
    ) -> None:
        self._node = node
        self._topics = {
            command_topic: 'two controllers move one arm',
            state_topic: 'the arm jumps between two states',
        }
        self._warnings = warnings
        self._state_topic = state_topic
        self._found: dict[str, bool] = {}

    @property
    def alone(self) -> bool:
        """Whether one node at most publishes joint states."""
        return not self._found.get(self._state_topic, False)

    def look(self) -> None:
        """Look for them, and warn of those that are there for the second time in a row."""
        for topic, hazard in self._topics.items():
            seen, several = self._found.get(topic, False), self._node.count_publishers(topic) > 1
            self._found[topic] = several
            if several and seen:
                self._warnings.warn(topic, f'{topic} has {self._names(topic)}: {hazard}')

    def _names(self, topic: str) -> str:
        names = sorted(
            f'{info.node_namespace.rstrip("/")}/{info.node_name}'
            for info in self._node.get_publishers_info_by_topic(topic)
        )
        return f'{len(names)} publishers, {", ".join(names)}'

"""What is around the control of an arm: other nodes on its topics, and what is shown of it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rclpy.subscription import Subscription
from visualization_msgs.msg import MarkerArray

from tp_controller.ros.commands import is_stamped
from tp_controller.ros.control import Control
from tp_controller.ros.diagnostics import PERIOD as DIAGNOSTICS_PERIOD
from tp_controller.ros.diagnostics import Diagnostics
from tp_controller.ros.markers import PERIOD as MARKER_PERIOD
from tp_controller.ros.markers import Markers
from tp_controller.ros.neighbours import Neighbours
from tp_controller.ros.receivers import PERIOD as RECEIVER_PERIOD
from tp_controller.ros.receivers import Receivers
from tp_controller.ros.robot_node import RobotNode

if TYPE_CHECKING:
    from tp_controller.ros.around import Around

NEIGHBOUR_PERIOD = 1.0
"""Time [s] between two looks for other publishers; all that are not heard are found in it."""
RECEIVERS = 'receivers'
"""What warnings about readers of the commands are about."""


class Surroundings:
    """Looks for other publishers and for readers, and publishes markers and diagnostics.

    Parameters
    ----------
    node
        The controller's node.
    control
        Its parts.
    diagnostics
        Tell of them.

    Attributes
    ----------
    around
        Goes ways around, which the markers show; None before it is there.
    """

    def __init__(self, node: RobotNode, control: Control, diagnostics: Diagnostics) -> None:
        settings, intake, warnings = control.settings, control.intake, control.warnings
        self._node, self._tasks, self._watch = node, settings.stack.tasks, control.watch
        self._inputs, self._intake, self._warnings = control.inputs, intake, warnings
        robot, commands, state = settings.stack.robot, control.commands, control.state.msg
        self._neighbours = Neighbours(node, commands.topic, intake.topic, warnings, intake.others)
        self._receivers: Receivers | None = None
        if not is_stamped(settings.values['command.type']):
            interface = 'position' if control.positions else 'velocity'
            self._receivers = Receivers(node, commands, robot.joints, interface, self._tell)
            node.make_timer(RECEIVER_PERIOD, self._receivers.look)
        self.around: Around | None = None
        self._markers = Markers(robot, state, self._tasks.values())
        self._state, self._publisher = state, node.create_publisher(MarkerArray, '~/markers', 10)
        node.make_timer(MARKER_PERIOD, self._publish_markers)
        node.make_timer(NEIGHBOUR_PERIOD, self._look_for_neighbours)
        rate = settings.values['rate']
        diagnostics.begin(settings.stack, state, rate, control.watch, commands, warnings)
        node.make_timer(DIAGNOSTICS_PERIOD, diagnostics.tick)

    def follow_tasks(self) -> None:
        """Show the tasks that there are now."""
        self._markers.follow_tasks(self._tasks.values())

    def look(self, period: float) -> None:
        """Look at some of the topics; to be called again and again with a period [s]."""
        self._neighbours.listen(self._polled, period / NEIGHBOUR_PERIOD)

    def close(self) -> None:
        """Let readers be."""
        if self._receivers is not None:
            self._receivers.close()

    def _tell(self, problem: str) -> None:
        self._warnings.clear(RECEIVERS)
        if problem:
            self._warnings.warn(RECEIVERS, problem, lasting=True)

    def _publish_markers(self) -> None:
        if self._state.cycles and self._publisher.get_subscription_count():
            if self.around is not None:
                self._markers.way = self.around.places
            stamp = self._node.get_clock().now().to_msg()
            self._publisher.publish(self._markers.array(stamp))

    def _look_for_neighbours(self) -> None:
        self._warnings.flush()
        self._neighbours.look()
        if not self._inputs.active:
            self._neighbours.listen(self._polled)
        self._watch.single_publisher = self._neighbours.alone

    @property
    def _polled(self) -> list[Subscription]:
        return [self._intake.subscription, *self._inputs.subscriptions]

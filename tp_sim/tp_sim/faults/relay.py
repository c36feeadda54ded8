"""Stands between simulator and controller: passes on, disturbs, and records both ways."""

from __future__ import annotations

import heapq
import itertools
import threading
import time
from dataclasses import dataclass
from typing import Any

import rclpy
from rclpy.context import Context
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from tp_controller.ros.polled import subscribe, taker
from tp_sim.faults.disturbances import Delivery, Disturbance, passed_on
from tp_sim.faults.record import Command, Motion, Sent
from tp_sim.harness import PrivateDomain

PLANT_STATES, PLANT_COMMANDS = 'plant/joint_states', 'plant/command'
"""Topics on the simulator's side."""
LONGEST_WAIT = 0.02
DEPTH = 1000


@dataclass(frozen=True)
class Topics:
    """Names on the controller's side, and the form of its commands."""

    states: str = 'joint_states'
    commands: str = 'joint_velocity_command'
    goals: str = 'tp_controller/ee_position/goal'
    stamped: bool = True
    """Whether commands are sensor_msgs/JointState, else std_msgs/Float64MultiArray."""

    @property
    def command_type(self) -> type:
        """Message type of commands."""
        return JointState if self.stamped else Float64MultiArray


class Relay:
    """Passes joint states one way and commands the other, in a thread of its own.

    Times are those of the wall clock. For a command it is the time at which the middleware sent
    it, so that a relay that runs late does not make it look old.

    Parameters
    ----------
    domain
        Where the nodes are.
    topics
        Names on the controller's side.
    namespace
        Namespace of both sides.

    Attributes
    ----------
    sent, commands, motions
        Everything so far; only ever appended to.
    disturbance
        What happens to joint states; may be set at any time.
    """

    def __init__(self, domain: PrivateDomain, topics: Topics, namespace: str = '') -> None:
        self.sent: list[Sent] = []
        self.commands: list[Command] = []
        self.motions: list[Motion] = []
        self.disturbance: Disturbance = passed_on
        self._stamped = topics.stamped
        self._due: list[tuple[float, int, Delivery]] = []
        self._count = itertools.count()
        self._stopped = False
        self._failure: BaseException | None = None
        self._context = Context()
        with domain.entered():
            rclpy.init(args=[], context=self._context, domain_id=domain.number)
            self._node = rclpy.create_node(
                'relay', context=self._context, namespace=namespace, use_global_arguments=False
            )
        qos = QoSProfile(depth=DEPTH)
        self._to_controller = self._node.create_publisher(JointState, topics.states, qos)
        self._to_plant = self._node.create_publisher(topics.command_type, PLANT_COMMANDS, qos)
        self._subscriptions = (
            subscribe(self._node, JointState, PLANT_STATES, qos),
            subscribe(self._node, topics.command_type, topics.commands, qos),
        )
        self._wait_set = rclpy_implementation.WaitSet(2, 0, 0, 0, 0, 0, self._context.handle)
        self._thread = threading.Thread(target=self._run, name='relay', daemon=True)
        self._thread.start()

    @property
    def listeners(self) -> int:
        """How many listen to its joint states."""
        return int(self._to_controller.get_subscription_count())

    def check(self) -> None:
        """Raise what ended the thread, if anything did."""
        if self._failure is not None:
            raise self._failure

    def close(self) -> None:
        """Stop and leave the domain."""
        self._stopped = True
        self._thread.join()
        self._node.destroy_node()
        rclpy.try_shutdown(context=self._context)

    def _run(self) -> None:
        try:
            states, commands = map(taker, self._subscriptions)
            while not self._stopped:
                self._wait()
                self._send_due()
                while (found := states()) is not None:
                    self._take_state(*found)
                while (found := commands()) is not None:
                    self._take_command(*found)
        except BaseException as error:
            self._failure = error

    def _wait(self) -> None:
        wait = LONGEST_WAIT
        if self._due:
            wait = min(wait, max(0.0, self._due[0][0] - time.time()))
        wait_set = self._wait_set
        wait_set.clear_entities()
        for subscription in self._subscriptions:
            wait_set.add_subscription(subscription.handle)
        wait_set.wait(int(1e9 * wait))

    def _take_state(self, msg: JointState, info: dict[str, Any]) -> None:
        now = time.time()
        sent = 1e-9 * (info.get('source_timestamp') or 0) or now
        motion = Motion(sent, tuple(msg.position), tuple(msg.velocity))
        self.motions.append(motion)
        for delivery in self.disturbance(Delivery(msg, origin=motion, taken=now)):
            heapq.heappush(self._due, (now + delivery.delay, next(self._count), delivery))
        self._send_due()

    def _send_due(self) -> None:
        while self._due and self._due[0][0] <= time.time():
            due, _, delivery = heapq.heappop(self._due)
            now = time.time()
            stamp, origin = delivery.msg.header.stamp, delivery.origin
            assert origin is not None
            self.sent.append(
                Sent(
                    stamp.sec * 1_000_000_000 + stamp.nanosec,
                    now,
                    # What the relay holds back makes data old; that it runs late does not.
                    delivery.taken + now - due,
                    delivery.usable,
                    origin.velocity,
                )
            )
            self._to_controller.publish(delivery.msg)

    def _take_command(self, msg: Any, info: dict[str, Any]) -> None:
        sent = 1e-9 * (info.get('source_timestamp') or 0) or time.time()
        if self._stamped:
            stamp = msg.header.stamp.sec * 1_000_000_000 + msg.header.stamp.nanosec
            self.commands.append(Command(stamp, sent, tuple(msg.velocity)))
        else:
            self.commands.append(Command(0, sent, tuple(msg.data)))
        self._to_plant.publish(msg)

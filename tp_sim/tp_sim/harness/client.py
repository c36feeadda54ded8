"""The harness's own node: publishes, listens, calls services, waits for conditions."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import rclpy
from rcl_interfaces.srv import SetParametersAtomically
from rclpy.action import ActionClient
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile
from rclpy.subscription import Subscription
from std_msgs.msg import String

from tp_controller.errors import listed
from tp_controller.ros.goals import feedforward_message, goal_message
from tp_controller.ros.robot_node import TOPIC, TOPIC_QOS
from tp_interfaces.action import Reach
from tp_interfaces.msg import ControllerState, TaskGoal, TaskState
from tp_interfaces.srv import AddTask, Change, RemoveTask, Step
from tp_sim.harness.domain import PrivateDomain
from tp_sim.harness.errors import GoalRejected, HarnessError

TIMEOUT = 60.0
"""Longest wait [s] for an answer, generous for a loaded machine."""
LOST = 10.0
"""Time [s] after which a service is called once more."""
ONCE = (AddTask, Change, RemoveTask, Step)
"""Services that do something else when they are called again."""


class ReachCall:
    """A goal of ``~/reach`` under way.

    Parameters
    ----------
    handle
        Its goal handle.
    feedback
        List to which its feedback is appended.
    wait_for
        Waits for a condition, see `Client.wait_for`.
    """

    def __init__(
        self, handle: Any, feedback: list[Reach.Feedback], wait_for: Callable[..., None]
    ) -> None:
        self.feedback = feedback
        self._handle, self._wait_for = handle, wait_for
        self._future = handle.get_result_async()

    @property
    def result(self) -> Reach.Result | None:
        """Its result, None before it has ended."""
        return self._future.result().result if self._future.done() else None

    def cancel(self) -> None:
        """Ask for its end, and wait until the controller has taken that."""
        self._wait_for(self._handle.cancel_goal_async().done, 'an answer to the cancellation')

    def wait(self) -> Reach.Result:
        """Wait for its result; joint states have to go on by themselves."""
        self._wait_for(self._future.done, 'the result of reach')
        return self._future.result().result


class Client:
    """Talks to a controller and a simulator on a private domain.

    Parameters
    ----------
    domain
        The domain.
    namespace
        Namespace of the robot's nodes.
    alive
        Called while waiting; raises `HarnessError` when waiting is in vain.
    """

    def __init__(
        self,
        domain: PrivateDomain,
        namespace: str = '',
        alive: Callable[[], None] = lambda: None,
    ) -> None:
        self._alive = alive
        self._context = Context()
        self._namespace = namespace
        with domain.entered():
            rclpy.init(args=[], context=self._context, domain_id=domain.number)
            self.node: Node = self.make_node('harness')
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.node)
        self._publishers: dict[str, Publisher] = {}
        self._service_clients: dict[str, Any] = {}
        self._reach_client: ActionClient | None = None
        self.state: ControllerState | None = None
        """Newest state of the controller."""
        self.on_state: list[Callable[[ControllerState], None]] = []
        """Called with every state of the controller."""
        self._state_subscription = self.subscribe(
            ControllerState, 'tp_controller/state', self._keep_state
        )

    def make_node(self, name: str) -> Node:
        """Make a node of that name on the domain, which nobody spins."""
        return rclpy.create_node(
            name,
            context=self._context,
            namespace=self._namespace,
            use_global_arguments=False,
            start_parameter_services=False,
        )

    def close(self) -> None:
        """Leave the domain."""
        self._executor.shutdown()
        self.node.destroy_node()
        rclpy.try_shutdown(context=self._context)

    def wait_for(self, condition: Callable[[], bool], what: str, timeout: float = TIMEOUT) -> None:
        """Handle messages until a condition holds.

        Raises
        ------
        HarnessError
            If it does not within ``timeout`` [s].
        """
        end = time.monotonic() + timeout
        while not condition():
            if time.monotonic() > end:
                raise HarnessError(f'waited {timeout:g} s in vain for {what}')
            self._alive()
            self._executor.spin_once(timeout_sec=0.1)

    def spin_for(self, seconds: float) -> None:
        """Handle messages for a time [s]."""
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0.0:
            self._alive()
            self._executor.spin_once(timeout_sec=min(left, 0.1))

    def subscribe(
        self, message_type: type, topic: str, callback: Callable[[Any], None]
    ) -> Subscription:
        """Call back for every message of a topic, none of them dropped here."""
        return self.node.create_subscription(message_type, topic, callback, QoSProfile(depth=5000))

    def ignore_state(self) -> None:
        """Stop listening to the controller's state, which then need not publish it."""
        self.node.destroy_subscription(self._state_subscription)

    def collect(self, message_type: type, topic: str) -> list[Any]:
        """List to which every further message of a topic is appended."""
        messages: list[Any] = []
        self.subscribe(message_type, topic, messages.append)
        return messages

    def publish(self, topic: str, msg: Any) -> None:
        """Publish to a topic once somebody listens to it."""
        if topic not in self._publishers:
            self._publishers[topic] = self.node.create_publisher(type(msg), topic, 100)
        publisher = self._publishers[topic]
        self.wait_for(lambda: publisher.get_subscription_count() > 0, f'a listener to {topic}')
        publisher.publish(msg)

    def publish_description(self, text: str) -> None:
        """Publish a URDF as ``robot_description``; who comes later gets it too."""
        if TOPIC not in self._publishers:
            self._publishers[TOPIC] = self.node.create_publisher(String, TOPIC, TOPIC_QOS)
        self._publishers[TOPIC].publish(String(data=text))

    def call(self, service_type: Any, name: str, request: Any, timeout: float = TIMEOUT) -> Any:
        """Call a service and return its response.

        A first answer is lost if its sender does not know its receiver yet, on a busy machine. So
        what may be asked for twice is.

        Raises
        ------
        HarnessError
            If there is none or it does not answer in time.
        """
        if name not in self._service_clients:
            self._service_clients[name] = self.node.create_client(service_type, name)
        client = self._service_clients[name]
        self.wait_for(client.service_is_ready, f'the service {name}', timeout)
        begin = time.monotonic()
        calls = [client.call_async(request)]

        def done() -> bool:
            late = time.monotonic() > begin + LOST * len(calls)
            if late and service_type not in ONCE:
                calls.append(client.call_async(request))
            return any(call.done() for call in calls)

        self.wait_for(done, f'an answer of {name}', timeout)
        return next(call for call in calls if call.done()).result()

    def set_parameters(self, node: str, values: Mapping[str, Any]) -> None:
        """Set parameters of a node, all of them or none.

        Raises
        ------
        GoalRejected
            If the node refuses, with its reason.
        """
        request = SetParametersAtomically.Request()
        request.parameters = [
            Parameter(name, value=value).to_parameter_msg() for name, value in values.items()
        ]
        service = f'{node}/set_parameters_atomically'
        result = self.call(SetParametersAtomically, service, request).result
        if not result.successful:
            raise GoalRejected(result.reason)

    def task(self, name: str) -> TaskState:
        """Newest state of a task.

        Raises
        ------
        HarnessError
            If the controller has no such task.
        """
        self.wait_for(lambda: self.state is not None, 'a state of the controller')
        assert self.state is not None
        for task in self.state.tasks:
            if task.name == name:
                return task
        names = [task.name for task in self.state.tasks]
        raise HarnessError(f'no task {name!r}; there are {listed(names)}')

    def send_goal(self, name: str, values: Sequence[float], frame: str = '') -> None:
        """Send a goal and wait until the controller has taken it.

        Parameters
        ----------
        name
            Name of the task.
        values
            As ``target`` in a parameter file.
        frame
            Frame that they are given in; empty for the base frame.

        Raises
        ------
        InvalidValue
            If the values are not those of such a task.
        GoalRejected
            If the controller refuses.
        """
        self.publish_goal(name, goal_message(self.task(name), values, frame))

    def publish_goal(self, name: str, msg: Any) -> None:
        """Publish a goal message and wait until the controller has taken it.

        Raises
        ------
        GoalRejected
            If the controller refuses.
        """
        before = self.task(name)
        self.publish(f'tp_controller/{name}/goal', msg)

        def answered() -> bool:
            now = self.task(name)
            counts = (now.accepted_goals, now.rejected_goals)
            return counts != (before.accepted_goals, before.rejected_goals)

        self.wait_for(answered, f'an answer to the goal of {name}')
        if self.task(name).rejected_goals > before.rejected_goals:
            raise GoalRejected(f'{name}: {self.task(name).message}')

    def start_reach(
        self,
        goals: Mapping[str, Sequence[float]],
        tolerance: float | None = None,
        time_limit: float = 0.0,
        frame: str = '',
        around: bool = False,
    ) -> ReachCall:
        """Send a goal to ``~/reach`` and wait until the controller has taken it.

        Parameters
        ----------
        goals
            Values as ``target`` in a parameter file, by task.
        tolerance
            Largest error norm [m, rad] that counts as reached; the action's default if None.
        time_limit
            Time [s] after which it is given up; 0 for none.
        frame
            Frame that the values are given in; empty for the base frame.
        around
            Whether a way around is looked for.
        """
        if self._reach_client is None:
            self._reach_client = ActionClient(self.node, Reach, 'tp_controller/reach')
        self.wait_for(self._reach_client.server_is_ready, 'the action reach')
        goal = Reach.Goal(time_limit=time_limit, around=around)
        goal.goals = [
            TaskGoal(task=name, values=[float(value) for value in values], frame_id=frame)
            for name, values in goals.items()
        ]
        if tolerance is not None:
            goal.tolerance = tolerance
        feedback: list[Reach.Feedback] = []
        sent = self._reach_client.send_goal_async(
            goal, feedback_callback=lambda message: feedback.append(message.feedback)
        )
        self.wait_for(sent.done, 'an answer of reach')
        return ReachCall(sent.result(), feedback, self.wait_for)

    def send_feedforward(self, name: str, values: Sequence[float], frame: str = '') -> None:
        """Send a feedforward and wait until the controller uses it.

        Raises
        ------
        InvalidValue
            If the values are not those of such a task.
        GoalRejected
            If the controller refuses.
        """
        msg = feedforward_message(self.task(name), values, frame)
        self.publish_feedforward(name, msg)

    def publish_feedforward(self, name: str, msg: Any) -> None:
        """Publish a feedforward message and wait until the controller has taken it.

        Raises
        ------
        GoalRejected
            If the controller refuses.
        """
        self.wait_for(lambda: self.state is not None, 'a state of the controller')
        assert self.state is not None
        rejected = self.state.rejected_goals
        accepted = self.task(name).accepted_feedforwards
        self.publish(f'tp_controller/{name}/feedforward', msg)

        def answered() -> bool:
            assert self.state is not None
            taken = self.task(name).accepted_feedforwards > accepted
            return taken or self.state.rejected_goals > rejected

        self.wait_for(answered, f'an answer to the feedforward of {name}')
        if self.state.rejected_goals > rejected:
            raise GoalRejected(f'{name}: {self.task(name).message}')

    def _keep_state(self, msg: ControllerState) -> None:
        self.state = msg
        for callback in self.on_state:
            callback(msg)

"""What a user does with a controller: goals, feedforwards, ``~/reach``; its state."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from rclpy.action import ActionClient

from tp_controller.errors import listed
from tp_controller.ros.goals import feedforward_message, goal_message
from tp_interfaces.action import Reach
from tp_interfaces.msg import ControllerState, TaskGoal, TaskState
from tp_sim.harness.domain import PrivateDomain
from tp_sim.harness.errors import GoalRejected, HarnessError
from tp_sim.harness.messenger import Messenger


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


class Client(Messenger):
    """Talks to a controller on a private domain; the parameters are those of `Messenger`."""

    def __init__(
        self, domain: PrivateDomain, namespace: str = '', alive: Callable[[], None] | None = None
    ) -> None:
        super().__init__(domain, namespace, alive)
        self._reach_client: ActionClient | None = None
        self.state: ControllerState | None = None
        """Newest state of the controller."""
        self.on_state: list[Callable[[ControllerState], None]] = []
        """Called with every state of the controller."""
        self._state_subscription = self.subscribe(
            ControllerState, 'tp_controller/state', self._keep_state
        )

    def ignore_state(self) -> None:
        """Stop listening to the controller's state, which then need not publish it."""
        self.node.destroy_subscription(self._state_subscription)

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

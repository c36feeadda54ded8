"""What the page asks for on its way to the nodes, and what they answer."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable
from functools import partial
from typing import Any

from rcl_interfaces.srv import SetParametersAtomically
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.publisher import Publisher
from std_srvs.srv import SetBool

from tp_controller.errors import InvalidValue
from tp_controller.ros.goals import goal_message
from tp_controller.view.wishes import Change, Goal, Hold, Reset, Save, Wish
from tp_interfaces.msg import ControllerState
from tp_interfaces.srv import Reset as ResetService
from tp_interfaces.srv import Save as SaveService

UNANSWERED = 20
"""Calls that wait for an answer at most, those of hold apart."""
LOST = 5.0
"""Time [s] after which an answer is no longer waited for."""


class ViewLink:
    """Sends goals on topics, and calls services, of a controller and a simulator.

    Parameters
    ----------
    node
        Sends and calls; somebody has to spin it.
    controller, simulator
        Names of their nodes.
    say
        Called with what they answer, for people.
    """

    def __init__(
        self, node: Node, controller: str, simulator: str, say: Callable[[str], None]
    ) -> None:
        self._node, self._controller, self._say = node, controller, say
        self._publishers: dict[str, Publisher] = {}
        self._set = node.create_client(
            SetParametersAtomically, f'{controller}/set_parameters_atomically'
        )
        self._hold = node.create_client(SetBool, f'{controller}/hold')
        self._save = node.create_client(SaveService, f'{controller}/save')
        self._reset = node.create_client(ResetService, f'{simulator}/reset')
        self._calls: dict[Any, float] = {}

    @property
    def simulated(self) -> bool:
        """Whether there is a simulator that can be reset."""
        return bool(self._reset.service_is_ready())

    def prepare(self, state: ControllerState) -> None:
        """Let the goals' topics be found before the first goal is sent."""
        for task in state.tasks:
            if len(task.target_components):
                with contextlib.suppress(InvalidValue):
                    msg = goal_message(task, [0.0] * len(task.target_components))
                    self._publisher(task, type(msg))

    def grant(self, wish: Wish, state: ControllerState | None) -> None:
        """Do what somebody asks for.

        Parameters
        ----------
        wish
            What is asked for.
        state
            The newest state of the controller, None before the first.
        """
        if isinstance(wish, Goal):
            self._send(wish, state)
        elif isinstance(wish, Change):
            value = Parameter(wish.key, value=wish.value).to_parameter_msg()
            request = SetParametersAtomically.Request(parameters=[value])
            self._ask(self._set, request, f'{wish.key}: {_shown(wish.value)}')
        elif isinstance(wish, Hold):
            request = SetBool.Request(data=wish.on)
            self._ask(self._hold, request, 'hold' if wish.on else 'resume')
        elif isinstance(wish, Reset):
            self._ask(self._reset, ResetService.Request(), 'simulator reset')
        elif isinstance(wish, Save):
            request = SaveService.Request(path=wish.path, overwrite=wish.overwrite)
            self._ask(self._save, request, f'saved to {wish.path}')

    def _send(self, goal: Goal, state: ControllerState | None) -> None:
        task = next((t for t in state.tasks if t.name == goal.task), None) if state else None
        if task is None:
            return
        try:
            msg = goal_message(task, goal.values)
        except InvalidValue as error:
            self._say(str(error))
            return
        self._publisher(task, type(msg)).publish(msg)

    def _publisher(self, task: Any, kind: type) -> Publisher:
        """Where goals of a task are sent, which may have become one of another type."""
        found = self._publishers.get(task.name)
        if found is not None and found.msg_type is not kind:
            self._node.destroy_publisher(found)
            found = None
        if found is None:
            topic = f'{self._controller}/{task.name}/goal'
            found = self._publishers[task.name] = self._node.create_publisher(kind, topic, 10)
        return found

    def _ask(self, client: Any, request: Any, done: str) -> None:
        now = time.monotonic()
        for call, begin in list(self._calls.items()):
            if now - begin > LOST:
                # Its node has ended, or was stopped: what it still says is too late.
                del self._calls[call]
        crowded = len(self._calls) >= UNANSWERED and client is not self._hold
        if crowded or not client.service_is_ready():
            self._say(f'{client.service_name} does not answer')
            return
        call = client.call_async(request)
        self._calls[call] = now
        call.add_done_callback(partial(self._on_answer, done))

    def _on_answer(self, done: str, call: Any) -> None:
        self._calls.pop(call, None)
        answer = call.result()
        if isinstance(answer, SetParametersAtomically.Response):
            good, text = answer.result.successful, answer.result.reason
        else:
            good, text = answer.success, answer.message
        self._say((text or done) if good else f'refused: {text}')


def _shown(value: Any) -> str:
    if isinstance(value, bool):
        return 'on' if value else 'off'
    return ', '.join(f'{item:g}' if isinstance(item, float) else item or '–' for item in value)

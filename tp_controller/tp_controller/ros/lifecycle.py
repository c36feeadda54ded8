"""Nodes with the states of a managed node: unconfigured, inactive, active, finalized."""

from __future__ import annotations

import gc
import traceback
from abc import abstractmethod
from collections.abc import Callable
from functools import partial
from typing import Any

from lifecycle_msgs.srv import ChangeState
from rcl_interfaces.msg import ParameterDescriptor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.lifecycle import LifecycleNodeMixin, LifecycleState, TransitionCallbackReturn
from rclpy.timer import Timer

from tp_controller.config import AUTOSTART, robot_source
from tp_controller.errors import InvalidValue
from tp_controller.ros.parameters import given_parameters
from tp_controller.ros.robot_node import HEARTBEAT, RobotNode

SUCCESS = TransitionCallbackReturn.SUCCESS
FAILURE = TransitionCallbackReturn.FAILURE
ERROR = TransitionCallbackReturn.ERROR

UNCONFIGURED = 'unconfigured: no parameter is used, and no command is sent'
ENTITIES = ('publisher', 'subscription', 'service', 'client', 'timer')
"""What a node makes that it has to let go again."""


class ManagedNode(LifecycleNodeMixin, RobotNode):
    """A node about a robot whose life others may drive by the standard services.

    To configure it is what `start` does; it takes the parameters that the node has by then. With
    the parameter ``autostart``, which is true unless it is given, the node configures and
    activates itself as soon as its robot is known. Its parameters are those of `RobotNode`.

    Attributes
    ----------
    active
        Whether the node does what it is for.
    """

    def __init__(self, name: str, **options: Any) -> None:
        RobotNode.__init__(self, name, **options)
        LifecycleNodeMixin.__init__(self)
        self.active = False
        self._autostart = self._given.get(AUTOSTART, True) is not False
        self._failure: Exception | None = None
        self._showing: Timer | None = None
        self._starts = False
        """Whether it configures and activates itself at present."""
        # A transition that there is not in this state is refused, not an error of the node.
        self._change_state = self._service_change_state.callback
        self._service_change_state.callback = self._on_change_state

    @abstractmethod
    def activate(self) -> None:
        """Begin to do what the node is for."""

    @abstractmethod
    def deactivate(self) -> str:
        """Leave the robot safe and let it be; return what was done about it."""

    @abstractmethod
    def close(self) -> None:
        """Let go what `start` made besides publishers, subscriptions, services and timers."""

    def added(self, key: str) -> bool:
        """Whether a parameter came while the node was configured, and counts in the next one."""
        return False

    # Start

    def _start(self) -> None:
        """Configure and activate, if nobody else does."""
        if not self._autostart:
            return
        self._starts = True
        for trigger in (self.trigger_configure, self.trigger_activate):
            if trigger() != SUCCESS:
                assert self._failure is not None
                raise self._failure
        self._starts = False

    def begin(self) -> None:
        """Start, or wait for what the start needs.

        Raises
        ------
        InvalidValue
            As `RobotNode.begin`.
        """
        if not self._autostart and robot_source(self._given) is not None:
            self.check(self._given)
            self.log.info('unconfigured, as autostart is false')
            self._show_unconfigured()
            return
        super().begin()

    # Transitions

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Start on the parameters as they are now."""
        given = given_parameters(self)
        if robot_source(given) is None and self._description is None:
            self.log.warning('not configured: no robot_description has come, and none is given')
            return FAILURE
        entities = {kind: set(getattr(self, f'{kind}s')) for kind in ENTITIES}
        self._let_go = partial(self._let_go_others, entities)
        try:
            self._given = given
            self.start(given, self._description)
        except Exception as error:
            self._failure = error
            self._let_go()
            if not isinstance(error, InvalidValue):
                traceback.print_exc()
                return ERROR
            if not self._starts:
                self.log.warning(f'not configured: {error}')
            return FAILURE
        if self._showing is not None:
            self.destroy_timer(self._showing)
            self._showing = None
        self.started = True
        return SUCCESS

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Begin."""
        return self._safely(self._activate)

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Bring the robot to rest, and let it be."""
        return self._safely(self._deactivate)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Let go everything that belongs to the configuration."""
        return self._safely(self._clean_up)

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Bring the robot to rest for good."""
        return self._safely(self._deactivate)

    def on_error(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Be unconfigured after an error, with the robot at rest."""
        self._deactivate()
        if self.started:
            self._clean_up()
        return SUCCESS

    def _safely(self, do: Callable[[], None]) -> TransitionCallbackReturn:
        try:
            do()
        except Exception as error:
            self._failure = error
            traceback.print_exc()
            return ERROR
        return SUCCESS

    def _activate(self) -> None:
        self.activate()
        self.active = True

    def _deactivate(self) -> None:
        if self.active:
            self.active = False
            self.log.info(f'inactive: {self.deactivate()}')

    def _clean_up(self) -> None:
        self.started = False
        self.close()
        self._let_go()
        # What was made at the start need not stay any longer.
        gc.unfreeze()
        self.log.info('unconfigured')
        self._show_unconfigured()

    def _show_unconfigured(self) -> None:
        """Give signs of life until somebody configures the node."""
        self._showing = self.make_timer(HEARTBEAT, partial(self.show_waiting, UNCONFIGURED))

    def _let_go_others(self, entities: dict[str, set[Any]]) -> None:
        """Destroy entities made since these; undeclare parameters that nobody gave or added."""
        for kind, before in entities.items():
            for entity in set(getattr(self, f'{kind}s')) - before:
                getattr(self, f'destroy_{kind}')(entity)
        for key in given_parameters(self):
            # Everything may change now; rclpy has no call for that.
            self._descriptors[key] = ParameterDescriptor(name=key, dynamic_typing=True)
            if key not in self._given and not self.added(key):
                self.undeclare_parameter(key)

    def _on_change_state(
        self, request: ChangeState.Request, response: ChangeState.Response
    ) -> ChangeState.Response:
        try:
            return self._change_state(request, response)
        except rclpy_implementation.RCLError:
            asked = request.transition.label or request.transition.id
            self.log.warning(
                f'no transition {asked} from the state {self._state_machine.current_state[1]}'
            )
            response.success = False
            return response

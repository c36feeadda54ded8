"""Hold: the service that keeps the arm at rest, and what is told about it."""

from __future__ import annotations

from collections.abc import Callable

from rclpy.node import Node
from std_srvs.srv import SetBool

from tp_controller.config import RESUME, TARGETS, Settings
from tp_controller.errors import InvalidValue
from tp_controller.ros.log import Log

HELD = 'held by ~/hold'
INACTIVE = 'inactive: no command is sent'
EMPTY = 'no task in the hierarchy'
OFF = 'every task of the hierarchy is off'


def refuse_at_rest(key: str, held: bool, active: bool) -> None:
    """Refuse what would have to wait for an arm that is kept at rest.

    Raises
    ------
    InvalidValue
        For ``key`` while the arm is held or the node is not active.
    """
    if held:
        raise InvalidValue(key, f'one while {HELD}', 'ones once it is called with false')
    if not active:
        raise InvalidValue(key, 'one while the node is not active', 'ones once it is')


class Hold:
    """``~/hold``: true brings the arm to rest and keeps it there, false lets it go on.

    Parameters
    ----------
    node
        The controller's node.
    settings
        What it runs on.
    log
        Has one line when the hold begins, when the arm is at rest, and when it goes on.
    changed
        Called after each of the three.
    """

    def __init__(
        self, node: Node, settings: Settings, log: Log, changed: Callable[[], None]
    ) -> None:
        self._settings, self._stack = settings, settings.stack
        self._log, self._changed = log, changed
        self._told_rest = False
        node.create_service(SetBool, '~/hold', self._on_request)

    @property
    def message(self) -> str:
        """Why the arm is brought to rest and kept there; empty if it is not."""
        if not self._stack.resting:
            return ''
        empty = OFF if self._stack.hierarchy else EMPTY
        cause = HELD if self._stack.held else empty
        return f'{cause}: {"at rest" if self._stack.at_rest else "braking"}'

    def look(self) -> None:
        """Take note that the arm has come to rest; to be called after every command."""
        if self._stack.held and not self._told_rest and self._stack.at_rest:
            self._told_rest = True
            self._tell(f'{HELD}: at rest')

    def _on_request(
        self, request: SetBool.Request, response: SetBool.Response
    ) -> SetBool.Response:
        response.success = True
        stack = self._stack
        if request.data == stack.held:
            response.message = 'held already' if stack.held else 'not held: nothing to resume'
        elif request.data:
            stack.hold()
            self._told_rest = False
            response.message = 'braking to rest'
            self._tell(f'{HELD}: braking to rest')
        else:
            counts = self._settings.values[RESUME]
            stack.resume(targets=counts == TARGETS)
            response.message = f'resumed, {RESUME}: {counts}'
            self._tell(f'resumed by ~/hold, {RESUME}: {counts}')
        return response

    def _tell(self, line: str) -> None:
        self._log.info(line)
        self._changed()

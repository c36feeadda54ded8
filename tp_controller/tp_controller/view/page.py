"""The server of the page: where it listens, and whom it lets in."""

from __future__ import annotations

import contextlib
import io
import ipaddress
import socket
import urllib.parse
from collections.abc import Collection, Iterator
from typing import Any
from unittest import mock

import viser
from viser import _messages as messages
from viser import infra

from tp_controller.errors import InvalidValue, shown
from tp_controller.view.site import SiteServer

LOCAL = ('127.0.0.1', '::1', 'localhost')
TITLE = 'Task-priority control'
SAID = 6.0
"""Time [s] that an answer stays in sight."""


class Page:
    """A page that any number of browsers show at a time.

    A browser is let in only with this very page: another site that is open in it could move the
    arm else. viser's tunnel to the internet is closed.

    Parameters
    ----------
    host
        Address or name of this machine to listen on.
    port
        Port; the next free one if it is taken, any free one for 0.

    Raises
    ------
    InvalidValue
        If this machine has no such address, or the port is none.

    Attributes
    ----------
    server
        viser's server.
    """

    def __init__(self, host: str = LOCAL[0], port: int = 8080) -> None:
        _check(host, port)
        self._host = host
        name = socket.gethostname()
        self._own = frozenset({*LOCAL, host, name, socket.getfqdn(), f'{name}.local'})
        with _silence(), mock.patch.object(infra, 'WebsockServer', SiteServer):
            self.server = viser.ViserServer(host, port, TITLE, verbose=False)
        connections: infra.WebsockServer = self.server._websock_server
        connections.unregister_handler(messages.ShareUrlRequest)
        connections.unregister_handler(messages.ShareUrlDisconnect)
        connections.on_client_connect(self._admit)
        gui = self.server.gui
        gui.configure_theme(
            control_width='large', show_logo=False, show_share_button=False,
            brand_color=(31, 119, 180),
        )  # fmt: skip

    @property
    def port(self) -> int:
        """Port that it listens on."""
        return int(self.server.get_port())

    @property
    def address(self) -> str:
        """What to open in a browser on this machine."""
        everywhere = self._host in ('0.0.0.0', '::', '')
        host = 'localhost' if everywhere or self._host in LOCAL else self._host
        return f'http://{f"[{host}]" if ":" in host else host}:{self.port}'

    @property
    def open_to_network(self) -> bool:
        """Whether other machines reach it."""
        return self._host not in LOCAL and not _is_loopback(self._host)

    @property
    def watched(self) -> bool:
        """Whether any browser shows it."""
        return bool(self.server.get_clients())

    def say(self, text: str) -> None:
        """Show a text for a while in every browser."""
        for client in self.server.get_clients().values():
            client.add_notification('', text, auto_close_seconds=SAID)

    def close(self) -> None:
        """Close it; browsers say that they have lost the connection."""
        with _silence():
            self.server.stop()
        if isinstance(self.server._websock_server, SiteServer):
            self.server._websock_server.site.cleanup()

    async def _admit(self, connection: infra.WebsockClientConnection) -> None:
        """Close a connection that a page of another site has opened, before it is listened to."""
        found = self.server._websock_server._live_connections[connection.client_id]
        headers = found.request.headers if found.request else {}
        origin = headers.get('Origin')
        if origin is not None and not trusted(origin, headers.get('Host', ''), self._own):
            await found.close(1008, 'pages of other sites are not let in')


def trusted(origin: str, asked: str, own: Collection[str]) -> bool:
    """Whether a page may talk to the server that it asks.

    Parameters
    ----------
    origin
        Where the page is from.
    asked
        Host and port that it asks, which have to be those of its origin.
    own
        Names of this machine. Any other name may be made to lead here.
    """
    found = urllib.parse.urlsplit(origin)
    name = found.hostname
    if name is None or found.netloc != asked:
        return False
    return name in own or _is_address(name)


def _is_address(name: str) -> bool:
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True


def _is_loopback(host: str) -> bool:
    return _is_address(host) and ipaddress.ip_address(host).is_loopback


def _check(host: str, port: int) -> None:
    """Refuse what viser would try for ever."""
    if not 0 <= port <= 65535:
        raise InvalidValue('port', shown(port), 'a number from 0 (any free port) to 65535')
    try:
        family, *_, place = socket.getaddrinfo(host, 0, type=socket.SOCK_STREAM)[0]
        _bind(family, place)
    except OSError as error:
        got = f'{shown(host)} ({error.strerror})'
        raise InvalidValue(
            'host', got, 'an address of this machine, or 0.0.0.0 for all of them'
        ) from None
    for candidate in range(port, 65536):
        with contextlib.suppress(OSError):
            _bind(family, (place[0], candidate, *place[2:]))
            return
    raise InvalidValue('port', f'{port}, taken like all after it', 'a free one; 0: any')


def _bind(family: socket.AddressFamily, place: Any) -> None:
    with socket.socket(family, socket.SOCK_STREAM) as probe:
        probe.bind(place)


@contextlib.contextmanager
def _silence() -> Iterator[None]:
    """Keep what viser prints about itself from the terminal."""
    with contextlib.redirect_stdout(io.StringIO()):
        yield

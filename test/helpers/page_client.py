"""Stands in for a browser: takes what the page's server sends, sends what a browser would."""

import time

import msgspec
import zstandard
from viser import __version__
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect


class PageClient:
    """A connection to the page, and what has been received on it."""

    def __init__(self, address, origin=None):
        self._socket = connect(
            address.replace('http', 'ws'),
            subprotocols=[f'viser-v{__version__}'],
            origin=origin,
            max_size=None,
            close_timeout=1.0,
            compression=None,
            # Whoever waits for a browser meanwhile reads nothing.
            ping_interval=None,
        )
        self.messages = []
        self.closed = False
        # A server counts a browser once that says where its camera is.
        self.send(
            type='ViewerCameraMessage',
            wxyz=(1.0, 0.0, 0.0, 0.0),
            position=(3.0, 3.0, 3.0),
            fov=1.0,
            image_height=100,
            image_width=100,
            near=0.1,
            far=100.0,
            look_at=(0.0, 0.0, 0.0),
            up_direction=(0.0, 0.0, 1.0),
        )

    def close(self):
        self._socket.close()

    def send(self, **message):
        try:
            self._socket.send(msgspec.msgpack.encode(message))
        except ConnectionClosed:
            self.closed = True

    def receive(self, seconds):
        """Take messages for a time; returns how many packets came."""
        end, packets = time.monotonic() + seconds, 0
        while (left := end - time.monotonic()) > 0.0 and not self.closed:
            try:
                data = self._socket.recv(timeout=left)
            except TimeoutError:
                break
            except ConnectionClosed:
                self.closed = True
                break
            packets += 1
            size = int.from_bytes(data[8:16], 'little')
            packed = zstandard.ZstdDecompressor().decompress(data[16 : 16 + size])
            self.messages += msgspec.msgpack.decode(packed)['messages']
        return packets

    def wait_for(self, condition, seconds=60.0):
        """Take messages until something is among them; returns it."""
        end = time.monotonic() + seconds
        while not (found := condition()):
            assert time.monotonic() < end, sorted(self.kinds())
            assert not self.closed
            self.receive(0.1)
        return found

    def kinds(self):
        return {message['type'] for message in self.messages}

    def element(self, kind, label=None):
        """Newest element of a kind in the panel, by its label."""
        found = [
            message
            for message in self.messages
            if message['type'] == kind and label in (None, message['props'].get('label'))
        ]
        return found[-1] if found else None

    def text(self):
        """All texts of the panel that were ever shown, in their order."""
        found = [
            m['props']['_markdown'] for m in self.messages if m['type'] == 'GuiMarkdownMessage'
        ]
        updates = (m['updates'] for m in self.messages if m['type'] == 'GuiUpdateMessage')
        return '\n'.join(found + [u['_markdown'] for u in updates if '_markdown' in u])

    def set(self, element, value):
        self.send(type='GuiUpdateMessage', uuid=element['uuid'], updates={'value': value})

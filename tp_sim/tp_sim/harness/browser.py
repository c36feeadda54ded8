"""A headless Chromium that a test or a command drives by its DevTools protocol."""

from __future__ import annotations

import base64
import contextlib
import json
import os
import shutil
import subprocess
import tempfile
import time
import urllib.request
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

from websockets.sync.client import ClientConnection, connect

from tp_sim.harness.errors import HarnessError
from tp_sim.harness.process import die_with_parent

NAMES = ('chromium', 'chromium-browser', 'google-chrome')
FLAGS = (
    '--headless=new',
    '--no-sandbox',
    '--no-first-run',
    '--disable-extensions',
    '--disable-background-networking',
    '--hide-scrollbars',
    # /dev/shm of a container is small.
    '--disable-dev-shm-usage',
    # Pictures without a graphics card; only what the page itself draws with one needs it.
    '--enable-unsafe-swiftshader',
    '--remote-debugging-port=0',
)
TIMEOUT = 180.0
"""Longest wait [s], generous for a loaded machine."""
OVER = (
    '(e, hit) => hit && (e.contains(hit)'
    " || (hit.contains(e) && hit.closest('button, label') !== null))"
)
"""Function of the page: whether what is under the mouse is an element, or the button round it."""


class Place(NamedTuple):
    """Middle of something on the page, in pixels from its upper left corner."""

    x: float
    y: float


@cache
def chromium() -> str | None:
    """Path of a Chromium on this machine, None if there is none that can be started."""
    return next(filter(_starts, filter(None, map(shutil.which, NAMES))), None)


def _starts(path: str) -> bool:
    """Whether a program tells its version; a package may have put a mere note in its place."""
    with contextlib.suppress(OSError, subprocess.TimeoutExpired):
        asked = subprocess.run(
            [path, '--version'],
            stdin=subprocess.DEVNULL,
            capture_output=True,
            timeout=TIMEOUT,
            check=False,
        )
        return asked.returncode == 0
    return False


class Browser:
    """One page of a headless Chromium.

    Parameters
    ----------
    width, height
        Size of the page [pixels].

    Raises
    ------
    HarnessError
        If there is no Chromium, or it does not start.
    """

    def __init__(self, width: int = 1280, height: int = 800) -> None:
        path = chromium()
        if path is None:
            raise HarnessError(f'no Chromium on this machine: none of {", ".join(NAMES)}')
        self._folder = tempfile.TemporaryDirectory(ignore_cleanup_errors=True)
        self._process = subprocess.Popen(
            [path, *FLAGS, f'--user-data-dir={self._folder.name}', 'about:blank'],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
            preexec_fn=die_with_parent(os.getpid()),  # noqa: PLW1509
        )
        self._calls = 0
        self._events: list[dict[str, Any]] = []
        try:
            self._socket = self._connect()
            for domain in ('Runtime', 'Log', 'Page'):
                self.call(f'{domain}.enable')
            self.call(
                'Emulation.setDeviceMetricsOverride',
                width=width,
                height=height,
                deviceScaleFactor=1,
                mobile=False,
            )
        except Exception:
            self.close()
            raise

    @property
    def pid(self) -> int:
        """Process that has started all others of it."""
        return self._process.pid

    def close(self) -> None:
        """End it."""
        self._process.terminate()
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(10.0)
        self._process.kill()
        self._process.wait()
        self._folder.cleanup()

    def open(self, address: str) -> None:
        """Go to a page."""
        self.call('Page.navigate', url=address)

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        """Call a method of the protocol and return its result."""
        self._calls += 1
        message = {'id': self._calls, 'method': method, 'params': parameters}
        self._socket.send(json.dumps(message))
        while True:
            answer = json.loads(self._socket.recv(timeout=TIMEOUT))
            if answer.get('id') == self._calls:
                break
            self._events.append(answer)
        if 'error' in answer:
            raise HarnessError(f'{method}: {answer["error"]}')
        return dict(answer['result'])

    def evaluate(self, script: str) -> Any:
        """Value of an expression of the page."""
        found = self.call(
            'Runtime.evaluate', expression=script, returnByValue=True, awaitPromise=True
        )
        if 'exceptionDetails' in found:
            raise HarnessError(f'{script}: {found["exceptionDetails"]}')
        return found['result'].get('value')

    def errors(self) -> list[str]:
        """Everything that the page has complained about so far."""
        self.evaluate('0')
        found = []
        for event in self._events:
            about = event.get('params', {})
            method = event.get('method')
            bad = (
                method == 'Runtime.exceptionThrown'
                or (method == 'Runtime.consoleAPICalled' and about['type'] == 'error')
                or (method == 'Log.entryAdded' and about['entry']['level'] == 'error')
            )
            if bad:
                found.append(json.dumps(about)[:500])
        return found

    def screenshot(self, path: str | Path | None = None) -> bytes:
        """Picture of the page as PNG, written to a file if one is given."""
        end = time.monotonic() + TIMEOUT
        while True:
            try:
                found = self.call('Page.captureScreenshot', format='png')
                break
            except HarnessError as error:
                # From one page to the next there is none for a moment.
                if 'active page' not in str(error) or time.monotonic() > end:
                    raise
                time.sleep(0.1)
        data = base64.b64decode(found['data'])
        if path is not None:
            Path(path).write_bytes(data)
        return data

    def wait_for(self, condition: Callable[[], Any], what: str, timeout: float = TIMEOUT) -> Any:
        """Wait for a condition and return it.

        Raises
        ------
        HarnessError
            If it does not come true in `timeout` [s].
        """
        end = time.monotonic() + timeout
        while not (found := condition()):
            if time.monotonic() > end:
                raise HarnessError(f'the page did not show {what}: {self.text()[:2000]}')
            time.sleep(0.05)
        return found

    def text(self) -> str:
        """Text of the page."""
        return str(self.evaluate('document.body.innerText'))

    def find(self, script: str) -> Place:
        """Wait for an element, the value of an expression; return its middle.

        Parameters
        ----------
        script
            An expression of the page, such as `text_element` makes them.
        """
        before: list[Any] = [None]

        def look() -> Place | None:
            found = self.evaluate(
                f'(() => {{ const e = {script}; if (!e) return null;'
                " e.scrollIntoView({block: 'nearest'});"
                ' const r = e.getBoundingClientRect();'
                ' const x = r.x + r.width / 2, y = r.y + r.height / 2;'
                ' const hit = document.elementFromPoint(x, y);'
                f' return ({OVER})(e, hit) ? [x, y] : null; }})()'
            )
            # Something that still moves is not there yet; it moves from picture to picture.
            self.frames(2)
            still = found is not None and found == before[0]
            before[0] = found
            return Place(*found) if still else None

        place: Place = self.wait_for(look, script)
        return place

    def click(self, script: str) -> None:
        """Wait for an element, the value of an expression, and click it.

        Once more, if something else has come under the mouse meanwhile.
        """

        def press() -> bool:
            place = self.find(script)
            self.evaluate(
                f'(() => {{ const e = {script}; window.clicked = false;'
                " document.addEventListener('click',"
                f' event => window.clicked = e && ({OVER})(e, event.target),'
                ' {once: true, capture: true}); })()'
            )
            self.mouse('mouseMoved', place)
            self.mouse('mousePressed', place)
            self.mouse('mouseReleased', place)
            return bool(self.evaluate('window.clicked'))

        self.wait_for(press, f'{script} under the mouse')

    def drag(self, start: Place, end: Place, steps: int = 8) -> None:
        """Press the mouse, move it in steps, and release it."""
        self.mouse('mouseMoved', start)
        self.frames(2)
        self.mouse('mousePressed', start)
        for i in range(1, steps + 1):
            share = i / steps
            place = Place(start.x + share * (end.x - start.x), start.y + share * (end.y - start.y))
            self.mouse('mouseMoved', place, held=True)
            self.frames(1)
        self.mouse('mouseReleased', end)

    def mouse(self, kind: str, place: Place, held: bool = False) -> None:
        """Send an event of the mouse."""
        pressed = held or kind == 'mousePressed'
        self.call(
            'Input.dispatchMouseEvent',
            type=kind,
            x=place.x,
            y=place.y,
            button='none' if kind == 'mouseMoved' and not held else 'left',
            buttons=int(pressed),
            clickCount=int(kind != 'mouseMoved'),
        )

    def frames(self, count: int) -> None:
        """Wait until the page has drawn so many pictures."""
        self.evaluate(
            'new Promise(done => { let left = '
            f'{count}; const next = () => left-- > 0 ? requestAnimationFrame(next) : done(0);'
            ' next(); })'
        )

    def _connect(self) -> ClientConnection:
        file = Path(self._folder.name) / 'DevToolsActivePort'
        pages: list[dict[str, Any]] = []
        end = time.monotonic() + TIMEOUT
        while not pages and self._process.poll() is None and time.monotonic() < end:
            time.sleep(0.05)
            with contextlib.suppress(OSError, ValueError, IndexError):
                port = int(file.read_text().split()[0])
                with urllib.request.urlopen(f'http://127.0.0.1:{port}/json') as answer:
                    pages = [page for page in json.load(answer) if page['type'] == 'page']
        if not pages:
            raise HarnessError('Chromium does not start')
        return connect(pages[0]['webSocketDebuggerUrl'], max_size=None)


def text_element(text: str, inside: str = 'document') -> str:
    """Expression of the innermost element with a text, whole, or from its beginning with ``…``."""
    given = json.dumps(text.removesuffix('…'))
    own = 'e.textContent.trim()'
    test = f'{own}.startsWith({given})' if text.endswith('…') else f'{own} === {given}'
    return f"[...{inside}.querySelectorAll('*')].filter(e => e.offsetWidth && {test}).pop()"

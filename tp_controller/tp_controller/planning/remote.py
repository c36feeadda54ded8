"""Talks to the planner's process by threads: no call waits."""

from __future__ import annotations

import os
import pickle
import queue
import subprocess
import sys
import threading
import time

from tp_controller.planning.messages import Failed, Reply, Request

MODULE = 'tp_controller.planning'
SILENCE = 30.0
"""Time [s] without a reply to a request after which the process is ended: no phase of a plan takes
half of that on a busy machine."""


class _Running:
    """A process, and the number of the last request that it was sent.

    Parameters
    ----------
    number
        Of the first request.
    """

    def __init__(self, number: int) -> None:
        self.number = number
        environment = os.environ | {'PYTHONPATH': os.pathsep.join(filter(None, sys.path))}
        self.process = subprocess.Popen(
            [sys.executable, '-m', MODULE],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env=environment,
            # A Ctrl-C in the terminal is for this process alone.
            start_new_session=True,
        )


class RemotePlanner:
    """Talks to the process, which is started with the first request, or anew if it has ended."""

    def __init__(self) -> None:
        self._requests: queue.SimpleQueue[Request | None] = queue.SimpleQueue()
        self._replies: queue.SimpleQueue[tuple[int, Reply]] = queue.SimpleQueue()
        self._thread: threading.Thread | None = None
        self._running: _Running | None = None
        self._heard = 0.0

    def ask(self, request: Request) -> None:
        """Ask for a plan; a request before it is given up."""
        self._heard = time.monotonic()
        self._requests.put(request)
        if self._thread is None:
            self._thread = threading.Thread(target=self._write, name='planner', daemon=True)
            self._thread.start()

    def take(self) -> list[tuple[int, Reply]]:
        """Replies that have come since the last call, with the numbers of their requests."""
        found = []
        while True:
            try:
                found.append(self._replies.get_nowait())
            except queue.Empty:
                break
        if found:
            self._heard = time.monotonic()
        return found

    @property
    def silent(self) -> bool:
        """Whether it has not answered for too long; to be asked while a reply is waited for."""
        return time.monotonic() - self._heard > SILENCE

    def kill(self) -> None:
        """End the process; the next request starts another one."""
        running = self._running
        if running is not None:
            running.process.kill()
            running.process.wait()

    def close(self) -> None:
        """End the process, and ask no more."""
        if self._thread is not None:
            self._requests.put(None)
            self._thread = None
        self.kill()

    def _write(self) -> None:
        while (request := self._requests.get()) is not None:
            try:
                process = self._ready(request.number)
                assert process.stdin is not None
                pickle.dump(request, process.stdin)
                process.stdin.flush()
            except (OSError, ValueError) as error:
                self._replies.put((request.number, Failed(f'the planner has ended: {error}')))

    def _ready(self, number: int) -> subprocess.Popen[bytes]:
        """Process that runs, for a request of this number."""
        running = self._running
        if running is None or running.process.poll() is not None:
            self._running = running = _Running(number)
            threading.Thread(target=self._read, args=(running,), name='plans', daemon=True).start()
        running.number = number
        return running.process

    def _read(self, running: _Running) -> None:
        assert running.process.stdout is not None
        try:
            while True:
                self._replies.put(pickle.load(running.process.stdout))
        except Exception:  # whatever breaks the conversation ends it
            # Requests that another process was sent since are none of its own.
            self._replies.put((running.number, Failed('the planner has ended')))

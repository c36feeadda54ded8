"""A recording of a closed loop, made beside it."""

from __future__ import annotations

import threading
import time
from pathlib import Path

from rclpy.node import Node

from tp_controller.recording import RecordingWriter
from tp_controller.ros.recorder import Recorder
from tp_sim.harness.errors import HarnessError

PERIOD = 0.005
"""Time [s] between two looks for messages."""
QUIET = 0.1
"""Time [s] without a message after which nothing more is expected of nodes that have ended."""


class LoopRecording:
    """Records a controller in a thread of its own, until it is closed.

    Parameters
    ----------
    node
        Listens; nobody else uses it.
    path
        The file, replaced if there is one.

    Raises
    ------
    InvalidValue
        If it cannot be written.
    """

    def __init__(self, node: Node, path: str | Path) -> None:
        self._node = node
        self._writer = RecordingWriter(path, overwrite=True)
        self._recorder = Recorder(node, 'tp_controller', self._writer, lossless=True)
        self._stopped = threading.Event()
        self._failure: BaseException | None = None
        self._ready = False
        self._thread = threading.Thread(target=self._run, name='recording', daemon=True)
        self._thread.start()

    def ready(self) -> bool:
        """Whether it listens to the controller, and has its parameters.

        Raises
        ------
        HarnessError
            If it has failed.
        """
        self._check()
        return self._ready

    def _check(self) -> None:
        if self._failure is not None:
            raise HarnessError(f'the recording failed: {self._failure}') from self._failure

    def _run(self) -> None:
        try:
            seen = time.monotonic()
            while not self._stopped.is_set() or time.monotonic() - seen < QUIET:
                if self._recorder.work():
                    seen = time.monotonic()
                else:
                    time.sleep(PERIOD)
                self._ready = self._recorder.ready
            self._recorder.finish()
        except Exception as error:
            self._failure = error

    def close(self) -> None:
        """Take the last messages of nodes that have ended, and finish the file.

        Raises
        ------
        HarnessError
            If anything of it failed.
        """
        self._stopped.set()
        self._thread.join()
        self._writer.close()
        self._node.destroy_node()
        self._check()

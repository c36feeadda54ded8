"""The recording that the page starts and ends: the command `record` in a process of its own."""

from __future__ import annotations

import contextlib
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

from tp_controller.errors import shown

SUFFIX = '.mcap'
MODULE = 'tp_controller.ros.page_record'
LAST = 10.0
"""Time [s] that it has to finish its file when the page ends."""


class ViewRecording:
    """Starts and ends a recording of a controller.

    A process of its own takes every message however long the page takes for a picture.

    Parameters
    ----------
    controller
        Full name of the controller's node.
    folder
        Where the files are.
    say
        Called with what has become of it, for people.
    """

    def __init__(self, controller: str, folder: Path, say: Callable[[str], None]) -> None:
        self._controller, self._folder, self._say = controller, folder, say
        self._process: subprocess.Popen[str] | None = None
        self._path = folder

    @property
    def path(self) -> Path | None:
        """File that is being written, None if there is none."""
        return None if self._process is None else self._path

    def start(self, name: str) -> None:
        """Begin a new file in the folder; a name with a folder is refused."""
        if self._process is not None:
            self._say(f'{self._path} is being recorded already')
            return
        name = name.strip()
        if not name or Path(name).name != name:
            self._say(f'refused: file: got {shown(name)}; accepts a name without a folder')
            return
        path = self._folder / name
        self._path = path if path.suffix == SUFFIX else path.with_name(f'{name}{SUFFIX}')
        # Remaps and the namespace of this process are in the controller's full name.
        self._process = subprocess.Popen(
            [sys.executable, '-m', MODULE, str(self._path), '--controller', self._controller],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
            # Ctrl-C in the terminal is for the page, which ends it.
            start_new_session=True,
        )

    def stop(self) -> None:
        """Let it finish the file; `work` tells when it has."""
        if self._process is not None:
            self._process.send_signal(signal.SIGINT)

    def work(self) -> None:
        """See whether it has ended, by itself or because it was asked to."""
        process = self._process
        if process is None or process.poll() is None:
            return
        self._process = None
        told = process.stderr.read() if process.stderr else ''
        if process.returncode == 0:
            self._say(f'recorded: {self._path}')
        else:
            lines = told.strip().splitlines() or [f'status {process.returncode}']
            self._say(f'refused: {lines[-1].removeprefix("record: ")}')

    def close(self) -> None:
        """End it before the page ends."""
        if self._process is not None:
            self.stop()
            with contextlib.suppress(subprocess.TimeoutExpired):
                self._process.wait(LAST)
            self.work()

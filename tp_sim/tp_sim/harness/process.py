"""Commands and executables of nodes as child processes that never outlive their parent."""

from __future__ import annotations

import ctypes
import os
import signal
import subprocess
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path

from ament_index_python.packages import PackageNotFoundError, get_package_prefix

from tp_sim.harness.errors import HarnessError

_LIBC = ctypes.CDLL(None)
_PR_SET_PDEATHSIG = 1
STOPPED = 30.0
"""Time [s] that a process has to end after it is interrupted, generous for a loaded machine."""


def die_with_parent(parent: int) -> Callable[[], None]:
    """What a child process does first, so that it gets SIGTERM when its parent ends."""

    def ask() -> None:
        _LIBC.prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)
        if os.getppid() != parent:
            os._exit(1)

    return ask


class Process:
    """One running command, with what it prints.

    Parameters
    ----------
    name
        Its name in messages.
    command
        Program and arguments.
    environment
        Environment of the process, see `PrivateDomain.environment`.
    folder
        Where it runs; None for where this process does.
    """

    def __init__(
        self,
        name: str,
        command: Sequence[str],
        environment: dict[str, str],
        folder: str | Path | None = None,
    ) -> None:
        self.name = name
        self._output = tempfile.TemporaryFile()  # noqa: SIM115 - closed by stop
        self._process = subprocess.Popen(
            command,
            env=environment,
            cwd=folder,
            stdin=subprocess.DEVNULL,
            stdout=self._output,
            stderr=subprocess.STDOUT,
            preexec_fn=die_with_parent(os.getpid()),  # noqa: PLW1509 - prctl has to run in the child
            # Ctrl-C in a terminal is for the parent, which stops its nodes itself.
            start_new_session=True,
        )

    @property
    def pid(self) -> int:
        """Process number."""
        return self._process.pid

    @property
    def running(self) -> bool:
        """Whether the process has not ended yet."""
        return self._process.poll() is None

    @property
    def output(self) -> str:
        """Everything that it has printed so far."""
        return self.output_since(0)[0]

    def output_since(self, begin: int) -> tuple[str, int]:
        """What it has printed after so many bytes, and how many bytes there are."""
        size = os.fstat(self._output.fileno()).st_size
        text = os.pread(self._output.fileno(), size - begin, begin).decode(errors='replace')
        return text, size

    @property
    def resident_memory(self) -> int:
        """Resident memory [bytes]."""
        pages = int(Path(f'/proc/{self.pid}/statm').read_text().split()[1])
        return pages * os.sysconf('SC_PAGE_SIZE')

    def signal(self, number: int) -> None:
        """Send it a signal."""
        self._process.send_signal(number)

    def wait(self, timeout: float = 10.0) -> int:
        """Wait until it has ended; return its exit status.

        Raises
        ------
        HarnessError
            If it has not ended after ``timeout`` [s].
        """
        try:
            return self._process.wait(timeout)
        except subprocess.TimeoutExpired:
            raise HarnessError(
                f'{self.name} still runs after {timeout:g} s:\n{self.output}'
            ) from None

    def wait_for_output(self, text: str, timeout: float = 10.0) -> None:
        """Wait until it has printed a text.

        Raises
        ------
        HarnessError
            If it has not after ``timeout`` [s].
        """
        end = time.monotonic() + timeout
        while text not in self.output:
            if time.monotonic() > end:
                raise HarnessError(f'{self.name} did not print {text!r}:\n{self.output}')
            time.sleep(0.02)

    def interrupt(self) -> None:
        """Ask it to end, as Ctrl-C does."""
        if self.running:
            self.signal(signal.SIGINT)

    def kill(self) -> None:
        """End it without asking it, and wait."""
        self._process.kill()
        self._process.wait()

    def stop(self) -> int:
        """Interrupt it and wait; return its exit status. It is killed after half a minute."""
        self.interrupt()
        try:
            return self._process.wait(STOPPED)
        except subprocess.TimeoutExpired:
            self._process.kill()
            return self._process.wait()


class NodeProcess(Process):
    """One running executable of a ROS package.

    Parameters
    ----------
    package, executable
        As in ``ros2 run <package> <executable>``.
    parameter_file
        Passed as ``--params-file``; None for none.
    environment
        Environment of the process, see `PrivateDomain.environment`.
    ros_arguments
        Further arguments after ``--ros-args``, such as ``-r __ns:=/arm_1``.
    arguments
        Arguments before ``--ros-args``.

    Raises
    ------
    HarnessError
        If the package is not built or has no such executable.
    """

    def __init__(
        self,
        package: str,
        executable: str,
        parameter_file: str | Path | None,
        environment: dict[str, str],
        ros_arguments: Sequence[str] = (),
        arguments: Sequence[str] = (),
    ) -> None:
        command = [str(executable_path(package, executable)), *arguments, '--ros-args']
        if parameter_file is not None:
            command += ['--params-file', str(parameter_file)]
        super().__init__(executable, [*command, *ros_arguments], environment)


def executable_path(package: str, executable: str) -> Path:
    """Path of an executable of a ROS package.

    Raises
    ------
    HarnessError
        If the package is not built or has no such executable.
    """
    try:
        path = Path(get_package_prefix(package)) / 'lib' / package / executable
    except PackageNotFoundError:
        raise HarnessError(
            f'package {package} is not built: make setup, then source setup.bash'
        ) from None
    if not path.exists():
        raise HarnessError(f'package {package} has no executable {executable}')
    return path

"""A ROS domain that nobody else on this machine uses."""

from __future__ import annotations

import fcntl
import os
import random
import socket
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

from tp_sim.harness.errors import HarnessError

DISCOVERY_PROFILE = Path(__file__).with_name('discovery.xml')
DOMAINS = range(1, 102)
"""Domain numbers whose ports stay clear of the ephemeral ones on Linux."""


PORTS = 118
"""Ports of a domain that are looked at, for 54 participants: those of the last one end there."""


class PrivateDomain:
    """Holds a domain number until it is closed or the process ends.

    Attributes
    ----------
    number
        For ``ROS_DOMAIN_ID``.
    """

    def __init__(self) -> None:
        numbers = list(DOMAINS)
        random.shuffle(numbers)
        for number in numbers:
            lock = _locked(Path(tempfile.gettempdir()) / f'tp_sim_domain_{number}.lock')
            if lock is None:
                continue
            # The port of a domain that somebody holds is not tried: whoever enters it at that
            # moment would get another one.
            if not _in_use(number):
                self.number = number
                self._lock = lock
                return
            lock.close()
        raise HarnessError(f'all ROS domains from {DOMAINS[0]} to {DOMAINS[-1]} are in use')

    @property
    def variables(self) -> dict[str, str]:
        """What moves a process to the domain, to this machine alone, and to quick discovery.

        Fast DDS by default repeats an announcement that was missed after seconds only.
        """
        return {
            'ROS_DOMAIN_ID': str(self.number),
            'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST',
            'FASTRTPS_DEFAULT_PROFILES_FILE': str(DISCOVERY_PROFILE),
        }

    def environment(self) -> dict[str, str]:
        """Environment of this process with the domain's `variables`."""
        return {**os.environ, **self.variables}

    @contextmanager
    def entered(self) -> Iterator[None]:
        """Let participants that this process makes within be on the domain."""
        saved = {name: os.environ.get(name) for name in self.variables}
        os.environ.update(self.variables)
        try:
            yield
        finally:
            for name, value in saved.items():
                if value is None:
                    del os.environ[name]
                else:
                    os.environ[name] = value

    def close(self) -> None:
        """Give the domain back."""
        self._lock.close()


def _in_use(number: int) -> bool:
    """Whether somebody on this machine is on the domain, who knows nothing of the locks.

    Every participant of a domain listens on ports that follow from the domain's number and its
    own (RTPS specification, section 9.6.1.1). Its own is 0 for the first one of a process, if
    nobody else has taken that.
    """
    first = 7400 + 250 * number
    return not all(_is_free(port) for port in range(first, first + PORTS))


def _is_free(port: int) -> bool:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.bind(('', port))
        except OSError:
            return False
    return True


def _locked(path: Path) -> IO[str] | None:
    """Open file with an exclusive lock, which ends with the process; None if taken."""
    try:
        # Left in place: removing a lock file lets two processes hold different ones.
        lock = path.open('a')
    except OSError:
        return None
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        lock.close()
        return None
    return lock

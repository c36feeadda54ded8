"""What commands have in common."""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Callable, Sequence
from typing import NoReturn

from tp_controller.errors import TaskPriorityError

REFUSED, INTERRUPTED = 2, 130
"""Exit status after arguments that cannot be used, and after Ctrl-C."""


class OneLineParser(argparse.ArgumentParser):
    """Says what is wrong with the arguments in one line."""

    def error(self, message: str) -> NoReturn:
        """End with `REFUSED`."""
        self.exit(REFUSED, f'{self.prog}: {message} (--help lists the options)\n')

    def run(
        self, job: Callable[[argparse.Namespace], int | None], words: Sequence[str] | None = None
    ) -> int:
        """Do a job with the arguments; return its exit status, `REFUSED` or `INTERRUPTED`."""
        given = self.parse_args(words)
        try:
            return job(given) or 0
        except TaskPriorityError as error:
            print(f'{self.prog}: {error}', file=sys.stderr)
            return REFUSED
        except KeyboardInterrupt:
            print(f'{self.prog}: interrupted', file=sys.stderr)
            return INTERRUPTED


def positive_time(text: str) -> float:
    """Time [s] that an argument names."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0.0 < value < math.inf:
        raise argparse.ArgumentTypeError(f'{text!r} is not a number above 0')
    return value

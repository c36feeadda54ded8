"""What commands have in common."""

from __future__ import annotations

import argparse
import math
from typing import NoReturn

REFUSED = 2
"""Exit status after arguments that cannot be used."""


class OneLineParser(argparse.ArgumentParser):
    """Says what is wrong with the arguments in one line."""

    def error(self, message: str) -> NoReturn:
        """End with `REFUSED`."""
        self.exit(REFUSED, f'{self.prog}: {message} (--help lists the options)\n')


def positive_time(text: str) -> float:
    """Time [s] that an argument names."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0.0 < value < math.inf:
        raise argparse.ArgumentTypeError(f'{text!r} is not a number above 0')
    return value

"""What commands have in common."""

from __future__ import annotations

import argparse
from typing import NoReturn

REFUSED = 2
"""Exit status after arguments that cannot be used."""


class OneLineParser(argparse.ArgumentParser):
    """Says what is wrong with the arguments in one line."""

    def error(self, message: str) -> NoReturn:
        """End with `REFUSED`."""
        self.exit(REFUSED, f'{self.prog}: {message} (--help lists the options)\n')

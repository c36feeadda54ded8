"""Space that the recursion over levels works in, and where everything stands in it.

| matrix | what it has |
|---|---|
| 0 | N, basis of the freedom that levels above leave |
| 2, 3, 9 | B, W, U: directions of a level, see `directions.invert`; 2 and 3 also for others |
| 4 | right sides (rows 0 to 2), and which rows of the Jacobian count (3) |
| 5 | Z, basis of the freedom that joints and rows that are held leave to a level |
| 6 | answers to the right sides, of the gain term alone, its way, and the gain term settled |
| 7 | rows 0 to 2: where a level starts, and its way; 3 and 5: coordinates of velocities |
| 8 | best velocity so far, origin, which rows are held; `FREE` and `SLOWED` |
| 10 | S (0), singular values of levels above (1), weights, lost errors, a pull (2 to 4), least \
rates (5), coordinates (6), `SHARE_GOT`, own singular values (8), `VERDICTS`, `NEEDED` |
| 11, 12 | directions that levels above have taken, and the rows' shares in them |
| 13 to 15 | space for second derivatives |
| 16, 17 | as 11 and 12, of the level itself |
"""

from __future__ import annotations

import numpy as np

SHARE_GOT = (10, 7)
"""Row of the workspace whose first value is the share of its wish that a level gets."""
VERDICTS = (10, 9)
"""Row of the workspace that tells what `settle` found in every level, for reasons that last."""
NEEDED = (10, 10)
"""Row of the workspace whose first value tells whether second derivatives counted."""
FREE, SLOWED = (8, 3), (8, 4)
"""Rows of the workspace with the answer without bounds, and the rows' velocities of it."""


def workspace(rows: int, n: int) -> np.ndarray:
    """Space for up to ``rows`` rows in all and n joints."""
    size = max(rows, n, 10) + n + 1
    return np.zeros((18, size, size))

"""Types of the arrays that compiled functions take."""

from tp_controller.compiled import float64, types

COLUMN = float64[::1]
"""Vector that may be written to."""
ROWS = float64[:, ::1]
"""Matrix, row by row, that may be written to."""
CUBE = float64[:, :, ::1]
"""Matrices one after the other that may be written to."""
FIXED = types.Array(float64, 1, 'C', readonly=True)
"""Vector that is read only."""
FIXED_ROWS = types.Array(float64, 2, 'A', readonly=True)
"""Matrix in any order that is read only."""

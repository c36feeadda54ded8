"""Colors that are told apart by the colour-blind, too (Okabe and Ito 2008)."""

from __future__ import annotations

COLORS = (
    (0, 114, 178),
    (213, 94, 0),
    (0, 158, 115),
    (204, 121, 167),
    (230, 159, 0),
    (86, 180, 233),
    (110, 110, 110),
)
TARGET = (255, 140, 20)
OBSTACLE = (205, 55, 50)
FAR, NEAR = (0, 158, 115), (213, 30, 30)


def color(number: int) -> tuple[int, int, int]:
    """Color of the thing with that number."""
    return COLORS[number % len(COLORS)]


def css(number: int) -> str:
    """The same as HTML writes it."""
    return '#{:02x}{:02x}{:02x}'.format(*color(number))

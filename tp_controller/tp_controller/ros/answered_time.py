"""Time of the joint states that are answered, for what changes by itself."""

from __future__ import annotations

import math
from typing import Protocol


class Follower(Protocol):
    """What changes as time passes."""

    def advance(self, seconds: float) -> None:
        """Let time [s] pass; negative takes time back."""


class AnsweredTime:
    """Adds up the time between the joint states that are answered.

    A simulation faster or slower than real time sees the same, whatever is done to its clock.

    Parameters
    ----------
    followers
        Those who have to know it before the next step.

    Attributes
    ----------
    now
        Time [s] since the first joint state.
    """

    def __init__(self, *followers: Follower) -> None:
        self._followers = list(followers)
        self.now = 0.0

    def follow(self, follower: Follower) -> None:
        """Let one more know it."""
        self._followers.append(follower)

    def advance(self, seconds: float) -> None:
        """Let time pass.

        Parameters
        ----------
        seconds
            Time [s] since the joint state that was answered before, infinite for the first one;
            negative takes time back.
        """
        if math.isfinite(seconds):
            self.now += seconds
        for follower in self._followers:
            follower.advance(seconds)

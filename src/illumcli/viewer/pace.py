"""How coarse pictures must be to come in time, from the times that the last ones took."""

from __future__ import annotations

from collections import deque
from statistics import median

DIVISORS = (1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0)
"""What width and height are divided by; few, so that pictures of one size follow each other."""
FEWEST = 1 << 14
"""Pixels of a picture, at least, however long it takes: smaller ones show nothing."""
SLACK = 1.5
"""A divisor is in use until pictures take longer than they may by this factor."""
MEASURED = 3
"""The median of so many times counts."""


class Pace:
    """The divisor of pictures that may take some time each.

    Parameters
    ----------
    seconds : float
        What a picture may take.
    most : int
        Pixels of a picture, at most, as long as none was measured.
    """

    def __init__(self, seconds: float, most: int) -> None:
        self._seconds = seconds
        self._most = most
        self._divisor: float | None = None
        self._times: deque[float] = deque(maxlen=MEASURED)

    def add(self, divisor: float, seconds: float) -> None:
        """Note the time of a picture."""
        if divisor == self._divisor:
            self._times.append(seconds)

    def divisor(self, pixels: int) -> float:
        """The divisor for a picture of so many pixels: the one in use, unless pictures take too long; a
        smaller one only if even pictures whose time is all in their pixels would come in time."""
        allowed = [each for each in DIVISORS if pixels / each**2 >= FEWEST] or [DIVISORS[0]]
        before = self._divisor
        if before is None:
            self._divisor = next((each for each in allowed if pixels / each**2 <= self._most), allowed[-1])
        elif self._times:
            time = median(self._times)
            fitting = [each for each in allowed if time * (before / each) ** 2 <= self._seconds]
            if time > SLACK * self._seconds or (fitting and fitting[0] < before):
                self._divisor = fitting[0] if fitting else allowed[-1]
        if self._divisor not in allowed:
            self._divisor = allowed[-1]
        if self._divisor != before:
            self._times.clear()
        return self._divisor

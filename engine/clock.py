"""Simulated time as a whole number of ticks, so that it never drifts."""

from dataclasses import dataclass


@dataclass
class Clock:
    """A fixed tick and how many have passed."""

    dt: float = 1 / 32  # s; a power of two: tick * dt is exact
    tick: int = 0

    @property
    def now(self):
        """Seconds since the start."""
        return self.tick * self.dt

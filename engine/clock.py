"""Simulated time as a whole number of ticks, so that it never drifts."""

import struct
from dataclasses import dataclass

_STATE = struct.Struct("<dq")


@dataclass
class Clock:
    """A fixed tick and how many have passed."""

    dt: float = 1 / 32  # s; a power of two: tick * dt is exact
    tick: int = 0

    @property
    def now(self):
        """Seconds since the start."""
        return self.tick * self.dt

    def state(self):
        """The clock as bytes (see `flockbrush.engine.state`)."""
        return _STATE.pack(self.dt, self.tick)

    def set_state(self, data):
        """Put back what `state` gave."""
        self.dt, self.tick = _STATE.unpack(data)

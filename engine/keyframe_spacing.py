"""Which ticks of a recording have a snapshot, so that any moment is not far from one."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass
class KeyframeSpacing:
    """After how many ticks a snapshot is due: told in ticks and animals, never by the clock, so files stay the same."""

    ticks: int  # there is one after so many ticks at the latest; 0 for none at all
    # there is one, sooner, after so many ticks times animals: what must be lived again costs about as much
    steps: float = math.inf
    least: int = 1  # no sooner than after so many ticks
    # animals in all snapshots together after which they get rarer, in proportion to what there are: a recording then
    # grows with the root of its length, as far as `ticks` allows
    room: float = math.inf
    _passed: int = 0  # ticks since the last snapshot
    _lived: int = 0  # and these times animals
    _kept: int = 0  # animals in all snapshots

    def passed(self, animals: int, ticks: int = 1) -> bool:
        """Count a tick, or several, of so many animals; whether a snapshot is due after it."""
        self._passed += ticks
        self._lived += ticks * animals
        rare = max(1.0, self._kept / self.room)
        enough = self._lived >= self.steps * rare and self._passed >= self.least * rare
        if not self.ticks or not (enough or self._passed >= self.ticks):
            return False
        self._passed = self._lived = 0
        self._kept += animals
        return True

    def expected(self, ticks: int, animals: int) -> int:
        """Snapshots in so many ticks, if there are always so many animals."""
        count = snapshots = 0
        while self.ticks:
            rare = max(1.0, snapshots / self.room)
            gap = math.ceil(min(self.ticks, max(self.steps * rare / max(animals, 1), self.least * rare)))
            if gap > ticks:
                break
            ticks, count, snapshots = ticks - gap, count + 1, snapshots + animals
        return count

"""Leaders that pictures mark: those of brushes that mostly follow, because marking nearly all says nothing."""

from __future__ import annotations

import numpy as np

FEW, MANY = 0.4, 0.6  # shares of leaders: marks appear below the first, disappear above the second


class LeaderMarks:
    """The marks of a run.  Between the two shares a brush stays as it was, so that marks do not flicker."""

    def __init__(self, _simulation):
        self._marked = np.zeros(0, bool)  # by brush + 1
        self._known = np.zeros(0, bool)  # whether animals of it have been seen

    def of(self, moment) -> np.ndarray:
        """(n,) bool: the animals of a moment that are marked."""
        kind = moment.brush + 1
        count = np.bincount(kind, minlength=len(self._known))
        share = np.bincount(kind, moment.leader, minlength=len(count)) / np.maximum(count, 1)
        more = len(count) - len(self._known)
        marked, known = (np.concatenate([flags, np.zeros(more, bool)]) for flags in (self._marked, self._known))
        now = np.where(known, marked, share <= (FEW + MANY) / 2)
        now = (now | (share < FEW)) & ~(share > MANY)
        self._marked, self._known = np.where(count > 0, now, marked), known | (count > 0)
        return moment.leader & now[kind]

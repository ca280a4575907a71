"""Birds that change sides in steady flight (Klotsman & Tal [1]_, fig. 14).

In the example a bird flies on one side of the leader in one frame and on the other side in a later one.  The animated
bird that corresponds to it does the same; where the sides of the example are exchanged, it goes the opposite way.
All others keep their order.  The paper does not say how a bird crosses: here it goes behind the others, in a
smooth curve that comes no nearer to anybody than `NEAREST`.

.. [1] Klotsman, M. & Tal, A. (2012). Animation of flocks flying in line formations. Artificial Life 18(1), 91-105.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from flockbrush.behaviours.formation.formation_shapes import FrameShape

NEAREST = 0.9  # wingspans: drawn lateral distances are at least this, out of one another's downwash
STEEPEST = 1.5  # the greatest slope of `_smooth`
DEEPEST = 16 * 2 * np.sqrt(3) / 18  # and of `_dip`
LOOKS = np.linspace(0.0, 1.0, 65)  # parts of a crossing at which distances are looked at


class Arrangement(NamedTuple):
    """Which bird flies in which place, from left to right.  A bird's number is its place in the first frame."""

    left: int  # birds on the left of the leader
    order: np.ndarray  # (n,) bird in each place


def arrangements(frames: list[FrameShape], match: np.ndarray, swap: bool, left: int) -> list[Arrangement]:
    """Where the animated birds fly in each frame, when each keeps to the side of the bird that it corresponds to.

    Parameters
    ----------
    match : ndarray (n,) int
        The place in ``frames[0].birds`` of the bird that each animated one follows, -1 for none.
    swap : bool
        Whether left and right of the example are exchanged.
    left : int
        Birds on the left of the leader in the first frame.

    Notes
    -----
    A frame in which another bird leads says nothing of sides: it takes the arrangement of the frame before.
    """
    first, arrangements = frames[0], [Arrangement(left, np.arange(len(match)))]
    leader = first.birds[first.leader]
    for frame in frames[1:]:
        if frame.birds == first.birds:
            arrangements.append(arrangements[0])
        elif frame.birds[frame.leader] != leader:
            arrangements.append(arrangements[-1])
        else:
            arrangements.append(_arranged(first, frame, match, swap, left))
    return arrangements


def _arranged(first, frame, match, swap, left):
    arms = {-1: list(range(left - 1, -1, -1)), 1: list(range(left + 1, len(match)))}  # from the leader outwards
    side = -1 if swap else 1
    for bird, place in enumerate(match.tolist()):
        if place < 0 or bird == left or first.birds[place] not in frame.birds:
            continue
        before, beside = (1 if bird > left else -1), frame.birds.index(first.birds[place]) - frame.leader
        after = side * (1 if beside > 0 else -1)
        if after == before:
            continue
        theirs = len(frame.birds) - 1 - frame.leader if beside > 0 else frame.leader
        arms[before].remove(bird)
        rank = (abs(beside) - 1) / max(theirs - 1, 1) if theirs > 1 else 1.0  # 0 next to the leader, 1 at the end
        arms[after].insert(round(rank * len(arms[after])), bird)
    return Arrangement(len(arms[-1]), np.array([*arms[-1][::-1], left, *arms[1]]))


class Crossing:
    """The way from one arrangement to another.

    Parameters
    ----------
    start, end : ndarray (n, 2)
        Wingspans to the right and ahead of the leader, by place.
    drift, speed : float
        Wingspans per second through the formation: of those who keep their side, and of those who change it.
    """

    def __init__(self, before: Arrangement, after: Arrangement, start, end, drift: float, speed: float):
        self.after, self.shape = after, end
        n = len(start)
        self.start, self.end = np.empty((n, 2)), np.empty((n, 2))
        self.start[before.order], self.end[after.order] = start, end
        was, is_now = np.empty(n, np.int64), np.empty(n, np.int64)
        was[before.order], is_now[after.order] = np.arange(n) - before.left, np.arange(n) - after.left
        self.birds = np.flatnonzero(np.sign(was) != np.sign(is_now))  # (m,); birds that change sides
        self.dip = np.zeros(n)
        for bird in self.birds.tolist():
            self.dip[bird] = self._depth(bird)
        far = np.abs(self.end - self.start)
        away = np.hypot(STEEPEST * far[:, 0], STEEPEST * far[:, 1] + DEEPEST * self.dip)
        changes = np.isin(np.arange(n), self.birds)
        self.seconds = float((away / np.where(changes, speed, drift)).max())  # how long it takes

    def _depth(self, bird):
        """How far back this bird goes on its way; no farther than it must."""
        paths = np.array([self._at(part) for part in LOOKS])
        others = np.delete(paths, self.birds[self.birds >= bird], axis=1)  # and those whose way is known
        best, room = 0.0, -np.inf
        for dip in np.linspace(0.0, np.ptp(paths[:, :, 1]) + 4.0, 65):
            mine = paths[:, bird] - dip * np.c_[np.zeros(len(LOOKS)), _dip(LOOKS)]
            near = float(np.hypot(*np.moveaxis(others - mine[:, None], 2, 0)).min())
            if near > room + 1e-9:
                best, room = float(dip), near
            if room >= NEAREST - 1e-9:
                break
        return best

    def _at(self, part):
        way = self.start + _smooth(part) * (self.end - self.start)
        way[:, 1] -= self.dip * _dip(part)
        return way

    def at(self, time: float) -> np.ndarray:
        """Where every bird is ``time`` seconds after the crossing began, (n, 2), by bird."""
        return self._at(time / self.seconds)

    def places(self, time: float) -> np.ndarray:
        """The places of the new arrangement meanwhile, (n, 2): free ones move with the place before them."""
        now = self.at(time)[self.after.order]
        free = np.isin(self.after.order, self.birds)
        left = self.after.left
        for k in [*range(left - 1, -1, -1), *range(left + 1, len(now))]:
            before = k + (1 if k < left else -1)
            if free[k]:
                now[k] = now[before] + self.shape[k] - self.shape[before]
        return now


def _smooth(part):
    """From 0 to 1, at rest at both ends."""
    return part * part * (3.0 - 2.0 * part)


def _dip(part):
    """From 0 to 1 and back, at rest at both ends."""
    return 16.0 * part**2 * (1.0 - part) ** 2

"""Steady flight: from an example to a flight of any length by any number of birds (Klotsman & Tal [1]_, section 5).

The example's shapes are built again with as many birds as wanted (step 1), their savings give each bird a range of
shares (step 2), shares drawn from the ranges give key shapes (step 3), and a curve through the key shapes gives the
flight (step 4).  Key shapes are drawn as the flight goes on, so it need not end.  A flight is made of chapters of
`CHAPTER` seconds; each begins and ends with a shape of step 1, in the order of the example's frames, so that a look at
any time draws the key shapes of two chapters at most.

What the paper leaves open and what is settled here:

* Shares are computed on the even grid on which they are solved afterwards; from uneven x the example's own values have
  no solution.
* Draws of eq. 2 do not sum to 1, which contradicts Munk's theorem; they are projected onto those that do.
* A parabola is enlarged with the flock, so that 28 birds do not make a narrower U than 16.
* The leader stays in front: who would pass it in a key shape stays just behind.
* Between key shapes every bird goes monotonously, and the time between two is such that none goes faster through the
  formation than ``drift``.
* Lateral distances change, too, if wanted (``lateral``): shapes of step 1 have the distances that they were drawn with,
  key shapes an even one within the range of the example's means.  The distances between neighbours are interpolated,
  not places, so that the order is kept and nobody comes into another's downwash.
* A bird that changes sides in the example does so in the flight: `flockbrush.behaviours.formation.sides`.

.. [1] Klotsman, M. & Tal, A. (2012). Animation of flocks flying in line formations. Artificial Life 18(1), 91-105.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from flockbrush.behaviours.formation.formation_shapes import Formation, FrameShape
from flockbrush.behaviours.formation.hummel import relative_power, total_power
from flockbrush.behaviours.formation.key_shapes import (
    PROXIMAL,
    NoShape,
    project,
    solve_levenberg_marquardt,
    solve_proximal,
)
from flockbrush.behaviours.formation.sides import NEAREST, Crossing, arrangements
from flockbrush.engine.noise import Noise
from flockbrush.engine.problems import Problem, ProblemsError

WAYS = 1.0, 0.7, 0.4, 0.2  # parts of the way to a key shape that are tried
IN_FRONT = 0.05  # wingspans by which the leader leads at least
CHAPTER = 60.0  # s of a chapter, at least
MANY = 4096  # key shapes of a chapter, at most: a number for each draw


@dataclass(frozen=True)
class Drawing:
    """How key shapes are drawn (eq. 2), and how fast the flock passes from one to the next."""

    epsilon: float = 0.1  # how far shares may leave the example's range; the paper: 0 to .2
    less: float = 0.8  # C1, a share shrinks at most to this part of the one before; the paper: .75 to .9
    more: float = 1.2  # C2, and grows at most to this; the paper: 1.1 to 1.25
    proximal: float = PROXIMAL  # μ; larger moves less from key shape to key shape
    drift: float = 0.4  # wingspans per second, the fastest through the formation; a twentieth of a goose's airspeed
    least_time: float = 2.0  # s between key shapes, at least
    method: str = "proximal"  # or "levenberg-marquardt", the paper's
    lateral: bool = False  # whether lateral distances change as in the example; else they are constant
    crossing: float = 1.6  # wingspans per second, of a bird that changes sides; by eye


def correspond(movie: FrameShape, birds: int, left: int) -> tuple[np.ndarray, bool]:
    """Which bird of the movie each animated one follows, and whether the sides are exchanged.

    The leaders belong together, and the sides with more birds; on a side the birds next to the leader and the last
    ones, then the outliers, then the rest, and whoever is left over has none.

    Returns
    -------
    (n,) int
        Places in ``movie.birds``, -1 for none.
    bool
        Whether the movie must be mirrored.
    """
    theirs = movie.leader, len(movie.birds) - 1 - movie.leader
    ours = left, birds - 1 - left
    swap = (theirs[0] - theirs[1]) * (ours[0] - ours[1]) < 0
    match = np.full(birds, -1)
    match[left] = movie.leader
    for side, count in enumerate(ours):
        outward = -1 if (side == 0) != swap else 1
        arm = [movie.leader + outward * (k + 1) for k in range(theirs[side if not swap else 1 - side])]
        for k, bird in _along(arm, count, set(movie.outliers)):
            match[left + (k + 1) * (-1 if side == 0 else 1)] = bird
    return match, swap


def _along(arm, count, outliers):
    """(place on the animated arm, bird) pairs, in order outwards."""
    if not arm or not count:
        return []
    if count < len(arm):  # first the ends, then special birds, then the rest from the leader outwards
        rank = sorted(range(len(arm)), key=lambda k: (k not in (0, len(arm) - 1), arm[k] not in outliers, k))
        sample = sorted(rank[:count])
        return list(enumerate(arm[k] for k in sample))
    places = np.round(np.linspace(0, count - 1, len(arm))).astype(int)
    return list(zip(places.tolist(), arm, strict=True))


class SteadyFlight:
    """A flock in formation that flies as long as one looks.

    Parameters
    ----------
    formation : Formation
        The example.
    birds : int
        How many fly; the example may have had more or fewer.
    seed : int
        Same seed, same flight.
    left : int, optional
        How many fly to the left of the leader; as in the example by default.
    exchange : bool
        Left and right of the example exchanged, before anything else.

    Raises
    ------
    ProblemsError
        When the example has no frame with a curve, or the numbers of birds make no formation.
    """

    def __init__(self, formation: Formation, birds: int, seed=0, left=None, drawing=None, exchange=False):
        frames = formation.usable
        if not frames:
            reason = formation.frames[0].why if formation.frames else "it has no frames"
            raise _wrong(formation, f"has no frame with a line formation ({reason})")
        if birds < 2:
            raise _wrong(formation, f"a formation needs at least two birds, got {birds}")
        self.formation, first = formation, frames[0]
        if left is None:
            share = first.leader / max(len(first.birds) - 1, 1)
            left = round((1 - share if exchange else share) * (birds - 1))
        if not 0 <= left < birds:
            raise _wrong(formation, f"of {birds} birds at most {birds - 1} fly left of the leader, got {left}")
        self.drawing, self.left, self.noise = drawing or Drawing(), left, Noise(seed)
        self.spacing = max(NEAREST, float(np.mean([frame.spacing[0] for frame in frames])))
        # (n,); wingspans to the right of the leader, from left to right, on the even grid of the first frame
        self.x = (np.arange(birds) - left) * self.spacing
        flown = [_mirror(frame) for frame in frames] if exchange else list(frames)
        self.match, self.swap = correspond(flown[0], birds, left)
        self.means = [float(max(NEAREST, one(f.spacing[0] for f in flown))) for one in (min, max)]
        self.arrangements = arrangements(flown, self.match, self.swap, left)
        shapes = [self._initial(k, frame, flown[0]) for k, frame in enumerate(flown)]
        # (frames, n, 2); the shapes of step 1 by place: wingspans to the right and ahead of the leader
        self.initial = np.array(shapes)
        self.shares = np.array([relative_power(shape[:, 1], self.spacing) for shape in shapes])  # by place
        mine = np.array([s[np.argsort(a.order)] for s, a in zip(self.shares, self.arrangements, strict=True)])
        eps = self.drawing.epsilon
        # low, high: (n,); the learned ranges of shares by bird, widened by epsilon
        self.low, self.high = (1 - eps) * mine.min(axis=0), (1 + eps) * mine.max(axis=0)
        self.crossings = [self._crossing(k) for k in range(len(frames))]
        longest = max(self._passage(k) for k in range(len(frames)))
        self.chapter = max(CHAPTER, 1.5 * longest)
        self._chapters: dict[int, Chapter] = {}

    def __len__(self):
        return len(self.x)

    # step 1 -----------------------------------------------------------------------------

    def _initial(self, at, frame, first):
        """The frame's shape with our birds: curve, deviations, and the outliers' own (step 1)."""
        n, curve, (left, order) = len(self.x), frame.curve, self.arrangements[at]
        draws = self.noise.normal("formation shape", at, np.arange(n), 2)
        dx = np.maximum(frame.spacing[0] + frame.spacing[1] * draws[:, 0], NEAREST)
        x = np.concatenate([-np.cumsum(dx[:left])[::-1], [0.0], np.cumsum(dx[left + 1 :])])
        if self.swap:
            curve = curve.mirrored()
        if n > len(frame.birds):
            curve = curve.scaled((n - 1) / max(len(frame.birds) - 1, 1))
        y = np.array(_both_sides(curve, x, frame, self.swap))
        mean, deviation = frame.deviation
        y += mean + deviation * draws[:, 1]
        out = {frame.birds[k]: k for k in frame.outliers}
        for k, bird in enumerate(self.match[order].tolist()):
            if bird >= 0 and first.birds[bird] in out:
                theirs = out[first.birds[bird]]
                y[k] = _both_sides(curve, x, frame, self.swap)[k] + frame.y[theirs] - frame.curve.y(frame.x[theirs])
        y -= y[left]
        return np.stack([x if self.drawing.lateral else self._grid(left), _behind_the_leader(y, left)], axis=-1)

    def _grid(self, left, spacing=None):
        """Even lateral places (n,) with so many birds on the left of the leader."""
        return (np.arange(len(self.x)) - left) * (spacing or self.spacing)

    def _crossing(self, k):
        """How birds change sides after the k-th frame, or None."""
        then = (k + 1) % len(self.initial)
        before, after = self.arrangements[k], self.arrangements[then]
        if np.array_equal(before.order, after.order):
            return None
        return Crossing(before, after, self.initial[k], self.initial[then], self.drawing.drift, self.drawing.crossing)

    def _passage(self, k):
        """s that the flock needs from the shape of the k-th frame to the next."""
        then = (k + 1) % len(self.initial)
        if self.crossings[k] is not None:
            return self.crossings[k].seconds
        return self.pause(self.initial[k], self.initial[then])

    # step 3 -----------------------------------------------------------------------------

    def pause(self, a, b):
        """s from one shape (n, 2) to another: monotone curves go at most at twice their mean speed."""
        far = np.abs(b - a)
        if self.drawing.lateral:  # distances between neighbours are interpolated: a bird goes at most their sum
            gaps = np.abs(np.diff(b[:, 0]) - np.diff(a[:, 0]))
            left = int(np.flatnonzero(a[:, 0] == 0.0)[0])
            far[:left, 0], far[left + 1 :, 0] = np.cumsum(gaps[:left][::-1])[::-1], np.cumsum(gaps[left:])
        return max(self.drawing.least_time, 2.0 * float(np.hypot(far[:, 0], far[:, 1]).max()) / self.drawing.drift)

    def key(self, k):
        """The k-th key shape of the first chapter: wingspans to the right and ahead of the leader, (n, 2)."""
        return self._chapter(0).key(k)

    def _chapter(self, number):
        if number not in self._chapters:
            if len(self._chapters) > 2:  # somebody looks at frames in turn
                del self._chapters[next(iter(self._chapters))]
            self._chapters[number] = Chapter(self, number)
        return self._chapters[number]

    def drawn(self, at, last, before, arrangement):
        """A key shape (eqs. 2 to 4, eq. 2 projected) after the shape ``last`` of shares ``before``, and its shares."""
        how, (left, order) = self.drawing, arrangement
        low, high = np.maximum(self.low[order], how.less * before), np.minimum(self.high[order], how.more * before)
        chance = self.noise.uniform("formation key", at, np.arange(len(self.x)))[:, 0]
        spacing = self.spacing
        if how.lateral:  # "the x-distance is constant, chosen from the range of possible mean x-distances"
            least, most = self.means
            spacing = least + float(self.noise.uniform("formation spacing", at, [0])[0, 0]) * (most - least)
        try:
            share = project(low + chance * (high - low), low, high)
            x = self._grid(left, spacing)
            return np.stack([x, self._shape(share, last[:, 1], x, arrangement)], axis=-1), share
        except (NoShape, ValueError):
            message = (
                f"no shape saves the shares of power that this one does; allow more than epsilon = {how.epsilon:g}"
            )
            raise _wrong(self.formation, message) from None

    def _shape(self, share, last, x, arrangement):
        """The key shape of these shares with the leader in front; or as far towards it as the ranges allow."""
        how, wanted, (left, order) = self.drawing, share * float(total_power(x)), arrangement
        if how.method == "proximal":
            y = solve_proximal(x, wanted, last, how.proximal)
        else:
            try:
                y = solve_levenberg_marquardt(x, wanted, last)
            except NoShape:  # no shape has these shares: as near as the proximal form comes
                y = solve_proximal(x, wanted, last, how.proximal)
        y = _behind_the_leader(y - y[left], left)
        best, least = y, np.inf
        for way in WAYS:
            there = last + way * (y - last)
            beyond = max(self._beyond(last + part * (there - last), order) for part in (0.3, 0.7, 1.0))
            if beyond < least - 1e-3:
                best, least = there, beyond
            if least <= 0.0:
                break
        return best

    def _beyond(self, y, order):
        """By how much the worst share leaves its range, relative; not above 0 when none does."""
        share = relative_power(y, self.spacing)
        low, high = self.low[order], self.high[order]
        return float((np.maximum(low - share, share - high) / np.maximum(share, 1e-12)).max())

    # step 4 -----------------------------------------------------------------------------

    def at(self, time):
        """Where every bird is at a time in seconds: wingspans to the right and ahead of the leader, (n, 2)."""
        chapter, since = self._since(time)
        return chapter.at(since)

    def places(self, time):
        """The places at that time, from left to right, (n, 2): as `at`, but whose bird changes sides is free."""
        chapter, since = self._since(time)
        if since < chapter.times[0]:
            return chapter.crossing.places(since)
        return chapter.shape(since)

    def changes_sides(self, time):
        """Whether somebody is between two sides at that time."""
        chapter, since = self._since(time)
        return 0.0 < since < chapter.times[0]

    def _since(self, time):
        if not time >= 0:
            raise ValueError(f"a flight begins at 0 s, got {time}")
        number, since = divmod(time, self.chapter)
        return self._chapter(int(number)), since

    def frames(self, count, fps=25.0):
        """The first ``count`` frames: (count, n, 2), wingspans, the leader at the origin."""
        return np.array([self.at(k / fps) for k in range(count)])

    def report(self, frames, fps=25.0):
        """What a flight kept to.

        Returns
        -------
        dict
            ``outside``: the part of all shares that left its range; ``beyond``: by how much at most, relative;
            ``fastest``: wingspans a second through the formation; ``leader_in_front``: the part of frames;
            ``least_aside``: wingspans, the least lateral distance of neighbours.  All of these in the frames in
            which nobody changes sides; ``switches``: how many do so.
        """
        crossing = np.array([self.changes_sides(k / fps) for k in range(len(frames))])
        stands = np.flatnonzero(~crossing)
        places = np.argsort(frames[stands, :, 0], axis=1)  # bird in each place
        share = np.empty(places.shape)
        for k, order in zip(range(len(stands)), places, strict=True):
            share[k, order] = relative_power(frames[stands[k], order, 1], self.spacing)
        off = np.maximum(self.low - share, share - self.high) / np.where(share > 0, share, 1.0)
        steady = stands[:-1][np.diff(stands) == 1]
        ways = np.linalg.norm(frames[steady + 1] - frames[steady], axis=2)
        return {
            "frames": len(frames),
            "birds": len(self.x),
            "outside": float((off > 1e-9).mean()),
            "beyond": float(max(off.max(), 0.0)),
            "fastest": float(ways.max()) * fps if len(ways) else 0.0,
            "leader_in_front": float((frames[stands, :, 1].argmax(axis=1) == self.left).mean()),
            "least_aside": float(np.diff(np.sort(frames[stands, :, 0], axis=1), axis=1).min()),
            "switches": self._switches((len(frames) - 1) / fps),
        }

    def _switches(self, until):
        """How many birds have begun to change sides by that time."""
        begun = [self.crossings[k % len(self.crossings)] for k in range(int(until // self.chapter) + 1)]
        return sum(len(crossing.birds) for crossing in begun if crossing is not None)


class Chapter:
    """A part of a flight: from the step-1 shape of one frame of the example to that of the next, by key shapes.

    Where birds change sides between the two, they do so first, and the key shapes lead from the new shape back to it.
    """

    def __init__(self, flight: SteadyFlight, number: int):
        frames = len(flight.initial)
        start, then = number % frames, (number + 1) % frames
        self.flight, self.number, self.crossing = flight, number, flight.crossings[start]
        if self.crossing is not None:
            start = then
        self.arrangement = flight.arrangements[then]
        self.keys, self.times = [flight.initial[start]], [self.crossing.seconds if self.crossing else 0.0]
        self.end, self.share = flight.initial[then], flight.shares[start]

    def key(self, k):
        """The k-th key shape; the last one where there are fewer."""
        while len(self.keys) <= k and self.times[-1] < self.flight.chapter:
            self._draw()
        return self.keys[min(k, len(self.keys) - 1)]

    def _draw(self):
        """One more key shape; the last as soon as there is time for no other."""
        flight, last, now = self.flight, self.keys[-1], self.times[-1]
        shape, share = flight.drawn(self.number * MANY + len(self.keys), last, self.share, self.arrangement)
        then = now + flight.pause(last, shape)
        if then + flight.pause(shape, self.end) > flight.chapter:
            shape, then = self.end, flight.chapter
        self.keys.append(shape)
        self.times.append(then)
        self.share = share

    def at(self, time):
        """Where every bird is ``time`` s after the chapter began, (n, 2)."""
        if time < self.times[0]:
            return self.crossing.at(time)
        out = np.empty((len(self.arrangement.order), 2))
        out[self.arrangement.order] = self.shape(time)
        return out

    def shape(self, time):
        """The shape by place, from left to right, after any change of sides, (n, 2)."""
        while self.times[-1] <= time:
            self._draw()
        times = self.times
        k = int(np.searchsorted(times, time, side="right")) - 1
        self.key(k + 2)
        now = [keys[:, 1] for keys in self.keys[max(k - 1, 0) : k + 3]]
        y = _between(now, times[max(k - 1, 0) : k + 3], min(k, 1), time)
        if not self.flight.drawing.lateral:
            return np.stack([self.keys[k][:, 0], y], axis=-1)
        now = [np.diff(keys[:, 0]) for keys in self.keys[max(k - 1, 0) : k + 3]]
        x = np.r_[0.0, np.cumsum(_between(now, times[max(k - 1, 0) : k + 3], min(k, 1), time))]
        return np.stack([x - x[self.arrangement.left], y], axis=-1)


def _between(keys, times, k, time):
    """A monotone curve through keys, between the k-th and the next; at rest where there is none before or after."""
    gap = times[k + 1] - times[k]
    rise = (keys[k + 1] - keys[k]) / gap
    rest = np.zeros_like(rise)
    before = (keys[k] - keys[k - 1]) / (times[k] - times[k - 1]) if k else rest
    after = (keys[k + 2] - keys[k + 1]) / (times[k + 2] - times[k + 1]) if k + 2 < len(keys) else rest
    return _hermite((time - times[k]) / gap, gap, keys[k], keys[k + 1], _gentle(before, rise), _gentle(rise, after))


def _wrong(formation, message):
    return ProblemsError([Problem(formation.name or "formation", None, None, message)])


def _mirror(frame: FrameShape) -> FrameShape:
    """The frame as in a mirror."""
    n = len(frame.birds)
    return FrameShape(
        frame.frame, frame.birds[::-1], tuple(-x for x in frame.x[::-1]), frame.y[::-1], n - 1 - frame.leader,
        frame.kind, frame.why, frame.curve.mirrored() if frame.curve else None,
        tuple(sorted(n - 1 - k for k in frame.outliers)), frame.spacing, frame.deviation,
    )  # fmt: skip


def _both_sides(curve, x, frame, swap):
    """The curve's y; a side on which the example has no birds is the mirror of the other."""
    has = frame.leader > 0, frame.leader < len(frame.birds) - 1
    if swap:
        has = has[::-1]
    x = np.asarray(x)
    if not has[0]:
        x = np.where(x < 0, -x, x)
    if not has[1]:
        x = np.where(x > 0, -x, x)
    return curve.y(x)


def _behind_the_leader(y, left):
    """``y``, with the leader in front."""
    out = np.minimum(y, y[left] - IN_FRONT)
    out[left] = y[left]
    return out


def _gentle(before, after):
    """Slopes at a key that let no curve overshoot: harmonic mean, 0 at turning points."""
    same = before * after > 0
    return np.where(same, 2.0 * before * after / np.where(same, before + after, 1.0), 0.0)


def _hermite(t, gap, a, b, slope_a, slope_b):
    t2, t3 = t * t, t * t * t
    return (
        (2 * t3 - 3 * t2 + 1) * a + (t3 - 2 * t2 + t) * gap * slope_a
        + (3 * t2 - 2 * t3) * b + (t3 - t2) * gap * slope_b
    )  # fmt: skip

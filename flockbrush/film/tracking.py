"""Detect birds in each frame of a video of the sky, and track them through crossings, gaps and picture edges.

Each frame is divided into blobs that differ from the sky, and each blob into parts: one for each peak of the contrast,
smoothed by a share of the thickness of the blob. If single birds have several peaks (long wings), a blob has no more
parts than its area allows. Every known bird predicts its position from its own velocity relative to the flock. If more
birds are predicted in a blob than it has peaks, the blob is split among them if it is large enough; else some birds
are taken to be hidden by others for a while. Birds that pass in front of each other thus keep their identities. Birds
and parts are matched at the least total cost (`scipy.optimize.linear_sum_assignment` [1]_). At the end, tracks that
break off are joined to tracks that begin a little later, where their extrapolated paths meet.

.. [1] Crouse, D. F. (2016). On implementing 2D rectangular assignment algorithms. IEEE Transactions on Aerospace and
   Electronic Systems 52(4), 1679-1696.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import cv2
import numpy as np
from scipy.optimize import linear_sum_assignment

from flockbrush.film.birds_in_sky import away_from_sky
from flockbrush.film.crossings import Crossed, renamed
from flockbrush.film.tracks import Tracks

GAIN_PLACE, GAIN_VELOCITY = 0.5, 0.12  # of the filter that follows a bird (alpha, beta)
BORN_AFTER = 3  # frames in a row, before something is a bird
GAP = 12  # frames a bird may be out of sight before its track ends
JOIN = 30  # frames between a track that breaks off and one that goes on
HIDDEN = 10  # frames a bird may be foretold within a patch without being told apart in it
PART = 0.35  # of a patch's greatest half width: the blur that leaves one peak for each bird
FAINT = 0.3  # of the highest peak: a lower one is none
WINGED = 0.1  # of the blobs of single birds: if more have several peaks, wings have peaks of their own
NEW = 0.8  # of the usual area for each bird of a blob in which fewer were foretold
ROOM = 0.55  # of the usual area for each bird that was foretold in a blob
ROUNDS = 8  # of k-means
LEAST = 5  # px, area of a blob
FAR = 1e6  # a cost that means: never


@dataclass
class Blob:
    """A patch of a picture that differs from the sky."""

    at: np.ndarray  # (2,) px
    pixels: np.ndarray  # (k, 2) px
    weight: np.ndarray  # (k,) contrast
    peaks: np.ndarray  # (n, 2) px, middles of what it seems to be made of

    @property
    def area(self):
        return len(self.pixels)


def blobs_of(image) -> list[Blob]:
    """The patches of a picture that differ from the sky.

    Parameters
    ----------
    image : (h, w, 3) or (h, w) uint8 ndarray
    """
    away, threshold = away_from_sky(image)
    mask, away = (away > threshold).astype(np.uint8), away.astype(np.float32)
    count, labels, stats, _ = cv2.connectedComponentsWithStats(mask, connectivity=8)
    most = min(mask.shape) / 6
    blobs = []
    for k in range(1, count):
        left, top, wide, tall, area = stats[k]
        if area < LEAST or max(wide, tall) > most:
            continue
        mine = (labels[top : top + tall, left : left + wide] == k).astype(np.uint8)
        y, x = np.nonzero(mine)
        weight = away[top + y, left + x].astype(float)
        pixels = np.column_stack([x + left + 0.5, y + top + 0.5])
        peaks = _peaks(mine, away[top : top + tall, left : left + wide] / (2 * threshold)) + (left, top)
        blobs.append(Blob(weight @ pixels / weight.sum(), pixels, weight, peaks))
    return blobs


def _peaks(mine, contrast):
    """Peaks of the contrast of a patch, (n, 2) px, smoothed by a share of the thickness of the patch."""
    edge = 6
    inside = cv2.copyMakeBorder(mine, edge, edge, edge, edge, cv2.BORDER_CONSTANT)
    ink = cv2.copyMakeBorder(np.minimum(contrast, 1) * mine, edge, edge, edge, edge, cv2.BORDER_CONSTANT)
    thick = float(cv2.distanceTransform(inside, cv2.DIST_L2, 5).max())
    blur = max(PART * thick, 0.5)
    smooth = cv2.GaussianBlur(ink, (0, 0), blur)
    side = 2 * max(1, round(0.8 * blur)) + 1
    top = (smooth >= cv2.dilate(smooth, np.ones((side, side)))) & (inside > 0) & (smooth > FAINT * smooth.max())
    y, x = np.nonzero(top)
    return np.column_stack([x, y]) - edge + 0.5


def split(blob, centres, rounds=8):
    """Centres of the parts of a blob that contains several birds, by k-means.

    Parameters
    ----------
    blob : Blob
    centres : (k, 2) array_like
        Predicted positions to start from, px.
    rounds : int
        Largest number of iterations.

    Returns
    -------
    (k, 2) ndarray
    """
    centres = np.array(centres, float)
    for _ in range(rounds):
        nearest = np.argmin(((blob.pixels[:, None] - centres[None]) ** 2).sum(-1), axis=1)
        moved = centres.copy()
        for k in range(len(centres)):
            mine = nearest == k
            if mine.any():
                moved[k] = blob.weight[mine] @ blob.pixels[mine] / blob.weight[mine].sum()
        if np.abs(moved - centres).max() < 0.05:
            break
        centres = moved
    return centres


def divided(blob, foretold, usual, reach, winged=True):
    """Divide a blob among birds.

    There is a bird for each peak, and one for each predicted position without a peak as long as the area of the blob
    allows it. The other predicted birds are hidden, and stay at the nearest pixel of the blob.

    Parameters
    ----------
    blob : Blob
    foretold : (n, 2) array_like
        Predicted positions, px.
    usual : float
        Usual area of a bird, px².
    reach : float
        Largest distance of a peak from a predicted position, px.
    winged : bool
        Single birds have several peaks: then there are no more birds than predicted, or than the area allows.

    Returns
    -------
    (k, 2) ndarray, (m, 2) ndarray
        Positions of the birds that can be told apart, and of hidden ones.
    """
    rest = np.array(foretold).reshape(-1, 2)
    size = blob.area / usual
    peaks = _fewer(blob, rest, max(len(rest), int(size / NEW)) if winged else len(blob.peaks))
    if len(rest):
        gaps = np.linalg.norm(rest[:, None] - peaks[None], axis=-1)
        rows, columns = linear_sum_assignment(np.minimum(gaps, reach) ** 2)
        rest = np.delete(rest, rows[gaps[rows, columns] < reach], axis=0)
    room = max(0, int(size / ROOM) - len(peaks))
    centres = np.concatenate([peaks, rest[:room]])
    parts = split(blob, centres, ROUNDS) if len(centres) > 1 else peaks
    hidden = [blob.pixels[np.argmin(((blob.pixels - place) ** 2).sum(1))] for place in rest[room:]]
    return parts, np.array(hidden).reshape(-1, 2)


def _fewer(blob, foretold, most):
    """At most `most` peaks of a blob, (n, 2) px, that are farthest apart; for one, the middle of the blob."""
    if len(blob.peaks) < 2 or most < 2:
        return blob.at[None]
    if len(blob.peaks) <= most:
        return blob.peaks
    if len(foretold) == most:
        return split(blob, foretold, ROUNDS)
    chosen = [int(np.argmax(np.linalg.norm(blob.peaks - blob.at, axis=1)))]
    while len(chosen) < most:
        gaps = np.linalg.norm(blob.peaks[:, None] - blob.peaks[None, chosen], axis=-1).min(axis=1)
        chosen.append(int(np.argmax(gaps)))
    return blob.peaks[chosen]


@dataclass(eq=False)
class _Bird:
    """One bird that is followed."""

    number: int
    at: np.ndarray
    velocity: np.ndarray
    area: float
    path: dict = field(default_factory=dict)  # frame -> (2,) px
    missed: int = 0
    sights: int = 1  # since it was found, or put right
    hidden: int = 0  # frames in a row in which it was not told apart from others
    sure: bool = False  # named by hand, or seen often enough
    turns: list = field(default_factory=list)  # frames: no bird from the first on, one again from the second, ...

    @property
    def gone(self):
        """Whether a person has said that it is no bird."""
        return len(self.turns) % 2 == 1

    def path_as_bird(self):
        """The part of its path in which it is a bird."""
        return {f: at for f, at in self.path.items() if np.searchsorted(self.turns, f, "right") % 2 == 0}

    def foretold(self):
        return self.at + self.velocity

    def see(self, frame, at, area=None):
        before = self.foretold()
        off = at - before
        self.sights += 1
        n = self.sights  # the fewer, the more each one counts, as in a line fitted to all of them
        gain = max(GAIN_VELOCITY, min(0.6, 6 / (n * (n + 1))))
        self.velocity = self.velocity + gain * off / (1 + self.missed)
        self.at = before + max(GAIN_PLACE, 2 * (2 * n - 1) / (n * (n + 1))) * off
        self.path[frame] = np.array(at)
        self.missed = 0
        self.sure = self.sure or len(self.path) >= BORN_AFTER
        if area is not None:
            self.area += 0.1 * (area - self.area)

    def miss(self):
        self.at = self.foretold()
        self.missed += 1


class Tracker:
    """Tracks the birds of a video, frame by frame.

    Parameters
    ----------
    seeds, corrections : dict of int to list of (id, x, y) or (id, x, y, gone)
        By frame: positions of birds marked by hand, px. A correction overrides what was detected. With `gone` the
        object is no bird from this frame on; it is still tracked, so that it is not detected again, but not returned.
        A correction of a bird that was detected automatically has the number that this bird has without corrections.
    reach : float, optional
        Largest distance of a bird from its predicted position, px; by default about twice the extent of the usual blob.
    first : int
        Number of the first frame.
    fresh : int
        First number of birds that are detected automatically, if no seed has a larger one.

    Attributes
    ----------
    begun : list of (int, int)
        Frame and number of each correction with which a bird began, because none had this number before.
    """

    def __init__(self, seeds=None, corrections=None, reach=None, first=0, fresh=1):
        seeds, self._corrections = seeds or {}, corrections or {}
        self.by_hand = _merged(seeds, self._corrections)
        self.reach = reach
        self.frame = first - 1
        self.birds: list[_Bird] = []
        self.gone: list[_Bird] = []
        self.next = max(fresh, 1 + max((row[0] for rows in seeds.values() for row in rows), default=0))
        self.begun: list[tuple[int, int]] = []
        self._named: set[int] = set()  # birds that began by hand
        self._blobs: dict[int, dict[tuple[float, float], tuple[int, float]]] = {}  # frame -> place -> (blob, area)
        self._areas: list[float] = []
        self._peaked: list[bool] = []

    def step(self, image):
        """Process the next frame, (h, w, 3) or (h, w) uint8."""
        self.take(blobs_of(image))

    def take(self, blobs):
        """Process the blobs of the next frame."""
        self.frame += 1
        self._areas = (self._areas + [b.area for b in blobs])[-2000:]
        usual = float(np.median(self._areas)) if self._areas else 1.0
        lone = self._lone(blobs, usual)
        self._peaked = (self._peaked + [len(b.peaks) > 1 for b in lone])[-2000:]
        reach = self.reach or max(6.0, 2.2 * np.sqrt(usual))
        seen, area, apart = self._parts(blobs, usual, reach)
        free = np.ones(len(seen), bool)
        for number, x, y, *removed in self.by_hand.get(self.frame, ()):
            self._by_hand(number, np.array([x, y]), seen, free, reach, any(removed))
        self._match(seen, area, free, reach)
        self._begin(seen, area, free & apart, reach)
        self._unmask(set(map(tuple, seen[~apart].tolist())))
        self._let_go()

    def _lone(self, blobs, usual):
        """Blobs of about the usual area in which at most one bird was predicted."""
        known = [bird.foretold() for bird in self.birds if bird.sure and bird.missed <= 4]
        lone = []
        for blob in blobs:
            if 0.5 * usual < blob.area < 1.25 * usual:
                low, high = blob.pixels.min(axis=0) - 1, blob.pixels.max(axis=0) + 1
                if sum(bool((low <= at).all() and (at <= high).all()) for at in known) <= 1:
                    lone.append(blob)
        return lone

    @property
    def _winged(self):
        """Whether single birds have several peaks, so that peaks do not count birds."""
        return not self._peaked or np.mean(self._peaked) > WINGED

    def _parts(self, blobs, usual, reach):
        """Positions of birds in this frame (k, 2) px, areas (k,) px², and whether each is separate from others (k,)."""
        foretold = [bird.foretold() for bird in self.birds if bird.sure and bird.missed <= 4]
        inside: list[list[np.ndarray]] = [[] for _ in blobs]
        if blobs and foretold:
            low, high = (np.array([edge(blob.pixels, axis=0) for blob in blobs]) for edge in (np.min, np.max))
            for place in foretold:
                off = np.maximum(low - place, place - high).max(1) - 0.5  # of the box: never more than of the blob
                near = np.flatnonzero(off <= 0.5 * reach)
                gaps = [_gap(blobs[k], place) for k in near]
                if gaps and min(gaps) <= 0.5 * reach:
                    inside[near[int(np.argmin(gaps))]].append(place)
        places, areas, apart = [np.zeros((0, 2))], [], []
        here = self._blobs.setdefault(self.frame, {})
        for number, (blob, mine) in enumerate(zip(blobs, inside, strict=True)):
            parts, hidden = divided(blob, mine, usual, reach, self._winged)
            places += [parts, hidden]
            areas += [blob.area / len(parts)] * len(parts) + [usual] * len(hidden)
            apart += [True] * len(parts) + [False] * len(hidden)
            several = len(parts) + len(hidden) > 1
            for place in (*parts, *hidden):
                here[place[0], place[1]] = (number, np.nan) if several else (-1, blob.area)
        return np.concatenate(places), np.array(areas), np.array(apart, bool)

    def _by_hand(self, number, at, seen, free, reach, gone=False):
        bird = next((b for b in self.birds if b.number == number), None) or self._resumed(number)
        if bird is None:
            bird = _Bird(number, at.copy(), self._drift(), 0.0)
            self.birds.append(bird)
            self._named.add(number)
            if number in (row[0] for row in self._corrections.get(self.frame, ())):
                self.begun.append((self.frame, number))
        if len(seen):
            gaps = np.where(free, np.linalg.norm(seen - at, axis=1), np.inf)
            k = int(np.argmin(gaps))
            if gaps[k] <= 0.7 * reach:
                free[k] = False
                at = seen[k]
        jump = at - bird.foretold()
        bird.see(self.frame, at)
        if np.linalg.norm(jump) > reach:  # it had been somebody else: its velocity says nothing
            bird.velocity, bird.sights = self._drift(), 1
        bird.at, bird.sure = at.copy(), True
        if gone != bird.gone:
            bird.turns.append(self.frame)

    def _resumed(self, number):
        """The bird with a number whose track has ended, with the tracks that continue it; None if there was none."""
        bird = next((b for b in self.gone if b.number == number), None)
        if bird is None:
            return None
        self.gone.remove(bird)
        rest = [b for b in (bird, *self.gone, *self.birds) if b.sure and len(b.path_as_bird()) >= BORN_AFTER]
        following = dict(self._joins(rest))
        while number in following:
            number = following[number]
            other = next(b for b in rest if b.number == number)
            (self.birds if other in self.birds else self.gone).remove(other)
            bird = replace(other, number=bird.number, path=bird.path | other.path, turns=bird.turns + other.turns)
        self.birds.append(bird)
        return bird

    def _joins(self, birds):
        """(number, number of the track that continues it) of birds whose tracks broke off, in order of time."""
        ended = {b.number for b in birds if b.gone}
        paths = {b.number: b.path_as_bird() for b in birds}
        return _joins(paths, self.reach or 30.0, ended, self._named)

    def _drift(self):
        """Median velocity of the flock, (2,) px per frame."""
        known = [b.velocity for b in self.birds if b.sure and not b.missed]
        return np.median(known, axis=0) if known else np.zeros(2)

    def _match(self, seen, area, free, reach):
        waiting = [b for b in self.birds if self.frame not in b.path]
        columns = np.flatnonzero(free)
        taken = set()
        if waiting and len(columns):
            foretold = np.array([b.foretold() for b in waiting])
            gaps = np.linalg.norm(foretold[:, None] - seen[None, columns], axis=-1)
            wide = np.array([reach * (1 + 0.25 * min(b.missed, 6)) * (1 if b.sure else 1.5) for b in waiting])
            cost = np.where(
                gaps <= wide[:, None],
                gaps**2 / reach + 0.02 * np.abs(np.subtract.outer([b.area for b in waiting], area[columns])),
                FAR,
            )
            cost[[not b.sure for b in waiting]] += 0.3 * reach  # who is known comes first
            cost[cost >= FAR] = FAR
            for r, c in zip(*linear_sum_assignment(cost), strict=True):
                if cost[r, c] < FAR:
                    waiting[r].see(self.frame, seen[columns[c]], area[columns[c]])
                    free[columns[c]] = False
                    taken.add(r)
        for r, bird in enumerate(waiting):
            if r not in taken:
                bird.miss()

    def _begin(self, seen, area, free, reach):
        for k in np.flatnonzero(free):
            near = [np.linalg.norm(b.at - seen[k]) for b in self.birds if b.sure and not b.missed]
            if near and min(near) < 0.25 * reach:
                continue  # a scrap of somebody
            while self.next in self._named:
                self.next += 1
            path = {self.frame: seen[k].copy()}
            self.birds.append(_Bird(self.next, seen[k].copy(), self._drift(), float(area[k]), path))
            self.next += 1

    def _unmask(self, unseen):
        """End birds that were hidden by others for long, and remove their guessed positions."""
        for bird in self.birds:
            place = bird.path.get(self.frame)
            bird.hidden = bird.hidden + 1 if place is not None and tuple(place.tolist()) in unseen else 0
            if bird.hidden > HIDDEN:
                for frame in range(self.frame - bird.hidden + 1, self.frame + 1):
                    bird.path.pop(frame, None)
                bird.missed = GAP + 1

    def _let_go(self):
        remaining = []
        for bird in self.birds:
            if bird.missed > (GAP if bird.sure else 1):
                if bird.sure:
                    self.gone.append(bird)
            else:
                remaining.append(bird)
        self.birds = remaining

    def tracks(self) -> Tracks:
        """The tracks so far, broken ones joined, in order of number.

        Raises
        ------
        ValueError
            When no bird was followed.
        """
        birds = [b for b in self.gone + self.birds if b.sure and len(b.path_as_bird()) >= BORN_AFTER]
        if not birds:
            raise ValueError("no bird could be tracked through three frames")
        paths = {b.number: dict(b.path_as_bird()) for b in birds}
        name = {number: number for number in paths}
        for one, other in self._joins(birds):
            name[other] = name[one]
            paths[name[one]].update(paths.pop(other))
        numbers = sorted(paths)
        frames = [f for path in paths.values() for f in path]
        first, last = min(frames), max(frames)
        px = np.full((last - first + 1, len(numbers), 2), np.nan)
        blob, area, fixed = np.full(px.shape[:2], -1), np.full(px.shape[:2], np.nan), np.zeros(px.shape[:2], bool)
        for n, number in enumerate(numbers):
            for f, at in paths[number].items():
                px[f - first, n] = at
                blob[f - first, n], area[f - first, n] = self._blobs.get(f, {}).get((at[0], at[1]), (-1, np.nan))
        for f, rows in self.by_hand.items():
            if first <= f <= last:
                fixed[f - first] = np.isin(numbers, [row[0] for row in rows])
        names = renamed(Crossed(px, blob, area, fixed))
        return Tracks(np.take_along_axis(px, np.argsort(names, 1)[..., None], 1), np.array(numbers), first)


def _gap(blob, place):
    """How far a place is from a blob, px; 0 inside."""
    return max(0.0, float(np.abs(blob.pixels - place).max(1).min()) - 0.5)


def _merged(*tables):
    out: dict[int, list] = {}
    for table in tables:
        for frame, rows in table.items():
            out.setdefault(int(frame), []).extend(rows)
    return out


def _ends(path, at_end, span=6):
    """(frame, place, velocity) of the beginning or the end of a path, by a line through a few frames."""
    frames = sorted(path)[-span:] if at_end else sorted(path)[:span]
    places = np.array([path[f] for f in frames])
    t = np.array(frames, float)
    if len(t) < 2:
        return frames[0], places[0], np.zeros(2)
    slope = np.polyfit(t, places, 1)
    f = frames[-1] if at_end else frames[0]
    return f, slope[0] * f + slope[1], slope[0]


def _joins(paths, reach, ended=(), named=()):
    """(number, number) of tracks that break off and of those that begin up to `JOIN` frames later where both meet.

    In order of time. Those that a person has ended, or begun with a name, stay so.
    """
    numbers = sorted(paths)
    ends = {n: _ends(paths[n], True) for n in numbers}
    starts = {n: _ends(paths[n], False) for n in numbers}
    cost = np.full((len(numbers), len(numbers)), FAR)
    for i, a in enumerate(numbers):
        for j, b in enumerate(numbers):
            wait = starts[b][0] - ends[a][0]
            if a != b and a not in ended and b not in named and 0 < wait <= JOIN:
                forth = ends[a][1] + wait * ends[a][2] - starts[b][1]
                back = starts[b][1] - wait * starts[b][2] - ends[a][1]
                off = 0.5 * (np.linalg.norm(forth) + np.linalg.norm(back))
                if off <= reach * (0.5 + wait / 12):
                    cost[i, j] = off + 0.3 * wait
    pairs = [(numbers[i], numbers[j]) for i, j in zip(*linear_sum_assignment(cost), strict=True) if cost[i, j] < FAR]
    return sorted(pairs, key=lambda pair: ends[pair[0]][0])

"""Corrections of the birds of a film: positions set by hand, tracking from there on, undo, and files."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from flockbrush.film.birds_in_sky import PictureTracker
from flockbrush.film.tracking import JOIN, Tracker, blobs_of
from flockbrush.film.tracks import Tracks

BLOBS = 4000  # frames whose patches are remembered


@dataclass(frozen=True)
class Birds:
    """The birds of all frames; every edit returns a new object."""

    px: np.ndarray  # (F, N, 2); pixels, NaN where a bird is not seen
    ids: tuple[int, ...] = ()
    # corrections by frame and bird: (x, y, gone). Gone: the bird is removed from this frame on.
    corrections: dict[int, dict[int, tuple[float, float, bool]]] = field(default_factory=dict)
    pending: int | None = None  # the first frame that was corrected and not tracked again from

    @classmethod
    def none(cls, frames) -> Birds:
        """An object without birds, for so many frames."""
        return cls(np.zeros((frames, 0, 2)))

    @classmethod
    def of(cls, tracks: Tracks, frames) -> Birds:
        """The birds of tracks; positions outside the film are left out."""
        px = np.full((frames, len(tracks.ids), 2), np.nan)
        low, high = max(0, tracks.first), min(frames, tracks.first + len(tracks.px))
        if low < high:
            px[low:high] = tracks.px[low - tracks.first : high - tracks.first]
        return cls(px, tuple(int(bird) for bird in tracks.ids))

    def at(self, k) -> dict[int, tuple[float, float]]:
        """{bird: (x, y)} of a frame."""
        row = self.px[k]
        return {self.ids[n]: (float(row[n, 0]), float(row[n, 1])) for n in np.flatnonzero(np.isfinite(row[:, 0]))}

    def tail(self, bird, k, frames) -> np.ndarray:
        """Positions of a bird in the frames up to this one, (m, 2)."""
        path = self.px[max(0, k - frames) : k + 1, self.ids.index(bird)]
        return path[np.isfinite(path[:, 0])]

    def sights(self) -> dict[int, int]:
        """{bird: number of frames in which it is seen}."""
        counts = np.isfinite(self.px[..., 0]).sum(0)
        return {bird: int(n) for bird, n in zip(self.ids, counts, strict=True)}

    # what a person does ---------------------------------------------------------------------

    def shift(self, k) -> np.ndarray:
        """The flock's movement from the frame before to this one, pixels."""
        ways = self.px[k] - self.px[k - 1] if k else np.zeros((0, 2))
        ways = ways[np.isfinite(ways[:, 0])]
        return np.median(ways, axis=0) if len(ways) else np.zeros(2)

    def put(self, k, bird, x, y) -> Birds:
        """Set the position of a bird in this frame; an unused number adds a bird."""
        px, ids = self.px, self.ids
        if bird not in ids:
            px, ids = np.concatenate([px, np.full((len(px), 1, 2), np.nan)], axis=1), (*ids, bird)
        else:
            px = px.copy()
        px[k, ids.index(bird)] = x, y
        return self._after(px, ids, k, {bird: (float(x), float(y), False)})

    def new(self) -> int:
        """A number that was never used for a bird."""
        corrected = (bird for rows in self.corrections.values() for bird in rows)
        return 1 + max((*self.ids, *corrected), default=0)

    def partly(self) -> dict[int, int]:
        """In how many frames those birds are that are not in all of them."""
        return {bird: n for bird, n in sorted(self.sights().items()) if n < len(self.px)}

    def swap(self, k, one, other) -> Birds:
        """Swap the numbers of two birds from this frame on."""
        px, i, j = self.px.copy(), self.ids.index(one), self.ids.index(other)
        px[k:, i], px[k:, j] = self.px[k:, j], self.px[k:, i]
        names = {one: other, other: one}
        corrections = {
            f: {names.get(bird, bird): row for bird, row in rows.items()} if f >= k else rows
            for f, rows in self.corrections.items()
        }
        swapped = replace(self, px=px, corrections=corrections)
        corrected = {bird: (*at, False) for bird, at in swapped.at(k).items() if bird in names}
        return swapped._after(px, self.ids, k, corrected)

    def lost(self, k) -> dict[int, tuple[float, float]]:
        """{bird: last position} of tracks that ended within `JOIN` frames before frame k; not of removed birds."""
        removed = {bird for rows in self.corrections.values() for bird, row in rows.items() if row[2]}
        lost = {}
        for n, bird in enumerate(self.ids):
            frames_seen = np.flatnonzero(np.isfinite(self.px[:, n, 0]))
            if 0 < k - frames_seen[-1] <= JOIN and bird not in removed:
                x, y = self.px[frames_seen[-1], n].tolist()
                lost[bird] = x, y
        return lost

    def join(self, one, other) -> Birds:
        """Join two tracks to one bird, ``one``: the track of the other begins after that of ``one`` has ended.

        Raises
        ------
        ValueError
            When both are seen in one frame, or the other is seen before.
        """
        px, i, j = self.px.copy(), self.ids.index(one), self.ids.index(other)
        has_place = np.isfinite(px[:, j, 0])
        begin = int(has_place.argmax())
        if np.isfinite(px[begin:, i, 0]).any():
            raise ValueError(f"bird {one} and bird {other} are both seen in frame {begin} or later")
        px[has_place, i] = px[has_place, j]
        px[:, j] = np.nan
        corrections = {
            f: {one if bird == other else bird: row for bird, row in rows.items()}
            for f, rows in self.corrections.items()
        }
        at = px[begin, i].tolist()
        return replace(self, corrections=corrections)._after(px, self.ids, begin, {one: (at[0], at[1], False)})

    def remove(self, k, bird) -> Birds:
        """Remove a bird from this frame on; entirely if this frame is before its first sighting."""
        px, n = self.px.copy(), self.ids.index(bird)
        frames_seen = np.flatnonzero(np.isfinite(px[:, n, 0]))
        ahead = frames_seen[frames_seen >= k]
        if not len(ahead):
            return self
        at = px[ahead[0], n].tolist()
        px[k:, n] = np.nan
        corrections = {
            f: {b: row for b, row in rows.items() if b != bird or f < k} for f, rows in self.corrections.items()
        }
        rest = replace(self, corrections={f: rows for f, rows in corrections.items() if rows})
        after = rest._after(px, self.ids, int(ahead[0]), {bird: (at[0], at[1], True)})
        return replace(after, pending=self.pending)  # the others need not be tracked again

    def _after(self, px, ids, k, rows) -> Birds:
        """The birds with the corrections of a frame."""
        corrections = dict(self.corrections)
        if rows:
            corrections[k] = dict(sorted((corrections.get(k, {}) | rows).items()))
        return Birds._seen(px, ids, corrections, k if self.pending is None else min(k, self.pending))

    @classmethod
    def _seen(cls, px, ids, corrections, pending) -> Birds:
        """Birds, those without any position left out."""
        present = np.isfinite(px[..., 0]).any(0)
        return cls(px[:, present], tuple(np.array(ids, int)[present].tolist()), corrections, pending)

    # following on -----------------------------------------------------------------------------

    def by_hand(self) -> dict[int, list[tuple]]:
        """The corrections as `Tracker` takes them."""
        return {
            f: [(bird, x, y, True) if removed else (bird, x, y) for bird, (x, y, removed) in rows.items()]
            for f, rows in sorted(self.corrections.items())
        }

    def lead(self, k) -> int:
        """The first frame whose positions a tracker needs to continue at frame k."""
        removals = [f for f, rows in self.corrections.items() if f < k and any(row[2] for row in rows.values())]
        return max(0, min([k - JOIN, *(f - 1 for f in removals)]))

    def tracker(self, k) -> tuple[Tracker, int]:
        """(a tracker initialised with the positions before frame k and all corrections, its first frame)."""
        first = self.lead(k)
        seeds = {f: [(bird, *at) for bird, at in self.at(f).items()] for f in range(first, k)}
        corrections = {f: rows for f, rows in self.by_hand().items() if f >= first}
        seeds = {  # corrections of a frame take precedence over detections
            f: [row for row in rows if row[0] not in {other[0] for other in corrections.get(f, ())}]
            for f, rows in seeds.items()
        }
        return Tracker(seeds, corrections, first=first, fresh=self.new()), first

    def with_tracks(self, k, tracks: Tracks | None, until=None) -> Birds:
        """The same birds before frame k and from frame ``until`` on, and the birds of the tracks in between."""
        frames = len(self.px)
        until = frames if until is None else until
        fresh = Birds.none(frames) if tracks is None else Birds.of(tracks, frames)
        corrected = {bird for f, rows in self.corrections.items() if f >= k for bird in rows}
        ids = tuple(sorted({*self.ids, *fresh.ids, *corrected}))
        px = np.full((frames, len(ids), 2), np.nan)
        for old, span in ((self, slice(0, k)), (fresh, slice(k, until)), (self, slice(until, frames))):
            for n, bird in enumerate(old.ids):
                px[span, ids.index(bird)] = old.px[span, n]
        for f, rows in self.corrections.items():
            for bird, (x, y, removed) in rows.items() if k <= f < frames else ():  # who was lost keeps its correction
                place = px[f, ids.index(bird)]
                if not removed and np.isnan(place[0]):
                    place[:] = x, y
        pending = None if self.pending is None or self.pending >= k else self.pending
        return Birds._seen(px, ids, self.corrections, pending)

    # files ------------------------------------------------------------------------------------

    def tracks(self) -> Tracks:
        """The birds as tracks, from the first frame that has a bird."""
        rows = np.flatnonzero(np.isfinite(self.px[..., 0]).any(1))
        low, high = (int(rows[0]), int(rows[-1]) + 1) if len(rows) else (0, 0)
        return Tracks(self.px[low:high], np.array(self.ids, int), low)

    def corrections_text(self) -> str:
        """The corrections as `flockbrush track --correct` reads them."""
        lines = ["frame,id,x,y,gone"]
        for f, rows in sorted(self.corrections.items()):
            lines += [f"{f},{bird},{x:.2f},{y:.2f},{int(removed)}" for bird, (x, y, removed) in rows.items()]
        return "\n".join(lines) + "\n"

    def with_corrections(self, rows) -> Birds:
        """The birds with corrections that were read from a file, {frame: [(id, x, y[, gone])]}."""
        corrections = {
            f: {int(bird): (float(x), float(y), bool(removed and removed[0])) for bird, x, y, *removed in frame}
            for f, frame in rows.items()
        }
        return replace(self, corrections=corrections)


class Follower:
    """Tracks the birds of a film; the patches of recent frames are cached.

    Parameters
    ----------
    film : Film
        No other reader may use it.
    """

    def __init__(self, film):
        self.film = film
        self._blobs: dict[int, list] = {}

    def follow(self, birds: Birds, k, say=lambda share: None) -> Birds:
        """The birds, tracked again from frame k with all corrections; positions before k stay unchanged.

        Parameters
        ----------
        say : callable, optional
            Called with the share that is done; an exception it raises stops the tracking.
        """
        tracker, first, until = self.tracker(birds, k)
        for f in range(first, until):
            tracker.take(self.blobs(f))
            say((f + 1 - first) / (until - first))
        try:
            tracks = tracker.tracks()
        except ValueError:
            tracks = None
        return birds.with_tracks(k, tracks, until)

    def tracker(self, birds: Birds, k):
        """A tracker for frame k and those after it, its first frame, and the frame before which it ends."""
        return *birds.tracker(k), len(self.film)

    def blobs(self, f):
        """The patches of a frame."""
        if f not in self._blobs:
            while len(self._blobs) >= BLOBS:
                self._blobs.pop(next(iter(self._blobs)))
            self._blobs[f] = [] if f in self.film.lost else blobs_of(self.film.frame(f))
        return self._blobs[f]


class PictureFollower(Follower):
    """Follows the birds of pictures, in which they were found before, up to the next one that a person has corrected.

    Parameters
    ----------
    film : PictureFilm
    """

    def tracker(self, birds: Birds, k):
        first, film = max(0, k - 1), self.film
        until = min((f for f in birds.corrections if f >= k), default=len(film))
        seeds = {f: [(bird, *at) for bird, at in birds.at(f).items()] for f in range(first, k)}
        fresh = birds.new() if birds.ids else 0
        tracker = PictureTracker(film.wingspan, seeds, birds.corrections, first, fresh, birds.at, film.size)
        return tracker, first, until

    def blobs(self, f):
        return self.film.found[f]

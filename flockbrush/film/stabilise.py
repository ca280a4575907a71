"""Stabilise a moving camera: for each picture, the map from its pixels to those of the first picture (eq. 1).

A map is a (2, 3) similarity: shift, rotation and zoom. Without landmarks the ground itself is tracked: corners of a key
picture are found in every picture that shows most of the same ground, so that errors add up only from one key picture
to the next, and a camera that returns finds the old key picture. With landmarks, rectangles drawn by the user are
tracked (CSRT) forwards and backwards from their frames, and the maps are smoothed over nine frames as in the paper.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import cv2
import numpy as np

from flockbrush.film.camera_maps import LOST, Steady, after, back, fitted, joined_tracks, moved_by, scaled_maps, zoom_of
from flockbrush.film.clip_reader import Clip, Say, silent
from flockbrush.film.landmarks import csrt, least_side
from flockbrush.film.observations import CannotObserve

SIDE = 640  # px, the longer side of the pictures in which corners are followed
BUCKETS = 8, 6  # across, down: corners are taken from all of the picture, not from the herd alone
IN_BUCKET = 8
LEAST = 12  # corners that must agree on how the camera moved
FEW, SCARCE = 0.6, 0.2  # share of corners that agree, below which the picture before is tried, too; and descriptors
BETTER = 1.5  # times as many must agree for it to be taken: errors add up from key picture to key picture
NEAR, FIRM = 1.2, 0.3  # px at SIDE, within which a corner agrees; and at which it counts half
SHARED, ZOOMED, TURNED = 0.6, 1.25, 0.25  # of a key picture's corners in view; ratio; rad: beyond, another key picture
EVEN = 31  # px at SIDE, over which light and contrast are made even
SHOT = 8  # frames from which something can be learned
ALIKE = 0.4  # correlation of what is in a rectangle with what was in it at first, below which it is lost
_CRITERIA = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 20, 0.02)
_LK = dict(winSize=(15, 15), maxLevel=3, criteria=_CRITERIA, minEigThreshold=1e-4)


# by the ground ---------------------------------------------------------------------------


@dataclass
class _Key:
    """A key picture: other pictures are compared with its corners."""

    grey: np.ndarray
    corners: np.ndarray  # (n, 2) px
    to_first: np.ndarray  # (2, 3)


def register(clip: Clip, animals=None, say: Say = silent) -> Steady:
    """The maps of a clip, from the ground that it shows.

    Parameters
    ----------
    clip : Clip
    animals : callable, optional
        ``animals(k, picture)`` returns an (h, w) bool mask in which no corners are taken.
    say : callable, optional
        Called with a text, the pictures done and their number.

    Raises
    ------
    CannotObserve
        When the ground of a picture cannot be found in those before.
    """
    scale = min(1.0, SIDE / max(clip.size))
    follower = GroundFollower(animals, scale)
    for k, picture in clip.read():
        if not follower.step(k, picture):
            a, b = int(clip.numbers[k - 1]), int(clip.numbers[k])
            raise CannotObserve(
                clip.name,
                f"the ground of frame {a} cannot be found in frame {b}: a cut, or too fast a camera motion; "
                f"try {_around(clip, k)}landmarks: --landmark FRAME:x,y,w,h",
                {"frame": b, "pictures": {f"frame {b}": picture}},
            )  # fmt: skip
        say("tracking the ground", k + 1, len(clip))
    return follower.steady()


def _around(clip, k):
    """The frames before and after the k-th picture as --frames options, where there are at least `SHOT` of them."""
    n = clip.numbers
    parts = [f"--frames {n[a]}:{n[b - 1]}, or " for a, b in ((0, k), (k, len(n))) if b - a >= SHOT]
    return "".join(parts)


class GroundFollower:
    """Tracks the ground from picture to picture; keeps the key pictures and the maps found so far."""

    def __init__(self, animals, scale):
        self.animals, self.scale = animals, scale
        self.keys: list[_Key] = []
        self.key: _Key | None = None
        self.maps: list[np.ndarray] = []
        self.bare = False

    def step(self, k, picture) -> bool:
        """Add the next picture; False when its ground cannot be found."""
        grey = _grey(picture, self.scale)
        if not self.maps:
            self.maps.append(np.eye(2, 3))
            self.last = self._new_key(k, picture, grey, self.maps[0])
            self.bare = len(self.last.corners) < 2 * LEAST
            return True
        if self.bare:
            self.maps.append(np.eye(2, 3))
            return True
        to_first = self._found(grey)
        if to_first is None:
            return False
        self.maps.append(to_first)
        self.last = _Key(grey, np.empty((0, 2)), to_first)
        self._choose_key(k, picture, grey)
        return True

    def _found(self, grey):
        """The map of this picture to the first, or None.

        If few corners of the key picture agree, the picture before is tried too, and becomes a key picture if it fits
        better.
        """
        m, agree = self._against(self.key, grey)
        if agree < FEW and self.last.to_first is not self.key.to_first:
            last = _Key(self.last.grey, _corners(self.last.grey), self.last.to_first)
            again, better = self._against(last, grey)
            if better > BETTER * agree:
                self.keys.append(last)
                self.key, m = last, again
        return m

    def _against(self, key, grey):
        """Match a picture with one key picture.

        Returns
        -------
        (2, 3) ndarray or None
            Map of the picture to the first.
        float
            Share of the corners that agree, 0 to 1.
        """
        guess = after(back(key.to_first), self.maps[-1])  # this picture to the key, if the camera stood since
        best, most = None, 0.0
        for attempt in (lambda: guess, lambda: _by_descriptors(grey, key.grey)):
            seen = attempt()
            if seen is None:
                break
            for _ in range(2):
                m, agree = _refined(key, grey, seen)
                if m is None:
                    break
                step = np.abs(moved_by(m, _frame(grey)) - moved_by(seen, _frame(grey))).max()
                seen = m
                if step < 2.0:
                    break
            if m is not None and agree > most:
                best, most = after(key.to_first, m), agree
            if most >= SCARCE:
                break
        return best, most

    def _choose_key(self, k, picture, grey):
        """Keep the key picture, return to an older one, or make this picture a key picture."""
        if self._fit(self.key, self.maps[-1], grey) > 0:
            return
        others = [(self._fit(key, self.maps[-1], grey), i) for i, key in enumerate(self.keys)]
        best, i = max(others)
        if best > 0.15:
            self.key = self.keys[i]
        else:
            self._new_key(k, picture, grey, self.maps[-1])

    @staticmethod
    def _fit(key, to_first, grey):
        """Margin by which a key picture still fits: by shared corners, zoom and rotation; above 0 it is kept."""
        to_here = after(back(to_first), key.to_first)
        x, y = moved_by(to_here, key.corners).T
        h, w = grey.shape
        shared = ((x > 8) & (x < w - 8) & (y > 8) & (y < h - 8)).mean() if len(x) else 0.0
        zoom, turn = abs(np.log(zoom_of(to_here))), abs(np.arctan2(to_here[1, 0], to_here[0, 0]))
        return min(shared - SHARED, 1 - zoom / np.log(ZOOMED), 1 - turn / TURNED)

    def _new_key(self, k, picture, grey, to_first) -> _Key:
        """Make this picture the key picture, if it has enough corners; returns the key picture."""
        away = self.animals(k, picture) if self.animals is not None else None
        corners = _corners(grey, away)
        if len(corners) >= 2 * LEAST or self.key is None:
            self.key = _Key(grey, corners, to_first)
            self.keys.append(self.key)
        return self.key

    def steady(self) -> Steady:
        """The maps of all pictures, scaled to the size of the clip, with notes."""
        notes = []
        if self.bare:
            notes.append(
                "the ground has too little texture to measure the motion of the camera, which is assumed to stand still"
            )
        maps = scaled_maps(self.maps, 1 / self.scale)
        size = np.array(self.keys[-1].grey.shape[::-1]) / self.scale
        corners = np.array([(0, 0), (size[0], 0), (0, size[1]), size])
        drift = max((np.abs(moved_by(m, corners) - corners).max() for m in maps), default=0.0)
        return Steady(maps, bool(drift > 1.0), notes)


def _frame(grey):
    """The four corners of a picture, px."""
    h, w = grey.shape
    return np.array([(0, 0), (w, 0), (0, h), (w, h)], float)


def _grey(picture, scale):
    """The picture in grey, reduced by `scale`, with local brightness and contrast made even."""
    grey = cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY)
    if scale != 1:
        grey = cv2.resize(grey, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    away = grey.astype(np.float32) - cv2.blur(grey, (EVEN, EVEN)).astype(np.float32)
    contrast = cv2.sqrt(cv2.blur(away * away, (EVEN, EVEN)))
    return cv2.convertScaleAbs(away * (32.0 / (contrast + 4.0)) + 128.0)


def _corners(grey, away=None):
    """Good corners to track, (n, 2) px, at most `IN_BUCKET` in each of 8 x 6 parts of the picture."""
    free = None
    if away is not None:
        wide = cv2.dilate(away.astype(np.uint8), np.ones((9, 9), np.uint8))
        free = 255 * (1 - cv2.resize(wide, grey.shape[::-1], interpolation=cv2.INTER_NEAREST))
    corners = cv2.goodFeaturesToTrack(grey, 2000, 0.002, 7, mask=free)
    if corners is None:
        return np.empty((0, 2))
    points = corners.reshape(-1, 2)  # the best first
    bucket = _bucket(points, grey.shape)
    order = np.argsort(bucket, kind="stable")
    begins = np.r_[0, np.flatnonzero(np.diff(bucket[order])) + 1]
    rank = np.empty(len(points), int)
    rank[order] = np.arange(len(points)) - np.repeat(begins, np.diff(np.r_[begins, len(points)]))
    return points[rank < IN_BUCKET].astype(float)


def _bucket(points, shape):
    column = np.clip(points[:, 0] * BUCKETS[0] / shape[1], 0, BUCKETS[0] - 1).astype(int)
    row = np.clip(points[:, 1] * BUCKETS[1] / shape[0], 0, BUCKETS[1] - 1).astype(int)
    return row * BUCKETS[0] + column


def _refined(key, grey, to_key):
    """Refine the map of a picture to a key picture by optical flow of its corners.

    Returns the map and the share of the corners that agree; None if fewer than `LEAST` do.
    """
    h, w = key.grey.shape
    there = cv2.warpAffine(grey, to_key, (w, h), flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    inside = _within(moved_by(back(to_key), key.corners), grey.shape, 4)
    if inside.sum() < LEAST:
        return None, 0.0
    corners = key.corners[inside].astype(np.float32).reshape(-1, 1, 2)
    seen, fine, _ = cv2.calcOpticalFlowPyrLK(key.grey, there, corners, None, **_LK)
    fine = fine.ravel().astype(bool) & np.isfinite(seen).all((1, 2))
    at, seen = corners[fine, 0].astype(float), seen[fine, 0].astype(float)
    if len(at) < LEAST:
        return None, 0.0
    step, agree = _consensus(seen, at, key.grey.shape)
    return (None, 0.0) if step is None else (after(step, to_key), float(agree.mean()))


def _within(points, shape, margin):
    x, y = points.T
    return (x >= margin) & (y >= margin) & (x < shape[1] - margin) & (y < shape[0] - margin)


def _consensus(seen, at, shape):
    """The similarity from `seen` to `at`, (n, 2) px each, on which corners of most of the picture agree.

    RANSAC is run twice, the second time on the corners that disagree: of both maps the one whose corners cover more of
    the picture is the ground, the other the herd. Returns the map and who agrees (n,), or None and None.
    """
    best, chosen, wide = None, None, 0
    rest = np.ones(len(at), bool)
    for _ in range(2):
        if rest.sum() < LEAST:
            break
        m, fine = cv2.estimateAffinePartial2D(
            seen[rest], at[rest], method=cv2.RANSAC, ransacReprojThreshold=NEAR, maxIters=500, confidence=0.995
        )
        if m is None or fine.sum() < LEAST:
            break
        agree = np.zeros(len(at), bool)
        agree[np.flatnonzero(rest)[fine.ravel().astype(bool)]] = True
        covers = len(np.unique(_bucket(at[agree], shape)))
        if covers > wide:
            best, chosen, wide = m, agree, covers
        if agree.mean() > 0.7:
            break
        rest &= ~agree
    if best is None or not 0.5 < zoom_of(best) < 2.0:
        return None, None
    return _firm(seen[chosen], at[chosen]), chosen


def _firm(a, b):
    """Similarity of points a to b, (n, 2) px each, by iteratively reweighted least squares."""
    m = fitted(a, b)
    for _ in range(5):
        away = np.linalg.norm(moved_by(m, a) - b, axis=1)
        m = fitted(a, b, 1.0 / (1.0 + (away / FIRM) ** 2))
    return m


def _by_descriptors(grey, other):
    """The map of a picture to another from SIFT features, for large motion; None if fewer than `LEAST` agree."""
    sift = cv2.SIFT_create(1500, contrastThreshold=0.02)
    (pa, da), (pb, db) = sift.detectAndCompute(grey, None), sift.detectAndCompute(other, None)
    if da is None or db is None or min(len(da), len(db)) < LEAST:
        return None
    near = cv2.BFMatcher(cv2.NORM_L2).knnMatch(da, db, k=2)
    pairs = [pair[0] for pair in near if len(pair) == 2 and pair[0].distance < 0.8 * pair[1].distance]
    if len(pairs) < LEAST:
        return None
    a = np.array([pa[m.queryIdx].pt for m in pairs])
    b = np.array([pb[m.trainIdx].pt for m in pairs])
    similarity, fine = cv2.estimateAffinePartial2D(a, b, method=cv2.RANSAC, ransacReprojThreshold=3.0, maxIters=2000)
    return similarity if similarity is not None and fine.sum() >= LEAST else None


# by landmarks ----------------------------------------------------------------------------


def follow_landmarks(clip: Clip, landmarks, say: Say = silent) -> Steady:
    """The maps of a clip from rectangles on the ground, smoothed over nine frames.

    Parameters
    ----------
    clip : Clip
    landmarks : list of Landmark
        Two places far apart give rotation and zoom best. The same place in two frames, or a single one, works too.
    say : callable, optional
        Called with a text, the steps done and their number.

    Raises
    ------
    CannotObserve
        When a rectangle is outside the picture or has no corners, or when all are lost.
    """
    pictures = [_grey_and_colour(picture) for _, picture in clip.read()]
    begin = [_placed(clip, mark, pictures[0][0].shape) for mark in landmarks]
    done = [0] * len(landmarks)

    def track(i):
        def report(count):
            done[i] = count
            say("tracking the landmarks", sum(done), len(pictures) * len(landmarks))

        return _Track(clip, pictures, *begin[i], landmarks[i], report).followed()

    with ThreadPoolExecutor(2) as pool:
        tracks = list(pool.map(track, range(len(landmarks))))
    return joined_tracks(clip, tracks)


def _grey_and_colour(picture):
    return cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY), picture


def _placed(clip, mark, shape):
    """Row of the picture with a landmark, and its rectangle (x, y, w, h) in pixels of the pictures read."""
    rows = np.flatnonzero(clip.numbers == mark.frame)
    if not len(rows):
        raise CannotObserve(
            clip.name,
            f"the landmark of frame {mark.frame} is in a frame that is not used; used frames: {clip.numbers[0]} to "
            f"{clip.numbers[-1]}",
        )
    x, y, w, h = (value * clip.scale for value in (mark.x, mark.y, mark.w, mark.h))
    least = least_side(clip.full)
    if min(mark.w, mark.h) < least or x < 0 or y < 0 or x + w > shape[1] or y + h > shape[0]:
        raise CannotObserve(
            clip.name,
            f"the landmark {mark.frame}:{mark.x:g},{mark.y:g},{mark.w:g},{mark.h:g} must be a rectangle left,top,width,"
            f"height of at least {least} pixels inside the picture of {clip.full[0]} x {clip.full[1]}",
        )
    return int(rows[0]), (round(x), round(y), round(w), round(h))


class _Track:
    """Tracks one landmark through all pictures."""

    def __init__(self, clip, pictures, row, rect, mark, report):
        self.clip, self.pictures, self.row, self.rect, self.mark, self.report = clip, pictures, row, rect, mark, report
        x, y, w, h = rect
        grey = pictures[row][0]
        patch = grey[y : y + h, x : x + w]
        corners = cv2.goodFeaturesToTrack(patch, 80, 0.01, 4)
        if corners is None or len(corners) < 4:
            raise CannotObserve(
                clip.name,
                f"the landmark of frame {mark.frame} has no corners to track; draw it around something with corners "
                "that does not move, such as a rock or a bush",
                {"pictures": {f"frame {mark.frame}": pictures[row][1]}},
            )
        self.points = corners.reshape(-1, 2).astype(float) + (x, y)
        self.maps = np.full((len(pictures), 2, 3), np.nan)  # from the landmark's own picture to each
        self.maps[row] = np.eye(2, 3)
        self.lost: list[int] = []

    def followed(self):
        """Fill the maps forwards and backwards from the frame of the landmark; returns self."""
        self.count = 1
        for rows in (range(self.row + 1, len(self.pictures)), range(self.row - 1, -1, -1)):
            self._go(rows)
        return self

    def _go(self, rows):
        tracker = csrt()
        tracker.init(self.pictures[self.row][1], self.rect)
        guess, misses = np.eye(2, 3), 0
        for k in rows:
            fine, box = tracker.update(self.pictures[k][1])
            m, alike = self._held(k, guess, box if fine else None)
            misses = 0 if m is not None else misses + 1
            if misses >= LOST:
                self.lost.append(k)
                return
            if m is not None:
                guess = m
                self.maps[k] = m
            self.count += 1
            self.report(self.count)

    def _held(self, k, guess, box):
        """Find the landmark in picture k, from its last map and from the box of CSRT.

        Returns the map to picture k and the correlation with the first view; None and 0 where it is not found.
        """
        grey = self.pictures[k][0]
        tries = [guess] if box is None else [_to_box(guess, self.rect, box), guess]
        for seen in tries:
            m = self._refined(grey, seen)
            if m is not None:
                alike = self._alike(grey, m)
                if alike > ALIKE:
                    return m, alike
        if box is not None and self._alike(grey, tries[0]) > ALIKE:
            return tries[0], ALIKE
        return None, 0.0

    def _refined(self, grey, seen):
        """The map refined by optical flow of the corners in the rectangle; None when too few agree."""
        own = self.pictures[self.row][0]
        x, y, w, h = self.rect
        margin = 24
        left, top = max(0, x - margin), max(0, y - margin)
        size = min(own.shape[1], x + w + margin) - left, min(own.shape[0], y + h + margin) - top
        cut = np.array([[1.0, 0, left], [0, 1.0, top]])
        to_here = after(seen, cut)
        there = cv2.warpAffine(grey, to_here, size, flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
                               borderMode=cv2.BORDER_REPLICATE)  # fmt: skip
        at = (self.points - (left, top)).astype(np.float32).reshape(-1, 1, 2)
        patch = own[top : top + size[1], left : left + size[0]]
        now, fine, _ = cv2.calcOpticalFlowPyrLK(patch, there, at, None, **(_LK | {"winSize": (11, 11), "maxLevel": 2}))
        fine = fine.ravel().astype(bool)
        if fine.sum() < 4:
            return None
        a, b = at[fine, 0].astype(float), now[fine, 0].astype(float)
        m, agree = cv2.estimateAffinePartial2D(a, b, method=cv2.RANSAC, ransacReprojThreshold=NEAR)
        if m is None or agree.sum() < max(4, 0.3 * len(at)) or not 0.7 < zoom_of(m) < 1.4:
            return None
        return after(to_here, after(m, back(cut)))

    def _alike(self, grey, m):
        """Correlation of the content of the rectangle with that of picture k under a map, -1 to 1."""
        x, y, w, h = self.rect
        corners = moved_by(m, [(x, y), (x + w, y), (x, y + h), (x + w, y + h)])
        if not _within(corners, grey.shape, -2).all():
            return -1.0
        own = self.pictures[self.row][0][y : y + h, x : x + w].astype(np.float32)
        flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        now = cv2.warpAffine(grey, after(m, np.array([[1.0, 0, x], [0, 1.0, y]])), (w, h), flags=flags)
        a, b = own - own.mean(), now - now.mean()
        return float((a * b).sum() / max(np.sqrt((a * a).sum() * (b * b).sum()), 1e-6))


def _to_box(guess, rect, box):
    """The map, shifted so that the middle of the rectangle is at the middle of the box found by CSRT."""
    x, y, w, h = rect
    middle = np.array([x + w / 2, y + h / 2])
    now = np.array([box[0] + box[2] / 2, box[1] + box[3] / 2])
    shifted = guess.copy()
    shifted[:, 2] = now - shifted[:, :2] @ middle
    return shifted

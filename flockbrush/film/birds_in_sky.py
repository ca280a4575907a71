"""Detection of birds on a plain sky, and their identities from frame to frame.

A bird is a patch that differs from the sky around it, all of a picture darker or all lighter.  The sky is the picture
with small objects removed (a median), so clouds and gradients do not matter.  What is not a bird is left out by
size, measured against the other birds, by shape, and by being lighter where most are darker (moon, sun).
"""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
from scipy.optimize import linear_sum_assignment

from flockbrush.engine.files import refused
from flockbrush.film.bird_sizes import Patch, of_one_size, patches_of
from flockbrush.film.media import FilmReader, read_picture
from flockbrush.film.tracks import Tracks

CONTRAST = 6.0  # robust deviations of the sky: a bird differs by more
LEAST_CONTRAST = 18.0  # grey levels
WINDOWS = (1 / 6, 1 / 3, 2 / 3)  # of the picture's shorter side: the medians that are its sky
SMALL, LARGE = 0.25, 4.0  # of the usual bird's area: outside is no bird
ALIKE = 1.6  # times the usual span, or one over: about as large as most
FEW = 0.34  # share of the birds: so few that are lighter, or darker, than the sky while the others are not are no birds
PURE = 0.85  # of a patch lighter, or darker, than the sky: of one kind (a white bird with a dark head is of neither)
OPPOSITE = 0.7  # difference of those shares between a bird and other objects
TWO = 1.7  # times the usual span: two birds that touch
REACH = 2.0  # wingspans that a bird may leave the flock's movement from one picture to the next
NEAR = 0.6  # wingspans: a mark so near to a bird that was found is on it
VIDEOS = {".mp4", ".avi", ".mov", ".mkv", ".webm", ".m4v"}


def away_from_sky(image):
    """How far each pixel of a picture is from the sky around it, (h, w) uint8 grey levels, and from where it counts.

    Parameters
    ----------
    image : (h, w, 3) or (h, w) uint8
    """
    grey = _grey(image)
    away = cv2.absdiff(grey, _sky(grey, WINDOWS[0]))
    return away, _counts_from(away)


def _counts_from(away):
    """The grey-level difference above which a pixel is not sky."""
    counts = sum(np.bincount(row, minlength=256) for row in away)
    levels = np.arange(256.0)
    noise = 1.4826 * _quantile(np.abs(levels - _quantile(levels, counts, 0.5)), counts, 0.5)
    highest = 0.35 * _quantile(levels, counts, 0.9995)
    return np.float32(max(CONTRAST * noise, LEAST_CONTRAST, highest))


def _grey(image):
    return image if image.ndim == 2 else cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)


def _window(grey, share):
    return max(3, int(min(grey.shape) * share) | 1)


def _sky(grey, share):
    """The picture without small objects: medians in windows of this share of its shorter side."""
    window = _window(grey, share)
    shrink = max(1, window // 41)  # medians of large windows are slow and no better
    small = cv2.resize(grey, None, fx=1 / shrink, fy=1 / shrink, interpolation=cv2.INTER_AREA)
    sky = cv2.medianBlur(small, max(3, min(255, window // shrink | 1)))
    return cv2.resize(sky, grey.shape[::-1], interpolation=cv2.INTER_LINEAR)


def _quantile(values, counts, share):
    """The quantile of so many of each value, between neighbours in proportion."""
    order = np.argsort(values, kind="stable")
    up_to = np.cumsum(counts[order])
    place = (up_to[-1] - 1) * share
    low, high = (values[order[np.searchsorted(up_to, at, side="right")]] for at in (int(place), int(np.ceil(place))))
    return float(low + (high - low) * (place - int(place)))


def find_birds(image) -> list[Patch]:
    """Birds in a picture (h, w, 3) or (h, w), uint8, in order from left to right."""
    return find_birds_and_others(image)[0]


def find_birds_and_others(image) -> tuple[list[Patch], list[str]]:
    """As `find_birds`, and sentences about what was left out though it may be a bird.

    The sky is taken with a window of twice the usual bird or more, so that large birds do not become sky.
    """
    grey = _grey(image)
    for share in WINDOWS:
        sky = _sky(grey, share)
        birds, others, usual = _sorted_out(grey, sky)
        if 2.0 * usual <= _window(grey, share):
            break
    sentences = [_sentence(why, some, usual) for why, some in others.items()]
    if long := [f"{p.x:.0f},{p.y:.0f}" for p in birds if p.span > TWO * usual]:
        sentences.append(
            f"{len(long)} at {', '.join(long)} as long as two birds, counted as one each; they may be touching birds"
        )
    return sorted(birds, key=lambda patch: patch.x), sentences


def _sorted_out(grey, sky):
    """(birds, {why not: patches}, usual span).

    Patches that are left out do not count when the contrast threshold of birds is determined.
    """
    away, lighter = cv2.absdiff(grey, sky), grey > sky
    threshold = _counts_from(away)
    while True:
        there = away > threshold
        mask = cv2.morphologyEx(there.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8))
        birds, others, usual = _as_birds(patches_of(mask, lighter))
        rest = away.copy()
        for patch in (patch for some in others.values() for patch in some):
            low, high = patch.points.min(axis=0), patch.points.max(axis=0) + 1
            rest[low[1] : high[1], low[0] : high[0]] = 0
        less = _counts_from(rest)
        if not birds or less >= 0.8 * threshold:
            return birds, others, usual
        threshold = less


def _as_birds(patches):
    """(birds, {why not: patches}, usual span) of the patches of a picture."""
    patches, usual = of_one_size(patches)
    alike = [p.area for p in patches if p.whole and usual / ALIKE <= p.span <= usual * ALIKE]
    area = float(np.median(alike or [p.area for p in patches] or [0.0]))
    others: dict[str, list[Patch]] = {}
    birds = []
    for patch in patches:
        if patch.area > LARGE * area:
            others.setdefault("larger", []).append(patch)
        elif SMALL * area <= patch.area and patch.shaped:
            birds.append(patch)
        elif SMALL**2 * area <= patch.area and patch.shaped:
            others.setdefault("smaller", []).append(patch)
    light = float(np.median([p.pale for p in birds] or [0.0]))
    if light >= PURE or light <= 1.0 - PURE:
        kind = "darker" if light >= PURE else "lighter"
        rare = [p for p in birds if abs(p.pale - light) >= OPPOSITE]
        if rare and len(rare) <= FEW * len(birds):
            others[f"{kind} than the sky"] = rare
            birds = [p for p in birds if p not in rare]
    return birds, others, usual


def _sentence(why, patches, usual):
    """A sentence about patches that were left out: where they are, and what they may be."""
    where = ", ".join(f"{p.x:.0f},{p.y:.0f}" for p in patches[:5]) + ", ..." * (len(patches) > 5)
    were = "was" if len(patches) == 1 else "were"
    if "sky" in why:
        return f"{len(patches)} {why}, at {where}, unlike the others, {were} left out; possibly moon, sun or lamp"
    sizes = [p.span for p in patches]
    long = f"{min(sizes):.0f}" + f" to {max(sizes):.0f}" * (len(sizes) > 1)
    return (
        f"{len(patches)} {why} than a bird, at {where}, {were} left out: {long} pixels long (median bird: {usual:.0f})"
    )


def read_pictures(paths, every=1):
    """(name, picture) of images and of the frames of videos, one in ``every``.

    Raises
    ------
    ProblemsError
        When a file is neither.
    """
    names = [Path(path).name for path in paths]
    for path in map(Path, paths):
        if names.count(path.name) > 1:
            message = "another file has the same name, by which the table knows its frames; rename one"
            raise refused(path, message)
        if not path.is_file():
            raise refused(path, "there is no such file")
        if path.suffix.lower() in VIDEOS:
            yield from _frames(path, every)
            continue
        yield path.name, read_picture(path, f"the name of a clip must end in one of {', '.join(sorted(VIDEOS))}")


def _frames(path, every):
    with FilmReader(path) as film:
        for k in itertools.count():
            image = film.read() if k % every == 0 else None
            if image is None and (k % every == 0 or not film.skip()):
                break
            if image is not None:
                yield f"{path.name}:{film.number}", image
        if not k:
            raise refused(path, film.damage)


def carry(before, now, reach):
    """Which patch of this frame is which of the frame before, -1 for a new one, (len(now),).

    The flock's common movement is taken out; nobody goes farther than ``reach`` pixels within it.
    """
    match = np.full(len(now), -1)
    if not before or not now:
        return match
    a, b = (np.array([(p.x, p.y) for p in patches]) for patches in (before, now))
    shift = np.median(b, axis=0) - np.median(a, axis=0)
    for _ in range(3):
        distance = np.linalg.norm(a[:, None] + shift - b[None], axis=2)
        rows, columns = linear_sum_assignment(np.minimum(distance, 3 * reach))
        close = distance[rows, columns] <= reach
        if not close.any():
            break
        shift = np.median(b[columns[close]] - a[rows[close]], axis=0)
    match[columns[close]] = rows[close]
    return match


class Mark(NamedTuple):
    """Where a bird is in a picture."""

    x: float  # pixels
    y: float
    found: bool = True  # whether it is on a bird that was found; else it is carried on from a mark by hand
    gone: bool = False  # a person has said that this is no bird; it is followed so that it does not come back


def is_found(x, y, patches):
    """Whether a mark is exactly on one of the birds that were found, as far as files keep it."""
    return any(abs(patch.x - x) < 0.1 and abs(patch.y - y) < 0.1 for patch in patches)


class PictureTracker:
    """Follows the birds of a few pictures, as `flockbrush.film.tracking.Tracker` does those of films.

    Parameters
    ----------
    wingspan : float
        Pixels.
    seeds : dict of int to list of (id, x, y)
        Pictures whose birds are known: exactly these.
    corrected : collection of int
        Pictures of ``seeds`` that a person has corrected: whatever else was found in them is no bird.
    first : int
        Number of the first picture that it will be given.
    fresh : int
        New birds get this number and those after it.
    known : callable, optional
        The birds of a picture as they were, {id: (x, y)}: a bird that is new in it keeps its number.
    size : (float, float)
        Width and height of the pictures: who leaves them is not carried on.
    """

    def __init__(self, wingspan, seeds=None, corrected=(), first=0, fresh=0, known=lambda k: {}, size=(np.inf, np.inf)):
        self.wingspan, self.seeds, self.corrected, self.known, self.size = wingspan, seeds or {}, corrected, known, size
        self.first, self.frame, self.fresh = first, first - 1, fresh
        self.marks: list[dict[int, Mark]] = []  # of each picture
        self._no_birds = itertools.count(-1, -1)  # numbers of what is no bird

    def take(self, patches):
        """Take the birds that were found in the next picture."""
        self.frame += 1
        before = self.marks[-1] if self.marks else {}
        match = carry(list(before.values()), patches, REACH * self.wingspan)
        old = list(before.items())
        same = [(patch, *old[k]) for patch, k in zip(patches, match, strict=True) if k >= 0]
        now = {bird: Mark(patch.x, patch.y, True, was.gone) for patch, bird, was in same}
        if self.frame in self.seeds:
            now = self._as_told(now, patches)
        else:
            self._carry_on(before, now)
            self._begin(now, before, [p for p, k in zip(patches, match, strict=True) if k < 0])
        self.marks.append(now)

    def _as_told(self, now, patches):
        """The birds of a picture that a person knows, and what is followed though it is no bird."""
        places = {bird: Mark(x, y, is_found(x, y, patches)) for bird, x, y in self.seeds[self.frame]}
        no_birds = {bird: mark for bird, mark in now.items() if mark.gone and not self._on(*mark[:2], places.values())}
        if self.frame in self.corrected:
            occupied = [*places.values(), *no_birds.values()]
            rest = [p for p in patches if not self._on(p.x, p.y, occupied)]
            no_birds |= {next(self._no_birds): Mark(p.x, p.y, True, True) for p in rest}
        return places | no_birds

    def _on(self, x, y, others):
        return any(np.hypot(p.x - x, p.y - y) <= NEAR * self.wingspan for p in others)

    def _carry_on(self, before, now):
        """Carry on those that a person has marked where nothing is found."""
        ways = [(now[b].x - mark.x, now[b].y - mark.y) for b, mark in before.items() if b in now]
        shift = np.median(ways, axis=0) if ways else np.zeros(2)
        for bird, mark in before.items():
            x, y = mark.x + shift[0], mark.y + shift[1]
            if bird not in now and not mark.found and 0 <= x < self.size[0] and 0 <= y < self.size[1]:
                now[bird] = Mark(x, y, False, mark.gone)

    def _begin(self, now, before, patches):
        """Number those that are new; who was seen at this very place before keeps its number."""
        known = {place: bird for bird, place in self.known(self.frame).items()}
        for patch in patches:
            bird = known.get((patch.x, patch.y))
            if bird is None or bird in now or bird in before:
                bird, self.fresh = self.fresh, self.fresh + 1
            now[bird] = Mark(patch.x, patch.y)

    def tracks(self) -> Tracks:
        """The tracks so far; ValueError when there are none."""
        numbers = sorted({bird for marks in self.marks for bird, mark in marks.items() if not mark.gone})
        if not numbers:
            raise ValueError("no bird was found")
        px = np.full((len(self.marks), len(numbers), 2), np.nan)
        for row, marks in zip(px, self.marks, strict=True):
            for n, bird in enumerate(numbers):
                if bird in marks and not marks[bird].gone:
                    row[n] = marks[bird][:2]
        return Tracks(px, np.array(numbers), self.first)


def mark(paths, every=1):
    """Marks of every bird that is found in every picture.

    Returns
    -------
    list of (str, int, Patch)
        Frame, bird and where it is.
    float
        The median of the patches' longest extents, pixels: a wingspan, if they are seen from below with wings spread.
    list of str
        Sentences about birds that are not in all frames, and about what may be no bird.

    Raises
    ------
    ProblemsError
        When there are no birds.
    """
    looked = [(name, *find_birds_and_others(image)) for name, image in read_pictures(paths, every)]
    frames = [(name, patches) for name, patches, _ in looked]
    doubts = [f"{name}: {line}" for name, _, lines in looked for line in lines]
    if not any(patches for _, patches in frames):
        raise refused(next(iter(paths)), "no birds were detected on a plain sky")
    span = float(np.median([patch.span for _, patches in frames for patch in patches]))
    tracker = PictureTracker(span)
    tracks: dict[int, list[tuple[str, Patch]]] = {}
    for frame, patches in frames:
        tracker.take(patches)
        places = {(patch.x, patch.y): patch for patch in patches}
        for bird, at in tracker.marks[-1].items():
            tracks.setdefault(bird, []).append((frame, places[at.x, at.y]))
    whole = {bird: sights for bird, sights in tracks.items() if len(sights) == len(frames)}
    lost = [
        f"bird {bird} is in {len(sights)} of {len(frames)} frames, from {sights[0][0]}, and was left out"
        for bird, sights in tracks.items()
        if bird not in whole
    ]
    if not whole:
        raise refused(next(iter(paths)), "no bird could be tracked through all frames")
    rows = [(frame, bird, patch) for bird, sights in whole.items() for frame, patch in sights]
    place = {frame: k for k, (frame, _) in enumerate(frames)}
    return sorted(rows, key=lambda row: (place[row[0]], row[1])), span, lost + doubts

"""Birds on a plain sky, found in pictures and carried from frame to frame.

A bird is a small patch that differs from the sky around it, all of a picture darker or all lighter.  The sky is the
picture with everything small taken out (a median), so clouds and gradients do not matter.  What is not a bird is left
out by size, measured against the other patches, by shape, and by being lighter where most are darker (moon, sun).
"""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
from scipy.optimize import linear_sum_assignment

from flockbrush.engine.problems import Problem, ProblemsError
from flockbrush.film.media import FilmReader, read_picture

CONTRAST = 6.0  # robust deviations of the sky: a bird differs by more
LEAST_CONTRAST = 18.0  # grey levels
SMALL, LARGE = 0.25, 4.0  # of the median patch: outside is no bird
SOLID = 0.3  # part of its convex hull that a bird fills
FEW = (
    0.34  # share of the patches: so few that are lighter, or darker, than the sky while the others are not are no birds
)
THIN = 12.0  # longer than this for its width: a wire, a twig
VIDEOS = {".mp4", ".avi", ".mov", ".mkv", ".webm", ".m4v"}


class Patch(NamedTuple):
    """Something that looks like a bird."""

    x: float  # pixels
    y: float
    area: float  # pixels
    span: float  # pixels, its longest extent


def away_from_sky(image):
    """How far each pixel of a picture is from the sky around it, (h, w) uint8 grey levels, and from where it counts.

    Parameters
    ----------
    image : (h, w, 3) or (h, w) uint8
    """
    grey, sky = _grey_and_sky(image)
    away = cv2.absdiff(grey, sky)
    counts = sum(np.bincount(row, minlength=256) for row in away)
    levels = np.arange(256.0)
    noise = 1.4826 * _quantile(np.abs(levels - _quantile(levels, counts, 0.5)), counts, 0.5)
    highest = 0.35 * _quantile(levels, counts, 0.9995)
    return away, np.float32(max(CONTRAST * noise, LEAST_CONTRAST, highest))


def _grey_and_sky(image):
    """The picture in grey levels, and without everything small."""
    grey = image if image.ndim == 2 else cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
    window = max(3, min(grey.shape) // 6 | 1)
    shrink = max(1, window // 41)  # medians of large windows are slow and no better
    small = cv2.resize(grey, None, fx=1 / shrink, fy=1 / shrink, interpolation=cv2.INTER_AREA)
    sky = cv2.medianBlur(small, max(3, min(255, window // shrink | 1)))
    return grey, cv2.resize(sky, grey.shape[::-1], interpolation=cv2.INTER_LINEAR)


def _quantile(values, counts, share):
    """The quantile of so many of each value, between neighbours in proportion."""
    order = np.argsort(values, kind="stable")
    up_to = np.cumsum(counts[order])
    place = (up_to[-1] - 1) * share
    low, high = (values[order[np.searchsorted(up_to, at, side="right")]] for at in (int(place), int(np.ceil(place))))
    return float(low + (high - low) * (place - int(place)))


def find_birds(image) -> list[Patch]:
    """Birds in a picture (h, w, 3) or (h, w), uint8, in order from left to right.

    A bird must be small: at most a twelfth of the picture's shorter side.
    """
    return find_birds_and_others(image)[0]


def find_birds_and_others(image) -> tuple[list[Patch], list[str]]:
    """As `find_birds`, and sentences about what was left out though it may be a bird."""
    away, threshold = away_from_sky(image)
    mask = cv2.morphologyEx((away > threshold).astype(np.uint8), cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8))
    grey, sky = _grey_and_sky(image)
    lighter = (grey > sky) & (away > threshold)
    patches = sorted(_birds(mask, min(mask.shape) / 12), key=lambda patch: patch.x)
    pale = [_is_pale(lighter, away > threshold, patch) for patch in patches]
    rare = sum(pale) <= len(pale) / 2  # whether lighter ones are the fewer
    others = [patch for patch, light in zip(patches, pale, strict=True) if light == rare]
    if not others or len(others) > FEW * len(patches):
        return patches, []
    kind, usual = ("lighter", "darker") if rare else ("darker", "lighter")
    where = ", ".join(f"{patch.x:.0f},{patch.y:.0f}" for patch in others[:5])
    said = (
        f"{len(others)} {kind} than the sky, at {where}, while the others are {usual}, was left out: moon, sun, lamp?"
    )
    return [patch for patch in patches if patch not in others], [said]


def _is_pale(lighter, there, patch):
    """Whether most of what differs from the sky around the middle of a patch is lighter."""
    r = int(np.ceil(0.5 * patch.span)) + 1
    box = np.s_[max(0, int(patch.y) - r) : int(patch.y) + r + 1, max(0, int(patch.x) - r) : int(patch.x) + r + 1]
    return bool(lighter[box].sum() > 0.5 * there[box].sum())


def _birds(mask, most):
    count, labels, stats, centres = cv2.connectedComponentsWithStats(mask, connectivity=8)
    patches = []
    for k in range(1, count):
        left, top, wide, tall, area = stats[k]
        if area < 6 or max(wide, tall) > 2 * most:
            continue
        shape = (labels[top : top + tall, left : left + wide] == k).astype(np.uint8)
        points = cv2.findNonZero(shape)
        hull = cv2.contourArea(cv2.convexHull(points)) + 1.0
        sides = sorted(side + 1.0 for side in cv2.minAreaRect(points)[1])
        if area / max(hull, area) >= SOLID and sides[1] / sides[0] <= THIN:
            patches.append(Patch(float(centres[k][0]), float(centres[k][1]), float(area), sides[1]))
    if not patches:
        return []
    usual = float(np.median([patch.area for patch in patches if patch.area > 0.1 * max(p.area for p in patches)]))
    return [patch for patch in patches if SMALL * usual <= patch.area <= LARGE * usual]


def read_pictures(paths, every=1):
    """(name, picture) of images and of the frames of videos, one in ``every``.

    Raises
    ------
    ProblemsError
        When a file is neither.
    """
    for path in map(Path, paths):
        if not path.is_file():
            raise ProblemsError([Problem(str(path), None, None, "there is no such file")])
        if path.suffix.lower() in VIDEOS:
            yield from _frames(path, every)
            continue
        yield path.name, read_picture(path, f"the names of films end in {', '.join(sorted(VIDEOS))}")


def _frames(path, every):
    with FilmReader(path) as film:
        for k in itertools.count():
            image = film.read() if k % every == 0 else None
            if image is None and (k % every == 0 or not film.skip()):
                break
            if image is not None:
                yield f"{path.name}:{k}", image
        if not k:
            raise ProblemsError([Problem(str(path), None, None, "is a video without a frame that can be read")])


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
    doubts = [f"{name}: {line}" for name, _, said in looked for line in said]
    if not any(patches for _, patches in frames):
        raise ProblemsError([Problem(str(next(iter(paths))), None, None, "no birds were found on a plain sky")])
    span = float(np.median([patch.span for _, patches in frames for patch in patches]))
    tracks: dict[int, list[tuple[str, Patch]]] = {}
    before: list[Patch] = []
    names: list[int] = []
    for frame, patches in frames:
        match = carry(before, patches, 2.0 * span)
        here = []
        for patch, old in zip(patches, match, strict=True):
            here.append(names[old] if old >= 0 else len(tracks))
            tracks.setdefault(here[-1], []).append((frame, patch))
        before, names = patches, here
    whole = {bird: seen for bird, seen in tracks.items() if len(seen) == len(frames)}
    lost = [
        f"bird {bird} is in {len(seen)} of {len(frames)} frames, from {seen[0][0]}, and was left out"
        for bird, seen in tracks.items()
        if bird not in whole
    ]
    if not whole:
        raise ProblemsError(
            [Problem(str(next(iter(paths))), None, None, "no bird could be followed through all frames")]
        )
    rows = [(frame, bird, patch) for bird, seen in whole.items() for frame, patch in seen]
    place = {frame: k for k, (frame, _) in enumerate(frames)}
    return sorted(rows, key=lambda row: (place[row[0]], row[1])), span, lost + doubts

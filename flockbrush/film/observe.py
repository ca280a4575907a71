"""Observation of a clip: from the file of a film to all measurements of its herd.

In order: open it (`clip`), take the camera's motion out (`stabilise`), find the animals' colours (`masks`),
the size of one (`bodies`), and then frame by frame the flow of the bodies (`flow`), the fields (`fields`) and the
single animals (`bodies`, `sightings`).
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import NamedTuple

import cv2
import numpy as np

from flockbrush.engine.files import refused
from flockbrush.film.body_gaps import radius_of_touching
from flockbrush.film.body_outlines import BodySize, blobs_left, bodies_of, sizes_alone
from flockbrush.film.body_shapes import Outlines, gone_on
from flockbrush.film.camera_maps import Steady, after, back, zoom_of
from flockbrush.film.clip_fields import ClipGrid, Collector, grid_over, outlined, painted, read_colours
from flockbrush.film.clip_reader import Clip, Say, open_clip, silent
from flockbrush.film.flow import Flow, gap_of
from flockbrush.film.landmarks import Landmark
from flockbrush.film.masks import BodyColours, colours_of
from flockbrush.film.measured_size import blur_margin, scaled, size_in, too_small
from flockbrush.film.media import read_picture
from flockbrush.film.observations import CannotObserve, Evidence, Sightings
from flockbrush.film.plain_ground import ground_alone, is_plain
from flockbrush.film.several_kinds import sizes_told, speeds_told
from flockbrush.film.sightings import UNKNOWN, SightingNoise, sightings_of
from flockbrush.film.speed_process import SMOOTHED
from flockbrush.film.speeds import speed_evidence
from flockbrush.film.stabilise import follow_landmarks, register

SPECK = 0.3  # of one animal's pixels: smaller patches are not animals
HERD = 0.1  # share of the pictures that animals cover, above which the ground is tracked again without them
SIZES = 9  # pictures in which the size of one animal is measured
FINE, LARGEST = 12.0, 2560  # px: pictures are made no smaller than bodies of that length allow, up to that side
SMALL = 6.0  # px: shorter bodies are not separated
FEW = 5  # animals
HARDLY = 0.7  # BL, the way in the clip below which most animals may be taken for ground
LEAVES, STAYS = 1.0, 0.1  # BL by which a body leaves its place; share of bodies that stay, above which it is noted
AT_REST = 0.25  # BL, of the way that the flow of a body's pixels would make in the whole clip
JUMP, STEADY = 0.5, 0.4  # overlap of the herd with that of the frame before, over the usual; and the least usual one
AHEAD = 2  # pictures that other threads work on
MASKING = 2  # threads that make masks
ROOMLESS = 0.98  # share of the picture that obstacles cannot cover
SLOW = 3.0  # deviations of the ground's flow: slower bodies have no direction


@dataclass(frozen=True)
class Glance:
    """One frame during processing, for drawing."""

    k: int  # row of the clip
    # picture, mask: ndarray; (h, w, 3) BGR; (h, w), 1 where animals are
    picture: np.ndarray
    mask: np.ndarray
    # at, move: (n, 2); pixels of bodies, and their velocity in px/s, without camera motion
    at: np.ndarray
    move: np.ndarray
    bodies: Outlines | None  # in pixels of this picture


def observe(
    path, *, frames=None, landmarks=(), body_colour="auto", body_length_px=None, grid=30, obstacles=None, regions=None,
    say: Say = silent, show: Callable[[Glance, Watch, dict], None] | None = None,
) -> Evidence:  # fmt: skip
    """Observe the herd of a clip.

    Parameters
    ----------
    path : path
        A film or a photograph.
    frames : (int or None, int or None), optional
        First and last frame that are used, both included, counted from 0.
    landmarks : iterable of Landmark or (int, (x, y, w, h))
        Rectangles on the ground, in pixels of frames of the clip; without any, the whole ground is tracked.
    body_colour : "auto" or (red, green, blue)
    body_length_px : float, optional
        Of one animal in the first frame, pixels of the clip; default: measured on isolated animals.
    grid : int
        Cells across the longer side of the picture.
    obstacles, regions : path, optional
        Painted over the first frame: white where animals cannot go; a colour for each region, black for none.
    say : callable
        (what is done, how many are done, of how many).
    show : callable, optional
        Called with every frame, for drawing: (glance, watch, its fields by name).

    Raises
    ------
    CannotObserve
        When the clip does not show enough; the error holds what was seen.
    ProblemsError
        When a mask cannot be read.
    """
    watch = Watch.of(path, frames, landmarks, body_colour, body_length_px, grid, obstacles, regions, say)
    return watch.evidence(say, show)


@dataclass
class Watch:
    """A clip with known camera motion, animal colours and animal size."""

    clip: Clip
    steady: Steady
    colours: BodyColours
    size: BodySize  # of what the mask shows of one animal
    margin: float  # px by which blur widens it on each side
    length: float  # px of the first picture: a body length, given or measured on the mask
    given: bool  # whether it was given
    grid: ClipGrid
    obstacle: np.ndarray | None  # (h, w) uint8 in pixels of the first picture
    obstacle_cells: np.ndarray | None
    outline: np.ndarray | None  # (k, 5) of the obstacles, BL
    region_cells: np.ndarray | None
    region_colours: np.ndarray | None
    apart: bool  # whether animals can be separated
    notes: list[str]

    @staticmethod
    def of(path, frames, landmarks, body_colour, body_length_px, grid, obstacles, regions, say) -> Watch:
        """Scan the whole clip once, as needed before its frames are measured."""
        if not 2 <= int(grid) <= 400:
            raise ValueError(f"a grid must have 2 to 400 cells across, got {grid}")
        clip = open_clip(path, frames, say)
        painted_on = [_mask_of(mask, clip) for mask in (obstacles, regions)]
        looks = _animals_in(clip, landmarks, body_colour, body_length_px, say)
        larger = min(1.0, clip.scale * FINE / looks.size.length)
        if larger > 1.1 * clip.scale:  # small animals: the pictures are made less small
            clip = open_clip(path, frames, say, min(LARGEST, round(larger * max(clip.full))))
            looks = _animals_in(clip, landmarks, body_colour, body_length_px, say)
        steady, colours, size, margin, length, apart, notes = looks
        cells = grid_over(clip.size, steady.maps, length, grid)
        obstacle = None if painted_on[0] is None else (painted_on[0].max(-1) > 127).astype(np.uint8)
        if obstacle is not None and obstacle.mean() > ROOMLESS:
            raise refused(obstacles, "is almost completely white; white means obstacle, black means ground")
        numbers, kinds = (None, None) if painted_on[1] is None else read_colours(painted_on[1])
        if kinds is not None and len(kinds) > 32:
            raise refused(regions, f"has {len(kinds)} colours; use a few colours for the regions, without soft edges")
        return Watch(
            clip, steady, colours, size, margin, length, body_length_px is not None, cells,
            None if obstacle is None else cv2.resize(obstacle, clip.size, interpolation=cv2.INTER_NEAREST),
            None if obstacle is None else painted(obstacle, cells, clip.scale).astype(bool),
            None if obstacle is None else outlined(obstacle, cells, clip.scale),
            None if numbers is None else painted(numbers.astype(np.uint8), cells, clip.scale),
            kinds, apart, clip.notes + steady.notes + notes,
        )  # fmt: skip

    def evidence(self, say: Say = silent, show=None) -> Evidence:
        """Measure every frame."""
        clip, taken = self.clip, _Taken(self, self.apart and self.size.length >= SMALL)
        first = None
        masked = ((*frame, *made) for frame, made in ahead(taken.masked, clip.read(), MASKING))
        for (k, picture, mask, small), bodies in ahead(taken.separated, masked):
            first = picture if first is None else first
            for glance in taken.next(k, picture, mask, small, bodies):
                if show is not None:
                    show(glance, self, taken.collector.last())
            say("measuring the herd", k + 1, len(clip))
        for glance in taken.rest():
            if show is not None:
                show(glance, self, taken.collector.last())
        fields = taken.collector.fields(clip.fps, self.obstacle_cells, self.region_cells, self.outline)
        self._check(fields, taken.masks)
        sightings, noise = taken.sightings()
        smoothed = 2 * noise.half + 1 / clip.fps if np.isfinite(noise.half) else SMOOTHED
        errors = noise.speed_errors(clip.fps)
        radius = max(0.5 * self.size.width - self.margin, 0.0) / self.size.length
        radius = radius if sightings is None else radius_of_touching(sightings, radius)
        speed = None if clip.still else speed_evidence(fields, sightings, self.size.area, smoothed, errors, radius)
        way = math.inf if speed is None else speed.mean * float(clip.times[-1] - clip.times[0])
        doubt = _doubt(way)
        warnings = [f"unreliable: {doubt}"] if doubt else []
        return Evidence(
            name=clip.name, sha256=clip.sha256, fps=clip.fps, body_length_px=self.length,
            length_source="given" if self.given else "blobs",
            radius_bl=radius, fields=fields, sightings=sightings, speed=speed,
            notes=self._notes(taken, way) + speeds_told(sightings, clip.fps) + warnings, doubt=doubt, picture=first,
            to_pixels=self.grid.to_pixels, camera=self._camera(),
            region_colours=self.region_colours, place_noise=float(np.nan_to_num(noise.place)),
            heading_noise=float(np.nan_to_num(noise.heading)), smoothing=noise.smoothing(clip.fps),
        )  # fmt: skip

    def _check(self, fields, example):
        """Refuse a clip with hardly any animals."""
        usual = float(np.median(fields.count))
        if usual < 1:
            long = f" of the given {self.length / self.clip.scale:.0f} pixels" if self.given else ""
            raise CannotObserve(
                self.clip.name,
                f"no animals were detected: in the median frame, their colour covers the area of {usual:.2g} "
                f"animals{long}; "
                "give their colour with --body-colour R,G,B, or their length with --body-length-px",
                {"animals": usual, "pictures": example},
            )  # fmt: skip

    def _notes(self, taken, way):
        notes = list(self.notes)
        if taken.gap > 1:
            notes.append(f"motion was measured over {taken.gap} frames, because animals move little between two frames")
        usual = float(np.median(taken.collector.rows["count"]))
        if usual < FEW:
            notes.append(f"only about {usual:.0f} animals are visible: too few to learn the motion of a herd")
        notes += [*taken.jumps(), *taken.staying(way)]
        if not self.apart:
            notes.append("single animals could not be separated; only fields are available")
        return notes

    def _camera(self):
        """(n, 2, 3) from full pixels of the clip to the reference picture."""
        camera = np.array(self.steady.maps, float)
        camera[..., :2] *= self.clip.scale
        return camera


class _Taken:
    """Processes the frames of a clip in order."""

    def __init__(self, watch: Watch, animals: bool):
        self.watch, self.clip, self.maps = watch, watch.clip, watch.steady.maps
        self.collector = Collector(watch.grid, self.clip.size, watch.size.area, not animals)
        self.flow = Flow(self.clip.size, watch.size.length)
        self.gap = 0 if self.clip.still else min(self._gap(), len(self.clip) // 2)
        self.frames: dict[int, tuple] = {}
        self.seen: list[Outlines] | None = [] if animals else None
        self.last: Outlines | None = None
        self.earlier: Outlines | None = None
        self.moves: list[np.ndarray] = []
        self.masks: dict[str, np.ndarray] = {}
        self.overlaps: list[float] = []
        self.flowing, self.resting = 0, 0  # pixels of the flow of all frames, and those of them that are at rest
        self.stays: np.ndarray | None = None  # (h, w) uint8 on the first picture: what has looked like animals so far

    def _gap(self):
        """The number of frames over which flow is measured, from a sample of neighbouring pairs."""
        n = len(self.clip)
        rows = np.unique(np.linspace(0, n - 2, 5).round().astype(int))
        pictures = dict(self.clip.read([k for row in rows for k in (row, row + 1)]))
        steps = []
        for k in rows:
            one, other = (self.flow.small(pictures[j], self.watch.colours.mask(j, pictures[j])) for j in (k, k + 1))
            _, move, _ = self.flow.between(one, other, self.maps[k], self.maps[k + 1])
            steps.append(np.linalg.norm(move, axis=1))
        return gap_of(np.concatenate(steps), self.watch.size.length, self.clip.fps)

    def masked(self, k, picture):
        """(mask, input of the flow) of a picture; pictures may be masked in any order."""
        mask = self._mask(k, picture)
        return mask, self.flow.small(picture, mask)

    def separated(self, k, picture, mask, _small):
        """The animals of a picture, if they are separated; pictures must come in order."""
        if self.seen is None:
            return None
        zoom, to_here = zoom_of(self.maps[k]), after(back(self.maps[k]), self.maps[k - 1])
        earlier, self.last = (None if bodies is None else bodies.moved(to_here) for bodies in (self.earlier, self.last))
        self.earlier = self.last
        size = scaled(self.watch.size, 1 / zoom)
        before = None if self.last is None else gone_on(self.last, earlier, size.length)
        self.last = bodies_of(mask, size, picture, before, self.watch.margin / zoom)
        return self.last

    def next(self, k, picture, mask, small, bodies):
        """Process a picture; returns the glances of all frames that can be measured now."""
        if k > 0:
            self.overlaps.append(self._overlap(k, self.frames[k - 1][2][1], small[1]))
        self.stays = self._stays(k, mask)
        self.frames[k] = (picture, mask, small, bodies)
        if k - self.gap >= 0:
            yield self._measure(k - self.gap, k)
            self.frames.pop(k - 2 * self.gap - 1, None)

    def _overlap(self, k, before, now):
        """Share of the herd's pixels that were the herd's in the previous frame, without camera motion."""
        way = after(back(self.maps[k]), self.maps[k - 1])
        way[:, 2] *= self.flow.scale
        before = cv2.warpAffine(before, way, self.flow.size, flags=cv2.INTER_NEAREST)
        return float(cv2.countNonZero(cv2.bitwise_and(before, now)) / max(1, cv2.countNonZero(now)))

    def _stays(self, k, mask):
        """Pixels that looked like animals in every picture so far that shows them."""
        if self.stays is None:
            return mask.copy()
        here = cv2.warpAffine(mask, self.maps[k], mask.shape[::-1], flags=cv2.INTER_NEAREST, borderValue=1)
        return self.stays & here

    def staying(self, way):
        """A note if much of what looks like animals never moves; ``way``: how far they seem to go, BL."""
        first = cv2.countNonZero(self.masks["what looks like animals"])
        share = cv2.countNonZero(self.stays) / max(first, 1)
        if way <= LEAVES:  # they would not leave their places, or are things that are mistaken for one another
            share = min(share, self.resting / max(self.flowing, 1))
        if share > STAYS and not self.clip.still:
            yield (
                f"{share:.0%} of what looks like animals never moves in this clip: either animals that stand, or "
                "lines, stones and plants of their colour; watch flockbrush fields --preview, and give the colour of "
                "the animals with --body-colour"
            )

    def jumps(self):
        """Notes on frames in which the whole herd jumps: a cut over the same ground, or missing frames."""
        overlaps, numbers = np.array(self.overlaps), self.clip.numbers
        usual = float(np.median(overlaps)) if len(overlaps) else 0.0
        for k in np.flatnonzero(overlaps < JUMP * usual)[:3] + 1 if usual > STEADY else []:
            a, b = numbers[k - 1], numbers[k]
            yield (
                f"the herd jumps between frames {a} and {b}; if this is a cut, use --frames {numbers[0]}:{a} or "
                f"--frames {b}:{numbers[-1]}"
            )

    def rest(self):
        """The glances at the last frames, whose flow is measured backwards."""
        last = len(self.clip) - 1
        for k in range(last - self.gap + 1, last + 1):
            yield self._measure(k, k - self.gap)

    def _mask(self, k, picture):
        mask = self.watch.colours.mask(k, picture)
        if self.watch.obstacle is not None:
            size = self.clip.size
            mask[cv2.warpAffine(self.watch.obstacle, back(self.maps[k]), size, flags=cv2.INTER_NEAREST) > 0] = 0
        return without_specks(mask, SPECK * self.watch.size.area / zoom_of(self.maps[k]) ** 2)

    def _measure(self, k, other):
        picture, mask, small, bodies = self.frames[k]
        number, m = int(self.clip.numbers[k]), self.maps[k]
        if k == other:
            self.collector.add(number, mask, m, 0.0)
            at = move = np.empty((0, 2))
        else:
            seconds = float(self.clip.times[other] - self.clip.times[k])
            at, move, noise = self.flow.between(small, self.frames[other][2], m, self.maps[other])
            self._rest(move * zoom_of(m) / abs(seconds))
            slow = SLOW * np.nan_to_num(noise) * zoom_of(m) / self.watch.length / abs(seconds)
            self.collector.add(number, mask, m, seconds, (at, move), slow)
            move = move / seconds
        if self.seen is not None:
            self._follow(k, bodies, at, move)
        if not self.masks:
            self.masks = {f"frame {number}": picture, "what looks like animals": mask * np.uint8(255)}
        return Glance(k, picture, mask, at, move, bodies)

    def _rest(self, velocity):
        """Count what is at rest, by the velocities of pixels of bodies (n, 2), px/s."""
        way = np.hypot(*velocity.T) * float(self.clip.times[-1] - self.clip.times[0])
        self.flowing += len(way)
        self.resting += int((way < AT_REST * self.watch.length).sum())

    def _follow(self, k, bodies, at, move):
        m = self.maps[k]
        self.seen.append(bodies.moved(m))
        self.moves.append(self._at_bodies(bodies, at, move) @ m[:, :2].T / self.clip.fps)

    def _at_bodies(self, bodies, at, move):
        """(k, 2) velocity of the centre of each body, px/s; NaN unknown."""
        w, h = self.flow.size
        where = np.full((h, w), -1)
        x, y = np.clip(np.floor((at + 0.5) * self.flow.scale).astype(int), 0, (w - 1, h - 1)).T
        where[y, x] = np.arange(len(at))
        x, y = np.clip(np.floor(bodies.xy * self.flow.scale).astype(int), 0, (w - 1, h - 1)).T
        row = where[y, x]
        return np.where((row >= 0)[:, None], np.vstack([move, (np.nan, np.nan)])[row], np.nan)

    def sightings(self) -> tuple[Sightings | None, SightingNoise]:
        """(single animals, if they were separated; their errors)."""
        if self.seen is None:
            return None, UNKNOWN
        moves = None if self.clip.still else self.moves
        return sightings_of(self.seen, self.clip.fps, self.watch.grid.to_bl, moves)


def _doubt(way):
    """A sentence if animals move so little, BL, that resting ones cannot be separated from the ground; else ""."""
    if way >= HARDLY:
        return ""
    return (
        f"animals move {way:.2g} body lengths in this clip. Animals that stand all the time are taken for ground, so "
        "counts, speeds and directions are of the few that move; use more frames, or --body-colour"
    )


def ahead(work, items, threads=1):
    """(item, work(*item)) of each item in order, while other threads work on the next."""
    with ThreadPoolExecutor(threads) as pool:
        waiting: deque = deque()
        for item in items:
            waiting.append((item, pool.submit(work, *item)))
            if len(waiting) > AHEAD:
                item, made = waiting.popleft()
                yield item, made.result()
        for item, made in waiting:
            yield item, made.result()


# steps -----------------------------------------------------------------------------------


class _Looks(NamedTuple):
    """Animal colours and camera motion of a clip; fields as those of `Watch`."""

    steady: Steady
    colours: BodyColours
    size: BodySize
    margin: float
    length: float
    apart: bool
    notes: list[str]


def _animals_in(clip, landmarks, body_colour, body_length_px, say):
    steady = _steady(clip, [_landmark(mark) for mark in landmarks], say)
    say("detecting the animals", 0, 1)
    colours = colours_of(clip, steady, body_colour)
    pictures, masks = _sampled(clip, colours)
    if not landmarks and not clip.still and steady.moved:
        away = lambda k, picture: colours.mask(k, picture) > 0  # noqa: E731
        if np.mean([m.mean() for m in masks.values()]) > HERD or not ground_alone(clip, away, steady.maps):
            steady = register(clip, away, say)
            colours.maps = steady.maps
    plain = _plain(pictures, steady, masks) if not landmarks and not clip.still else []
    size, length, apart, notes = size_in(clip, steady, masks, body_length_px)
    lines = not clip.still and colours.find_lines(masks, pictures, size)
    bodies = masks
    if colours.find_stones(size.area) or lines:
        masks = _sampled(clip, colours)[1]
        size, length, apart, notes = size_in(clip, steady, masks, body_length_px)
        bodies = {k: blobs_left(bodies[k], mask) for k, mask in masks.items()}
    notes += sizes_told(*sizes_alone(bodies.values()))
    margin = blur_margin(pictures, masks, size)
    return _Looks(steady, colours, size, margin, length, apart, plain + colours.notes + notes + too_small(clip, size))


def _landmark(mark) -> Landmark:
    return mark if isinstance(mark, Landmark) else Landmark(int(mark[0]), *map(float, mark[1]))


def _steady(clip, landmarks, say):
    """The maps of the clip; exact identities for a camera that stands still."""
    if clip.still:
        if landmarks:
            raise refused(clip.name, "is one picture, and landmarks hold pictures together: leave out --landmark")
        return Steady(np.eye(2, 3)[None], False)
    steady = follow_landmarks(clip, landmarks, say) if landmarks else register(clip, None, say)
    if not steady.moved:
        steady.maps = np.tile(np.eye(2, 3), (len(clip), 1, 1))
    return steady


def _sampled(clip, colours):
    """({k: picture}, {k: mask}) of a sample of pictures."""
    rows = np.unique(np.linspace(0, len(clip) - 1, min(SIZES, len(clip))).round().astype(int))
    pictures = dict(clip.read(rows))
    return pictures, {k: colours.mask(k, picture) for k, picture in pictures.items()}


def _plain(pictures, steady, masks):
    """Notes on a ground that is too plain to show camera motion."""
    if steady.moved or not is_plain(pictures[min(masks)], masks[min(masks)]):
        return []
    return [
        "the ground has too little texture to measure the motion of the camera, which is assumed to stand still; if it "
        "moves, mark something that does not move, in two frames, with --landmark FRAME:x,y,w,h"
    ]


def without_specks(mask, least):
    """The mask without patches of fewer than ``least`` pixels."""
    count, labels, stats, _ = cv2.connectedComponentsWithStats(mask, connectivity=8, ltype=cv2.CV_32S)
    keep = (stats[:, cv2.CC_STAT_AREA] >= least).astype(np.uint8)
    if keep[1:].all():
        return mask
    keep[0] = 0
    return keep[labels]


def _mask_of(path, clip):
    """A painted picture of the clip's size, BGR, or None."""
    if path is None:
        return None
    picture = read_picture(path, "a mask must be a PNG painted over the first frame of the clip")
    w, h = picture.shape[1::-1]
    if (w, h) == clip.full:
        return picture
    if abs(w / h - clip.full[0] / clip.full[1]) < 0.01:
        return cv2.resize(picture, clip.full, interpolation=cv2.INTER_NEAREST)
    raise refused(
        path,
        f"is {w} x {h} pixels, but the clip is {clip.full[0]} x {clip.full[1]}; paint the mask over a frame of "
        "the clip",
    )

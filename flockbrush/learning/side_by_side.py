"""A clip and a simulation side by side: one ground, one camera, one scale."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import cv2
import numpy as np

from flockbrush.film.camera_maps import after, back, moved_by
from flockbrush.film.observations import Evidence
from flockbrush.film.open_clip import pictures_of
from flockbrush.learning.rollout import Run
from flockbrush.learning.simulate import longest_way
from flockbrush.learning.words_of_tracks import words_for
from flockbrush.render import LIGHT, DrawnHerd, Painter, ViewCamera
from flockbrush.render.canvas import Canvas
from flockbrush.render.drawn_terrain import nice
from flockbrush.render.style import mix, rgb

TALL, WIDEST = 460, 760  # pixels of one picture, at most
EDGE = 2.5  # body lengths of ground left around the herd
SQUAREST = 0.55, 1.9  # width over height of a picture
FADE = 1.5  # s of trails behind the simulated animals
GAP = 8  # pixels between two pictures
LETTERS = 16, 1 / 30  # pixels of what is written above them, at least; of a picture's width
STRIP = 1.8  # times the letters, the room for it
BAR = 10  # times the letters, the scale bar


class ComparisonGround:
    """The ground of a clip as both sides are drawn on it.

    Parameters
    ----------
    evidence : Evidence
        Of frames that are all to be shown; it needs `picture`, `to_pixels` and `camera`.
    brush : Brush
        Its colour and body are those of the simulated animals.
    others : list of (k, 2) ndarray
        Places that should be in the picture too, BL.
    read_scale : float
        Pixels of the frames that `film` is given for one of the clip's own.
    """

    def __init__(self, evidence: Evidence, brush, others=(), read_scale=1.0):
        self.evidence, self.brush = evidence, brush
        self._upright = np.array([[1 / read_scale, 0, 0], [0, 1 / read_scale, 0]])
        to_pixels = np.eye(2, 3) if evidence.to_pixels is None else np.asarray(evidence.to_pixels, float)
        self.low, self.high = _box(evidence, to_pixels, others)
        wide, tall = self.high - self.low
        self.scale = min(TALL / tall, WIDEST / wide)  # pixels of the stage in a body length
        self.size = (int(2 * round(wide * self.scale / 2)), int(2 * round(tall * self.scale / 2)))
        self._from_picture = after(self._from_bl, back(to_pixels))
        self._elsewhere = self._outside()
        self.painter = self._painter(wide, tall)

    @property
    def _from_bl(self):
        """(2, 3), body lengths to pixels of the stage."""
        s = self.scale
        return np.array([[s, 0, -s * self.low[0]], [0, -s, s * self.high[1]]])

    def _painter(self, wide, tall):
        picture = self.evidence.picture
        ground = LIGHT.ground
        if picture is not None:
            blue, green, red = np.median(picture.reshape(-1, 3), axis=0)
            ground = mix(LIGHT.ground, (red, green, blue), 0.45)
        look = replace(LIGHT, ground=ground)
        level = SimpleNamespace(name="", width=float(wide), height=float(tall))
        painter = Painter(level, self.size, look, words=False, trails=FADE)
        view = (0, 0, *self.size)
        painter.look(ViewCamera((float(wide) / 2, float(tall) / 2), self.scale, self.size, view))
        return painter

    def film(self, frame, t) -> np.ndarray:
        """A frame of the clip as it is read (BGR), the t-th of the evidence, laid on the stage; RGB."""
        camera = np.eye(2, 3) if self.evidence.camera is None else self.evidence.camera[t]
        way = after(self._from_picture, after(camera, self._upright))
        paper = tuple(float(part) for part in LIGHT.paper[::-1])
        flat = cv2.warpAffine(frame, way, self.size, flags=cv2.INTER_AREA, borderValue=paper)
        if self._elsewhere is not None:
            flat[self._elsewhere] = (0.4 * flat[self._elsewhere] + 0.6 * np.array(paper)).astype(np.uint8)
        return np.ascontiguousarray(flat[:, :, ::-1])

    def _outside(self):
        """(h, w) bool, pixels of the stage beyond the region that was learned from; None where all was."""
        fields = self.evidence.fields
        kinds = np.unique(fields.region[fields.seen.any(0)])
        if len(kinds) != 1 or (fields.region == kinds[0]).all():
            return None
        cell, (x, y) = fields.cell, fields.origin
        middle = np.array([[cell, 0, x + cell / 2], [0, cell, y + cell / 2]])  # of cells, BL
        here = (fields.region == kinds[0]).astype(np.uint8)
        return cv2.warpAffine(here, after(self._from_bl, middle), self.size, flags=cv2.INTER_NEAREST) == 0

    def herd(self, xy, forward, time, ids=None) -> np.ndarray:
        """Simulated animals (n, 2) BL; RGB."""
        radius = self.brush.body.radius / self.brush.body.length
        n = len(xy)
        animals = DrawnHerd(
            np.asarray(xy, float) - self.low, forward, 1.0, radius, brush=np.zeros(n, int),
            brush_colours=(self.brush.colour,), brush_names=(self.brush.name,), ids=ids,
        )  # fmt: skip
        return self.painter.frame(animals, time=time, legend=False, under=self._obstacles)

    def _obstacles(self, image):
        fields, canvas = self.evidence.fields, Canvas(image)
        if fields.outline is None:
            half = 0.5 * fields.cell * np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
            for centre in fields.centres[fields.obstacle]:
                canvas.area(moved_by(self._from_bl, centre + half), LIGHT.rock)
            return
        for number in np.unique(fields.outline[:, 4]):
            starts, ends = fields.outline[fields.outline[:, 4] == number, :4].reshape(-1, 2, 2).transpose(1, 0, 2)
            first = np.flatnonzero(np.r_[True, (starts[1:] != ends[:-1]).any(1)])
            rings = [np.vstack([ring, ring[:1]]) for ring in np.split(starts, first[1:])]
            line = np.vstack([*rings, *(ring[:1] for ring in rings[-2::-1])])  # holes are reached by a way and back
            canvas.area(moved_by(self._from_bl, line), LIGHT.rock)

    def beside(self, frame, t, xy, forward, time, words, ids=None) -> np.ndarray:
        """Clip left, simulation right, and what is written above each; RGB."""
        left, right = self.film(frame, t), self.herd(xy, forward, time, ids)
        wide, tall = self.size
        letters = max(LETTERS[0], round(LETTERS[1] * wide))
        strip = round(STRIP * letters)
        image = np.full((tall + strip + 2, 2 * wide + GAP, 3), 255, np.uint8)
        image[strip : strip + tall, :wide] = left
        image[strip : strip + tall, wide + GAP :] = right
        canvas = Canvas(image)
        for k, text in enumerate(words):
            begin = k * (wide + GAP) + 2
            long = canvas.words(text, (begin, strip / 2), letters, rgb("#26302c"), anchor=(0, 0.5))
        if begin + long + BAR * letters < 2 * wide + GAP:  # room for it beside the words
            self._bar(canvas, (2 * wide + GAP - 4, strip / 2), round(0.85 * letters))
        even = image.shape[0] + image.shape[0] % 2
        return np.pad(image, [(0, even - image.shape[0]), (0, 0), (0, 0)], constant_values=255)

    def _bar(self, canvas, at, letters):
        """A scale bar of several body lengths, ending at ``at``."""
        length = nice(0.16 * self.size[0] / self.scale)
        across = length * self.scale
        words = f"{length:g} body length" + ("" if length == 1 else "s")
        wide = canvas.words(words, at, letters, rgb("#66716a"), anchor=(1, 0.5))
        x = at[0] - wide - 8
        canvas.line([(x - across, at[1]), (x, at[1])], 2.5, rgb("#66716a"))


def _box(evidence, to_pixels, others):
    """(low, high) corners in BL of what is shown: the herd and some ground, as far as the clip ever showed it."""
    fields = evidence.fields
    there = (np.nan_to_num(fields.density) > 0).any(0) | fields.enclosed  # of an arena, all of it
    places = [fields.centres[there], *(np.asarray(o, float).reshape(-1, 2) for o in others)]
    places = np.concatenate([p for p in places if len(p)] or [fields.centres.reshape(-1, 2)])
    room = EDGE + fields.cell / 2
    low, high = places.min(0) - room, places.max(0) + room
    shown = _shown(evidence, to_pixels)
    low, high = np.maximum(low, shown[0]), np.minimum(high, shown[1])
    if (high - low <= 1).any():
        low, high = shown
    return _proportioned(low, high)


def _shown(evidence, to_pixels):
    """Corners in BL of all the ground that any frame shows."""
    if evidence.picture is None:
        f = evidence.fields
        return np.asarray(f.origin, float), f.origin + f.cell * np.array(f.shape[::-1])
    tall, wide = evidence.picture.shape[:2]
    corners = np.array([(0, 0), (wide, 0), (wide, tall), (0, tall)], float)
    cameras = [np.eye(2, 3)] if evidence.camera is None else evidence.camera
    on_picture = np.concatenate([moved_by(camera, corners) for camera in cameras])
    ground = moved_by(back(to_pixels), on_picture)
    return ground.min(0), ground.max(0)


def halves_of(image: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Clip and simulation of a picture of `Stage.beside`, each alone."""
    wide = (image.shape[1] - GAP) // 2
    return image[:, :wide], image[:, wide + GAP :]


def _proportioned(low, high):
    """Grown until it is neither too wide nor too tall."""
    middle, size = (low + high) / 2, high - low
    size = np.maximum(size, [SQUAREST[0] * size[1], size[0] / SQUAREST[1]])
    return middle - size / 2, middle + size / 2


def moments_beside(clip, frames: Evidence, run: Run, brush, count) -> list[np.ndarray]:
    """Clip beside simulation at some moments, (h, w, 3) RGB."""
    total, numbers = len(frames.fields), frames.fields.frames
    chosen = np.unique(np.linspace(0, total - 1, count).round().astype(int))
    pictures, scale = pictures_of(clip, frames, chosen)
    stage = ComparisonGround(frames, brush, [longest_way(run)], scale)
    made = []
    for t in range(total):  # every frame, for the trails
        rows = run.of(t)
        seconds = float(run.times[t])
        if t in pictures:
            filmed = "photograph" if len(np.unique(numbers)) == 1 else words_for(frames)(f"clip, frame {numbers[t]}")
            words = (filmed, f"{brush.name}, after {seconds:.1f} s")
            made.append(stage.beside(pictures[t], t, run.xy[rows], run.forward[rows], seconds, words, run.ids[rows]))
        else:
            stage.herd(run.xy[rows], run.forward[rows], seconds, run.ids[rows])
    return made

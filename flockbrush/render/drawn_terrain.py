"""The ground of a level: kinds of terrain without gaps, hills, and regions of cells with rounded corners."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np

from flockbrush.render.canvas import Canvas
from flockbrush.render.shapes import bilinear, grain, lighten, patch, shrink, smear, steepness
from flockbrush.render.style import mix, rgb

BLUR = 1.1  # cells; rounds the corners of painted regions
AROUND = 8  # cells around a box that have a say in how it looks
RIM = 4  # pixels around a box that have a say in how regions look in it
REACH = RIM + 2  # pixels


class TerrainSketch:
    """The part of a Sketcher that draws the ground."""

    level: Any
    camera: Any
    theme: Any
    unit: float
    image: np.ndarray
    canvas: Canvas

    def cells(self, cell, shape):
        """(rows, columns) of the cells that the clip shows, and of those around that have a say in how they look."""
        left, top, right, bottom = self.canvas.clip
        step = shrunk(cell * self.camera.scale)
        far = AROUND * step * cell + REACH / self.camera.scale
        west, south = self.camera.metres((left, bottom)) - far
        east, north = self.camera.metres((right, top)) + far
        return _between(south, north, cell, step, shape[0]), _between(west, east, cell, step, shape[1])

    def spread(self, values, cell, start, around=0):
        """Values of cells [iy, ix] smoothly over the clip's pixels, and `around` more on every side.

        `start` (iy, ix) is the cell of the level that the first value belongs to.
        """
        left, top, right, bottom = self.canvas.clip
        values, fine = np.ascontiguousarray(values, np.float32), cell * self.camera.scale
        step = shrunk(fine)
        if step > 1:
            values, cell, fine = shrink(values, step), cell * step, fine * step
        x, y = self.camera.metres((0.5, 0.5)) / cell - 0.5
        xs = x + np.arange(left - around, right + around) / fine
        ys = y - np.arange(top - around, bottom + around) / fine
        return bilinear(values, start[0] // step, start[1] // step, xs, ys)

    def soft(self, cells, cell, start, around=0):
        """How much of the neighbourhood of each pixel of the clip belongs to a region of cells, 0 to 1.

        Single cells and lines of them have more than their share, so as to be seen.
        """
        soft = blurred(cells, BLUR)
        thin, alone = cells & (soft < 0.4), cells & (soft < 0.2)  # would be smoothed away
        if thin.any():
            soft = np.maximum(soft, 1.9 * blurred(thin & ~alone, 0.7))
            soft[alone] = 1.8
        return self.spread(soft, cell, start, around)

    def region(self, cells, cell, start):
        """A region of cells (bool [iy, ix]) with rounded corners: signed distance to its edge in pixels, inside > 0."""
        level = self.soft(cells, cell, start, RIM) - np.float32(0.5)
        slope = smear(steepness(level), np.array([1, 4, 6, 4, 1]) / 16)
        edge = level / np.maximum(slope, np.float32(0.15 / max(cell * self.camera.scale, 1.0)))
        return edge[RIM:-RIM, RIM:-RIM]

    def _kinds(self, rows, columns):
        """(colour, cells [iy, ix], whether they block the way) of the kinds of ground, lowest first."""
        terrain, theme = self.level.terrain, self.theme
        walkable, factor, blind = (
            part[rows, columns] for part in (terrain.walkable, terrain.speed_factor, terrain.blocks_view)
        )
        bare = np.ones(walkable.shape, bool)
        index = getattr(terrain, "index", None)
        if index is not None and len(getattr(terrain, "colours", ())):
            index = index[rows, columns]
            bare = index < 0
            for k in np.unique(index[~bare]):
                colour = self.washed(rgb(terrain.colours[k]))
                yield colour, (index == k) & walkable, False
                yield colour, (index == k) & ~walkable, True
        yield theme.rough, bare & walkable & (factor < 1), False
        yield theme.road, bare & walkable & (factor > 1), False
        yield theme.ground, bare & walkable & (factor == 1), False
        yield theme.water, bare & ~walkable & ~blind, True
        yield theme.rock, bare & ~walkable & blind, True

    def washed(self, colour):
        """A designer's colour, calm enough to stand behind animals."""
        grey = (int(0.3 * colour[0] + 0.6 * colour[1] + 0.1 * colour[2]),) * 3
        return mix(mix(mix(colour, grey, 0.2), self.theme.wash, self.theme.wash_share), self.theme.ground, 0.12)

    def _terrain(self):
        left, top, right, bottom = self.canvas.clip
        part = self.image[top:bottom, left:right]
        part[:] = self.theme.ground
        if getattr(self.level, "terrain", None) is not None:
            rows, columns = self.cells(self.level.cell, self.level.terrain.walkable.shape)
            kinds = [kind for kind in self._kinds(rows, columns) if kind[1].any()]
            if len(kinds) > 1 or kinds[0][0] != self.theme.ground:
                self._patchwork(part, kinds, (rows.start, columns.start))
        lighten(self.image, self._grain() + self._slopes(), left, top)

    def _patchwork(self, part, kinds, start):
        """Kinds of ground without gaps: each pixel has the kind that most of its neighbourhood has.

        Kinds that block and kinds that do not compete among themselves only: the border between them is the one that
        stops animals (`wall_edge`).
        """
        shares = np.stack([self.soft(cells, self.level.cell, start) for _, cells, _ in kinds])
        inks = np.array([colour for colour, _, _ in kinds], np.float64)
        sharp = self.level.cell * self.camera.scale * BLUR * 1.25
        blocks = np.array([blocking for _, _, blocking in kinds])
        lead = self._wall_lead(kinds, start, sharp)
        for group, ahead in ((blocks, lead), (~blocks, -lead)):
            mine = [shares[k] for k in np.flatnonzero(group)]
            best, room = functools.reduce(np.maximum, mine, np.float32(0)), np.minimum(1 + ahead, 1)
            for share in mine:  # the best has 1, or falls behind by its distance from the wall
                near = share > 0
                share -= best
                share += room
                share *= near
        patch(part, shares, inks, np.array(self.theme.outline, np.float64), sharp, self.unit)

    def _wall_lead(self, kinds, start, sharp):
        """How far each pixel of the clip is inside what blocks, in units of `sharp` pixels, -1 to 1."""
        walls = [cells for _, cells, blocking in kinds if blocking]
        if not walls or len(walls) == len(kinds):
            return np.float32(1 if walls else -1)
        return np.clip(self.wall_edge(np.logical_or.reduce(walls), self.level.cell, start) / sharp, -1, 1)

    def wall_edge(self, blocked, cell, start):
        """Blocked cells as animals meet them: signed distance to their border in pixels, inside > 0.

        Cells keep their size but for slightly rounded corners.  Two that touch at a corner are joined, because nobody
        passes between them.  Where a pixel holds several cells it is blocked when one of them is.
        """
        step = shrunk(cell * self.camera.scale)
        if step > 1:
            blocked = any_of(blocked, step)
            cell, start = cell * step, (start[0] // step, start[1] // step)
        fine = 4 if cell * self.camera.scale >= 8 else 2
        parts = joined(blocked, fine)
        level = self.spread(blurred(parts, 0.22 * fine), cell / fine, (start[0] * fine, start[1] * fine), RIM)
        level = level - np.float32(0.5)
        slope = smear(steepness(level), np.array([1, 4, 6, 4, 1]) / 16)
        edge = level / np.maximum(slope, np.float32(0.5 / max(cell * self.camera.scale, 1.0)))
        return edge[RIM:-RIM, RIM:-RIM]

    def _grain(self):
        left, top, right, bottom = self.canvas.clip
        xs = self.camera.metres(np.stack([np.arange(left, right) + 0.5, np.zeros(right - left)], axis=1))[:, 0]
        ys = self.camera.metres(np.stack([np.zeros(bottom - top), np.arange(top, bottom) + 0.5], axis=1))[:, 1]
        light = np.zeros((bottom - top, right - left), np.float32)
        for salt, (pixels, share) in enumerate(((90, 0.45), (22, 0.3), (3.2, 0.45))):
            wavelength = 2.0 ** np.round(np.log2(pixels * self.unit / self.camera.scale))
            light += share * self.theme.texture * grain(xs, ys, wavelength, salt)
        return light

    def _slopes(self):
        """Light from the north-west on the height map, and lines of equal height."""
        heights = getattr(self.level, "height_map", None)
        if heights is None:
            return np.float32(0)
        rows, columns = self.cells(heights.cell, heights.values.shape)
        ground = self.spread(heights.values[rows, columns], heights.cell, (rows.start, columns.start), 1)
        down, across = (side[1:-1, 1:-1] for side in np.gradient(ground))
        steep = np.clip((across + down) * self.camera.scale * 0.7, -1, 1)
        span = float(heights.values.max() - heights.values.min())
        if span <= 0:
            return np.float32(0)
        width, height = (self.camera.view[k + 2] - self.camera.view[k] for k in (0, 1))
        shown = max(width / self.level.width, height / self.level.height) / self.camera.scale
        every = nice(span / 8 * min(shown, 1.0))
        phase = np.abs((ground[1:-1, 1:-1] / every + 0.5) % 1 - 0.5) * every
        slope = np.maximum(np.hypot(across, down), 1e-6)
        contour = np.clip(1.1 - phase / slope / self.unit, 0, 1) * (slope > span * 1e-4)
        return (steep * self.theme.relief - contour * self.theme.relief * 0.35).astype(np.float32)


def shrunk(fine):
    """How many cells of so many pixels are drawn as one."""
    return 1 if fine >= 0.75 else int(np.ceil(1 / fine))


def _between(low, high, cell, step, count):
    """The cells from `low` to `high` metres, in whole steps; at least one."""
    first = min(max(int(np.floor(low / cell)), 0), count - 1) // step * step
    last = max(min(int(np.ceil(high / cell)), count), first + 1)
    return slice(first, min(-(-last // step) * step, count))


def any_of(cells, step):
    """Whether any of a block of step x step cells is set; blocks at the edge may be smaller."""
    height, width = cells.shape
    padded = np.pad(cells, ((0, -height % step), (0, -width % step)))
    return padded.reshape(-(-height // step), step, -(-width // step), step).any(axis=(1, 3))


def joined(cells, fine):
    """Cells as fine x fine parts each, with a bridge where two cells touch at a corner only."""
    parts = np.repeat(np.repeat(cells, fine, axis=0), fine, axis=1)
    a, b, c, d = cells[:-1, :-1], cells[:-1, 1:], cells[1:, :-1], cells[1:, 1:]
    for touching, sides in (((a & d & ~b & ~c), ((-1, 0), (0, -1))), ((b & c & ~a & ~d), ((-1, -1), (0, 0)))):
        iy, ix = np.nonzero(touching)
        for up, right in sides:
            parts[(iy + 1) * fine + up, (ix + 1) * fine + right] = True
    return parts


def blurred(cells, width):
    """Cells smeared over so many cells around them, float32."""
    return smear(np.ascontiguousarray(cells, np.float32), bell(width, 3.0 / width))


def bell(width, reach):
    """Weights of a blur of this width, out to `reach` times it, that add up to 1."""
    far = round(reach * width)
    weights = np.exp(-((np.arange(-far, far + 1) / width) ** 2) / 2)
    return weights / weights.sum()


def nice(value: float) -> float:
    """The largest of 1, 2, 5, 10, 20, 50, ... that is not above the value."""
    if not value > 0:
        return 1.0
    power = 10.0 ** np.floor(np.log10(value))
    return float(max(step * power for step in (1, 2, 5) if step * power <= value * (1 + 1e-9)))

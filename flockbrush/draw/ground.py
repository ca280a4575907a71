"""The picture of a level without its animals: drawn once for each camera and theme, then only copied."""

from __future__ import annotations

import numpy as np

from flockbrush.draw.camera import Camera
from flockbrush.draw.canvas import Canvas, circle, smooth
from flockbrush.draw.shapes import grain
from flockbrush.draw.style import PALETTE, Theme, mix, rgb

BLUR = 1.1  # cells; rounds the corners of painted regions


def brush_key(asset: str) -> str:
    """The name of a brush, from its name or its file."""
    return str(asset).replace("\\", "/").rsplit("/", 1)[-1].removesuffix(".brush.toml")


def paint_ground(level, camera: Camera, theme: Theme, unit: float = 1.0, brushes=None, labels=True) -> np.ndarray:
    """The level as the camera sees it, (h, w, 3) uint8.

    Parameters
    ----------
    level : Level
        Or anything with `width` and `height`; what it lacks is not drawn.
    unit : float
        Pixels of a hairline: 1 at 1280 x 720, more on larger pictures.
    brushes : dict of str to "#rrggbb" or (r, g, b)
        Colours of the brushes painted on the level, by name.
    labels : bool
        Write the names of goals, exits and lines.
    """
    return _Ground(level, camera, theme, unit, brushes or {}, labels).paint()


class _Ground:
    def __init__(self, level, camera, theme, unit, brushes, labels):
        self.level, self.camera, self.theme, self.unit = level, camera, theme, unit
        self.brushes = {brush_key(name): rgb(colour) for name, colour in brushes.items()}
        self.labels, self.taken = labels, []
        width, height = camera.size
        self.image = np.empty((height, width, 3), np.uint8)
        self.image[:] = theme.paper
        left, top = camera.pixels((0, level.height))
        right, bottom = camera.pixels((level.width, 0))
        self.corners = np.array([[left, top], [right, top], [right, bottom], [left, bottom]])
        view = camera.view
        inner = (
            max(view[0], round(left)),
            max(view[1], round(top)),
            min(view[2], round(right)),
            min(view[3], round(bottom)),
        )
        self.canvas = Canvas(self.image, inner if inner[2] > inner[0] and inner[3] > inner[1] else (0, 0, 0, 0))
        self.outside = Canvas(self.image, view)

    def of(self, name):
        """A list of the level's objects, empty when the level has none."""
        return getattr(self.level, name, None) or []

    def paint(self):
        if self.canvas.clip[2] > self.canvas.clip[0]:
            self._terrain()
            self._brushes()
            self._zones()
            self._speeds()
            self._spawns()
            self._areas()
            self._exits()
            self._guides()
            self._obstacles()
            self._goals()
            self._lines()
        self.outside.line(self.corners, 1.4 * self.unit, self.theme.frame, closed=True)
        return self.image

    # ground ----------------------------------------------------------------------

    def spread(self, values, cell):
        """Values of cells [iy, ix] (float32, also with colours) smoothly over the clip's pixels."""
        import cv2

        left, top, right, bottom = self.canvas.clip
        values, fine = np.ascontiguousarray(values, np.float32), cell * self.camera.scale
        if fine < 0.75:
            shrink = int(np.ceil(1 / fine))
            ny, nx = (-(-side // shrink) for side in values.shape[:2])
            pad = [(0, ny * shrink - values.shape[0]), (0, nx * shrink - values.shape[1])] + [(0, 0)] * (
                values.ndim - 2
            )
            values = cv2.resize(np.pad(values, pad, mode="edge"), (nx, ny), interpolation=cv2.INTER_AREA)
            cell, fine = cell * shrink, fine * shrink
        start = self.camera.metres((left + 0.5, top + 0.5)) / cell - 0.5
        back = np.array([[1 / fine, 0, start[0]], [0, -1 / fine, start[1]]])
        flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        return cv2.warpAffine(values, back, (right - left, bottom - top), flags=flags, borderMode=cv2.BORDER_REPLICATE)

    def soft(self, cells, cell):
        """How much of the neighbourhood of each pixel of the clip belongs to a region of cells, 0 to 1.

        Single cells and lines of them have more than their share, so as to be seen.
        """
        soft = blurred(cells, BLUR)
        thin, alone = cells & (soft < 0.4), cells & (soft < 0.2)  # would be smoothed away
        if thin.any():
            soft = np.maximum(soft, 1.9 * blurred(thin & ~alone, 0.7))
            soft[alone] = 1.8
        return self.spread(soft, cell)

    def region(self, cells, cell):
        """A region of cells (bool [iy, ix]) with rounded corners: signed distance to its edge in pixels, inside > 0."""
        import cv2

        level = self.soft(cells, cell) - 0.5
        across, down = cv2.Sobel(level, -1, 1, 0, scale=0.125), cv2.Sobel(level, -1, 0, 1, scale=0.125)
        slope = cv2.GaussianBlur(np.sqrt(across**2 + down**2), (5, 5), 0)
        return level / np.maximum(slope, 0.15 / max(cell * self.camera.scale, 1.0))

    def _kinds(self):
        """Pairs of a colour and the cells [iy, ix] it is on, lowest first."""
        terrain, theme = getattr(self.level, "terrain", None), self.theme
        if terrain is None:
            return
        index = getattr(terrain, "index", None)
        if index is not None and len(getattr(terrain, "colours", ())):
            for k, colour in enumerate(terrain.colours):
                if (index == k).any():
                    yield self.washed(rgb(colour)), index == k
            return
        walkable, factor, blind = terrain.walkable, terrain.speed_factor, terrain.blocks_view
        yield theme.rough, walkable & (factor < 1)
        yield theme.road, walkable & (factor > 1)
        yield theme.water, ~walkable & ~blind
        yield theme.rock, ~walkable & blind

    def washed(self, colour):
        """A designer's colour, calm enough to stand behind animals."""
        grey = (int(0.3 * colour[0] + 0.6 * colour[1] + 0.1 * colour[2]),) * 3
        return mix(mix(mix(colour, grey, 0.2), self.theme.wash, self.theme.wash_share), self.theme.ground, 0.12)

    def _terrain(self):
        left, top, right, bottom = self.canvas.clip
        part = self.image[top:bottom, left:right]
        part[:] = self.theme.ground
        kinds = [(colour, cells) for colour, cells in self._kinds() if cells.any()]
        if kinds:
            part[:] = self._patchwork(kinds)
        light = self._grain() + self._slopes()
        part[:] = np.clip(part * (1 + light[..., None]), 0, 255).astype(np.uint8)

    def _patchwork(self, kinds):
        """Kinds of ground without gaps: each pixel has the kind that most of its neighbourhood has."""
        bare = ~np.logical_or.reduce([cells for _, cells in kinds])
        kinds = [(self.theme.ground, bare), *kinds] if bare.any() else kinds
        left, top, right, bottom = self.canvas.clip
        most, second = np.full((2, bottom - top, right - left), -1, np.float32)
        first, other = np.zeros((2, bottom - top, right - left), np.uint8)
        for k, (_, cells) in enumerate(kinds):
            share = self.soft(cells, self.level.cell)
            wins, follows = share > most, (share > second) & (share <= most)
            second, other = (
                np.where(wins, most, np.where(follows, share, second)),
                np.where(wins, first, np.where(follows, k, other)),
            )
            most, first = np.where(wins, share, most), np.where(wins, k, first)
        lead = np.minimum(most - np.maximum(second, 0), 1)
        edge = lead * self.level.cell * self.camera.scale * BLUR * 1.25
        inks = np.array([colour for colour, _ in kinds], np.float32)
        rim = 0.13 * np.exp(-edge / (2.5 * self.unit)) * (1 - lead)
        ink = inks[other] + (inks[first] - inks[other]) * np.clip(edge + 0.5, 0, 1)[..., None]
        return ink * (1 - rim[..., None]) + np.array(self.theme.outline, np.float32) * rim[..., None] + 0.5

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
        ground = self.spread(heights.values, heights.cell)
        down, across = np.gradient(ground)
        steep = np.clip((across + down) * self.camera.scale * 0.7, -1, 1)
        span = float(ground.max() - ground.min())
        if span <= 0:
            return np.float32(0)
        every = nice(span / 8)
        phase = np.abs((ground / every + 0.5) % 1 - 0.5) * every
        slope = np.maximum(np.hypot(across, down), 1e-6)
        contour = np.clip(1.1 - phase / slope / self.unit, 0, 1) * (slope > span * 1e-4)
        return (steep * self.theme.relief - contour * self.theme.relief * 0.35).astype(np.float32)

    # what is painted -------------------------------------------------------------

    def colour_of(self, asset):
        """The colour of a brush; one of the palette for a brush nobody has told us."""
        key = brush_key(asset)
        if key not in self.brushes:
            self.brushes[key] = rgb(PALETTE[len(self.brushes) % len(PALETTE)])
        return self.brushes[key]

    def _brushes(self):
        for layer in self.of("brush_layers"):
            for k, asset in enumerate(layer.assets):
                cells = np.asarray(layer.index) == k
                if cells.any():
                    self._tint(self.region(cells, self.level.cell), self.colour_of(asset), float(layer.weight))

    def _tint(self, edge, colour, weight):
        """A translucent region, stronger along its edge, with a thin outline."""
        cover = np.clip(edge + 0.5, 0, 1)
        glow = np.exp(-np.clip(edge, 0, 80) / (9 * self.unit))
        line = np.clip(self.unit * 0.9 - np.abs(edge - self.unit * 0.5) + 0.5, 0, 1)
        strength = cover * self.theme.tint * (0.75 + 0.75 * glow) * (0.4 + 0.6 * weight)
        self._lay(np.maximum(strength, line * 0.75), colour)

    def _lay(self, mask, colour):
        """Lay a colour over the clip by a mask of its size."""
        self.canvas.blend(np.ascontiguousarray(mask, np.float32), *self.canvas.clip[:2], colour)

    def _zones(self):
        for zone in self.of("zones"):
            points = self.camera.pixels(zone.polygon)
            brush = getattr(zone, "brush", None)
            colour = self.colour_of(brush) if brush else self.theme.cap
            if brush:
                self.canvas.area(points, colour, self.theme.tint)
            if np.isfinite(zone.max_speed) or zone.factor != 1:
                self._hatch_area(points, self.theme.cap, 0.5)
            self.canvas.line(points, 1.6 * self.unit, colour, 0.95, closed=True, dash=(7 * self.unit, 4 * self.unit))

    def _speeds(self):
        for name, sign, fmt in (("cap", 1, "max {:g} m/s"), ("factor", -1, "speed x {:g}")):
            raster = getattr(self.level, name, None)
            if raster is None:
                continue
            values = np.asarray(raster.values)
            for value in np.unique(values[np.isfinite(values) & (values != 1 if name == "factor" else True)]):
                edge = self.region(values == value, raster.cell)
                line = np.clip(self.unit * 0.6 - np.abs(edge) + 0.5, 0, 1) * 0.8
                self._lay(np.maximum(line, np.clip(edge + 0.5, 0, 1) * self._stripes(sign) * 0.55), self.theme.cap)
                self._label_region(edge, fmt.format(value), self.theme.cap)

    def _stripes(self, sign):
        left, top, right, bottom = self.canvas.clip
        across, every = np.arange(left, right)[None, :] + sign * np.arange(top, bottom)[:, None], 11 * self.unit
        phase = np.abs(across / every % 1 - 0.5) * every / np.sqrt(2)
        return np.clip(self.unit * 0.55 - phase + 0.5, 0, 1)

    def _hatch_area(self, points, colour, alpha):
        found = self.canvas.area_mask(points)
        if found is None:
            return
        mask, left, top = found
        x, y = left - self.canvas.clip[0], top - self.canvas.clip[1]
        stripes = self._stripes(1)[y : y + mask.shape[0], x : x + mask.shape[1]]
        self.canvas.blend(np.ascontiguousarray(mask * stripes, np.float32), left, top, colour, alpha)

    # objects ---------------------------------------------------------------------

    def _spawns(self):
        for spawn in self.of("spawns"):
            points, dash = self.camera.pixels(spawn.polygon), (5 * self.unit, 4 * self.unit)
            self.canvas.line(points, 1.3 * self.unit, self.theme.spawn, 0.8, closed=True, dash=dash)

    def _areas(self):
        for area in self.of("areas"):
            points = self.camera.pixels(area.polygon)
            self.canvas.area(points, self.theme.muted, 0.07)
            self.canvas.line(points, 1.1 * self.unit, self.theme.muted, 0.7, closed=True)
            self.label(area.name, points.mean(axis=0), self.theme.muted)

    def _exits(self):
        for exit_ in self.of("exits"):
            points = self.camera.pixels(exit_.polygon)
            self.canvas.area(points, self.theme.exit, 0.13)
            self._hatch_area(points, self.theme.exit, 0.5)
            self.canvas.line(points, 1.8 * self.unit, self.theme.exit, closed=True)
            self.label(exit_.name or "exit", points.mean(axis=0), self.theme.exit)

    def _obstacles(self):
        import cv2

        obstacles = self.of("obstacles")
        left, top, right, bottom = self.canvas.clip
        shadow = np.zeros((bottom - top, right - left), np.float32)
        shapes = [(obstacle, self.camera.pixels(obstacle.polygon)) for obstacle in obstacles]
        for _, points in shapes:
            found = self.canvas.area_mask(points + (2.5 * self.unit, 3.5 * self.unit))
            if found is not None:
                mask, x, y = found
                part = shadow[y - top : y - top + mask.shape[0], x - left : x - left + mask.shape[1]]
                np.maximum(part, mask, out=part)
        if shapes:
            self._lay(
                cv2.GaussianBlur(shadow, (0, 0), 2.6 * self.unit) * self.theme.shadow_alpha * 1.4, self.theme.shadow
            )
        for obstacle, points in shapes:
            self._obstacle(obstacle, points)

    def _obstacle(self, obstacle, points):
        theme, unit = self.theme, self.unit
        opaque = 0.92 if getattr(obstacle, "blocks_view", True) else 0.30
        found = self.canvas.area_mask(points)
        if found is not None and self._is_large(points):
            opaque *= 0.8  # the terrain under a bank or a cliff is worth seeing
        self.canvas.area(points, theme.obstacle, opaque)
        dash = None if getattr(obstacle, "solid", True) else (4 * unit, 3 * unit)
        self.canvas.line(points, 1.5 * unit, theme.obstacle_edge, 0.9, closed=True, dash=dash)

    def _is_large(self, points):
        x, y = points.T
        area = abs(np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1))) / 2
        return area > 0.04 * self.level.width * self.level.height * self.camera.scale**2

    def _guides(self):
        for guide in self.of("guides"):
            if len(guide.points) < 2:
                continue
            loop = bool(getattr(guide, "loop", False))
            points = self.camera.pixels(guide.points)
            curve = smooth(points, loop)
            swath = min(2 * float(getattr(guide, "radius", 0)) * self.camera.scale, 400 * self.unit)
            self.canvas.line(curve[::2], max(swath, 2), self.theme.guide, 0.07, closed=loop)
            self.canvas.line(curve, 2.2 * self.unit, self.theme.guide, 0.75, closed=loop)
            self._arrows(curve, loop)

    def _arrows(self, curve, loop):
        """Arrowheads along a curve, evenly spaced, the last one at its end."""
        curve = np.vstack([curve, curve[:1]]) if loop else curve
        along = np.concatenate([[0], np.cumsum(np.hypot(*np.diff(curve, axis=0).T))])
        if not 0 < along[-1] < 1e5:
            return
        size = 13 * self.unit
        count = max(1, int(along[-1] / (95 * self.unit)))
        for at in (np.arange(count) + 1) * along[-1] / count - (0 if not loop else along[-1] / count / 2):
            tip, tail = (_along(curve, along, max(where, 0)) for where in (at, at - size))
            self.canvas.arrowhead(tip, tip - tail, size, self.theme.guide, 0.95)

    def _goals(self):
        for goal in self.of("goals"):
            centre, colour = self.camera.pixels(goal.xy), self.theme.goal
            radius = goal.radius * self.camera.scale
            polygon = getattr(goal, "polygon", None)
            border = circle(centre, radius) if polygon is None else self.camera.pixels(polygon)
            self.canvas.area(border, colour, 0.10)
            self.canvas.line(border, 1.8 * self.unit, colour, 0.9, closed=True)
            self._flag(centre, colour)
            self.label(goal.name, centre + (0, 13 * self.unit), colour)

    def _flag(self, foot, colour):
        u = self.unit
        self.canvas.disc(foot, 2.2 * u, colour)
        self.canvas.line([foot, foot - (0, 19 * u)], 1.8 * u, colour)
        cloth = foot + np.array([[0.5, -19], [13, -15], [0.5, -10.5]]) * u
        self.canvas.area(cloth, colour)

    def _lines(self):
        for line in self.of("lines"):
            points, u = self.camera.pixels(line.points), self.unit
            self.canvas.line(points, 1.5 * u, self.theme.muted, 0.85, dash=(9 * u, 3 * u))
            for end, other in ((points[0], points[1]), (points[-1], points[-2])):
                way = (other - end) / max(float(np.hypot(*(other - end))), 1e-9) * 5 * u
                self.canvas.line([end + (-way[1], way[0]), end + (way[1], -way[0])], 1.5 * u, self.theme.muted, 0.9)
            self.label(line.name, points.mean(axis=0), self.theme.muted)

    # words -----------------------------------------------------------------------

    def _label_region(self, edge, text, colour):
        """Write in the widest part of a region given by the distance to its edge."""
        import cv2

        inside = (edge > 0).astype(np.uint8)
        if inside.any():
            deep = cv2.distanceTransform(inside, cv2.DIST_L2, 3)
            heart = np.argwhere(deep > 0.95 * deep.max())
            row, col = heart[np.argmin(np.abs(heart - heart.mean(axis=0)).sum(axis=1))]
            self.label(text, (col + self.canvas.clip[0], row + self.canvas.clip[1]), colour)

    def label(self, text, at, colour):
        """Write a small name near a point, unless it would lie on another one or does not fit."""
        if not (self.labels and text):
            return
        from flockbrush.draw.text import words

        height = max(10, round(12 * self.unit))
        tall, wide = words(str(text)[:40], height).shape
        left, top, right, bottom = self.canvas.clip
        if wide + 8 > right - left or not (left <= at[0] <= right and top <= at[1] <= bottom):
            return
        x = min(max(at[0] - wide / 2, left + 4), right - wide - 4)
        y = min(max(at[1] - tall / 2, top + 3), bottom - tall - 3)
        box = (x - 3, y - 2, x + wide + 3, y + tall + 2)
        if any(box[0] < b[2] and b[0] < box[2] and box[1] < b[3] and b[1] < box[3] for b in self.taken):
            return
        self.taken.append(box)
        ink = mix(colour, self.theme.ink, 0.45)
        self.canvas.words(str(text)[:40], (x, y), height, ink, 0.95, halo=self.theme.paper)


def blurred(cells, width):
    """Cells smeared over so many cells around them, float32."""
    import cv2

    return cv2.GaussianBlur(np.asarray(cells, np.float32), (7, 7), width, borderType=cv2.BORDER_REPLICATE)


def _along(curve, along, at):
    return np.array([np.interp(at, along, curve[:, 0]), np.interp(at, along, curve[:, 1])])


def nice(value: float) -> float:
    """The largest of 1, 2, 5, 10, 20, 50, ... that is not above the value."""
    if not value > 0:
        return 1.0
    power = 10.0 ** np.floor(np.log10(value))
    return float(max(step * power for step in (1, 2, 5) if step * power <= value * (1 + 1e-9)))

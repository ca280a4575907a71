"""What a level looks like without its animals, in any box of the picture."""

from __future__ import annotations

import numpy as np

from flockbrush.engine.seam import with_images, wrap_of
from flockbrush.levels.geometry import sign_of
from flockbrush.render.brush_marks import cover as pattern_cover
from flockbrush.render.brush_marks import ink_of, pattern_of
from flockbrush.render.canvas import Canvas, circle, dashes, smooth
from flockbrush.render.drawn_art import draw_art
from flockbrush.render.drawn_terrain import TerrainSketch, bell
from flockbrush.render.shapes import cover_polygon, smear
from flockbrush.render.style import PALETTE, rgb
from flockbrush.render.text import words

# of things that reach over borders, the field with their outline
OUTLINES = {"exits": "polygon", "zones": "polygon", "areas": "polygon", "lines": "points", "obstacles": "polygon"}
SIGNS = 0.45  # opacity of the patterns of brushes
SAMPLES = 128  # cells across, of those looked at for the place of a name


def brush_key(asset: str) -> str:
    """The name of a brush, from its name or its file."""
    return str(asset).replace("\\", "/").rsplit("/", 1)[-1].removesuffix(".brush.toml")


class Sketcher(TerrainSketch):
    """Draws any box of a level's picture, the same pixels whichever box they are drawn in.

    Nothing here depends on the box but what is cut off: a part drawn anew fits what was drawn before.
    """

    def __init__(self, level, camera, theme, unit, brushes, image, known=None):
        self.level, self.camera, self.theme, self.unit = level, camera, theme, unit
        self.brushes, self.image = brushes, image
        self._known: dict = {} if known is None else known  # what has been worked out for this camera
        left, top = camera.pixels((0, level.height))
        right, bottom = camera.pixels((level.width, 0))
        self.corners = np.array([[left, top], [right, top], [right, bottom], [left, bottom]])
        view = camera.view
        self.inner = (
            max(view[0], round(left)),
            max(view[1], round(top)),
            min(view[2], round(right)),
            min(view[3], round(bottom)),
        )
        self.aim((0, 0, 0, 0))

    def aim(self, box):
        """Draw in this box (left, top, right, bottom; pixels) from now on."""
        self.outside = Canvas(self.image, _common(box, self.camera.view))
        self.canvas = Canvas(self.image, _common(box, self.inner))

    def of(self, name):
        """A list of the level's objects, empty when the level has none; what reaches over a border goes on there."""
        things, outline = getattr(self.level, name, None) or [], OUTLINES.get(name)
        wrap = wrap_of(self.level)
        return things if outline is None or wrap is None else [one for one, _ in with_images(things, wrap, outline)]

    def paint(self, box):
        """Draw everything inside the box anew, but for the names."""
        self.aim(box)
        left, top, right, bottom = self.outside.clip
        self.image[top:bottom, left:right] = self.theme.paper
        if self.canvas.clip[2] > self.canvas.clip[0]:
            self._terrain()
            draw_art(self)
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

    # what is painted -------------------------------------------------------------

    def colour_of(self, asset):
        """The colour of a brush; one of the palette for an unknown brush."""
        key = brush_key(asset)
        if key not in self.brushes:
            self.brushes[key] = rgb(PALETTE[len(self.brushes) % len(PALETTE)])
        return self.brushes[key]

    def _brushes(self):
        for layer in self.of("brush_layers"):
            rows, columns = self.cells(self.level.cell, layer.index.shape)
            index = np.asarray(layer.index[rows, columns])
            for k in np.unique(index[index >= 0]):
                edge = self.region(index == k, self.level.cell, (rows.start, columns.start))
                self._tint(edge, brush_key(layer.assets[k]), float(layer.weight))

    def _tint(self, edge, brush, weight):
        """A translucent region with the pattern of its brush, stronger along its edge, with a thin outline."""
        colour = self.colour_of(brush)
        cover = np.clip(edge + 0.5, 0, 1)
        glow = np.exp(-np.clip(edge, 0, 80) / (9 * self.unit))
        line = np.clip(self.unit * 0.9 - np.abs(edge - self.unit * 0.5) + 0.5, 0, 1)
        strength = cover * self.theme.tint * (0.75 + 0.75 * glow) * (0.4 + 0.6 * weight)
        self._lay(strength, colour)
        self._lay(np.maximum(line, self.pattern(brush) * cover * SIGNS), ink_of(colour, self.theme))

    def pattern(self, brush):
        """Cover of a brush's pattern over the clip, which stays where it is on the ground."""
        left, top, right, bottom = self.canvas.clip
        x, y = np.arange(left, right) - self.corners[0][0], np.arange(top, bottom) - self.corners[0][1]
        return pattern_cover(pattern_of(brush, self.colour_of(brush)), x[None, :], y[:, None], self.unit)

    def _lay(self, mask, colour):
        """Lay a colour over the clip by a mask of its size."""
        self.canvas.blend(np.ascontiguousarray(mask, np.float32), *self.canvas.clip[:2], colour)

    def _zones(self):
        for zone, points in self.shapes("zones"):
            brush = getattr(zone, "brush", None)
            colour = self.colour_of(brush) if brush else self.theme.cap
            if brush:
                self.canvas.area(points, colour, self.theme.tint)
                self._sign_area(points, self.pattern(brush_key(brush)), ink_of(colour, self.theme), SIGNS)
            if np.isfinite(zone.max_speed) or zone.factor != 1:
                self._hatch_area(points, self.theme.cap, 0.5)
            self._dashed(zone, points, 1.6 * self.unit, colour, 0.95, (7 * self.unit, 4 * self.unit), closed=True)

    def _speeds(self):
        for name, sign in (("cap", 1), ("factor", -1)):
            raster = getattr(self.level, name, None)
            if raster is None:
                continue
            rows, columns = self.cells(raster.cell, raster.values.shape)
            values = np.asarray(raster.values[rows, columns])
            for value in np.unique(values[said(name, values)]):
                edge = self.region(values == value, raster.cell, (rows.start, columns.start))
                line = np.clip(self.unit * 0.6 - np.abs(edge) + 0.5, 0, 1) * 0.8
                self._lay(np.maximum(line, np.clip(edge + 0.5, 0, 1) * self.stripes(sign) * 0.55), self.theme.cap)

    def stripes(self, sign):
        """Cover of slanting stripes over the clip, which stay where they are on the ground."""
        left, top, right, bottom = self.canvas.clip
        x, y = self.corners[0]
        across = np.arange(left, right)[None, :] - x + sign * (np.arange(top, bottom)[:, None] - y)
        every = 11 * self.unit
        phase = np.abs(across / every % 1 - 0.5) * every / np.sqrt(2)
        return np.clip(self.unit * 0.55 - phase + 0.5, 0, 1)

    def _hatch_area(self, points, colour, alpha):
        self._sign_area(points, self.stripes(1), colour, alpha)

    def _sign_area(self, points, signs, colour, alpha):
        """Lay signs, a cover of the whole clip, over an area."""
        area = self.canvas.area_mask(points)
        if area is None:
            return
        mask, left, top = area
        x, y = left - self.canvas.clip[0], top - self.canvas.clip[1]
        signs = signs[y : y + mask.shape[0], x : x + mask.shape[1]]
        self.canvas.blend(np.ascontiguousarray(mask * signs, np.float32), left, top, colour, alpha)

    # objects ---------------------------------------------------------------------

    def shapes(self, name, far=12.0):
        """(object, its outline in pixels) of the level's objects of a kind that come near the clip."""
        left, top, right, bottom = self.canvas.clip
        far = far * self.unit
        for thing in self.of(name):
            points = self.outline(thing)
            low, high = points.min(axis=0) - far, points.max(axis=0) + far
            if low[0] < right and low[1] < bottom and high[0] > left and high[1] > top:
                yield thing, points

    def once(self, what, thing, points, work):
        """What `work()` gives for an object, worked out once for each camera and as long as its points are the same."""
        key = what, id(thing)
        if key not in self._known or self._known[key][0] is not points:
            self._known[key] = points, work()
        return self._known[key][1]

    def outline(self, thing):
        """The points of an object in pixels."""
        points = getattr(thing, "polygon", None)
        points = thing.points if points is None else points
        return self.once("outline", thing, points, lambda: self.camera.pixels(points))

    def _dashed(self, thing, points, width, colour, alpha, dash, closed=False):
        """Draw a dashed line through an object's outline."""
        whole = np.vstack([points, points[:1]]) if closed else points
        segments = self.once(("dashes", dash), thing, points, lambda: dashes(whole, *dash))
        self.canvas.segments(segments, width, colour, alpha)

    def _spawns(self):
        for spawn, points in self.shapes("spawns"):
            dash = (5 * self.unit, 4 * self.unit)
            self._dashed(spawn, points, 1.3 * self.unit, self.theme.spawn, 0.8, dash, closed=True)

    def _areas(self):
        for _, points in self.shapes("areas"):
            self.canvas.area(points, self.theme.muted, 0.07)
            self.canvas.line(points, 1.1 * self.unit, self.theme.muted, 0.7, closed=True)

    def _exits(self):
        for _, points in self.shapes("exits"):
            self.canvas.area(points, self.theme.exit, 0.13)
            self._hatch_area(points, self.theme.exit, 0.5)
            self.canvas.line(points, 1.8 * self.unit, self.theme.exit, closed=True)

    def _obstacles(self):
        shapes = list(self.shapes("obstacles"))
        if shapes:
            self._shadows([points + (2.5 * self.unit, 3.5 * self.unit) for _, points in shapes])
        for obstacle, points in shapes:
            self._obstacle(obstacle, points)

    def _shadows(self, shapes):
        """Soft shadows of outlines."""
        left, top, right, bottom = self.canvas.clip
        blur = bell(2.6 * self.unit, 3.0)
        far = len(blur) // 2
        left, top, wide, tall = left - far, top - far, right - left + 2 * far, bottom - top + 2 * far
        shadow = np.zeros((tall, wide), np.float32)
        for points in shapes:
            np.maximum(shadow, cover_polygon(np.ascontiguousarray(points), left, top, wide, tall), out=shadow)
        self._lay(smear(shadow, blur)[far:-far, far:-far] * self.theme.shadow_alpha * 1.4, self.theme.shadow)

    def _obstacle(self, obstacle, points):
        theme, unit = self.theme, self.unit
        seen_through = not getattr(obstacle, "blocks_view", True) or not getattr(obstacle, "on_the_ground", True)
        opaque = 0.30 if seen_through else 0.92  # animals pass below what hangs above the ground
        mask = self.canvas.area_mask(points)
        if mask is not None and self._is_large(points):
            opaque *= 0.8  # the terrain under a bank or a cliff is worth seeing
        self.canvas.area(points, theme.obstacle, opaque)
        bars = getattr(obstacle, "solid", True) and getattr(obstacle, "on_the_ground", True)
        dash = None if bars else (4 * unit, 3 * unit)
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
            curve = self._curve(guide, loop)
            swath = max(min(2 * float(getattr(guide, "radius", 0)) * self.camera.scale, 400 * self.unit), 2)
            self.canvas.line(curve[::2], swath, self.theme.guide, 0.07, closed=loop)
            self.canvas.line(curve, 2.2 * self.unit, self.theme.guide, 0.75, closed=loop)
            self._heads(guide, curve, loop)

    def _heads(self, guide, curve, loop):
        """The arrowheads of a guide that come near the clip."""
        left, top, right, bottom = self.canvas.clip
        size = 13 * self.unit
        for tip, along in self.once("arrows", guide, guide.points, lambda: self._arrows(curve, loop)):
            if left - size < tip[0] < right + size and top - size < tip[1] < bottom + size:
                self.canvas.arrowhead(tip, along, size, self.theme.guide, 0.95)

    def _curve(self, guide, loop):
        return self.once("curve", guide, guide.points, lambda: smooth(self.outline(guide), loop))

    def _arrows(self, curve, loop):
        """[(tip, direction)] of arrowheads along a curve, evenly spaced, the last one at its end."""
        curve = np.vstack([curve, curve[:1]]) if loop else curve
        along = np.concatenate([[0], np.cumsum(np.hypot(*np.diff(curve, axis=0).T))])
        if not 0 < along[-1] < 1e5:
            return []
        size, count = 13 * self.unit, max(1, int(along[-1] / (95 * self.unit)))
        arrows = []
        for at in (np.arange(count) + 1) * along[-1] / count - (0 if not loop else along[-1] / count / 2):
            tip, tail = (_along(curve, along, max(where, 0)) for where in (at, at - size))
            arrows.append((tip, tip - tail))
        return arrows

    def _goals(self):
        for goal in self.of("goals"):
            centre, colour = self._spot(goal), self.theme.goal
            area = getattr(goal, "polygon", None) is not None
            border = self.outline(goal) if area else circle(centre, goal.radius * self.camera.scale)
            self.canvas.area(border, colour, 0.10)
            self.canvas.line(border, 1.8 * self.unit, colour, 0.9, closed=True)
            self._flag(centre, colour)

    def _spot(self, goal):
        """The pixel of a goal's flag."""
        return self.camera.pixels(sign_of(goal))

    def _flag(self, foot, colour):
        u = self.unit
        self.canvas.disc(foot, 2.2 * u, colour)
        self.canvas.line([foot, foot - (0, 19 * u)], 1.8 * u, colour)
        cloth = foot + np.array([[0.5, -19], [13, -15], [0.5, -10.5]]) * u
        self.canvas.area(cloth, colour)

    def _lines(self):
        for line, points in self.shapes("lines"):
            u = self.unit
            self._dashed(line, points, 1.5 * u, self.theme.muted, 0.85, (9 * u, 3 * u))
            for end, other in ((points[0], points[1]), (points[-1], points[-2])):
                way = (other - end) / max(float(np.hypot(*(other - end))), 1e-9) * 5 * u
                self.canvas.line([end + (-way[1], way[0]), end + (way[1], -way[0])], 1.5 * u, self.theme.muted, 0.9)

    # names -----------------------------------------------------------------------

    def names(self):
        """(text, where in pixels, colour) of everything that has a name, in the order in which they get their room."""
        theme = self.theme
        for goal in self.of("goals"):
            yield goal.name, self._spot(goal) + (0, 13 * self.unit), theme.goal
        for exit_ in self.of("exits"):
            yield exit_.name or "exit", self.outline(exit_).mean(axis=0), theme.exit
        for line in self.of("lines"):
            points = self.outline(line)
            wide, high = np.ptp(points, axis=0)
            below = 12 * self.unit if wide > high else 0.0  # a short one would be hidden
            yield line.name, points.mean(axis=0) + (0, below), theme.muted
        for area in self.of("areas"):
            yield area.name, self.outline(area).mean(axis=0), theme.muted
        for name, fmt in (("cap", "max {:g} m/s"), ("factor", "speed x {:g}")):
            raster = getattr(self.level, name, None)
            if raster is not None:
                for value, at in self._hearts(name, raster):
                    yield fmt.format(value), at, theme.cap

    def _hearts(self, name, raster):
        """(value, the pixel farthest from its region's edge) of every value painted in the view.

        Looks at no more than some thousand cells, however large the map.
        """
        import cv2

        left, top, right, bottom = self.inner
        west, south = self.camera.metres((left, bottom)) / raster.cell
        east, north = self.camera.metres((right, top)) / raster.cell
        ny, nx = raster.values.shape
        rows, columns = (
            slice(max(int(south), 0), min(int(north) + 1, ny)),
            slice(max(int(west), 0), min(int(east) + 1, nx)),
        )
        step = max(1, -(-max(rows.stop - rows.start, columns.stop - columns.start) // SAMPLES))
        values = np.asarray(raster.values[rows.start : rows.stop : step, columns.start : columns.stop : step])
        for value in np.unique(values[said(name, values)]):
            inside = np.pad(values == value, 1).astype(np.uint8)
            deep = cv2.distanceTransform(inside, cv2.DIST_L2, 3)[1:-1, 1:-1]
            heart = np.argwhere(deep > 0.95 * deep.max())
            iy, ix = heart[np.argmin(np.abs(heart - heart.mean(axis=0)).sum(axis=1))]
            at = (np.array([columns.start + ix * step, rows.start + iy * step]) + 0.5) * raster.cell
            yield value, self.camera.pixels(at)


def said(name, values):
    """Which of these caps or factors say anything."""
    return np.isfinite(values) & (values != 1) if name == "factor" else np.isfinite(values)


def placed(names, clip, height):
    """[(text, x, y, colour)] of those names that fit into the clip and lie on no other, in their order."""
    left, top, right, bottom = clip
    occupied: list[tuple] = []
    places = []
    for text, at, colour in names:
        text = str(text or "")[:40]
        tall, wide = words(text, height).shape
        if not wide or wide + 8 > right - left or not (left <= at[0] <= right and top <= at[1] <= bottom):
            continue
        x = min(max(at[0] - wide / 2, left + 4), right - wide - 4)
        y = min(max(at[1] - tall / 2, top + 3), bottom - tall - 3)
        box = (x - 3, y - 2, x + wide + 3, y + tall + 2)
        if not any(box[0] < b[2] and b[0] < box[2] and box[1] < b[3] and b[1] < box[3] for b in occupied):
            occupied.append(box)
            places.append((text, round(x), round(y), colour))
    return places


def _common(box, other):
    """The part that two boxes share; empty when there is none."""
    left, top, right, bottom = (
        max(box[0], other[0]),
        max(box[1], other[1]),
        min(box[2], other[2]),
        min(box[3], other[3]),
    )
    return (left, top, right, bottom) if right > left and bottom > top else (left, top, left, top)


def _along(curve, along, at):
    return np.array([np.interp(at, along, curve[:, 0]), np.interp(at, along, curve[:, 1])])

"""The picture of a level without its animals, kept tile by tile: what has changed is drawn anew, the rest stays."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np

from flockbrush.render.canvas import Canvas
from flockbrush.render.drawn_ground import Sketcher, placed
from flockbrush.render.style import Theme, mix
from flockbrush.render.view_camera import ViewCamera

TILE = 128  # pixels
SPILL = 16.0  # pixels of a hairline of 1 by which things are drawn beyond their place: flags, arrowheads, shadows
_WHOLE = 1e-3  # pixels; a camera that moved by a whole number of them but for so much needs no new tiles


class Tiles:
    """The ground under a camera.

    Every box is drawn with the very pixels it has in the whole, so that a picture mended in one place is the one that a
    new drawing gives.  Names lie above all tiles and are laid on a copy.
    """

    def __init__(self, level, theme: Theme, unit: float = 1.0, brushes: dict | None = None, labels=True):
        self.level, self.theme, self.unit, self.labels = level, theme, unit, labels
        self.brushes = {} if brushes is None else brushes  # shared: colours may become known later
        self.camera: ViewCamera | None = None
        self.stale: dict[tuple, tuple] = {}  # tile -> box
        self.named: list[tuple] = []
        self._known: dict = {}
        # (h, w, 3) uint8; the picture; parts that are stale show what was there before. Shared, do not write to it.
        self.image: np.ndarray
        self._bare: np.ndarray  # without names

    # where tiles are ---------------------------------------------------------------

    def look(self, camera: ViewCamera):
        """Look at another part: shows at once what is known of it, however coarse, and leaves the rest to `refine`."""
        if camera == self.camera:
            return
        old, self.camera = self.camera, camera
        self._known = {}
        width, height = camera.size
        before = getattr(self, "_bare", None)
        self._bare = np.empty((height, width, 3), np.uint8)
        self._bare[:] = self.theme.paper
        west, east = (np.clip(camera.pixels((x, 0))[0], 0, width).astype(int) for x in (0, self.level.width))
        south, north = (np.clip(camera.pixels((0, y))[1], 0, height).astype(int) for y in (0, self.level.height))
        self._bare[north:south, west:east] = self.theme.ground  # until it is drawn
        fresh = set()
        if old is not None:
            fresh = self._take_over(before, old)
        if not fresh:
            self._anchor = np.floor(camera.pixels((0, self.level.height)) + 0.317).astype(int)
        self.stale = {tile: box for tile, box in self._tiles(camera.view) if tile not in fresh}
        self._sketch()
        self._name()
        self._compose(camera.view)

    def _take_over(self, before, old):
        """Bring what was drawn to where it is now; returns the tiles that are as good as new."""
        new = self.camera
        same = replace(old, centre=new.centre) == new
        corner = new.pixels((0, self.level.height)) - old.pixels((0, self.level.height))
        step = np.rint(corner).astype(int)
        if not same or np.abs(corner - step).max() > _WHOLE:
            self._warp(before, old)
            return set()
        view, (right, down) = new.view, (int(step[0]), int(step[1]))
        seen = (
            max(view[0], view[0] + right), max(view[1], view[1] + down),
            min(view[2], view[2] + right), min(view[3], view[3] + down),
        )  # fmt: skip
        if seen[2] <= seen[0] or seen[3] <= seen[1]:
            return set()
        source = before[seen[1] - down : seen[3] - down, seen[0] - right : seen[2] - right]
        self._bare[seen[1] : seen[3], seen[0] : seen[2]] = source
        self._anchor = self._anchor + step
        known = {tile for tile, box in self._tiles(seen) if tile not in self.stale}
        return {tile for tile, box in self._tiles(view) if tile in known and _within(box, seen)}

    def _warp(self, before, old):
        import cv2

        new, view = self.camera, self.camera.view
        corner, step = old.pixels(new.metres((0, 0))), old.scale / new.scale
        back = np.array([[step, 0, corner[0] + step / 2 - 0.5], [0, step, corner[1] + step / 2 - 0.5]])
        left, top, right, bottom = old.view
        before_part = np.ascontiguousarray(before[top:bottom, left:right])
        back[:, 2] -= (left, top)
        flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        border = tuple(int(c) for c in self.theme.paper)
        image = cv2.warpAffine(
            before_part, back, new.size, flags=flags, borderMode=cv2.BORDER_CONSTANT, borderValue=border
        )
        self._bare[view[1] : view[3], view[0] : view[2]] = image[view[1] : view[3], view[0] : view[2]]

    def _tiles(self, box):
        """((column, row), box cut off by the view) of every tile that touches a box of pixels."""
        view = self.camera.view
        box = (max(box[0], view[0]), max(box[1], view[1]), min(box[2], view[2]), min(box[3], view[3]))
        x, y = self._anchor
        for row in range((box[1] - y) // TILE, -(-(box[3] - y) // TILE)):
            for column in range((box[0] - x) // TILE, -(-(box[2] - x) // TILE)):
                left, top = x + column * TILE, y + row * TILE
                yield (
                    (int(column), int(row)),
                    (
                        int(max(left, view[0])), int(max(top, view[1])),
                        int(min(left + TILE, view[2])), int(min(top + TILE, view[3])),
                    ),
                )  # fmt: skip

    # drawing -----------------------------------------------------------------------

    def _sketch(self):
        arguments = (self.level, self.camera, self.theme, self.unit, self.brushes, self._bare)
        self._sketcher = Sketcher(*arguments, self._known)

    def repaint(self, box):
        """Draw a box of the level anew: (west, south, east, north) in metres, or "all" to have it done by `refine`."""
        self._sketch()
        if isinstance(box, str):
            self.stale = dict(self._tiles(self.camera.view))
            self._name()
            return
        low, high = self.camera.pixels((box[0], box[3])), self.camera.pixels((box[2], box[1]))
        far = SPILL * self.unit + 4 * getattr(self.level, "cell", 1.0) * self.camera.scale  # cells are rounded off
        left, top, right, bottom = self.camera.view
        low = np.maximum(np.floor(low - far), (left, top)).astype(int)
        high = np.minimum(np.ceil(high + far), (right, bottom)).astype(int)
        self._name()
        if (high > low).all():
            part = (int(low[0]), int(low[1]), int(high[0]), int(high[1]))
            self._sketcher.paint(part)
            self._compose(part)

    def refine(self, budget: float) -> bool:
        """Draw stale tiles, those in the middle first, for about so many seconds; whether none is left."""
        end = time.perf_counter() + budget
        if self.camera is None:
            return True
        middle = np.array(self.camera.middle)
        order = sorted(self.stale.items(), key=lambda tile: np.abs(np.array(tile[1]).reshape(2, 2) - middle).sum())
        for tile, box in order:
            self._draw(tile, box)
            if time.perf_counter() >= end:
                break
        return not self.stale

    def complete(self):
        """Draw whatever is stale."""
        if self.stale and self.camera is not None:
            self.stale = {}
            self._sketcher.paint(self.camera.view)
            self._compose(self.camera.view)

    def _draw(self, tile, box):
        self.stale.pop(tile, None)
        self._sketcher.paint(box)
        self._compose(box)

    # names --------------------------------------------------------------------------

    def _name(self):
        """Find the places of all names, and draw anew where one came, went or moved."""
        if not self.labels:
            return
        height = max(10, round(12 * self.unit))
        inner = self._sketcher.inner
        clip = inner if inner[2] > inner[0] and inner[3] > inner[1] else (0, 0, 0, 0)
        labels = placed(self._sketcher.names(), clip, height)
        changed = [name for name in [*self.named, *labels] if (name in self.named) != (name in labels)]
        self.named = labels
        if hasattr(self, "image") and self.image.shape == self._bare.shape:
            for name in changed:
                self._compose(_label_box(name, height))

    def _compose(self, box):
        """Lay the names over the part of the picture in this box."""
        if not hasattr(self, "image") or self.image.shape != self._bare.shape:
            self.image = self._bare.copy()
        left, top, right, bottom = (max(0, int(side)) for side in box)
        self.image[top:bottom, left:right] = self._bare[top:bottom, left:right]
        height = max(10, round(12 * self.unit))
        inner = self._sketcher.inner
        clip = (max(left, inner[0]), max(top, inner[1]), min(right, inner[2]), min(bottom, inner[3]))
        if clip[2] <= clip[0] or clip[3] <= clip[1]:
            return
        canvas = Canvas(self.image, clip)
        for name in self.named:
            text, x, y, colour = name
            part = _label_box(name, height)
            if part[0] < right and part[1] < bottom and part[2] > left and part[3] > top:
                ink = mix(colour, self.theme.ink, 0.45)
                canvas.words(text, (x, y), height, ink, 0.95, halo=self.theme.paper)


def _label_box(name, height):
    from flockbrush.render.text import words

    tall, wide = words(name[0], height).shape
    return name[1] - 6, name[2] - 6, name[1] + wide + 6, name[2] + tall + 6


def _within(box, other):
    return box[0] >= other[0] and box[1] >= other[1] and box[2] <= other[2] and box[3] <= other[3]

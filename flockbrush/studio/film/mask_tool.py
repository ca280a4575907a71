"""The mode to paint masks of obstacles and regions over a clip."""

from __future__ import annotations

import cv2
import numpy as np
import pygame

from flockbrush.film.camera_maps import back, moved_by
from flockbrush.film.clip_layers import OBSTACLE, REGIONS, MaskLayer, fill, stroke
from flockbrush.studio.film.mode import Mode
from flockbrush.studio.theme import px
from flockbrush.studio.widgets import chosen, enabled

TOOLS = ("brush", "erase", "fill")
WALL = (176, 48, 32)  # what obstacles are painted in on the screen
SEEN = 0.42  # opacity
SIZES = (2.0, 160.0)  # pixels of the film


class PaintMode(Mode):
    """Paints a mask, which belongs to the first used frame and moves with the landmarks."""

    name = "mask"
    title = "Mask"

    def __init__(self, window):
        super().__init__(window)
        self.layer, self.region, self.tool = "obstacles", 1, "brush"
        self.radius = max(SIZES[0], 0.02 * min(window.film.size))
        self.array = None  # the layer while a stroke is painted, (h, w) uint8
        self._last = None

    @property
    def hint(self):
        """What the mouse does, or why it does nothing where the place of the mask is unknown."""
        if self._to_first() is None:
            return self._unknown()
        how = "Drag: paint   Right click: fill   B, E, F: brush, eraser, fill   [ ]: size   Wheel: zoom"
        still = f"The mask belongs to frame {self._first()}; without landmarks the camera is taken to stand still   "
        return how if self.state.marks.landmarks or self.window.k == self._first() else still + how

    def fill(self, column):
        self.layers = column.pair(
            ("Obstacles", lambda: self.take_layer("obstacles"), "Areas where animals cannot walk: trees, water, walls"),
            ("Regions", lambda: self.take_layer("regions"), "One brush is learned from each colour"),
        )
        self.swatches = column.swatches(REGIONS, self.take_region) if self.layer == "regions" else []
        self.tools = column.pair(
            ("Brush", lambda: self.take_tool("brush"), "B"),
            ("Erase", lambda: self.take_tool("erase"), "E"),
            ("Fill", lambda: self.take_tool("fill"), "Fill a connected area (F): draw its outline, then fill it"),
        )
        self.size = column.slider(
            "Size", 2 * self.radius, *SIZES, lambda v: f"{v:.0f} px", self.set_size, power=True, tip="[ and ]"
        )
        self.gone = column.button("Clear", self.clear, "Remove all paint of this layer")
        self.share = column.line()
        column.note(
            "The mask belongs to the first frame that is used. In other frames it is shown where the landmarks say that"
            " it has moved."
            if self.layer == "obstacles"
            else "Animals in each colour are learned apart. What is not painted belongs to none."
        )

    def freshen(self):
        chosen(self.layers, ("obstacles", "regions").index(self.layer))
        chosen(self.tools, TOOLS.index(self.tool))
        chosen(self.swatches, self.region - 1)
        if self.array is None:
            layer = getattr(self.state, self.layer)
            self.share.say(f"{100 * layer.share:.1f} % of the picture is painted")
            enabled(self.gone, not layer.blank)
        self.size.set(2 * self.radius)

    # choices ------------------------------------------------------------------------------

    def take_layer(self, name):
        """Paint obstacles or regions."""
        self.layer = name
        self.window.rebuild_column()

    def take_region(self, number):
        """Paint with another colour."""
        self.region, self.tool = number, "brush" if self.tool == "erase" else self.tool

    def take_tool(self, name):
        """Brush, eraser or fill."""
        self.tool = name

    def set_size(self, size):
        """Width of the stroke, pixels of the film."""
        self.radius = float(np.clip(size, *SIZES)) / 2

    def clear(self):
        """Take all paint of this layer away."""
        self.edit(f"{self.layer} cleared", **{self.layer: MaskLayer.empty(self.window.film.size)})

    def keys(self):
        tools = {tool[0]: lambda tool=tool: self.take_tool(tool) for tool in TOOLS}
        sizes = {"[": lambda: self.set_size(1.6 * self.radius), "]": lambda: self.set_size(2.5 * self.radius)}
        return tools | sizes

    # painting -----------------------------------------------------------------------------

    def _array(self):
        return getattr(self.state, self.layer).array if self.array is None else self.array

    def _first(self):
        return self.state.marks.first or 0

    def _to_first(self):
        """The motion from this frame to the one that the mask belongs to, (2, 3); None where it is not known."""
        return self.window.ground.motion(self.window.k, self._first())

    def _unknown(self):
        """Why the motion is not known."""
        marks, first = self.state.marks.landmarks, self._first()
        if any(self.window.ground.waits_for(mark) for mark in marks):
            return f"The landmarks are still being followed; until then, paint in frame {first}"
        return f"No landmark is found both here and in frame {first}, to which the mask belongs; paint in another frame"

    def _there(self, place):
        """The place in the frame that the mask belongs to; None, with a message, if unknown."""
        matrix = self._to_first()
        if matrix is None:
            self.window.toasts.say(self._unknown(), "warning")
            return None
        return moved_by(matrix, place)

    def _value(self):
        return 0 if self.tool == "erase" else OBSTACLE if self.layer == "obstacles" else self.region

    def press(self, place, at):
        self._last = self._there(place)
        if self._last is None:
            return False
        self.array = self._array().copy()
        if self.tool == "fill":
            fill(self.array, self._last, self._value())
        else:
            stroke(self.array, self._last, self._last, self.radius, self._value())
        return True

    def drag(self, place, at):
        there = self._there(place) if self.array is not None and self.tool != "fill" else None
        if there is not None:
            stroke(self.array, self._last, there, self.radius, self._value())
            self._last = there

    def release(self, place, at):
        array, self.array = self.array, None
        if array is not None and not np.array_equal(array, self._array()):
            what = {"brush": "painted", "erase": "erased", "fill": "filled"}[self.tool]
            self.edit(f"{self.layer} {what}", **{self.layer: MaskLayer.of(array)})

    def click_right(self, place, at):
        there, array = self._there(place), self._array().copy()
        if there is None:
            return
        fill(array, there, self._value())
        if not np.array_equal(array, self._array()):
            self.edit(f"{self.layer} filled", **{self.layer: MaskLayer.of(array)})

    def let_go(self):
        self.array = None

    # drawing ------------------------------------------------------------------------------

    def moments(self):
        return [(self._first(), WALL)] if not self.state.obstacles.blank or not self.state.regions.blank else ()

    def draw(self, canvas):
        matrix = self._to_first()
        for name in ("regions", "obstacles") if matrix is not None else ():
            layer = getattr(self.state, name)
            array = self._array() if name == self.layer else layer.array
            if self.array is not None or not layer.blank:
                lay_over(
                    canvas.image,
                    self.window.warped(array, back(matrix)),
                    self._table(name),
                    SEEN if name == self.layer else 0.2,
                )
        self._draw_cursor(canvas)

    @staticmethod
    def _table(name):
        return np.array([(0, 0, 0), *(REGIONS if name == "regions" else [WALL])], np.uint8)

    def _draw_cursor(self, canvas):
        at = np.array(pygame.mouse.get_pos(), float) - self.window.area.topleft
        if self.tool != "fill" and (at >= 0).all() and (at < self.window.area.size).all():
            radius = max(1.5, self.radius * self.window.zoom)
            canvas.ring(at, radius, px(self.window.scale, 3), self.window.theme.paper, 0.7)
            canvas.ring(at, radius, px(self.window.scale, 1), self.window.theme.ink)


def lay_over(image, labels, table, alpha):
    """Lay colours over a picture (h, w, 3), in place, where labels (h, w) uint8 are not 0."""
    x, y, wide, high = cv2.boundingRect(labels)
    if not wide:
        return
    part, label = image[y : y + high, x : x + wide], np.ascontiguousarray(labels[y : y + high, x : x + wide])
    colours = np.zeros((1, 256, 3), np.uint8)
    colours[0, : len(table)] = table
    mixed = cv2.addWeighted(part, 1 - alpha, cv2.LUT(cv2.merge([label] * 3), colours), alpha, 0)
    cv2.copyTo(mixed, label, part)

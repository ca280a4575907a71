"""The mode for pictures: marks birds by hand and shows the formation that they fly in."""

from __future__ import annotations

import numpy as np

from flockbrush.film.birds_in_sky import REACH
from flockbrush.studio.film.bird_tool import GRAB, RING, BirdsMode
from flockbrush.studio.theme import chrome, font, px
from flockbrush.studio.toasts import wrapped

WAYS = ("auto", "up", "right", "down", "left")


class FormationMode(BirdsMode):
    """Shows and corrects birds in pictures; a correction is followed on at once."""

    name = "formation"
    title = "Formation"
    hint = "Click: add   Right click: remove   Drag a bird: move   Drag a number onto another bird: swap   Wheel: zoom"

    def __init__(self, window):
        super().__init__(window)
        self.heading, self.tail = "auto", 0.0  # heading: the way the birds fly: auto, up, right, down or left

    def fill(self, column):
        self.count = column.line()
        column.heading("Formation")
        self.kind, self.why = column.line(), [column.line("", 0), column.line()]
        self.way = column.button(self._way(), self.turn, "Heading of the birds in the picture (H)")
        self.fill_bird(column)
        column.heading("File")
        self.lost_birds = column.line()
        self.offer_command(column, "Copy the command that finds the formation (Ctrl+C)")

    def freshen(self):
        birds, partly = self.state.birds, self.state.birds.partly()
        count = len(birds.at(self.window.k))
        self.count.say(f"{count} bird{'s' * (count != 1)}, wingspan {self.book.wingspan:.0f} px")
        shape = self.shape()
        self.kind.say("no birds" if shape is None else "no formation" if shape.kind == "none" else shape.kind)
        why = "" if shape is None else shape.why
        first = wrapped(why, font(px(self.window.scale, 14)), self.column.width - px(self.window.scale, 8))[0]
        for line, text in zip(self.why, (first, why[len(first) :].strip()), strict=True):
            line.say(text)
        self.freshen_bird()
        dashed = "Dashed: not in all pictures, not saved"
        self.lost_birds.say(dashed if partly else "")

    def _way(self):
        return f"Heading {self.heading}"

    def turn(self):
        """Select the next heading of the birds."""
        self.heading = WAYS[(WAYS.index(self.heading) + 1) % len(WAYS)]
        self.way.set_text(self._way())

    def keys(self):
        return {"h": self.turn, "n": self.next_break, "delete": lambda: self.take_away(self.window.k)}

    def shape(self):
        """The formation of the picture that is shown, with the dragged bird at the mouse."""
        return self.book.shape(self._places(), self.heading)

    def _places(self):
        places = self.state.birds.at(self.window.k)
        if self.held is not None and self.held[0] == "bird" and self.far():
            places[self.held[1]] = self.window.place(self.held[3])
        return places

    def _lost(self, place):
        """The bird of the picture before that is missing here and would be about at this place."""
        birds, k = self.state.birds, self.window.k
        shift = birds.shift(k)
        missing = {b: np.add(at, shift) for b, at in birds.at(k - 1).items() if b not in birds.at(k)} if k else {}
        far = {bird: float(np.hypot(*(at - place))) for bird, at in missing.items()}
        near = {bird: gap for bird, gap in far.items() if gap <= REACH * self.book.wingspan}
        return min(near, key=lambda bird: near[bird], default=None)

    # drawing ------------------------------------------------------------------------------

    def reach(self):
        return max(self._radius(()), px(self.window.scale, GRAB))

    def _radius(self, places):
        return max(px(self.window.scale, RING), 0.62 * self.book.wingspan * self.window.zoom)

    def draw(self, canvas):
        u, shape = self.window.scale, self.shape()
        if shape is not None and len(shape.curve):
            line = self.window.at(shape.curve)
            canvas.line(line, 4.5 * u, self.window.theme.paper, 0.75)
            canvas.line(line, 2.2 * u, chrome(self.window.theme).accent)
        self._shape, self._partly = shape, self.state.birds.partly()
        super().draw(canvas)

    def look(self, bird):
        theme, u, shape = self.window.theme, self.window.scale, self._shape
        dash = (5 * u, 4 * u) if bird in self._partly else None
        if shape is not None and bird == shape.leader and shape.kind != "none":
            return theme.leader, theme.outline, dash
        return theme.predator if shape is not None and bird in shape.outliers else theme.ink, theme.paper, dash

"""The mode for bodies: pick a colour by a click, measure a length by a drag."""

from __future__ import annotations

import cv2
import numpy as np

from flockbrush.film.body_marks import body_mask, colour_at
from flockbrush.film.looking import LENGTHS_PX
from flockbrush.studio.film.mask_tool import lay_over
from flockbrush.studio.film.mode import Mode
from flockbrush.studio.theme import px
from flockbrush.studio.widgets import enabled

GLOW = (255, 0, 180)  # of the mask: no animal and no meadow has it


class BodyMode(Mode):
    """Colour and length of the animals."""

    name = "body"
    title = "Body"
    hint = "Click an animal: pick its colour   Drag from tail to head: measure its length   M: show or hide the mask"

    def __init__(self, window):
        super().__init__(window)
        self.shown = True
        self._mask: tuple = ((), None)

    def fill(self, column):
        column.heading("Colour")
        self.chips = [column.chip(self.state.marks.body_colour)]
        self.colour = column.line()
        self.mask = column.button("Hide mask", self.toggle_mask, "Show which pixels have this colour (M)")
        self.no_colour = column.button(
            "Detect colour", self.forget_colour, "Clear the colour; flockbrush learn then detects it"
        )
        column.heading("Length")
        self.length = column.line()
        self.no_length = column.button(
            "Measure length", self.forget_length, "Clear the length; flockbrush learn then measures it"
        )
        column.heading("Learn")
        self.offer_command(column)

    def freshen(self):
        marks = self.state.marks
        self.chips[0].colour = marks.body_colour
        if marks.body_colour is None:
            self.colour.say("detected when learning")
        else:
            share = 100 * float(self._masked().mean())
            self.colour.say(f"{', '.join(map(str, marks.body_colour))}: {share:.1f} % of the picture")
        self.length.say("detected when learning" if marks.body_length is None else f"{marks.body_length:.1f} pixels")
        text = "Hide mask" if self.shown else "Show mask"
        if self.mask.text != text:
            self.mask.set_text(text)
        for button, can in (
            (self.mask, marks.body_colour), (self.no_colour, marks.body_colour), (self.no_length, marks.body_length),
        ):  # fmt: skip
            enabled(button, can is not None)

    def toggle_mask(self):
        """Show or hide which pixels have the body's colour."""
        self.shown = not self.shown

    def forget_colour(self):
        """Let the command find the colour."""
        self.mark("colour cleared", body_colour=None)

    def forget_length(self):
        """Let the command find the length."""
        self.mark("length cleared", body_length=None)

    def keys(self):
        return {"m": self.toggle_mask}

    def _masked(self):
        """The mask of the frame that is shown, made once."""
        key = self.window.k, self.state.marks.body_colour
        if key != self._mask[0]:
            self._mask = key, body_mask(self.window.film.frame(self.window.k), self.state.marks.body_colour)
        return self._mask[1]

    def press(self, place, at):
        self.held = np.array(place), np.array(place), at, at
        return True

    def drag(self, place, at):
        if self.held is not None:
            self.held = self.held[0], np.array(place), self.held[2], at

    def release(self, place, at):
        far, held, self.held = self.far(), self.held, None
        if held is None:
            return
        if far:
            length = float(np.hypot(*(held[1] - held[0])))
            if LENGTHS_PX[0] <= length <= LENGTHS_PX[1]:
                self.mark("body length", body_length=length)
            else:
                least, most = LENGTHS_PX
                self.window.toasts.say(f"A body has {least:g} to {most:g} pixels, not {length:.1f}.", "warning")
            return
        if self.in_picture(place):
            self.mark("body colour", body_colour=colour_at(self.window.film.frame(self.window.k), *place))

    def draw(self, canvas):
        if self.shown and self.state.marks.body_colour is not None:
            labels = self.window.warped(self._masked().astype(np.uint8), None, cv2.INTER_NEAREST)
            lay_over(canvas.image, labels, np.array([(0, 0, 0), GLOW], np.uint8), 0.6)
        if self.far():
            self._draw_length(canvas)

    def _draw_length(self, canvas):
        u, theme = self.window.scale, self.window.theme
        start, end = self.held[2], self.held[3]
        canvas.line([start, end], 4.5 * u, theme.paper, 0.8)
        canvas.line([start, end], 2.0 * u, theme.ink)
        for point in (start, end):
            canvas.disc(point, 3.5 * u, theme.ink)
        length = float(np.hypot(*(self.held[1] - self.held[0])))
        canvas.words(f"{length:.1f} px", end + 10 * u, px(u, 15), theme.ink, halo=theme.paper)

"""The base class of all modes of the window for clips."""

from __future__ import annotations

import numpy as np

from flockbrush.render.style import PALETTE, rgb
from flockbrush.studio.film.clip_column import ClipColumn
from flockbrush.studio.theme import px

COLOURS = tuple(rgb(colour) for colour in PALETTE)  # of birds and their paths
STILL = 4  # pixels of the screen: a shorter way of the mouse is a click


class Mode:
    """One mode of the window for clips.  Places are pixels of the clip, `at` is in pixels of the canvas.

    Parameters
    ----------
    window : ClipWindow
    """

    name = "mode"
    title = "Mode"
    hint = ""
    held: tuple | None = None  # what the mouse holds

    def __init__(self, window):
        self.window = window
        self.column: ClipColumn

    @property
    def book(self):
        """The marks of the film."""
        return self.window.book

    @property
    def state(self):
        """All marks as they are now."""
        return self.window.book.state

    def fill(self, column: ClipColumn):
        """Put controls into the column."""

    def freshen(self):
        """Update the controls."""

    def draw(self, canvas):
        """Draw onto the picture of the frame."""

    def moments(self):
        """(frame, colour) of what is to be marked on the strip."""
        return ()

    def press(self, place, at) -> bool:
        """Handle a press of the left button; returns whether the mode uses it (else the view moves)."""
        return False

    def drag(self, place, at):
        """The mouse moves with the left button down."""

    def release(self, place, at):
        """The left button goes up."""

    def click_right(self, place, at):
        """The right button went down."""

    def keys(self) -> dict:
        """What keys do, by their names."""
        return {}

    def key(self, key) -> bool:
        """A key; whether the mode knows it."""
        do = self.keys().get(key)
        if do is not None:
            do()
        return do is not None

    def let_go(self):
        """Cancel an unfinished action."""
        self.held = None

    def leave(self):
        """Called when another mode is selected."""

    # help for modes -----------------------------------------------------------------------

    def offer_command(self, column, tip="Copy the flockbrush learn command to the clipboard (Ctrl+C)"):
        """A button that copies the command that goes on from the marks."""
        column.button("Copy command", self.window.copy_line, tip)

    def far(self) -> bool:
        """Whether the mouse has moved what it holds, of which the last two are where it began and where it is now."""
        return self.held is not None and np.hypot(*(self.held[-2] - self.held[-1])) > px(self.window.scale, STILL)

    def in_picture(self, place) -> bool:
        """Whether a place is in the picture."""
        return bool(0 <= place[0] < self.window.film.size[0] and 0 <= place[1] < self.window.film.size[1])

    def edit(self, label, **changes):
        """A step that replaces parts of the state."""
        self.book.do(label, self.name, self.window.k, **changes)

    def mark(self, label, **changes):
        """A step that changes the marks."""
        self.book.mark(label, self.name, self.window.k, **changes)

    def near(self, at, places, reach):
        """The key of the place (in pixels of the film) that is nearest to a pixel of the canvas, within reach."""
        far = {key: float(np.hypot(*(self.window.at(place) - at))) for key, place in places.items()}
        return min((key for key in far if far[key] <= reach), key=lambda key: far[key], default=None)

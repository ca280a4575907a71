"""The mode to view a clip: play, scrub, select the used frames."""

from __future__ import annotations

from flockbrush.studio.film.mode import Mode
from flockbrush.studio.theme import chrome


class LookMode(Mode):
    """Shows facts about the clip and the used frames."""

    name = "view"
    title = "View"
    hint = (
        "Space: play   Left, Right: step   Page Up, Page Down: ten   Wheel: zoom   Drag: move   I, O: first, last frame"
    )

    def fill(self, column):
        film = self.window.film
        column.line(film.name)
        column.line(f"{film.size[0]} x {film.size[1]} pixels")
        column.line(f"{len(film)} frames, {film.fps:g} per second")
        column.heading("Used frames")
        self.used = column.line()
        column.pair(
            ("From here", self.window.use_from, "Make this the first used frame (I)"),
            ("To here", self.window.use_to, "Make this the last used frame (O)"),
            ("All", self.window.use_all, "Use all frames"),
        )
        column.heading("Learn")
        column.note("Mark landmarks if the camera moves, paint obstacles, show a body. The command with all of it:")
        self.offer_command(column)

    def freshen(self):
        marks = self.state.marks
        last = len(self.window.film) - 1 if marks.last is None else marks.last
        self.used.say(f"{marks.first or 0} to {last}")

    def moments(self):
        colour = chrome(self.window.theme).accent
        marks = self.state.marks
        return [(k, colour) for k in (marks.first, marks.last) if k is not None]

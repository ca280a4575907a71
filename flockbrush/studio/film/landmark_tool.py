"""The mode for landmarks: rectangles on things that do not move, tracked by CSRT."""

from __future__ import annotations

import numpy as np

from flockbrush.film.landmarks import MOST, between, least_side
from flockbrush.render.style import PALETTE, rgb
from flockbrush.studio.film.mode import Mode
from flockbrush.studio.theme import px
from flockbrush.studio.widgets import enabled

ROWS = 4  # of the column, at least
COLOURS = tuple(rgb(PALETTE[k]) for k in (5, 0, 2, 1, 4, 3, 7, 6))


class LandmarksMode(Mode):
    """Draws, tracks and removes landmarks."""

    name = "landmarks"
    title = "Landmarks"
    hint = "Drag a rectangle around something that does not move   Right click: remove   Two are enough, in any frames"

    held: tuple | None = None  # where the rectangle was begun and where it is now, pixels of the film

    def fill(self, column):
        column.note(
            "A drifting, turning, zooming camera is held still by two rectangles on the ground, far from each other,"
            " where no animal passes."
        )
        self.rows = [
            column.pair((f"{k + 1}", lambda k=k: self.go(k), "Show the frame of this landmark"))[0]
            for k in range(self._rows_needed())
        ]
        self.all_gone = column.button("Remove all", self.clear)
        column.heading("Learn")
        self.offer_command(column)

    def _rows_needed(self):
        return max(ROWS, len(self.state.marks.landmarks))

    def freshen(self):
        marks = self.state.marks.landmarks
        if len(self.rows) != self._rows_needed():
            self.window.rebuild_column()
            return
        for k, row in enumerate(self.rows):
            exists = k < len(marks)
            text = f"{k + 1}: frame {marks[k].frame}, {self.window.ground.said(marks[k])}" if exists else "–"
            if row.text != text:
                row.set_text(text)
            enabled(row, exists)
        enabled(self.all_gone, marks)

    def go(self, k):
        """Show the frame a landmark was drawn in."""
        self.window.go(self.state.marks.landmarks[k].frame)

    def clear(self):
        """Take all landmarks away."""
        self.mark("all landmarks removed", landmarks=())

    def moments(self):
        return [(mark.frame, COLOURS[k % 8]) for k, mark in enumerate(self.state.marks.landmarks)]

    def draw(self, canvas):
        for k, mark in enumerate(self.state.marks.landmarks):
            box, own = self.window.ground.box(mark, self.window.k), mark.frame == self.window.k
            if box is not None:
                self._draw_box(canvas, box[:2], box[:2] + box[2:], COLOURS[k % 8], str(k + 1), own)
        if self.held is not None:
            self._draw_box(canvas, *map(np.array, self.held), COLOURS[len(self.state.marks.landmarks) % 8], "", True)

    def _draw_box(self, canvas, one, other, colour, name, own):
        u, low, high = self.window.scale, self.window.at(np.minimum(one, other)), self.window.at(np.maximum(one, other))
        corners = np.array([low, (high[0], low[1]), high, (low[0], high[1])])
        canvas.line(corners, 4.4 * u, self.window.theme.paper, 0.7, closed=True)
        canvas.line(corners, 2.4 * u, colour, closed=True, dash=None if own else (7 * u, 5 * u))
        if name:
            canvas.words(name, low + (0, -2), px(u, 16), colour, anchor=(0, 1), halo=self.window.theme.paper)

    def press(self, place, at):
        if len(self.state.marks.landmarks) >= MOST:
            self.window.toasts.say(f"The maximum of {MOST} landmarks is reached.", "warning")
            return False
        self.held = np.array(place), np.array(place)
        return True

    def drag(self, place, at):
        if self.held is not None:
            self.held = self.held[0], np.clip(place, 0, self.window.film.size)

    def release(self, place, at):
        held, self.held = self.held, None
        landmark = None if held is None else between(self.window.k, *held, self.window.film.size)
        if landmark is not None:
            marks = (*self.state.marks.landmarks, landmark)
            self.mark(f"landmark {len(marks)}", landmarks=marks)
        elif held is not None:
            least = least_side(self.window.film.size)
            self.window.toasts.say(
                f"Drag from one corner of the rectangle to the other; it must have at least {least} x {least} pixels."
            )

    def click_right(self, place, at):
        for k, mark in enumerate(self.state.marks.landmarks):
            box = self.window.ground.box(mark, self.window.k)
            if box is not None and (box[:2] <= place).all() and (place <= box[:2] + box[2:]).all():
                rest = self.state.marks.landmarks[:k] + self.state.marks.landmarks[k + 1 :]
                self.mark(f"landmark {k + 1} removed", landmarks=rest)
                return

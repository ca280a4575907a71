"""The tool that selects and moves animals of a recording, after the run."""

from __future__ import annotations

import numpy as np
import pygame

from flockbrush.studio.tools.tool import Tool


class EditRecorded(Tool):
    """Selects animals of a recording; a drag moves them, Delete deletes them.  The recording stays as it is."""

    name, title, key, icon = "edit", "Edit the recording", "d", "edit"
    tip = "Select recorded animals to move, delete, retime or restyle them in exports; the recording is not changed"
    hint = "Click an animal or drag a box (Shift adds). Drag selected animals to move them."
    selects = "first click animals of the recording, or draw a box around them"

    def __init__(self, app):
        super().__init__(app)
        self._from: tuple[float, float] | None = None  # where the button went down
        self._moves = self._more = False  # whether the drag moves animals, and whether a box adds to the selection

    @property
    def edits(self):
        """The edits of the recording that is open, or None."""
        return self.app.session.edits

    def press(self, xy, button, mods):
        if button != 1 or self.edits is None:
            return
        self._from, self._more = xy, bool(mods & pygame.KMOD_SHIFT)
        animal = self._under(xy)
        self._moves = animal is not None
        if animal is None:
            return
        if self._more:
            self.edits.toggle(animal)
        elif animal not in self.edits.selected:
            self.edits.select([animal])
        self._show()

    def release(self, xy):
        start, self._from = self._from, None
        if start is None or xy is None:
            return
        if not self._moves:
            self.edits.select(self._within(start, xy), self._more)
            self._show()
        elif np.hypot(*np.subtract(xy, start)) > self.reach(6) and len(self.edits.selected):
            by = (round(float(xy[0] - start[0]), 3), round(float(xy[1] - start[1]), 3), 0.0)
            self.app.edit_recorded("move", by=by)

    def cancel(self) -> bool:
        if self.edits is None:
            return False
        going = self._from is not None or len(self.edits.selected) > 0
        self.interrupt()
        self.edits.select([])
        self._show()
        return going

    def interrupt(self):
        self._from = None  # the selection stays: another edit of the same animals may follow

    def delete(self) -> bool:
        if self.edits is None or not len(self.edits.selected):
            return False
        self.app.edit_recorded("delete")
        return True

    def _show(self):
        count = len(self.edits.selected)
        self.app.set_hint(f"{count} selected.  {self.hint}" if count else self.hint)

    def _under(self, xy):
        """Id of the animal at a point of the ground as it is shown, or None; in space, of the one under the mouse."""
        canvas = self.app.canvas
        herd = canvas.herd
        if canvas.in_space:
            return canvas.pick()
        if herd is None or not len(herd.ids):
            return None
        away = np.hypot(*(herd.xy[:, :2] - xy).T) - 0.5 * np.asarray(herd.length)
        nearest = int(np.argmin(away))
        return int(herd.ids[nearest]) if away[nearest] <= self.reach(9) else None

    def _within(self, one, other):
        """Ids of the animals that are shown in a box of the ground; none in one as small as a click."""
        herd, low, high = self.app.canvas.herd, np.minimum(one, other), np.maximum(one, other)
        if herd is None or np.hypot(*(high - low)) <= self.reach(6):
            return []
        return herd.ids[((herd.xy[:, :2] >= low) & (herd.xy[:, :2] <= high)).all(axis=1)]

    def cursor(self, surface, camera):
        herd = self.app.canvas.herd
        if self.edits is None or herd is None:
            return
        rows = np.flatnonzero(np.isin(herd.ids, self.edits.selected))
        shift = np.zeros(2)
        if self._from is not None and self.at is not None:
            if self._moves:
                shift = np.subtract(self.at, self._from)
            else:
                (west, south), (east, north) = self._from, self.at
                corners = [(west, south), (east, south), (east, north), (west, north)]
                self.path(surface, camera, corners, self.app.accent, closed=True, width=1.5)
        lengths = np.broadcast_to(herd.length, len(herd.ids))
        for row in rows:
            least = 5 * self.app.scale / camera.scale_at(herd.xy[row, :2])
            radius = max(0.7 * float(lengths[row]), least)
            self.circle(surface, camera, herd.xy[row, :2] + shift, radius, self.app.accent, 2)

"""The mode to sketch a flock: draws a path for each bird."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from flockbrush.film.flight_sketch import FlightSketch, Path
from flockbrush.studio.film.mode import COLOURS, Mode
from flockbrush.studio.theme import px
from flockbrush.studio.widgets import chosen, enabled

GRAB = 10  # pixels of the screen around a path that belong to it
LENGTHS = (20.0, 2000.0)  # frames of a flight before an empty sky


class SketchMode(Mode):
    """Converts paths drawn by hand to tracks."""

    name = "sketch"
    title = "Sketch"
    hint = "Drag: draw the path of a bird   Drag its start: move it   Right click: remove   Space: play"

    def __init__(self, window):
        super().__init__(window)
        self.drawn: list | None = None  # (x, y, seconds) of the path that is being drawn
        self.held = None  # (bird, where it was begun, where it is now) of a path that is being moved

    def fill(self, column):
        column.note("Draw the path of each bird. All paths begin in the first frame and end in the last.")
        self.count = column.line()
        column.heading("Speed")
        self.speed = column.pair(
            ("Even", lambda: self.set_even(True), "Constant speed along the path"),
            ("As drawn", lambda: self.set_even(False), "Speed of the pen while drawing"),
        )
        sketch = self.state.sketch
        show, tip = lambda v: f"{100 * v:.0f} %", "Removes bends shorter than this"
        self.smooth = column.slider("Smoothing", sketch.smooth, 0.0, 1.0, show, self.set_smooth, tip=tip)
        self.length = None
        if self.window.film.path is None:
            self.length = column.slider(
                "Length", float(sketch.frames), *LENGTHS, self._said_length, self.set_length, power=True
            )
        self.gone = column.button("Remove all", self.clear)
        column.heading("3D")
        self.lifts = column.button("Lift and view", self.lift, "Save, and show the flock in 3D")

    def _said_length(self, frames):
        return f"{frames:.0f} frames, {frames / self.window.film.fps:.1f} s"

    def freshen(self):
        sketch = self.state.sketch
        birds, frames = len(sketch.paths), sketch.frames
        said = f"{birds} bird{'s' * (birds > 1)}, {frames} frame{'s' * (frames > 1)}"
        self.count.say(said if birds else "no paths")
        chosen(self.speed, 0 if sketch.even else 1)
        self.smooth.set(sketch.smooth)
        if self.length is not None:
            self.length.set(float(sketch.frames))
        enabled(self.gone, sketch.paths)
        enabled(self.lifts, sketch.paths)

    # choices ------------------------------------------------------------------------------

    def set_even(self, even):
        """Even speed, or as it was drawn."""
        if even != self.state.sketch.even:
            self.edit("even speed" if even else "speed as drawn", sketch=replace(self.state.sketch, even=even))

    def set_smooth(self, smooth):
        """How much is smoothed, 0 to 1."""
        self._slide("smoothing", replace(self.state.sketch, smooth=float(smooth)))

    def set_length(self, frames):
        """How many frames the flight has."""
        self._slide("length of the flight", replace(self.state.sketch, frames=round(frames)))

    def _slide(self, label, sketch):
        """A step; the steps of one slide are one."""
        if self.book.undo_label == label and not self.book.redo_label and self.state is not self.book.saved:
            self.book.amend(self.state._replace(sketch=sketch))
        else:
            self.edit(label, sketch=sketch)

    def clear(self):
        """Take all paths away."""
        self.edit("all paths removed", sketch=replace(self.state.sketch, paths=()))

    def lift(self):
        """Show the flock in 3D."""
        self.window.lifting.begin("sketch.csv")

    # the mouse ----------------------------------------------------------------------------

    def _start_at(self, at):
        """The bird whose path begins at a pixel of the canvas."""
        starts = {path.bird: path.points[0][:2] for path in self.state.sketch.paths}
        return self.near(at, starts, px(self.window.scale, GRAB))

    def _path_at(self, at):
        """The bird whose path runs along a pixel of the canvas."""
        far = {
            path.bird: float(np.linalg.norm(self.window.at(path.xy) - at, axis=1).min())
            for path in self.state.sketch.paths
        }
        return min((b for b in far if far[b] <= px(self.window.scale, GRAB)), key=lambda b: far[b], default=None)

    def press(self, place, at):
        bird = self._start_at(at)
        if bird is not None:
            self.held = bird, np.array(place), np.array(place)
        else:
            self.drawn = [(*place, 0.0)]
            self._since = self.window.now
        return True

    def drag(self, place, at):
        if self.held is not None:
            self.held = self.held[0], self.held[1], np.array(place)
        elif self.drawn is not None and np.hypot(*np.subtract(place, self.drawn[-1][:2])) >= 0.5:
            self.drawn.append((*place, self.window.now - self._since))

    def release(self, place, at):
        drawn, held, self.drawn, self.held = self.drawn, self.held, None, None
        if held is not None:
            by = held[2] - held[1]
            if np.hypot(*by) > 1:
                self.edit(f"path {held[0]} moved", sketch=self.state.sketch.moved(held[0], by))
        elif drawn is not None:
            after = self.state.sketch.with_path(drawn)
            if after is None:
                self.window.toasts.say("Hold the button and drag to draw the path of a bird.")
            else:
                self.edit(f"path {after.paths[-1].bird}", sketch=after)

    def click_right(self, place, at):
        bird = self._path_at(at)
        if bird is not None:
            self.edit(f"path {bird} removed", sketch=self.state.sketch.without(bird))

    def let_go(self):
        self.drawn = self.held = None

    # drawing ------------------------------------------------------------------------------

    def _seen(self) -> FlightSketch:
        """The sketch as it is while a path is moved."""
        sketch = self.state.sketch
        return sketch if self.held is None else sketch.moved(self.held[0], self.held[2] - self.held[1])

    def draw(self, canvas):
        u, theme, sketch = self.window.scale, self.window.theme, self._seen()
        if self.drawn is not None and len(self.drawn) > 1:
            line = self.window.at(np.array(self.drawn)[:, :2])
            canvas.line(line, 4.0 * u, theme.paper, 0.7)
            canvas.line(line, 2.0 * u, theme.ink)
        if not sketch.paths:
            return
        px_ = sketch.tracks.px
        for n, path in enumerate(sketch.paths):
            self._draw_path(canvas, path, self.window.at(px_[:, n]), min(self.window.k, sketch.frames - 1))

    def _draw_path(self, canvas, path: Path, line, k):
        u, theme, colour = self.window.scale, self.window.theme, COLOURS[path.bird % 8]
        thin = line[:: max(1, len(line) // 120)]
        canvas.line(np.vstack([thin, line[-1:]]), 3.6 * u, theme.paper, 0.6)
        canvas.line(np.vstack([thin, line[-1:]]), 1.8 * u, colour)
        canvas.disc(line[0], 5.5 * u, theme.paper)
        canvas.disc(line[0], 4.0 * u, colour)
        ahead = line[-1] - line[max(0, len(line) - 1 - max(1, len(line) // 20))]
        canvas.arrowhead(line[-1], ahead, 11 * u, colour)
        way = line[min(k + 1, len(line) - 1)] - line[max(k - 1, 0)]
        self._draw_bird(canvas, line[k], way)
        canvas.words(str(path.bird), line[0] + (7 * u, -7 * u), px(u, 13), theme.ink, anchor=(0, 1), halo=theme.paper)

    def _draw_bird(self, canvas, at, way):
        """A small bird seen from below."""
        u, theme = self.window.scale, self.window.theme
        along = way / max(float(np.hypot(*way)), 1e-9)
        aside = np.array([-along[1], along[0]])
        half = (9, 0), (3, 2), (-2, 13), (-2, 2), (-8, 3)  # along and across
        outline = *half, *((ahead, -across) for ahead, across in half[:0:-1])
        shape = [at + u * (ahead * along + across * aside) for ahead, across in outline]
        canvas.line(shape, 3.0 * u, theme.paper, 0.8, closed=True)
        canvas.area(shape, theme.ink)

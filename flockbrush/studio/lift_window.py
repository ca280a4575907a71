"""The window that shows a lifted flight in 3D, solves it again with other weights, and exports it."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pygame
import pygame_gui
from pygame_gui.elements import UIHorizontalSlider, UIPanel

from flockbrush.engine.files import claimed
from flockbrush.lifting.flight_show import ENDINGS, METHODS, Show, Solver, Wanted, with_wish
from flockbrush.render.canvas import Canvas
from flockbrush.render.orbit import OrbitCamera
from flockbrush.render.space_view import SpacePainter
from flockbrush.render.style import mix
from flockbrush.studio.film.clip_column import ClipColumn
from flockbrush.studio.theme import chrome, px
from flockbrush.studio.widgets import NO_MARGINS, enabled, set_icon, words
from flockbrush.studio.window import FramesWindow

HINT = "Drag: orbit   Right drag: move   Wheel: zoom   Click: select a bird   Space: play"
FROM_CAMERA = "   C: camera view"
STILL = 4  # pixels: a shorter way of the mouse is a click
TRAIL = 2.0  # s
SETTLE = 0.25  # s after the last move of a slider until all frames are solved
SLIDERS = (  # name, what is set, lowest, highest, whether equal steps multiply, how it is written, tip
    ("Smooth paths", "smoothness", 0.03, 30.0, True, "{:.2g}", "λ_t: weight of smooth paths"),
    ("Alignment", "flock", 0.03, 30.0, True, "{:.2g}", "λ_f: weight of alignment and cohesion"),
    ("Even speed", "evenness", 0.0, 3.0, False, "{:.2f}", "Weight of a constant mean speed of the flock"),
    ("Separation", "separation", 0.0, 1.0, False, "{:.2f}", "Weight of separation of birds; for the looks only"),
    ("Separation distance", "separation_distance", 0.1, 10.0, True, "{:.2g} m", "Distance below which separation acts"),
)


class LiftWindow(FramesWindow):
    """The window that shows a flight.

    Parameters
    ----------
    size : (int, int)
        Pixels.
    theme : {"light", "dark"}, optional
        The one of the playground by default.
    under : str, optional
        What it was opened over, and Escape goes back to, such as "the film".

    Attributes
    ----------
    k : int
        The frame that is shown.
    bird : int or None
        Number of the bird that is picked.
    """

    def __init__(self, show: Show, size=(1280, 720), theme=None, under=""):
        self.show, self.solver, self.under = show, Solver(show), under
        super().__init__(theme)
        self.playing, self.late, self.bird = True, 0.0, None
        self.wanted = show.wanted
        self.at = 0.0  # frames: where playing is
        self._due = np.inf  # s until all frames are solved
        self._later: list[tuple[str, Callable]] = []  # files by their names, written when they are
        self._closing = False  # then, too
        self._camera: OrbitCamera | None = None
        self.open(size)
        for note in show.flight.notes:
            self.toasts.say(note, "warning")

    @property
    def k(self):
        """The frame that is shown."""
        return int(self.at)

    # controls ---------------------------------------------------------------------------

    def build(self):
        """Build all controls for the window size."""
        size = self.begin()
        foot, wide = px(self.scale, 66), min(px(self.scale, 270), size[0] // 2)
        self.area = pygame.Rect(0, 0, size[0] - wide, max(20, size[1] - foot))
        self.column: ClipColumn | None = None
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of labels that are shorter than their words
            self._build_foot(pygame.Rect(0, size[1] - foot, size[0], foot))
            self._build_column(pygame.Rect(self.area.right, 0, wide, self.area.height))
        self.painter = SpacePainter(
            None, self.area.size, self.theme, trails=None, words=False, live=True, floor=self.show.floor
        )
        self._frame = np.empty((self.area.height, self.area.width, 3), np.uint8)
        self.look_from(self._camera)
        self._freshen()

    def _build_foot(self, rect):
        back = UIPanel(rect, 1, self.manager, margins=NO_MARGINS, object_id="@bar")
        more = ("fit", "Show everything (0)", self.fit), ("camera", "View from the camera (C)", self.from_camera)
        _, self.play, *_, from_camera = self.frame_buttons(back, *more)
        enabled(from_camera, self.show.camera is not None)
        gap = px(self.scale, 3)
        x = from_camera.relative_rect.right + gap
        wide = px(self.scale, 200)
        self.clock = words(
            self, pygame.Rect(rect.width - wide - 3 * gap, px(self.scale, 10), wide, px(self.scale, 24)), "", back,
            "@right",
        )  # fmt: skip
        track = pygame.Rect(x + 3 * gap, px(self.scale, 14), 0, px(self.scale, 18))
        track.width = max(20, rect.width - wide - 6 * gap - track.x)
        self.scrub = UIHorizontalSlider(
            track, self.k, (0, len(self.show) - 1), self.manager, back, object_id="@slider", click_increment=1
        )
        below = pygame.Rect(px(self.scale, 10), px(self.scale, 42), rect.width - px(self.scale, 20), px(self.scale, 20))
        back_to = f"Escape: back to {self.under}   " if self.under else ""
        hint = back_to + HINT + FROM_CAMERA * (self.show.camera is not None)
        self.hint = words(self, below, hint, back, "@note")

    def _build_column(self, rect):
        column = self.column = ClipColumn(self, rect)
        column.title(Path(self.show.name).name)
        self.facts = [column.line("", 0) for _ in range(4)]
        if self.show.camera is not None:
            column.heading("Lifted from one camera")
            for name, key, low, high, power, form, tip in SLIDERS:
                column.slider(
                    name, self._value(key), low, high, form.format, lambda value, key=key: self.wish(key, value),
                    power=power, tip=tip,
                )  # fmt: skip
            self.method = column.button(self._method(), self.other_method, "Global solve, or descent of the thesis")
            column.button("Reset", self.reset, "Reset all sliders")
        column.heading(f"{self.show.animal.capitalize()}s")
        column.slider(
            self.show.sized_by, self.show.span, 0.1, 4.0, f"{{:.2f}} {self.show.unit}".format, self.set_span,
            power=True, tip="Size of the drawn animals; the wingspan is also used for a formation brush",
        )  # fmt: skip
        column.pair(
            ("Export…", self.ask_export, f"Write the flight: {', '.join(ENDINGS)} (Ctrl+S)"),
            ("Formation…", self.ask_brush, "Make a formation brush from the birds of this frame (B)"),
        )
        self.solved = column.line("")

    def _value(self, key):
        return getattr(self.wanted.wish, key)

    def _method(self):
        return "Method: one global solve" if self.wanted.method == METHODS[0] else "Method: Algorithm 3 (COBYLA)"

    def _freshen(self):
        """Update labels and buttons."""
        flight = self.show.flight
        self.clock.say(f"frame {flight.frames[self.k]}   {self.k / flight.fps:.2f} of {self.show.seconds:.2f} s")
        facts = self.show.facts(self.k)
        lines = [*facts, *[""] * (3 - len(facts)), self.show.about(self.k, self.bird)]
        for label, text in zip(self.facts, lines, strict=True):
            label.say(text)
        if self.show.camera is not None:
            busy = "solving …" if self.solver.busy else ""
            self.solved.say(busy or (f"solved in {self.solver.seconds:.2f} s" if self.solver.seconds else ""))
        set_icon(self, self.play, "pause" if self.playing else "play")
        if self.scrub.get_current_value() != self.k and not self.scrub.has_moved_recently:
            self.scrub.set_current_value(self.k)
            self.scrub.has_moved_recently = False

    def title(self):
        return f"{self.show.name} – Flight – Flockbrush"

    # one frame ---------------------------------------------------------------------------

    def frame(self, dt):
        """Run one frame, without waiting."""
        self.events()
        self._go_on(dt)
        self._due -= dt
        if self._due <= 0:
            self._due = np.inf
            self.solver.ask(self.wanted)
        if self.guarded(self.solver.look):
            self.painter.floor = self.show.floor
        self._go_on_solved()
        self.toasts.update(dt)
        self.manager.update(dt)
        self._freshen()
        self.draw()

    def _go_on(self, dt):
        if self.playing:
            self.at += dt * self.show.flight.fps
            if self.at >= len(self.show):
                self.at = 0.0

    def draw(self):
        """The flight and the controls onto the screen."""
        self.screen.fill(chrome(self.theme).panel)
        herd = self.show.herd(self.k)
        image = self.painter.frame(herd, title="", legend=False, out=self._frame, selected=self.bird)
        canvas = Canvas(image)
        self._draw_ways(canvas)
        if self.show.camera is not None:
            self._draw_camera(canvas)
        self.show_image(image)
        pygame.display.flip()

    def _draw_ways(self, canvas):
        """Trails of the last seconds, fainter with age."""
        way = self.show.way(self.k, TRAIL)
        if len(way) < 2:
            return
        colour = mix(self.theme.ink, self.theme.paper, 0.25)
        edges = np.linspace(0, len(way) - 1, 4).round().astype(int)
        for begin, end, alpha in zip(edges[:-1], edges[1:] + 1, (0.15, 0.35, 0.6), strict=True):
            part = way[begin:end]
            canvas.segments(self.painter.camera.lines(part[:-1], part[1:]), 1.2 * self.scale, colour, alpha)

    def _draw_camera(self, canvas):
        """The camera, its picture in space, and the lines of sight through that."""
        corners, spots = self.show.frustum(self.k)
        ink, soft = chrome(self.theme).accent, mix(chrome(self.theme).accent, self.theme.paper, 0.35)
        home = np.zeros((1, 3))
        canvas.segments(self.painter.camera.lines(np.repeat(home, 4, 0), corners), 1.3 * self.scale, ink, 0.6)
        canvas.segments(self.painter.camera.lines(corners, np.roll(corners, -1, 0)), 1.6 * self.scale, ink, 0.9)
        places, depth = self.painter.camera.project(corners)
        if (depth > self.painter.camera.nearest).all() and (np.abs(places) < 1e4).all():
            canvas.area(places, soft, 0.12)
        row = None if self.bird is None else self.show.row(self.bird)
        rows = self.show.there(self.k)
        if row is not None and row in rows:
            bird = self.show.flight.xyz[self.k, row : row + 1]
            canvas.segments(self.painter.camera.lines(home, bird), 1.4 * self.scale, ink, 0.9)
        if len(spots):
            places, depth = self.painter.camera.project(spots)
            for place in places[depth > self.painter.camera.nearest]:
                if (np.abs(place) < 1e4).all():
                    canvas.disc(place, max(1.6, 2.0 * self.scale), ink, 0.9)
        at, depth = self.painter.camera.project(home)
        if depth[0] > self.painter.camera.nearest and (np.abs(at[0]) < 1e4).all():
            canvas.disc(at[0], 5 * self.scale, self.theme.paper)
            canvas.disc(at[0], 3.6 * self.scale, ink)

    # what a person does ---------------------------------------------------------------------

    @property
    def count(self):
        """How many frames there are."""
        return len(self.show)

    def keys(self):
        return {
            "space": self.toggle_play, "0": self.fit, "c": self.from_camera, "ctrl+s": self.ask_export,
            "b": self.ask_brush, "ctrl+q": self.ask_to_quit, "escape": self.cancel,
        }  # fmt: skip

    def _of_parts(self, event):
        if event.type == pygame_gui.UI_HORIZONTAL_SLIDER_MOVED and event.ui_element is self.scrub:
            self.playing = False
            self.at = float(round(event.value))
            return True
        return super()._of_parts(event)

    def _press(self, at, button):
        moves = button == 3 or pygame.key.get_mods() & pygame.KMOD_SHIFT
        self._held = ("move" if moves else "turn", at, at, button)

    def _wheel(self, notches, at):
        self.look_from(self.painter.camera.zoomed(1.15**notches))

    def _drag(self, pos):
        what, start, last, button = self._held
        if np.hypot(*np.subtract(pos, start)) <= STILL and last is start:
            return
        across, down = np.subtract(pos, last)
        camera = self.painter.camera
        if what == "turn":
            per = np.pi / max(self.area.height, 1)
            self.look_from(camera.turned(across * per, down * per))
        else:
            right, up, _ = camera.axes
            x, y, z = np.asarray(camera.target) + (-across * right + down * up) / camera.scale
            self.look_from(camera.at(x, y, z))
        self._held = what, start, pos, button

    def _release(self, pos):
        what, start, _, _ = self._held
        self._held = None
        if what == "turn" and np.hypot(*np.subtract(pos, start)) <= STILL:
            row = self.painter.pick(tuple(pos))
            rows = self.show.there(self.k)
            self.bird = None if row is None else int(self.show.flight.ids[rows[row]])

    def cancel(self):
        """Clear the selection; where there is none, go back to what the window was opened over."""
        if self.under and self.bird is None and self._held is None:
            self.ask_to_quit()
        self.let_go()
        self.bird = None

    def step(self, frames):
        """Stop, and go so many frames on."""
        self.playing = False
        self.at = float(np.clip(self.k + frames, 0, len(self.show) - 1))

    def toggle_play(self):
        """Play or stop; from the end, begin anew."""
        self.playing = not self.playing
        if self.playing and self.k == len(self.show) - 1:
            self.at = 0.0

    # looking ----------------------------------------------------------------------------------

    def look_from(self, camera=None):
        """Look from there; from beside the whole flight and its camera by default."""
        if camera is None or camera.size != tuple(self.area.size):
            camera = self._all(camera)
        self._camera = camera
        self.painter.look(camera)

    def _all(self, like=None):
        xyz = self.show.flight.xyz.reshape(-1, 3)
        points = xyz[np.isfinite(xyz).all(-1)]
        if self.show.camera is not None:
            points = np.vstack([points, np.zeros((1, 3))])
        azimuth, elevation = (np.radians(140.0), np.radians(24.0)) if like is None else (like.azimuth, like.elevation)
        return OrbitCamera.of(
            points, self.area.size, self.painter.view, azimuth, elevation, floor=self.show.floor, margin=0.07
        )

    def fit(self):
        """Show the whole flight."""
        self.look_from(self._all(self.painter.camera))

    def from_camera(self):
        """Look from where the camera stood, with about its field of view."""
        lens = self.show.camera
        if lens is None:
            return
        far = 0.4 * float(np.nanmedian(self.show.flight.xyz[..., 1]))
        wide, high = self.area.size
        shown = max(lens.height, lens.width * high / wide)  # pixels of the film over the height of this picture
        fov = 2 * np.arctan(0.5 * shown / lens.focal * 1.06)
        view, floor = self.painter.view, self.show.floor
        how = tuple(self.area.size), view
        self.look_from(OrbitCamera((0.0, far, 0.0), far, np.pi / 2, 0.0, *how, fov=fov, floor=floor))

    # wishes -----------------------------------------------------------------------------------

    def wish(self, key, value):
        """Solve anew with another weight: a glance at once, all frames when the hand rests."""
        self.wanted = self.guarded(lambda: with_wish(self.wanted, **{key: float(value)})) or self.wanted
        if self.wanted.method == METHODS[0]:
            self.solver.ask(self.wanted, glance=True)
        self._due = SETTLE

    def other_method(self):
        """The global solve, or the thesis' descent."""
        self.wanted = with_wish(self.wanted, method=METHODS[1 - METHODS.index(self.wanted.method)])
        self.method.set_text(self._method())
        self.solver.ask(self.wanted)

    def reset(self):
        """All sliders as they were at first."""
        self.wanted = Wanted()
        for slider, (_, key, *_rest) in zip(self.column.sliders, SLIDERS, strict=False):
            slider.set(self._value(key))
        self.method.set_text(self._method())
        self.solver.ask(self.wanted)

    def set_span(self, span):
        """Set the wingspan of the drawn birds."""
        self.show.span = float(span)

    # keeping ----------------------------------------------------------------------------------

    def ask_export(self):
        """Ask for the file of the flight."""
        self.show.check_exports(())
        name = str(Path(self.show.name).with_suffix("").with_suffix("")) + ".flock.csv"
        answers = [("Write", self._export), ("Cancel", None)]
        self.ask("Export", f"Write the flight to ({', '.join(ENDINGS)}):", answers, name)

    def _export(self, path):
        def write():
            self.show.export(path)
            self.toasts.say(f"wrote {path}")

        self._replacing([path], write)

    def _replacing(self, paths, write):
        """Write files; where some are there already, ask first."""
        there = [str(path) for path in map(Path, paths) if path.exists()]
        if there:
            question = f"{' and '.join(there)} already exist{'s' * (len(there) == 1)}."
            self.ask("Replace?", question, [("Replace", lambda: self._when_solved(paths, write)), ("Cancel", None)])
        else:
            self._when_solved(paths, write)

    def _when_solved(self, paths, write):
        """Write what is kept: solved as is wished, in all its frames. Until it is, the window goes on."""
        self._later.append((" and ".join(map(str, paths)), write))
        if not self.solver.has(self.wanted):
            self._due = np.inf
            self.solver.ask(self.wanted)
            self.toasts.say("The flight is written when it is solved.")
        self._go_on_solved()

    def _go_on_solved(self):
        if not self._later or self.solver.busy or self._due < np.inf:
            return
        later, self._later = self._later, []
        if self.solver.has(self.wanted):
            for _, write in later:
                self.guarded(write)
            if self._closing:
                self.quit()
        else:
            self._closing = False
            self.toasts.say("Nothing was written: the flight could not be solved with these settings.", "error")

    @property
    def unsaved(self):
        return f"{self._waiting} will be written when the flight is solved." if self._later else ""

    @property
    def _waiting(self):
        return " and ".join(name for name, _ in self._later)

    def save(self):
        """Close the window when what waits is written: it goes on until then."""
        self._closing = bool(self._later)
        return not self._closing

    def leave(self, keep=False):
        return f"not written, since the flight was not solved: {self._waiting}" if self._later else ""

    def ask_brush(self):
        """Ask for the file of the brush."""
        self.playing = False
        formation = self.guarded(lambda: self.show.formation(self.k))
        if formation is None:
            return
        kind = formation.frames[0].kind
        name = f"{Path(self.show.name).name.split('.')[0]}-{kind.lower().replace(' ', '-')}.brush.toml"
        question = f"The birds of this frame fly as a {kind} ({formation.frames[0].why}). Write the brush to:"
        answers = [("Write", self._brush), ("Write and play", None), ("Cancel", None)]
        where = str(Path(self.show.name).parent / name)
        self.ask("Formation brush", question, answers, where)
        dialog = self.dialog
        dialog.answers[list(dialog.answers)[1]] = lambda: self._fly(dialog.entry.get_text().strip())

    def _brush(self, path):
        k = self.k

        def write():
            with claimed([path]):
                self.toasts.say(self.show.formation_brush(k, path))

        self._replacing([path], write)

    def _fly(self, path):
        """Write brush and level, and show that in place of the flight until it is closed."""
        k = self.k
        self._replacing(self.show.formation_files(path), lambda: self._write_and_play(k, path))

    def _write_and_play(self, k, path):
        from flockbrush.studio.start import StartOptions, opening_of

        level = self.show.formation_level(k, path)
        options = StartOptions(str(level), level.stem, theme=self.theme.name)
        self.open_over(opening_of(options, self.screen.get_size()))

"""The window for clips: its parts, its frames and what the mouse and the keys do."""

from __future__ import annotations

import tempfile
import warnings

import cv2
import numpy as np
import pygame
from pygame_gui.elements import UIButton, UIPanel

from flockbrush.engine.problems import ProblemsError
from flockbrush.film.clip_document import Book
from flockbrush.film.clip_frames import Film, Sky
from flockbrush.film.clip_jobs import ClipJob
from flockbrush.render.canvas import Canvas
from flockbrush.studio.film.bird_tool import BirdsMode
from flockbrush.studio.film.body_tool import BodyMode
from flockbrush.studio.film.clip_column import ClipColumn
from flockbrush.studio.film.clip_look import LookMode
from flockbrush.studio.film.followed_ground import FollowedGround
from flockbrush.studio.film.formation_tool import FormationMode
from flockbrush.studio.film.frame_strip import FilmBar
from flockbrush.studio.film.landmark_tool import LandmarksMode
from flockbrush.studio.film.lifting import Lifting
from flockbrush.studio.film.mask_tool import PaintMode
from flockbrush.studio.film.picture_view import PictureView
from flockbrush.studio.film.sketch_tool import SketchMode
from flockbrush.studio.theme import chrome, px
from flockbrush.studio.widgets import NO_MARGINS, chosen, enabled, icon_row
from flockbrush.studio.window import FramesWindow

MODES = (LookMode, LandmarksMode, PaintMode, BodyMode, BirdsMode, SketchMode)
OF_THE_SKY = (LookMode, SketchMode)  # where there is no film
OF_PICTURES = (FormationMode,)


class ClipWindow(FramesWindow):
    """The window that shows a clip and edits its marks.

    Parameters
    ----------
    size : (int, int)
        Pixels.
    theme : {"light", "dark"}, optional
        The one of the playground by default.
    camera : path, optional
        Of the camera that filmed, for lifting.
    mode : str
        Name of the first mode.
    """

    repeat = 300, 33

    def __init__(self, book: Book, size=(1280, 720), theme=None, camera=None, mode="view"):
        self.book, self.film = book, book.film
        super().__init__(theme)
        self.k, self.playing, self.now = 0, False, 0.0  # k: the frame that is shown
        self.view = PictureView()
        self.jobs: dict = {}  # work that goes on beside the window
        self.lifting = Lifting(self, camera)
        self.ground = FollowedGround(self)
        self._shown: tuple = ()
        self._late = 0.0  # s that playing is ahead of the frame shown
        filmed = isinstance(self.film, Film)
        kinds = MODES if filmed else OF_THE_SKY if isinstance(self.film, Sky) else OF_PICTURES
        self.modes = [kind(self) for kind in kinds]
        self.mode = next((one for one in self.modes if one.name == mode), self.modes[0])
        self.open(size)
        for note in self.film.notes:
            self.toasts.say(f"{self.film.name}: {note}", "warning")

    # controls ---------------------------------------------------------------------------

    def build(self):
        """Make all controls for the window's size and mode."""
        size = self.begin()
        bar, foot = px(self.scale, 42), px(self.scale, 68)
        wide = min(px(self.scale, 250), size[0] // 2)
        self.area = pygame.Rect(0, bar, size[0] - wide, max(20, size[1] - bar - foot))
        self._side = pygame.Rect(self.area.right, bar, wide, self.area.height)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of labels that are shorter than their words
            self._build_top(pygame.Rect(0, 0, size[0], bar))
            self.bar = FilmBar(self, pygame.Rect(0, size[1] - foot, size[0], foot))
            self._build_column()
        self._shown = ()
        self._freshen()

    def _build_top(self, rect):
        back = UIPanel(rect, 1, self.manager, margins=NO_MARGINS, object_id="@bar")
        side, pad = px(self.scale, 32), px(self.scale, 5)
        icons = (
            ("save", "Save everything (Ctrl+S)", self.save), ("redo", "Redo (Ctrl+Shift+Z)", self.redo),
            ("undo", "Undo (Ctrl+Z)", self.undo), ("fit", "Show the whole picture (0)", self.fit),
        )  # fmt: skip
        right = rect.width - pad - side
        icon_row(self, pygame.Rect(right, pad, side, side), -(side + pad), icons, back)
        right -= len(icons) * (side + pad)
        wide = min(px(self.scale, 108), (right - pad) // len(self.modes))
        self.tabs = []
        for n, mode in enumerate(self.modes):
            place = pygame.Rect(pad + n * wide, pad, wide - pad // 2, side)
            tab = UIButton(
                place, mode.title, self.manager, back, tool_tip_text=f"{mode.title} ({n + 1})", object_id="@plain"
            )
            self.buttons[tab] = lambda mode=mode: self.take(mode.name)
            self.tabs.append(tab)

    def _build_column(self):
        self.column = ClipColumn(self, self._side)
        self.column.title(self.mode.title)
        self.mode.column = self.column
        self.mode.fill(self.column)
        chosen(self.tabs, self.modes.index(self.mode))

    def take(self, name):
        """Take another mode."""
        self.let_go()
        if name != self.mode.name:
            self.mode.leave()
            self.mode = next(mode for mode in self.modes if mode.name == name)
        self.rebuild_column()

    def rebuild_column(self):
        """Rebuild the controls of the mode."""
        self.column.close()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            self._build_column()
        self._freshen()

    def _freshen(self):
        """Update labels and buttons."""
        self.bar.freshen()
        self.mode.freshen()
        for button, do in self.buttons.items():
            can = {self.undo: self.book.undo_label, self.redo: self.book.redo_label}.get(do, True)
            enabled(button, can)
        pygame.display.set_caption(self.title())

    def title(self):
        return f"{self.film.name}{' *' if self.book.dirty else ''} – {self.mode.title} – Flockbrush"

    # one frame ---------------------------------------------------------------------------

    def frame(self, dt):
        """Run one frame, without waiting."""
        self.now += dt
        if self.film.path is None and len(self.film) != self.book.state.sketch.frames:
            self.film.lasts(self.book.state.sketch.frames)
            self.k = min(self.k, len(self.film) - 1)
        self.events()
        self._play(dt)
        self._look_at_jobs()
        self.ground.go_on()
        self.toasts.update(dt)
        self.manager.update(dt)
        self._freshen()
        self.guarded(self.draw)

    def _play(self, dt):
        if not self.playing:
            return
        self._late += dt
        k = self.k
        while k + 1 < len(self.film) and self.film.time(k + 1) - self.film.time(self.k) <= self._late:
            k += 1
        if k > self.k:
            self._late -= self.film.time(k) - self.film.time(self.k)
            self.k = k
        if self.k == len(self.film) - 1:
            self.playing = False

    def job(self, key, name, do, then):
        """Start a background job; an older job with the same key is dropped, and ends before this begins."""
        older = self.jobs.pop(key, None)
        if older is not None:
            older.stop()
        self.jobs[key] = ClipJob(name, do, then, older)

    def _look_at_jobs(self):
        for key, job in list(self.jobs.items()):
            over = self.guarded(job.look)
            if over is not False and self.jobs.get(key) is job:
                del self.jobs[key]

    # drawing -----------------------------------------------------------------------------

    def draw(self):
        """Draw picture, marks and controls."""
        self.screen.fill(chrome(self.theme).panel)
        image = self._picture().copy()
        self.guarded(self.mode.draw, Canvas(image))
        self.show_image(image)
        if not self.asking:
            self.bar.draw(self.screen)
            for chip in getattr(self.mode, "chips", ()):
                chip.draw(self.screen)
        pygame.display.flip()

    def matrix(self):
        """From pixels of the film to those of the canvas, (2, 3)."""
        scale, left, top = self.view.matrix(self.film.size, self.area)
        return np.array([[scale, 0, left], [0, scale, top]])

    def warped(self, picture, matrix=None, flags=cv2.INTER_NEAREST, border=0):
        """A picture of the film's size as it lies on the canvas; `matrix` moves it within the film first."""
        whole = self.matrix()
        if matrix is not None:
            whole = whole @ np.vstack([matrix, [0, 0, 1]])
        whole = whole.copy()
        whole[:, 2] += 0.5 * whole[:, :2].sum(1) - 0.5  # middles of pixels
        return cv2.warpAffine(
            picture, whole, self.area.size, flags=flags, borderMode=cv2.BORDER_CONSTANT, borderValue=border
        )

    def _picture(self):
        """The part of the frame that is shown, (h, w, 3) red first, made once."""
        key = self.k, self.area.size, self.matrix().tobytes()
        if key != self._shown:
            how = cv2.INTER_AREA if self.matrix()[0, 0] < 1 else cv2.INTER_LINEAR
            paper = tuple(map(float, self.theme.paper[::-1]))
            self._image = cv2.cvtColor(self.warped(self.film.frame(self.k), None, how, paper), cv2.COLOR_BGR2RGB)
            self._shown = key
        return self._image

    def at(self, place) -> np.ndarray:
        """Pixels of the canvas of places in the film, (..., 2)."""
        scale, left, top = self.view.matrix(self.film.size, self.area)
        return np.asarray(place, float) * scale + (left, top)

    def place(self, at):
        """The place in the film of a pixel of the canvas."""
        scale, left, top = self.view.matrix(self.film.size, self.area)
        return (at[0] - left) / scale, (at[1] - top) / scale

    @property
    def zoom(self):
        """Pixels of the canvas for one of the film."""
        return self.view.matrix(self.film.size, self.area)[0]

    # what a person does ---------------------------------------------------------------------

    def _of_strip(self, event):
        return self.bar.mouse(event)

    @property
    def count(self):
        """How many frames there are."""
        return len(self.film)

    def keys(self):
        does = {
            "ctrl+z": self.undo, "ctrl+shift+z": self.redo, "ctrl+y": self.redo, "ctrl+s": self.save, "0": self.fit,
            "space": self.toggle_play, "ctrl+q": self.ask_to_quit, "escape": self.let_go, "ctrl+c": self.copy_line,
        }  # fmt: skip
        does |= {f"{n}": lambda mode=mode: self.take(mode.name) for n, mode in enumerate(self.modes, 1)}
        return does | ({"i": self.use_from, "o": self.use_to} if isinstance(self.film, Film) else {})

    def _key(self, key):
        if not self.mode.key(key):
            super()._key(key)

    def _press(self, at, button):
        if button == 3:
            self.mode.click_right(self.place(at), at)
        else:
            handled = button == 1 and self.mode.press(self.place(at), at)
            self._held = "mode" if handled else "view", at, button

    def _drag(self, at):
        who, last, button = self._held
        if who == "view":
            self.view.shift += at - last
        else:
            self.mode.drag(self.place(at), at)
        self._held = who, at, button

    def _release(self, at):
        who, self._held = self._held[0], None
        if who == "mode":
            self.mode.release(self.place(at), at)

    def _wheel(self, notches, at):
        self.view.wheel(notches, at, self.film.size, self.area)

    def let_go(self):
        """Cancel an unfinished action."""
        super().let_go()
        self.mode.let_go()

    def go(self, k):
        """Show another frame; playing stops."""
        self.playing = False
        self.k = min(max(k, 0), len(self.film) - 1)

    def step(self, frames):
        """So many frames on."""
        self.go(self.k + frames)

    def toggle_play(self):
        """Play or pause; from the end, play from the beginning."""
        self.playing = not self.playing
        self._late = 0.0
        if self.playing and self.k == len(self.film) - 1:
            self.k = 0

    def fit(self):
        """Show the whole picture."""
        self.view = PictureView()

    def use_from(self):
        """Make this the first used frame."""
        last = self.book.state.marks.last
        self._use(self.k or None, last if last is None or last > self.k else None, f"used from frame {self.k}")

    def use_to(self):
        """Make this the last used frame."""
        first = self.book.state.marks.first
        last = self.k if self.k < len(self.film) - 1 else None
        self._use(first if first is None or first < self.k else None, last, f"used up to frame {self.k}")

    def use_all(self):
        """Use all frames."""
        self._use(None, None, "all frames are used")

    def _use(self, first, last, label):
        marks, state = self.book.state.marks, self.book.state
        if first != marks.first and not (state.obstacles.blank and state.regions.blank):
            self.toasts.say("The mask belongs to the first used frame, which has changed.", "warning")
        self.book.mark(label, self.mode.name, self.k, first=first, last=last)

    def undo(self):
        """Undo the last step."""
        self._after(self.book.undo(), "undone")

    def redo(self):
        """Redo the change that was undone last."""
        self._after(self.book.redo(), "redone")

    def _after(self, step, how):
        self.let_go()
        if step is not None:
            mode, frame = step.where
            self.toasts.say(f"{step.label}: {how}")
            self.go(frame)
            self.take(mode)

    def copy_line(self):
        """Copy the flockbrush learn command to the clipboard."""
        line = self.book.learn_line()
        for landmark in self.book.unused_landmarks():
            told = f"The landmark of frame {landmark.frame} is not found in any used frame: learn will refuse it."
            self.toasts.say(told, "warning")
        try:
            pygame.scrap.put_text(line)
            later = "; save (Ctrl+S) before you run it" if self.book.dirty else ""
            self.toasts.say(f"Copied: {line}{later}")
        except (pygame.error, AttributeError):
            self.toasts.say(f"No clipboard is available; the command is: {line}", "warning")

    def save(self) -> bool:
        """Write all marks; returns whether it worked."""
        written = self.guarded(self.book.save)
        if written is None:
            return False
        names = ", ".join(path.name for path in written)
        self.toasts.say(f"Saved in {self.book.folder.resolve()}: {names}")
        return True

    def open_dialog(self, dialog):
        """Ask something; playing stops."""
        self.playing = False
        super().open_dialog(dialog)

    @property
    def unsaved(self):
        """A sentence about marks that are not saved, "" when all are."""
        return f"The marks in {self.film.name} are not saved." if self.book.dirty else ""

    def leave(self, keep=False):
        """End all background jobs; unsaved marks are saved if they are to be kept."""
        for job in self.jobs.values():
            job.stop(wait=True)
        self.jobs.clear()
        self.mode.leave()
        if not keep or not self.book.dirty:
            return ""
        told = ""
        try:
            saved = self.book.save_unfinished()
        except (OSError, ProblemsError) as error:
            self.book.go_to(tempfile.mkdtemp(prefix=f"{self.book.stem}-marks-"))
            told = f"{error}\n"
            saved = self.book.save_unfinished()
        if not saved:
            return f"{self.film.name}: there were no marks to save when the program ended"
        return f"{told}{', '.join(map(str, saved))}: marks were saved before the program ended"

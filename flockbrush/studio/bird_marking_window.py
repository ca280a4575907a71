"""The window to correct the positions of birds in the frames of a clip."""

from __future__ import annotations

import warnings

import cv2
import numpy as np
import pygame
import pygame_gui
from pygame_gui.elements import UIButton, UIHorizontalSlider, UIPanel

from flockbrush.film.bird_marking import Album, Mark
from flockbrush.render.canvas import Canvas
from flockbrush.render.style import rgb
from flockbrush.render.text import words as written
from flockbrush.studio.theme import chrome, px
from flockbrush.studio.widgets import NO_MARGINS, icon_button, words
from flockbrush.studio.window import Window

HINT = "Click: add   Right click: remove   Drag a bird: move   Drag a number onto another bird: swap   Wheel: zoom"
WAYS = ("auto", "up", "right", "down", "left")
GRAB = 11  # pixels around a bird that belong to it, at least
STILL = 4  # pixels: a shorter way of the mouse is a click
LARGEST_ZOOM = 24.0  # of the picture's size in the window


class PictureView:
    """The part of a picture that is visible, and its place in the window."""

    def __init__(self):
        self.zoom, self.shift = 1.0, np.zeros(2)

    def matrix(self, picture, area):
        """(scale, left, top): from pixels of the picture to those of the area."""
        scale = min(area.width / picture[0], area.height / picture[1]) * self.zoom
        corner = (np.array(area.size) - np.array(picture) * scale) / 2 + self.shift
        return scale, float(corner[0]), float(corner[1])

    def wheel(self, notches, at, picture, area):
        """Zoom at the mouse pointer."""
        scale, left, top = self.matrix(picture, area)
        point = (at[0] - left) / scale, (at[1] - top) / scale
        self.zoom = float(np.clip(self.zoom * 1.2**notches, 1.0, LARGEST_ZOOM))
        scale, left, top = self.matrix(picture, area)
        self.shift += (at[0] - point[0] * scale - left, at[1] - point[1] * scale - top)
        if self.zoom == 1.0:
            self.shift[:] = 0


class Marking(Window):
    """The window on an album.

    Parameters
    ----------
    out : path
        Where the marks are saved.
    size : (int, int)
        Pixels.
    theme : {"light", "dark"}, optional
        The one of the playground unless told.
    """

    smallest = 320, 240

    def __init__(self, album: Album, out, size=(1280, 720), theme=None):
        self.album, self.out = album, out
        super().__init__(theme)
        self.k, self.heading = 0, "auto"  # heading: the way the birds fly: auto, up, right, down or left
        self.view = PictureView()
        self._shown: tuple = ()
        self._image = np.zeros((1, 1, 3), np.uint8)
        self._labels: dict[int, pygame.Rect] = {}
        self.open(size)
        self._tell_partly()

    # controls ---------------------------------------------------------------------------

    def build(self):
        """Build all controls for the window size."""
        size = self.begin()
        bar, foot = px(self.scale, 42), px(self.scale, 62)
        self.area = pygame.Rect(0, bar, size[0], max(20, size[1] - bar - foot))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of labels that are shorter than their words
            self._build_top(pygame.Rect(0, 0, size[0], bar))
            self._build_foot(pygame.Rect(0, size[1] - foot, size[0], foot))
        self._shown = ()
        self._freshen()

    def _build_top(self, rect):
        back = UIPanel(rect, 1, self.manager, margins=NO_MARGINS, object_id="@bar")
        side, pad = px(self.scale, 32), px(self.scale, 5)
        x = pad
        for picture, tip, do in (
            ("undo", "Undo (Ctrl+Z)", self.undo), ("redo", "Redo (Ctrl+Shift+Z)", self.redo),
            ("save", "Save the marks (Ctrl+S)", self.save), ("fit", "Show the whole picture (0)", self.fit),
        ):  # fmt: skip
            self.buttons[icon_button(self, pygame.Rect(x, pad, side, side), picture, tip, back)] = do
            x += side + pad
        wide = px(self.scale, 120)
        tip = "Heading of the birds in the picture (H)"
        self.way = UIButton(
            pygame.Rect(x, pad, wide, side), self._way(), self.manager, back, tool_tip_text=tip,
            object_id="@small_button",
        )  # fmt: skip
        self.buttons[self.way] = self.turn
        x += wide + 2 * pad
        self.kind = words(self, pygame.Rect(x, pad, max(20, rect.width - x - pad), side), "", back)

    def _build_foot(self, rect):
        back = UIPanel(rect, 1, self.manager, margins=NO_MARGINS, object_id="@bar")
        row, pad = px(self.scale, 26), px(self.scale, 8)
        wide = min(px(self.scale, 440), rect.width // 2)
        self.where = words(self, pygame.Rect(pad, px(self.scale, 5), wide, row), "", back)
        left = 2 * pad + wide
        self.slider = None
        if len(self.album) > 1:
            track = pygame.Rect(left, px(self.scale, 9), rect.width - left - pad, px(self.scale, 18))
            self.slider = UIHorizontalSlider(
                track, self.k, (0, len(self.album) - 1), self.manager, back, object_id="@slider", click_increment=1
            )
        below = pygame.Rect(pad, px(self.scale, 32), rect.width - 2 * pad, row)
        self.hint = words(self, below, HINT, back, "@note")

    def _way(self):
        return f"Heading {self.heading}" if self.heading != "auto" else "Heading auto"

    def _freshen(self):
        """Update labels and buttons."""
        birds = self.album.birds(self.k)
        touched = ", corrected" if self.k in self.album.state.touched else ""
        frame = self.album.frames[self.k]
        place = f"{self.k + 1}/{len(self.album)}  " if len(self.album) > 1 else ""
        self.where.say(f"{place}{frame.name}   {len(birds)} bird{'s' * (len(birds) != 1)}{touched}")
        shape = self.album.shape(self.k, self.heading, self._birds())
        if shape is None:
            self.kind.say("no birds")
        else:
            self.kind.say(f"{'no formation' if shape.kind == 'none' else shape.kind}: {shape.why}")
        for button, do in self.buttons.items():
            can = {self.undo: self.album.undo_label, self.redo: self.album.redo_label}.get(do, True)
            if bool(can) != button.is_enabled:
                (button.enable if can else button.disable)()
        pygame.display.set_caption(self.title())

    def title(self):
        return f"{self.out}{' *' if self.album.dirty else ''} – Marking – Flockbrush"

    # one frame ---------------------------------------------------------------------------

    def frame(self, dt):
        """Run one frame, without waiting."""
        self.events()
        self.toasts.update(dt)
        self.manager.update(dt)
        self._freshen()
        self.draw()

    def draw(self):
        """Draw picture, marks and controls."""
        self.screen.fill(chrome(self.theme).panel)
        image = self._picture().copy()
        self._draw_marks(Canvas(image))
        self.screen.blit(pygame.image.frombuffer(image.tobytes(), self.area.size, "RGB"), self.area)
        self.toasts.draw(self.screen, self.area, self.theme, self.scale)
        self.manager.draw_ui(self.screen)
        pygame.display.flip()

    def _picture(self):
        """The part of the frame that is shown, (h, w, 3), made once."""
        frame = self.album.frames[self.k]
        scale, left, top = self.view.matrix(frame.size, self.area)
        key = self.k, self.area.size, scale, left, top
        if key != self._shown:
            if not self._shown or self._shown[0] != self.k:
                self._whole = frame.picture()
            matrix = np.array([[scale, 0, left + 0.5 * scale - 0.5], [0, scale, top + 0.5 * scale - 0.5]])
            how = cv2.INTER_AREA if scale < 1 else cv2.INTER_LINEAR
            self._image = cv2.warpAffine(
                self._whole, matrix, self.area.size, flags=how, borderMode=cv2.BORDER_CONSTANT,
                borderValue=tuple(map(float, self.theme.paper)),
            )  # fmt: skip
            self._shown = key
        return self._image

    def _at(self, xy):
        """Pixels of the canvas of places in the picture."""
        scale, left, top = self.view.matrix(self.album.frames[self.k].size, self.area)
        return np.asarray(xy, float) * scale + (left, top)

    def _place(self, at):
        """The place in the picture of a pixel of the canvas."""
        scale, left, top = self.view.matrix(self.album.frames[self.k].size, self.area)
        return (at[0] - left) / scale, (at[1] - top) / scale

    def _radius(self):
        scale = self.view.matrix(self.album.frames[self.k].size, self.area)[0]
        return max(px(self.scale, 8), 0.62 * self.album.wingspan * scale)

    def _birds(self):
        """The birds, with the dragged one at the mouse."""
        birds = self.album.birds(self.k)
        if self._held is not None and self._held[0] == "bird" and self._far():
            birds[self._held[1]] = Mark(*self._place(self._held[3]), "hand")
        return birds

    def _draw_marks(self, canvas):
        birds, radius, u = self._birds(), self._radius(), self.scale
        shape = self.album.shape(self.k, self.heading, birds)
        ink, halo = self.theme.ink, self.theme.paper
        if shape is not None and len(shape.curve):
            line = self._at(shape.curve)
            canvas.line(line, 4.5 * u, halo, 0.75)
            canvas.line(line, 2.2 * u, chrome(self.theme).accent)
        self._labels = {}
        partly = self.album.partly()
        for bird, mark in birds.items():
            at = self._at(mark[:2])
            leads = shape is not None and bird == shape.leader and shape.kind != "none"
            off = shape is not None and bird in shape.outliers
            colour = self.theme.leader if leads else self.theme.predator if off else ink
            canvas.ring(at, radius, 4.2 * u, self.theme.outline if leads else halo, 0.8)
            canvas.ring(at, radius, 2.0 * u, colour, dash=(5 * u, 4 * u) if bird in partly else None)
            if mark.by != "found":
                canvas.disc(at, 3.6 * u, halo)
                canvas.disc(at, 2.4 * u, rgb(chrome(self.theme).accent))
            self._draw_number(canvas, bird, at + (0.72 * radius, -0.72 * radius), ink, halo)
        if self._held is not None and self._held[0] == "number" and self._far():
            self._draw_number(canvas, self._held[1], np.array(self._held[3]), chrome(self.theme).accent, halo, False)

    def _draw_number(self, canvas, bird, corner, ink, halo, keep=True):
        height = px(self.scale, 15)
        tall, wide = written(str(bird), height).shape
        canvas.words(str(bird), corner, height, ink, anchor=(0, 1), halo=halo)
        if keep:
            place = pygame.Rect(round(corner[0]), round(corner[1]) - tall, wide, tall)
            self._labels[bird] = place.inflate(px(self.scale, 6), px(self.scale, 4))

    # what a person does ---------------------------------------------------------------------

    def _key(self, key):
        step = {"left": -1, "right": 1, "pageup": -10, "pagedown": 10, "home": -len(self.album), "end": len(self.album)}
        does = {
            "ctrl+z": self.undo, "ctrl+shift+z": self.redo, "ctrl+y": self.redo, "ctrl+s": self.save, "0": self.fit,
            "h": self.turn, "ctrl+q": self.ask_to_quit, "escape": self.let_go,
        }  # fmt: skip
        if key in step:
            self.go(self.k + step[key])
        elif key in does:
            does[key]()

    def _of_parts(self, event):
        if event.type != pygame_gui.UI_HORIZONTAL_SLIDER_MOVED or event.ui_element is not self.slider:
            return False
        self.go(round(event.value), slide=False)
        return True

    def _wheel(self, notches, at):
        self.view.wheel(notches, at, self.album.frames[self.k].size, self.area)

    def _press(self, at, button):
        bird, number = self.bird_at(at), self._number_at(at)
        if button == 3 and bird is not None:
            self.album.remove(self.k, bird)
        elif button == 2:
            self._held = "view", None, at, at, button
        elif button == 1:
            what = "number" if number is not None else "bird" if bird is not None else "sky"
            self._held = what, bird if number is None else number, at, at, button

    def bird_at(self, at) -> int | None:
        """The bird at a pixel of the canvas."""
        reach = max(self._radius(), px(self.scale, GRAB))
        far = {b: float(np.hypot(*(self._at(mark[:2]) - at))) for b, mark in self.album.birds(self.k).items()}
        return min((b for b in far if far[b] <= reach), key=lambda b: far[b], default=None)

    def _number_at(self, at):
        """The bird whose number is at a pixel, unless a bird itself is nearer its middle."""
        bird = self.bird_at(at)
        if bird is not None:
            middle = self._at(self.album.birds(self.k)[bird][:2])
            if np.hypot(*(middle - at)) < 0.7 * self._radius():
                return None
        return next((b for b, place in self._labels.items() if place.collidepoint(at)), None)

    def _far(self):
        """Whether the mouse has moved farther than in a click."""
        return np.hypot(*np.subtract(self._held[2], self._held[3])) > px(self.scale, STILL)

    def _drag(self, at):
        what, bird, start, last, button = self._held
        if what == "view" or (what == "sky" and self._far()):
            self.view.shift += np.subtract(at, last)
            what = "view"
        self._held = what, bird, start, at, button

    def _release(self, at):
        what, bird = self._held[:2]
        far, self._held = self._far(), None
        if what == "sky":
            self._add(self._place(at))
        elif what == "bird" and far:
            self.album.move(self.k, bird, *self._place(at))
        elif what == "number" and far:
            other = self.bird_at(at)
            if other is not None and other != bird:
                self.album.swap(self.k, bird, other)

    def _add(self, place):
        wide, tall = self.album.frames[self.k].size
        if 0 <= place[0] < wide and 0 <= place[1] < tall:
            self.album.add(self.k, *place)

    def go(self, k, slide=True):
        """Show another frame."""
        k = min(max(k, 0), len(self.album) - 1)
        self._held = None
        if k != self.k:
            self.k = k
            if self.slider is not None and slide:
                self.slider.set_current_value(k)
                self.slider.has_moved_recently = False

    def fit(self):
        """Show the whole picture."""
        self.view = PictureView()

    def turn(self):
        """Select the next heading of the birds."""
        self.heading = WAYS[(WAYS.index(self.heading) + 1) % len(WAYS)]
        self.way.set_text(self._way())

    def undo(self):
        """Undo the last correction."""
        self._after(self.album.undo(), "undone")

    def redo(self):
        """Redo the change that was undone last."""
        self._after(self.album.redo(), "redone")

    def _after(self, step, how):
        self._held = None
        if step is not None:
            self.go(step.where)
            self.toasts.say(f"{step.label}: {how}")

    def save(self) -> bool:
        """Write the marks; returns whether it worked."""
        if self.guarded(self._write) is None:
            return False
        count = len(set(self.album.birds(0)) - set(self.album.partly()))
        frames = f" in {len(self.album)} frames" if len(self.album) > 1 else ""
        self.toasts.say(f"{count} birds{frames} saved in {self.out}")
        self._tell_partly()
        return True

    def _write(self):
        self.album.save(self.out)
        return self.out

    def _tell_partly(self):
        """Tell which birds are not marked in all frames; they are not saved."""
        partly = self.album.partly()
        if partly:
            some = ", ".join(f"{bird} ({n})" for bird, n in list(partly.items())[:8])
            more = ", …" if len(partly) > 8 else ""
            said = f"Dashed birds are not marked in all {len(self.album)} frames and will not be saved: {some}{more}"
            self.toasts.say(said, "warning")

    @property
    def unsaved(self):
        """A sentence about corrections that are not saved, "" when all are."""
        return f"{self.out} has unsaved corrections." if self.album.dirty else ""

    def leave(self, keep=False):
        """Unsaved corrections are saved if they are to be kept."""
        if not keep or not self.album.dirty:
            return ""
        self.album.save(self.out)
        return f"{self.out}: corrections were saved before the program ended"

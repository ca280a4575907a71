"""The base class of all windows: the main loop, events, sizes, messages, questions, and windows opened over others."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from typing import Any

import numpy as np
import pygame
import pygame_gui
from pygame_gui.elements import UITextEntryBox, UITextEntryLine

from flockbrush.engine.problems import ProblemsError
from flockbrush.render.style import theme_of
from flockbrush.runs.terminal import debugging, say
from flockbrush.studio.dialogs import Dialog
from flockbrush.studio.manager import Manager
from flockbrush.studio.opening_key import OpeningKey
from flockbrush.studio.settings import load_settings
from flockbrush.studio.shortcuts import key_of
from flockbrush.studio.theme import look, px, scale_of
from flockbrush.studio.toasts import Toasts
from flockbrush.studio.widgets import icon_row


class Window:
    """A window of the studio.

    A subclass has `build` (all controls, beginning with `begin`), `frame` (one frame; it calls `events`), and handles
    what no control has used: `_key` (a key by its name), and `_press`, `_drag`, `_release` and `_wheel` in pixels of
    `area`, the canvas.  What the mouse holds between press and release is `_held`, a tuple that ends with the button.

    Parameters
    ----------
    theme : str, optional
        The one in the settings unless given.
    palette : str, optional
        Colours of brushes; the one in the settings unless given.
    scale : float, optional
        Size of text and buttons; the one in the settings unless given, else found from window and screen.

    Attributes
    ----------
    manager : Manager
        Of all controls.
    buttons : dict
        What a button does, by the button.
    dialog : Dialog or None
        While one is open it gets all input.
    running : bool
        Until the window is closed.
    """

    smallest = 480, 360  # pixels
    repeat = 350, 40  # ms until a key that is held counts again, and from then on
    rate = 60  # frames per second, at most
    counted = True  # whether its frames count for `run`

    def __init__(self, theme=None, palette=None, scale=None):
        self.settings, self.settings_problem = load_settings()
        self.theme = theme_of(theme or self.settings.theme or "light", palette or self.settings.palette)
        self.wanted_scale = scale or self.settings.ui_scale
        self.running, self.toasts = True, Toasts()
        self.dialog: Dialog | None = None
        self.buttons: dict = {}
        self._held: tuple | None = None  # what the mouse holds
        self._opening_key = OpeningKey()
        self._keys_down: set[int] = set()
        self.failed = False  # whether it was closed by an exception
        self._over: Window | None = None  # to be opened over this one

    # making the window -------------------------------------------------------------

    def open(self, size):
        """Open the window with everything in it."""
        self.open_screen(size)
        self.build()

    def open_screen(self, size):
        """Open the window, still empty."""
        pygame.display.init()
        pygame.font.init()
        pygame.display.set_caption(self.title())
        self.screen = pygame.display.set_mode(self._least(size), pygame.RESIZABLE)
        pygame.key.set_repeat(*self.repeat)
        pygame.event.set_blocked([pygame.JOYDEVICEADDED, pygame.AUDIODEVICEADDED])

    def title(self) -> str:
        """The window title."""
        return "Flockbrush"

    def build(self):
        """Build all controls for the window size, the theme and the scale."""

    def begin(self):
        """Make a new manager for the controls; returns the window size."""
        size = self.screen.get_size()
        self.scale = scale_of(size, _screen_height(), self.wanted_scale)
        self.manager = Manager(size, look(self.theme, self.scale))
        self.buttons, self.dialog = {}, None
        return size

    def _least(self, size):
        return max(self.smallest[0], int(size[0])), max(self.smallest[1], int(size[1]))

    def resize(self, size):
        """Handle a new window size; an unfinished action ends."""
        self.let_go()
        size = self._least(size)
        if size != self.screen.get_size():
            self.screen = pygame.display.set_mode(size, pygame.RESIZABLE)
        self.build()

    # the main loop -----------------------------------------------------------------

    def run(self, frames=None, stop=lambda: False):
        """Run the main loop until the window is closed, for some frames, or until `stop()`.

        A window that is opened over this one runs until it is closed, or fails; then this one goes on.
        """
        clock, shown, ended_well = pygame.time.Clock(), [self], False
        self.started()
        try:
            while shown and frames != 0 and not stop():
                top = shown[-1]
                dt = min(clock.tick(top.rate) / 1000, 0.25)
                if len(shown) > 1:
                    shown[-2].guarded(top.frame_or_quit, dt)
                else:
                    top.frame(dt)
                frames = None if frames is None else frames - top.counted
                self._next_window(shown, top)
            ended_well = not stop()
        finally:
            for window in shown:
                if window is not self:
                    window.leave_saying(keep=not ended_well)

    def _next_window(self, shown, top):
        """After a frame of the window on top: take it away if it is closed, and show the one that it has opened."""
        over, top._over = top._over, None
        if not top.running:
            shown.pop()
            if top is not self:
                top.leave_saying(keep=top.failed)
        if over is not None:
            shown.append(over)
            over.started()
        elif shown and shown[-1] is not top:
            shown[-1].open(top.screen.get_size())

    def started(self):
        """Called when the main loop shows the window for the first time."""

    def frame(self, dt):
        """Run one frame, `dt` seconds after the last one, without waiting."""
        raise NotImplementedError

    def frame_or_quit(self, dt):
        """Run one frame; if it fails, the window is closed, and unsaved changes are kept."""
        try:
            self.frame(dt)
        except Exception:
            self.failed = True
            self.quit()
            raise

    def open_over(self, window):
        """Show another window in place of this one until it is closed."""
        self.let_go()
        self._over = window

    def leave(self, keep=False) -> str:
        """Release what the window holds.

        Parameters
        ----------
        keep : bool
            Keep unsaved changes: the program was interrupted or failed.

        Returns
        -------
        str
            A sentence about what was kept, "" for nothing.
        """
        return ""

    def leave_saying(self, keep=False):
        """Release what the window holds, and print what was kept."""
        kept = self.leave(keep)
        if kept:
            say(kept)

    def close(self, keep=False):
        """Release what the window holds, and close it."""
        self.leave_saying(keep)
        with contextlib.suppress(pygame.error):
            if pygame.display.get_init():
                pygame.event.get()  # clear() and quit() would keep for ever the controls that waiting events speak of
                pygame.display.quit()

    # events ------------------------------------------------------------------------

    def events(self):
        """Handle all events since the last frame; of resizes in a row only the last.

        Keys repeat by a clock that goes on while a frame takes long: a key that was let go since was pressed once.
        """
        waiting: list = []
        since = pygame.event.get()
        let_go = {event.key for event in since if event.type == pygame.KEYUP}
        for event in since:
            if event.type == pygame.WINDOWFOCUSLOST:  # others hear of keys that are let go from then on
                self._keys_down.clear()
            elif event.type == pygame.KEYUP:
                self._keys_down.discard(event.key)
            elif event.type == pygame.KEYDOWN:
                if event.key in self._keys_down & let_go:
                    continue
                self._keys_down.add(event.key)
            if event.type == pygame.VIDEORESIZE and waiting and waiting[-1].type == pygame.VIDEORESIZE:
                waiting.pop()
            waiting.append(event)
        for event in waiting:
            self.guarded(self.handle, event)

    def guarded(self, do, *arguments):
        """Call a function; an exception becomes a message, and the window continues."""
        try:
            return do(*arguments)
        except Exception as error:
            if debugging() and not isinstance(error, (ProblemsError, OSError)):
                raise
            self.notify(said(error), "error")
        return None

    def handle(self, event):
        """Handle one event: of the window itself, then the dialog, the controls, the keyboard and the mouse."""
        if event.type == pygame.QUIT:
            self.ask_to_quit()
        elif event.type == pygame.VIDEORESIZE:
            self.resize(event.size)
        elif event.type in (pygame.WINDOWFOCUSLOST, pygame.WINDOWLEAVE):
            self._left(event)
        elif self.asking:
            self._of_dialog(event)
        else:
            self.dialog = None
            if not self._is_of_controls(event):
                self._of_canvas(event)
            if event.type == pygame.KEYDOWN and self.asking:
                self._opening_key.opened(event)

    @property
    def asking(self) -> bool:
        """Whether a dialog is open."""
        return self.dialog is not None and self.dialog.alive()

    def _of_dialog(self, event):
        """Give an event to the dialog, but not the letter of the key that has opened it."""
        if not self._opening_key.is_its_text(event):
            self.manager.process_events(event)
            self.dialog.handle(event)

    def _is_of_controls(self, event) -> bool:
        """Whether a control has used an event."""
        key = event.type in (pygame.KEYDOWN, pygame.KEYUP)
        if key and not self._is_typing():
            return False
        if self._is_dragging():  # a drag that leaves the canvas goes on
            return False
        if self._of_strip(event):
            return True
        # no control wants to hear of movements (they look where the mouse is), and asking them all takes long
        taken = event.type != pygame.MOUSEMOTION and self.manager.process_events(event)
        if event.type == pygame_gui.UI_BUTTON_PRESSED and event.ui_element in self.buttons:
            self.buttons[event.ui_element]()
            return True
        return taken or self._of_parts(event) or key  # letters that are typed are not keys of tools

    def _is_typing(self):
        focus = self.manager.get_focus_set() or ()
        return any(isinstance(element, (UITextEntryLine, UITextEntryBox)) for element in focus)

    def _is_dragging(self) -> bool:
        """Whether the mouse holds something on the canvas."""
        return self._held is not None

    def _of_strip(self, event) -> bool:
        """Whether a strip that is drawn above the controls has used an event."""
        return False

    def _of_parts(self, event) -> bool:
        """Whether a column or another part with controls has used an event."""
        return False

    def _of_canvas(self, event):
        """Handle keys and mouse that are not for a control."""
        if event.type == pygame.KEYDOWN:
            self._pressed_key(event)
        else:
            self._mouse(event)

    def _pressed_key(self, event):
        """Handle a key that was pressed."""
        self._key(key_of(event))

    def _mouse(self, event):
        """Handle the mouse on the canvas."""
        if event.type == pygame.MOUSEBUTTONDOWN and self._held is None and self.area.collidepoint(event.pos):
            if event.button <= 3 and not self.toasts.click(event.pos):
                self._press(self._inside(event.pos), event.button)
        elif event.type == pygame.MOUSEMOTION and self._held is not None:
            self._drag(self._inside(event.pos))
        elif event.type == pygame.MOUSEBUTTONUP and self._held is not None and event.button == self._held[-1]:
            self._drag(self._inside(event.pos))
            self._release(self._inside(event.pos))
        elif event.type == pygame.MOUSEWHEEL and self.area.collidepoint(pygame.mouse.get_pos()):
            self._wheel(event.y, self._inside(pygame.mouse.get_pos()))

    def _inside(self, position):
        """A pixel of the window as one of the canvas."""
        return np.array([position[0] - self.area.x, position[1] - self.area.y], float)

    def _left(self, event):
        """The mouse has left the window, or the window has lost the keyboard."""
        if event.type == pygame.WINDOWFOCUSLOST:
            self.let_go()

    def let_go(self):
        """End what mouse and keys hold."""
        self._held = None

    # messages and questions ----------------------------------------------------------

    def notify(self, text, kind="info"):
        """Show a message."""
        self.toasts.say(text, kind)

    def ask(self, title, question, answers, entry=None):
        """Ask a question with some answers (text, function or None), the first is the default; see `Dialog`."""
        self.open_dialog(Dialog(self, title, question, answers, entry))

    def open_dialog(self, dialog):
        """Show a dialog in place of the one that is open."""
        self.let_go()
        if self.asking:
            self.dialog.kill()
        self.dialog = dialog

    @property
    def unsaved(self) -> str:
        """A sentence about what is not saved, "" when everything is."""
        return ""

    def save(self) -> bool:
        """Save everything; returns whether it worked."""
        return True

    def ask_to_quit(self):
        """Close the window; ask first if there is something that is not saved."""
        if self.unsaved:
            answers = [("Save", self._save_and_quit), ("Discard changes", self.quit), ("Cancel", None)]
            self.ask("Quit", self.unsaved, answers)
        else:
            self.quit()

    def _save_and_quit(self):
        if self.save():
            self.quit()

    def quit(self):
        """Close the window after this frame."""
        self.running = False


class FramesWindow(Window):
    """A window that plays the frames of something in `area`, beside a column."""

    column: Any
    count: int  # of frames
    step: Callable  # so many frames on
    toggle_play: Callable

    def keys(self) -> dict:
        """What keys do, by their names, beside stepping through the frames."""
        return {}

    def _key(self, key):
        steps = {"left": -1, "right": 1, "pageup": -10, "pagedown": 10, "home": -self.count, "end": self.count}
        if key in steps:
            self.step(steps[key])
        else:
            self.keys().get(key, lambda: None)()

    def _of_parts(self, event):
        return self.column.handle(event)

    def frame_buttons(self, back, *more) -> list:
        """Buttons at the left of a bar: to step back, to play, to step on, and more (icon, tip, what a press does)."""
        side, gap = px(self.scale, 34), px(self.scale, 3)
        icons = (
            ("back", "Previous frame (Left)", lambda: self.step(-1)),
            ("play", "Play or pause (Space)", self.toggle_play),
            ("step", "Next frame (Right)", lambda: self.step(1)),
            *more,
        )
        return icon_row(self, pygame.Rect(px(self.scale, 8), px(self.scale, 6), side, side), side + gap, icons, back)

    def show_image(self, image):
        """Put a picture (h, w, 3) of the area onto the screen, and messages and controls above it."""
        self.screen.blit(pygame.image.frombuffer(image.tobytes(), self.area.size, "RGB"), self.area)
        self.toasts.draw(self.screen, self.area, self.theme, self.scale)
        self.manager.draw_ui(self.screen)


def said(error) -> str:
    """The message of an exception for the user."""
    if isinstance(error, OSError) and error.strerror:
        return f"{error.filename}: {error.strerror}" if error.filename else error.strerror
    known = isinstance(error, (ValueError, OSError, ProblemsError)) or type(error) is LookupError
    text = str(error.args[0] if type(error) is LookupError and error.args else error)
    return text if known and text else f"this failed: {type(error).__name__}: {text}"


def _screen_height():
    try:
        return max((height for _, height in pygame.display.get_desktop_sizes()), default=0)
    except pygame.error:
        return 0

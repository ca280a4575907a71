"""The window that is shown while a level or a flight is read and kernels are compiled."""

from __future__ import annotations

import threading

import pygame

from flockbrush.studio.theme import chrome, font, px, scale_of
from flockbrush.studio.window import Window

PATIENCE = 1.5  # s after which it is told why this takes so long
OPENING = "Opening the level …", "Compiling kernels (only at the first start) …"
FEW = 8  # animals of the herd that tries all kernels


class Opening(Window):
    """Runs a function in a thread while a window shows the progress, then shows the window that is made of its result.

    Parameters
    ----------
    title : str
        What is opened.
    work : callable
        What takes long.
    then : callable
        Called with the result of the work and the size of the window; returns the window to show.
    doing : (str, str)
        What the window says, and what it says after some time.
    """

    smallest = 1, 1
    rate = 30
    counted = False

    def __init__(self, title, size, theme, work, then, doing=OPENING):
        super().__init__(theme)
        self.name, self.work, self.then, self.doing = title, work, then, doing
        self.seconds, self.result, self.error = 0.0, None, None
        self.open(size)
        self._thread = threading.Thread(target=self._do, name="opening", daemon=True)

    def title(self):
        return f"Opening {self.name} … – Flockbrush"

    def started(self):
        self._thread.start()

    def _do(self):
        try:
            self.result = self.work()
        except BaseException as error:  # noqa: BLE001  the main loop handles it
            self.error = error

    def frame(self, dt):
        self.seconds += dt
        self.events()
        if self._thread.is_alive():
            self.draw(self.seconds)
        elif self.running:
            self.quit()
            if self.error is not None:
                raise self.error
            self.open_over(self.then(self.result, self.screen.get_size()))

    def _is_of_controls(self, event):
        """There are no controls, and nothing to be done by hand."""
        return True

    def draw(self, seconds):
        """Draw the name, the reason for the wait, and a moving bar."""
        screen, c = self.screen, chrome(self.theme)
        scale = scale_of(screen.get_size())
        width, height = screen.get_size()
        screen.fill(c.panel)
        why = self.doing[seconds > PATIENCE]
        for text, size, colour, y in ((self.name, 24, c.ink, -30), (why, 14, c.muted, 8)):
            words = font(px(scale, size), size > 20).render(text, True, colour)
            screen.blit(
                words, words.get_rect(center=(width // 2, height // 2 + px(scale, abs(y)) * (1 if y > 0 else -1)))
            )
        track = pygame.Rect(0, 0, min(px(scale, 240), width - 20), px(scale, 4))
        track.center = width // 2, height // 2 + px(scale, 40)
        pygame.draw.rect(screen, c.sunken, track, border_radius=px(scale, 2))
        way = abs((seconds * 0.7) % 2 - 1) * (track.width - track.width // 4)
        slider = pygame.Rect(track.x + round(way), track.y, track.width // 4, track.height)
        pygame.draw.rect(screen, c.accent, slider, border_radius=px(scale, 2))
        pygame.display.flip()


def try_kernels(name, seed=None):
    """Let a few animals of a level live and be drawn, so that all is compiled before the window needs it."""
    from flockbrush.output.pictures import herd_of
    from flockbrush.render import Painter
    from flockbrush.render.space_view import SpacePainter
    from flockbrush.runs.run import start
    from flockbrush.runs.snapshots import moment_of

    try:
        simulation = start(name, seed, FEW)
    except (ValueError, LookupError):  # without spawns there is nobody to try with
        return
    try:
        simulation.run(2)
        herd = herd_of(simulation, moment_of(simulation, labels=()))
        for kind in (Painter, SpacePainter):
            kind(simulation.level, (320, 240), words=False).frame(herd, time=0.0)
    finally:
        simulation.close()

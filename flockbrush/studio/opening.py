"""The start window, which is shown while the level is read and kernels are compiled."""

from __future__ import annotations

import threading

import pygame

from flockbrush.render.style import Theme
from flockbrush.studio.theme import chrome, font, px, scale_of

PATIENCE = 1.5  # s after which it is told why this takes so long
FEW = 8  # animals of the herd that tries all kernels


class Opening:
    """Runs a function in a thread while a window shows the progress.

    Parameters
    ----------
    work : callable
        What takes long; its result is that of `wait`.
    """

    def __init__(self, title, size, theme: Theme, work):
        self.title, self.theme, self.work = title, theme, work
        self.result = self.error = None
        pygame.display.init()
        pygame.font.init()
        pygame.display.set_caption(f"Opening {title} … – Flockbrush")
        self.screen = pygame.display.set_mode(size, pygame.RESIZABLE)
        self._thread = threading.Thread(target=self._do, name="opening", daemon=True)

    def _do(self):
        try:
            self.result = self.work()
        except BaseException as error:  # noqa: BLE001  it belongs to whoever waits
            self.error = error

    def wait(self, stop=lambda: False):
        """The result of the work, or None when the window was closed before; what went wrong is raised here."""
        self._thread.start()
        clock, seconds = pygame.time.Clock(), 0.0
        while self._thread.is_alive():
            seconds += clock.tick(30) / 1000
            if stop() or any(event.type == pygame.QUIT for event in pygame.event.get()):
                return None
            self.draw(seconds)
        if self.error is not None:
            raise self.error
        return self.result

    def draw(self, seconds):
        """The level's name, why one waits, and something that moves."""
        screen, c = self.screen, chrome(self.theme)
        scale = scale_of(screen.get_size())
        width, height = screen.get_size()
        screen.fill(c.panel)
        why = "Compiling kernels (only at the first start) …" if seconds > PATIENCE else "Opening the level …"
        for text, size, colour, y in ((self.title, 24, c.ink, -30), (why, 14, c.muted, 8)):
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
    from flockbrush.runs.run import start
    from flockbrush.runs.snapshots import moment_of

    try:
        simulation = start(name, seed, FEW)
    except (ValueError, LookupError):  # without spawns there is nobody to try with
        return
    try:
        simulation.run(2)
        painter = Painter(simulation.level, (320, 240), words=False)
        painter.frame(herd_of(simulation, moment_of(simulation, labels=False)), time=0.0)
    finally:
        simulation.close()

"""The bar below a clip: play, step, and a strip of all frames to scrub in."""

from __future__ import annotations

import pygame
from pygame_gui.elements import UIPanel

from flockbrush.studio.theme import chrome, px
from flockbrush.studio.widgets import NO_MARGINS, set_icon, words


class FilmBar:
    """Buttons and strip for the frames of a clip.

    Parameters
    ----------
    window : ClipWindow
    rect : pygame.Rect
    """

    def __init__(self, window, rect):
        self.app, self.rect, self.dragging = window, rect, False
        self.back = UIPanel(rect, 1, window.manager, margins=NO_MARGINS, object_id="@bar")
        _, self.play, last = window.frame_buttons(self.back)
        wide = px(window.scale, 190)
        tall = px(window.scale, 22)
        clock = pygame.Rect(rect.width - wide - px(window.scale, 10), px(window.scale, 12), wide, tall)
        self.clock = words(window, clock, "", self.back, "@right")
        left = rect.x + last.relative_rect.right + px(window.scale, 3) + px(window.scale, 12)
        room = max(20, rect.x + clock.x - px(window.scale, 12) - left)
        self.strip = pygame.Rect(left, rect.y + px(window.scale, 10), room, px(window.scale, 26))
        line = pygame.Rect(px(window.scale, 10), px(window.scale, 42), rect.width - px(window.scale, 20), 0)
        line.height = tall
        self.hint = words(window, line, "", self.back, "@note")

    def freshen(self):
        """Show what is so now."""
        app = self.app
        set_icon(app, self.play, "pause" if app.playing else "play")
        self.clock.say(app.film.caption(app.k))
        jobs = "   ".join(f"{job.name}: {100 * job.share:.0f} %" for job in app.jobs.values())
        self.hint.say(jobs or app.mode.hint)

    def x_of(self, k):
        """Where a frame is on the strip, pixels of the window."""
        return self.strip.x + round((self.strip.width - 1) * k / max(1, len(self.app.film) - 1))

    def draw(self, screen):
        """The strip onto the window."""
        app, c, strip = self.app, chrome(self.app.theme), self.strip
        u = app.scale
        bar = pygame.Rect(strip.x, strip.centery - px(u, 5), strip.width, px(u, 10))
        pygame.draw.rect(screen, c.sunken, bar, border_radius=px(u, 4))
        marks = app.book.state.marks
        first, last = marks.first or 0, len(app.film) - 1 if marks.last is None else marks.last
        used = pygame.Rect(self.x_of(first), bar.y, max(px(u, 3), self.x_of(last) - self.x_of(first)), bar.height)
        faded = tuple((a + 2 * b) // 3 for a, b in zip(c.accent, c.sunken, strict=True))
        pygame.draw.rect(screen, faded, used, border_radius=px(u, 4))
        for k, colour in app.mode.moments():
            x = self.x_of(k)
            pygame.draw.line(screen, colour, (x, bar.top - px(u, 4)), (x, bar.bottom + px(u, 3)), px(u, 2))
        for job in app.jobs.values():
            progress_bar = pygame.Rect(bar.x, bar.bottom + px(u, 3), round(bar.width * job.share), px(u, 3))
            pygame.draw.rect(screen, c.warning, progress_bar)
        at = self.x_of(app.k), bar.centery
        pygame.draw.circle(screen, c.ink, at, px(u, 8))
        pygame.draw.circle(screen, c.raised, at, px(u, 5))

    def mouse(self, event) -> bool:
        """Scrub along the strip; whether the event was ours."""
        if (
            event.type == pygame.MOUSEBUTTONDOWN
            and event.button == 1
            and self.strip.inflate(8, 8).collidepoint(event.pos)
        ):
            self.dragging = True
        elif not self.dragging or event.type not in (pygame.MOUSEMOTION, pygame.MOUSEBUTTONUP):
            return False
        self.app.go(round((event.pos[0] - self.strip.x) / max(1, self.strip.width - 1) * (len(self.app.film) - 1)))
        if event.type == pygame.MOUSEBUTTONUP:
            self.dragging = False
        return True

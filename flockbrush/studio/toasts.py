"""Short messages that come, can be read, and go."""

from __future__ import annotations

from dataclasses import dataclass, field

import pygame

from flockbrush.render.style import Theme
from flockbrush.studio.theme import chrome, font, px

STAYS = {"info": 4.0, "warning": 8.0, "error": 14.0}  # s
MOST = 4  # at once; older ones go


@dataclass
class Toast:
    """One message."""

    text: str
    kind: str  # info | warning | error
    left: float  # s
    times: int = 1
    picture: pygame.Surface | None = field(default=None, repr=False)
    rect: pygame.Rect = field(default_factory=lambda: pygame.Rect(0, 0, 0, 0))


class Toasts:
    """The messages on the canvas, newest at the bottom; a click takes one away."""

    def __init__(self):
        self.shown: list[Toast] = []
        self.log: list[Toast] = []  # everything said, for tests and for the curious
        self._look = None

    def say(self, text, kind="info"):
        """Show a message; the same one again is counted instead of shown twice."""
        kind = kind if kind in STAYS else "info"
        text = str(text).strip() or "an error occurred"
        for toast in self.shown:
            if toast.text == text:
                toast.left, toast.times, toast.picture = STAYS[kind], toast.times + 1, None
                return
        toast = Toast(text, kind, STAYS[kind])
        self.log.append(toast)
        del self.log[:-200]
        self.shown.append(toast)
        del self.shown[:-MOST]

    def update(self, dt):
        """Let time pass."""
        for toast in self.shown:
            toast.left -= dt
        self.shown = [toast for toast in self.shown if toast.left > 0]

    def click(self, position) -> bool:
        """Take away the message at a position of the window; whether there was one."""
        for toast in self.shown:
            if toast.rect.collidepoint(position):
                self.shown.remove(toast)
                return True
        return False

    def draw(self, screen, area: pygame.Rect, theme: Theme, scale: float):
        """Draw them upwards from the bottom of an area."""
        if (theme, scale, area.width) != self._look:
            self._look = (theme, scale, area.width)
            for toast in self.shown:
                toast.picture = None
        gap, y = px(scale, 8), area.bottom - px(scale, 10)
        for toast in reversed(self.shown):
            if toast.picture is None:
                toast.picture = picture_of(toast, min(px(scale, 460), area.width - 2 * gap), theme, scale)
            y -= toast.picture.get_height()
            toast.rect = toast.picture.get_rect(midtop=(area.centerx, y))
            if toast.rect.top < area.top:
                break
            screen.blit(toast.picture, toast.rect)
            y -= gap


def picture_of(toast: Toast, width: int, theme: Theme, scale: float) -> pygame.Surface:
    """The card of a message, at most so wide."""
    c, letters, pad = chrome(theme), font(px(scale, 13)), px(scale, 10)
    text = toast.text + (f"  (×{toast.times})" if toast.times > 1 else "")
    lines = wrapped(text, letters, max(20, width - 3 * pad))[:8]
    line = letters.get_linesize()
    wide = min(width, max(letters.size(part)[0] for part in lines) + 3 * pad)
    card = pygame.Surface((max(8, wide), len(lines) * line + round(1.4 * pad)), pygame.SRCALPHA)
    colour = {"info": c.accent, "warning": c.warning, "error": c.error}[toast.kind]
    pygame.draw.rect(card, c.raised, card.get_rect(), border_radius=px(scale, 5))
    pygame.draw.rect(card, c.border, card.get_rect(), 1, border_radius=px(scale, 5))
    bar = pygame.Rect(0, 0, px(scale, 4), card.get_height())
    pygame.draw.rect(card, colour, bar, border_top_left_radius=px(scale, 5), border_bottom_left_radius=px(scale, 5))
    for k, part in enumerate(lines):
        card.blit(letters.render(part, True, c.ink), (round(1.5 * pad), round(0.7 * pad) + k * line))
    return card


def wrapped(text: str, letters, room: int) -> list[str]:
    """The text in lines of at most so many pixels; words that are too long are cut."""
    lines = []
    for paragraph in text.splitlines() or [""]:
        line = ""
        for word in paragraph.split(" "):
            trial = f"{line} {word}" if line else word
            if letters.size(trial)[0] <= room:
                line = trial
                continue
            if line:
                lines.append(line)
            while letters.size(word)[0] > room and len(word) > 1:
                fits = next(n for n in range(len(word) - 1, 0, -1) if n == 1 or letters.size(word[:n])[0] <= room)
                lines.append(word[:fits])
                word = word[fits:]
            line = word
        lines.append(line)
    return lines

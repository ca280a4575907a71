"""The legend of brush colours and the scale bar on the canvas."""

from __future__ import annotations

import numpy as np
import pygame

from flockbrush.render.animal_figures import KINDS, LEADER, NO_WINGS, PLAIN, PREDATOR, figure
from flockbrush.render.brush_marks import swatch
from flockbrush.render.drawn_ground import brush_key
from flockbrush.render.drawn_terrain import nice
from flockbrush.render.hud import PATCH
from flockbrush.render.painter import brush_rgb, brushes_in_sight
from flockbrush.render.shapes import Pose
from flockbrush.render.sprites import Stamps
from flockbrush.render.style import worn
from flockbrush.studio.theme import chrome, font, px

MOST = 8  # brushes in the legend; the rest is counted
FRESH = 0.3  # s between two counts


class Legend:
    """Names the colours of the animals on the canvas, with their numbers."""

    def __init__(self, app):
        self.app = app
        self.picture = None
        self._wait, self._said = 0.0, None

    def update(self, dt):
        """Count again now and then; draw the card anew only when it changes."""
        self._wait -= dt
        herd = self.app.canvas.herd
        if self._wait > 0 or herd is None:
            return
        self._wait = FRESH
        painted = frozenset(brushes_in_sight(self.app.canvas.painter.level))
        content = (self._entries(herd), tuple(herd.brush_colours), self.app.theme, self.app.scale, painted)
        if content != self._said:
            self._said = content
            self.picture = self._card(herd, content[0], painted)

    def _entries(self, herd):
        """((name, kind of figure, brush index, count), ...) in the order they are shown."""
        predator = np.zeros(len(herd.xy), bool) if herd.predator is None else herd.predator
        names = herd.brush_names
        counts = np.bincount(herd.brush[~predator], minlength=len(names)) if len(herd.xy) else []
        order = [k for k in np.argsort(-np.asarray(counts), kind="stable") if counts[k]] if len(names) else []
        rows = [(str(names[k]), PLAIN, int(k), int(counts[k])) for k in order[:MOST]]
        if len(order) > MOST:
            rows.append((f"{len(order) - MOST} more", -1, 0, int(sum(counts[k] for k in order[MOST:]))))
        leaders = int(np.sum(herd.leader)) if herd.leader is not None else 0
        if leaders:
            rows.append(("leaders" if leaders > 1 else "leader", LEADER, int(order[0]) if order else 0, leaders))
        if predator.any():
            rows.append(("predators" if predator.sum() > 1 else "predator", PREDATOR, 0, int(predator.sum())))
        return tuple(rows)

    def _card(self, herd, rows, painted):
        app, c, u = self.app, chrome(self.app.theme), self.app.scale
        letters = font(px(u, 12))
        line, pad = letters.get_linesize() + px(u, 2), px(u, 8)
        if not rows:
            return None
        names = max(letters.size(name)[0] for name, *_ in rows)
        numbers = max(letters.size(f"{count:,}")[0] for *_, count in rows)
        size = (2 * pad + px(u, 28) + names + px(u, 14) + numbers, 2 * pad + line * len(rows) - px(u, 2))
        card = pygame.Surface(size, pygame.SRCALPHA)
        pygame.draw.rect(card, (*c.panel, 225), card.get_rect(), border_radius=px(u, 5))
        pygame.draw.rect(card, c.border, card.get_rect(), 1, border_radius=px(u, 5))
        brushes = brush_rgb(worn(herd.brush_colours, app.theme))
        colours = Stamps(brushes, app.theme).colours
        for k, (name, kind, brush, count) in enumerate(rows):
            y = pad + k * line
            if kind >= 0:
                ground = np.array(c.panel, np.uint8)
                if kind == PLAIN and brush_key(name) in painted:
                    ground = swatch(name, tuple(brushes[brush].tolist()), app.theme, (px(u, 22), line), PATCH * u)
                card.blit(self._figure(kind, brush, colours, px(u, 22), line, ground), (pad, y))
            ink = c.ink if kind >= 0 else c.muted
            card.blit(letters.render(name, True, ink), (pad + px(u, 28), y))
            number = letters.render(f"{count:,}", True, c.muted)
            card.blit(number, (size[0] - pad - number.get_width(), y))
        return card

    def _figure(self, kind, brush, colours, width, height, ground):
        """An animal as it is drawn on the ground, (3,) or (height, width, 3)."""
        image = np.empty((height, width, 3), np.uint8)
        image[:] = ground
        clip = np.array([0, 0, width, height])
        look = (
            PREDATOR if kind == PREDATOR else (brush + 1) * KINDS + kind
        )  # the first look is of animals without a brush
        long, at = 0.9 * width, Pose(width / 2, height / 2, 1.0, 0.0)
        figure(image, clip, at, long, 0.24 * long, kind, False, colours[look], NO_WINGS)
        return pygame.image.frombuffer(image.tobytes(), (width, height), "RGB")

    def draw(self, surface):
        """Lay the card on the upper left of the canvas, where there is room for it."""
        if self.picture is not None:
            width, height = surface.get_size()
            pad = px(self.app.scale, 10)
            if self.picture.get_width() + 2 * pad < 0.6 * width and self.picture.get_height() + 2 * pad < 0.7 * height:
                surface.blit(self.picture, (pad, pad))


class ScaleBar:
    """A bar of a round number of metres."""

    def __init__(self, app):
        self.app, self._said, self.picture = app, None, None

    def height(self, size, camera):
        """Pixels at the lower edge of a canvas of this size that the bar takes."""
        return px(self.app.scale, 10) + self.picture.get_height() if self._fits(size, camera) else 0

    def draw(self, surface, camera):
        """Lay the bar on the lower left of the canvas."""
        if self._fits(surface.get_size(), camera):
            pad = px(self.app.scale, 10)
            surface.blit(self.picture, self.picture.get_rect(bottomleft=(pad, surface.get_height() - pad)))

    def _fits(self, size, camera):
        """Whether there is room for the bar, which is drawn anew when it changes."""
        content = (camera.scale, self.app.theme.name, self.app.scale)
        if content != self._said:
            self._said, self.picture = content, self._bar(camera.scale)
        return self.picture.get_width() < 0.6 * size[0] and size[1] > 160

    def _bar(self, scale):
        c, u = chrome(self.app.theme), self.app.scale
        metres = nice(150 * u / scale)
        letters = font(px(u, 12))
        text = letters.render(f"{metres:g} m" if metres < 1000 else f"{metres / 1000:g} km", True, c.ink)
        long, pad = round(metres * scale), px(u, 8)
        size = (long + text.get_width() + 3 * pad, text.get_height() + px(u, 8))
        card = pygame.Surface(size, pygame.SRCALPHA)
        pygame.draw.rect(card, (*c.panel, 225), card.get_rect(), border_radius=px(u, 5))
        y, thick = size[1] // 2, max(2, px(u, 2))
        pygame.draw.line(card, c.ink, (pad, y), (pad + long, y), thick)
        for x in (pad, pad + long):
            pygame.draw.line(card, c.ink, (x, y - px(u, 4)), (x, y + px(u, 4)), thick)
        card.blit(text, (2 * pad + long, px(u, 4)))
        return card

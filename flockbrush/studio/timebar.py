"""The time bar: play, pause, playback speed, and a strip of the recorded run to scrub in."""

from __future__ import annotations

import pygame
import pygame_gui
from pygame_gui.elements import UIDropDownMenu, UIImage, UIPanel

from flockbrush.render.hud import clock
from flockbrush.studio.theme import chrome, font, px
from flockbrush.studio.widgets import NO_MARGINS, action_button, is_open, set_icon, words

RATES = {"¼×": 0.25, "½×": 0.5, "1×": 1.0, "2×": 2.0, "4×": 4.0, "8×": 8.0}
PATIENCE = 1.5  # s
LAGGING = 0.9  # of the wished pace: below, the lag is told
STEPS = (5, 10, 15, 30, 60, 120, 300, 600, 1800, 3600, 1e9)  # s between two numbers on the strip
ROOM = 30.0  # s the strip shows at least
ABOVE = 60  # layer of the lists of menus


class UpMenu(UIDropDownMenu):
    """A menu whose list opens above whatever is there."""

    def update(self, time_delta):
        super().update(time_delta)
        if is_open(self):
            shown = self.current_state.options_selection_list
            shown.change_layer(ABOVE)
            shown.list_and_scroll_bar_container.change_layer(ABOVE + 1)


class TimeBar:
    """Time: its buttons, its speed, its strip and its branches."""

    def __init__(self, app, rect):
        self.app, self.rect = app, rect
        self.back = UIPanel(rect, 1, app.manager, margins=NO_MARGINS, object_id="@bar")
        self.dragging = False
        self._shown = self._branches = None
        self._in_time = app.now
        self._make_buttons()
        self._make_right()
        left = self.left + px(app.scale, 10)
        width = self.right - px(app.scale, 12) - left
        self.strip = None
        if width > px(app.scale, 60):
            self.strip = pygame.Rect(rect.x + left, rect.y + px(app.scale, 8), width, rect.height - px(app.scale, 16))
            place = self.strip.move(-rect.x, -rect.y)
            self.image = UIImage(place, pygame.Surface(place.size), app.manager, container=self.back)

    def _make_buttons(self):
        app, side, gap = self.app, px(self.app.scale, 34), px(self.app.scale, 3)
        self.buttons, x = {}, px(app.scale, 8)
        for name in ("play", "step", "back", "restart"):
            if x + side > self.rect.width:
                break
            place = pygame.Rect(x, (self.rect.height - side) // 2, side, side)
            self.buttons[name] = action_button(app, place, name, self.back)
            x += side + gap
        self.rates = None
        wide = px(app.scale, 62)
        if self.rect.width > px(app.scale, 420):
            place = pygame.Rect(x + gap, (self.rect.height - px(app.scale, 28)) // 2, wide, px(app.scale, 28))
            self.rates = self._menu(list(RATES), self._rate(), place.move(self.rect.topleft))
            x += wide + 2 * gap
        self.left = x

    def _menu(self, names, chosen, place):
        return UpMenu(names, chosen, place, self.app.manager, object_id="@up")  # within the bar its list would be cut

    def _rate(self):
        return min(RATES, key=lambda name: abs(RATES[name] - self.app.session.rate))

    def _make_right(self):
        app, pad = self.app, px(self.app.scale, 10)
        self.right = self.rect.width - pad
        self.clock = self.lag = self.branches = None
        wide = px(app.scale, 128)
        if self.rect.width > px(app.scale, 560):
            self.right -= wide
            half = self.rect.height // 2
            top = pygame.Rect(self.right, px(app.scale, 8), wide, half - px(app.scale, 8))
            self.clock = words(app, top, "", self.back, "@right")
            self.lag = words(app, top.move(0, top.height), "", self.back, "@note_right")
        if self.rect.width > px(app.scale, 820):
            self.right -= px(app.scale, 130)
            place = pygame.Rect(self.right, (self.rect.height - px(app.scale, 28)) // 2, px(app.scale, 120), 0)
            place.height = px(app.scale, 28)
            self.branch_place = place

    # events ------------------------------------------------------------------------

    def handle(self, event) -> bool:
        """Choose a speed or a branch."""
        if event.type == pygame_gui.UI_DROP_DOWN_MENU_CHANGED:
            if event.ui_element is self.rates:
                self.app.session.rate = RATES[event.text]
                return True
            if event.ui_element is self.branches:
                self.app.switch(event.text)
                return True
        return False

    def mouse(self, event) -> bool:
        """Scrub along the strip; asked before the controls are."""
        if event.type == pygame.MOUSEBUTTONDOWN and event.button == 1 and self._is_on_strip(event.pos):
            self.dragging = True
            self._scrub(event.pos)
            return True
        if event.type == pygame.MOUSEMOTION and self.dragging:
            self._scrub(event.pos)
            return True
        if self.dragging and event.type in (pygame.MOUSEBUTTONUP, pygame.WINDOWFOCUSLOST):
            self.dragging = False
            return True
        return False

    def _is_on_strip(self, position):
        return self.strip is not None and self.strip.collidepoint(position)

    def _scrub(self, position):
        share = (position[0] - self.strip.x) / self.strip.width
        session = self.app.session
        self.app.scrub(min(max(round(share * self._span()), 0), session.last_tick))

    def _span(self):
        """Ticks from end to end of the strip."""
        session = self.app.session
        return max(session.last_tick, round(ROOM / session.clock.dt))

    # showing -----------------------------------------------------------------------

    def update(self):
        """Show what is so now."""
        app, session = self.app, self.app.session
        set_icon(app, self.buttons["play"], "pause" if session.playing else "play")
        if self.rates is not None and self.rates.selected_option[0] != self._rate():
            place = self.rates.relative_rect.copy()
            self.rates.kill()
            self.rates = self._menu(list(RATES), self._rate(), place)
        if self.clock is not None:
            dt = session.clock.dt
            self.clock.say(f"{clock(session.tick * dt)} / {clock(session.last_tick * dt)}")
            self.lag.say(self._lag())
        self._update_branches()
        self.draw()

    def _lag(self):
        """How time goes, in words."""
        session = self.app.session
        if not session.playing:
            return "in the past" if session.in_past else "paused"
        if self._is_late():
            return f"lags: {session.pace:.2g}× of {session.rate:g}×"
        return "viewing the past" if session.in_past else "running"

    def _is_late(self):
        """Whether time has been slower than wished for a while, not only in the moment after a pause."""
        session, now = self.app.session, self.app.now
        if not 0 < session.pace < LAGGING * session.rate:
            self._in_time = now
        return now - self._in_time > PATIENCE

    def _update_branches(self):
        if self.right + self.rect.x > self.rect.right - px(self.app.scale, 200):
            return
        names, current = [str(name) for name in self.app.session.branches], self.app.session.branch_name
        if (names, current) == self._branches or not names:
            return
        self._branches = (names, current)
        if self.branches is not None:
            self.branches.kill()
        chosen = current if current in names else names[0]
        self.branches = self._menu(names, chosen, self.branch_place.move(self.rect.topleft))
        self.draw()

    def draw(self):
        """Show the strip as it is now."""
        if self.strip is not None:
            content = self._said()
            if content != self._shown:
                self._shown = content
                self.image.set_image(self._strip())

    def _said(self):
        session = self.app.session
        marks = len(self._marks())
        return session.tick, session.last_tick, self._span(), session.branch_name, marks, self.dragging

    def _marks(self):
        return self.app.session.branches[self.app.session.branch_name].commands

    def _forks(self):
        """Branches that fork from the shown one, and its own fork from its parent."""
        branches, name = self.app.session.branches.values(), self.app.session.branch_name
        return [b for b in branches if b.parent == name or (b.name == name and b.parent)]

    def _strip(self):
        """The strip as a surface: what is known, what was done, where branches begin, and now."""
        app, session, c = self.app, self.app.session, chrome(self.app.theme)
        u, (width, height) = app.scale, self.strip.size
        picture = pygame.Surface(self.strip.size)
        picture.fill(c.bar)
        top, tall = round(0.36 * height), round(0.3 * height)
        x = lambda tick: round(tick / self._span() * (width - 1))  # noqa: E731
        pygame.draw.rect(picture, c.sunken, (0, top, width, tall), border_radius=px(u, 4))
        known = max(x(session.last_tick), px(u, 4))
        faded = tuple((a + 2 * b) // 3 for a, b in zip(c.accent, c.sunken, strict=True))
        pygame.draw.rect(picture, faded, (0, top, known, tall), border_radius=px(u, 4))
        self._draw_ticks(picture, x, top + tall, c)
        for tick in sorted({tick for tick, _ in self._marks()})[-2000:]:
            pygame.draw.circle(picture, c.ink, (x(tick), top + tall // 2), max(2, px(u, 2)))
        for branch in self._forks():
            at = x(branch.left)
            pygame.draw.polygon(
                picture, c.warning, [(at, top), (at - px(u, 5), top - px(u, 7)), (at + px(u, 5), top - px(u, 7))]
            )
        at = x(session.tick)
        pygame.draw.rect(picture, c.accent, (0, top, at, tall), border_radius=px(u, 4))
        for tick in sorted({tick for tick, _ in self._marks() if tick <= session.tick})[-2000:]:
            pygame.draw.circle(picture, c.on_accent, (x(tick), top + tall // 2), max(2, px(u, 2)))
        pygame.draw.circle(picture, c.ink, (min(max(at, px(u, 6)), width - px(u, 7)), top + tall // 2), px(u, 7))
        pygame.draw.circle(picture, c.raised, (min(max(at, px(u, 6)), width - px(u, 7)), top + tall // 2), px(u, 4))
        return picture

    def _draw_ticks(self, picture, x, y, c):
        """Seconds along the strip."""
        dt, letters = self.app.session.clock.dt, font(px(self.app.scale, 10))
        span = self._span() * dt
        every = next(step for step in STEPS if span / step * px(self.app.scale, 52) <= picture.get_width())
        second = 0.0
        while second <= span:
            at = x(second / dt)
            text = letters.render(clock(second)[:-2], True, c.muted)
            left = min(max(at - text.get_width() // 2, 0), picture.get_width() - text.get_width())
            picture.blit(text, (left, y + 1))
            second += every

"""The Profile panel: time of each system of a tick and of each part of a frame."""

from __future__ import annotations

import re

from flockbrush.studio.panels.bars import Bar, bars_picture
from flockbrush.studio.panels.panel import Picture, ScrollPanel

FRAME = {
    "simulation": "waiting for ticks, which run in parallel",
    "drawing": "ground, animals, overlays",
    "interface": "buttons, panels, this text",
}
MEMORY = 0.3  # share of the newest frame in the mean: a second's frames matter


class ProfilePanel(ScrollPanel):
    """Shows milliseconds as bars."""

    title = "Profile"
    tip = "Time of each part of a frame and of each system of a tick"
    systems: Picture | None

    def make(self):
        super().make()
        px = self.px
        self.means = dict.fromkeys(FRAME, 0.0)
        self.row = px(22)
        self.heading("Frame, mean ms", 0)
        tip = "<br>".join(f"<b>{name}</b>: {meaning}" for name, meaning in FRAME.items())
        self.frame = self.picture(px(28), 5 * self.row, f"{tip}<br>60 frames per second: 16.7 ms")
        self.heading("Tick by system, mean ms", px(36) + 5 * self.row)
        self.systems = None
        self.refresh()

    def update(self, dt):
        for name, seconds in self.app.seconds.items():
            if name in self.means:
                self.means[name] += MEMORY * (1000 * seconds - self.means[name])
        super().update(dt)

    def refresh(self):
        self._show_frame()
        self._show_systems(self.app.session.profile())

    def _show_frame(self):
        colours = dict(zip(FRAME, (self.app.theme.guide, self.app.theme.exit, self.colours.accent), strict=True))
        total = sum(self.means.values())
        most = max(total, 1000 / 60)
        bars = [Bar(name, ms / most, f"{ms:.2f}", colours[name]) for name, ms in self.means.items()]
        bars.append(Bar("together", total / most, f"{total:.2f}", self.colours.muted, True))
        self.frame.show(bars_picture(bars, self.frame.size, self.row, self.px(13), self.colours))

    def _show_systems(self, profile):
        px, ordered = self.px, sorted(profile.items(), key=lambda item: -item[1])
        total = sum(profile.values())
        bars = [Bar("whole tick", 1.0 if total else 0.0, f"{total:.2f}", self.colours.muted, True)]
        most = max(total, 1e-9)
        bars += [Bar(words_of(name), ms / most, f"{ms:.2f}", self.app.theme.guide) for name, ms in ordered]
        tall = len(bars) * self.row
        if self.systems is None or self.systems.size[1] != tall:
            if self.systems is not None:
                self.systems.kill()
            top = px(64) + 5 * self.row
            self.systems = self.picture(top, tall)
            self.scroll.set_scrollable_area_dimensions((self.wide, top + tall))
        self.systems.show(bars_picture(bars, self.systems.size, self.row, self.px(13), self.colours))


def words_of(name) -> str:
    """The name of a system as words: "See by hidden points"."""
    return re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name).capitalize()

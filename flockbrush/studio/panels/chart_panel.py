"""The Charts panel: order, rotation, speed and the number of animals under each brush, over the whole run."""

from __future__ import annotations

import math

import numpy as np
import pygame

from flockbrush.studio.panels.panel import FRESH, Picture, ScrollPanel, blank, write
from flockbrush.studio.panels.panel_strip import Strip, axis_picture, end_of, strip_picture, top_of, value_at
from flockbrush.systems.program_reports import state_colours

MEASURES = {
    "polarization": ("polarization", "", "Polarization: 0 headings in all directions, 1 all the same"),
    "milling": ("milling", "", "Milling: 0 no rotation about the centroid, 1 all animals rotate"),
    "speed": ("speed", " m/s", "Mean speed, m/s"),
}
UNITY = {"polarization", "milling"}  # measures from 0 to 1
DRAWN = (*MEASURES, "animals", "axis", "legend", "counts")
MOST = 5  # brushes in the legend
LINE = 19  # pixels of a line of words
COUNTS_TIP = "Gone: left at an exit, a goal or the edge, were caught, or were removed"


class ChartsPanel(ScrollPanel):
    """Shows measures over the whole run, with the present marked."""

    title = "Charts"
    tip = "Polarization, milling, speed and the number of animals per brush over the whole run"
    strips: dict[str, Picture]

    def make(self):
        super().make()
        px, area = self.px, self.area
        y, gap, legend = px(4), px(10), (MOST + 1) * px(LINE)
        room = area.height - px(46) - 3 * gap - legend - 2 * px(LINE)
        tall = int(min(max(room / 4.3, px(56)), px(120)))
        self.strips = {}
        for name, (_, _, tip) in MEASURES.items():
            y = self._strip(name, y, tall, tip) + gap
        y = self._strip("animals", y, round(1.3 * tall), "Number of animals under each brush, stacked")
        y = self._strip("axis", y, px(18), None)
        y = self._strip("legend", y + px(4), legend, None)
        y = self._strip("counts", y, 2 * px(LINE), COUNTS_TIP)
        self.scroll.set_scrollable_area_dimensions((self.wide, y))
        self.next = len(DRAWN) - 1
        self.refresh()

    def _strip(self, name, y, tall, tip) -> int:
        self.strips[name] = self.picture(y, tall, tip)
        return y + tall

    def update(self, dt):
        self._stale -= dt
        if self._stale <= 0:
            self._stale = FRESH / len(DRAWN)  # one after the other: no frame draws them all
            self.next = (self.next + 1) % len(DRAWN)
            if self.next == 0:
                self._look()
            self._draw(DRAWN[self.next])

    def refresh(self):
        self._look()
        for name in DRAWN:
            self._draw(name)

    def _look(self):
        """The moment that all charts show, though they are drawn one after the other."""
        session = self.app.session
        now = session.clock.now
        self.seen = session.chart, now, max(session.last_tick * session.clock.dt, now)

    def _draw(self, name):
        """Draw one chart anew, if what it shows has changed."""
        chart, now, last = self.seen
        content = (len(chart.time), chart.time[-1] if len(chart.time) else 0.0, now, last, self.app.theme.name)
        if self.strips[name].said == content:
            return
        if name == "axis":
            self.strips[name].show(axis_picture(end_of(last), self.strips[name].size, self.px(11), self.colours))
        elif name == "legend":
            self._legend(chart, now)
        elif name == "counts":
            self._counts(chart, now)
        else:
            strip = (self._measure if name in MEASURES else self._animals)(name, chart, now, end_of(last))
            self.strips[name].show(strip_picture(strip, self.strips[name].size, self.px(12), self.colours))
        self.strips[name].said = content

    def _measure(self, name, chart, now, end) -> Strip:
        title, unit, _ = MEASURES[name]
        values = chart.values.get(name, np.zeros(0))
        value = value_at(chart.time, values, now)
        text = f"{value:.2f}{unit}" if math.isfinite(value) else "–"
        top = 1.0 if name in UNITY else top_of(1.1 * values)
        return Strip(title, chart.time, [(values, self.colours.accent)], now, end, top, text)

    def _animals(self, name, chart, now, end) -> Strip:
        what, counted, colours = self._counted(chart)
        lines = [(counts, colours.get(name, self.colours.muted)) for name, counts in counted.items()]
        total = sum((counts for counts, _ in lines), np.zeros(len(chart.time)))
        count = value_at(chart.time, total, now)
        text = f"{count:,.0f}" if math.isfinite(count) else "–"
        return Strip(f"animals by {what}", chart.time, lines, now, end, top_of(1.15 * total), text, stacked=True)

    def _counted(self, chart):
        """(what counts are by, {name: counts}, {name: colour}): states where there are programs, else brushes."""
        if not chart.states:
            return "brush", chart.counts, self.brush_colours
        return "state", chart.states, state_colours(self.app.session.simulation.world)

    def _counts(self, chart, now):
        """Who is there by species, and how many were born and are gone since the start."""
        px, surface = self.px, blank(self.strips["counts"].size)
        for k, text in enumerate(counted_words(chart, now)):
            write(surface, text, (0, (k + 0.5) * px(LINE)), px(12), self.colours.muted, room=self.wide)
        self.strips["counts"].show(surface)

    def _legend(self, chart, now):
        """Names of the brushes or states with their numbers at present, most first."""
        px, surface = self.px, blank(self.strips["legend"].size)
        _, counted, colours = self._counted(chart)
        counts = {name: value_at(chart.time, counts, now) for name, counts in counted.items()}
        known = {name: count for name, count in counts.items() if count and math.isfinite(count)}
        order = sorted(known, key=lambda name: -known[name])
        for k, name in enumerate(order[:MOST]):
            y = (k + 0.5) * px(LINE)
            pygame.draw.circle(surface, colours.get(name, self.colours.muted), (px(6), y), px(5))
            write(surface, name, (px(18), y), px(12), self.colours.ink, room=0.6 * self.wide)
            write(surface, f"{known[name]:,.0f}", (self.wide, y), px(12), self.colours.muted, (1, 0.5))
        if len(order) > MOST:
            more = f"and {len(order) - MOST} more"
            write(surface, more, (px(18), (MOST + 0.5) * px(LINE)), px(12), self.colours.muted)
        self.strips["legend"].show(surface)


def counted_words(chart, now) -> list[str]:
    """Two lines: animals by species, most first; and who was born and is gone since the start of a chart."""
    counts_now = {name: value_at(chart.time, counts, now) for name, counts in chart.species.items()}
    known = {name: int(count) for name, count in counts_now.items() if count and math.isfinite(count)}
    ever = value_at(chart.time, chart.ever, now)
    if not math.isfinite(ever):
        return []
    herds = ", ".join(f"{name} {known[name]:,}" for name in sorted(known, key=lambda name: -known[name]))
    born, died = int(ever - chart.ever[0]), int(ever - sum(known.values()))
    return [herds or "no animals", f"{born:,} born and {died:,} gone since the start"]

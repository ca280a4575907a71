"""The Animal panel: the state of one animal and the forces on it."""

from __future__ import annotations

import numpy as np
import pygame
from pygame_gui.elements import UIButton

from flockbrush.components import (
    Airborne,
    Body,
    BrushBinding,
    Destination,
    Ground,
    Heading,
    Position,
    ReferenceBird,
    Role,
    Species,
    Speed,
    Velocity,
)
from flockbrush.render.forces import reason_colour
from flockbrush.studio.panels.bars import Bar, bars_picture
from flockbrush.studio.panels.panel import Picture, ScrollPanel, blank, write
from flockbrush.studio.widgets import enabled
from flockbrush.systems.explain import explain
from flockbrush.systems.landscape import Landscape
from flockbrush.systems.palette import Palette
from flockbrush.systems.population import SpeciesList
from flockbrush.systems.program_reports import reason
from flockbrush.systems.senses import Sight, SightInSpace

NOBODY = "No animal is selected.", "Click an animal with the Select tool to see", "its state and its forces here."


class AnimalPanel(ScrollPanel):
    """Shows the state of the selected animal and the forces on it."""

    title = "Animal"
    tip = "The selected animal: its state, its visible neighbours and the forces on it"
    pictures: dict[str, Picture]
    buttons: dict[str, UIButton]
    whom: object

    def make(self):
        super().make()
        self.row = self.px(22)
        self.whom = self  # nobody yet
        self.refresh()

    def _select_reference(self):
        row = row_of(self.app.session, self.app.selected)
        if row is not None:
            self._select(int(self.app.session.simulation.agents[ReferenceBird.entity][row]))

    def _select(self, entity):
        self.app.selected = entity or None
        self.soon()

    def refresh(self):
        session, entity = self.app.session, self.app.selected
        row = row_of(session, entity)
        if row is None:
            self._show_nobody(entity)
            return
        facts = facts_of(session, row)
        explanation = explain(session.simulation.world, entity)
        pulls = pulls_of(explanation, session.clock.dt)
        self._lay_out(entity, len(facts), len(pulls))
        self._show_facts(entity, facts, session, row)
        self._show_pulls(explanation, pulls)
        bird = int(session.simulation.agents[ReferenceBird.entity][row])
        button = self.buttons["reference"]
        enabled(button, bird)
        if button.visible != ("reference bird" in dict(facts)):
            (button.hide if button.visible else button.show)()

    # layout ----------------------------------------------------------------------

    def _lay_out(self, whom, facts=0, pulls=0):
        """Make the widgets for so many facts and forces, unless they are there."""
        layout = (whom is None, facts, pulls)
        if self.whom == layout:
            return
        self.clear()
        self.whom, px = layout, self.px
        if whom is None:
            self.pictures, self.buttons = {"nobody": self.picture(0, px(110))}, {}
            self.scroll.set_scrollable_area_dimensions((self.wide, px(120)))
            return
        half, y = (self.wide - px(6)) // 2, px(36) + facts * self.row
        self.pictures = {"facts": self.picture(0, y - px(6))}
        tip = "Select the reference bird of this bird"
        self.buttons = {
            "reference": self.button("Reference bird", self._select_reference, 0, y, half, tip),
            "nobody": self.button("Deselect", lambda: self._select(None), half + px(6), y, half, "Clear the selection"),
        }
        y, tall = self.heading("Forces", y + px(36)), (pulls + 1) * self.row + px(48)
        self.pictures["pulls"] = self.picture(y, tall, PULLS_TIP)
        self.scroll.set_scrollable_area_dimensions((self.wide, y + tall + px(6)))

    # pictures --------------------------------------------------------------------

    def _show_nobody(self, entity):
        self._lay_out(None)
        picture = self.pictures["nobody"]
        lines = (f"Animal {entity} does not exist any more.", *NOBODY[1:]) if entity else NOBODY
        if picture.said == (lines, self.app.theme.name):
            return
        surface = blank(picture.size)
        for k, line in enumerate(lines):
            colour = self.colours.ink if k == 0 else self.colours.muted
            write(surface, line, (0, self.px(18) + k * self.row), self.px(13), colour, room=self.wide)
        picture.show(surface, (lines, self.app.theme.name))

    def _show_facts(self, entity, facts, session, row):
        surface, px, colours = blank(self.pictures["facts"].size), self.px, self.colours
        agents, palette = session.simulation.agents, session.palette
        brush = palette.brushes[agents[BrushBinding.brush][row]]
        pygame.draw.circle(surface, self.app.colour_of(brush.name), (px(8), px(15)), px(7))
        species = session.simulation.world.resource(SpeciesList).names[agents[Species.index][row]]
        write(surface, f"{species} {entity}", (px(22), px(15)), px(15), colours.ink, bold=True, room=self.wide - px(24))
        for k, (words, value) in enumerate(facts):
            y = px(30) + (k + 0.5) * self.row
            write(surface, words, (0, y), px(13), colours.muted)
            write(surface, value, (self.wide, y), px(13), colours.ink, (1, 0.5), room=0.66 * self.wide)
        self.pictures["facts"].show(surface)

    def _show_pulls(self, explanation, pulls):
        """What each force adds to the turn, in the colours of the arrows on the canvas, and what comes of it."""
        px, picture, session = self.px, self.pictures["pulls"], self.app.session
        most = max([abs(pull) for pull in pulls.values()], default=0.0)
        bars = [
            Bar(name, pull / max(most, 1e-9), f"{abs(pull):.0f}°/s", reason_colour(name, self.app.theme))
            for name, pull in pulls.items()
        ]
        surface, y, share = blank(picture.size), px(18) * bool(bars), 0.42
        surface.blit(bars_picture(bars, picture.size, self.row, px(13), self.colours, share, both_ways=True), (0, y))
        if bars:
            write(surface, "left", (share * self.wide, px(8)), px(11), self.colours.muted)
            write(surface, "right", (self.wide - 4.2 * px(13), px(8)), px(11), self.colours.muted, (1, 0.5))
        y += len(bars) * self.row + px(14)
        if not bars:
            write(surface, "This model does not report its forces.", (0, y), px(13), self.colours.muted, room=self.wide)
            y += self.row
        fastest = session.palette.max_turn[session.palette.named(explanation.brush)]
        text = turning(explanation.turn / session.clock.dt, fastest)
        write(surface, text, (0, y), px(13), self.colours.ink, bold=True, room=self.wide)
        picture.show(surface)


PULLS_TIP = (
    "Contribution of each force to the turn: bars to the left turn the animal left, bars to the right turn it right. "
    "The arrows on the canvas have the same colours."
)


def pulls_of(explanation, dt) -> dict[str, float]:
    """{reason: degrees a second by which it turns the animal, to the left positive}, in the model's order."""
    (fx, fy), pulls = explanation.forward, {}
    for name, (x, y) in explanation.terms:
        if name != "heading":
            pulls[name] = float(np.degrees(fx * y - fy * x) / dt)
    return pulls


def row_of(session, entity) -> int | None:
    """The row of an animal, None when there is no such animal (any more)."""
    ids = session.simulation.agents.ids
    if entity is None or not len(ids):
        return None
    row = int(np.searchsorted(ids, entity))
    return row if row < len(ids) and ids[row] == entity else None


def facts_of(session, row) -> list[tuple[str, str]]:
    """(name, value with unit) of all facts about one animal."""
    world = session.simulation.world
    agents, land = world.agents, world.resource(Landscape)
    speed, length = float(np.linalg.norm(agents[Velocity.xyz][row])), float(agents[Body.length][row])
    fx, fy = agents[Heading.forward][row, :2]
    x, y, z = agents[Position.xyz][row]
    palette, binding = session.palette, agents[BrushBinding.brush][row]
    blend = float(agents[BrushBinding.blend][row])
    before = palette.names[agents[BrushBinding.previous][row]]
    bird, goal = int(agents[ReferenceBird.entity][row]), int(agents[Destination.goal][row])
    cap, factor = float(agents[Ground.cap][row]), float(agents[Ground.factor][row])
    facts = [
        ("brush", palette.names[binding] + (f", {100 * blend:.0f} % (from {before})" if blend < 1 else "")),
        ("role", "leader" if agents[Role.leader][row] else "follower"),
        ("speed", f"{speed:.2f} m/s, {speed / length:.1f} BL/s"),
        ("desired speed", f"{float(agents[Speed.target][row]):.2f} m/s"),
        ("heading", f"{np.degrees(np.arctan2(fy, fx)) % 360:.0f}°, {compass(fx, fy)}"),
        ("position", f"{x:.1f}, {y:.1f} m" + (f"; height {z:.1f} m" if z else "")),
        ("visible neighbours", f"{seen_by(world, row)}"),
    ]
    flying = palette.flies[binding] and not palette.grounded[binding]
    if bird or flying:
        facts.append(("reference bird", f"animal {bird}" if bird else "none"))
    why = reason(world, row)
    if why is not None:
        facts[1:1] = [("state", f"{why[1]} (program {why[0]})"), ("why", why[2])]
    if goal >= 0:
        facts.append(("goes to", land.goals[goal].name or f"goal {goal + 1}"))
    if flying:
        facts.append(("flies", attitude(agents[Heading.forward][row], agents[Airborne.up][row])))
        factor = 1.0  # mud slows nobody in the air
    if np.isfinite(cap) or factor != 1:
        limit = f"at most {cap:.1f} m/s" if np.isfinite(cap) else f"{100 * factor:.0f} % of its speed"
        facts.append(("ground", limit))
    return facts


def seen_by(world, row) -> int:
    """How many others the animal saw in the last tick."""
    flies = world.resource(Palette).flies[world.agents[BrushBinding.brush][row]]
    visible = world.resource(SightInSpace if flies else Sight).by_slot
    if visible is None or row >= len(visible.count):
        return 0
    return int(visible.count[row])


def attitude(forward, up) -> str:
    """How a bird lies in the air, in words, from its heading and its back, (3,) each."""
    climb = float(np.degrees(np.arcsin(np.clip(forward[2], -1, 1))))
    left = np.array([-forward[1], forward[0], 0.0]) / max(np.hypot(forward[0], forward[1]), 1e-9)
    lean = float(np.degrees(np.arctan2(up @ left, up @ np.cross(forward, left))))
    words = [f"{'climbs' if climb > 0 else 'sinks'} {abs(climb):.0f}°"] if abs(climb) >= 0.5 else []
    words += [f"banks {abs(lean):.0f}° {'left' if lean > 0 else 'right'}"] if abs(lean) >= 0.5 else []
    return ", ".join(words) or "level"


def compass(x, y) -> str:
    """The nearest of the eight points of the compass."""
    names = ("east", "north-east", "north", "north-west", "west", "south-west", "south", "south-east")
    return names[round(np.degrees(np.arctan2(y, x)) / 45) % 8]


def turning(turn, fastest=np.inf) -> str:
    """A turn in words; `turn` and the `fastest` there may be, rad/s, to the left positive."""
    degrees = float(np.degrees(min(abs(turn), fastest)))
    if degrees < 1:
        return "Sum: keeps its heading"
    return f"Sum: {'left' if turn > 0 else 'right'}, {degrees:.0f}°/s" + (" (maximum)" if abs(turn) > fastest else "")

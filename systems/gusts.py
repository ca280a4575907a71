"""Gusts of wind, for birds in line formation: what a level's script or a designer blows at them."""

from __future__ import annotations

import numpy as np
from flockbrush.components import BrushBinding
from flockbrush.components.formation import FormationPlace
from flockbrush.engine.clock import Clock
from flockbrush.engine.commands import command
from flockbrush.engine.noise import Noise
from flockbrush.systems.palette import Palette
from flockbrush.systems.selection import OfAnimals
from flockbrush.systems.undo import need

ONSET = 0.5  # s in which a gust is felt.  By eye


@command
class Gust(OfAnimals):
    """Wind (x, y, z) m/s that comes up at once and lulls within ``seconds``, not the same for every bird.

    It blows at those who fly in line formation: all, one species, or those within ``radius`` of (at_x, at_y).
    ``uneven`` 0 blows at all alike, 1 at some not at all and at others twice as much.
    """

    place_kinds = ()  # (x, y) is a wind
    changes = (FormationPlace.gust, FormationPlace.wind, FormationPlace.felt, FormationPlace.lull)
    x: float
    y: float
    z: float = 0.0
    seconds: float = 3.0
    uneven: float = 0.5
    species: str = ""
    at_x: float = 0.0
    at_y: float = 0.0
    radius: float = 0.0

    def check(self, world):
        need(self.seconds > 0, f"seconds must be above 0, got {self.seconds:g}")
        need(0 <= self.uneven <= 1, f"uneven must be from 0 to 1, got {self.uneven:g}")
        super().check(world)

    def chosen(self, world):
        return super().chosen(world) & world.resource(Palette).formation[world.agents[BrushBinding.brush]]

    def apply(self, world):
        agents = world.agents
        chosen = self.chosen(world)
        chance = world.resource(Noise).uniform("gust", world.resource(Clock).tick, agents.ids)
        share = 1.0 + self.uneven * (2.0 * chance - 1.0)
        agents[FormationPlace.gust][chosen] += (share * np.array([self.x, self.y, self.z]))[chosen]
        agents[FormationPlace.lull][chosen] = self.seconds


def blow(agents, rows, dt):
    """One tick of wind for these birds: gusts come up and lull."""
    gust, wind = agents[FormationPlace.gust][rows], agents[FormationPlace.wind][rows]
    if not gust.any() and not wind.any() and not agents[FormationPlace.felt][rows].any():
        return
    agents[FormationPlace.felt][rows] = wind
    wind = wind + min(dt / ONSET, 1.0) * (gust - wind)
    gust = gust * np.maximum(1.0 - 3.0 * dt / np.maximum(agents[FormationPlace.lull][rows], dt), 0.0)[:, None]
    still = (np.abs(gust) < 1e-3).all(axis=1) & (np.abs(wind) < 1e-3).all(axis=1)
    gust[still], wind[still] = 0.0, 0.0
    agents[FormationPlace.gust][rows], agents[FormationPlace.wind][rows] = gust, wind

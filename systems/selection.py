"""Which animals and cells a command is about."""

from __future__ import annotations

import numpy as np
from flockbrush.components import Position, Species
from flockbrush.engine.problems import did_you_mean
from flockbrush.engine.seam import images, short_way
from flockbrush.systems.binding import can_do, cannot, cannot_follow
from flockbrush.systems.landscape import Landscape
from flockbrush.systems.painting import merged_cells
from flockbrush.systems.palette import Palette
from flockbrush.systems.population import SpeciesList
from flockbrush.systems.programs import Programs
from flockbrush.systems.undo import OfThese, need


def check_circle(command):
    need(command.radius >= 0, f"radius must be at least 0 m, got {command.radius:g}")


class OfAnimals(OfThese):
    """A command to animals of a species ("" for all) in a circle (radius 0: everywhere), at (at_x, at_y) or (x, y)."""

    needs_fields = "species: str", "x or at_x: float", "y or at_y: float", "radius: float"

    def check(self, world):
        check_circle(self)
        check_species(world, self.species)

    def chosen(self, world):
        """(n,) bool, who is meant."""
        x, y = (self.at_x, self.at_y) if hasattr(self, "at_x") else (self.x, self.y)
        return selected(world, x, y, self.radius, self.species)

    def rows(self, world):
        return np.flatnonzero(self.chosen(world))


def check_species(world, name):
    names = world.resource(SpeciesList).names
    if name and name not in names:
        raise LookupError(f"there is no species {name!r}{did_you_mean(name, names)}")


def check_brush(world, name):
    world.resource(Palette).named(name)


def check_can(world, brush, species):
    """ValueError when a species is named that cannot move as a brush does."""
    why = cannot(world.resource(Palette), world.resource(SpeciesList), brush, species)
    need(not why, why)


def check_can_come(world, species, brush, program):
    """ValueError unless a species, which may be new to this world, can move as a brush and a program do."""
    need(species, "a species needs a name")
    fauna = SpeciesList([species], world.resource(SpeciesList).library)
    why = cannot(world.resource(Palette), fauna, brush, species)
    need(not why, why)
    if program:
        programs = world.resource(Programs)
        check_can_follow(world, programs.programs[programs.named(program)], fauna)


def check_can_follow(world, program, fauna):
    """ValueError when one of these species cannot move as a brush in a state of a `Program` does."""
    for species in fauna.names:
        why = cannot_follow(world.resource(Palette), fauna, program, species)
        need(not why, why)


def species_of(world, row):
    """Name of the species of one animal."""
    return world.resource(SpeciesList).names[int(world.agents[Species.index][row])]


def can_use_brush(world, brush):
    """(n,) bool: the animals that can move as a brush does."""
    palette, fauna = world.resource(Palette), world.resource(SpeciesList)
    return can_do(palette, fauna.table)[palette.named(brush)][world.agents[Species.index]]


def cells_within(land, x, y, radius):
    """(iy, ix) of the cells whose centres lie in a circle, which reaches over the borders of a map that wraps."""
    ways = images([(x, y)], land.wrap, radius)
    return merged_cells([_in_circle(land, x + dx, y + dy, radius) for dx, dy in ways], land.brush.shape[1])[:2]


def _in_circle(land, x, y, radius):
    """(iy, ix, 1) of the cells of a map that ends at its borders."""
    c = land.cell
    ny, nx = land.brush.shape
    x0, x1 = max(0, int((x - radius) / c)), min(nx, int((x + radius) / c) + 1)
    y0, y1 = max(0, int((y - radius) / c)), min(ny, int((y + radius) / c) + 1)
    cx, cy = (np.arange(x0, x1) + 0.5) * c - x, (np.arange(y0, y1) + 0.5) * c - y
    iy, ix = np.nonzero(cy[:, None] ** 2 + cx**2 <= radius**2)
    return iy + y0, ix + x0, np.ones(len(iy))


def selected(world, x, y, radius, species):
    """(n,) bool: animals of a species ("" for all) in a circle (radius 0: everywhere)."""
    xyz = world.agents[Position.xyz]
    chosen = np.ones(len(xyz), bool)
    if radius > 0:
        away = short_way(xyz[:, :2] - (x, y), world.resource(Landscape).wrap)
        chosen &= (away**2).sum(1) <= radius**2
    if species:
        check_species(world, species)
        chosen &= world.agents[Species.index] == world.resource(SpeciesList).names.index(species)
    return chosen

"""The predators that can be added: species that hunt, each with its hunting brush."""

from __future__ import annotations

from typing import NamedTuple

from flockbrush.behaviours.behaviour import behaviours


class Hunter(NamedTuple):
    """A species that hunts, and the brush that it follows."""

    species: str
    brush: str


def dangerous(app) -> dict:
    """{name: brush} of the brushes whose models hunt."""
    models = behaviours()
    brushes = {name: app.find_brush(name) for name in app.brush_names()}
    return {name: brush for name, brush in brushes.items() if brush is not None and models[brush.model].danger}


def hunters(app):
    """{species: Hunter} of all species that hunt by a brush of theirs, those that the animals of the level fear first.

    A brush that names the species goes before one for all that hunt like it.

    Where no such species is known (a level of brushes and species of one's own), brushes of dangerous models are
    offered under the species "predator".
    """
    library, hunting = app.fauna.library, dangerous(app)
    by_species = {}
    for species in map(library.get, library.names()):
        if any(relation.verb == "hunt" for relation in species.relations.values()):
            fitting = [name for name, brush in hunting.items() if _fits(species, brush)]
            own = [name for name in fitting if species.name in hunting[name].made_for]
            if fitting:
                by_species[species.name] = Hunter(species.name, (own or fitting)[0])
    if not by_species:
        return {name: Hunter("predator", name) for name in hunting}
    present = {spawn.species for spawn in app.session.simulation.level.spawns}
    return dict(sorted(by_species.items(), key=lambda pair: (-_frightens(pair[0], present, library), pair[0])))


def _fits(species, brush):
    """Whether a brush is made for one species."""
    return bool(brush.made_for) and brush.is_made_for(species.name, species.tags)


def _frightens(name, present, library):
    """How many of the species that are present are its prey or fear it; those without a file fear all on foot."""
    hunter, count = library.get(name), 0
    for other in present:
        prey = library.find(other)
        if prey is None:
            count += hunter.can("walk")
            continue
        hunts, fears = hunter.relation_to(prey.name, prey.tags), prey.relation_to(hunter.name, hunter.tags)
        count += (hunts is not None and hunts.verb == "hunt") or (fears is not None and fears.verb == "fear")
    return count

"""The active tool, the selected brush, speed limit and surface, and the size of the stroke."""

from __future__ import annotations

import numpy as np

from flockbrush.behaviours.brush import flies_free, shipped
from flockbrush.behaviours.species import usual_species
from flockbrush.components import BrushBinding, ProgramState, Species
from flockbrush.engine.problems import ProblemsError, did_you_mean
from flockbrush.render.style import mix, rgb, worn
from flockbrush.render.style import palette as fallback_colours
from flockbrush.studio.brush_palette import CAPS
from flockbrush.studio.hunters import dangerous, hunters
from flockbrush.studio.needed import brush_needed
from flockbrush.studio.tools import offered
from flockbrush.studio.tools import world_tools as lookup
from flockbrush.studio.tools.tool import CHOICES
from flockbrush.systems.binding import binds_nobody
from flockbrush.systems.landscape import Landscape
from flockbrush.systems.population import SpeciesList, body_of
from flockbrush.systems.room import in_the_air


class ActiveTool:
    """Methods of the App that tools call."""

    def empty(self, brush=None):
        """Select the paint tool, with the requested brush or the first brush of the level."""
        level = self.session.simulation.level
        self.options = {
            "shape": "pen", "solid": True, "blocks_view": True, "erase": "usual", "layer": "brush", "count": 10,
            "hunter": "",
        }  # fmt: skip
        self.size = self.settings.brush_size or max(2 * level.cell, round(min(level.width, level.height) / 24, 1))
        self.set_size(self.size)
        self.softness = 0.0
        names = self.brush_names()
        if brush is not None and brush not in names:
            raise LookupError(f"there is no brush {brush!r}{did_you_mean(brush, names)}")
        surfaces = self.surface_names()
        self.paint = {
            "brush": brush or self._first_brush(names),
            "cap": 1.0,
            "surface": surfaces[1] if len(surfaces) > 1 else "",
        }
        self.told: set[str] = set()  # of whom paint does not bind
        self.tools = {kind.name: kind(self) for kind in offered(self.session)}
        self.tool = self.tools["brush"]

    def _first_brush(self, names):
        """A brush that differs from what the animals do already, so that the first stroke has a visible effect.

        One that binds the species of the level and moves through the air if most of its animals do, if there is any.
        """
        spawns = self.session.simulation.level.spawns
        used, present = {spawn.brush for spawn in spawns}, {spawn.species for spawn in spawns}
        danger = dangerous(self)
        quiet = [name for name in names if name not in danger]
        quiet = [name for name in quiet if self._binds(name, present)] or quiet
        flying = sum(spawn.count if self._flies(spawn.brush) else -spawn.count for spawn in spawns) > 0
        quiet = [name for name in quiet if self._flies(name) == flying] or quiet
        others = [name for name in quiet if name not in used]
        for preferred in ("mill-hollow", "swarm", "mill-filled"):
            if preferred in others:
                return preferred
        return (others or quiet or names or [""])[0]

    def _binds(self, name, present):
        """Whether paint of a brush affects any of some species, as far as they are known."""
        brush = self.find_brush(name)
        known = [asset for asset in map(self.fauna.library.find, present) if asset is not None]
        return brush is not None and (not known or any(brush.is_made_for(one.name, one.tags) for one in known))

    def _flies(self, name):
        """Whether a brush moves animals through the air."""
        brush = self.find_brush(name)
        return brush is not None and flies_free(brush)

    # the hand ----------------------------------------------------------------------

    @property
    def brush(self):
        """Name of the selected brush."""
        return self.paint["brush"]

    @brush.setter
    def brush(self, name):
        self.paint["brush"] = name

    def take_tool(self, name):
        """Select another tool; an unfinished action of the tool before is cancelled."""
        if name == self.tool.name:
            if "shape" in self.tool.options:
                pens = list(CHOICES["shape"])
                self.set_option("shape", pens[(pens.index(self.options["shape"]) + 1) % len(pens)])
            return
        self.tool.cancel()
        self.tool = self.tools[name]
        if self.tool.palette in ("cap", "surface", "brush") and name in ("brush", "cap", "surface"):
            self.options["layer"] = name
        self.tool_changed()

    def set_option(self, name, value):
        """Set an option of the active tool."""
        if value != self.options[name]:
            self.options[name] = value
            self.tool.cancel()
            self.tool_changed()

    def choose(self, layer, value):
        """Select an entry of a palette."""
        self.paint[layer] = value
        self.tool_changed(palette=False)

    def take(self, layer, value):
        """Select what was picked from the ground, and the tool that paints with it."""
        self.paint[layer] = value
        keep = self.tool.palette == layer
        if not keep:
            self.take_tool(layer)
        self.tool_changed()
        self.notify(f"selected: {value:g} m/s" if layer == "cap" else f"selected: {value}")

    def next_paint(self, step):
        """Select the next entry of the palette."""
        layer = self.options["layer"] if self.tool.palette == "layer" else self.tool.palette
        if not layer:
            return
        entries = self.paints(layer)
        now = entries.index(self.paint[layer]) if self.paint[layer] in entries else -step
        self.choose(layer, entries[(now + step) % len(entries)])

    def paints(self, layer):
        """What can be painted on a layer, in the order of its palette."""
        return {"brush": self.brush_names, "cap": lambda: list(CAPS), "surface": self.surface_names}[layer]()

    # sizes -------------------------------------------------------------------------

    def sizes(self):
        """The smallest and the largest radius of a stroke, m."""
        level = self.session.simulation.level
        low = max(0.25, 0.5 * level.cell)
        return low, max(4 * low, 0.25 * max(level.width, level.height))

    def set_size(self, size):
        """The radius of round tools, m."""
        low, high = self.sizes()
        self.size = float(np.clip(size, low, high))

    def change_size(self, factor):
        """Make round tools larger by a factor."""
        self.set_size(self.size * factor)

    def set_softness(self, softness):
        """Set how much a stroke fades towards its edge, 0 to 1."""
        self.softness = float(np.clip(softness, 0, 1))

    def change_softness(self, step):
        """Change the softness of the edge by an amount."""
        self.set_softness(round(self.softness + step, 3))

    def set_count(self, count):
        """Set the number of animals added at once."""
        self.options["count"] = round(count)

    def usual_radius(self):
        """Radius of objects placed by a click, m, large enough to be visible on this map."""
        level = self.session.simulation.level
        return round(max(1.5 * level.cell, min(level.width, level.height) / 30), 1)

    # brushes ------------------------------------------------------------------------

    def world_palette(self):
        """The brushes of the running world."""
        return self.session.palette

    @property
    def fauna(self):
        """The species of the running world."""
        return self.session.simulation.world.resource(SpeciesList)

    def brush_names(self):
        """Names of all brushes to paint with: the designer's own, those of the level, the other shipped ones."""
        own = [brush.name for brush in self.session.palette.own]  # without those between two
        names = list(dict.fromkeys([*own, *self.session.library.names()]))
        usual = set(shipped().names())
        return sorted(names, key=lambda name: name in usual)

    def find_brush(self, name):
        """The brush of this name, or None."""
        palette = self.session.palette
        if name in palette.index:
            return palette.brushes[palette.index[name]]
        try:
            return self.session.library.get(name)
        except ProblemsError:
            return None

    def brush_needed(self, name):
        """Commands that load a brush into the world, if it is not loaded yet."""
        return brush_needed(self.session, name)

    def colour_of(self, name):
        """The colour "#rrggbb" of a brush."""
        brush, names = self.find_brush(name), self.session.palette.names
        if self.theme.palette != "own":
            offered = [*names, *(other for other in self.session.library.names() if other not in names)]
            return worn(offered, self.theme)[offered.index(name) if name in offered else 0]
        return brush.colour if brush is not None else tuple(fallback_colours(1)[0])

    def brush_of(self, animal):
        """Name of the brush that controls an animal now; where paint mixes two, of the one that is painted."""
        palette = self.session.palette
        index = self.session.simulation.world.component_for_entity(animal, BrushBinding).brush
        return palette.names[palette.end(int(index))]

    def choices(self, option):
        """{value: label} of an option with choices; {} of others."""
        if option == "hunter":
            return {name: name.capitalize() for name in hunters(self)}
        return CHOICES.get(option, {})

    def hunter(self):
        """The predator to add: the chosen one, else the one that the animals of this level fear most; or None."""
        known = hunters(self)
        return known.get(self.options["hunter"], next(iter(known.values()), None))

    def body_length(self, hunter):
        """Body length of a predator, m."""
        return body_of(self.find_brush(hunter.brush), self.fauna.library.find(hunter.species)).length

    def painted_at(self, xy):
        """The brush that is painted at a point of the ground, or None."""
        land = self.session.simulation.world.resource(Landscape)
        iy, ix = (min(max(int(v / land.cell), 0), n - 1) for v, n in zip(xy[::-1], land.brush.shape, strict=True))
        index = int(land.brush[iy, ix])
        return self.session.palette.brushes[index] if index >= 0 else None

    def painted_under(self, xy, species):
        """Name of the painted brush that a species follows at a point of the ground, or ""."""
        brush, asset = self.painted_at(xy), self.fauna.library.find(species)
        binds = brush is not None and (asset is None or brush.is_made_for(asset.name, asset.tags))
        return brush.name if binds else ""

    def tell_unbound(self):
        """Say once, after painting with the selected brush, which animals of this world that does not bind, and why."""
        world, palette = self.session.simulation.world, self.session.palette
        if self.brush not in palette.index:
            return
        held, kinds, aloft = world.agents[ProgramState.brush] >= 0, world.agents[Species.index], in_the_air(world)
        told = f"Paint does not bind {held.sum()} animals: the states of their program choose their brushes."
        why = binds_nobody(palette, self.fauna, self.brush, kinds[~held], aloft[~held])
        for kind, text in (("program", told if held.any() else ""), (why, why)):
            if text and kind not in self.told:
                self.told.add(kind)
                self.notify(text)

    def species_of(self, brush):
        """Species of animals added with a brush: the species that starts with it, or that it is made for."""
        spawns = self.session.simulation.level.spawns
        same = [spawn.species for spawn in spawns if spawn.brush == brush]
        if same:
            return same[0]
        asset = self.find_brush(brush)
        made_for = usual_species(asset.made_for, self.fauna.library, self.fauna.names) if asset is not None else ""
        if made_for:
            return made_for
        return "predator" if brush in dangerous(self) else spawns[0].species if spawns else "animal"

    # surfaces -------------------------------------------------------------------------

    def surface_names(self):
        """Names of the surfaces to paint; the first is bare ground."""
        land = self.session.simulation.world.resource(Landscape)
        return ["", *(kind.name for kind in land.kinds)]

    def surface_colour(self, name):
        """The colour of a surface."""
        land = self.session.simulation.world.resource(Landscape)
        for kind in land.kinds:
            if kind.name == name and kind.colour:
                return mix(rgb(kind.colour), self.theme.wash, 0.5 * self.theme.wash_share)
        return self.theme.ground

    # what lies where --------------------------------------------------------------------

    def things_at(self, places, reach, kinds):
        """(kind, object) at any of some points of the ground, topmost first."""
        return lookup.things_at(self.session.simulation, places, reach, kinds)

    def thing_under(self, xy, kinds):
        """(kind, object) at a point of the ground, else of the smallest area around it; None where there is none."""
        hits = self.things_at([xy], self.tool.reach(), kinds)
        return hits[0] if hits else lookup.area_around(self.session.simulation, xy, kinds)

    def animal_at(self, xy, reach):
        """Id of the animal nearest to a point of the ground, or None; in the 3D view, of the one under the mouse."""
        if self.canvas.in_space:
            return self.canvas.pick()
        return lookup.animal_at(self.session.simulation, xy, reach)

    def is_off_map(self, start, stop, radius):
        """Whether a stroke from here to there touches no ground of the map."""
        level = self.session.simulation.level
        return any(
            max(a, b) + radius < 0 or min(a, b) - radius > side
            for a, b, side in zip(start, stop, (level.width, level.height), strict=True)
        )

    def new_id(self):
        """An id for a new object of the level file."""
        return self.session.editor.new_id()

    def select(self, animal):
        """Select an animal; None clears the selection."""
        self.selected = animal
        if animal is not None and self.column is not None:
            self.column.show_titled("Animal")

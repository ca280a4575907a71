"""Tools that paint the ground (brushes, speed limits, surfaces), erase, pick and fill."""

from __future__ import annotations

import numpy as np

from flockbrush.studio.tools.tool import Stroke, Tool
from flockbrush.studio.tools.world_tools import KINDS
from flockbrush.systems.edits import Paint, RemoveThing, fill, pick
from flockbrush.systems.landscape import Landscape

ERASES = {"usual": ("brush", "cap"), "everything": ("brush", "cap", "surface")}  # what the eraser takes, by its option
LAYERS = {"brush": "behaviour", "cap": "speed limits", "surface": "surfaces"}


class Painting(Stroke):
    """Paints one layer."""

    layer = ""
    options = ("size", "softness")

    def press(self, xy, button, mods):
        if button == 3:  # the other button takes what is there, as in every paint program
            self.app.tools["pick"].press(xy, 1, mods)
        else:
            super().press(xy, button, mods)

    def value(self):
        """What is painted."""
        return self.app.paint[self.layer]

    def go(self, start, stop):
        app = self.app
        if app.is_off_map(start, stop, app.size):
            return
        what = Paint(self.layer, self.value(), *start, *stop, app.size, app.softness)
        if not len(what.where(app.session.simulation.world)[0]):
            return  # between the last cells and the rim of the map
        app.do(f"paint {LAYERS[self.layer]}", [*self.needed(), what], self.join)

    def cursor(self, surface, camera):
        if self.at is None:
            return
        r = self.app.size * camera.scale_at(self.at)
        self.ring(surface, camera, self.app.size, self.colour())
        if self.app.softness > 0.05 and r > 12:
            self.circle(surface, camera, self.at, self.app.size * (1 - self.app.softness), self.colour())


class PaintBrushTool(Painting):
    """Paints behaviour."""

    name, title, key, icon = "brush", "Paint behaviour", "b", "brush"
    tip = "Paint a brush on the ground: animals there follow it"
    hint = "Drag over the ground: animals there follow the selected brush."
    layer = palette = "brush"

    def end(self):
        self.app.tell_unbound()


class PaintCapTool(Painting):
    """Paints how fast animals may go."""

    name, title, key, icon = "cap", "Paint a speed limit", "c", "cap"
    tip = "Paint a speed limit"
    hint = "Drag over the ground to limit the speed there."
    layer = palette = ink = "cap"


class PaintSurface(Painting):
    """Paints what the ground is made of."""

    name, title, key, icon = "surface", "Paint a surface", "s", "surface"
    tip = "Paint the surface of the ground: road, mud, water, rock"
    hint = "Drag over the ground to change its surface."
    layer = palette = "surface"


class Erase(Stroke):
    """Takes away what is painted, and things that are touched."""

    name, title, key, icon = "erase", "Erase", "e", "erase"
    tip = "Erase paint, and objects at the centre of the eraser"
    hint = "Drag over paint or an object to erase it."
    options = ("size", "erase")

    def go(self, start, stop):
        app, what = self.app, self.app.options["erase"]
        blank = {"brush": "", "cap": 0.0, "surface": ""}
        layers = [layer for layer in LAYERS if layer in ERASES.get(what, (what,))]
        commands = [] if app.is_off_map(start, stop, app.size) else [
            Paint(layer, blank[layer], *start, *stop, app.size) for layer in layers if self._is_painted(layer)
        ]  # fmt: skip
        if what in (*ERASES, "things"):
            touched = app.things_at([start, stop], self.reach(5), kinds=KINDS)
            commands += [RemoveThing(kind, thing.id) for kind, thing in touched]
        if commands:
            app.do("erase", commands, self.join)

    def _is_painted(self, layer):
        """Whether there is anything of a layer, so that undo lists stay short."""
        land = self.app.session.simulation.world.resource(Landscape)
        if layer == "cap":
            return bool(np.isfinite(land.surface[..., 1]).any())
        return layer != "brush" or bool((land.brush >= 0).any())


class Pick(Tool):
    """Takes what lies under the mouse into the hand."""

    name, title, key, icon = "pick", "Pick from the ground", "i", "pick"
    tip = "Pick the brush, speed limit or surface under the mouse, or the brush of an animal"
    hint = "Click painted ground or an animal to pick its brush."

    def press(self, xy, button, mods):
        app, world = self.app, self.app.session.simulation.world
        animal = app.animal_at(xy, self.reach(8))
        if animal is not None:
            return app.take("brush", app.brush_of(animal))
        for layer in ("cap", "brush", "surface"):
            picked = pick(world, layer, *xy)
            if picked:
                return app.take(layer, picked)
        app.notify("nothing is painted here")


class Fill(Tool):
    """Fills the region under the mouse."""

    name, title, key, icon = "fill", "Fill a region", "f", "fill"
    tip = "Fill a connected area with the selected brush, speed limit or surface"
    hint = "Click an area to fill it with the brush, speed limit or surface selected on the left."
    palette, options = "layer", ("layer",)

    def press(self, xy, button, mods):
        if button != 1:
            return
        app = self.app
        layer = app.options["layer"]
        if app.is_off_map(xy, xy, 0.0):
            return app.notify("this point is outside the map")
        needed = app.brush_needed(app.brush) if layer == "brush" else []
        cells = fill(app.session.simulation.world, layer, *xy, app.paint[layer])
        app.do(f"fill with {LAYERS[layer]}", [*needed, cells])
        if layer == "brush":
            app.tell_unbound()

    def cursor(self, surface, camera):
        if self.at is not None:
            self.ring(surface, camera, 5 / camera.scale_at(self.at), self.app.theme.ink)

"""Tools for animals themselves: add, remove, predators, select."""

from __future__ import annotations

import numpy as np

from flockbrush.components import Position
from flockbrush.studio.outlines import rows
from flockbrush.studio.tools.tool import Stroke, Tool
from flockbrush.studio.tools.world_tools import KINDS, SPOKEN, change, free_name, moved, outline, thing_of
from flockbrush.systems.commands import AddAnimals, RemoveAnimals
from flockbrush.systems.edits import MarkSpawn, RemoveThing


class AddAnimalsTool(Stroke):
    """Puts animals down."""

    name, title, key, icon = "add", "Add animals", "n", "add"
    tip = "Add animals with the selected brush"
    hint = "Click or drag to add animals."
    palette = "brush"
    options: tuple[str, ...] = ("size", "count")

    def step(self):
        return 1.6 * self.app.size

    def release(self, xy):
        self.last = None

    def go(self, start, stop):
        app, brush = self.app, self.app.brush
        if brush is None or app.is_off_map(stop, stop, app.size):
            return
        add = AddAnimals(brush, *stop, app.size, app.options["count"], app.species_of(brush))
        if app.do("add animals", [*self.needed(), add], self.join):
            self._tell_of_paint(stop, brush)

    def begin(self, xy):
        self._warned = False
        super().begin(xy)

    def _tell_of_paint(self, xy, brush):
        """Show once a stroke that painted ground gives added animals another brush."""
        app = self.app
        painted = app.painted_under(xy, app.species_of(brush))
        if painted not in ("", brush) and not self._warned:
            self._warned = True
            app.notify(
                f"the ground here is painted with {painted}: animals follow that brush here, and {brush} elsewhere"
            )


class Predator(Tool):
    """Puts one predator down, which belongs to the level from then on."""

    name, title, key, icon = "predator", "Predator", "w", "predator"
    tip = "Add a predator of the chosen species, from which animals flee; it becomes part of the level"
    hint = "Click to add a predator."
    options = ("hunter",)

    def press(self, xy, button, mods):
        app = self.app
        if button != 1 or app.is_off_map(xy, xy, 0.0):
            return
        hunter = app.hunter()
        if hunter is None:
            app.notify("there is no brush for a predator; use a shipped one such as wolf-hunt", "warning")
            return
        name = free_name(app.session.simulation, hunter.species)
        room = rows(self._room(xy, hunter))
        mark = MarkSpawn(app.new_id(), name, room, hunter.brush, hunter.species, 1)
        app.do(f"add a {hunter.species}", [*app.brush_needed(hunter.brush), mark])

    def _room(self, xy, hunter):
        """Corners of a square about a point, large enough for its body, within the map."""
        level = self.app.session.simulation.level
        half = min(1.2 * self.app.body_length(hunter), level.width / 2, level.height / 2)
        x, y = (min(max(at, half), side - half) for at, side in zip(xy, (level.width, level.height), strict=True))
        return np.array([[x - half, y - half], [x + half, y - half], [x + half, y + half], [x - half, y + half]])

    def cursor(self, surface, camera):
        if self.at is not None:
            self.ring(surface, camera, 7 * self.app.scale / camera.scale_at(self.at), self.app.theme.predator)


class RemoveAnimalsTool(Stroke):
    """Takes animals away."""

    name, title, key, icon, ink = "remove", "Remove animals", "r", "remove", "predator"
    tip = "Remove the animals within the circle"
    hint = "Click or drag over animals to remove them."
    options = ("size",)
    spacing = 0.5

    def go(self, start, stop):
        app = self.app
        away = np.hypot(*(app.session.simulation.agents[Position.xyz][:, :2] - stop).T)
        if (away <= app.size).any():
            app.do("remove animals", [RemoveAnimals(*stop, app.size)], self.join)


class Select(Tool):
    """Takes hold of an animal to understand it, or of a thing to move or delete it."""

    name, title, key, icon = "select", "Select", "v", "select"
    tip = "Click an animal to see its forces; click an object to edit or delete it, drag it to move it"
    hint = "Click an animal to see its forces; click an object to edit or delete it, drag it to move it."

    def __init__(self, app):
        super().__init__(app)
        self.thing: tuple[str, int] | None = None  # kind and id
        self._pressed = None

    def press(self, xy, button, mods):
        if button != 1:
            return
        app = self.app
        app.select(app.animal_at(xy, self.reach(9)))
        hits = [] if app.selected is not None else app.things_at([xy], self.reach(), KINDS)
        self.thing = (hits[0][0], hits[0][1].id) if hits else None
        self._pressed = xy if self.thing else None
        if hits:
            kind = SPOKEN.get(hits[0][0], hits[0][0])
            app.set_hint(f"{kind} {hits[0][1].name!r}: drag to move it, P to edit its properties, Delete to remove it.")

    def drag(self, xy):
        pass

    def release(self, xy):
        start, self._pressed = self._pressed, None
        held = self.held()
        if start is None or held is None or np.hypot(xy[0] - start[0], xy[1] - start[1]) <= self.reach(6):
            return
        kind = self.thing[0]
        if not held.id:
            self.app.notify(f"this {kind} is not an object of the level", "warning")
            return
        shift = np.subtract(xy, start)
        change(self.app, f"move the {SPOKEN.get(kind, kind)}", *self.thing, lambda command: moved(command, shift))

    def held(self):
        """The selected thing as it is now, or None."""
        return thing_of(self.app.session.simulation, *self.thing) if self.thing else None

    def cancel(self) -> bool:
        going = self.thing is not None or self.app.selected is not None
        self._drop()
        self.app.select(None)
        return going

    def interrupt(self):
        self._pressed = None  # the selection stays: another edit of the same thing may follow

    def _drop(self):
        """Release the thing and its message."""
        if self.thing is not None and self.app.tool is self:
            self.app.set_hint(self.hint)
        self.thing = None

    def delete(self) -> bool:
        if self.thing is None or self.held() is None:
            return False
        kind, number = self.thing
        self._drop()
        self.app.do(f"remove the {SPOKEN.get(kind, kind)}", [RemoveThing(kind, number)])
        return True

    def cursor(self, surface, camera):
        held = self.held() if self.thing else None
        if held is None:
            self._drop()
        else:
            points, closed = outline(self.thing[0], held)
            self.path(surface, camera, points, self.app.accent, closed, width=3)
            if self._pressed is not None and self.at is not None:
                shift = np.subtract(self.at, self._pressed)
                self.path(surface, camera, points + shift, self.app.accent, closed, width=1.5)

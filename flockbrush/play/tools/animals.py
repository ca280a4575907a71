"""Tools for animals themselves: add, remove, predators, select."""

from __future__ import annotations

import numpy as np

from flockbrush.draw.style import rgb
from flockbrush.play.tools.things import move_goal
from flockbrush.play.tools.tool import Stroke, Tool
from flockbrush.play.tools.world import outline, things


class AddAnimals(Stroke):
    """Puts animals down."""

    name, title, key, icon = "add", "Add animals", "n", "add"
    tip = "Put animals of the chosen behaviour down"
    hint = "Click or drag to put animals down."
    palette = "brush"
    options: tuple[str, ...] = ("size", "count")

    def step(self):
        return 1.6 * self.app.size

    def release(self, xy):
        self.last = None

    def go(self, start, stop):
        from systems.commands import AddAnimals as Add

        app, brush = self.app, self.chosen()
        if brush is None or app.is_off_map(stop, stop, app.size):
            return
        add = Add(brush, *stop, app.size, self.count(), app.species_of(brush))
        app.do(self.label(), [*app.brush_needed(brush), add], self.join)

    def chosen(self):
        """Name of the brush of those who come."""
        return self.app.brush

    def count(self):
        """How many come at once."""
        return self.app.options["count"]

    def label(self):
        """What the undo list says."""
        return "add animals"

    def cursor(self, surface, camera):
        brush = self.chosen()
        self.ring(surface, camera, self.app.size, rgb(self.app.colour_of(brush)) if brush else self.app.theme.ink)


class Predator(AddAnimals):
    """Puts one predator down."""

    name, title, key, icon = "predator", "Predator", "w", "predator"
    tip = "Put a predator down; others flee from it"
    hint = "Click to put a predator down."
    palette, options = "", ()

    def step(self):
        return np.inf

    def chosen(self):
        brush = self.app.predator_brush()
        if brush is None:
            self.app.notify("there is no brush of a predator; wolf-hunt is one that comes with Flockbrush", "warning")
        return brush

    def count(self):
        return 1

    def label(self):
        return "add a predator"

    def cursor(self, surface, camera):
        if self.at is not None:
            self.ring(surface, camera, 7 * self.app.scale / camera.scale_at(self.at), self.app.theme.predator)


class RemoveAnimals(Stroke):
    """Takes animals away."""

    name, title, key, icon = "remove", "Remove animals", "r", "remove"
    tip = "Take away the animals within the circle"
    hint = "Click or drag over animals to take them away."
    options = ("size",)
    spacing = 0.5

    def go(self, start, stop):
        from components import Position
        from systems.commands import RemoveAnimals as Remove

        app = self.app
        away = np.hypot(*(app.session.simulation.agents[Position.xyz][:, :2] - stop).T)
        if (away <= app.size).any():
            app.do("remove animals", [Remove(*stop, app.size)], self.join)

    def cursor(self, surface, camera):
        self.ring(surface, camera, self.app.size, self.app.theme.predator)


class Select(Tool):
    """Takes hold of an animal to understand it, or of a thing to move or delete it."""

    name, title, key, icon = "select", "Select", "v", "select"
    tip = "Click an animal to see why it turns; click a thing to delete it, drag a goal to move it"
    hint = "Click an animal to see why it turns; click a thing to delete it."

    def __init__(self, app):
        super().__init__(app)
        self.thing: tuple[str, int] | None = None  # kind and id
        self._pressed = None

    def press(self, xy, button, mods):
        if button != 1:
            return
        app = self.app
        app.select(app.animal_at(xy, self.reach(9)))
        found = [] if app.selected is not None else app.things_at(
            [xy], self.reach(), kinds=("goal", "guide", "obstacle", "exit", "spawn")
        )  # fmt: skip
        self.thing = (found[0][0], found[0][1].id) if found else None
        self._pressed = xy if self.thing else None
        if found:
            app.set_hint(f"{found[0][0]} {found[0][1].name!r}:  Delete takes it away.")

    def drag(self, xy):
        pass

    def release(self, xy):
        start, self._pressed = self._pressed, None
        held = self.held()
        if start is None or held is None or self.thing[0] != "goal":
            return
        if np.hypot(xy[0] - start[0], xy[1] - start[1]) > self.reach(6):
            move_goal(self.app, held, (held.xy[0] + xy[0] - start[0], held.xy[1] + xy[1] - start[1]))

    def held(self):
        """The selected thing as it is now, or None."""
        for kind, thing in things(self.app.session.simulation):
            if self.thing == (kind, getattr(thing, "id", None)):
                return thing
        return None

    def cancel(self) -> bool:
        going = self.thing is not None or self.app.selected is not None
        self.thing = None
        self.app.select(None)
        return going

    def delete(self) -> bool:
        from systems.edits import RemoveThing

        if self.thing is None or self.held() is None:
            return False
        kind, number = self.thing
        self.thing = None
        self.app.do(f"remove the {kind if kind != 'spawn' else 'spawn area'}", [RemoveThing(kind, number)])
        return True

    def cursor(self, surface, camera):
        held = self.held() if self.thing else None
        if held is not None:
            points, closed = outline(self.thing[0], held)
            self.path(surface, camera, points, self.app.accent, closed, width=3)
            if self._pressed is not None and self.at is not None and self.thing[0] == "goal":
                shift = np.subtract(self.at, self._pressed)
                self.path(surface, camera, points + shift, self.app.accent, closed, width=1.5)

"""Tools that draw and place things: obstacles, guides, goals, exits, spawn areas."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pygame

from flockbrush.levels.geometry import distance_to_line
from flockbrush.studio.outlines import box, rows, swath, thinned
from flockbrush.studio.tools.tool import Tool
from flockbrush.studio.tools.world_tools import change, free_name, moved, outline, thing_of, things
from flockbrush.systems.commands import AddObstacle
from flockbrush.systems.edits import DrawGuide, MarkSpawn, PlaceExit, PlaceGoal, RemoveThing

CLICK = 6.0  # pixels the mouse may move and it is still a click
DOUBLE = 0.4  # s between the two presses of a double click


class ShapeTool(Tool):
    """A tool that draws a shape: by dragging, or corner by corner."""

    def __init__(self, app):
        super().__init__(app)
        self.points: list[tuple[float, float]] = []
        self.dragging = False
        self._pressed_at = 0.0

    def cancel(self) -> bool:
        going = bool(self.points)
        self.points, self.dragging = [], False
        return going

    def is_double(self, xy) -> bool:
        """Whether this press follows another one at the same place at once."""
        now = self.app.now
        quick = now - self._pressed_at < DOUBLE
        self._pressed_at = now
        return quick and bool(self.points) and self.is_near(xy, self.points[-1])

    def is_near(self, xy, other) -> bool:
        """Whether two points of the ground are one for the mouse."""
        return float(np.hypot(xy[0] - other[0], xy[1] - other[1])) <= self.reach(CLICK)

    def delete(self) -> bool:
        if self.dragging:
            return self.cancel()
        if self.points:
            self.points.pop()
            return True
        return False


class OutlineTool(ShapeTool):
    """Draws outlines: with a round pen, as a rectangle, or corner by corner."""

    options: tuple[str, ...] = ("shape", "size")
    label = ""  # what a step of undo is called
    HINTS = {
        "pen": "Drag to draw with a round pen.",
        "rectangle": "Drag from corner to corner.",
        "polygon": "Click the corners; Enter or a double click closes the shape.",
    }

    @property
    def shape(self):
        """pen | rectangle | polygon."""
        return self.app.options["shape"]

    def press(self, xy, button, mods):
        if button == 3:
            self.finish()
        elif button != 1:
            return
        elif self.shape == "polygon":
            self._corner(xy)
        else:
            self.points, self.dragging = [xy], True

    def _corner(self, xy):
        closes = len(self.points) > 2 and self.is_near(xy, self.points[0])
        if self.is_double(xy) or closes:
            self.finish()
        elif not (self.points and self.is_near(xy, self.points[-1])):
            self.points.append(xy)

    def drag(self, xy):
        if not self.dragging:
            return
        if self.shape == "rectangle":
            self.points[1:] = [xy]
        elif np.hypot(xy[0] - self.points[-1][0], xy[1] - self.points[-1][1]) > 0.25 * self.app.size:
            self.points.append(xy)

    def release(self, xy):
        if not self.dragging:
            return
        self.dragging = False
        points, self.points = self.points, []
        if self.shape == "rectangle":
            if len(points) > 1 and not self.is_near(*points):
                self.build([box(*points)])
        else:
            self.build(swath([*points, xy], self.app.size))

    def finish(self):
        if self.shape == "polygon":
            points, self.points = self.points, []
            if len(points) > 2:
                self.build([points])

    def build(self, polygons):
        """Put what was drawn down, but for what lies off the map: one thing for each outline."""
        app = self.app
        name = free_name(app.session.simulation, self.name)
        polygons = [
            polygon for polygon in polygons if not app.is_off_map(np.min(polygon, axis=0), np.max(polygon, axis=0), 0.0)
        ]
        commands = []
        for k, polygon in enumerate(polygons):
            called = name if len(polygons) == 1 else f"{name}{'abcdefghijklmnopqrstuvwxyz'[k % 26]}"
            commands.append(self.command(called, rows(polygon)))
        if commands:
            app.do(self.label, [*self.needed(), *commands])

    def command(self, name, points):
        """The command that puts one down."""
        raise NotImplementedError

    def cursor(self, surface, camera):
        colour = self.colour()
        if self.shape == "pen":
            self.ring(surface, camera, self.app.size, colour)
            if self.dragging:
                self._pen(surface, camera)
        elif self.shape == "rectangle" and len(self.points) > 1:
            self.path(surface, camera, box(*self.points[:2]), colour, closed=True)
        elif self.points:
            ends = [self.at] if self.at and self.shape == "polygon" else []
            self.path(surface, camera, [*self.points, *ends], colour)
            self.dots(surface, camera, self.points, colour)

    def _pen(self, surface, camera):
        """What has been drawn so far."""
        width = min(max(2, round(2 * self.app.size * camera.scale_at(self.points[-1]))), 400)
        pixels = camera.pixels(self.points)
        for x, y in pixels:
            pygame.draw.circle(surface, self.colour(), (x, y), width / 2)
        if len(pixels) > 1:
            pygame.draw.lines(surface, self.colour(), False, pixels.tolist(), width)


class ObstacleTool(OutlineTool):
    """Draws obstacles."""

    name, title, key, icon, ink = "obstacle", "Obstacle", "o", "obstacle", "obstacle_edge"
    tip = "Draw an obstacle; press the key again to change the drawing mode"
    hint, label = "Drag to draw an obstacle.", "add an obstacle"
    options = ("shape", "size", "solid", "blocks_view")

    def command(self, name, points):
        app = self.app
        return AddObstacle(name, points, app.options["solid"], app.options["blocks_view"], id=app.new_id())


class PathTool(ShapeTool):
    """Draws things that are lines, and reshapes those there are."""

    spoken = ""  # what a person calls the thing
    makes: Callable  # the command that draws one: id, name, points

    def __init__(self, app):
        super().__init__(app)
        self.held = None  # (id, points, index) while a point is dragged
        self.hot = None  # (id, index) of the point under the mouse

    def press(self, xy, button, mods):
        if button == 3:
            return self.finish() if self.points else self._drop(xy)
        if button != 1:
            return None
        if self.points:
            return self._next(xy)
        return self._hold(xy) or self._start(xy)

    def _start(self, xy):
        self._pressed_at = self.app.now
        self.points, self.dragging = [xy], True

    def _next(self, xy):
        if self.is_double(xy):
            self.finish()
        elif not self.is_near(xy, self.points[-1]):
            self.points.append(xy)

    def _hold(self, xy) -> bool:
        """Take hold of a point of a line; of a new one where the mouse is between two."""
        hit = self._point_at(xy)
        if hit is not None:
            line, index = hit
            self.held = (line.id, [tuple(p) for p in np.asarray(line.points).tolist()], index)
            return True
        for _, line in self.app.things_at([xy], self.reach(), kinds=(self.name,)):
            _, segment = distance_to_line(np.asarray(xy), *outline(self.name, line))
            points = [tuple(p) for p in np.asarray(line.points).tolist()]
            points.insert(segment + 1, xy)
            self.held = (line.id, points, segment + 1)
            return True
        return False

    def _point_at(self, xy):
        """(line, index) of the nearest point of any line within reach, or None."""
        best, hit = self.reach(10), None
        for kind, line in things(self.app.session.simulation):
            if kind == self.name:
                away = np.hypot(*(np.asarray(line.points) - xy).T)
                if away.min() <= best:
                    best, hit = float(away.min()), (line, int(away.argmin()))
        return hit

    def _drop(self, xy):
        """Take a point out of a line; with the last but one the line goes."""
        hit = self._point_at(xy)
        if hit is None:
            return False
        line, index = hit
        if len(line.points) <= 2:
            self.app.do(f"remove {self.spoken}", [RemoveThing(self.name, line.id)])
        else:
            self._reshape(line.id, np.delete(np.asarray(line.points), index, axis=0), "delete a point")
        return True

    def delete(self) -> bool:
        return super().delete() or (self.at is not None and self._drop(self.at))

    def move(self, xy):
        hit = None if self.points else self._point_at(xy)
        self.hot = None if hit is None else (hit[0].id, hit[1])

    def drag(self, xy):
        if self.held is not None:
            _, points, index = self.held
            points[index] = xy
        elif self.dragging and not self.is_near(xy, self.points[-1]):
            self.points.append(xy)

    def release(self, xy):
        if self.held is not None:
            number, points, index = self.held
            self.held = None
            points[index] = xy
            return self._reshape(number, points, f"reshape {self.spoken}")
        if self.dragging:
            self.dragging = False
            if len(self.points) > 1:  # drawn in one go
                points, self.points = self.points, []
                self._draw(thinned([*points, xy], self.reach(5)))
        return None

    def finish(self):
        points, self.points, self.dragging = self.points, [], False
        if len(points) > 1:
            self._draw(points)

    def cancel(self) -> bool:
        going, self.held = self.held is not None, None
        return super().cancel() or going

    def _draw(self, points):
        app = self.app
        name = free_name(app.session.simulation, self.name)
        app.do(f"draw {self.spoken}", [self.makes(app.new_id(), name, rows(points))])

    def _reshape(self, number, points, label):
        change(self.app, label, self.name, number, lambda command: replace(command, points=rows(points)))

    def cursor(self, surface, camera):
        colour = self.colour()
        if self.points:
            ends = [self.at] if self.at and not self.dragging else []
            self.path(surface, camera, [*self.points, *ends], colour, width=2.5)
            if not self.dragging:
                self.dots(surface, camera, self.points, colour)
            return
        for kind, line in things(self.app.session.simulation):
            if kind != self.name:
                continue
            held = self.held is not None and self.held[0] == line.id
            points = self.held[1] if held else line.points
            if held:
                self.path(surface, camera, points, colour, outline(kind, line)[1], width=2.5)
            hot = self.held[2] if held else self.hot[1] if self.hot and self.hot[0] == line.id else None
            self.dots(surface, camera, points, colour, hot)


class GuideTool(PathTool):
    """Draws arrows for leaders to follow."""

    name, title, key, icon, ink, spoken, makes = "guide", "Guide", "g", "guide", "guide", "a guide", DrawGuide
    tip = "Draw a guide that leaders follow; drag its points to reshape it"
    hint = "Drag to draw a guide for leaders. Drag its points to reshape it."


class SpanTool(ShapeTool):
    """Draws things given by two points: the start and the end of a drag."""

    def press(self, xy, button, mods):
        if button == 1:
            self.points, self.dragging = [xy, xy], True

    def drag(self, xy):
        if self.dragging:
            self.points[1] = xy

    def release(self, xy):
        if not self.dragging:
            return
        self.drag(xy)
        (a, b), self.points, self.dragging = self.points, [], False
        self.draw(a, b)

    def draw(self, a, b):
        """Draw the thing from one point to the other."""


class GoalTool(SpanTool):
    """Places goals, and moves those there are."""

    name, title, key, icon = "goal", "Goal", "h", "goal"
    tip = "Place a goal; drag outwards to enlarge it, drag its flag to move it"
    hint = "Click to place a goal; drag its flag to move it."

    held = None  # id of the goal that is dragged

    def press(self, xy, button, mods):
        if button != 1:
            return
        hits = self.app.things_at([xy], self.reach(10), kinds=("goal",))
        self.held = hits[0][1].id if hits else None
        super().press(xy, button, mods)

    def draw(self, a, b):
        held, self.held = self.held, None
        if held is not None:
            if not self.is_near(a, b):
                change(self.app, "move a goal", "goal", held, lambda command: moved(command, np.subtract(b, a)))
            return
        app, radius = self.app, float(np.hypot(b[0] - a[0], b[1] - a[1]))
        radius = app.usual_radius() if self.is_near(a, b) else radius
        name = free_name(app.session.simulation, "goal")
        app.do("place a goal", [PlaceGoal(app.new_id(), name, *a, round(radius, 2))])

    def cursor(self, surface, camera):
        if not self.dragging:
            return
        a, b = self.points
        if self.held is not None:
            goal = thing_of(self.app.session.simulation, "goal", self.held)
            if goal is not None:
                around, closed = outline("goal", goal)
                self.path(surface, camera, around + np.subtract(b, a), self.app.theme.goal, closed)
            return
        radius = float(np.hypot(b[0] - a[0], b[1] - a[1]))
        self.circle(surface, camera, a, max(3.0 / camera.scale_at(a), radius), self.app.theme.goal, 2)


class AreaTool(SpanTool):
    """Draws rectangular areas from corner to corner."""

    def draw(self, a, b):
        if self.is_near(a, b):
            r = self.app.usual_radius()
            a, b = (a[0] - r, a[1] - r), (a[0] + r, a[1] + r)
        self.place(self.inside(box(a, b)))

    def inside(self, corners):
        """The part of a rectangle that lies on the map."""
        level = self.app.session.simulation.level
        return np.clip(corners, 0, (level.width, level.height))

    def place(self, corners):
        """Put the thing there."""

    def cursor(self, surface, camera):
        if self.dragging:
            self.path(surface, camera, box(*self.points), getattr(self.app.theme, self.ink), closed=True)


class ExitTool(AreaTool):
    """Draws areas in which animals leave the world."""

    name, title, key, icon, ink = "exit", "Exit", "x", "exit", "exit"
    tip = "Draw an area that removes animals that enter it"
    hint = "Drag a rectangle: animals that enter it are removed."

    def place(self, corners):
        name = free_name(self.app.session.simulation, "exit")
        self.app.do("place an exit", [PlaceExit(self.app.new_id(), name, rows(corners))])


class SpawnAreaTool(AreaTool):
    """Draws areas in which animals come into the world."""

    name, title, key, icon, ink = "spawn", "Spawn area", "a", "spawn", "spawn"
    tip = "Draw an area in which animals are created, now and at each start of the level"
    hint = "Drag a rectangle: animals are created there, now and at each start of the level."
    palette, options = "brush", ("count",)

    def place(self, corners):
        app, brush = self.app, self.app.brush
        name = free_name(app.session.simulation, "spawn")
        mark = MarkSpawn(app.new_id(), name, rows(corners), brush, app.species_of(brush), app.options["count"])
        app.do("mark a spawn area", [*self.needed(), mark])

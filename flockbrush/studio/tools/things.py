"""Tools that draw and place things: obstacles, guides, goals, exits, spawn areas."""

from __future__ import annotations

import numpy as np
import pygame

from flockbrush.studio.outlines import box, rows, swath, thinned
from flockbrush.studio.tools.tool import Tool
from flockbrush.studio.tools.world_tools import free_name, outline, things

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


class ObstacleTool(ShapeTool):
    """Draws obstacles: with a round pen, as a rectangle, or corner by corner."""

    name, title, key, icon = "obstacle", "Obstacle", "o", "obstacle"
    tip = "Draw an obstacle; press the key again to change the pen"
    hint = "Drag to draw an obstacle."
    options = ("shape", "size", "solid", "blocks_view")
    HINTS = {
        "pen": "Drag to draw an obstacle with a round pen.",
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
        """Put obstacles down."""
        from flockbrush.systems.commands import AddObstacle

        app = self.app
        name = free_name(app.session.simulation, "obstacle")
        solid, opaque = app.options["solid"], app.options["blocks_view"]
        commands = []
        polygons = [
            polygon for polygon in polygons if not app.is_off_map(np.min(polygon, axis=0), np.max(polygon, axis=0), 0.0)
        ]
        for k, polygon in enumerate(polygons):
            called = name if len(polygons) == 1 else f"{name}{'abcdefghijklmnopqrstuvwxyz'[k % 26]}"
            commands.append(AddObstacle(called, rows(polygon), solid, opaque, id=app.new_id()))
        if commands:
            app.do("add an obstacle", commands)

    def cursor(self, surface, camera):
        colour = self.app.theme.obstacle_edge
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
            pygame.draw.circle(surface, self.app.theme.obstacle, (x, y), width / 2)
        if len(pixels) > 1:
            pygame.draw.lines(surface, self.app.theme.obstacle, False, pixels.tolist(), width)


class GuideTool(ShapeTool):
    """Draws arrows for leaders to follow, and reshapes those there are."""

    name, title, key, icon = "guide", "Guide", "g", "guide"
    tip = "Draw an arrow that leaders follow; drag its points to reshape it"
    hint = "Drag to draw a way for leaders.  Drag its points to reshape it."

    def __init__(self, app):
        super().__init__(app)
        self.held = None  # (guide, points, index) while a point is dragged
        self.hot = None  # (guide, index) of the point under the mouse

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
        """Take hold of a point of a guide; of a new one where the mouse is between two."""
        found = self._point_at(xy)
        if found is not None:
            guide, index = found
            self.held = (guide, [tuple(p) for p in np.asarray(guide.points).tolist()], index)
            return True
        for _, guide in self.app.things_at([xy], self.reach(), kinds=("guide",)):
            from flockbrush.studio.outlines import distance_to_line

            _, segment = distance_to_line(np.asarray(xy), guide.points, guide.loop)
            points = [tuple(p) for p in np.asarray(guide.points).tolist()]
            points.insert(segment + 1, xy)
            self.held = (guide, points, segment + 1)
            return True
        return False

    def _point_at(self, xy):
        """(guide, index) of the nearest point of any guide within reach, or None."""
        best, found = self.reach(10), None
        for kind, guide in things(self.app.session.simulation):
            if kind == "guide":
                away = np.hypot(*(np.asarray(guide.points) - xy).T)
                if away.min() <= best:
                    best, found = float(away.min()), (guide, int(away.argmin()))
        return found

    def _drop(self, xy):
        """Take a point out of a guide; with the last but one the guide goes."""
        from flockbrush.systems.edits import RemoveThing

        found = self._point_at(xy)
        if found is None:
            return False
        guide, index = found
        if len(guide.points) <= 2:
            self.app.do("remove a guide", [RemoveThing("guide", guide.id)])
        else:
            self._reshape(guide, np.delete(np.asarray(guide.points), index, axis=0), "delete a point")
        return True

    def delete(self) -> bool:
        return super().delete() or (self.at is not None and self._drop(self.at))

    def move(self, xy):
        self.hot = None if self.points else self._point_at(xy)

    def drag(self, xy):
        if self.held is not None:
            guide, points, index = self.held
            points[index] = xy
        elif self.dragging and not self.is_near(xy, self.points[-1]):
            self.points.append(xy)

    def release(self, xy):
        if self.held is not None:
            guide, points, index = self.held
            self.held = None
            points[index] = xy
            return self._reshape(guide, points, "reshape a guide")
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
        from flockbrush.systems.edits import DrawGuide

        app = self.app
        name = free_name(app.session.simulation, "guide")
        app.do("draw a guide", [DrawGuide(app.new_id(), name, rows(points))])

    def _reshape(self, guide, points, label):
        from flockbrush.systems.edits import DrawGuide

        self.app.do(label, [DrawGuide(
            guide.id, guide.name, rows(points), guide.strength, guide.radius, guide.decay, guide.goal, guide.loop,
        )])  # fmt: skip

    def cursor(self, surface, camera):
        colour = self.app.theme.guide
        if self.points:
            ends = [self.at] if self.at and not self.dragging else []
            self.path(surface, camera, [*self.points, *ends], colour, width=2.5)
            if not self.dragging:
                self.dots(surface, camera, self.points, colour)
            return
        for kind, guide in things(self.app.session.simulation):
            if kind != "guide":
                continue
            held = self.held is not None and self.held[0] is guide
            points = self.held[1] if held else guide.points
            if held:
                self.path(surface, camera, points, colour, guide.loop, width=2.5)
            hot = self.held[2] if held else self.hot[1] if self.hot and self.hot[0] is guide else None
            self.dots(surface, camera, points, colour, hot)


class SpanTool(ShapeTool):
    """Draws what two points tell: where a drag began, and where it ended."""

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

    held = None

    def press(self, xy, button, mods):
        if button != 1:
            return
        found = self.app.things_at([xy], self.reach(10), kinds=("goal",))
        self.held = found[0][1] if found else None
        super().press(xy, button, mods)

    def draw(self, a, b):
        held, self.held = self.held, None
        if held is not None:
            if not self.is_near(a, b):
                move_goal(self.app, held, (held.xy[0] + b[0] - a[0], held.xy[1] + b[1] - a[1]))
            return
        from flockbrush.systems.edits import PlaceGoal

        app, radius = self.app, float(np.hypot(b[0] - a[0], b[1] - a[1]))
        radius = app.usual_radius() if self.is_near(a, b) else radius
        name = free_name(app.session.simulation, "goal")
        app.do("place a goal", [PlaceGoal(app.new_id(), name, *a, round(radius, 2))])

    def cursor(self, surface, camera):
        if not self.dragging:
            return
        a, b = self.points
        if self.held is not None:
            a = (self.held.xy[0] + b[0] - a[0], self.held.xy[1] + b[1] - a[1])
            radius = self.held.radius
        else:
            radius = float(np.hypot(b[0] - a[0], b[1] - a[1]))
        self.circle(surface, camera, a, max(3.0 / camera.scale_at(a), radius), self.app.theme.goal, 2)


def move_goal(app, goal, xy):
    """Put a goal elsewhere, with everything else as it is."""
    from flockbrush.systems.edits import PlaceGoal

    polygon = getattr(goal, "polygon", None)
    shift = np.asarray(xy) - goal.xy
    points = [] if polygon is None else rows(np.asarray(polygon) + shift)
    goals = [thing for kind, thing in things(app.session.simulation) if kind == "goal"]
    index = getattr(goal, "next_index", -1)
    after = goals[index].name if 0 <= index < len(goals) else ""
    place = PlaceGoal(goal.id, goal.name, float(xy[0]), float(xy[1]), goal.radius, goal.on_arrive, after, points)
    app.do("move a goal", [place])


class AreaTool(SpanTool):
    """Draws rectangular areas from corner to corner."""

    thing = ""

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
            self.path(surface, camera, box(*self.points), getattr(self.app.theme, self.thing), closed=True)


class ExitTool(AreaTool):
    """Draws areas in which animals leave the world."""

    name, title, key, icon, thing = "exit", "Exit", "x", "exit", "exit"
    tip = "Draw an area; animals that come there leave the world"
    hint = "Drag a rectangle: animals that come there leave the world."

    def place(self, corners):
        from flockbrush.systems.edits import PlaceExit

        name = free_name(self.app.session.simulation, "exit")
        self.app.do("place an exit", [PlaceExit(self.app.new_id(), name, rows(corners))])


class SpawnAreaTool(AreaTool):
    """Draws areas in which animals come into the world."""

    name, title, key, icon, thing = "spawn", "Spawn area", "a", "spawn", "spawn"
    tip = "Draw an area; animals are born there now, and whenever the level starts"
    hint = "Drag a rectangle: animals are born there, now and at each start."
    palette, options = "brush", ("count",)

    def place(self, corners):
        from flockbrush.systems.edits import MarkSpawn

        app, brush = self.app, self.app.brush
        name = free_name(app.session.simulation, "spawn")
        mark = MarkSpawn(app.new_id(), name, rows(corners), brush, app.species_of(brush), app.options["count"])
        app.do("mark a spawn area", [*app.brush_needed(brush), mark])


__all__ = ["AreaTool", "ExitTool", "GoalTool", "GuideTool", "ObstacleTool", "SpawnAreaTool", "move_goal", "outline"]

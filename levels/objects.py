"""Objects of a level: their class, their shape in metres, their properties."""

from __future__ import annotations

import numpy as np
from flockbrush.components.level_things import FAR
from flockbrush.engine import limits
from flockbrush.engine.problems import did_you_mean
from flockbrush.engine.solids import polyhedron
from flockbrush.levels import geometry
from flockbrush.levels.checked_nodes import class_of, real, text, whole
from flockbrush.levels.layer_reader import default_class
from flockbrush.levels.properties import read_properties
from flockbrush.levels.schema import (
    CLASSES,
    Area,
    Exit,
    Goal,
    Guide,
    Key,
    Line,
    Obstacle,
    Spawn,
    Zone,
)
from flockbrush.systems.obstacle_commands import MOST_CORNERS

OBJECT_CLASSES = [c.name for c in CLASSES.values() if c.use == "object"]
A_PYRAMID = "-2 -2 0; 2 -2 0; 2 2 0; -2 2 0; 0 0 5"
_SHAPES = {"area": "a rectangle, ellipse or polygon", "line": "a polyline", "point": "a point"}


class ObjectReader:
    """Reads the object layers into a level; leans on the level reader for structure and brushes."""

    def __init__(self, reader, frame, level):
        self.reader, self.frame, self.level = reader, frame, level
        self.ids: dict[int, int] = {}  # id -> line
        self.places: dict[int, object] = {}  # id -> place, for the checks that come later
        self.goal_ids: dict[int, str] = {}
        self.key_lines: dict[int, dict[str, int]] = {}  # id -> line of each property
        self.key_shapes: dict[int, tuple[str, np.ndarray]] = {}
        self.vertices = 0

    def place(self, thing):
        """Where a thing of the level stands in the file."""
        return self.places[thing.id]

    def layer(self, layer, kind):
        """Every object of one layer."""
        nodes = layer.node.get("objects", [])
        if not isinstance(nodes, list):
            layer.place.say("'objects' must be a list")
            return
        for node in nodes:
            if not isinstance(node, dict):
                layer.place.say("each of the 'objects' must be an object")
            elif len(self.ids) >= limits.OBJECTS:
                layer.place.say(f"there are more than {limits.OBJECTS} objects")
                return
            else:
                self.object(node, layer, kind)

    def object(self, node, layer, kind):
        """One object: find its class, then let its own method read it."""
        place = layer.place.at(node, f"an object in {layer.place.where}")
        number = whole(node, "id", place, 1, 2**31 - 1)
        if number is None:
            return
        name = text(node, "name", place)
        called = f" {name[:60]!r}" if name else ""
        place = layer.place.at(node, f"object {number}{called} in {layer.place.where}")
        if number in self.ids:
            place.say(f"object id {number} is taken by the object at line {self.ids[number]}")
            return
        self.ids[number] = place.line
        self.places[number] = place
        if "template" in node:
            place.say("templates are not supported; detach the object (in Tiled: right click > Detach)")
            return
        cls = self.class_of(node, kind, place)
        if cls is not None:
            if node.get("visible") is False:
                place.warn("is hidden in Tiled but still used; delete it, or move it to a layer 'notes ...'")
            shape = self.shape(node, layer, place)
            if shape is not None and self.takes(CLASSES[cls], shape, place):
                getattr(self, cls.lower())(number, name, shape, read_properties(node, CLASSES[cls], place), place)

    def class_of(self, node, kind, place):
        """The object's class, or the one its layer is for; None: not ours, or a problem."""
        cls = class_of(node, place)
        if cls in OBJECT_CLASSES:
            return cls
        if "text" in node and not cls:
            return None
        if cls:
            place.say(f"there is no class {cls[:60]!r}{did_you_mean(cls, OBJECT_CLASSES)}")
            return None
        at_home = default_class(node, kind)
        if at_home is None:
            place.say(f"has no class; set one of {', '.join(OBJECT_CLASSES)}")
        return at_home

    def takes(self, cls, shape, place):
        """Whether this class may have this shape."""
        kind, points = shape
        if kind not in cls.shapes:
            shapes = " or ".join(_SHAPES[s] for s in cls.shapes)
            place.say(f"{article(cls.name)} must be {shapes}, but this is {_SHAPES[kind]}")
            return False
        if kind == "area" and not self.sound(points, place):
            return False
        if kind == "line" and len(points) < 2:
            place.say("the line needs at least two different points")
            return False
        return True

    def sound(self, polygon, place):
        """A polygon with an area that does not cross itself."""
        if len(polygon) < 3 or geometry.span_area(polygon) < 1e-6 * self.frame.metres**2:
            place.say("its area is zero; enlarge or delete it")
            return False
        edges = geometry.crossing(polygon)
        if edges is not None:
            at = ", ".join(f"{v:.1f}" for v in polygon[edges[0]])
            place.say(f"its outline crosses itself near ({at}) m; move the corners apart")
            return False
        return True

    # ------------------------------------------------------------ shapes

    def shape(self, node, layer, place):
        """("area" | "line" | "point", (k, 2) m), areas counter-clockwise; None with a problem."""
        x, y = real(node, "x", place), real(node, "y", place)
        w, h = real(node, "width", place), real(node, "height", place)
        angle = real(node, "rotation", place, limit=1e6)
        outline = self.drawn(node, w, h, place)
        if outline is None:
            return None
        kind, points = outline
        self.vertices += len(points)
        if self.vertices > limits.LEVEL_CORNERS:
            place.say(f"all outlines together have more than {limits.LEVEL_CORNERS} corners")
            return None
        points = geometry.turn(points, angle) + (x + layer.dx, y + layer.dy)
        points = geometry.without_repeats(self.frame.to_metres(points), kind == "area")
        return kind, geometry.counter_clockwise(points) if kind == "area" else points

    def drawn(self, node, w, h, place):
        """The outline about the object's own origin, px."""
        for key in ("polygon", "polyline"):
            if key in node:
                points = self.vertex_list(node[key], key, place)
                return None if points is None else ("area" if key == "polygon" else "line", points)
        if node.get("point") is True:
            return "point", np.zeros((1, 2))
        if w < 0 or h < 0:
            place.say(f"width and height must not be negative, got {w:g} x {h:g} px")
            return None
        if node.get("ellipse") is True:
            return "area", geometry.ellipse(w, h)
        if node.get("capsule") is True:
            return "area", geometry.capsule(w, h)
        corners = geometry.rectangle(w, h)
        return "area", corners - self.tile_origin(node, w, h, place) if "gid" in node else corners

    def tile_origin(self, node, w, h, place):
        """Tile objects stand on their bottom-left corner, unless their tileset says otherwise."""
        gid = whole(node, "gid", place, 1, 2**32 - 1)
        gid = (gid or 0) & 0x0FFFFFFF
        if self.reader.tiles.of(gid) is None and not self.reader.tiles.lost:
            place.say(f"no tileset has tile id {gid}")
        return np.array(self.reader.tiles.origin(gid)) * (w, h)

    def vertex_list(self, entries, key, place):
        if not isinstance(entries, list) or not entries or not all(isinstance(p, dict) for p in entries):
            place.say(f"'{key}' must be a list of points, at least one")
            return None
        if len(entries) > limits.CORNERS:
            place.say(f"the outline has {len(entries)} corners; there may be at most {limits.CORNERS}")
            return None
        return np.array([[real(p, k, place) for k in "xy"] for p in entries], float).reshape(-1, 2)

    # ------------------------------------------------------------ one method per class

    def obstacle(self, number, name, shape, v, place):
        if v["z_min"] >= v["z_max"]:
            place.say(f"z_min must be below z_max, got {v['z_min']:g} and {v['z_max']:g} m")
        corners = self.corners(v.pop("corners"), v["shape"], place)
        self.level.obstacles.append(Obstacle(number, name, shape[1], corners=corners, **v))

    def corners(self, text, shape, place):
        """(k, 3) m of a hull, None of other shapes and of what is no hull."""
        if shape != "hull":
            if text.strip():
                place.say(f"corners can only be used with shape 'hull', and shape is {shape!r}")
            return None
        try:
            parsed = [[float(word) for word in corner.replace(",", " ").split()] for corner in text.split(";")]
            if not 4 <= len(parsed) <= MOST_CORNERS or any(len(corner) != 3 for corner in parsed):
                raise ValueError(f"4 to {MOST_CORNERS} corners of three numbers each are needed")
            if not np.abs(parsed).max() <= FAR:
                raise ValueError(f"coordinates must be at most {FAR:g} m")
            polyhedron(parsed)
        except ValueError as error:
            place.say(
                f"corners of a hull must be 'east north up; east north up; ...' in m, such as {A_PYRAMID!r}: {error}"
            )
            return None
        return np.array(parsed)

    def guide(self, number, name, shape, v, place):
        self.level.guides.append(Guide(number, name, shape[1], **v))

    def goal(self, number, name, shape, v, place):
        kind, points = shape
        xy = points[0] if kind == "point" else geometry.centroid(points)
        name = name or f"goal {number}"
        self.goal_ids[number] = name
        self.level.goals.append(Goal(number, name, xy, **v, polygon=points if kind == "area" else None))

    def zone(self, number, name, shape, v, place):
        if not (v["brush"] or v["max_speed"] or v["factor"] != 1 or v["event"]):
            place.say("does nothing; give it a brush, a max_speed, a factor or an event")
        brush = self.brush(v, place) if v["brush"] else None
        self.level.zones.append(Zone.of(number, name, shape[1], {**v, "brush": brush}))

    def spawn(self, number, name, shape, v, place):
        values = dict(v)
        values["brush"] = self.brush(v, place) if "brush" in v.given else ""
        values["count"] = self.count(shape[1], v, place)
        values |= {"speed": v["speed"] or None, "body_length": v["body_length"] or None}
        values["program"] = self.reader.program(v["program"], place, v.lines.get("program"))
        del values["density"]
        if v["rate"] and v["family_size"]:
            place.say("families need a rate of 0: they appear at once", v.lines.get("family_size"))
        self.level.spawns.append(Spawn(number, name, shape[1], **values))

    def count(self, polygon, v, place):
        """How many animals: as counted, or from the density."""
        count, density = v["count"], v["density"]
        if count and density:
            place.say(
                f"give count or density, not both (count is {count}, density {density:g})", v.lines.get("density")
            )
        if density:
            count = round(density * geometry.signed_area(polygon))
            if count < 1:
                place.say(
                    f"a density of {density:g} per m^2 gives no animal on {geometry.signed_area(polygon):.1f} m^2"
                )
        elif count < 1 and not v["rate"] and not {"count", "density", "rate"} & v.wrong:
            place.say("count must be at least 1, got 0", v.lines.get("count"))
        if count > limits.ANIMALS:
            place.say(f"{count} animals are too many; there may be at most {limits.ANIMALS}")
        return count

    def exit(self, number, name, shape, v, place):
        self.level.exits.append(Exit(number, name, shape[1]))

    def key(self, number, name, shape, v, place):
        kind, points = shape
        xy = geometry.centroid(points) if kind == "area" else points[0]
        if isinstance(v.others.get("program"), str):
            self.reader.program(v.others["program"], place, v.lines.get("program"))
        brush = v.others.get("brush")
        if isinstance(brush, str) and brush.endswith(".toml"):
            v.others["brush"] = self.reader.brush_file(brush, "", place, v.lines.get("brush"), "brush")
        self.level.script.append(Key(number, name, v["at"], v["command"], dict(v.others), xy, place.line))
        self.key_lines[number] = v.lines
        self.key_shapes[number] = shape

    def line(self, number, name, shape, v, place):
        self.level.lines.append(Line(number, name or f"line {number}", shape[1]))

    def area(self, number, name, shape, v, place):
        self.level.areas.append(Area(number, name or f"area {number}", shape[1]))

    def brush(self, v, place):
        return self.reader.brush(v["brush"], "", place, v.lines.get("brush"), "brush")

    # ------------------------------------------------------------ names of goals

    def finish(self):
        """Object references to goals become names."""
        for thing, key in [(g, "goal") for g in self.level.guides] + [(g, "next") for g in self.level.goals]:
            value = getattr(thing, key)
            if type(value) is int:
                if value and value not in self.goal_ids:
                    self.places[thing.id].say(f"{key}: object {value} is not a Goal")
                setattr(thing, key, self.goal_ids.get(value, ""))


def article(name):
    """A Spawn, an Exit."""
    return f"{'an' if name[0] in 'AEIO' else 'a'} {name}"

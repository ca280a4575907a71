"""The objects in a level's document: found, drawn, and taken out."""

from __future__ import annotations

from flockbrush.levels.document_changes import EditError
from flockbrush.levels.document_nodes import is_class, values_of
from flockbrush.levels.layer_reader import default_class, is_designer_layer, kind_of
from flockbrush.levels.object_outlines import outline_of, reshape, shape_as
from flockbrush.levels.schema import CLASSES
from flockbrush.levels.tiled import project_member

TYPES = {bool: "bool", int: "int", float: "float", str: "string"}  # of arguments, as Tiled calls them


class MapObjects:
    """The objects of an `EditedMap`.

    An object that was taken out and is drawn again keeps what no command tells, and comes into its layer if the order
    of the level allows it.
    """

    def __init__(self):
        self.brush_files: dict[str, str] = {}  # of brushes that the level names as files
        self._dropped: dict = {}  # (object, layer, dx, dy) by id and class

    def objects(self):
        """(object, layer, dx, dy) of all, those on the designer's own layers left out."""
        for node, dx, dy, _ in self.layers():
            for thing in node.get("objects", []) if not is_designer_layer(node.get("name", "")) else ():
                yield thing, node, dx, dy

    def find(self, number, cls):
        """(object, layer, dx, dy) of the object with this id, or None; EditError when it is something else."""
        entry = next((o for o in self.objects() if o[0].get("id") == number), None)
        if entry is not None and self.class_of(entry[0], entry[1]) != cls:
            what = self.class_of(entry[0], entry[1]) or "not a Flockbrush object"
            raise EditError(f"object {number} of the level is {what}, not {cls}")
        return entry

    def known(self, number, cls):
        """As `find`; of an object that was taken out, while its layer is there, what `find` gave before."""
        entry = self.find(number, cls)
        if entry is None:
            once = self._dropped.get((number, cls))
            entry = once if once and any(node is once[1] for node, *_ in self.layers()) else None
        return entry

    def class_of(self, thing, node):
        """The class of an object, its own or its layer's."""
        return thing.get("class") or thing.get("type") or default_class(thing, kind_of(node.get("name", ""))) or ""

    def outline(self, thing, dx, dy):
        """("area" | "line" | "point", (k, 2) m) of an object."""
        return outline_of(self.document, thing, dx, dy, self.tiles.origin(thing.get("gid", 0)))

    def draw(self, number, cls, name, shape, points, properties, at=-1):
        """Add an object, or change the one with this id: its outline only if it is another; points None: as it is.

        A new one becomes number ``at`` of its class, or stands behind all others.  It has all defaults that the
        properties do not tell, also where one with its id was taken out.
        """
        if not number:
            raise EditError(f"{cls.lower()} {name!r} has no id, so no level file can hold it")
        existing, there = self.known(number, cls), self.find(number, cls)
        if there is None:
            if points is None:
                raise EditError(f"the level has no {cls} with id {number}")
            properties = {p.name: p.default for p in CLASSES[cls].properties if not p.required} | properties
            node, dx, dy, following = self._place_of_new(cls, at, existing)
        else:
            _, node, dx, dy = there
            following = None
        named = "class" if str(self.data.get("version", "")) == "1.9" else "type"
        if existing is None:
            thing: dict = {
                named: cls,
                "height": 0,
                "id": number,
                "name": name,
                "rotation": 0,
                "visible": True,
                "width": 0,
            }
            shape_as(self.document, thing, shape, points, dx, dy)
        else:
            old, _, east, south = existing
            thing = {**old, "name": name}
            if self.class_of(thing, node) != cls:  # its layer gave the class
                thing[named] = cls
            if (east, south) != (dx, dy):
                thing |= {"x": thing.get("x", 0) + east - dx, "y": thing.get("y", 0) + south - dy}
            if points is not None:
                reshape(self.document, thing, self.outline(thing, dx, dy), shape, points, dx, dy)
        self._tell(thing, CLASSES[cls], properties)
        self._replace(node, number, thing, following)
        if number >= self.data.get("nextobjectid", 0):
            self.set(self.data, "nextobjectid", number + 1)

    def _tell(self, thing, cls, properties):
        """Properties: those that are there change, others are added when they are not the default."""
        entries = [dict(entry) for entry in thing.get("properties", [])]
        if cls.open:  # the arguments of another command
            entries = [e for e in entries if e["name"] in properties or cls.property(e["name"]) or is_class(e, cls)]
        whole = next((e for e in entries if isinstance(e["value"], dict) and is_class(e, cls)), None)
        members = {} if whole is None else dict(whole["value"])
        for name, value in properties.items():
            p = cls.property(name)
            if p.kind == "brush" if p is not None else name == "brush":
                value = self.brush_files.get(value, value)
            entry = next((e for e in entries if e["name"] == name), None)
            if name in members:
                members[name] = value
            elif p is None:
                entries = [e for e in entries if e is not entry]
                entries.append({"name": name, "type": TYPES[type(value)], "value": value})
            elif entry is None:
                if value != p.default or p.required:
                    entries.append({**project_member(p, "propertytype"), "value": value})
            elif not (p.kind == "goal" and type(entry["value"]) is int and self._goal(entry["value"]) == value):
                entry |= {"value": value, "type": "string"} if p.kind == "goal" else {"value": value}
        if whole is not None:
            whole["value"] = members
        if entries:
            thing["properties"] = sorted(entries, key=lambda e: e["name"])

    def _goal(self, number):
        """The name of the goal with this id."""
        return next((o.get("name") or f"goal {number}" for o, *_ in self.objects() if o.get("id") == number), "")

    def _place_of_new(self, cls, at, once):
        """(layer, dx, dy, the object that comes next there or None) of what becomes number ``at`` of its class.

        In the layer where it was ``once``, as `known` tells, or one for its class, unless the order of the level, which
        is that of its layers, wants another.
        """
        same = [entry for entry in self.objects() if self.class_of(*entry[:2]) == cls]
        at = at if 0 <= at < len(same) else len(same)
        layers = [entry[:3] for entry in self.layers() if entry[0].get("type") == "objectgroup"]
        rank = {id(node): k for k, (node, _, _) in enumerate(layers)}
        first = rank[id(same[at - 1][1])] if at else 0
        end = rank[id(same[at][1])] + 1 if at < len(same) else len(layers)
        between = layers[first:end]
        fit = [entry for entry in between if once is not None and entry[0] is once[1]]
        fit += [entry for entry in between if kind_of(entry[0].get("name", "")) == CLASSES[cls].home]
        fit += [entry[1:] for entry in same[max(at - 1, 0) :]]
        node, dx, dy = fit[0] if fit else (self.add_object_layer(cls), 0.0, 0.0)
        return node, dx, dy, next((o for o, layer, *_ in same[at:] if layer is node), None)

    def _replace(self, node, number, thing, following):
        """Put an object in the place of the one with its id; where there is none, before another, None: at the end."""
        objects = node.get("objects", [])
        here = next((k for k, o in enumerate(objects) if o.get("id") == number), None)
        if here is not None:
            self.set(node, "objects", [*objects[:here], thing, *objects[here + 1 :]])
            return
        here = next((k for k, o in enumerate(objects) if o is following), len(objects))
        self.set(node, "objects", [*objects[:here], thing, *objects[here:]])

    def drop(self, number, cls):
        """Take an object out."""
        existing = self.find(number, cls)
        if existing is None:
            raise EditError(f"the level has no {cls} with id {number}")
        thing, node, *_ = self._dropped[number, cls] = existing
        self.set(node, "objects", [o for o in node["objects"] if o is not thing])

    def need_another_spawn(self, number):
        """EditError where this is the level's only spawn: a level without animals is none, and could not be opened."""
        others = [t for t, node, _, _ in self.objects() if t["id"] != number and self.class_of(t, node) == "Spawn"]
        if not others:
            raise EditError("this is the level's only spawn area; draw another first")

    def need_unnamed(self, name):
        """EditError while the level's script names this goal."""
        for thing, node, _, _ in self.objects():
            if self.class_of(thing, node) == "Key" and values_of(thing, CLASSES["Key"]).get("goal") == name:
                raise EditError(f"the script names goal {name!r} in object {thing['id']}; change that first")

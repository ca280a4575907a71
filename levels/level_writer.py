"""Writing a level: edit the document that was loaded, in place, and save it the way Tiled would.

What the designer made and we do not know survives; keys are sorted and the layout is Tiled's own, so the
difference between two saves is the change and no more.
"""

from __future__ import annotations

import copy
import json
from pathlib import Path

import numpy as np
from flockbrush.engine.files import make_backup, refused, write_bytes
from flockbrush.engine.problems import Problem, ProblemsError, did_you_mean
from flockbrush.levels.checked_nodes import parsed_document
from flockbrush.levels.document_nodes import values_of
from flockbrush.levels.json_lines import JsonError
from flockbrush.levels.schema import CLASSES
from flockbrush.levels.tile_data import decode

_XML = (".tmx", ".xml")
_TYPES = {bool: "bool", int: "int", float: "float", str: "string"}


# ---------------------------------------------------------------- the text


def dump(document: dict) -> str:
    """The document as Tiled 1.8 and later lays it out: sorted keys, whole floats as ints."""
    return _write(document, 0)


def _write(value, column):
    """`column` is where the brace of the object around stands."""
    if isinstance(value, dict):
        return _write_object(value, column)
    if isinstance(value, list | tuple):
        return _write_list(value, column)
    return _scalar(value)


def _write_object(value, column):
    margin = "\n" + " " * column
    if not value:
        return "{\n" + margin + "}"
    start = "{ " if column == 0 else "{" + margin + " "
    return start + f",{margin} ".join(_member(k, v, column) for k, v in sorted(value.items())) + margin + "}"


def _member(key, value, column):
    if isinstance(value, dict):
        column += 4
        return f"{_scalar(str(key))}:\n{' ' * column}{_write(value, column)}"
    return f"{_scalar(str(key))}:{_write(value, column)}"


def _write_list(values, column):
    if not any(isinstance(v, dict | list | tuple) for v in values):
        return "[" + ", ".join(map(_scalar, values)) + "]"
    margin = " " * (column + 8)
    return "[\n" + ", \n".join(margin + _write(v, column + 8) for v in values) + "]"


def _scalar(value):
    if isinstance(value, float | np.floating):
        value = float(value)
        if not np.isfinite(value):
            raise ValueError(f"{value} cannot be written to a level")
        value = int(value) if value == int(value) and abs(value) < 1e15 else value
    elif isinstance(value, np.integer):
        value = int(value)
    return json.dumps(value).replace("/", "\\/")


# ---------------------------------------------------------------- the file


def refuse_xml(path):
    """ProblemsError where a level's name says that it is XML."""
    path = Path(path)
    if path.suffix.lower() in _XML:
        message = f"a level is saved as Tiled's JSON; save it under another name, such as {path.stem}.tmj"
        raise refused(path, message)


def write_level(document: dict, path, backup=True) -> Path:
    """Save a level's document, all of it or nothing.

    Parameters
    ----------
    document : dict
        As loaded from a TMJ file and edited, or `Document.data`.
    path : path-like
        Where to; an earlier file there is kept as ``NAME.tmj.bak``.
    backup : bool
        Keep the earlier file.

    Raises
    ------
    ProblemsError
        When it cannot be written; the earlier file is then untouched.
    """
    path = Path(path)
    refuse_xml(path)
    data = (dump(document)).encode()
    try:
        changes = backup and path.exists() and path.read_bytes() != data
    except OSError as error:
        raise refused(path, f"cannot be read: {error.strerror or error}") from None
    if changes:
        make_backup(path)
    return write_bytes(path, data)


# ---------------------------------------------------------------- the document


class Document:
    """A level as its file has it, for editing: positions in metres, everything else as in Tiled.

    Parameters
    ----------
    data : dict
        The document; a copy is kept.
    path : path-like
        Where it came from, and where `save` puts it.
    """

    def __init__(self, data: dict, path):
        self.data = copy.deepcopy(data)
        self.path = Path(path)
        tile = self.data["tilewidth"]
        properties = values_of(self.data, CLASSES["FlockbrushLevel"])
        self.scale = tile / properties.get("metres_per_tile", 1)  # px per metre
        self.top = self.data["height"] * tile

    @classmethod
    def load(cls, path) -> Document:
        """The document of a TMJ or TMX file with a fixed size; it is saved as TMJ.

        Raises
        ------
        ProblemsError
            When it cannot be read.  Whether it makes a level is `read_level`'s business: call that first.
        """
        try:
            data = parsed_document(Path(path).read_bytes())
        except OSError as error:
            raise ProblemsError(
                [Problem(str(path), None, None, f"cannot be read: {error.strerror or error}")]
            ) from None
        except JsonError as error:
            raise ProblemsError([Problem(str(path), error.line, None, str(error))]) from None
        if not isinstance(data, dict) or data.get("infinite"):
            message = "an infinite map cannot be edited here; set a fixed size in Tiled (Map > Map Properties)"
            raise ProblemsError([Problem(str(path), 1, None, message)])
        return cls(data, path)

    def save(self, path=None, backup=True) -> Path:
        """Write the document back, or to another place."""
        return write_level(self.data, path or self.path, backup)

    # ------------------------------------------------------------ finding

    def layers(self, nodes=None):
        """Every layer, groups opened, with its offset in px: (layer, dx, dy)."""
        for node in self.data["layers"] if nodes is None else nodes:
            dx, dy = node.get("offsetx", 0), node.get("offsety", 0)
            if node.get("type") == "group":
                yield from ((n, x + dx, y + dy) for n, x, y in self.layers(node["layers"]))
            else:
                yield node, dx, dy

    def layer(self, name):
        """(layer, dx, dy) by name; KeyError with the names there are."""
        by_name = {node["name"]: (node, dx, dy) for node, dx, dy in self.layers()}
        if name not in by_name:
            raise KeyError(f"no layer {name!r}{did_you_mean(name, by_name)}")
        return by_name[name]

    def object(self, number):
        """(object, dx, dy) by id; KeyError."""
        for node, dx, dy in self.layers():
            for thing in node.get("objects", []):
                if thing["id"] == number:
                    return thing, dx, dy
        raise KeyError(f"no object {number}")

    # ------------------------------------------------------------ editing

    def move_object(self, number, xy):
        """Put an object's own origin at a place in metres."""
        thing, dx, dy = self.object(number)
        thing["x"], thing["y"] = _plain(self.pixels([xy])[0] - (dx, dy))

    def add_object(self, layer, cls, points, title="", /, closed=True, **properties) -> int:
        """Draw a polygon, a polyline (``closed=False``) or a point on an object layer.

        Parameters
        ----------
        layer : str
        cls : str
            One of the schema's object classes.
        points : array_like, (k, 2)
            Metres; one point makes a point object.
        title : str
            The object's name; by place, since a script command may have a property ``name``.

        Returns
        -------
        int
            The new object's id.
        """
        if cls not in CLASSES:
            raise KeyError(f"no class {cls!r}{did_you_mean(cls, CLASSES)}")
        node, dx, dy = self.layer(layer)
        px = self.pixels(points) - (dx, dy)
        number = self.data["nextobjectid"]
        self.data["nextobjectid"] = number + 1
        x, y = _plain(px[0])
        thing = {"id": number, "name": title, "type": cls, "x": x, "y": y, "width": 0, "height": 0, "rotation": 0}
        thing["visible"] = True
        if len(px) == 1:
            thing["point"] = True
        else:
            shape = [dict(zip("xy", _plain(p), strict=True)) for p in px - px[0]]
            thing["polygon" if closed else "polyline"] = shape
        for key, value in properties.items():
            _set(thing, key, value)
        node.setdefault("objects", []).append(thing)
        return number

    def paint(self, layer, cells, gid):
        """Set the tiles of a tile layer; cells are (iy, ix) from the south-west, gid 0 erases."""
        node = self.layer(layer)[0]
        width, height = node["width"], node["height"]
        gids = decode(node["data"], node.get("encoding"), node.get("compression"), width, height)
        flat = node["data"] if isinstance(node["data"], list) else gids.ravel().tolist()
        for iy, ix in cells:
            if 0 <= iy < height and 0 <= ix < width:
                flat[(height - 1 - iy) * width + ix] = int(gid)
        node["data"] = flat
        node.pop("encoding", None)
        node.pop("compression", None)

    def pixels(self, points):
        """Metres, y up -> px, y down, (k, 2)."""
        points = np.asarray(points, float).reshape(-1, 2)
        return np.column_stack([points[:, 0] * self.scale, self.top - points[:, 1] * self.scale])


def _plain(xy):
    """Two numbers, without the dust of arithmetic."""
    return [round(float(v), 6) for v in xy]


def _set(node, name, value):
    """Set one custom property, keeping the list sorted as Tiled does."""
    properties = node.setdefault("properties", [])
    entry = next((p for p in properties if p["name"] == name), None)
    if entry is None:
        entry = {"name": name, "type": _TYPES[type(value)]}
        properties.append(entry)
        properties.sort(key=lambda p: p["name"])
    entry["value"] = value

"""Checked pieces of a document of Tiled's: the document itself, its numbers and texts."""

from __future__ import annotations

from functools import lru_cache

from flockbrush.engine import limits
from flockbrush.levels.json_lines import JsonError, Node, parse
from flockbrush.levels.properties import is_number, shown
from flockbrush.levels.tmx import is_xml, read_xml

FAR = 10_000_000  # px or tiles; nothing real is farther out


def parsed_document(data):
    """The document in a file of Tiled's, JSON or XML; JsonError."""
    return read_xml(data) if is_xml(data) else parse(data, limits.JSON_DEPTH)


_parsed_once = lru_cache(maxsize=8)(
    parsed_document
)  # levels of a folder share their tilesets; parsed ones are not changed


def parsed(data, place, kind):
    """The JSON object in these bytes, if it is a `kind`."""
    if not data.strip():
        place.say(f"this file is empty; expected a Tiled {kind}", 1)
        return None
    try:
        doc = (parsed_document if kind == "map" else _parsed_once)(data)
    except JsonError as error:
        place.say(str(error), error.line)
        return None
    if not isinstance(doc, Node):
        place.say(f"this is not a Tiled {kind}: expected an object, got {shown(doc)}", 1)
        return None
    if doc.get("type") == "world":
        place.say(f"this is a Tiled world of several maps; open one of its maps{_maps_of(doc)}", doc.line)
        return None
    if doc.get("type", kind) != kind:
        place.say(f"this is not a Tiled {kind}: its type is {shown(doc.get('type'))}", doc.line)
        return None
    return doc


def _maps_of(doc):
    maps = doc.get("maps")
    names = [one.get("fileName") for one in maps if isinstance(one, dict)] if isinstance(maps, list) else []
    return ": " + ", ".join(str(name)[:60] for name in names[:6]) if names else ""


def whole(node, key, place, low, high, default=None):
    """A structural whole number; None with a problem."""
    value = node.get(key, default)
    if is_number(value) and value == int(value) and low <= value <= high:
        return int(value)
    place.say(f"'{key}' must be a whole number from {low} to {high}, got {shown(value)}")
    return None


def real(node, key, place, default=0.0, limit=FAR):
    """A structural number; the default with a problem."""
    value = node.get(key, default)
    if is_number(value) and abs(value) <= limit:
        return float(value)
    place.say(f"'{key}' must be a number up to {limit:g}, got {shown(value)}")
    return float(default or 0)


def text(node, key, place, default=""):
    """A structural text."""
    value = node.get(key, default)
    if isinstance(value, str):
        return value
    place.say(f"'{key}' must be a string, got {shown(value)}")
    return default


def class_of(node, place):
    """Tiled 1.8 and 1.10 say ``type``, 1.9 says ``class``."""
    return text(node, "class", place) or text(node, "type", place)


def dicts(node, key):
    """The objects in a list of a document, which may be anything."""
    value = node.get(key)
    return [one for one in value if isinstance(one, dict)] if isinstance(value, list) else []


def tiles_by_id(tileset):
    """{number: node} of the tiles in a tileset's document, which may be anything."""
    return {tile["id"]: tile for tile in dicts(tileset, "tiles") if type(tile.get("id")) is int}

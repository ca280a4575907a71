"""What nodes of a document of Tiled's are: layers in groups, properties of a class, paint that binds some, names of
files."""

from __future__ import annotations

from flockbrush.behaviours.brush import SUFFIX
from flockbrush.levels.schema import CLASSES

_FILES = ("source", "image", "template")  # of tilesets, pictures and objects


def is_class(entry, cls):
    """Whether a property holds all of a class as one value."""
    return (entry.get("propertytype") or entry["name"]).lower() == cls.name.lower()


def values_of(node, cls):
    """{name: value} of the properties of a node of a class, also where one holds all of the class."""
    values: dict = {}
    for entry in node.get("properties", []):
        whole = is_class(entry, cls) and isinstance(entry["value"], dict)
        values |= entry["value"] if whole else {entry["name"]: entry["value"]}
    return values


def properties_without(node, cls, names):
    """The properties of a node of a class but those of these names, also where one holds all of the class."""
    kept = []
    for entry in node.get("properties", []):
        if is_class(entry, cls) and isinstance(entry["value"], dict):
            kept.append({**entry, "value": {name: one for name, one in entry["value"].items() if name not in names}})
        elif entry["name"] not in names:
            kept.append(entry)
    return kept


def binds_some(node):
    """Whether a brush layer says whom it binds or how strongly: what is painted by hand belongs to none of those."""
    cls = CLASSES["BrushLayer"]
    properties = values_of(node, cls)
    return any(properties.get(one.name, one.default) != one.default for one in cls.properties)


def every_layer(nodes):
    """Every layer, groups too."""
    for node in nodes:
        yield node
        yield from every_layer(node.get("layers", []))


def is_brush_file(name):
    """Whether this names the file of a brush."""
    return name.endswith(SUFFIX)


def brush_files(node):
    """{brush: its file} of the brushes that a document names as files."""
    names = (one[key] for one, key in file_references(node) if is_brush_file(one[key]))
    return {name.replace("\\", "/").rsplit("/", 1)[-1].removesuffix(SUFFIX): name for name in names}


def file_references(node):
    """(node, key) wherever a document, or a part of one, names a file: a tileset, a picture, a template, a brush, or
    what a property of type file says."""
    if isinstance(node, list):
        for one in node if node and isinstance(node[0], dict) else ():
            yield from file_references(one)
    elif isinstance(node, dict):
        yield from ((node, key) for key in _FILES if node.get(key) and isinstance(node[key], str))
        value = node.get("value")
        if isinstance(value, dict):
            yield from ((value, key) for key, one in value.items() if isinstance(one, str) and is_brush_file(one))
        elif isinstance(value, str) and value and (node.get("type") == "file" or is_brush_file(value)):
            yield node, "value"
        for key, value in node.items():
            if key != "value":
                yield from file_references(value)


def file_names(node):
    """(name, whether a level needs it: templates and the files of a game are others' matter) of `file_references`."""
    for one, key in file_references(node):
        yield one[key], key in ("source", "image") or is_brush_file(one[key])

"""What nodes of a level's document are: layers in groups, properties of a class, paint that binds some."""

from __future__ import annotations

from flockbrush.levels.schema import CLASSES


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

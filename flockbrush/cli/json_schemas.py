"""JSON schemas of brush, level and sweep files; editors use them to complete names and show units and bounds.

Everything is generated from what the readers check against: the models' parameters, the classes of level things and
the specification of sweeps.  The readers check more (names that must exist, sums, geometry) and give better messages.
"""

from __future__ import annotations

import copy
from dataclasses import replace
from typing import Any

from flockbrush.behaviours import brush
from flockbrush.behaviours.behaviour import behaviours
from flockbrush.levels.level_class import ObjectClass, Property
from flockbrush.levels.schema import CLASSES, GROUP
from flockbrush.studies import sweep_file
from flockbrush.studies.experiments import experiments

DIALECT = "https://json-schema.org/draft/2020-12/schema"
Schema = dict[str, Any]


def brush_schema() -> Schema:
    """Schema of ``NAME.brush.toml``; its `parameters` depend on the model of the file."""
    schema = brush.Brush.model_json_schema()
    properties = schema["properties"]
    for name in ("name", "params"):  # the file's name, and what `parameters` becomes
        del properties[name]
    schema["required"] = ["schema", *(name for name in schema["required"] if name in properties)]
    properties["schema"] = {"const": brush.SCHEMA}
    properties["model"]["enum"] = list(behaviours())
    properties["parameters"] = {"type": "object", "description": "the parameters of the model"}
    schema["allOf"] = []
    for name, model in behaviours().items():
        parameters = model.Params.model_json_schema()
        schema["$defs"] |= parameters.pop("$defs", {})
        schema["$defs"][f"parameters of {name}"] = parameters | {"title": f"parameters of {name}"}
        then = {"properties": {"parameters": {"$ref": f"#/$defs/parameters of {name}"}}}
        schema["allOf"].append({"if": {"properties": {"model": {"const": name}}}, "then": then})
    return _titled(schema, "Flockbrush brush", f"a file NAME{brush.SUFFIX}")


def sweep_schema() -> Schema:
    """Schema of ``NAME.sweep.toml``."""
    schema = sweep_file.document_schema()
    values = {"type": ["object", "array", "string", "number", "boolean"]}
    schema["properties"] |= {
        "schema": {"const": sweep_file.SCHEMA},
        "grid": {
            "type": "object",
            "description": "all combinations of these values are run",
            "additionalProperties": values,
        },
        "fixed": {"type": "object", "description": "parameters that are the same in every run"},
        "case": {
            "type": "array",
            "description": "cases that are combined with the grid",
            "items": {"type": "object", "required": ["title"], "properties": {"title": {"type": "string"}}},
        },
    }
    schema["properties"]["experiment"]["enum"] = list(experiments())
    schema["required"] = ["schema", *schema["required"]]
    return _titled(schema, "Flockbrush sweep", f"a file NAME{sweep_file.SUFFIX}")


def _object(required=(), **properties) -> Schema:
    """Schema of a table with these properties."""
    return {"type": "object", "required": list(required), "properties": properties}


def level_schema() -> Schema:
    """Schema of ``NAME.tmj``: Tiled's JSON format with the classes and properties of Flockbrush."""
    classes = [c for c in CLASSES.values() if c.use == "object"]
    level = CLASSES["FlockbrushLevel"]
    group = {"required": ["name"], "properties": {"name": {"const": GROUP}}}
    tiles = {"type": "integer", "minimum": 1, "description": "tiles"}
    layers, kinds = _list_of("layer"), ["tilelayer", "objectgroup", "imagelayer", "group"]
    schema: Schema = _object(
        ["type", "layers", "width", "height", "tilewidth", "tileheight", "properties"],
        type={"const": "map"}, orientation={"const": "orthogonal"}, width=tiles, height=tiles,
        properties={"type": "array"}, layers=layers, tilesets={"type": "array", "items": {"type": "object"}},
    ) | {
        "if": {"properties": {"layers": {"contains": group}}},  # the map of a game has properties of its own
        "then": {"properties": {"properties": _properties(replace(level, open=True))}},
        "else": {"properties": {"properties": _properties(level)}},
        "$defs": {
            "layer": _object(
                ["name", "type"],
                name={"type": "string"}, type={"enum": kinds}, layers=layers, objects=_list_of("object"),
            ),
            "object": _object(
                ["id", "x", "y"],
                id={"type": "integer"}, name={"type": "string"},
                type={"type": "string", "description": "class: " + ", ".join(c.name for c in classes)},
                x={"type": "number", "description": "pixels from the left edge"},
                y={"type": "number", "description": "pixels from the top edge"},
            ) | {
                "allOf": [
                    {
                        "if": {"required": ["type"], "properties": {"type": {"const": c.name}}},
                        "then": {"properties": {"properties": {"$ref": f"#/$defs/properties of {c.name}"}}},
                    }
                    for c in classes
                ],
            },
            **{f"properties of {c.name}": _properties(c) for c in classes},
        },
    }  # fmt: skip
    return _titled(schema, "Flockbrush level", "a map of the Tiled editor, NAME.tmj")


SCHEMAS = {"brush": brush_schema, "level": level_schema, "sweep": sweep_schema}


def _list_of(what) -> Schema:
    return {"type": "array", "items": {"$ref": f"#/$defs/{what}"}}


def _titled(schema, title, description):
    schema = copy.deepcopy(schema)
    return {"$schema": DIALECT, "title": title, "description": description} | {
        name: value for name, value in schema.items() if name not in ("title", "description")
    }


def _properties(cls: ObjectClass) -> Schema:
    """Schema of the list of custom properties in Tiled: one item for each property of a class, or one for all."""
    names: Schema = {"type": "string"} if cls.open else {"enum": [p.name for p in cls.properties]}
    item = _object(["name", "value"], name=names, type={"type": "string"}) | {
        "allOf": [
            {"if": {"properties": {"name": {"const": p.name}}}, "then": {"properties": {"value": _value(p)}}}
            for p in cls.properties
        ]
    }
    of_class = {"required": ["propertytype"], "properties": {"propertytype": {"const": cls.name}}}
    members = {"type": "object", "properties": {p.name: _value(p) for p in cls.properties}}
    value = members if cls.open else members | {"additionalProperties": False}
    whole = _object(["name", "value"], name={"type": "string"}, type={"const": "class"}, value=value)
    given = [_contains(p.name, of_class) for p in cls.properties if p.required]
    either = {"if": of_class, "then": whole, "else": item}
    schema = {"type": "array", "description": cls.meaning, "items": either}
    return schema | ({"allOf": given} if given else {})


def _contains(name, of_class):
    """Schema of a list in which a property is given: by itself, or as a member of its class."""
    member = of_class | {"properties": of_class["properties"] | {"value": {"required": [name]}}}
    return {"contains": {"anyOf": [{"properties": {"name": {"const": name}}}, member]}}


_TYPES = {  # of the kinds that are no texts
    "number": "number",
    "int": "integer",
    "bool": "boolean",
    "heading": ["string", "number"],
    "goal": ["string", "integer"],
}


def _value(p: Property) -> Schema:
    bounds = {"minimum": p.low, "maximum": p.high, "exclusiveMinimum": p.above}
    schema = {
        "type": _TYPES.get(p.kind, "string"),
        "description": p.meaning + (f" ({p.unit})" if p.unit else ""),
        "default": p.default,
        **{name: bound for name, bound in bounds.items() if bound is not None},
    }
    if p.values:
        schema["enum"] = list(p.values)
    return schema

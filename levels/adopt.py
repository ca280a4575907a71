"""Making a level of a map that was drawn for something else: ours is added, theirs stays as it is."""

from __future__ import annotations

import copy
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
from flockbrush.engine.files import refused
from flockbrush.engine.problems import ProblemsError
from flockbrush.levels.carried_files import from_folder
from flockbrush.levels.checked_nodes import parsed_document
from flockbrush.levels.document_nodes import file_references
from flockbrush.levels.ground_rules import suggest_rules
from flockbrush.levels.json_lines import JsonError
from flockbrush.levels.level_files import DiskFiles, FileRefused, project_folder
from flockbrush.levels.level_writer import dump, write_level
from flockbrush.levels.properties import FilePlace, Refused, Report, Values, convert, read_properties
from flockbrush.levels.reader import LevelReader, read_level_text
from flockbrush.levels.schema import CLASSES, GROUP, LAYER_NAMES, SCHEMA

_TILE_LAYERS = {"terrain": 1, "brush": 0.4, "speed": 0.5}  # opacity
_OBJECT_LAYERS = tuple(name for name in LAYER_NAMES if name not in (*_TILE_LAYERS, "height"))
_ADDED = ("metres_per_tile", "ground_rules")  # properties, whatever the map has
_HERD = 30  # animals of the first spawn, at most
_ROOM = 3.0  # m^2 for each
_TILESETS = ("terrain", "brushes", "speed")


class Adoption:
    """A map as a level.

    Attributes
    ----------
    document : dict
    path : Path
        Where it will be written.
    rules : list of str
        What tiles mean, as their names suggest.
    level : Level
        As it will be read.
    """

    def __init__(self, source, path, document, rules, level):
        self.source, self.path, self.document, self.rules, self.level = source, path, document, rules, level

    def write(self):
        """Write the level; what has its name already is kept, and refused."""
        if self.path.exists():
            raise refused(self.path, "already exists; give another file with -o")
        return write_level(self.document, self.path, backup=False)


def adopt(source, output=None, metres_per_tile=1.0) -> Adoption:
    """What a map would be as a level: its layers, tilesets and properties, and a group of our layers above them.

    Parameters
    ----------
    source : path
        A ``.tmx``, ``.tmj`` or ``.json`` file of Tiled; it is only read.
    output : path, optional
        Of the level, ``.tmj``; beside the map, with its name, by default.
    metres_per_tile : float

    Raises
    ------
    ProblemsError
        When it is no map, one that cannot be a level (isometric, hexagonal, infinite), or a level already.
    """
    source = Path(source)
    output = _output_of(source, output)
    source_map, reader = _read(source)
    _refuse_others(source, source_map)
    document = copy.deepcopy(source_map)
    if output.parent.resolve() != source.parent.resolve():
        _move(document, source.parent.resolve(), output.parent.resolve())
    tilesets = [tileset.node for tileset in reader.tiles.tilesets]
    rules = suggest_rules(
        tilesets, [n.get("name", "") for n in _nodes(document["layers"]) if n.get("type") == "tilelayer"]
    )
    for entry, tileset in zip(document["tilesets"], _in_order(document["tilesets"], reader), strict=True):
        if "source" not in entry:  # how many tiles it has, where an old map leaves it out
            entry.update({key: tileset.node[key] for key in _COUNTED if key in tileset.node and key not in entry})
    _add_properties(document, metres_per_tile, rules)
    _add_tilesets(document, output, reader)
    _add_layers(document)
    try:
        level = _with_herd(document, output)
    except ProblemsError as error:  # of a file that is not there yet, with lines of its own
        of_map = [replace(one, file=str(source), line=None) for one in error.problems if one.file == str(output)]
        raise ProblemsError([*of_map, *(one for one in error.problems if one.file != str(output))]) from None
    return Adoption(source, output, document, rules, level)


_COUNTED = ("columns", "tilecount", "imagewidth", "imageheight")


def _in_order(entries, reader):
    by_first = {tileset.firstgid: tileset for tileset in reader.tiles.tilesets}
    return [by_first[entry["firstgid"]] for entry in entries]


def _output_of(source, output):
    if output is None:
        output = source.with_suffix(".tmj")
        if output.exists() or source.suffix.lower() == ".tmj":
            output = source.with_name(f"{source.stem}-level.tmj")
    output = Path(output)
    if output.suffix.lower() != ".tmj":
        raise refused(output, "the name of a level must end in .tmj")
    if output.exists():
        raise refused(output, "already exists; give another file with -o")
    if not output.parent.is_dir():
        raise refused(output, f"there is no folder {str(output.parent)!r}")
    return output


def _read(source):
    """(document, a reader that has read its tilesets); ProblemsError."""
    report, files = Report(), DiskFiles(source)
    reader = LevelReader(files, report, None)
    document = reader.document()
    if document is None:
        raise ProblemsError(report.problems)
    reader.check_map(document, Values(CLASSES["FlockbrushLevel"]), FilePlace(report, str(source), document.line))
    if not isinstance(document.get("layers"), list) or not isinstance(document.get("tilesets", []), list):
        reader.place.say("'layers' and 'tilesets' must be lists", document.line)
    if document.get("infinite"):
        reader.place.say("an infinite map has no size; in Tiled: Map > Map Properties > Infinite off", document.line)
    if not report.problems and reader.layers.frame(document, [], 1.0, reader.place.at(document, "map")) is not None:
        reader.tiles.read(copy.deepcopy(document))
    if report.problems:
        raise ProblemsError(report.problems)
    document.setdefault("tilesets", [])
    return document, reader


def _refuse_others(source, document):
    """A level, and a map with properties of its own that are called as ours and mean something else; ProblemsError."""
    report, cls = Report(), CLASSES["FlockbrushLevel"]
    place = FilePlace(report, str(source), document.line, "map")
    given = read_properties(document, replace(cls, properties=(), open=True), place)
    if "schema" in given.others or any(node.get("name") == GROUP for node in _nodes(document["layers"])):
        raise refused(
            source, f"is already a level, or has layers named '{GROUP}'; check it with flockbrush level check"
        )
    for p in cls.properties:
        if p.name in given.others:
            try:
                if p.name in _ADDED:
                    raise Refused("is added to the map")
                convert(p, given.others[p.name])
            except Refused as error:
                message = f"rename property {p.name!r} of the map, which is one of ours: {p.name} {error}"
                place.say(message, given.lines[p.name])
    if report.problems:
        raise ProblemsError(report.problems)


def _nodes(nodes):
    for node in nodes if isinstance(nodes, list) else []:
        if isinstance(node, dict):
            yield node
            yield from _nodes(node.get("layers", []))


def _move(document, before, after):
    """Let the files that a map names be found from another folder."""

    for node, key in file_references(document):
        node[key] = from_folder(node[key], before, after)


# ---------------------------------------------------------------- what is added


def _add_properties(document, metres_per_tile, rules):
    ours = [
        {"name": "metres_per_tile", "type": "float", "value": metres_per_tile},
        {"name": "schema", "type": "string", "value": SCHEMA},
    ]
    if rules:
        ours.append({"name": "ground_rules", "type": "string", "value": "\n".join(rules)})
    document["properties"] = sorted([*document.get("properties", []), *ours], key=lambda entry: entry["name"])


def _add_tilesets(document, output, reader):
    """Name our tilesets where the project has them, behind all tiles of the map."""
    free = max((tileset.firstgid + tileset.count for tileset in reader.tiles.tilesets), default=1)
    folder = project_folder(output)
    for name in _TILESETS:
        file = folder / "tilesets" / f"{name}.tsj"
        if not (folder / "flockbrush.tiled-project").is_file() or not file.is_file():
            continue
        source = os.path.relpath(file, output.parent.resolve()).replace("\\", "/")
        try:
            count = parsed_document(DiskFiles(output).read(source))["tilecount"]
        except (FileRefused, JsonError, KeyError, TypeError):
            continue
        document["tilesets"].append({"firstgid": free, "source": source})
        free += count


def _add_layers(document):
    number = max([node.get("id", 0) for node in _nodes(document["layers"])], default=0)
    number = max(number + 1, document.get("nextlayerid", 1))
    group = {"id": number, "layers": [], "name": GROUP, "opacity": 1, "type": "group", "visible": True, "x": 0, "y": 0}
    size = document["width"], document["height"]
    for name in (*_TILE_LAYERS, *_OBJECT_LAYERS):
        number += 1
        layer = {"id": number, "name": name, "visible": True, "x": 0, "y": 0, "opacity": _TILE_LAYERS.get(name, 1)}
        if name in _TILE_LAYERS:
            layer |= {"type": "tilelayer", "width": size[0], "height": size[1], "data": [0] * (size[0] * size[1])}
        else:
            layer |= {"type": "objectgroup", "draworder": "topdown", "objects": []}
            colour = next((c.colour for c in CLASSES.values() if c.home == name), None)
            layer |= {"color": colour} if colour else {}
        group["layers"].append(layer)
    document["layers"] = [*document["layers"], group]
    document["nextlayerid"] = number + 1


def _with_herd(document, output):
    """The level with a first herd where there is most room; ProblemsError when there is none."""
    spawns = next(layer for layer in document["layers"][-1]["layers"] if layer["name"] == "spawns")
    objects = [thing for node in _nodes(document["layers"]) for thing in node.get("objects", [])]
    number = max([thing.get("id", 0) for thing in objects] + [document.get("nextobjectid", 1) - 1]) + 1
    tile, metres = document["tilewidth"], _metres(document)
    everywhere = {"x": 0, "y": 0, "width": tile * document["width"], "height": tile * document["height"]}
    spawns["objects"] = [_herd(number, 1, everywhere)]
    document["nextobjectid"] = number + 1
    level = read_level_text(dump(document).encode(), output)  # whether it can be read at all, and its ground
    x, y, side = _most_room(level)
    scale = tile / metres
    area = {"x": (x - side / 2) * scale, "y": (level.height - y - side / 2) * scale, "width": side * scale}
    count = int(np.clip(side * side / _ROOM, 1, _HERD))
    spawns["objects"] = [_herd(number, count, {**area, "height": side * scale})]
    return read_level_text(dump(document).encode(), output)


def _metres(document):
    return next(entry["value"] for entry in document["properties"] if entry["name"] == "metres_per_tile")


def _herd(number, count, area):
    values = (("brush", "string", "march"), ("count", "int", count), ("species", "string", "sheep"))
    properties = [{"name": name, "type": kind, "value": value} for name, kind, value in values]
    herd = {"id": number, "name": "herd", "type": "Spawn", "rotation": 0, "visible": True, "properties": properties}
    return herd | {key: round(value, 3) for key, value in area.items()}


def _most_room(level):
    """(x, y, side) m of the largest square of walkable ground, no larger than a herd needs."""
    import cv2

    walkable = np.ones(level.shape, bool) if level.terrain is None else level.terrain.walkable
    deep = cv2.distanceTransform(np.pad(walkable, 1).astype(np.uint8), cv2.DIST_C, 3)[1:-1, 1:-1]
    iy, ix = np.unravel_index(np.argmax(deep), deep.shape)
    side = min(2 * float(deep[iy, ix]) - 1, np.sqrt(_HERD * _ROOM) / level.cell)
    return (ix + 0.5) * level.cell, (iy + 0.5) * level.cell, max(side, 0.5) * level.cell

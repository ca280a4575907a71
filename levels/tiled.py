"""The Tiled project: classes and enums from the schema, tilesets drawn by hand of numpy, F5 and F6.

`write_project` makes a folder that a designer opens in Tiled; `init` adds a first level to it.
``python -m flockbrush.levels.tiled`` renews the project around the shipped levels.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
from flockbrush.behaviours.program import ProgramLibrary, shipped_programs
from flockbrush.engine.files import make_backup, refuse_foreign, refused, write_bytes
from flockbrush.engine.problems import Problem, ProblemsError
from flockbrush.levels.ground_rules import class_of
from flockbrush.levels.level_class import ENUMS, ObjectClass, Property
from flockbrush.levels.schema import CLASSES, PROJECT_FILE
from flockbrush.levels.sketch import LevelSketch
from flockbrush.levels.terrain_kinds import TERRAINS
from flockbrush.levels.tile_pictures import (
    BRUSHES_FILE,
    as_sheet,
    brush_picture,
    is_painted_over,
    known_brushes,
    png,
    speed_picture,
    terrain_picture,
)
from flockbrush.levels.tilesets_data import COLUMNS, SPEEDS, TILE

SESSION_FILE = PROJECT_FILE.replace("project", "session")
OBJECT_TYPES_FILE = "objecttypes.json"
TILESETS = {"terrain": "Terrain", "speed": "SpeedCap", "brushes": "Brush"}  # the class of their tiles
_GENERATED = (
    PROJECT_FILE, SESSION_FILE, OBJECT_TYPES_FILE,
    *(f"tilesets/{name}.{kind}" for name in TILESETS for kind in ("tsj", "png")),
)  # fmt: skip
_SIZES = "columns", "image", "imageheight", "imagewidth", "tilecount"
_USE = {"map": ["map"], "tile": ["tile"], "layer": ["layer"], "object": ["object"]}
_TYPES = {"number": "float", "int": "int", "bool": "bool", "colour": "color"}


def init(folder, library) -> list[Path]:
    """Begin a project for levels in a folder: the Tiled project, the tilesets and a first level.

    Parameters
    ----------
    folder : path-like
        Made when it is not there.
    library : BrushLibrary
        Its brushes become tiles and drop-down entries.

    Returns
    -------
    list of Path
        The files written.  Levels that are there already are left alone; the rest is brought up to date (see
        `write_project`), as after adding a brush.

    Raises
    ------
    ProblemsError
        When the folder cannot be written, or has files of the same names that are not from here.
    """
    folder = Path(folder)
    try:
        written = write_project(folder, library)
        first = folder / "first.tmj"
        if not any(folder.glob("*.tmj")):
            written.append(_first_level(first))
    except ProblemsError:  # it names the file
        raise
    except OSError as error:
        raise ProblemsError(
            [Problem(str(folder), None, None, f"cannot be written: {error.strerror or error}")]
        ) from None
    return written


def _first_level(path):
    """A herd on its way round a rock to a goal, an exit there, and others that come after: it never stops."""
    names = known_brushes(path.parent / BRUSHES_FILE)
    sketch = LevelSketch(40, 30, 1.0, "tilesets")
    sketch.ground("grass")
    sketch.ground("meadow", (np.sin(sketch.x / 4) + np.cos(sketch.y / 3)) > 0.6)
    sketch.ground("dirt", np.abs(sketch.y - 5) < 1.5)
    sketch.box("Obstacle", 20, 15, 9, 7, "rock", round_=True)
    way = [(3, 6), (20, 5), (32, 9), (35, 18), (35, 25)]
    sketch.draw("Guide", way, "way to the gate", closed=False, radius=4, goal="gate")
    sketch.draw("Goal", [(34, 27)], "gate", radius=5, on_arrive="despawn")
    sketch.box("Exit", 34, 27.5, 12, 5, "gate")
    brush = "march" if "march" in names else names[0]
    shared = {"species": "sheep", "brush": brush, "heading": "east"}
    sketch.box("Spawn", 8, 8, 12, 10, "herd", count=60, **shared)
    sketch.box("Spawn", 3, 8, 4, 8, "latecomers", rate=5, start=8, **shared)
    _notes(sketch)
    return sketch.save(path)


def _notes(sketch):
    """Write beside the things of a level, in Tiled, which of their fields have which units."""
    for k, cls in enumerate(("Spawn", "Goal", "Guide", "Obstacle", "Zone")):
        fields = [f"{p.name} ({p.unit})" if p.unit else p.name for p in CLASSES[cls].properties]
        sketch.note(sketch.width + 1, sketch.height - 6 * k, f"{cls}: {', '.join(fields)}")


def write_project(folder, library) -> list[Path]:
    """Write project, session, object types and tilesets, or bring up to date those that are there.

    What a designer has set in them stays: other types and commands, tiles that are there, with their values.  Pictures
    are drawn anew, and one that somebody has painted over is kept as ``NAME.png.bak``.
    """
    return _renew(Path(folder), library, _GENERATED)


def renew_brushes(folder, library) -> bool:
    """Bring new brushes into the Tiled project of a folder: their tiles, and their names in its lists.

    As `write_project`, of the files with brushes alone.  Returns whether there is a project.
    """
    folder = Path(folder)
    if not (folder / PROJECT_FILE).exists():
        return False
    _renew(folder, library, (PROJECT_FILE, BRUSHES_FILE, str(Path(BRUSHES_FILE).with_suffix(".png"))))
    return True


def _renew(folder, library, names):
    """Write the generated files of these names; ProblemsError, and nothing is written, where one is not ours."""
    refuse_foreign([folder / name for name in names], is_generated)
    own = ProgramLibrary([folder / "programs", *shipped_programs().folders])
    files = project_files(library, known_brushes(folder / BRUSHES_FILE), own.names())
    contents = {folder / name: _with_own(folder / name, files[name]) for name in names}
    (folder / "tilesets").mkdir(parents=True, exist_ok=True)
    for path, content in contents.items():
        if path.suffix == ".png" and path.exists() and is_painted_over(path.read_bytes(), content):
            make_backup(path)
        write_bytes(path, content)
    return list(contents)


def _with_own(path, content):
    """The bytes of a generated file, with what a designer has set in the one that is there; ProblemsError."""
    if path.suffix == ".png" or not path.exists():
        return content
    try:
        return _json(renewed(json.loads(path.read_bytes()), json.loads(content)))
    except (LookupError, TypeError):
        raise refused(path, "is damaged; delete it, and flockbrush level init creates it again") from None


def tile_order(library, known=()) -> list[str]:
    """The brushes in the order of their tiles: a tile once given stays, for levels are painted with it."""
    return [*known, *(name for name in library.names() if name not in known)]


def project_files(library, known=(), programs=None) -> dict[str, bytes]:
    """Name and content of every generated file; `known` are the brushes that have their tile already."""
    programs = shipped_programs().names() if programs is None else programs
    names = tile_order(library, known)
    brushes = [(name, library.get(name).colour if name in library.names() else "#808080") for name in names]
    files = {
        PROJECT_FILE: _json(project(library.names(), programs)),
        SESSION_FILE: _json(session()),
        OBJECT_TYPES_FILE: _json(object_types()),
    }
    for name, tiles, pictures in (
        ("terrain", TERRAINS, [terrain_picture(t) for t in TERRAINS]),
        ("speed", SPEEDS, [speed_picture(t) for t in SPEEDS]),
        ("brushes", [{"asset": n} for n, _ in brushes], [brush_picture(n, c) for n, c in brushes]),
    ):
        sheet = as_sheet(pictures)
        tiles = [(TILESETS[name], values) for values in tiles]
        files[f"tilesets/{name}.tsj"] = _json(tileset(name, tiles, sheet.shape))
        files[f"tilesets/{name}.png"] = png(sheet)
    return files


def _json(content):
    return (json.dumps(content, indent=4, sort_keys=True) + "\n").encode()


# ---------------------------------------------------------------- project


def project(brushes, programs=()) -> dict:
    """The ``.tiled-project``: what 1.9 and later take classes from, and 1.8 the enums and commands."""
    enums = {**ENUMS, "BrushAsset": ("", *brushes), "ProgramAsset": ("", *programs)}
    types = [
        {"id": i, "name": name, "storageType": "string", "type": "enum", "values": list(values), "valuesAsFlags": False}
        for i, (name, values) in enumerate(enums.items(), 1)
    ]
    for cls in CLASSES.values():
        types.append(
            {
                "color": _argb(cls.colour),
                "id": len(types) + 1,
                "members": [project_member(p, "propertyType") for p in _sorted(cls)],
                "name": cls.name,
                "type": "class",
                "useAs": _USE[cls.use],
            }
        )
    return {
        "automappingRulesFile": "",
        "commands": [
            _command("Play level", "F5", "play %mapfile"),  # Tiled puts the quotes around names of files itself
            _command("Check level", "F6", "level check --window %mapfile"),
        ],
        "compatibilityVersion": 1100,
        "extensionsPath": "extensions",
        "folders": ["."],
        "objectTypesFile": OBJECT_TYPES_FILE,
        "propertyTypes": types,
    }


def object_types() -> list[dict]:
    """The object types that Tiled 1.8 reads; later versions find the same classes in the project."""
    return [
        {
            "color": _argb(c.colour),
            "name": c.name,
            "properties": [project_member(p, "propertytype") for p in _sorted(c)],
        }
        for c in CLASSES.values()
        if c.use in ("object", "tile")
    ]


def session() -> dict:
    """The ``.tiled-session`` through which Tiled 1.8 finds the project."""
    return {
        "activeFile": "",
        "expandedProjectPaths": ["."],
        "openFiles": [],
        "project": PROJECT_FILE,
        "recentFiles": [],
    }


def _sorted(cls: ObjectClass):
    return sorted(cls.properties, key=lambda p: p.name)


def project_member(p: Property, enum_key) -> dict:
    member = {"name": p.name, "type": _TYPES.get(p.kind, "string"), "value": p.default}
    if p.kind == "colour":
        member["value"] = _argb(p.default)
    if p.kind in ("enum", "brush", "program"):
        member[enum_key] = p.enum or f"{p.kind.capitalize()}Asset"
    return member


def _command(name, shortcut, arguments):
    return {
        "arguments": arguments,
        "command": "flockbrush",
        "enabled": True,
        "name": name,
        "saveBeforeExecute": True,
        "shortcut": shortcut,
        "showOutput": True,
        "workingDirectory": "%mappath",
    }


def _argb(colour):
    return "#ff" + colour[1:]


# ---------------------------------------------------------------- tilesets


def tileset(name, tiles, shape) -> dict:
    """A ``.tsj``: one tile per (class, values), with only the values that differ from the defaults."""
    return {
        "columns": COLUMNS,
        "image": f"{name}.png",
        "imageheight": shape[0],
        "imagewidth": shape[1],
        "margin": 0,
        "name": name,
        "spacing": 0,
        "tilecount": shape[0] // TILE * COLUMNS,
        "tiledversion": "1.8.2",
        "tileheight": TILE,
        "tiles": [class_tile(i, cls, values) for i, (cls, values) in enumerate(tiles)],
        "tilewidth": TILE,
        "type": "tileset",
        "version": "1.8",
    }


def class_tile(number, cls, values):
    known = {p.name: p for p in CLASSES[cls].properties}
    properties = [
        {**project_member(known[k], "propertytype"), "value": _argb(v) if known[k].kind == "colour" else v}
        for k, v in sorted(values.items())
        if v != known[k].default
    ]
    return {"id": number, "properties": properties, "type": cls}


# ---------------------------------------------------------------- what is there already


def is_generated(path) -> bool:
    """Whether a file is recognisably one of `project_files`, whatever a designer has changed in it since.

    A picture is one beside such a tileset, or without a tileset in such a project.
    """
    if path.suffix == ".png":
        beside = path.with_suffix(".tsj")
        return is_generated(beside if beside.exists() else path.parent.parent / PROJECT_FILE)
    try:
        content = json.loads(path.read_bytes())
        if path.name == PROJECT_FILE:
            return any(known["name"] == "BrushAsset" for known in content["propertyTypes"])
        if path.name == SESSION_FILE:
            return content["project"] == PROJECT_FILE
        if path.name == OBJECT_TYPES_FILE:
            return set(TILESETS.values()) <= {known["name"] for known in content}
        own = {p.name for p in CLASSES[TILESETS[path.stem]].properties}
        tiles = [tile for tile in content["tiles"] if class_of(tile) == TILESETS[path.stem]]
        return content["image"] == f"{path.stem}.png" and any(
            named["name"] in own for tile in tiles for named in tile.get("properties", ())
        )
    except (OSError, ValueError, LookupError, TypeError, AttributeError):
        return False


def renewed(there, new):
    """A generated document, with what a designer has set in the one that is there."""
    if isinstance(new, list):  # object types
        return _by(there, new, "name")
    if "propertyTypes" in new:
        types = _by(there["propertyTypes"], new["propertyTypes"], "name")
        types = [{**known, "id": number} for number, known in enumerate(types, 1)]
        commands = _by(new["commands"], there.get("commands", []), "name")
        return {**new, **there, "commands": commands, "propertyTypes": types}
    if "tiles" in new:
        tiles = sorted(_by(new["tiles"], there["tiles"], "id"), key=lambda tile: tile["id"])
        return {**new, **there, **{size: new[size] for size in _SIZES}, "tiles": tiles}
    return {**new, **there}


def _by(before, after, key):
    """The entries of `after`, then those of `before` that have another name or number."""
    return [*after, *(entry for entry in before if entry[key] not in {one[key] for one in after})]


if __name__ == "__main__":  # the project that comes with Flockbrush
    from flockbrush.behaviours.brush import shipped

    home = Path(__file__).parent
    for name, content in project_files(shipped(), known_brushes(home / BRUSHES_FILE)).items():
        write_bytes(home / name, content)

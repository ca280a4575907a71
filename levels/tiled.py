"""The Tiled project: classes and enums from the schema, tilesets drawn by hand of numpy, F5 and F6.

`write_project` makes a folder that a designer opens in Tiled; `init` adds a first level to it.
``python -m flockbrush.levels.tiled`` renews the project around the shipped levels.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
from flockbrush.behaviours.program import ProgramLibrary, shipped_programs
from flockbrush.engine.files import write_bytes
from flockbrush.engine.problems import Problem, ProblemsError
from flockbrush.levels.level_class import ENUMS, ObjectClass, Property
from flockbrush.levels.schema import CLASSES, PROJECT_FILE
from flockbrush.levels.sketch import LevelSketch
from flockbrush.levels.terrain_kinds import TERRAINS
from flockbrush.levels.tile_pictures import (
    BRUSHES_FILE,
    as_sheet,
    brush_picture,
    known_brushes,
    png,
    speed_picture,
    terrain_picture,
)
from flockbrush.levels.tilesets_data import COLUMNS, SPEEDS, TILE

SESSION_FILE = PROJECT_FILE.replace("project", "session")
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
        The files written.  A level that is there already is left alone; the rest is generated anew, so that running
        it again after adding a brush brings the project up to date.

    Raises
    ------
    ProblemsError
        When the folder cannot be written.
    """
    folder = Path(folder)
    try:
        written = write_project(folder, library)
        first = folder / "first.tmj"
        if not any(folder.glob("*.tmj")):
            written.append(_first_level(first, library))
    except ProblemsError:  # it names the file
        raise
    except OSError as error:
        raise ProblemsError(
            [Problem(str(folder), None, None, f"cannot be written: {error.strerror or error}")]
        ) from None
    return written


def _first_level(path, library):
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
    """Write project, session, object types and tilesets; the same bytes every time."""
    folder = Path(folder)
    (folder / "tilesets").mkdir(parents=True, exist_ok=True)
    written = []
    own = ProgramLibrary([folder / "programs", *shipped_programs().folders])
    for name, content in project_files(library, known_brushes(folder / BRUSHES_FILE), own.names()).items():
        written.append(write_bytes(folder / name, content))
    return written


def renew_brushes(folder, library) -> bool:
    """Bring new brushes into the Tiled project of a folder: their tiles, and their names in its lists.

    Whatever else a designer has set in the project stays.  Returns whether there is a project.
    """
    folder = Path(folder)
    file = folder / PROJECT_FILE
    if not file.exists():
        return False
    try:
        project = json.loads(file.read_bytes())
        types = [t for t in project["propertyTypes"] if t["name"] == "BrushAsset"]
        for known in types:
            known["values"] = ["", *library.names()]
    except (ValueError, LookupError, TypeError):
        raise ProblemsError(
            [Problem(str(file), None, None, "is damaged: flockbrush level init creates it again")]
        ) from None
    files = project_files(library, known_brushes(folder / BRUSHES_FILE))
    tiles = {name: data for name, data in files.items() if Path(name).stem == Path(BRUSHES_FILE).stem}
    for name, data in {PROJECT_FILE: _json(project), **tiles}.items():
        (folder / name).parent.mkdir(exist_ok=True)
        write_bytes(folder / name, data)
    return True


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
        "objecttypes.json": _json(object_types()),
    }
    for name, tiles, pictures in (
        ("terrain", [("Terrain", t) for t in TERRAINS], [terrain_picture(t) for t in TERRAINS]),
        ("speed", [("SpeedCap", t) for t in SPEEDS], [speed_picture(t) for t in SPEEDS]),
        ("brushes", [("Brush", {"asset": n}) for n, _ in brushes], [brush_picture(n, c) for n, c in brushes]),
    ):
        sheet = as_sheet(pictures)
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
        "objectTypesFile": "objecttypes.json",
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


if __name__ == "__main__":  # the project that comes with Flockbrush
    from flockbrush.behaviours.brush import shipped

    write_project(Path(__file__).parent, shipped())

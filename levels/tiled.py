"""The Tiled project: classes and enums from the schema, tilesets drawn by hand of numpy, F5 and F6.

`write_project` makes a folder that a designer opens in Tiled; `init` adds a first level to it.
"""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path

import numpy as np
from flockbrush.behaviours.program import ProgramLibrary, shipped_programs
from flockbrush.engine.files import write_bytes
from flockbrush.engine.problems import Problem, ProblemsError
from flockbrush.levels.level_class import ENUMS, ObjectClass, Property
from flockbrush.levels.schema import CLASSES, PROJECT_FILE
from flockbrush.levels.sketch import LevelSketch
from flockbrush.levels.terrain_kinds import TERRAINS
from flockbrush.levels.tilesets_data import COLUMNS, SPEEDS, TILE

SESSION_FILE = PROJECT_FILE.replace("project", "session")
BRUSHES_FILE = "tilesets/brushes.tsj"
_FINE = 4  # pictures are drawn this much larger, then shrunk
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
    sketch = LevelSketch(40, 30, 1.0, "tilesets", names)
    sketch.ground("grass")
    sketch.ground("meadow", (np.sin(sketch.x / 4) + np.cos(sketch.y / 3)) > 0.6)
    sketch.ground("dirt", np.abs(sketch.y - 5) < 1.5)
    sketch.box("Obstacle", 20, 15, 9, 7, "rock", round_=True)
    way = [(3, 6), (20, 5), (32, 9), (35, 18), (35, 25)]
    sketch.draw("Guide", way, "way to the gate", closed=False, radius=4, goal="gate")
    sketch.draw("Goal", [(34, 27)], "gate", radius=5, on_arrive="despawn")
    sketch.box("Exit", 34, 27.5, 12, 5, "gate")
    brush = "march" if "march" in names else names[0]
    told = {"species": "sheep", "brush": brush, "heading": "east"}
    sketch.box("Spawn", 8, 8, 12, 10, "herd", count=60, **told)
    sketch.box("Spawn", 3, 8, 4, 8, "latecomers", rate=5, start=8, **told)
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
        kept = json.loads(file.read_bytes())
        types = [t for t in kept["propertyTypes"] if t["name"] == "BrushAsset"]
        for known in types:
            known["values"] = ["", *library.names()]
    except (ValueError, LookupError, TypeError):
        raise ProblemsError([Problem(str(file), None, None, "is damaged: level init makes it anew")]) from None
    made = project_files(library, known_brushes(folder / BRUSHES_FILE))
    tiles = {name: data for name, data in made.items() if Path(name).stem == Path(BRUSHES_FILE).stem}
    for name, data in {PROJECT_FILE: _json(kept), **tiles}.items():
        (folder / name).parent.mkdir(exist_ok=True)
        write_bytes(folder / name, data)
    return True


def tile_order(library, known=()) -> list[str]:
    """The brushes in the order of their tiles: a tile once given stays, for levels are painted with it."""
    return [*known, *(name for name in library.names() if name not in known)]


def known_brushes(tileset_file) -> list[str]:
    """The brushes of a ``brushes.tsj``, by tile; none if there is no such file."""
    try:
        tiles = json.loads(Path(tileset_file).read_bytes())["tiles"]
        return [tile["properties"][0]["value"] for tile in sorted(tiles, key=lambda tile: tile["id"])]
    except FileNotFoundError:
        return []
    except (ValueError, LookupError, TypeError):
        problem = Problem(str(tileset_file), None, None, "is damaged; delete it, and it is made again")
        raise ProblemsError([problem]) from None


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
        sheet = _sheet(pictures)
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
                "members": [_member(p, "propertyType") for p in _sorted(cls)],
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
        {"color": _argb(c.colour), "name": c.name, "properties": [_member(p, "propertytype") for p in _sorted(c)]}
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


def _member(p: Property, enum_key) -> dict:
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
        "tiles": [_tile(i, cls, values) for i, (cls, values) in enumerate(tiles)],
        "tilewidth": TILE,
        "type": "tileset",
        "version": "1.8",
    }


def _tile(number, cls, values):
    known = {p.name: p for p in CLASSES[cls].properties}
    told = [
        {**_member(known[k], "propertytype"), "value": _argb(v) if known[k].kind == "colour" else v}
        for k, v in sorted(values.items())
        if v != known[k].default
    ]
    return {"id": number, "properties": told, "type": cls}


# ---------------------------------------------------------------- pictures


def png(picture) -> bytes:
    """A picture as a PNG file."""
    import cv2

    return cv2.imencode(".png", picture)[1].tobytes()


def _sheet(pictures):
    """All pictures side by side, eight in a row, with transparent room at the end."""
    rows = -(-len(pictures) // COLUMNS)
    sheet = np.zeros((rows * TILE, COLUMNS * TILE, 4), np.uint8)
    for i, picture in enumerate(pictures):
        y, x = divmod(i, COLUMNS)
        sheet[y * TILE : (y + 1) * TILE, x * TILE : (x + 1) * TILE] = picture
    return sheet


def tile_sheet(meanings, side, library) -> bytes:
    """The picture of tiles painted in the playground, as a PNG file.

    Parameters
    ----------
    meanings : sequence
        Each ("brush", name), ("cap", (max_speed, factor)), ("surface", name), or None for an empty place.
    side : int
        Of a tile, px.
    library : BrushLibrary
        For the colours of the brushes.
    """
    import cv2

    sheet = _sheet([_picture_of(meaning, library) for meaning in meanings])
    rows = len(sheet) // TILE
    return png(cv2.resize(sheet, (COLUMNS * side, rows * side), interpolation=cv2.INTER_AREA))


def _picture_of(meaning, library):
    kind, what = meaning or ("", "")
    if kind == "brush":
        return brush_picture(what, library.get(what).colour if what in library.names() else "#808080")
    if kind == "cap":
        return speed_picture(dict(zip(SPEEDS[0], what, strict=True)))
    ground = next((t for t in TERRAINS if t["name"] == what), None)
    return np.zeros((TILE, TILE, 4), np.uint8) if ground is None else terrain_picture(ground)


def _bgr(colour, brighter=0):
    return tuple(int(np.clip(int(colour[i : i + 2], 16) + brighter, 0, 255)) for i in (5, 3, 1))


def _canvas(colour, alpha=255):
    size = TILE * _FINE
    canvas = np.zeros((size, size, 4), np.uint8)
    canvas[:] = (*_bgr(colour), alpha)
    return canvas


def _shrunk(canvas):
    import cv2

    return cv2.resize(canvas, (TILE, TILE), interpolation=cv2.INTER_AREA)


def terrain_picture(kind) -> np.ndarray:
    """One tile of ground, (32, 32, 4) uint8: its colour, with marks that tell the kinds apart without it."""
    import cv2

    canvas = _canvas(kind["colour"])
    places = _scatter(kind["name"])
    for k, (x, y) in enumerate(places):
        ink = (*_bgr(kind["colour"], 16 if k % 2 else -18), 255)
        _MARKS.get(kind["name"], _tuft)(cv2, canvas, int(x), int(y), ink)
    return _shrunk(canvas)


def _scatter(name, n=9):
    """Places on a jittered 3 x 3 grid, the same for a name every time; px of the fine canvas."""
    state = np.random.default_rng([ord(c) for c in name])
    size = TILE * _FINE
    grid = (np.stack(np.meshgrid(np.arange(3), np.arange(3)), -1).reshape(-1, 2) + 0.5) * size / 3
    return (grid + state.uniform(-0.22, 0.22, grid.shape) * size / 3)[:n]


def _tuft(cv2, canvas, x, y, ink):
    for dx in (-8, 0, 8):
        cv2.line(canvas, (x, y + 6), (x + dx, y - 8), ink, 3, cv2.LINE_AA)


def _flower(cv2, canvas, x, y, ink):
    _tuft(cv2, canvas, x, y + 4, ink)
    if (x // 3 + y // 5) % 2:
        cv2.circle(canvas, (x, y - 8), 5, (190, 225, 250, 255), -1, cv2.LINE_AA)


def _speck(cv2, canvas, x, y, ink):
    cv2.circle(canvas, (x, y), 4, ink, -1, cv2.LINE_AA)


def _stone(cv2, canvas, x, y, ink):
    cv2.ellipse(canvas, (x, y), (11, 8), 20, 0, 360, ink, -1, cv2.LINE_AA)


def _crag(cv2, canvas, x, y, ink):
    cv2.fillPoly(canvas, [np.array([(x - 16, y + 12), (x - 2, y - 14), (x + 16, y + 12)], np.int32)], ink, cv2.LINE_AA)


def _wave(cv2, canvas, x, y, ink):
    cv2.ellipse(canvas, (x - 8, y), (8, 5), 0, 180, 360, ink, 3, cv2.LINE_AA)
    cv2.ellipse(canvas, (x + 8, y), (8, 5), 0, 0, 180, ink, 3, cv2.LINE_AA)


def _bush(cv2, canvas, x, y, ink):
    for dx, dy in ((-8, 4), (8, 4), (0, -6)):
        cv2.circle(canvas, (x + dx, y + dy), 11, ink, -1, cv2.LINE_AA)


def _track(cv2, canvas, x, y, ink):
    cv2.line(canvas, (x - 12, y), (x + 12, y), ink, 3, cv2.LINE_AA)


_MARKS = {
    "meadow": _flower,
    "dirt": _speck,
    "road": _track,
    "sand": _speck,
    "gravel": _stone,
    "mud": _stone,
    "rock": _crag,
    "cliff": _crag,
    "deep water": _wave,
    "water": _wave,
    "shallows": _wave,
    "snow": _speck,
    "forest floor": _bush,
    "thicket": _bush,
}


def speed_picture(speed) -> np.ndarray:
    """One tile of a speed, (32, 32, 4): a road sign for a cap, a plate for a factor."""
    import cv2

    canvas = _canvas("#ffffff", 0)
    middle = TILE * _FINE // 2
    if speed["max_speed"]:
        cv2.circle(canvas, (middle, middle), middle - 6, (255, 255, 255, 235), -1, cv2.LINE_AA)
        cv2.circle(canvas, (middle, middle), middle - 11, (50, 60, 200, 255), 9, cv2.LINE_AA)
        _words(cv2, canvas, f"{speed['max_speed']:g}", 1.5)
    else:
        cv2.rectangle(canvas, (5, 26), (2 * middle - 6, 2 * middle - 27), (255, 255, 255, 235), -1)
        cv2.rectangle(canvas, (5, 26), (2 * middle - 6, 2 * middle - 27), (160, 110, 40, 255), 6)
        _words(cv2, canvas, f"x{speed['factor']:g}", 1.4)
    return _shrunk(canvas)


def _words(cv2, canvas, words, scale):
    font, weight = cv2.FONT_HERSHEY_SIMPLEX, 4
    (width, height), _ = cv2.getTextSize(words, font, scale, weight)
    scale = min(scale, scale * (canvas.shape[1] - 36) / width)
    (width, height), _ = cv2.getTextSize(words, font, scale, weight)
    at = ((canvas.shape[1] - width) // 2, (canvas.shape[0] + height) // 2)
    cv2.putText(canvas, words, at, font, scale, (40, 40, 40, 255), weight, cv2.LINE_AA)


def brush_picture(name, colour) -> np.ndarray:
    """One tile of a brush, (32, 32, 4): its colour and, in white, how its animals move.

    Those of the shipped brushes are pictures of running herds (``python -m flockbrush.studio.thumbnails --tiles
    levels``); for other brushes a sign that goes by the name has to do.
    """
    import cv2

    kept = _shipped_tiles().get(name)
    if kept is not None and np.abs(kept[0, 0, :3] - 0.78 * np.array(_bgr(colour))).max() < 3:
        return kept
    canvas = _canvas(colour)
    cv2.rectangle(canvas, (3, 3), (TILE * _FINE - 4, TILE * _FINE - 4), (*_bgr(colour, -45), 255), 5)
    glyph = next((g for word, g in _GLYPHS.items() if word in name), _arrows)
    glyph(cv2, canvas, name)
    return _shrunk(canvas)


@cache
def _shipped_tiles():
    """{name: tile} of the brushes that come with Flockbrush."""
    import cv2

    home = Path(__file__).parent
    sheet = cv2.imread(str((home / BRUSHES_FILE).with_suffix(".png")), cv2.IMREAD_UNCHANGED)
    if sheet is None:
        return {}
    corners = [divmod(number, COLUMNS) for number in range(sheet.shape[0] // TILE * COLUMNS)]
    tiles = [sheet[y * TILE : (y + 1) * TILE, x * TILE : (x + 1) * TILE] for y, x in corners]
    return dict(zip(known_brushes(home / BRUSHES_FILE), tiles, strict=False))


_WHITE = (255, 255, 255, 255)


def _animal(cv2, canvas, x, y, angle, size=15):
    """A pointed body."""
    c, s = np.cos(angle), np.sin(angle)
    shape = np.array([(1.3, 0), (-0.9, 0.7), (-0.5, 0), (-0.9, -0.7)]) * size @ np.array([(c, s), (-s, c)])
    cv2.fillPoly(canvas, [np.round(shape + (x, y)).astype(np.int32)], _WHITE, cv2.LINE_AA)


def _arrows(cv2, canvas, name):
    for x, y in ((38, 34), (84, 34), (38, 94), (84, 94), (62, 64)):
        _animal(cv2, canvas, x, y, 0)


def _mill(cv2, canvas, name):
    for ring, count in ((44, 8), (20, 4)) if "hollow" not in name else ((44, 9),):
        for k in range(count):
            a = 2 * np.pi * k / count
            _animal(cv2, canvas, 64 + ring * np.cos(a), 64 - ring * np.sin(a), -a - np.pi / 2, 11)


def _loose(cv2, canvas, name):
    angles = np.random.default_rng([ord(c) for c in name]).uniform(0, 2 * np.pi, 9)
    for (x, y), a in zip(_scatter(name), angles, strict=True):
        _animal(cv2, canvas, x, y, a, 12)


def _column(cv2, canvas, name):
    for k in range(4):
        _animal(cv2, canvas, 22 + 29 * k, 64 + 10 * np.sin(1.6 * k), 0, 14)


def _front(cv2, canvas, name):
    for k in range(5):
        _animal(cv2, canvas, 62 + 8 * (k % 2), 20 + 22 * k, 0, 13)


def _lanes(cv2, canvas, name):
    for k in range(9):
        _animal(cv2, canvas, 24 + 38 * (k % 3) + 8 * (k // 3 % 2), 30 + 34 * (k // 3), 0, 13)


def _rush(cv2, canvas, name):
    for x, y in ((40, 30), (40, 98), (66, 64)):
        _animal(cv2, canvas, x + 26, y, 0, 20)
        cv2.line(canvas, (x - 26, y), (x, y), _WHITE, 5, cv2.LINE_AA)


def _burst(cv2, canvas, name):
    for k in range(7):
        a = 2 * np.pi * k / 7
        _animal(cv2, canvas, 64 + 38 * np.cos(a), 64 + 38 * np.sin(a), a, 14)


def _closing(cv2, canvas, name):
    cv2.circle(canvas, (88, 64), 9, _WHITE, 4, cv2.LINE_AA)
    for y in (24, 64, 104):
        _animal(cv2, canvas, 36 + (y == 64) * 12, y, np.arctan2(64 - y, 52), 17)


_GLYPHS = {
    "mill": _mill,
    "swarm": _loose,
    "graze": _loose,
    "narrow": _column,
    "column": _column,
    "front": _front,
    "broad": _front,
    "lane": _lanes,
    "stampede": _rush,
    "flee": _burst,
    "hunt": _closing,
}

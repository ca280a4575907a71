"""Pictures of our tiles, drawn: ground, speed limits and brushes."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path

import numpy as np
from flockbrush.engine.problems import Problem, ProblemsError
from flockbrush.levels.terrain_kinds import TERRAINS
from flockbrush.levels.tilesets_data import COLUMNS, SPEEDS, TILE

BRUSHES_FILE = "tilesets/brushes.tsj"
_FINE = 4  # pictures are drawn this much larger, then shrunk


def png(picture) -> bytes:
    """A picture as a PNG file."""
    import cv2

    return cv2.imencode(".png", picture)[1].tobytes()


def as_sheet(pictures):
    """All pictures side by side, eight in a row, with transparent room at the end."""
    rows = -(-len(pictures) // COLUMNS)
    sheet = np.zeros((rows * TILE, COLUMNS * TILE, 4), np.uint8)
    for i, picture in enumerate(pictures):
        y, x = divmod(i, COLUMNS)
        sheet[y * TILE : (y + 1) * TILE, x * TILE : (x + 1) * TILE] = picture
    return sheet


def is_painted_over(there: bytes, new: bytes) -> bool:
    """Whether the file of a sheet shows other tiles than a new one, which may have more of them."""
    import cv2

    before, after = (cv2.imdecode(np.frombuffer(data or b"?", np.uint8), cv2.IMREAD_UNCHANGED) for data in (there, new))
    if before is None or after is None or before.shape != after[: len(before)].shape:
        return True
    after = after[: len(before)]
    return bool((before != after)[before[..., 3] > 0].any())


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

    sheet = as_sheet([_picture_of(meaning, library) for meaning in meanings])
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

    shipped_tile = _shipped_tiles().get(name)
    if shipped_tile is not None and np.abs(shipped_tile[0, 0, :3] - 0.78 * np.array(_bgr(colour))).max() < 3:
        return shipped_tile
    canvas = _canvas(colour)
    cv2.rectangle(canvas, (3, 3), (TILE * _FINE - 4, TILE * _FINE - 4), (*_bgr(colour, -45), 255), 5)
    glyph = next((g for word, g in _GLYPHS.items() if word in name), _arrows)
    glyph(cv2, canvas, name)
    return _shrunk(canvas)


def known_brushes(tileset_file) -> list[str]:
    """The brushes of a ``brushes.tsj``, by tile; none if there is no such file."""
    try:
        tiles = json.loads(Path(tileset_file).read_bytes())["tiles"]
        return [tile["properties"][0]["value"] for tile in sorted(tiles, key=lambda tile: tile["id"])]
    except FileNotFoundError:
        return []
    except (ValueError, LookupError, TypeError):
        problem = Problem(str(tileset_file), None, None, "is damaged; delete it, and it will be created again")
        raise ProblemsError([problem]) from None


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

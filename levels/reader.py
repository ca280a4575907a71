"""Reading a level: from a .tmj file to a `Level`, or to everything that is wrong with it.

An object's class decides what it is, whatever the layer; classless objects take the class of a layer named after one.
Hidden layers and objects count: the eye in Tiled is for the designer's view.  Layers called ``notes...`` or
``decor...`` are the designer's own, with all that is on them.
"""

from __future__ import annotations

import dataclasses
import os
import posixpath
from pathlib import Path

import numpy as np
from flockbrush.behaviours.brush import SUFFIX, BrushSource, load_brush
from flockbrush.behaviours.program import Program, shipped_programs
from flockbrush.behaviours.species import shipped_species
from flockbrush.engine.arguments import checked
from flockbrush.engine.file_formats import format_error
from flockbrush.engine.files import refused
from flockbrush.engine.problems import ProblemsError, did_you_mean
from flockbrush.engine.raster import Raster
from flockbrush.levels import schema
from flockbrush.levels.art_reader import ArtReader
from flockbrush.levels.checked_nodes import parsed, text
from flockbrush.levels.checks import check_level
from flockbrush.levels.height_picture import read_grey
from flockbrush.levels.hints import (
    event_hints,
    layer_hints,
    level_hints,
    mixing_hints,
    paint_hints,
    program_hints,
    script_hints,
    seam_hints,
    slope_hints,
    species_hints,
)
from flockbrush.levels.layer_reader import LayerReader, has_group, kind_of, plain_name, split
from flockbrush.levels.level_files import DiskFiles, FileRefused, MemoryFiles, UnsavedFiles
from flockbrush.levels.libraries import brush_library, program_library, recorded_library
from flockbrush.levels.objects import ObjectReader
from flockbrush.levels.properties import FilePlace, Report, read_properties, shown
from flockbrush.levels.schema import CLASSES, BrushLayer, Level, PaintBounds
from flockbrush.levels.terrain_kinds import Terrain
from flockbrush.levels.tileset_reader import TilesetReader


@checked(library="a BrushLibrary")
def read_level(path: str | os.PathLike, library: BrushSource | None = None, commands=None) -> Level:
    """The level in a TMJ file.

    Parameters
    ----------
    path : path-like
        A ``.tmj`` (or ``.json``) file saved by Tiled.
    library : BrushLibrary, optional
        Which brushes there are; the shipped ones, and those in a folder ``brushes`` beside the level or the project,
        when left out.
    commands : dict of str to dataclass, optional
        Which commands a script may give; all of `flockbrush.engine.commands` when left out, unchecked when that is
        empty.

    Raises
    ------
    ProblemsError
        With every problem of the level and the files it names.
    """
    path = Path(path)
    if path.suffix.lower() in OTHERS and path.is_file():
        raise refused(path, f"is {OTHERS[path.suffix.lower()]}; a level is a .tmj or .tmx file of Tiled")
    return _read(DiskFiles(path), library if library is not None else brush_library(path), commands)


def read_level_files(files: dict[str, bytes], library=None, commands=None) -> Level:
    """The level whose files a recording has embedded (`Level.files`), the level itself first.

    Raises
    ------
    ProblemsError
        As `read_level`.
    """
    return _read(MemoryFiles(files), library if library is not None else recorded_library(files), commands)


def read_level_text(text: bytes, path, library=None, kept=None) -> Level:
    """The level that a file would hold with this in it.

    Parameters
    ----------
    path : path-like
        The file; the others it names are read beside it.
    library : BrushLibrary, optional
        As `read_level`.
    kept : dict of str to bytes, optional
        Those other files, for when the disk has them no more.

    Raises
    ------
    ProblemsError
    """
    files = UnsavedFiles(Path(path), text, kept or {})
    return _read(files, library if library is not None else brush_library(path), None)


def _read(files, library, commands):
    report = Report()
    level = LevelReader(files, report, library, commands, program_library(files)).level()
    if report.problems or level is None:
        raise ProblemsError(sorted(report.problems, key=lambda p: (p.file, p.line or 0)))
    return level


OTHERS = {  # files that are often given instead of a level, and the commands that take them
    ".flock": "a recording, for flockbrush replay, play, measure or export",
    **dict.fromkeys((".csv", ".tsv", ".parquet", ".nc", ".npy"), "a table of tracks, for flockbrush measure or learn"),
    **dict.fromkeys((".mp4", ".mov", ".avi", ".mkv", ".webm"), "a film, for flockbrush learn, or play --clip"),
    **dict.fromkeys((".png", ".jpg", ".jpeg"), "a picture"),
    ".toml": "a brush, species, program or sweep; use it in a level, or with run --brush or sweep",
}


class LevelReader:
    """Walks through one document; tells every problem to the report and goes on as long as it makes sense."""

    def __init__(self, files, report, library, commands=None, programs=None):
        self.files, self.report = files, report
        self.library = library
        self.programs = programs or shipped_programs()
        self.named_programs: dict[str, Program] = {}
        self.commands = commands
        self._plain: list[tuple] = []  # where a brush is named without a file: (name, place, line, key)
        self._brush_files: dict[str, tuple[str, bytes]] = {}  # of brushes that are named with one
        self.place = FilePlace(report, str(files.level), None)
        self.tiles = TilesetReader(files, self.place)
        self.layers = LayerReader(self.place)

    # ------------------------------------------------------------ the document

    def level(self):
        """The level, or None with problems reported."""
        doc = self.document()
        if doc is None:
            return None
        place = self.place.at(doc, "map")
        walked = list(self.layers.walk(doc.get("layers"), place))
        layers, others = split(walked)
        values = self.map_properties(doc, has_group(walked), place)
        self.check_map(doc, values, place)
        self.tiles.read(doc)
        frame = self.layers.frame(doc, layers, values["metres_per_tile"], place)
        if frame is None:
            return None
        level = Level(
            name=self.files.level.stem,
            path=self.files.level,
            width=frame.nx * frame.metres,
            height=frame.ny * frame.metres,
            cell=frame.metres,
            boundary=values["boundary"],
            seed=values["seed"],
        )
        rules = FilePlace(self.report, place.file, values.lines.get("ground_rules", place.line), place.where)
        artist = ArtReader(self, frame, values["ground_rules"], rules)
        artist.read(level, others)
        self.fill(level, layers, frame)
        artist.finish(level)
        level.kinds = list({**self.tiles.kinds(), **artist.kinds}.values())
        level.files = self.files.got
        level.programs = self.named_programs
        self.know_brushes()
        check_level(level, self.objects, self.library, self.commands)
        if not self.report.problems:
            layer_hints(layers)
            level_hints(level, self.objects.places)
            program_hints(level, self.objects.places)
            event_hints(level, self.objects.places)
            script_hints(level, self.objects.places)
            places = [*self.paint_places, *map(self.objects.place, level.zones)]
            paint_hints(level, places, self.library)
            mixing_hints(level, places, self.library)
            fauna = getattr(self.library, "species", None) or shipped_species()
            slope_hints(level, self.objects.places, self.library, fauna)
            seam_hints(level, place)
            species_hints(level, self.objects.places, fauna)
        level.warnings = sorted(self.report.warnings, key=lambda p: (p.file, p.line or 0))
        return level

    def document(self):
        """The parsed map; None when it is none."""
        try:
            data = self.files.first()
        except FileRefused as error:
            self.place.say(str(error))
            return None
        return parsed(data, self.place, "map")

    def map_properties(self, doc, grouped, place):
        """The properties of the map; others than ours are those of a game where our layers have a group."""
        cls = CLASSES["FlockbrushLevel"]
        values = read_properties(doc, dataclasses.replace(cls, open=grouped), place)
        for name in values.others:
            near = did_you_mean(name, [p.name for p in cls.properties])
            if "did you mean" in near:
                place.warn(f"property {name[:60]!r} has no effect on the level{near}", values.lines[name])
        return values

    def check_map(self, doc, values, place):
        if "schema" in values.given and (wrong := format_error(values["schema"], schema.SCHEMA)):
            place.say(f"schema {wrong}", values.lines["schema"])
        if doc.get("orientation", "orthogonal") != "orthogonal":
            place.say(
                f"the orientation must be orthogonal, got {shown(doc['orientation'])}: tiles must be"
                " squares of the ground, seen from above"
            )

    # ------------------------------------------------------------ what the layers say

    def fill(self, level, layers, frame):
        """Read every layer into the level."""
        objects = self.objects = ObjectReader(self, frame, level)
        self.known = {}  # terrain kinds by tile id
        self.painted = None  # cells of terrain layers
        self.paint_places = []  # of the brush layers
        for layer in layers:
            kind = kind_of(layer.name)
            if kind is None and layer.kind != "objectgroup":
                layer.place.say(
                    f"no such layer{did_you_mean(plain_name(layer.name), schema.LAYER_NAMES)}"
                    f" (a layer of your own begins with {' or '.join(schema.IGNORED)})"
                )
            elif layer.kind == "tilelayer":
                self.tile_layer(level, layer, kind, frame)
            elif layer.kind == "imagelayer":
                self.image_layer(level, layer, kind, frame)
            else:
                objects.layer(layer, kind)
        objects.finish()

    def tile_layer(self, level, layer, kind, frame):
        cls = {c.home: c.name for c in CLASSES.values() if c.use == "tile"}.get(kind)
        if cls is None:
            layer.place.say(
                f"this must be {'an image' if kind == 'height' else 'an object'} layer, but is a tile layer"
            )
            return
        gids = self.layers.gids(layer, frame)
        used = self.used_tiles(gids, cls, layer)
        if cls == "Terrain":
            self.paint_terrain(level, gids, used, layer)
        elif cls == "Brush":
            level.brush_layers.append(self.brush_layer(gids, used, layer))
            self.paint_places.append(layer.place)
        else:
            self.paint_speed(level, gids, used, frame)

    def used_tiles(self, gids, cls, layer):
        """{gid: Tile} of the tiles painted here; those of another class are problems."""
        used = {}
        for gid in map(int, np.unique(gids)):
            if gid == 0:
                continue
            tileset = self.tiles.of(gid)
            tile = tileset.tiles.get(gid - tileset.firstgid) if tileset else None
            if tile is not None and tile.cls == cls:
                used[gid] = tile
                continue
            if tileset is None and self.tiles.lost:
                continue
            iy, ix = (int(k[0]) for k in np.nonzero(gids == gid))
            tiles = (
                f"it is a {tile.cls} tile"
                if tile and tile.cls
                else "it has no class"
                if tileset
                else "no tileset has it"
            )
            where = f"column {ix}, row {len(gids) - 1 - iy}"
            layer.place.say(f"tile id {gid} at {where} must be a {cls} tile, but {tiles}")
        return used

    def paint_terrain(self, level, gids, used, layer):
        if level.terrain is None:
            level.terrain = Terrain.blank(gids.shape)
        self.painted = gids > 0 if self.painted is None else self.painted | (gids > 0)
        for gid, tile in used.items():
            values = {**tile.values, "name": tile.values["name"] or tile.label}
            self.known[gid] = level.terrain.put(gids == gid, values, self.known.get(gid))

    def brush_layer(self, gids, used, layer):
        names = {gid: self.tile_brush(tile) for gid, tile in used.items()}
        assets = sorted(set(names.values()))
        index = np.full(gids.shape, -1, np.int16)
        for gid, name in names.items():
            index[gids == gid] = assets.index(name)
        values = read_properties(layer.node, CLASSES["BrushLayer"], layer.place)
        return BrushLayer(layer.name, layer.opacity, assets, index, PaintBounds.of(values))

    def tile_brush(self, tile):
        """The brush of a painted tile; looked up only now, since a tileset may know brushes that are gone."""
        if isinstance(tile.values["asset"], tuple):
            name, folder = tile.values["asset"]
            line = tile.values.lines.get("asset")
            tile.values["asset"] = self.brush(name, folder, tile.place, line, "asset") if line else name
        return tile.values["asset"]

    def paint_speed(self, level, gids, used, frame):
        """Several layers: the lowest cap, the product of factors."""
        for gid, tile in used.items():
            cells = gids == gid
            if tile.values["max_speed"] > 0:
                if level.cap is None:
                    level.cap = Raster(frame.metres, np.full(gids.shape, np.inf))
                values = level.cap.values
                values[cells] = np.minimum(values[cells], tile.values["max_speed"])
            if tile.values["factor"] != 1:
                if level.factor is None:
                    level.factor = Raster(frame.metres, np.ones(gids.shape))
                level.factor.values[cells] *= tile.values["factor"]

    def image_layer(self, level, layer, kind, frame):
        place = layer.place
        if kind != "height":
            place.say(
                f"this must be {'a tile' if kind in ('terrain', 'brush', 'speed') else 'an object'} layer, "
                "but is an image layer"
            )
            return
        if level.height_map is not None:
            place.say("there may be one height layer only")
            return
        values = read_properties(layer.node, CLASSES["Height"], place)
        source = text(layer.node, "image", place)
        try:
            grey = read_grey(self.files.read(source))
        except (FileRefused, ValueError) as error:
            place.say(f"height picture {source[:200]!r}: {error}")
            return
        ny, nx = grey.shape
        wraps = level.boundary == "wrap"
        if abs(nx * frame.ny / (ny * frame.nx) - 1) > (0.0 if wraps else 0.01):
            place.say(
                f"the height picture is stretched over the map and must have its proportions"
                f"{' exactly where the map wraps' if wraps else ''}, {frame.nx} : {frame.ny}, got {nx} x {ny} pixels"
            )
            return
        level.height_map = Raster(level.width / nx, grey[::-1].astype(float) * values["metres_per_level"])

    # ------------------------------------------------------------ brushes

    def brush(self, name, folder, place, line, key):
        """The name of a brush, files named relative to the level; a plain name is judged by `know_brushes`."""
        if name.endswith(".toml"):
            return self.brush_file(name, folder, place, line, key)
        self._plain.append((name, place, line, key))
        return name

    def know_brushes(self):
        """From now on the brushes named as files are known by name too; plain names that are wrong or hidden are told.

        A plain name means the file of this name, if the level names one anywhere.
        """
        others, files = self.library, self._brush_files
        self.library = others.with_files({name + SUFFIX: data for name, (_, data) in files.items()})
        names, hidden = self.library.names(), {name for name in files if self._hides(others, name)}
        for name, place, line, key in self._plain:
            if not name:
                place.say(f"{key} must name a brush{did_you_mean(name, names)}", line)
            elif name not in names:
                place.say(f"{key}: there is no brush {name[:60]!r}{did_you_mean(name, names)}", line)
            elif name in hidden:
                hidden.remove(name)
                place.warn(
                    f"brush {name!r} is that of {files[name][0]} in this level; rename the file to have both", line
                )

    def _hides(self, library, name):
        """Whether the brush of a file is not the one of this name in the library."""
        try:
            return name in library.names() and library.get(name).source != self._brush_files[name][1]
        except ProblemsError:  # not used
            return False

    def program(self, name, place, line):
        """The name of a program, after reading it; mistakes are reported with its own lines."""
        if name and name not in self.named_programs:
            try:
                self.named_programs[name] = self.programs.get(name)
            except ProblemsError as error:
                if name in self.programs.names():
                    self.report.problems.extend(error.problems)
                else:
                    place.say(f"program: {error.problems[0].message}", line)
        return name

    def brush_file(self, name, folder, place, line, key):
        try:
            data = self.files.read(posixpath.join(folder, name))
        except FileRefused as error:
            place.say(f"{key}: {error}", line)
            return name
        relative = posixpath.normpath(posixpath.join(folder, name).replace("\\", "/"))
        try:
            brush = load_brush(data, file=self.files.shown(relative)).name
        except ProblemsError as error:
            self.report.problems.extend(error.problems)
            return name
        other, known = self._brush_files.setdefault(brush, (relative, data))
        if known != data:
            place.say(f"{key}: {relative} and {other} are different brushes of one name; rename one of them", line)
        return brush

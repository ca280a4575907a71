"""What a designer draws is what the animals get, and what cannot be is told in words."""

import base64
import gzip
import json
import math
import struct
import tracemalloc
import zlib

import cv2
import flockbrush.systems.gusts  # noqa: F401  a command
import numpy as np
import pytest
from flockbrush.engine import limits
from flockbrush.engine.commands import COMMANDS
from flockbrush.engine.problems import ProblemsError
from flockbrush.levels.geometry import signed_area
from flockbrush.levels.reader import read_level_files
from small_level import (
    GRASS,
    MARCH,
    PLAIN,
    SLOW,
    WALL,
    Shelf,
    herd,
    level,
    objects,
    polygon,
    polyline,
    problem,
    problems,
    properties,
    read,
    thing,
    tiles,
    tileset,
    with_objects,
)


def png(picture):
    return cv2.imencode(".png", picture)[1].tobytes()


class TestShapes:
    """Pitfall 1: y is down and rotation clockwise in Tiled, offsets and groups add up."""

    def test_the_north_west_corner_of_tiled_is_the_top_of_our_y(self):
        spawn = read(level()).spawns[0]
        assert spawn.polygon.min(axis=0) == pytest.approx([4, 4])  # 32 px = 2 tiles = 4 m; 20 - (32+96)/16*2 = 4
        assert spawn.polygon.max(axis=0) == pytest.approx([20, 16])

    def test_every_area_is_counter_clockwise_however_it_was_drawn(self):
        corners = [(0, 0), (32, 0), (32, 32), (0, 16)]
        for points in (corners, corners[::-1]):
            rock = thing(2, "Obstacle", 16, 16, extra=polygon(*points))
            shape = read(with_objects("obstacles", rock)).obstacles[0].polygon
            assert signed_area(shape) == pytest.approx(12)  # 768 px^2 at 64 px^2 a m^2

    def test_a_polyline_keeps_its_direction_and_starts_at_its_origin(self):
        arrow = thing(2, "Guide", 16, 144, extra=polyline((0, 0), (128, -64)))
        assert read(with_objects("guides", arrow)).guides[0].points == pytest.approx(np.array([(2, 2), (18, 10)]))

    def test_rotation_is_clockwise_about_the_top_left_corner(self):
        rock = thing(2, "Obstacle", 80, 80, 32, 16, extra={"rotation": 90})
        shape = read(with_objects("obstacles", rock)).obstacles[0].polygon
        assert shape.min(axis=0) == pytest.approx([8, 6])  # turned down and to the left of (10, 10) m
        assert shape.max(axis=0) == pytest.approx([10, 10])

    def test_a_quarter_turn_in_two_eighths_agrees_with_one_in_a_quarter(self):
        rock = thing(2, "Obstacle", 80, 80, 32, 32, extra={"rotation": 45})
        shape = read(with_objects("obstacles", rock)).obstacles[0].polygon
        diagonal = 4 * math.sqrt(2)
        assert shape.min(axis=0) == pytest.approx([10 - diagonal / 2, 10 - diagonal])
        assert shape.max(axis=0) == pytest.approx([10 + diagonal / 2, 10])

    def test_a_tile_object_stands_on_its_bottom_left_corner(self):
        rock = thing(2, "Obstacle", 80, 80, 32, 16, extra={"gid": GRASS})
        shape = read(with_objects("obstacles", rock)).obstacles[0].polygon
        assert shape.min(axis=0) == pytest.approx([10, 10])
        assert shape.max(axis=0) == pytest.approx([14, 12])

    def test_a_tileset_may_centre_its_tile_objects(self):
        document = with_objects("obstacles", thing(2, "Obstacle", 80, 80, 32, 16, extra={"gid": 0x80000000 | GRASS}))
        document["tilesets"][0]["objectalignment"] = "center"
        assert read(document).obstacles[0].polygon.mean(axis=0) == pytest.approx([10, 10])

    def test_an_ellipse_is_a_polygon_that_touches_its_box(self):
        pond = thing(2, "Obstacle", 16, 16, 64, 32, extra={"ellipse": True})
        shape = read(with_objects("obstacles", pond)).obstacles[0].polygon
        assert len(shape) == 32
        assert shape.min(axis=0) == pytest.approx([2, 14])
        assert shape.max(axis=0) == pytest.approx([10, 18])
        assert signed_area(shape) == pytest.approx(math.pi * 4 * 2, rel=0.01)

    def test_a_capsule_is_a_box_with_round_ends(self):
        log = thing(2, "Obstacle", 16, 16, 64, 16, extra={"capsule": True})
        shape = read(with_objects("obstacles", log)).obstacles[0].polygon
        assert shape.max(axis=0) - shape.min(axis=0) == pytest.approx([8, 2])
        assert signed_area(shape) == pytest.approx(6 * 2 + math.pi, rel=0.01)

    def test_offsets_of_nested_groups_and_layers_add_up(self):
        inner = objects("spawns", herd(), offsetx=-16, offsety=-8)
        group = {"type": "group", "name": "north", "offsetx": -8, "layers": [inner]}
        outer = {"type": "group", "name": "all", "offsety": 16, "layers": [group]}
        spawn = read(level(tiles(), outer)).spawns[0]
        assert spawn.polygon.min(axis=0) == pytest.approx([1, 3])

    def test_a_tile_layer_is_offset_by_whole_tiles_or_not_at_all(self):
        gids = [0] * 100
        gids[0] = WALL
        ground = read(level(tiles(gids=gids, offsetx=32, offsety=16), objects("spawns", herd()))).terrain
        assert np.argwhere(~ground.walkable).tolist() == [[8, 2]]
        assert "may be offset by whole tiles of 16 px only, got 8, 0" in problem(
            level(tiles(offsetx=8), objects("spawns", herd()))
        )

    def test_a_double_click_at_a_corner_does_no_harm(self):
        rock = thing(2, "Obstacle", 16, 16, extra=polygon((0, 0), (32, 0), (32, 0), (32, 32), (0, 0)))
        assert len(read(with_objects("obstacles", rock)).obstacles[0].polygon) == 3

    def test_an_outline_that_crosses_itself_is_refused(self):
        bow = thing(2, "Obstacle", 16, 16, name="bow", extra=polygon((0, 0), (32, 32), (32, 0), (0, 32)))
        assert "object 2 'bow' in layer 'obstacles': its outline crosses itself near (2.0, 18.0) m" in problem(
            with_objects("obstacles", bow)
        )

    @pytest.mark.parametrize(
        "shape",
        [{}, polygon((0, 0), (32, 32)), polygon((0, 0), (16, 16), (32, 32)), {"ellipse": True}, {"width": 32}],
    )
    def test_a_shape_without_area_is_refused(self, shape):
        assert "it has no area; drag it larger or delete it" in problem(
            with_objects("obstacles", thing(2, "Obstacle", 16, 16, extra=shape))
        )

    def test_a_shape_of_the_wrong_kind_says_which_is_right(self):
        assert "a Guide must be a polyline, and this is a rectangle, ellipse or polygon" in problem(
            with_objects("guides", thing(2, "Guide", 16, 16, 32, 32))
        )
        assert "an Exit must be a rectangle, ellipse or polygon, and this is a polyline" in problem(
            with_objects("exits", thing(2, "Exit", 16, 16, extra=polyline((0, 0), (9, 9))))
        )

    def test_an_area_goal_has_its_centre_of_mass(self):
        fold = thing(2, "Goal", 16, 16, 32, 64, name="fold")
        goal = read(with_objects("goals", fold)).goals[0]
        assert goal.xy == pytest.approx([4, 14])
        assert goal.polygon is not None


PYRAMID = "-2 -2 0; 2 -2 0; 2, 2, 0; -2 2 0; 0 0 5"


def rock_with(**values):
    return with_objects("obstacles", thing(2, "Obstacle", 16, 16, 32, 32, "rock", **values))


class TestHulls:
    """A solid with flat faces is told by its corners."""

    def test_corners_are_metres_from_the_middle_of_its_foot(self):
        rock = read(rock_with(shape="hull", corners=PYRAMID, z_max=5.0)).obstacles[0]
        assert rock.corners.shape == (5, 3)
        assert rock.corners[4].tolist() == [0.0, 0.0, 5.0]

    @pytest.mark.parametrize(
        ("corners", "told"),
        [
            ("", "4 to 32 corners of three numbers"),
            ("0 0 0; 1 0 0; 0 1 0", "4 to 32 corners"),
            ("0 0; 1 0; 0 1; 1 1", "three numbers"),
            ("0 0 0; 1 0 0; 0 1 0; 1 1 0", "must not lie in one plane"),
            ("0 0 0; 1 0 0; 0 1 0; 0 0 up", "could not convert"),
            ("0 0 0; 1 0 0; 0 1 0; 0 0 nan", "no level is larger"),
            ("0 0 0; 1 0 0; 0 1 0; 0 0 1e300", "no level is larger"),
            ("; ".join(f"{k} {k * k} {k**3}" for k in range(40)), "4 to 32 corners"),
        ],
    )
    def test_what_is_no_hull_is_told(self, corners, told):
        found = problem(rock_with(shape="hull", corners=corners))
        assert "rock" in found and "such as '-2 -2 0;" in found and told in found

    def test_corners_of_a_box_are_told(self):
        assert "set shape to 'hull', it is 'box'" in problem(rock_with(corners=PYRAMID))


class TestDefaults:
    """Pitfall 2: defaults are ours; the class is `type` or `class`."""

    def test_what_the_file_leaves_out_the_schema_says(self):
        rock = thing(2, "Obstacle", 16, 16, 32, 32)
        obstacle = read(with_objects("obstacles", rock)).obstacles[0]
        assert (obstacle.solid, obstacle.blocks_view, obstacle.margin) == (True, True, 0.0)
        spawn = read(level()).spawns[0]
        assert (spawn.heading, spawn.speed, spawn.body_length, spawn.formation) == (None, None, None, "scatter")

    def test_tiled_1_9_calls_the_class_class(self):
        spawn = herd()
        spawn["class"] = spawn.pop("type")
        assert len(read(level(tiles(), objects("spawns", spawn))).spawns) == 1

    def test_an_object_without_class_takes_that_of_its_layer(self):
        plain = thing(2, "", 16, 16, 32, 32)
        assert len(read(with_objects("obstacles north", plain)).obstacles) == 1
        assert "has no class; there are Obstacle, Guide" in problem(with_objects("things", plain))

    def test_a_class_value_counts_as_its_members(self):
        spawn = herd()
        members = {"count": 7, "brush": "graze"}
        spawn["properties"] = [{"name": "spawn", "type": "class", "propertytype": "Spawn", "value": members}]
        found = read(level(tiles(), objects("spawns", spawn))).spawns[0]
        assert (found.count, found.brush) == (7, "graze")

    def test_notes_and_texts_are_the_designers_own(self):
        note = thing(2, "Whatever", 16, 16, 32, 32)
        text = thing(3, "", 16, 16, 32, 32, extra={"text": {"text": "sheep here"}})
        found = read(level(tiles(), objects("spawns", herd()), objects("notes", note), objects("obstacles", text)))
        assert len(found.spawns) == 1 and not found.obstacles

    def test_unknown_classes_properties_and_layers_ask_did_you_mean(self):
        assert "there is no class 'Obstical'; did you mean 'Obstacle'?" in problem(
            with_objects("obstacles", thing(2, "Obstical", 16, 16, 32, 32))
        )
        assert "Spawn has no property 'cuont'; did you mean 'count'?" in problem(
            level(tiles(), objects("spawns", herd(cuont=3)))
        )
        assert "layer 'terain': no such layer; did you mean 'terrain'?" in problem(
            level(tiles("terain"), objects("spawns", herd()))
        )

    def test_a_goal_may_be_named_by_its_object(self):
        arrow = thing(3, "Guide", 16, 144, extra=polyline((0, 0), (128, -64)))
        arrow["properties"] = [{"name": "goal", "type": "object", "value": 2}]
        fold = thing(2, "Goal", 80, 80, name="fold", extra={"point": True})
        document = level(tiles(), objects("spawns", herd()), objects("guides", arrow), objects("goals", fold))
        assert read(document).guides[0].goal == "fold"
        arrow["properties"][0]["value"] = 1
        document = level(tiles(), objects("spawns", herd()), objects("guides", arrow), objects("goals", fold))
        assert "goal: object 1 is no Goal" in problem(document)


class TestTiles:
    """Pitfall 3: flip flags, encodings, chunks."""

    gids = np.array([GRASS, WALL] + [GRASS] * 98, "<u4")

    def walls(self, **layer):
        ground = read(level(tiles(**layer), objects("spawns", herd()))).terrain
        return np.argwhere(~ground.walkable).tolist()

    def test_the_first_tile_of_the_file_is_the_north_west_one(self):
        assert self.walls(gids=self.gids.tolist()) == [[9, 1]]

    def test_flipped_tiles_are_the_same_ground(self):
        flags = np.array([0x80000000, 0xF0000000] + [0x40000000] * 98, "<u4")
        assert self.walls(gids=(self.gids | flags).tolist()) == [[9, 1]]

    @pytest.mark.parametrize("compression, pack", [("", bytes), ("zlib", zlib.compress), ("gzip", gzip.compress)])
    def test_packed_tiles_are_the_same_ground(self, compression, pack):
        packed = base64.b64encode(pack(self.gids.tobytes())).decode()
        assert self.walls(data=packed, encoding="base64", compression=compression) == [[9, 1]]

    @pytest.mark.parametrize(
        "layer, message",
        [
            ({"encoding": "base64", "compression": "zstd"}, "zstd is not read; set Map > Tile Layer Format to CSV"),
            ({"encoding": "base32"}, "unknown tile data encoding 'base32'; there are csv and base64"),
            ({"encoding": "base64", "compression": "lzma"}, "unknown tile data compression 'lzma'"),
            ({"encoding": "base64"}, "base64 tile data must be a text"),
            ({"encoding": "base64", "data": "no*base64"}, "tile data is not valid base64"),
            ({"encoding": "base64", "data": "AAAA"}, "must have 400 bytes (100 tiles), got 3"),
            ({"encoding": "base64", "compression": "zlib", "data": "AAAA"}, "tile data is not valid zlib"),
            ({"data": [1] * 99}, "tile data must have 100 tiles, got 99"),
            ({"data": [True] * 100}, "must be whole numbers from 0 to 4294967295"),
            ({"data": [1.0] * 100}, "must be whole numbers from 0 to 4294967295"),
            ({"data": [-1] * 100}, "must be whole numbers from 0 to 4294967295"),
            ({"data": [2**40] * 100}, "must be whole numbers from 0 to 4294967295"),
            ({"data": "1,1"}, "tile data must be a list of numbers"),
        ],
    )
    def test_tiles_that_cannot_be_read_say_why(self, layer, message):
        assert message in problem(level(tiles(**layer), objects("spawns", herd())))

    def test_a_bomb_is_not_unpacked(self):
        bomb = base64.b64encode(zlib.compress(bytes(50_000_000))).decode()
        document = level(tiles(data=bomb, encoding="base64", compression="zlib"), objects("spawns", herd()))
        tracemalloc.start()
        try:
            assert "unpacks to more than 400 bytes" in problem(document)
            assert tracemalloc.get_traced_memory()[1] < 5_000_000
        finally:
            tracemalloc.stop()

    def test_a_tile_of_the_wrong_class_is_named_with_its_place(self):
        gids = [GRASS] * 100
        gids[23], gids[35], gids[40] = MARCH, PLAIN, 77
        found = problems(level(tiles(gids=gids), objects("spawns", herd())))
        assert any("tile id 3 at column 3, row 2 must be a Terrain tile, and it is a Brush tile" in p for p in found)
        assert any("tile id 5 at column 5, row 3 must be a Terrain tile, and it has no class" in p for p in found)
        assert any("tile id 77 at column 0, row 4 must be a Terrain tile, and no tileset has it" in p for p in found)

    def test_an_infinite_map_is_as_large_as_what_is_painted(self):
        def chunk(x, y, *cells):
            data = [0] * 256
            for ix, iy, gid in cells:
                data[iy * 16 + ix] = gid
            return {"x": x, "y": y, "width": 16, "height": 16, "data": data}

        chunks = [chunk(-16, -16, (14, 12, WALL)), chunk(0, 0, (3, 1, GRASS))]  # tiles (-2, -4) to (3, 1)
        ground = {"type": "tilelayer", "name": "terrain", "chunks": chunks}
        spawn = thing(1, "Spawn", 0, 0, 16, 16, brush="march", count=1)
        found = read(level(ground, objects("spawns", spawn), infinite=True, width=99, height=99))
        assert (found.width, found.height) == (12, 12)
        assert np.argwhere(~found.terrain.walkable).tolist() == [[5, 0]]
        assert found.spawns[0].polygon.min(axis=0) == pytest.approx([4, 2])

    def test_chunks_worlds_apart_are_refused_before_memory_is_taken(self):
        chunks = [{"x": x, "y": x, "width": 1, "height": 1, "data": [GRASS]} for x in (-5_000_000, 5_000_000)]
        document = level({"type": "tilelayer", "name": "terrain", "chunks": chunks}, objects("spawns", herd()))
        assert "there may be at most 4194304" in problem({**document, "infinite": True})

    def test_an_empty_infinite_map_has_no_size(self):
        assert "an infinite map is as large as what is painted" in problem(
            level(objects("spawns", herd()), infinite=True)
        )

    def test_later_terrain_covers_earlier_and_unpainted_ground_is_plain(self):
        over = [0] * 100
        over[0] = WALL
        under = [0] * 100
        under[0], under[1] = GRASS, GRASS
        ground = read(level(tiles(gids=under), tiles("terrain top", over), objects("spawns", herd()))).terrain
        assert ground.names == ["grass", "wall"]
        assert ground.index[9, :3].tolist() == [1, 0, -1]
        assert ground.walkable[9, :3].tolist() == [False, True, True]

    def test_the_opacity_of_a_brush_layer_and_its_groups_is_its_weight(self):
        painted = tiles("brush soft", [MARCH] + [0] * 99, opacity=0.5)
        group = {"type": "group", "name": "g", "opacity": 0.5, "layers": [painted]}
        layer = read(level(tiles(), group, objects("spawns", herd()))).brush_layers[0]
        assert (layer.name, layer.weight, layer.assets) == ("g/brush soft", 0.25, ["march"])
        assert layer.index[9, 0] == 0
        assert (layer.index >= 0).sum() == 1

    def test_painted_speeds_make_a_cap_and_a_factor(self):
        found = read(level(tiles(), tiles("speed", [SLOW] + [0] * 99), objects("spawns", herd())))
        assert found.cap.values[9, 0] == 1.5
        assert np.isinf(found.cap.values).sum() == 99
        assert found.factor.values[9, 0] == 0.5
        assert found.cap.cell == 2

    def test_a_tileset_may_be_a_file_of_its_own(self):
        document = level(tilesets=[{"firstgid": 1, "source": "kinds.tsj"}])
        found = read(document, {"kinds.tsj": json.dumps(tileset()).encode()})
        assert found.terrain.names == ["grass"]
        assert list(found.files) == ["small.tmj", "kinds.tsj"]
        assert "'kinds.tsj': 'kinds.tsj' is not among the recorded files" in problems(document)[0]

    def test_a_tileset_that_grew_does_not_swallow_the_next_one(self):
        grown = {"firstgid": 1, **tileset(), "tilecount": 64}
        speeds = {"name": "speeds", "tilecount": 1, "tiles": [tileset()["tiles"][3] | {"id": 0}]}
        document = level(tiles(), tiles("speed", [6] * 100), objects("spawns", herd()))
        document["tilesets"] = [grown, {"firstgid": 6, **speeds}]
        assert read(document).cap.values.max() == 1.5


class TestNumbers:
    """Pitfall 4: whole floats come as ints; a bool is never a number."""

    def test_a_whole_float_is_a_number(self):
        spawn = herd()
        spawn["properties"] = [
            {"name": "brush", "type": "string", "value": "march"},
            {"name": "count", "type": "int", "value": 12},
            {"name": "altitude", "type": "float", "value": 8},
        ]
        assert read(level(tiles(), objects("spawns", spawn))).spawns[0].altitude == 8.0

    @pytest.mark.parametrize(
        "value, message",
        [
            (True, "count must be a whole number, got true"),
            (1.5, "count must be a whole number, got 1.5"),
            ("12", "count must be a whole number, got the text '12'; make the property an int"),
            (-3, "count must be at least 0, got -3"),
            (10**9, "count must be at most 1000000, got 1000000000"),
            (0, "count must be at least 1, got 0"),
        ],
    )
    def test_a_count_that_is_none_is_told(self, value, message):
        assert problem(level(tiles(), objects("spawns", herd(count=value)))).endswith(message)

    @pytest.mark.parametrize("word", ["NaN", "Infinity", "-Infinity", "1e999", "9" * 50])
    def test_numbers_that_are_none_are_refused(self, word):
        text = json.dumps(level()).replace('"opacity": 1', f'"opacity": {word}')
        assert "small.tmj:1: " in problem(text, indent=None)

    @pytest.mark.parametrize(
        "heading, radians",
        [("east", 0), ("north", math.pi / 2), ("South-West", 1.25 * math.pi), ("random", None), (-90.0, 1.5 * math.pi)],
    )
    def test_a_heading_is_a_compass_point_or_degrees(self, heading, radians):
        found = read(level(tiles(), objects("spawns", herd(heading=heading)))).spawns[0].heading
        assert found == (None if radians is None else pytest.approx(radians))

    def test_a_heading_that_is_none_is_told(self):
        assert "heading must be random, a compass point or degrees" in problem(
            level(tiles(), objects("spawns", herd(heading="noth")))
        )

    @pytest.mark.parametrize("key, value", [("tilewidth", 0), ("width", -1), ("height", 1.5), ("tileheight", True)])
    def test_a_map_without_size_is_refused(self, key, value):
        assert f"'{key}' must be a whole number from 1 to" in problem(level(**{key: value}))

    def test_tiles_must_be_square_and_the_map_straight(self):
        assert "tiles must be square, got 16 x 8 pixels" in problem(level(tileheight=8))
        assert "the orientation must be orthogonal, got the text 'isometric'" in problem(level(orientation="isometric"))


class TestCaps:
    """Pitfall 5, in part: sizes are capped before memory is taken."""

    def test_too_large_a_map_is_refused(self):
        assert "there may be at most 4194304" in problem(level(width=1_000_000, height=1_000_000))

    def test_too_many_corners_are_refused(self):
        many = polygon(*[(k, k * k) for k in range(limits.CORNERS + 1)])
        assert "the outline has 2001 corners; there may be at most 2000" in problem(
            with_objects("obstacles", thing(2, "Obstacle", 0, 0, extra=many))
        )

    def test_too_many_animals_are_refused(self):
        herds = [thing(k, "Spawn", 0, 0, 160, 160, brush="march", count=600_000, rate=1.0) for k in (1, 2)]
        assert "the spawns together ask for 1200000 animals; there may be at most 1000000" in problem(
            level(tiles(), objects("spawns", *herds))
        )

    def test_deep_nesting_is_refused(self):
        nest = "[" * 100_000
        assert "nested deeper than 64 levels" in problem(f'{{"layers": {nest}')

    def test_too_many_layers_are_refused(self):
        assert "there are more than 256 layers" in problem(level(*[objects("notes")] * 300))


class TestHeight:
    def valley(self, picture, **values):
        layer = {"type": "imagelayer", "name": "height", "image": "hills.png", "properties": properties(**values)}
        return level(tiles(), objects("spawns", herd()), layer), {"hills.png": picture}

    @pytest.mark.parametrize("dtype, top", [(np.uint8, 200), (np.uint16, 60_000)])
    def test_grey_levels_are_metres(self, dtype, top):
        picture = np.zeros((20, 20), dtype)
        picture[0, 5] = top  # the north edge
        raster = read(*self.valley(png(picture), metres_per_level=0.5)).height_map
        assert raster.cell == 1.0
        assert raster.values[19, 5] == top / 2
        assert raster.values.sum() == top / 2

    @pytest.mark.parametrize(
        "picture, message",
        [
            (png(np.zeros((20, 20, 3), np.uint8)), "the picture must be grey, 8 or 16 bit"),
            (png(np.zeros((10, 20), np.uint8)), "must have its proportions, 10 : 10, got 20 x 10 pixels"),
            (png(np.zeros((20, 20), np.uint8))[:60], "the picture is damaged"),
            (b"GIF89a", "this is not a PNG picture"),
            (
                b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR" + struct.pack(">IIBBBBB", 10**6, 10**6, 8, 0, 0, 0, 0) + b"    ",
                "the picture has 1000000 x 1000000 pixels",
            ),
        ],
    )
    def test_a_picture_that_is_no_height_says_why(self, picture, message):
        assert message in problem(*self.valley(picture))


class TestMeaning:
    """What a level may not mean."""

    def test_the_line_is_the_objects_own(self):
        text = json.dumps(level(tiles(data=[GRASS] * 100), objects("spawns", herd(count=0))), indent=1)
        lines = text.splitlines()
        name = next(k for k, words in enumerate(lines, 1) if '"name": "count"' in words)
        line = name - 1  # the property's brace
        assert (
            problem(text) == f"small.tmj:{line}: object 1 'herd A' in layer 'spawns': count must be at least 1, got 0"
        )

    def test_a_level_on_one_line_still_names_the_object(self):
        message = problem(level(tiles(), objects("spawns", herd(count=0))), indent=None)
        assert message == "small.tmj:1: object 1 'herd A' in layer 'spawns': count must be at least 1, got 0"

    def test_everything_wrong_is_told_at_once_in_the_order_of_the_file(self):
        rock = thing(2, "Obstacle", 16, 16, 0, 0, name="rock")
        stone = thing(3, "Obstacle", 16, 16, 32, 32, name="stone", margin=-1.0)
        document = level(tiles(), objects("obstacles", rock, stone), objects("spawns", herd(brush="mrach", count=0)))
        found = problems(document)
        assert [p.split(": ", 2)[1].split(" in ")[0] for p in found] == [
            "object 2 'rock'",
            "object 3 'stone'",
            "object 1 'herd A'",
            "object 1 'herd A'",
        ]
        assert "there is no brush 'mrach'; did you mean 'march'?" in found[2]

    def test_a_level_says_what_it_is(self):
        assert "map: schema is missing; a Flockbrush level says 'flockbrush-level/1'" in problem(level(properties=[]))
        assert "schema must be 'flockbrush-level/1', got 'flockbrush-level/9'" in problem(
            level(properties=properties(schema="flockbrush-level/9"))
        )

    def test_nobody_is_born_in_a_rock(self):
        rock = thing(2, "Obstacle", 16, 16, 142, 142, name="rock")
        assert "lies wholly inside obstacles or on ground that cannot be walked on" in problem(
            with_objects("obstacles", rock)
        )
        assert "on ground that cannot be walked on" in problem(
            level(tiles(gids=[WALL] * 100), objects("spawns", herd()))
        )
        through = thing(2, "Obstacle", 16, 16, 142, 142, solid=False)
        assert read(with_objects("obstacles", through)).agents == 12

    def test_animals_must_have_room(self):
        small = thing(1, "Spawn", 16, 16, 16, 16, "herd", brush="march", count=40)
        assert "40 animals 1 m long do not fit on 4 m^2 of free ground; there is room for 6" in problem(
            level(tiles(), objects("spawns", small))
        )

    def test_density_becomes_a_count(self):
        spawn = thing(1, "Spawn", 32, 32, 128, 96, brush="march", density=0.25)
        assert read(level(tiles(), objects("spawns", spawn))).spawns[0].count == 48  # 16 x 12 m
        assert "give count or density, not both" in problem(level(tiles(), objects("spawns", herd(density=0.25))))

    def test_a_spawn_with_a_rate_may_go_on_for_ever(self):
        spawn = read(level(tiles(), objects("spawns", herd(count=0, rate=2.0)))).spawns[0]
        assert (spawn.count, spawn.rate) == (0, 2.0)

    def test_one_animal_is_a_herd(self):
        assert read(level(tiles(), objects("spawns", herd(count=1)))).agents == 1

    def test_a_level_without_animals_says_how_to_get_some(self):
        assert "no animals: draw an area on an object layer 'spawns', of class Spawn" in problem(level(tiles()))

    def test_things_beyond_the_map_are_told(self):
        arrow = thing(2, "Guide", 16, 400, extra=polyline((0, 0), (64, 0)))
        assert "lies outside of the map, which is 20 x 20 m: x from 2.0 to 10.0, y from -30.0 to -30.0" in problem(
            with_objects("guides", arrow)
        )
        spawn = thing(1, "Spawn", -16, 32, 128, 96, brush="march", count=3)
        assert "reaches outside of the map" in problem(level(tiles(), objects("spawns", spawn)))
        through = thing(2, "Guide", -16, 80, extra=polyline((0, 0), (300, 0)))
        assert len(read(with_objects("guides", through)).guides) == 1

    def test_goals_lead_to_goals(self):
        def goals(**second):
            first = thing(2, "Goal", 80, 80, name="ford", extra={"point": True}, on_arrive="next", next="fold")
            return with_objects("goals", first, thing(3, "Goal", 20, 20, extra={"point": True}, **second))

        assert read(goals(name="fold")).goals[0].next == "fold"
        assert "next: there is no goal 'fold'; did you mean 'fould'?" in problem(goals(name="fould"))
        assert "two goals are called 'ford'; object 2 is the other" in problems(goals(name="ford"))[1]
        lost = thing(4, "Goal", 80, 80, name="x", extra={"point": True}, on_arrive="next")
        assert "on_arrive is 'next', so next must name a goal" in problem(with_objects("goals", lost))

    def test_a_zone_that_does_nothing_is_told(self):
        assert "does nothing; give it a brush, a max_speed, a factor or an event" in problem(
            with_objects("zones", thing(2, "Zone", 16, 16, 32, 32))
        )
        zone = read(with_objects("zones", thing(2, "Zone", 16, 16, 32, 32, max_speed=2.0))).zones[0]
        assert (zone.brush, zone.max_speed, zone.factor) == (None, 2.0, 1.0)

    def test_an_id_is_taken_once(self):
        assert "object id 1 is taken by the object at line" in problem(
            with_objects("obstacles", thing(1, "Obstacle", 16, 16, 32, 32))
        )

    def test_measures_have_names_of_their_own(self):
        lines = [thing(k, "Line", 16, 16, name="gate", extra=polyline((0, 0), (64, 0))) for k in (2, 3)]
        assert "two measures are called 'gate'" in problem(with_objects("measure", *lines))

    def test_a_template_must_be_detached(self):
        assert "templates are not read; detach it" in problem(
            with_objects("obstacles", {"id": 2, "template": "rock.tj", "x": 16, "y": 16})
        )


class TestScript:
    def script(self, extra=None, **values):
        key = thing(2, "Key", 80, 80, name="storm", extra={"point": True} if extra is None else extra, **values)
        return with_objects("script", key)

    def test_a_command_takes_its_place_from_the_object(self):
        key = read(self.script(at=3.0, command="Gust", strength=2.0)).script[0]
        assert (key.at, key.command) == (3.0, "Gust")
        assert key.args == {"strength": 2.0, "x": 10.0, "y": 10.0}

    def test_an_area_gives_its_radius_too(self):
        circle = {"ellipse": True, "width": 32, "height": 32}
        key = read(self.script(circle, command="Gust", strength=2.0)).script[0]
        assert key.args["radius"] == pytest.approx(2, rel=0.01)
        assert [key.args["x"], key.args["y"]] == pytest.approx([12, 8])

    @pytest.mark.parametrize(
        "values, message",
        [
            ({"command": "Gost", "strength": 1.0}, "there is no command 'Gost'; did you mean 'Gust'?"),
            ({"command": "Gust"}, "Gust needs the property 'strength'"),
            ({"strength": 1.0}, "command is missing"),
            ({"command": "Gust", "strength": "much"}, "strength must be a number, got the text 'much'"),
            ({"command": "Gust", "strength": True}, "strength must be a number, got true"),
            ({"command": "Gust", "strength": 1.0, "brush": "mach"}, "there is no brush 'mach'; did you mean 'march'?"),
            ({"command": "Gust", "strength": 1.0, "radios": 2}, "Gust has no 'radios'; did you mean 'radius'?"),
        ],
    )
    def test_a_script_that_cannot_run_is_told(self, values, message):
        assert message in problem(self.script(**values))

    @pytest.mark.parametrize("command", ["Migrate", "Gust", "RemoveAnimals"])
    def test_a_species_that_nobody_is_of_is_told_when_the_level_is_read(self, command):
        def told(*script):
            keys = [thing(k, "Key", 80, 80, extra={"point": True}, **v) for k, v in enumerate(script, 2)]
            data = json.dumps(with_objects("script", *keys)).encode()
            try:
                read_level_files({"small.tmj": data}, library=Shelf(), commands=COMMANDS)
            except ProblemsError as error:
                return str(error)
            return ""

        values = {"command": command, "radius": 5.0, "z": 1.0, "species": "aminal"}
        values = {k: v for k, v in values.items() if (command, k) != ("RemoveAnimals", "z")}
        assert "species: there is no species 'aminal'; there are animal" in told(values)
        assert told(values | {"species": "animal"}) == told(values | {"species": ""}) == ""
        added = {"command": "AddAnimals", "brush": "march", "radius": 5.0, "species": "aminal"}
        assert told(values, added) == ""


class TestNoLevel:
    def test_a_map_in_tmx_that_is_no_level_names_what_makes_one(self):
        for text in ('<?xml version="1.0"?><map/>', "<map version='1.8'/>"):
            assert problems(text)[0] == (
                "small.tmj:1: map: schema is missing; a Flockbrush level says 'flockbrush-level/1'"
                "; to make a level of another map: flockbrush level adopt FILE"
            )

    @pytest.mark.parametrize(
        "text, message",
        [
            ("", "small.tmj:1: not valid JSON: expecting value, found the end of the file"),
            ("[]", "small.tmj:1: this is not a Tiled map: expected an object, got a list"),
            ('{"type": "tileset"}', "small.tmj:1: this is not a Tiled map: its type is the text 'tileset'"),
            ('{"a": 1\n "b"}', "small.tmj:2: not valid JSON: expecting ',' delimiter, found '\"'"),
            ('{"a": 1,\n\n "a": 2}', "small.tmj:3: 'a' is given twice in one object"),
            ('{"a": "\\ud800"}', "small.tmj:1: half a character (a lone surrogate) in a text"),
            (b'{"a":\n"\xff"}', "small.tmj:2: this is not UTF-8 text"),
        ],
    )
    def test_what_is_no_level_says_what_it_is(self, text, message):
        assert problem(text) == message

    def test_hostile_names_stay_on_their_line(self):
        spawn = herd(count=0)
        spawn["name"] = "a\nb: fake: \x1b[31m"
        assert "\n" not in problem(level(tiles(), objects("spawns", spawn)))

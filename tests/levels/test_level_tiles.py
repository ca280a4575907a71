"""What tiles say of the ground, in whatever way Tiled keeps them."""

import base64
import gzip
import json
import tracemalloc
import zlib

import cv2
import numpy as np
import pytest
from small_level import (
    GRASS,
    MARCH,
    PLAIN,
    SLOW,
    WALL,
    herd,
    level,
    objects,
    problem,
    problems,
    read,
    thing,
    tiles,
    tileset,
)


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
            (
                {"encoding": "base64", "compression": "zstd"},
                "zstd is not supported; set Map > Tile Layer Format to CSV",
            ),
            ({"encoding": "base32"}, "unknown tile data encoding 'base32'; available: csv, base64"),
            ({"encoding": "base64", "compression": "lzma"}, "unknown tile data compression 'lzma'"),
            ({"encoding": "base64"}, "base64 tile data must be a string"),
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
        assert any("tile id 3 at column 3, row 2 must be a Terrain tile, but it is a Brush tile" in p for p in found)
        assert any("tile id 5 at column 5, row 3 must be a Terrain tile, but it has no class" in p for p in found)
        assert any("tile id 77 at column 0, row 4 must be a Terrain tile, but no tileset has it" in p for p in found)

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
        assert "an infinite map is as large as its painted area" in problem(
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

    def test_a_tileset_without_a_number_of_tiles_is_measured_whenever_it_is_read(self):
        old = {"name": "old", "image": "old.png", "tilewidth": 16, "tileheight": 16}
        files = {"old.tsj": json.dumps(old | {"tiles": tileset()["tiles"]}).encode()}
        document = level(tiles("terrain", [6] * 100), objects("spawns", herd()))
        document["tilesets"].append({"firstgid": 6, "source": "old.tsj"})
        small, large = (cv2.imencode(".png", np.zeros((16, 16 * n, 4), np.uint8))[1].tobytes() for n in (1, 8))
        assert any("picture 'old.png'" in said for said in problems(document, files))
        assert "whole number from 0 to 0, got 3" in problems(document, files | {"old.png": small})[-1]
        assert read(document, files | {"old.png": large}).terrain.names == ["grass"]

    def test_a_tileset_that_grew_does_not_swallow_the_next_one(self):
        grown = {"firstgid": 1, **tileset(), "tilecount": 64}
        speeds = {"name": "speeds", "tilecount": 1, "tiles": [tileset()["tiles"][3] | {"id": 0}]}
        document = level(tiles(), tiles("speed", [6] * 100), objects("spawns", herd()))
        document["tilesets"] = [grown, {"firstgid": 6, **speeds}]
        assert read(document).cap.values.max() == 1.5

    def test_a_collection_of_pictures_may_have_gaps_in_its_ids(self):
        meaning = tileset()["tiles"][3]
        gaps = {"name": "things", "tilecount": 2, "columns": 0, "tiles": [meaning | {"id": 0}, meaning | {"id": 5}]}
        document = level(tiles(), tiles("speed", [11] * 100), objects("spawns", herd()))
        document["tilesets"].append({"firstgid": 6, **gaps})
        assert read(document).cap.values.max() == 1.5
        document["tilesets"][1]["columns"] = 2
        assert "'id' must be a whole number from 0 to 1, got 5" in problems(document)[0]


def test_two_tilesets_that_begin_at_the_same_tile_are_told_for_the_map():
    document = level(tiles(), objects("spawns", herd()))
    document["tilesets"].append({"firstgid": 1, **tileset(), "name": "second"})
    said = problem(document)
    assert said.startswith("small.tmj") and said.endswith("two tilesets begin at tile id 1, one of them 'second'")

"""The artwork of a map looks as Tiled draws it, and rules give its tiles a meaning."""

import os
import shutil
import subprocess

import cv2
import numpy as np
import pytest
from flockbrush.engine import limits
from flockbrush.levels.adopt import adopt
from flockbrush.levels.art import ArtLayer, composite, read_art
from flockbrush.levels.ground_rules import GroundRules, TileFacts, suggest_rules
from foreign_maps import EXAMPLES, OF_TILED, foreign_map
from small_level import herd, level, objects, problems, properties, read, tiles, tileset

tiled = pytest.mark.skipif(shutil.which("tmxrasterizer") is None, reason="Tiled is not installed")
examples = pytest.mark.skipif(not (EXAMPLES / "desert.tmx").is_file(), reason="Tiled's examples are not installed")


@tiled
@pytest.mark.tools
@pytest.mark.parametrize("name", sorted(OF_TILED))
@pytest.mark.parametrize("of_tiled", [False, pytest.param(True, marks=examples)])
def test_the_picture_is_the_one_that_tiled_draws(name, of_tiled, tmp_path):
    path = foreign_map(name, tmp_path / "maps", of_tiled)
    environment = {**os.environ, "QT_QPA_PLATFORM": "offscreen"}
    out = tmp_path / "tiled.png"
    command = ["tmxrasterizer", "--hide-layer", "Objects", str(path), str(out)]
    subprocess.run(command, env=environment, check=True, capture_output=True, timeout=60)
    theirs = read_art(out.read_bytes()).astype(int)
    art = adopt(path, tmp_path / "maps" / "new.tmj").level.art
    for layer in art.layers:
        layer.objects = []  # tmxrasterizer draws objects that are no tiles as well, so that layer is left out
    ours = art.picture.astype(int)
    assert ours.shape == theirs.shape
    assert np.abs(ours - theirs).max() <= 3  # of 255; both round


class TestTilesOfATurnedKind:
    def sheet(self):
        tile = np.zeros((16, 16, 4), np.uint8)
        tile[:] = (10, 20, 30, 255)
        tile[:4, :8] = (200, 100, 50, 255)
        return tile

    @pytest.mark.parametrize(
        ("flags", "turned"),
        [
            (0, lambda t: t),
            (0x80000000, lambda t: t[:, ::-1]),
            (0x40000000, lambda t: t[::-1]),
            (0xA0000000, lambda t: np.rot90(t, -1)),
            (0x60000000, lambda t: np.rot90(t)),
            (0xC0000000, lambda t: np.rot90(t, 2)),
        ],
    )
    def test_flags_turn_and_mirror(self, flags, turned):
        picture = cv2.imencode(".png", self.sheet())[1].tobytes()
        document = level(tiles(), tiles("artwork", [0] * 57 + [6 | flags] + [0] * 42), objects("spawns", herd()))
        own = {"name": "own", "image": "own.png", "columns": 1, "tilecount": 1, "tilewidth": 16, "tileheight": 16}
        document["tilesets"].append({"firstgid": 6, **own})
        art = read(document, {"own.png": picture}).art
        assert np.array_equal(art.picture[80:96, 112:128], turned(self.sheet()))
        assert not art.picture[:80].any()

    def test_a_huge_map_is_drawn_smaller(self, monkeypatch):
        monkeypatch.setattr(limits, "ART_PIXELS", limits.Limit(40 * 40, "pixels", "artwork"))
        picture = cv2.imencode(".png", self.sheet())[1].tobytes()
        document = level(tiles(), tiles("artwork", [6] * 100), objects("spawns", herd()))
        own = {"name": "own", "image": "own.png", "columns": 1, "tilecount": 1, "tilewidth": 16, "tileheight": 16}
        document["tilesets"].append({"firstgid": 6, **own})
        art = read(document, {"own.png": picture}).art
        assert art.side == 4 and art.picture.shape == (40, 40, 4)


class TestWhatIsArt:
    def with_layer(self, name, gids=None, **more):
        return level(tiles(), tiles(name, gids or [5] * 100, **more), objects("spawns", herd()))

    def test_a_layer_of_another_name_is_art_and_means_nothing(self):
        found = read(self.with_layer("houses"))
        assert [layer.name for layer in found.art.layers] == ["houses"]
        assert found.terrain.walkable.all() and read(level()).art is None

    def test_a_name_near_ours_is_a_mistake_as_before(self):
        assert "layer 'terain': no such layer; did you mean 'terrain'?" in problems(self.with_layer("terain"))[0]

    def test_a_hidden_layer_is_not_drawn_and_notes_are_not(self):
        assert read(self.with_layer("houses", visible=False)).art is None
        assert read(self.with_layer("notes of mine")).art is None

    def test_in_a_group_of_ours_are_our_layers_and_no_others(self):
        group = {"type": "group", "name": "flockbrush", "layers": [tiles(), objects("spawns", herd())]}
        theirs = {"id": 9, "name": "", "type": "start", "x": 1, "y": 1, "point": True}
        document = level(tiles("terrain", [5] * 100), objects("spawns", theirs), group)
        found = read(document)
        assert [layer.name for layer in found.art.layers] == ["terrain"]
        assert len(found.spawns) == 1 and found.terrain.names == ["grass"]

    def test_only_beside_a_group_of_ours_a_map_may_have_properties_of_its_own(self):
        of_game = properties(music="theme.ogg", boundry="open")
        group = {"type": "group", "name": "flockbrush", "layers": [tiles(), objects("spawns", herd())]}
        document = level(group)
        document["properties"] += of_game
        found = read(document)
        (warning,) = map(str, found.warnings)
        assert "property 'boundry' has no effect on the level; did you mean 'boundary'?" in warning
        document = level()
        document["properties"] += of_game
        assert "FlockbrushLevel has no property 'music'" in problems(document)[0]

    def test_adoption_leaves_the_properties_of_a_map_as_they_are(self, tmp_path):
        path = foreign_map("sewers", tmp_path / "maps")
        music = '<properties><property name="music" value="theme.ogg"/></properties><tileset '
        path.write_text(path.read_text().replace("<tileset ", music, 1))
        document = adopt(path).document
        assert {"name": "music", "type": "string", "value": "theme.ogg"} in document["properties"]

    def test_a_lost_picture_is_a_warning(self):
        document = self.with_layer("houses", [6] * 100)
        own = {"name": "own", "image": "gone.png", "columns": 1, "tilecount": 1, "tilewidth": 16, "tileheight": 16}
        document["tilesets"].append({"firstgid": 6, **own})
        found = read(document)
        assert "picture 'gone.png' cannot be drawn" in str(found.warnings[0])
        assert not found.art.picture.any()

    def test_a_picture_that_is_none_draws_nothing(self):
        assert read_art(b"GIF89a") is None and read_art(b"") is None


def test_a_picture_that_reaches_over_the_edge_is_cut():
    canvas, spot = np.zeros((4, 4, 4), np.uint8), np.full((3, 3, 4), 255, np.uint8)
    composite(canvas, spot, -2, 3)
    assert canvas[:, :, 3].tolist() == [[0] * 4, [0] * 4, [0] * 4, [255, 0, 0, 0]]
    composite(canvas, spot, 9, 9)
    assert ArtLayer("x", 1.0, 0, 0).gids is None


class TestObjectsAndTints:
    """The numbers are those of Tiled's own pictures."""

    def drawn(self, *layers, **more):
        picture = cv2.imencode(".png", np.full((16, 16, 4), (255, 255, 200, 255), np.uint8))[1].tobytes()
        document = level(tiles(), objects("spawns", herd()), *layers)
        own = {"name": "own", "image": "own.png", "columns": 1, "tilecount": 1, "tilewidth": 16, "tileheight": 16}
        document["tilesets"].append({"firstgid": 6, **own, **more})
        return read(document, {"own.png": picture}).art.picture

    def decor(self, *things, **more):
        things = [
            {"id": 5 + k, "gid": 6, "x": 48, "y": 48, "width": 32, "height": 16, **o} for k, o in enumerate(things)
        ]
        return objects("decor of mine", *things, **more)

    def box(self, picture):
        rows, columns = np.nonzero(picture[:, :, 3] > 127)
        return int(columns.min()), int(rows.min()), int(columns.max()), int(rows.max())

    def test_the_tint_of_a_group_tints_its_layers(self):
        layer = tiles("artwork", [6] * 100, tintcolor="#ff8000")
        group = {"type": "group", "name": "g", "layers": [layer], "tintcolor": "#8040ff"}
        assert self.drawn(group)[0, 0].tolist() == [0, 32, 100, 255]

    @pytest.mark.parametrize(
        ("alignment", "box"),
        [("unspecified", (48, 32, 79, 47)), ("center", (32, 40, 63, 55)), ("topright", (16, 48, 47, 63))],
    )
    def test_an_object_stands_as_its_tileset_aligns_it(self, alignment, box):
        assert self.box(self.drawn(self.decor({"rotation": 0}), objectalignment=alignment)) == box

    def test_a_turned_object_is_shifted_with_its_tileset(self):
        picture = self.drawn(self.decor({"rotation": 30}), objectalignment="center", tileoffset={"x": 4, "y": 2})
        assert self.box(picture) == (36, 39, 70, 67)

    @pytest.mark.parametrize(("order", "upper"), [("topdown", "own"), ("index", "wall")])
    def test_objects_lie_in_the_order_of_their_layer(self, order, upper):
        document = level(tiles(), objects("spawns", herd()), self.decor({"y": 64}, {"gid": 2}, draworder=order))
        document["tilesets"].append({"firstgid": 6, "name": "own", "tilecount": 1, "columns": 1})
        last = read(document).art.layers[0].objects[-1]
        assert last.gid == {"own": 6, "wall": 2}[upper]


class TestRules:
    def told(self, text, tiles_of, layer_name="houses", **more):
        document = level(tiles(layer_name, [6] * 50 + [7] * 50), objects("spawns", herd(count=1)))
        document["properties"] = properties(schema="flockbrush-level/1", metres_per_tile=2.0, ground_rules=text)
        own = {
            "name": "own",
            "tilecount": 2,
            "columns": 2,
            "tilewidth": 16,
            "tileheight": 16,
            "tiles": tiles_of,
            **more,
        }
        document["tilesets"].append({"firstgid": 6, **own})
        return document

    def ground(self, *arguments, **more):
        return read(self.told(*arguments, **more)).terrain

    @pytest.mark.parametrize(
        ("rule", "tile"),
        [
            ("class Water = deep water", {"id": 0, "type": "Water"}),
            ("class water = walkable=false", {"id": 0, "type": "Water"}),
            ("property wet = deep water", {"id": 0, "properties": properties(wet=True)}),
            ("property depth:deep = walkable=false", {"id": 0, "properties": properties(depth="deep")}),
            ("property walkable:false = walkable=false", {"id": 0, "properties": properties(walkable=False)}),
            ("collision = walkable=false", {"id": 0, "objectgroup": {"objects": [{"id": 1}]}}),
            ("tileset own 0 = cliff", {"id": 0}),
            ("tileset own 0-0, 5 = walkable=false, blocks_view=true", {"id": 0}),
        ],
    )
    def test_a_rule_makes_ground_of_tiles(self, rule, tile):
        ground = self.ground(rule, [tile])
        assert not ground.walkable[5:].any() and ground.walkable[:5].all()  # the south row first

    def test_a_layer_and_a_terrain_can_be_named(self):
        assert (self.ground("layer houses = mud", []).speed_factor == 0.5).all()
        colours = {"colors": [{"name": "Sea"}, {"name": "Land"}], "wangtiles": [{"tileid": 1, "wangid": [0, 1] * 4}]}
        ground = self.ground("terrain sea = deep water", [], wangsets=[colours])
        assert ground.walkable[5:].all() and not ground.walkable[:5].any()

    def test_a_value_can_come_from_the_property(self):
        tile = {"id": 0, "properties": properties(speed=0.25)}
        ground = self.ground("property speed = speed_factor=property", [tile])
        assert (ground.speed_factor[5:] == 0.25).all() and (ground.speed_factor[:5] == 1).all()

    def test_the_first_rule_counts_and_comments_do_not(self):
        text = "# of the map\n\ntileset own 0 = mud\ntileset own = cliff"
        ground = self.ground(text, [])
        assert (ground.speed_factor[5:] == 0.5).all() and not ground.walkable[:5].any()
        assert ground.names == ["mud", "cliff"]

    def test_what_is_painted_in_our_own_layer_counts_above_rules(self):
        document = self.told("tileset own 0 = cliff", [])
        document["layers"].append(tiles("terrain", [1] * 10 + [0] * 90))
        found = read(document)
        assert found.terrain.walkable[9].all() and not found.terrain.walkable[5:9].any()
        assert found.art.painted[9].all() and not found.art.painted[:9].any()

    @pytest.mark.parametrize(
        ("rule", "message"),
        [
            ("water", "a rule is 'CONDITION = GROUND'"),
            ("clas Water = mud", "there is no condition 'clas'; did you mean 'class'?"),
            ("class = mud", "class needs a name"),
            ("class Water = watr", "there is no ground 'watr'; did you mean 'water'?"),
            ("class Water = walkabel=false", "ground has no 'walkabel'; did you mean 'walkable'?"),
            ("class Water = walkable=perhaps", "walkable must be true or false"),
            ("class Water = cost=cheap", "cost must be a number, got 'cheap'"),
            ("class Water = cost=0", "cost must be at least 0.01"),
            ("class Water = cost=nan", "cost must be a number"),
            ("class Water = cost=property", "only a rule for a property"),
            ("tileset own 0-999999999 = mud", "too many tiles"),
        ],
    )
    def test_a_rule_that_is_none_is_told(self, rule, message):
        found = problems(self.told(rule, []))
        assert len(found) == 1 and message in found[0] and "ground_rules: " in found[0]

    @pytest.mark.parametrize("rule", ["tileset own 3 = mud", ""])
    def test_a_tile_whose_number_is_none_is_told(self, rule):
        assert "'id' must be a whole number from 0 to 1, got a list" in problems(self.told(rule, [{"id": [1]}]))[0]

    @pytest.mark.parametrize(
        ("rule", "message"),
        [
            ("class Watr", "there is no class 'Watr'; did you mean 'Water'?"),
            ("property Deep", "there is no property 'Deep'; did you mean 'deep'?"),
            ("property deep:flase", "no tile has the value 'flase'; did you mean 'false'?"),
            ("terrain Raod", "there is no terrain 'Raod'; did you mean 'Road'?"),
            ("tileset onw 1", "there is no tileset 'onw'; available: kinds, own"),
            ("tileset own 2-9", "tileset 'own' has no such tile"),
            ("layer house", "there is no layer 'house'; did you mean 'houses'?"),
            ("collision", "no tile has a collision shape"),
        ],
    )
    def test_a_rule_that_matches_nothing_is_a_warning(self, rule, message):
        tile = {"id": 0, "type": "Water", "properties": properties(deep=False)}
        document = self.told(f"{rule} = mud", [tile], wangsets=[{"colors": [{"name": "Road"}], "wangtiles": []}])
        (said,) = read(document).warnings
        assert f"warning: ground_rules: {rule!r} matches nothing: {message}" in str(said) and said.line > 1

    @pytest.mark.parametrize(
        "rule", ["class water", "property deep:False", "terrain road", "tileset own 1-9", "layer Houses", "tileset own"]
    )
    def test_a_rule_that_names_what_there_is_is_none(self, rule):
        tile = {"id": 0, "type": "Water", "properties": properties(deep=False)}
        document = self.told(f"{rule} = mud", [tile], wangsets=[{"colors": [{"name": "Road"}], "wangtiles": []}])
        assert read(document).warnings == []

    @pytest.mark.parametrize(("rule", "kinds"), [("tileset own 2", ["road"]), ("tileset own 2 1", ["road"])])
    def test_a_tileset_may_have_a_name_that_ends_in_a_number(self, rule, kinds):
        found = read(self.told(f"{rule} = road", [], name="own 2"))
        assert found.terrain.names == kinds and found.warnings == []
        assert (found.terrain.index >= 0).sum() == (100 if rule == "tileset own 2" else 50)

    def test_a_value_of_a_tile_that_does_not_fit_is_told_once_and_later_rules_count(self):
        told = []
        rules = GroundRules("property speed = speed_factor=property\nclass Road = road", told.append)
        facts = TileFacts("art", 3, {"type": "Road", "properties": properties(speed=50.0)}, set())
        assert [rules.ground("x", facts)["name"] for _ in range(2)] == ["road"] * 2
        assert told == [
            "ground_rules: property speed: tile 3 of tileset 'art': speed_factor must be at most 10, got 50"
        ]

    def test_rules_that_the_tiles_do_not_fit_are_not_suggested(self):
        sheet = {
            **tileset(),
            "tiles": [{"id": k, "properties": properties(speed=v)} for k, v in enumerate((1.0, 50.0))],
        }
        assert suggest_rules([sheet], []) == []

    def test_there_may_be_as_many_rules_as_the_documentation_says(self):
        assert self.ground("\n".join(f"layer {'x' * 900} {k} = cliff" for k in range(100)), []) is None
        assert "more than 100 rules" in problems(self.told("\n".join(["layer x = cliff"] * 101), []))[0]

    def test_names_in_a_map_suggest_rules(self):
        wang = [{"colors": [{"name": "Sand"}, {"name": "Plasma"}]}]
        walls, solid = {"properties": properties(walkable=False)}, {"objectgroup": {"objects": [{}]}}
        sheet = {**tileset(), "wangsets": wang, "tiles": [{"type": "Water"}, walls, solid]}
        rules = suggest_rules([sheet], ["Walls", "Ground"])
        assert rules == [
            "class Water = deep water",
            "property walkable:false = walkable=false",
            "collision = walkable=false",
            "terrain Sand = sand",
            "layer Walls = cliff",
        ]
        assert GroundRules("\n".join(rules), pytest.fail).ground("x", TileFacts("", 0, {"type": "Water"}, set()))

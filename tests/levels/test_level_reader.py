"""What a designer draws is what the animals get, and what cannot be is told in words."""

import json
import math
import struct

import flockbrush.levels.build  # noqa: F401  all commands are known
import numpy as np
import pytest
from flockbrush.engine import limits
from flockbrush.engine.commands import COMMANDS
from flockbrush.engine.problems import ProblemsError
from flockbrush.levels.reader import read_level_files
from small_level import (
    GRASS,
    WALL,
    Shelf,
    herd,
    level,
    objects,
    png,
    polygon,
    polyline,
    problem,
    problems,
    properties,
    read,
    thing,
    tiles,
    with_objects,
)


def herd_problem(**properties):
    return problem(level(tiles(), objects("spawns", herd(**properties))))


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
        assert "has no class; set one of Obstacle, Guide" in problem(with_objects("things", plain))

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

    @pytest.mark.parametrize("name", ["notes old", "decor"])
    def test_objects_of_a_class_on_such_layers_are_ignored_too(self, name):
        old = objects(name, thing(2, "Spawn", 16, 16, 32, 32, brush="march", count=10))
        assert len(read(level(tiles(), objects("spawns", herd()), old)).spawns) == 1
        group = {"type": "group", "name": "flockbrush", "layers": [tiles(), objects("spawns", herd()), old]}
        group["layers"].append(tiles("decor stones", [5] * 100))
        found = read(level(group))
        assert len(found.spawns) == 1 and [layer.name for layer in found.art.layers] == ["flockbrush/decor stones"]

    def test_unknown_classes_properties_and_layers_ask_did_you_mean(self):
        assert "there is no class 'Obstical'; did you mean 'Obstacle'?" in problem(
            with_objects("obstacles", thing(2, "Obstical", 16, 16, 32, 32))
        )
        assert "Spawn has no property 'cuont'; did you mean 'count'?" in herd_problem(cuont=3)
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
        assert "goal: object 1 is not a Goal" in problem(document)


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
        assert herd_problem(count=value).endswith(message)

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
        assert "heading must be random, a compass point or degrees" in herd_problem(heading="noth")

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
        assert "the spawns have 1200000 animals in total; the maximum is 1000000" in problem(
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
        assert "map: schema is missing; a Flockbrush level has 'flockbrush-level/1'" in problem(level(properties=[]))
        assert "schema 'flockbrush-level/9' is of a newer Flockbrush; this one reads 'flockbrush-level/1'" in problem(
            level(properties=properties(schema="flockbrush-level/9"))
        )

    def test_nobody_is_born_in_a_rock(self):
        rock = thing(2, "Obstacle", 16, 16, 142, 142, name="rock")
        assert "is completely inside obstacles or on ground that is not walkable" in problem(
            with_objects("obstacles", rock)
        )
        assert "on ground that is not walkable" in problem(level(tiles(gids=[WALL] * 100), objects("spawns", herd())))
        through = thing(2, "Obstacle", 16, 16, 142, 142, solid=False)
        assert read(with_objects("obstacles", through)).agents == 12

    def test_animals_must_have_room(self):
        small = thing(1, "Spawn", 16, 16, 16, 16, "herd", brush="march", count=40)
        assert "40 animals 1 m long do not fit on 4 m^2 of free ground; at most 6 fit" in problem(
            level(tiles(), objects("spawns", small))
        )

    def test_density_becomes_a_count(self):
        spawn = thing(1, "Spawn", 32, 32, 128, 96, brush="march", density=0.25)
        assert read(level(tiles(), objects("spawns", spawn))).spawns[0].count == 48  # 16 x 12 m
        assert "give count or density, not both" in herd_problem(density=0.25)

    def test_a_spawn_with_a_rate_may_go_on_for_ever(self):
        spawn = read(level(tiles(), objects("spawns", herd(count=0, rate=2.0)))).spawns[0]
        assert (spawn.count, spawn.rate) == (0, 2.0)

    def test_one_animal_is_a_herd(self):
        assert read(level(tiles(), objects("spawns", herd(count=1)))).agents == 1

    def test_a_level_without_animals_says_how_to_get_some(self):
        assert "no animals: draw an area on an object layer 'spawns', of class Spawn" in problem(level(tiles()))

    def test_things_beyond_the_map_are_told(self):
        arrow = thing(2, "Guide", 16, 400, extra=polyline((0, 0), (64, 0)))
        assert "is outside the map, which is 20 x 20 m: x from 2.0 to 10.0, y from -30.0 to -30.0" in problem(
            with_objects("guides", arrow)
        )
        spawn = thing(1, "Spawn", -16, 32, 128, 96, brush="march", count=3)
        assert "extends outside the map" in problem(level(tiles(), objects("spawns", spawn)))
        through = thing(2, "Guide", -16, 80, extra=polyline((0, 0), (300, 0)))
        assert len(read(with_objects("guides", through)).guides) == 1

    def test_goals_lead_to_goals(self):
        def goals(**second):
            first = thing(2, "Goal", 80, 80, name="ford", extra={"point": True}, on_arrive="next", next="fold")
            return with_objects("goals", first, thing(3, "Goal", 20, 20, extra={"point": True}, **second))

        assert read(goals(name="fold")).goals[0].next == "fold"
        assert "next: there is no goal 'fold'; did you mean 'fould'?" in problem(goals(name="fould"))
        assert "two goals have the name 'ford'; the other is object 2" in problems(goals(name="ford"))[1]
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
        assert "two measures have the name 'gate'" in problem(with_objects("measure", *lines))

    def test_a_template_must_be_detached(self):
        assert "templates are not supported; detach the object" in problem(
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

    @pytest.mark.parametrize("command", ["Migrate", "RemoveAnimals"])
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
        assert "species: there is no species 'aminal'; available: animal" in told(values)
        assert told(values | {"species": "animal"}) == told(values | {"species": ""}) == ""
        added = {"command": "AddAnimals", "brush": "march", "radius": 5.0, "species": "aminal"}
        assert told(values, added) == ""

    def test_a_key_may_name_a_goal_or_a_brush_that_an_earlier_one_brings(self):
        def read_with(*script, **drawn):
            told = [{"properties": properties(**values)} for values in script]
            keys = [thing(k, "Key", 80, 80, extra=drawn | one) for k, one in enumerate(told, 2)]
            data = json.dumps(with_objects("script", *keys)).encode()
            return read_level_files({"small.tmj": data}, library=Shelf(), commands=COMMANDS)

        place = {"at": 0.2, "command": "PlaceGoal", "id": 77, "name": "there"}
        send = {"at": 0.5, "command": "SendTo", "goal": "there"}
        found = read_with(place, send, point=True)
        assert found.script[0].args == {"id": 77, "name": "there", "x": 10.0, "y": 10.0}
        with pytest.raises(ProblemsError, match="goal: there is no goal 'there'"):
            read_with(send, point=True)
        with pytest.raises(ProblemsError, match="AddObstacle needs an area or a line"):
            read_with({"command": "AddObstacle", "name": "gate"}, point=True)
        come = {"at": 0.5, "command": "AddAnimals", "brush": "new", "radius": 4.0}
        assert read_with({"at": 0.2, "command": "UseBrush", "name": "new", "source": "schema"}, come, point=True)
        with pytest.raises(ProblemsError, match="brush: there is no brush 'new'"):
            read_with(come, point=True)


class TestNoLevel:
    def test_a_map_in_tmx_that_is_no_level_names_what_makes_one(self):
        for text in ('<?xml version="1.0"?><map/>', "<map version='1.8'/>"):
            assert problems(text)[0] == (
                "small.tmj:1: map: schema is missing; a Flockbrush level has 'flockbrush-level/1'"
                "; to make a level of another map: flockbrush level adopt FILE"
            )

    @pytest.mark.parametrize(
        "text, message",
        [
            ("", "small.tmj:1: this file is empty; expected a Tiled map"),
            ("[]", "small.tmj:1: this is not a Tiled map: expected an object, got a list"),
            ('{"type": "tileset"}', "small.tmj:1: this is not a Tiled map: its type is the text 'tileset'"),
            ('{"a": 1\n "b"}', "small.tmj:2: not valid JSON: expecting ',' delimiter, found '\"'"),
            ('{"a": 1,\n\n "a": 2}', "small.tmj:3: 'a' is given twice in one object"),
            ('{"a": "\\ud800"}', "small.tmj:1: incomplete character (a lone surrogate) in a string"),
            (b'{"a":\n"\xff"}', "small.tmj:2: this is not UTF-8 text"),
        ],
    )
    def test_what_is_no_level_says_what_it_is(self, text, message):
        assert problem(text) == message

    def test_hostile_names_stay_on_their_line(self):
        spawn = herd(count=0)
        spawn["name"] = "a\nb: fake: \x1b[31m"
        assert "\n" not in problem(level(tiles(), objects("spawns", spawn)))

"""What is allowed in a level and rarely meant is a warning, with the object it is about."""

import json
import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from flockbrush.behaviours.brush import BrushLibrary, shipped
from flockbrush.behaviours.mixture import BrushPath, path_to_toml
from flockbrush.levels.build import build
from flockbrush.levels.hints import mixing_hints
from flockbrush.levels.reader import read_level_files
from flockbrush.levels.schema import BrushLayer, PaintBounds
from flockbrush.systems.palette import Palette
from small_level import (
    herd,
    level,
    objects,
    png,
    polyline,
    problem,
    problems,
    properties,
    read,
    thing,
    tiles,
    with_objects,
)


def warnings(document):
    return [str(warning) for warning in read(document).warnings]


def goal(number, name, x, y, **values):
    return thing(number, "Goal", x, y, name=name, extra={"point": True}, **values)


def guide(*points, **values):
    return thing(2, "Guide", 0, 0, name="way", extra=polyline(*points), **values)


def test_a_level_as_it_should_be_has_no_warnings():
    assert warnings(level()) == []


@pytest.mark.parametrize(
    ("species", "told"), [("sheeep", "there is no species 'sheeep'; did you mean 'sheep'?"), ("yeti", "")]
)
def test_a_species_without_a_file_that_is_nearly_called_as_one_is_named(species, told):
    found = warnings(level(tiles(), objects("spawns", herd(species=species))))
    assert [told in warning for warning in found] == [True] * bool(told)


class TestGoals:
    def test_one_that_no_animal_goes_to_is_named(self):
        found = warnings(with_objects("goals", goal(2, "pond", 80, 80), goal(3, "shed", 20, 80)))
        assert len(found) == 1
        assert found[0].startswith("small.tmj:")
        assert "object 3 'shed' in layer 'goals': warning: no animal goes to goal 'shed'" in found[0]
        assert "animals start with the first goal, 'pond'" in found[0]

    def test_one_that_follows_another_is_linked(self):
        first = goal(2, "pond", 80, 80, on_arrive="next", next="shed")
        assert warnings(with_objects("goals", first, goal(3, "shed", 20, 80))) == []

    def test_one_that_the_script_names_is_linked(self):
        key = thing(4, "Key", 20, 20, extra={"point": True}, command="Gust", strength=1.0, radius=2.0, brush="graze")
        document = with_objects("goals", goal(2, "pond", 80, 80), goal(3, "graze", 20, 80))
        document["layers"].append(objects("script", key))
        assert warnings(document) == []


class TestPrograms:
    def geese(self, name):
        birds = herd(species="goose", brush="geese", program="lake-goose", count=3, altitude=20.0)
        place = thing(3, "Area", 20, 20, 40, 40, name)
        document = level(objects("spawns", birds), objects("areas", place))
        files = {"small.tmj": json.dumps(document, indent=1).encode()}
        return [str(warning) for warning in read_level_files(files, library=shipped()).warnings]

    def test_a_place_that_is_not_in_the_level_is_named(self):
        found = self.geese("lakes")
        assert len(found) == 1
        assert "program 'lake-goose' names the place 'lake', which is not in this level" in found[0]
        assert found[0].endswith("no animal is ever in it or near it; did you mean 'lakes'?")

    @pytest.mark.parametrize(
        ("state", "said"),
        [
            ("merino/run", None),
            ("merino/rum", "names the state 'rum', which program 'merino' does not have: no animal is ever in it; "),
            ("merina/run", "names the program 'merina', which no animal of this level follows: no animal is ever"),
        ],
    )  # fmt: skip
    def test_a_state_of_another_program_that_is_not_there_is_named(self, state, said):
        others = herd(species="sheep", brush="graze", program="merino", count=3)
        watching = herd(species="sheep", brush="graze", program="watch", count=3)
        program = (
            'schema = "flockbrush.program/1"\n[state.a]\n[state.b]\n[[trigger]]\nfrom = "a"\nto = "b"\n'
            f'when = {{ share_of_seen_in = "{state}", at_least = 0.5 }}\n'
        )
        document = level(objects("spawns", watching, others | {"id": 2}))
        files = {
            "small.tmj": json.dumps(document, indent=1).encode(), "programs/watch.program.toml": program.encode(),
        }  # fmt: skip
        found = [str(warning) for warning in read_level_files(files, library=shipped()).warnings]
        assert len(found) == (said is not None) and (said is None or said in found[0]), found

    @pytest.mark.parametrize(("event", "said"), [("gate", None), ("gates", "the event 'gates'; did you mean 'gate'?")])
    def test_an_event_of_a_zone_that_nobody_hears_is_told(self, event, said):
        program = (
            'schema = "flockbrush.program/1"\n[state.a]\n[state.b]\n[[trigger]]\nfrom = "a"\nto = "b"\n'
            'when = { event = "gate" }\n'
        )
        zone = thing(5, "Zone", 20, 20, 40, 40, brush="march", event=event)
        document = level(
            objects("spawns", herd(species="sheep", brush="graze", program="watch", count=3)), objects("zones", zone)
        )
        files = {
            "small.tmj": json.dumps(document, indent=1).encode(), "programs/watch.program.toml": program.encode(),
        }  # fmt: skip
        found = [str(warning) for warning in read_level_files(files, library=shipped()).warnings]
        assert len(found) == (said is not None) and (said is None or found[0].endswith(said)), found

    def test_a_change_of_brush_that_programs_hide_is_told(self):
        key = thing(4, "Key", 20, 20, extra={"point": True}, at=1.0, command="SwitchBrush", brush="march")
        for program, number in (("", 0), ("merino", 1)):
            document = level(objects("spawns", herd(species="sheep", program=program, count=3)), objects("script", key))
            files = {"small.tmj": json.dumps(document, indent=1).encode()}
            found = [str(warning) for warning in read_level_files(files, library=shipped()).warnings]
            assert len([one for one in found if "SwitchBrush changes no animal" in one]) == number

    def test_steering_without_appointed_animals_is_told(self):
        def key(number, command, **values):
            return thing(number, "Key", 20, 20, extra={"point": True}, at=1.0, command=command, **values)

        steer, appoint = key(4, "Steer", species="sheep"), key(5, "Appoint", species="sheep")
        for keys, number in (([steer], 1), ([appoint, steer], 0)):
            document = level(objects("spawns", herd(species="sheep", count=3)), objects("script", *keys))
            files = {"small.tmj": json.dumps(document, indent=1).encode()}
            found = [str(warning) for warning in read_level_files(files, library=shipped()).warnings]
            assert len([one for one in found if "Steer changes no animal" in one]) == number

    def test_one_that_is_there_is_not(self):
        assert self.geese("lake") == []


class TestGuides:
    @pytest.mark.parametrize(
        ("last", "wall"),
        [
            ((158, 80), "the edge of the map"),
            ((110, 80), "obstacle 'rock'"),
            ((80, 20), "ground that no animal walks on"),
        ],
    )
    def test_one_that_ends_at_a_wall_names_it(self, last, wall):
        ground = [2] * 10 + [1] * 90
        document = level(tiles(gids=ground), objects("spawns", herd(count=3)))
        rock = thing(3, "Obstacle", 118, 64, 24, 32, "rock")
        document["layers"] += [objects("guides", guide((80, 80), last)), objects("obstacles", rock)]
        if wall == "the edge of the map":
            document["layers"][-1]["objects"] = []
        assert [f"warning: ends at {wall}, where animals will jam" in w for w in warnings(document)] == [True]

    def test_one_that_ends_in_the_open_or_goes_round_is_fine(self):
        assert warnings(with_objects("guides", guide((20, 80), (80, 80)))) == []
        assert warnings(with_objects("guides", guide((20, 80), (158, 80), (80, 20), loop=True))) == []

    def test_one_that_ends_in_a_goal_or_an_exit_is_fine(self):
        document = with_objects("guides", guide((20, 80), (158, 80)))
        document["layers"].append(objects("exits", thing(3, "Exit", 144, 64, 16, 32)))
        assert warnings(document) == []
        document["layers"][-1] = objects("goals", goal(3, "pond", 155, 80))
        assert warnings(document) == []

    def test_one_that_leaves_an_open_map_is_fine(self):
        document = with_objects("guides", guide((20, 80), (158, 80)))
        document["properties"] = properties(schema="flockbrush-level/1", metres_per_tile=2.0, boundary="open")
        assert warnings(document) == []

    def test_one_that_leaves_a_map_that_wraps_meets_what_is_at_the_other_border(self):
        rock, over = (thing(3, "Obstacle", x, 64, width, 32, "rock") for x, width in ((0, 16), (-32, 36)))
        ends = "ends at obstacle 'rock', where animals will jam"
        for last, stone in (((158, 80), rock), ((150, 80), over), ((170, 80), rock)):
            document = with_objects("guides", guide((20, 80), last))
            document["properties"] = properties(schema="flockbrush-level/1", metres_per_tile=2.0, boundary="wrap")
            document["layers"].append(objects("obstacles", stone))
            assert [ends in warning for warning in warnings(document)] == [True]
            for kind, well in (("exits", thing(4, "Exit", -32, 64, 48, 32)), ("goals", goal(4, "pond", 3, 80))):
                assert warnings({**document, "layers": [*document["layers"], objects(kind, well)]}) == []


class TestLayers:
    def test_a_hidden_layer_counts_and_is_named(self):
        document = level(tiles(visible=False), objects("spawns", herd()))
        assert warnings(document) == [
            "small.tmj:93: layer 'terrain': warning: is hidden in Tiled but still used; delete it, or name it"
            " 'notes ...' to have it ignored"
        ]

    def test_a_layer_in_a_hidden_group_is_hidden(self):
        group = {"type": "group", "name": "all", "visible": False, "layers": [tiles(), objects("spawns", herd())]}
        assert [w.count("is hidden") for w in warnings(level(group))] == [1, 1]

    def test_a_hidden_object_counts_and_is_named(self):
        document = level(tiles(), objects("spawns", herd() | {"visible": False}))
        assert (
            "object 1 'herd A' in layer 'spawns': warning: is hidden in Tiled but still used" in warnings(document)[0]
        )

    def test_the_designers_own_layers_may_be_hidden(self):
        document = with_objects("notes", thing(9, "", 0, 0), visible=False)
        assert warnings(document) == []

    def test_parallax_is_told(self):
        document = level(tiles(parallaxx=0.5), objects("spawns", herd()))
        assert "has a parallax factor, which is ignored" in warnings(document)[0]


def test_a_moved_tileset_is_the_only_thing_that_is_wrong():
    document = level(tilesets=[{"firstgid": 1, "source": "moved/kinds.tsj"}])
    found = problems(document)
    assert len(found) == 1
    assert "tileset: tileset 'moved/kinds.tsj': " in found[0]


class TestPaint:
    @pytest.mark.parametrize(
        ("values", "named"),
        [({"medium": "any", "z_min": 5.0}, True), ({"medium": "any", "z_max": 9.0}, False), ({"z_min": 5.0}, False)],
    )
    def test_ground_paint_that_lets_birds_go_on_their_way_down_is_named(self, values, named):
        zone = thing(2, "Zone", 16, 16, 64, 64, "pond", brush="graze", **values)
        layer = tiles("brush", [3] * 100, properties=properties(**values))
        for document in (with_objects("zones", zone), level(tiles(), layer, objects("spawns", herd()))):
            found = warnings(document)
            assert len(found) == named
            assert not named or "makes birds land, but acts only above z_min 5 m: below, they take off" in found[0]

    def test_paint_of_part_weight_names_pairs_that_nobody_has_measured(self, tmp_path, monkeypatch):
        layer = tiles("brush", [3] * 100, opacity=0.5, properties=properties(blend="mix", edge=4.0))
        document = level(tiles(), layer, objects("spawns", herd(brush="mine")))
        monkeypatch.chdir(tmp_path)
        (tmp_path / "brushes").mkdir()
        (tmp_path / "brushes" / "mine.brush.toml").write_bytes(shipped().get("graze").source)
        library = BrushLibrary([tmp_path / "brushes", *shipped().folders])
        found = read_level_files({"small.tmj": json.dumps(document, indent=1).encode()}, library)
        (made,) = found.brush_layers
        assert (made.bounds.blend, made.bounds.edge, made.weight, made.plain) == ("mix", 4.0, 0.5, False)
        assert len(found.warnings) == 1
        said = "layer 'brush': warning: there is no measured path from 'mine' to 'march'"
        assert re.match(r"small\.tmj:\d{3}: " + said, str(found.warnings[0]))
        command = "flockbrush brush morph brushes/mine.brush.toml march -o brushes/mine--march.path.toml"
        assert f"; {command} measures a path" in str(found.warnings[0])

    def test_a_brush_that_is_embedded_is_not_taken_for_a_file_in_the_current_folder(self, tmp_path, monkeypatch):
        monkeypatch.chdir(tmp_path)
        (tmp_path / "march.brush.toml").write_bytes(shipped().get("graze").source)
        layer = tiles("brush", [3] * 100, opacity=0.5, properties=properties(blend="mix", edge=4.0))
        document = level(tiles(), layer, objects("spawns", herd(brush="mine")))
        mine = {f"{name}.brush.toml": shipped().get(name).source for name in ("march",)}
        mine["mine.brush.toml"] = shipped().get("graze").source
        library = BrushLibrary(shipped().folders).with_files(mine)
        (warning,) = read_level_files({"small.tmj": json.dumps(document).encode()}, library).warnings
        assert "flockbrush brush morph mine march -o " in str(warning)

    @pytest.mark.parametrize(
        ("values", "said"),
        [
            ({"species": "sheeep"}, "species: there is no species or tag 'sheeep'; did you mean 'sheep'?"),
            ({"z_min": 5.0, "z_max": 5.0}, "z_min must be below z_max, got 5 and 5"),
        ],
    )
    def test_what_is_wrong_with_whom_paint_binds_is_told_with_its_layer_or_zone(self, values, said):
        layer = tiles("brush", [3] * 100, properties=properties(**values))
        found = problem(level(tiles(), layer, objects("spawns", herd())))
        assert re.match(rf"small\.tmj:\d{{3}}: layer 'brush': {re.escape(said)}", found)
        zone = thing(2, "Zone", 16, 16, 64, 64, "pond", brush="graze", **values)
        found = problem(with_objects("zones", zone))
        assert re.match(rf"small\.tmj:\d{{3}}: object 2 'pond' in layer 'zones': {re.escape(said)}", found)

    @pytest.mark.parametrize(
        ("values", "blend"),
        [({}, "cover"), ({"strength": 0.5}, "mix"), ({"edge": 3.0}, "mix"), ({"share": True, "edge": 3.0}, "share")],
    )
    def test_a_zone_weighs_as_its_properties_say(self, values, blend):
        zone = thing(2, "Zone", 16, 16, 64, 64, "pond", brush="march", **values)
        assert read(with_objects("zones", zone)).zones[0].bounds.blend == blend

    @pytest.mark.parametrize(
        ("worth", "said"),
        [
            ({"even": True}, None),
            ({"even": False}, "'graze' to 'march' is uneven: behaviour may jump"),
            ({"even": False, "bistable": True}, "'graze' to 'march' is bistable: herds keep their previous behaviour"),
        ],
    )
    def test_a_measured_way_that_is_not_even_is_named_too(self, worth, said):
        path = path_to_toml(BrushPath(start="graze", end="march", along=(0, 1), measured="table", **worth)).encode()
        library = SimpleNamespace(get=shipped().get, path_between=lambda *pair: (Path("graze--march.path.toml"), path))
        pairs = [SimpleNamespace(brush="graze")]
        mixing = BrushLayer("brush", 0.5, ["march"], np.zeros((2, 2), int), PaintBounds(blend="mix"))
        told = []
        made = SimpleNamespace(brush_layers=[mixing], zones=[], spawns=pairs)
        mixing_hints(made, [SimpleNamespace(warn=told.append)], library)
        assert len(told) == (said is not None) and all(said in words for words in told)

    def test_a_path_that_was_measured_with_another_brush_is_named(self, tmp_path):
        """Its detours fit the shipped brush; with another they stay within the bounds of the numbers."""
        changed = shipped().get("march").with_parameters(alignment_weight=0.2)
        (tmp_path / "march.brush.toml").write_bytes(changed.source)
        library = BrushLibrary([tmp_path, *shipped().folders])
        layer = tiles("brush", [3] * 100, opacity=0.5, properties=properties(blend="mix"))
        document = level(tiles(), layer, objects("spawns", herd(brush="graze")))
        found = read_level_files({"small.tmj": json.dumps(document).encode()}, library)
        assert len(found.warnings) == 1
        said = "the path from 'graze' to 'march' was measured with another brush 'march', so behaviour may jump"
        assert said in str(found.warnings[0])
        command = f"morph graze {tmp_path}/march.brush.toml -o {tmp_path}/graze--march.path.toml measures it anew"
        assert command in str(found.warnings[0])
        simulation = build(found, library=library)
        assert simulation.world.resource(Palette).named("graze--march--6of12") >= 0
        simulation.close()
        digests = {"start_sha256": shipped().get("graze").sha256, "end_sha256": changed.sha256}
        file = tmp_path / "graze--march.path.toml"
        file.write_text(path_to_toml(BrushPath(start="graze", end="march", along=(0, 1), **digests)))
        assert not read_level_files({"small.tmj": json.dumps(document).encode()}, library).warnings
        digests["end_sha256"] = shipped().get("march").sha256  # of the brush of that name, not of this one
        file.write_text(path_to_toml(BrushPath(start="graze", end="march", along=(0, 1), **digests)))
        (again,) = read_level_files({"small.tmj": json.dumps(document).encode()}, library).warnings
        assert said in str(again)

    def test_a_path_in_a_recording_is_not_compared_with_files_that_happen_to_be_here(self, tmp_path, monkeypatch):
        file, path = shipped().path_between("graze", "march")
        (tmp_path / "march.brush.toml").write_bytes(shipped().get("march").with_parameters(alignment_weight=0.2).source)
        monkeypatch.chdir(tmp_path)
        layer = tiles("brush", [3] * 100, opacity=0.5, properties=properties(blend="mix"))
        document = level(tiles(), layer, objects("spawns", herd(brush="graze")))
        library = shipped().with_files({file.name: path})
        assert not read_level_files({"small.tmj": json.dumps(document).encode()}, library).warnings


BANK = np.repeat([0, 200], 10).astype(np.uint8)[:, None].repeat(20, 1)  # up to the south
RAMP = np.where(np.arange(20) < 5, np.linspace(0, 200, 20)[:, None], BANK).astype(np.uint8)
HILLSIDE = np.linspace(0, 200, 20).astype(np.uint8)[:, None].repeat(20, 1)


class TestSteepGround:
    """A herd in the north, its goal in the south, and a bank of 4 m between them unless a test wants other hills."""

    def warned(self, species="sheep", picture=BANK, metres=0.02, goals=True):
        hills = {"type": "imagelayer", "name": "height", "image": "hills.png"}
        hills["properties"] = properties(metres_per_level=metres)
        spawn = thing(1, "Spawn", 8, 8, 140, 40, "herd A", brush="march", count=3, species=species)
        ponds = [objects("goals", goal(2, "pond", 80, 150))] if goals else []
        document = level(tiles(), objects("spawns", spawn), *ponds, hills)
        return [str(warning) for warning in read(document, {"hills.png": png(picture)}).warnings]

    def test_a_goal_that_a_species_cannot_reach_is_named(self):
        (found,) = self.warned()
        assert "object 1 'herd A' in layer 'spawns': warning: no way leads to goal 'pond'" in found
        assert "the ground between is steeper than species 'sheep' walks (walk.steepest is 1)" in found

    @pytest.mark.parametrize(
        "more", [{"species": "ant"}, {"picture": RAMP}, {"metres": 0.004}, {"goals": False}, {"species": "animal"}],
        ids=["ant", "ramp", "low bank", "no goal", "a name alone"],
    )  # fmt: skip
    def test_there_is_no_warning_where_it_can(self, more):
        assert self.warned(**more) == []

    def test_a_spawn_on_ground_that_is_too_steep_is_named(self):
        (found,) = self.warned(picture=HILLSIDE, metres=0.2, goals=False)
        assert "more than half of it is steeper than species 'sheep' walks" in found


@pytest.mark.parametrize(
    ("boundary", "picture", "said"),
    [
        ("wrap", HILLSIDE, "boundary is wrap, but heights on the south and north borders differ by up to 40 m"),
        ("wall", HILLSIDE, ""),
        ("wrap", np.concatenate([HILLSIDE[::2], HILLSIDE[::-2]]), ""),
    ],
    ids=["a cliff", "no seam", "one that fits"],
)  # fmt: skip
def test_heights_that_differ_on_opposite_borders_of_a_wrapped_map_are_told(boundary, picture, said):
    hills = {
        "type": "imagelayer",
        "name": "height",
        "image": "hills.png",
        "properties": properties(metres_per_level=0.2),
    }
    map_properties = properties(schema="flockbrush-level/1", metres_per_tile=2.0, boundary=boundary)
    document = level(tiles(), objects("spawns", herd(species="animal")), hills, properties=map_properties)
    found = [str(warning) for warning in read(document, {"hills.png": png(picture)}).warnings]
    assert len(found) == bool(said) and said in "".join(found)

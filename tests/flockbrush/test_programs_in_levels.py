"""Programs in level files and on the command line: run, recorded, replayed, exported, tried on a plane."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest
from flockbrush.behaviours.program import load_program, save_program, shipped_programs
from flockbrush.components import Body
from flockbrush.engine.locks import Advice
from flockbrush.engine.problems import ProblemsError
from flockbrush.levels.libraries import library_for_file
from flockbrush.levels.reader import read_level
from flockbrush.systems.fauna import SpeciesList

from flockbrush.cli.program_cli import plane_for
from flockbrush.runs.run import start

OWN = """schema = "flockbrush.program/1"
[state.rest]
brush = "graze"
[state.go]
brush = "march"
[[trigger]]
to = "go"
when = { any = [{ event = "alarm" }, { event = "gate" }] }
"""


def thing(number, cls, x, y, width, height, name="", **values):
    kinds = {int: "int", float: "float", str: "string"}
    told = [{"name": k, "type": kinds[type(v)], "value": v} for k, v in values.items()]
    return {
        "id": number, "name": name, "type": cls, "x": x, "y": y, "width": width, "height": height, "rotation": 0,
        "visible": True, "properties": told,
    }  # fmt: skip


def level(folder, program="own", **more):
    """A level of 60 x 40 m with twelve sheep in a program, whose file lies in the folder ``programs``."""
    (folder / "programs").mkdir(exist_ok=True)
    (folder / "programs" / "own.program.toml").write_text(OWN)
    spawn = thing(1, "Spawn", 100, 100, 100, 100, "herd", species="sheep", brush="graze", count=12, program=program)
    zone = thing(2, "Zone", 400, 0, 100, 400, "gate", event="gate", event_reach=-1.0)
    key = thing(3, "Key", 0, 0, 10, 10, "", at=0.5, command="SetState", program="own", state="go", **more)
    layers = [
        {"id": 1, "name": "spawns", "type": "objectgroup", "objects": [spawn]},
        {"id": 2, "name": "zones", "type": "objectgroup", "objects": [zone]},
        *([{"id": 3, "name": "script", "type": "objectgroup", "objects": [key]}] if more else []),
    ]
    document = {
        "type": "map", "orientation": "orthogonal", "infinite": False, "width": 60, "height": 40, "tilewidth": 10,
        "tileheight": 10, "tilesets": [], "layers": layers,
        "properties": [{"name": "schema", "type": "string", "value": "flockbrush-level/1"}],
    }  # fmt: skip
    path = folder / "pen.tmj"
    path.write_text(json.dumps(document, indent=1))
    return path


def test_a_spawn_names_a_program_and_a_zone_an_event(tmp_path):
    found = read_level(level(tmp_path))
    assert found.spawns[0].program == "own" and list(found.programs) == ["own"]
    assert (found.zones[0].event, found.zones[0].event_reach) == ("gate", -1.0)
    assert found.programs["own"] == load_program(OWN.encode(), "own.program.toml")


def test_a_program_that_is_not_there_or_is_wrong_is_said_with_its_line(tmp_path):
    with pytest.raises(ProblemsError, match=r"object 1 'herd'.*: program: there is no program 'onw'"):
        read_level(level(tmp_path, "onw"))
    path = level(tmp_path)
    (tmp_path / "programs" / "own.program.toml").write_text(OWN.replace('to = "go"', 'to = "og"'))
    with pytest.raises(ProblemsError, match=r"own.program.toml:7: trigger\[0\].to: there is no state 'og'"):
        read_level(path)
    (tmp_path / "programs" / "own.program.toml").write_text(OWN.replace('"march"', '"mrach"'))
    with pytest.raises(ProblemsError, match="there is no brush 'mrach'"):
        start(path)


def test_another_brush_for_a_level_whose_properties_are_one_value_of_a_class(tmp_path):
    path = level(tmp_path, species="sheep", radius=0.0)
    document = json.loads(path.read_text())
    for layer in document["layers"]:
        for one in layer["objects"]:
            values = {entry["name"]: entry["value"] for entry in one["properties"]}
            one["properties"] = [{"name": "all", "type": "class", "propertytype": one["type"], "value": values}]
    path.write_text(json.dumps(document))
    with pytest.warns(Advice, match="all animals have the brush swarm, without programs: own left out"):
        scene = start(path, brush="swarm")
    assert [(spawn.brush, spawn.program, spawn.count) for spawn in scene.level.spawns] == [("swarm", "", 12)]
    assert scene.level.script == []
    scene.close()


def test_a_script_puts_animals_into_states(tmp_path):
    scene = start(level(tmp_path, species="sheep", radius=0.0))
    scene.run(20)
    assert scene.states() == {"own": {"rest": 0, "go": 12}} and scene.transitions() == {"own": {}}


def test_a_run_with_an_event_is_told_exported_recorded_and_replayed(cli, tmp_path):
    path, film, table = level(tmp_path), tmp_path / "pen.fbr", tmp_path / "pen.csv"
    words = ("run", path, "--seconds", 2, "--event", "1:alarm", "--json", "--record", film, "--export", table)
    told = json.loads(cli(*words).out)
    assert told["states"] == {"own": {"rest": 0, "go": 12}}
    assert told["transitions"] == {"own": {"rest": {"go": 12}}}
    with open(table, newline="") as file:
        rows = list(csv.DictReader(file))
    assert {row["state"] for row in rows if float(row["time"]) <= 1.0} == {"rest"}
    assert {row["state"] for row in rows if float(row["time"]) > 1.1} == {"go"}
    (tmp_path / "programs" / "own.program.toml").unlink()  # the recording has it
    replayed = cli("replay", film, "--verify", "--json")
    assert json.loads(replayed.out)["verified"] is True
    measured = json.loads(cli("measure", film, "--json").out)
    assert measured["states"] == told["states"] and measured["transitions"] == told["transitions"]
    assert measured["series"]["state go"][0] == 0 and measured["measures"]["state go"] == 12


@pytest.mark.parametrize(
    "event, said",
    [
        ("alarm", "must be SECONDS:NAME"),
        ("x:alarm", "must be SECONDS:NAME"),
        ("-1:alarm", "must be SECONDS:NAME"),
        ("1:alarm@2,3", "must be SECONDS:NAME"),
        ("1:alram", "did you mean 'alarm'?"),
        ("7:alarm", "the run ends at 1 s, before this event"),
    ],
)
def test_an_event_that_cannot_be_is_refused_before_the_run(cli, tmp_path, event, said):
    done = cli("run", level(tmp_path), "--seconds", 1, f"--event={event}")
    assert done.code == 2 and said in " ".join(done.err.replace("│", " ").split())


def test_an_event_in_a_place_is_heard_there(cli, tmp_path):
    told = json.loads(cli("run", level(tmp_path), "--seconds", 1, "--event", "0.5:alarm@59,39,2", "--json").out)
    assert told["states"]["own"]["go"] == 0


# flockbrush program ----------------------------------------------------------------------------


def test_programs_are_listed_shown_and_checked(cli):
    assert all(name in cli("program", "list").out for name in shipped_programs().names())
    shown = cli("program", "show", "stampede").out
    assert "8..12 s" in shown and 'sees = "wolf"' in shown and "start: graze" in shown
    told = json.loads(cli("program", "show", "stampede", "--json").out)
    assert told["triggers"][0]["from"] == ["graze", "calm"] and told["states"]["stampede"]["for"] == "8..12 s"
    assert "stampede: ok: Stampede, 3 states, 2 triggers" in cli("program", "check", "stampede").out


def test_a_wrong_program_is_said_with_its_line_and_a_strange_one_noted(cli, tmp_path):
    wrong = tmp_path / "a.program.toml"
    wrong.write_text(OWN.replace('"march"', '"mrach"'))
    assert f"{wrong}:5: state.go.brush: there is no brush 'mrach'" in cli("program", "check", wrong).out
    wrong.write_text(OWN + "[state.left]\n" + '[[trigger]]\nto = "go"\nwhen = { sees = "wofl" }\n')
    done = cli("program", "check", wrong)
    assert (
        "state.left: no trigger leads to this state; only a command can set it" in done.err
        and "there is no species 'wofl'; did you mean 'wolf'?" in done.err
    )


def test_states_of_other_programs_of_ones_own_are_known_to_the_check(cli, tmp_path):
    (tmp_path / "other.program.toml").write_text(OWN)
    file = tmp_path / "own.program.toml"
    file.write_text(OWN + '[[trigger]]\nto = "rest"\nwhen = { share_of_seen_in = "other/rets", at_least = 0.5 }\n')
    assert "the program 'other' has no state 'rets'; did you mean 'rest'?" in cli("program", "check", file).err
    file.write_text(file.read_text().replace("rets", "rest"))
    assert "has no state" not in cli("program", "check", file).err


def test_a_program_is_tried_on_a_plane(cli, tmp_path):
    save_program(shipped_programs().get("stampede"), tmp_path)
    words = ("program", "test", tmp_path / "stampede.program.toml", "--animals", 20, "--seconds", 4)
    told = json.loads(cli(*words, "--event", "1:alarm", "--json").out)
    assert told["states"][0]["graze"] == 20 and told["transitions"]["graze"]["stampede"] == 20
    assert "from \\ to" in cli(*words).out
    assert "must be SPECIES:BRUSH" in " ".join(cli(*words, "--intruder", "wolf").err.split())
    assert "there is no brush 'wolf-hnut'" in " ".join(cli(*words, "--intruder", "wolf:wolf-hnut").err.split())


YAK = """schema = "flockbrush.species/1"
media = ["walk"]
[body]
length = 3.0
radius = 0.6
[relations]
wolf = { fear = 1.0, notice = "40 m" }
"""


def test_a_program_is_tried_with_the_species_beside_it(cli, tmp_path):
    (tmp_path / "species").mkdir()
    (tmp_path / "species" / "yak.species.toml").write_text(YAK)
    file = tmp_path / "programs" / "own.program.toml"
    file.parent.mkdir()
    file.write_text(OWN + '[[trigger]]\nto = "go"\nwhen = { sees = "yak" }\n')
    assert "there is no species" not in cli("program", "check", file).err
    simulation = plane_for(load_program(file), library_for_file(file), 4, "yak", ("wolf", "wolf-hunt"), 0)
    fauna = simulation.world.resource(SpeciesList)
    assert np.all(simulation.agents[Body.length] == 3.0) and fauna.relations.notice[0].max() == 40.0
    simulation.close()
    words = "program", "test", file, "--animals", 2, "--seconds", 0
    assert cli(*words, "--species", "yak", "--intruder", "yak:march").code == 0
    for option, value in (("--species", "yaks"), ("--intruder", "yaks:march")):
        done = cli(*words, option, value)
        assert done.code == 2 and f"{option}: there is no species 'yaks'; did you mean 'yak'?" in _plain(done.err)


def _plain(text):
    """The words of a message without the frame about them."""
    return " ".join(text.replace("│", " ").split())


def test_what_the_documentation_shows_of_a_program_is_what_it_does(cli):
    page = (Path(__file__).parents[2] / "docs" / "programs.md").read_text(encoding="utf-8")
    shown = cli("program", "test", "stampede", "--intruder", "wolf:wolf-hunt", "--seconds", 40).out
    rows = [" ".join(line.split()) for line in shown.splitlines() if line.strip()[:1].isdigit()]
    assert len(rows) == 9 and [row for row in rows if row not in " ".join(page.split())] == []


@pytest.mark.parametrize(("program", "species"), [("lake-goose", "goose"), ("falcon", "falcon"), ("merino", "sheep")])
def test_a_program_is_tried_with_animals_that_can_follow_it(cli, program, species):
    done = cli("program", "test", program, "--animals", 3, "--seconds", 0, "--json")
    assert json.loads(done.out)["species"] == species


def test_a_species_that_cannot_follow_a_program_is_refused(cli):
    done = cli("program", "test", "lake-goose", "--species", "sheep", "--seconds", 0)
    assert done.code == 1
    assert "--species: program 'lake-goose'" in done.err and "cannot use brush 'geese', which flies" in done.err

"""Exports of runs in which brushes, programs, families and animals come, and go, while they run."""

import csv
import json

import numpy as np
import pytest
from flockbrush.systems.commands import SwitchBrush
from flockbrush.systems.edits import MarkSpawn
from flockbrush.systems.program_commands import GiveProgram, UseProgram
from flockbrush.systems.undo import UseBrush

import flockbrush
from flockbrush.output.export import Exports
from flockbrush.output.exporter import exporters
from flockbrush.runs.catalogue import catalogue_of
from flockbrush.runs.run_edits import Edit, EditedMoments, Past
from flockbrush.runs.snapshots import moment_of, words_of

PROGRAM = """schema = "flockbrush.program/1"
[state.stroll]
brush = "graze"
[state.hurry]
brush = "march"
for = "0.5 s"
then = "stroll"
[[trigger]]
from = "stroll"
to = "hurry"
when = { rate = "3 /s" }
"""
SQUARE = [[40.0, 40.0], [50.0, 40.0], [50.0, 50.0], [40.0, 50.0]]
TICKS = 48


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    """A run in which everything comes late: a brush, a program that another replaces, and a family."""
    path = tmp_path_factory.mktemp("late") / "late.flock"
    swarm = flockbrush.shipped().get("swarm").source.decode().replace('name = "swarm"', 'name = "bees"')
    run = flockbrush.start("meadow", agents=12)
    with flockbrush.record(path, run) as record:
        for tick in range(TICKS):
            if tick == 8:
                run.submit(UseBrush("bees", swarm))
                run.submit(SwitchBrush("bees"))
            if tick == 16:
                run.submit(MarkSpawn(900, "late", SQUARE, "march", "sheep", 6, family_size=3))
            if tick == 24:
                run.submit(UseProgram("errands", PROGRAM))
                run.submit(GiveProgram("errands"))
            if tick == 36:
                other = PROGRAM.replace("[state.hurry]", '[state.dine]\nbrush = "graze"\n[state.hurry]')
                run.submit(UseProgram("errands", other))
            run.run(1)
            record.take()
    return path


def exported(cli, recording, tmp_path, *edits, to=".csv"):
    """The rows of a recording's table, with one edit of each animal."""
    file = recording.with_suffix(".edits.toml")
    file.unlink(missing_ok=True)
    for edit in edits:
        assert cli("edit", recording, *edit).code == 0
    out = tmp_path / f"late{to}"
    done = cli("export", recording, "--to", out, *([] if edits else ["--no-edits"]))
    file.unlink(missing_ok=True)
    assert done.code == 0, done.err
    with open(out, newline="") as table:
        return list(csv.DictReader(table))


NAMES = ("species", "brush", "group", "family", "state")


def names_of(rows, later=0):
    """{(frame, id): names}, frames counted so many later."""
    return {(int(row["frame"]) + later, int(row["id"])): tuple(row[name] for name in NAMES) for row in rows}


@pytest.fixture
def plain(cli, recording, tmp_path_factory):
    return exported(cli, recording, tmp_path_factory.mktemp("plain"))


def test_each_frame_names_what_there_was(plain):
    names = names_of(plain)
    assert {names[k][1] for k in names if k[0] < 8} == {"graze", "march"}  # the meadow has painted ground
    assert {names[k][1] for k in names if 8 < k[0] < 16} == {"graze", "bees"}
    assert {names[k][3] for k in names if k[0] < 16} == {""}
    assert {names[k][3] for k in names if k[0] > 17} > {"", "13"}
    assert {names[k][4] for k in names if k[0] < 24} == {""}
    assert {names[k][4] for k in names if k[0] > 30} >= {"stroll", "hurry"}
    assert len({key for key in names if key[0] == TICKS}) == 18


@pytest.mark.parametrize("ticks", [-16, 16])
def test_animals_of_another_time_bear_the_names_of_that_time(cli, recording, tmp_path, plain, ticks):
    rows = exported(cli, recording, tmp_path, ["--box=-1e4,-1e4,1e4,1e4", "--delay", ticks / 32])
    known = names_of(plain, later=ticks)
    shown = names_of(rows)
    both = [key for key in shown if key in known and key[1] <= 12]
    assert len(both) == 12 * (TICKS + 1 - abs(ticks))
    assert [shown[key] for key in both] == [known[key] for key in both]


def test_a_look_that_comes_later_is_shown_from_the_start(cli, recording, tmp_path):
    rows = exported(cli, recording, tmp_path, ["--ids", "1,2", "--look", "brush=bees"])
    names = names_of(rows)
    assert {names[frame, animal][1] for frame in range(TICKS + 1) for animal in (1, 2)} == {"bees"}
    assert {names[0, animal][1] for animal in range(3, 13)} == {"graze", "march"}


@pytest.mark.parametrize("ending", sorted(exporters()))
def test_every_format_takes_animals_of_another_time(recording, tmp_path, ending):
    from flockbrush.engine.recording import open_recording

    from flockbrush.runs import run as running

    if any(not pytest.importorskip(module) for module, _ in exporters()[ending].needs):
        return
    run = open_recording(recording)
    other = running.rebuild(run)
    past = Past(range(1, 13))
    past.watch(other, run.last_tick)
    edits = [Edit("retime", tuple(range(1, 7)), speed=2.5), Edit("delay", tuple(range(7, 13)), seconds=-1.0)]
    simulation = running.rebuild(run)
    view = EditedMoments(simulation, edits, past)
    with Exports([tmp_path / f"late{ending}"], simulation, 8, view, size=(320, 240)) as exports:
        exports.take()
        while simulation.clock.tick < run.last_tick:
            simulation.tick()
            exports.take()
    past.close()
    assert any(file.stat().st_size > 300 for file in tmp_path.rglob("*") if file.is_file())


def test_codes_mean_the_same_after_a_brush_was_taken_back():
    from flockbrush.engine.commands import Commands

    run = flockbrush.start("meadow", agents=3)
    commands = run.world.resource(Commands)
    source = flockbrush.shipped().get("swarm").source.decode()
    named = [source.replace('name = "swarm"', f'name = "{name}"') for name in ("bees", "wasps")]
    back = commands.perform(run.world, [UseBrush("bees", named[0]), SwitchBrush("bees")])
    run.run(1)
    bees = moment_of(run)
    commands.perform(run.world, back)
    commands.perform(run.world, [UseBrush("wasps", named[1]), SwitchBrush("wasps")])
    run.run(1)
    wasps = moment_of(run)
    words = words_of(run)["brush"]
    assert {words[k] for k in bees.brush} - {"graze"} == {"bees"}
    assert {words[k] for k in wasps.brush} - {"graze"} == {"wasps"}
    palette = catalogue_of(run.world).palette
    assert [brush.name for brush in palette.brushes] == words
    assert np.array_equal(palette.mean, [brush.speed.mean for brush in palette.brushes])


def test_a_state_keeps_its_name_when_another_program_has_one_of_the_same_name(cli, tmp_path):
    run = flockbrush.start("meadow", agents=12)
    path = tmp_path / "two.flock"
    with flockbrush.record(path, run) as record:
        for tick in range(64):
            if tick == 4:
                run.submit(UseProgram("one", PROGRAM))
                run.submit(GiveProgram("one"))
            if tick == 32:
                run.submit(UseProgram("two", PROGRAM))
            run.run(1)
            record.take()
    assert cli("export", path, "--to", tmp_path / "two.csv").code == 0
    with open(tmp_path / "two.csv", newline="") as table:
        assert {row["state"] for row in csv.DictReader(table)} == {"", "stroll", "hurry"}
    by_run, by_table = (json.loads(cli("measure", file, "--json").out) for file in (path, tmp_path / "two.csv"))
    shown, lived = by_table["transitions"]["one"], by_run["transitions"]["one"]
    assert shown["hurry"] == lived["hurry"] != {}
    assert 0 <= lived["stroll"]["hurry"] - shown["stroll"]["hurry"] <= 12  # within the tick in which the program came
    assert by_table["states"]["one"] == by_run["states"]["one"]


def test_a_look_of_another_size_is_in_the_table(cli, recording, tmp_path, plain):
    rows = exported(cli, recording, tmp_path, ["--ids", "1,2", "--look", "size=2"])
    for row, before in zip(rows, plain, strict=True):
        times = 2.0 if row["id"] in ("1", "2") else 1.0
        assert float(row["length"]) == pytest.approx(times * float(before["length"]), abs=2e-6)

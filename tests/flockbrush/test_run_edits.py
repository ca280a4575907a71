"""Edits of a recorded run: what they give, their file, their command, and that every export shows them."""

import csv
import shutil
import sqlite3
from dataclasses import replace

import numpy as np
import pytest
from flockbrush.engine.problems import ProblemsError
from flockbrush.engine.recording import open_recording
from test_gltf import Scene

from flockbrush.runs.edit_file import beside, edits_of, ids_of, ids_text, parse_edits
from flockbrush.runs.recording_selection import Selection, chosen
from flockbrush.runs.run import rebuild, start
from flockbrush.runs.run_edits import Edit, EditedMoments, Past
from flockbrush.runs.snapshots import moment_of, words_of


@pytest.fixture
def run(recording, tmp_path):
    """A recording of one's own: forty ticks, 24 sheep."""
    path = tmp_path / "run.flock"
    shutil.copy(recording, path)
    return path


@pytest.fixture(scope="module")
def told(recording):
    """(simulation, [moment of every tick])."""
    run = open_recording(recording)
    simulation = rebuild(run)
    moments = [moment_of(simulation)]
    while simulation.clock.tick < run.last_tick:
        simulation.tick()
        moments.append(moment_of(simulation))
    return simulation, moments


def past_of(moments, ids):
    """A `Past` of moments that are known already."""
    past = Past(ids)
    for moment in moments:
        past.keep(moment)
    return past


def edited(told, *edits):
    simulation, moments = told
    return EditedMoments(simulation, edits, past_of(moments, [a for edit in edits for a in edit.ids]))


def same(one, other, ids, **differently):
    """Whether animals are alike in two moments."""
    for name in ("xyz", "velocity", "forward", "length", "radius", "species", "brush", "leader"):
        a = getattr(one, name)[np.isin(one.ids, ids)]
        b = differently.get(name, getattr(other, name)[np.isin(other.ids, ids)])
        assert np.allclose(a, b, atol=1e-9), name


# what they give --------------------------------------------------------------------------


def test_deleted_animals_are_gone_from_when_until_when_and_the_others_stay(told):
    view = edited(told, Edit("delete", (2, 5), 0.5, 1.0))
    for tick in (0, 15, 16, 31, 32, 40):
        moment = told[1][tick]
        gone = 0.5 <= moment.time < 1.0
        shown = view.at(moment)
        assert shown.ids.tolist() == [a for a in moment.ids.tolist() if not (gone and a in (2, 5))]
        same(shown, moment, shown.ids)


def test_moved_animals_are_turned_about_a_point_and_set_down_elsewhere(told):
    moment = told[1][20]
    shown = edited(told, Edit("move", (1, 3), by=(2.0, -1.0, 0.5), turn=90.0, about=(10.0, 10.0))).at(moment)
    rows = np.isin(moment.ids, (1, 3))
    x, y, z = moment.xyz[rows].T
    expected = np.column_stack([10 - (y - 10) + 2, 10 + (x - 10) - 1, z + 0.5])
    turned = {
        name: np.column_stack([-getattr(moment, name)[rows][:, 1], getattr(moment, name)[rows][:, 0], 0 * x])
        for name in ("velocity", "forward")
    }
    same(shown, moment, (1, 3), xyz=expected, **turned)
    same(shown, moment, moment.ids[~rows])


def test_a_move_comes_and_goes_smoothly_and_velocities_are_those_of_the_positions(told):
    simulation, moments = told
    still = [replace(moments[0], time=t, velocity=0 * moments[0].velocity) for t in np.arange(0, 4, 1 / 256)]
    view = EditedMoments(
        simulation, [Edit("move", (1,), 1.0, 3.0, by=(4.0, 0, 0), turn=60.0, about=(5.0, 5.0), over=0.5)]
    )
    shown = [view.at(moment) for moment in still]
    xyz = np.array([moment.xyz[0] for moment in shown])
    velocity = np.array([moment.velocity[0] for moment in shown])
    assert np.allclose(np.gradient(xyz, 1 / 256, axis=0)[2:-2], velocity[2:-2], atol=0.2)
    assert np.abs(np.diff(xyz, axis=0)).max() < 0.2  # nothing jumps
    assert np.allclose(xyz[[0, 255, -1]], moments[0].xyz[0])


def test_retimed_animals_show_the_run_at_their_own_time(told):
    _, moments = told
    view = edited(told, Edit("retime", (4, 7), 0.25, speed=0.5))
    for tick in (0, 8, 16, 24, 40):
        moment = moments[tick]
        source = moments[tick if tick <= 8 else 8 + (tick - 8) // 2]
        shown = view.at(moment)
        assert shown.ids.tolist() == moment.ids.tolist() and shown.time == moment.time
        rate = 1.0 if tick < 8 else 0.5
        same(shown, source, (4, 7), velocity=rate * source.velocity[np.isin(source.ids, (4, 7))])
        same(shown, moment, [a for a in moment.ids.tolist() if a not in (4, 7)])


def test_faster_animals_run_ahead_and_stand_when_the_recording_has_ended(told):
    _, moments = told
    view = edited(told, Edit("retime", (4,), speed=4.0))
    same(view.at(moments[8]), moments[32], (4,), velocity=4 * moments[32].velocity[moments[32].ids == 4])
    end = moments[40]
    same(view.at(moments[20]), end, (4,), velocity=0 * end.velocity[end.ids == 4])


def test_frozen_animals_stand_and_go_on_from_there(told):
    _, moments = told
    view = edited(told, Edit("freeze", (6,), 0.25, 0.75))
    there = moments[8]
    for tick in (8, 12, 23):
        same(view.at(moments[tick]), there, (6,), velocity=0 * there.velocity[there.ids == 6])
    same(view.at(moments[24]), there, (6,))
    same(view.at(moments[40]), moments[24], (6,))


@pytest.mark.parametrize("seconds", [0.5, -0.5])
def test_delayed_animals_are_where_they_were_earlier_or_will_be(told, seconds):
    _, moments = told
    view = edited(told, Edit("delay", (9,), seconds=seconds))
    same(view.at(moments[20]), moments[20 - round(32 * seconds)], (9,))
    ends = moments[0] if seconds > 0 else moments[40]
    at = moments[4] if seconds > 0 else moments[36]
    same(view.at(at), ends, (9,), velocity=0 * ends.velocity[ends.ids == 9])


def test_edits_apply_one_after_another(told):
    """A move that is frozen half-way stays half-way; a freeze that is moved moves on."""
    _, moments = told
    move, freeze = Edit("move", (3,), 0.0, by=(8.0, 0, 0), over=1.0), Edit("freeze", (3,), 0.5)
    first = moments[16].xyz[moments[16].ids == 3][0]
    after = edited(told, move, freeze).at(moments[40])
    before = edited(told, freeze, move).at(moments[40])
    assert np.allclose(after.xyz[after.ids == 3][0] - first, (4.0, 0, 0))
    assert np.allclose(before.xyz[before.ids == 3][0] - first, (8.0, 0, 0))


def test_a_look_changes_brush_and_size_and_nothing_else(told):
    simulation, moments = told
    words, moment = words_of(simulation), moments[40]
    other = "march"
    shown = edited(told, Edit("look", (2,), 0.5, brush=other, size=2.0)).at(moment)
    mine = moment.ids == 2
    code = words["brush"].index(other)
    assert code != moment.brush[mine][0]
    same(shown, moment, (2,), brush=code, length=2 * moment.length[mine], radius=2 * moment.radius[mine])
    same(shown, moment, moment.ids[~mine])
    same(edited(told, Edit("look", (2,), 0.5, brush=other)).at(moments[4]), moments[4], (2,))


def test_moved_walkers_stand_on_the_hills():
    from flockbrush.systems.ground_height import heights_of_ground
    from flockbrush.systems.landscape import Landscape

    simulation = start("predators-valley")
    moment, land = moment_of(simulation), simulation.world.resource(Landscape)
    view = EditedMoments(simulation, [Edit("move", tuple(moment.ids.tolist()), by=(15.0, 9.0, 0))])
    shown = view.at(moment)

    def above(m):
        return m.xyz[:, 2] - heights_of_ground(land.heights, m.xyz)

    assert np.ptp(shown.xyz[:, 2] - moment.xyz[:, 2]) > 0.1  # there are hills
    assert np.allclose(above(shown), above(moment), atol=1e-9)


# whom --------------------------------------------------------------------------------------


def test_animals_are_chosen_by_what_they_are_and_where(told):
    simulation, moments = told
    moment, words = moments[40], words_of(simulation)

    def ids(**wanted):
        return chosen(Selection(**wanted), moment, words).tolist()

    every = moment.ids.tolist()
    assert ids(species="sheep") == every == ids(brush="swarm")
    assert ids(ids=(3, 900)) == [3]
    x, y = moment.xyz[4, :2]
    assert ids(near=(float(x) + 0.01, float(y))) == [moment.ids[4]]
    assert ids(near=(1000.0, 0.0)) == []
    west = float(np.median(moment.xyz[:, 0]))
    assert ids(box=(0, 0, west, 30)) == moment.ids[moment.xyz[:, 0] <= west].tolist()
    with pytest.raises(ValueError, match="no species 'shep'.*did you mean 'sheep'"):
        ids(species="shep")


def test_ids_are_written_in_ranges():
    assert ids_text((1, 2, 3, 7, 9, 10)) == "1-3, 7, 9-10"
    assert ids_of("9-10, 7,1-3") == (1, 2, 3, 7, 9, 10)
    for bad in ("", "a", "3-1", "0", "1,,2", "1-99999999999"):
        with pytest.raises(ValueError, match="1-40, 52"):
            ids_of(bad)


# the command and the file -------------------------------------------------------------------


def test_undo_redo_and_layers(cli, run):
    cli("edit", run, "--ids", "1", "--delete")
    cli("edit", run, "--species", "sheep", "--retime", "2", "--from", "0.5", "--layer", "fast")
    cli("edit", run, "--near", "10,15", "--move", "1,2", "--turn", "30", "--over", "1")
    assert [e.kind for e in edits_of(run).edits()] == ["delete", "move", "retime"]
    assert [cli("edit", run, "--undo").code for _ in range(2)] == [0, 0]
    assert [e.kind for e in edits_of(run).edits()] == ["delete"]  # those made last
    assert cli("edit", run, "--redo").code == 0
    assert [e.kind for e in edits_of(run).edits()] == ["delete", "retime"]
    assert edits_of(run).layer("fast").edits[0].start == 0.5
    assert cli("edit", run, "--off", "fast").code == 0
    assert [e.kind for e in edits_of(run).edits()] == ["delete"]
    listed = cli("edit", run)
    assert "retime 23 animals from 0.5 s: speed 2.0" in listed.out and "species sheep at 0.5 s" in listed.out
    assert cli("edit", run, "--freeze", "--ids", "2").code == 0
    done = cli("edit", run, "--redo")
    assert done.code == 1 and "nothing to redo" in done.err  # a new edit ends what could be done again
    assert cli("edit", run, "--remove-layer", "fast").code == 0
    assert [layer.name for layer in edits_of(run).layers] == ["edits"]


def test_animals_are_selected_as_the_edits_so_far_show_them(cli, run, told):
    _, moments = told
    here = moments[16]
    old, new = here.xyz[here.ids == 1][0, :2], here.xyz[here.ids == 1][0, :2] + (40, 0)

    def around(point):
        x, y = point
        return ("--box", f"{x - 0.01},{y - 0.01},{x + 0.01},{y + 0.01}", "--at", "0.5")

    def selected(*how):
        done = cli("edit", run, *how, "--look", "size=2")
        return list(edits_of(run).edits()[-1].ids) if done.code == 0 else done.err

    assert selected(*around(old)) == [1]
    assert cli("edit", run, "--undo").code == 0
    assert cli("edit", run, "--ids", "1", "--move", "40,0").code == 0
    assert "no animal is selected" in selected(*around(old))
    assert selected(*around(new)) == [1]
    assert cli("edit", run, "--ids", "2", "--delay", "0.25").code == 0
    then = moments[8]  # where animal 2 is shown a quarter of a second later
    assert selected(*around(then.xyz[then.ids == 2][0, :2])) == [2]
    assert cli("edit", run, "--ids", "3", "--delete").code == 0
    assert selected("--species", "sheep") == [animal for animal in here.ids.tolist() if animal != 3]


def test_a_turn_is_about_the_middle_of_the_animals_as_they_are_shown(cli, run, told):
    first = told[1][0]
    cli("edit", run, "--ids", "1-2", "--move", "10,20")
    assert cli("edit", run, "--ids", "1-2", "--turn", "90").code == 0
    middle = first.xyz[:2, :2].mean(axis=0) + (10, 20)
    assert edits_of(run).edits()[-1].about == pytest.approx(middle, abs=1e-3)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--delete",), "no animals are selected"),
        (("--ids", "1"), "no edit for the selected animals"),
        (("--ids", "900", "--delete"), "no animal is selected at 0 s by ids"),
        (("--ids", "x", "--delete"), "1-40, 52"),
        (("--ids", "1", "--delete", "--freeze"), "one edit at a time"),
        (("--ids", "1", "--move", "a,b"), "2 or 3 numbers"),
        (("--box", "5,5,1,1", "--delete"), "WEST,SOUTH"),
        (("--species", "wolf", "--delete"), "no species 'wolf'"),
        (("--ids", "1", "--look", "brush=none"), "no brush 'none'"),
        (("--ids", "1", "--look", "hat=red"), "brush=NAME"),
        (("--ids", "1", "--delete", "--from", "9"), "ends at 1.25 s"),
        (("--ids", "1", "--delay", "1", "--from", "0.5"), "whole run"),
        (("--ids", "1", "--freeze", "--from", "1", "--until", "0.5"), "later than --from"),
        (("--ids", "1", "--freeze", "--over", "1"), "can only be used with --move"),
        (("--undo",), "nothing to undo"),
        (("--on", "x"), "no layer 'x'"),
        (("--ids", "1", "--delete", "--layer", " "), "--layer: a layer must have a name, got ' '"),
    ],
)
def test_what_cannot_be_edited_is_refused_with_a_sentence(cli, run, arguments, said):
    done = cli("edit", run, *arguments)
    assert done.code == 1 and said in done.err
    assert not beside(run).exists()


def test_edits_of_another_recording_are_refused(cli, run, level, tmp_path):
    cli("edit", run, "--ids", "1", "--delete")
    other = tmp_path / "other.flock"
    assert cli("run", level, "--ticks", 3, "--record", other).code == 0
    beside(run).rename(beside(other))
    done = cli("export", other, "--to", tmp_path / "a.csv")
    assert done.code == 1 and "edits belong to another recording" in done.err
    assert not (tmp_path / "a.csv").exists()
    assert cli("export", other, "--to", tmp_path / "a.csv", "--no-edits").code == 0


GOOD = f"""recording = "run.flock"
sha256 = "{"0" * 64}"
[[layers]]
name = "one"
[[layers.edits]]
kind = "retime"
ids = "1-3"
speed = 2
"""


def test_a_file_of_edits_states_its_format(tmp_path):
    edits = parse_edits(GOOD.encode(), tmp_path / "a.edits.toml")
    edits.save()
    assert edits.path.read_text().startswith('schema = "flockbrush.edits/1"\n')
    assert parse_edits(edits.path.read_bytes(), edits.path).layers == edits.layers


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('"retime"', '"remember"', "one of delete, move"),
        ("speed = 2", "sped = 2", "did you mean 'speed'"),
        ("speed = 2", "speed = 0", "0.01 to 100"),
        ("speed = 2", 'speed = "fast"', "must be a number"),
        ("speed = 2", "by = [1, 2, 3]", "unknown name"),
        ('"1-3"', '"3-1"', "1-40, 52"),
        ('"1-3"', "[1, 2]", "1-40, 52"),
        ("speed = 2", "start = 5\nend = 2", "later than the start"),
        ('name = "one"', "on = 3", "true or false"),
        ('name = "one"', "", "a layer must have a name"),
        ("0" * 64, "abc", "SHA-256"),
        ("recording", 'schema = "flockbrush.edits/2"\nrecording', "is of a newer Flockbrush"),
        ("[[layers]]", 'order = ["two"]\n[[layers]]', "name the layer of each edit"),
    ],
)
def test_what_is_wrong_with_a_file_of_edits_is_said_with_its_line(old, new, said):
    assert parse_edits(GOOD.encode(), "a.edits.toml").edits()[0].speed == 2
    with pytest.raises(ProblemsError, match="a.edits.toml:[0-9]+: ") as error:
        parse_edits(GOOD.replace(old, new).encode(), "a.edits.toml")
    assert said in str(error.value)


def test_a_file_comes_back_as_it_was_written(cli, run):
    for arguments in (
        ("--near", "10,15", "--move", "1,2,3", "--turn", "-20", "--over", "0.5", "--from", "0.1", "--until", "0.9"),
        ("--brush", "march", "--look", "size=1.5", "--look", "brush=swarm"),
        ("--ids", "4-6", "--delay", "-0.25", "--layer", 'a "b" \\ ü 🐑 \x7f'),
    ):
        assert cli("edit", run, *arguments).code == 0
    file = edits_of(run)
    text = file.path.read_bytes()
    file.save()
    assert file.path.read_bytes() == text
    again = edits_of(run)
    assert (again.layers, again.done, again.undone) == (file.layers, file.done, file.undone)


# exports ------------------------------------------------------------------------------------


def test_every_kind_of_export_shows_the_edits_and_says_so(cli, run, tmp_path, told):
    pytest.importorskip("pxr.Usd")
    cli("edit", run, "--ids", "1-4", "--delete")
    cli("edit", run, "--ids", "5", "--retime", "0.5")
    cli("edit", run, "--ids", "6", "--look", "size=2")
    outs = [tmp_path / f"a.{kind}" for kind in ("csv", "glb", "usdc", "sqlite", "movebank.csv")]
    arguments = [word for out in outs for word in ("--to", out)]
    done = cli("export", run, *arguments, "--fps", 16, "--gltf-mode", "crowd")
    assert done.code == 0, done.err
    assert "applied 3 edits of 1 layer" in done.err and "--no-edits" in done.err
    left = list(range(5, 25))
    _, moments = told
    half = moments[20]

    with open(outs[0], newline="") as file:
        rows = [row for row in csv.DictReader(file) if row["frame"] == "20"]
    assert [int(row["id"]) for row in rows] == left
    assert np.allclose([float(rows[0][n]) for n in "xyz"], half.xyz[half.ids == 5][0], atol=1e-6)

    about, records = Scene(outs[1]).crowd()
    assert about["ids"] == left and "group" in records.dtype.names
    assert np.allclose(records[20]["place"][0], half.xyz[half.ids == 5][0], atol=1e-4)
    assert about["scales"][about["first_body"][1]][0] == pytest.approx(2 * half.length[half.ids == 6][0], abs=1e-4)

    from pxr import Usd, UsdGeom

    stage = Usd.Stage.Open(str(outs[2]))
    herd = UsdGeom.PointInstancer(stage.GetPrimAtPath("/World/Herd"))
    assert list(herd.GetIdsAttr().Get(20)) == left
    with sqlite3.connect(outs[3]) as base:
        assert [k for (k,) in base.execute("select distinct id from trajectory_data order by id")] == left
    base.close()
    with open(outs[4], newline="") as file:
        assert sorted({int(row["tag-local-identifier"]) for row in csv.DictReader(file)}) == left


def test_an_export_without_edits_is_the_run(cli, run, tmp_path):
    assert cli("export", run, "--to", tmp_path / "a.csv").code == 0
    cli("edit", run, "--ids", "1-4", "--freeze", "--from", "0.5")
    assert cli("export", run, "--to", tmp_path / "b.csv", "--no-edits").code == 0
    cli("edit", run, "--off", "edits")
    assert cli("export", run, "--to", tmp_path / "c.csv").code == 0
    assert (tmp_path / "a.csv").read_bytes() == (tmp_path / "b.csv").read_bytes() == (tmp_path / "c.csv").read_bytes()


def test_a_page_names_the_edits_it_shows(cli, run, tmp_path):
    cli("edit", run, "--ids", "1-4", "--delete")
    assert cli("export", run, "--to", tmp_path / "a.html", "--fps", 2).code == 0
    import base64
    import re
    import zlib

    text = (tmp_path / "a.html").read_text()
    about = re.search(r'data-kind="about">([^<]*)<', text).group(1)
    assert b"run.edits.toml" in zlib.decompress(base64.b64decode(about))


def test_animals_that_have_left_are_shown_again_where_their_time_goes_slowly(told):
    """Ids of a moment need not be those of the run at that time."""
    simulation, moments = told
    gone = [
        m if m.time < 0.5 else replace(m, **{k: v[1:] for k, v in vars(m).items() if isinstance(v, np.ndarray)})
        for m in moments
    ]
    first = int(moments[0].ids[0])
    view = EditedMoments(simulation, [Edit("retime", (first,), speed=0.5)], past_of(gone, [first]))
    assert first in view.at(gone[20]).ids.tolist() and first not in gone[20].ids.tolist()
    assert first not in view.at(gone[40]).ids.tolist()
    ids = view.at(gone[20]).ids
    assert (np.diff(ids) > 0).all()

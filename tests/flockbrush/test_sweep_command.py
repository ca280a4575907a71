"""The command sweep: what it prints, refuses and leaves behind."""

import importlib.util
import json
import math
from pathlib import Path

import cv2
import numpy as np
import pytest
from flockbrush.behaviours.brush import shipped
from flockbrush.engine.problems import ProblemsError
from flockbrush.levels.sketch import LevelSketch
from flockbrush.levels.tiled import write_project
from flockbrush.systems import measures
from pens import pen
from scipy.special import ndtri
from small_sweep import FLOCKS, here, rows_without_times, sweep_file

from flockbrush.runs import run as running
from flockbrush.studies.experiments import LevelRuns, experiments, lasting, perform
from flockbrush.studies.sweep import RESULTS, Journal, sweep_to
from flockbrush.studies.sweep_file import parse_sweep, read_sweep
from flockbrush.studies.sweep_report import show, summarise


def test_the_command_writes_rows_summary_and_plots(cli, tmp_path):
    told = cli("sweep", sweep_file(tmp_path), "--out", tmp_path / "out", "--jobs", 1, "--json")
    assert told.code == 0, told.err
    found = json.loads(told.out)
    assert (found["runs"], found["done"], found["failed"]) == (24, 24, 0)
    assert found["scenarios"][0]["parameters"] == {"birds": 3, "angle": 180}
    assert found["scenarios"][0]["means"]["leads"]["mean"] == pytest.approx(1.0, abs=0.5)
    assert [line["kept"] for line in found["expected"]] == [True, True]
    assert json.loads((tmp_path / "out" / "summary.json").read_text())["schema"] == "flockbrush.runs/1"
    known = {*RESULTS, *experiments()["v_rules"]().drawn}  # files that the sweep may not replace if they are of others
    assert {Path(file).name for file in found["files"]} <= known
    rows = rows_without_times(tmp_path / "out")
    assert len(rows) == 24
    assert rows[0] | {"seed": "0", "birds": "3", "angle": "180.0", "status": "ok"} == rows[0]
    for name in ("means", "formations", "forming", "distance_over_time"):
        picture = cv2.imread(str(tmp_path / "out" / f"{name}.png"))
        assert picture is not None and np.ptp(picture) > 100
    if importlib.util.find_spec("pyarrow"):
        import pyarrow.parquet as pq

        table = pq.read_table(tmp_path / "out" / "runs.parquet")
        assert table["leads"].to_pylist() == [int(row["leads"]) for row in rows]
        assert table.schema.metadata[b"schema"] == b"flockbrush.runs/1"
    again = cli("sweep", sweep_file(tmp_path), "--out", tmp_path / "out", "--resume")
    assert again.code == 0
    assert "24 of 24 runs" in again.out
    assert rows_without_times(tmp_path / "out") == rows


def test_the_exit_code_tells_of_what_was_expected_and_did_not_come(cli, tmp_path):
    wrong = FLOCKS.replace("mean = [0.5, 1.5]", "mean = [2.5, 3.5]")
    told = cli("sweep", sweep_file(tmp_path, wrong), "--out", tmp_path / "out", "--jobs", 1)
    assert told.code == 1
    assert "MISSED" in told.out


def summary_of(rows):
    """(sweep, summary) of one scenario with so many seeds, of which each gave a row of measures."""
    one = FLOCKS.replace("[3, 5]", "[3]").replace("[180, 170]", "[180]").replace("count = 6", f"count = {len(rows)}")
    sweep, journal = parse_sweep(one.encode(), "f.sweep.toml"), Journal("none.jsonl")
    for seed, measures_of_run in enumerate(rows):
        row = {"status": "ok", "seconds": 0.1, "measures": measures_of_run}
        journal.rows[sweep.scenarios[0].hash, seed] = row
    return sweep, summarise(sweep, journal)


def test_the_summary_tells_of_how_many_runs_a_mean_is(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "200")
    sweep, summary = summary_of([{"settled_distance": d, "distance": 1.0} for d in (0.1, None, 0.3, None, 0.2)])
    (scenario,) = summary["scenarios"]
    assert scenario["runs"] == 5
    assert [scenario["means"][name]["n"] for name in ("distance", "settled_distance", "leads")] == [5, 3, 0]
    assert scenario["means"]["settled_distance"]["error"] == pytest.approx(0.1 / 3**0.5)
    show(sweep, summary | {"files": []})
    assert "0.20 ± 0.10 (3 runs)" in capsys.readouterr().out


@pytest.mark.parametrize(("yes", "no"), [(60, 0), (59, 1), (0, 7), (1, 0)])
@pytest.mark.parametrize("answers", [(1, 0), (True, False)])
def test_intervals_of_shares_are_shares(yes, no, answers):
    name = "stabilised" if answers == (1, 0) else "leads"  # a measure of any unit may be true or false
    values = [answers[0]] * yes + [answers[1]] * no
    _, summary = summary_of([{name: value, "shape": "V" if value else "J"} for value in values])
    (scenario,) = summary["scenarios"]
    n, z = yes + no, float(ndtri(0.975))
    for found in (scenario["means"][name], *([scenario["share_intervals"]["shape"]["V"]] if yes else [])):
        assert 0 <= found["low"] < found["high"] <= 1
        for end in (found["low"], found["high"]):  # Wilson (1927): the true shares at z standard deviations from it
            assert abs(yes / n - end) == pytest.approx(z * math.sqrt(end * (1 - end) / n), abs=1e-12)


def test_numbers_that_happen_to_be_0_or_1_are_no_shares():
    _, summary = summary_of([{"leads": leads} for leads in (0, 1, 1, 1)])
    assert summary["scenarios"][0]["means"]["leads"]["high"] == pytest.approx(0.75 + 3.182446 * 0.25)


def test_files_that_are_not_there_are_told(cli, tmp_path):
    assert "there is no such file" in cli("sweep", "nowhere.sweep.toml", "--out", tmp_path / "out").err
    assert (
        "no shipped sweep of this name; did you mean 'v_rules'?" in cli("sweep", "v_rule", "--out", tmp_path / "o").err
    )
    (tmp_path / "file").touch()
    assert "--out must be a folder" in cli("sweep", sweep_file(tmp_path), "--out", tmp_path / "file").err
    assert cli("sweep", sweep_file(tmp_path), "--out", tmp_path / "o", "--jobs", 1, "--cluster", "tcp://x:1").code == 2


LEVEL = """
schema = "flockbrush.sweep/1"
measures = ["animals", "polarization", "mean polarization", "crossed gate to its right"]
[seeds]
count = 2
[grid]
agents = [6, 12]
brush.march.sensitivity = [5, 20]
[fixed]
level = "pen.tmj"
seconds = 1.0
every = 0.25
"""


def test_any_level_is_swept_over_its_brushes_and_animals(tmp_path):
    pen(tmp_path)
    sweep = read_sweep(sweep_file(tmp_path, LEVEL))
    assert [tuple(s.varied) for s in sweep.scenarios] == [("agents", "brush.march.sensitivity")] * 4
    rows = sweep_to(sweep, tmp_path / "out", here, 2).rows
    assert {row["status"] for row in rows.values()} == {"ok"}
    measured = [[rows[s.hash, seed]["measures"] for seed in (0, 1)] for s in sweep.scenarios]
    assert [m[0]["animals"] for m in measured] == [6, 6, 12, 12]
    assert len({m["polarization"] for pair in measured for m in pair}) == 8
    assert all(0 < m["mean polarization"] <= 1 for pair in measured for m in pair)


def test_a_sweep_that_is_read_again_has_the_level_of_now_and_the_measures_of_now(tmp_path, monkeypatch):
    pen(tmp_path)
    monkeypatch.setattr(measures, "_registry", dict(measures._registry))
    before = read_sweep(sweep_file(tmp_path, LEVEL))
    pen(tmp_path, sheep=5)
    measures.measure("late")(lambda herd: 1.0)
    after = read_sweep(sweep_file(tmp_path, LEVEL.replace('"animals"', '"animals", "late"')))
    assert after.scenarios[0].files["pen.tmj"] == (tmp_path / "pen.tmj").read_bytes()
    assert len({scenario.hash for scenario in (*before.scenarios, *after.scenarios)}) == 8


def test_a_sweep_reads_each_level_once(tmp_path, monkeypatch):
    read = []
    pen(tmp_path)
    opened = running.open_level
    monkeypatch.setattr(running, "open_level", lambda name: read.append(name) or opened(name))
    assert len(read_sweep(sweep_file(tmp_path, LEVEL)).scenarios) == 4
    assert read == [tmp_path / "pen.tmj"]


def test_a_worker_that_lacks_a_measure_says_so(tmp_path, monkeypatch):
    """Processes that are started anew do not have what a program has registered."""
    monkeypatch.setattr(measures, "_registry", dict(measures._registry))
    measures.measure("late")(lambda herd: 1.0)
    scenario = read_sweep(sweep_file(tmp_path, PLANE.replace('"polarization"', '"polarization", "late"'))).scenarios[0]
    job = "level", scenario.parameters, scenario.files, (0, 1), scenario.measures
    assert [error for *_, error, _ in perform(*job)] == [None, None]
    del measures._registry["late"]
    for _, row, error, _ in perform(*job):
        assert row is None and error.startswith("this worker has no measure 'late'; register it where workers do")


def small_pasture(folder):
    write_project(folder, shipped())
    sketch = LevelSketch(20, 20, 1.0, "tilesets")
    sketch.ground("grass")
    sketch.box("Spawn", 10, 10, 8, 8, "flock", species="sheep", brush="graze", count=4)
    return sketch


def test_brushes_between_two_are_not_swept_for_they_are_in_no_file(tmp_path):
    sketch = small_pasture(tmp_path)
    sketch.box("Zone", 10, 10, 9, 9, "soft", brush="march", strength=0.5)
    sketch.save(tmp_path / "pen.tmj")
    text = LEVEL.replace("crossed gate to its right", "milling").replace("brush.march.", "brush.graze--march--3of12.")
    with pytest.raises(ProblemsError, match="the level does not use a brush 'graze--march--3of12'"):
        read_sweep(sweep_file(tmp_path, text))


def test_an_area_that_the_script_takes_away_is_no_number(tmp_path):
    sketch = small_pasture(tmp_path)
    area = sketch.box("Area", 10, 10, 20, 20, "middle")
    sketch.draw("Key", [(1, 1)], "gone", at=0.25, command="RemoveThing", kind="area", id=area)
    sketch.save(tmp_path / "pen.tmj")
    ready = LevelRuns().ready({"level": "pen.tmj", "seconds": 0.5}, tmp_path)
    ((_, row, error, _),) = perform("level", ready.parameters, ready.files, (0,), tuple(ready.measures))
    assert error is None and row["animals"] == 4 and math.isnan(row["in middle"])


def test_a_run_of_a_sweep_is_the_run_of_the_level(tmp_path):
    from flockbrush.runs.run import start

    pen(tmp_path)
    sweep = read_sweep(sweep_file(tmp_path, LEVEL.replace("brush.march.sensitivity = [5, 20]\n", "")))
    rows = sweep_to(sweep, tmp_path / "out", here, 2).rows
    simulation = start(tmp_path / "pen.tmj", 1, 12)
    simulation.run(32)
    measured = rows[sweep.scenarios[1].hash, 1]["measures"]
    assert measured["polarization"] == simulation.measures()["polarization"]


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (
            "march.sensitivity",
            "marsh.sensitivity",
            "8: grid.brush.marsh.sensitivity: the level does not use a brush 'marsh'",
        ),
        (
            "march.sensitivity",
            "march.sensitive",
            "8: grid.brush.march.sensitive: unknown name; did you mean 'sensitivity'",
        ),
        ("[5, 20]", "[5, -20]", "8: grid.brush.march.sensitivity[1]: must be from 0 to 1000"),
        ("pen.tmj", "pan.tmj", "10: fixed.level: pan.tmj: there is no such file"),
        ('"animals"', '"animal"', "3: measures: there is no measure 'animal'; did you mean 'animals'?"),
        ("agents = [6, 12]", "agents = [6, 0]", "7: grid.agents[1]: must be at least 1"),
    ],
)
def test_mistakes_about_levels_are_told_with_their_line(tmp_path, old, new, said):
    pen(tmp_path)
    with pytest.raises(ProblemsError) as found:
        parse_sweep(LEVEL.replace(old, new, 1).encode(), "f.sweep.toml", tmp_path)
    assert f"f.sweep.toml:{said}" in str(found.value)


@pytest.mark.parametrize(
    ("key", "said"),
    [
        ("drives.homing.speed", "numbers of drives cannot be varied, only those of the model, speed, body and vision"),
        ("drives", "numbers of drives cannot be varied, only those of the model, speed, body and vision"),
        ("speed.mean.more", "what is varied is called brush.NAME.PARAMETER, or brush.NAME.speed.mean"),
    ],
)
def test_a_number_of_a_brush_that_cannot_be_varied_is_told_once(tmp_path, key, said):
    pen(tmp_path)
    with pytest.raises(ProblemsError) as found:
        parse_sweep(LEVEL.replace("march.sensitivity", f"march.{key}", 1).encode(), "f.sweep.toml", tmp_path)
    assert str(found.value) == f"f.sweep.toml:8: grid.brush.march.{key}: {said}"


def test_a_brush_that_a_level_names_as_a_file_is_swept(tmp_path):
    (tmp_path / "own").mkdir()
    (tmp_path / "own" / "march.brush.toml").write_bytes(shipped().get("march").source)
    path = pen(tmp_path)
    path.write_text(path.read_text().replace('"march"', '"own/march.brush.toml"'))
    sweep = read_sweep(sweep_file(tmp_path, LEVEL.replace("agents = [6, 12]", "agents = [6]")))
    rows = sweep_to(sweep, tmp_path / "out", here, 2).rows
    assert len({rows[s.hash, 0]["measures"]["polarization"] for s in sweep.scenarios}) == 2


PLANE = """
schema = "flockbrush.sweep/1"
measures = ["polarization"]
[seeds]
count = 2
[grid]
brush.march.wander = [0.0, 3.0]
[fixed]
plane = "march"
agents = 12
seconds = 2.0
"""


def test_a_herd_on_a_plane_is_swept_over_its_brush(tmp_path):
    from flockbrush.behaviours.brush import shipped
    from flockbrush.levels.build import plane

    sweep = read_sweep(sweep_file(tmp_path, PLANE))
    rows = sweep_to(sweep, tmp_path / "out", here, 2).rows
    wandering = sweep.scenarios[1]
    simulation = plane(shipped().get("march").with_parameters(wander=3.0), 12, seed=1)
    simulation.run(64)
    assert rows[wandering.hash, 1]["measures"]["polarization"] == simulation.measures()["polarization"]


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('plane = "march"', 'plane = "marsh"', "there is no brush 'marsh'; did you mean 'march'?"),
        ('plane = "march"', 'plane = "march"\nlevel = "meadow"', "must have either level or plane"),
        ('plane = "march"\n', "", "must have either level or plane"),
        ('plane = "march"', 'plane = "march"\nevery = 50', "every must be at most seconds"),
    ],
)
def test_mistakes_about_planes_are_told(tmp_path, old, new, said):
    with pytest.raises(ProblemsError) as found:
        parse_sweep(PLANE.replace(old, new, 1).encode(), "f.sweep.toml", tmp_path)
    assert said in str(found.value)


def test_what_lasts_in_a_flock_that_never_settles_is_measured():
    from flockbrush.behaviours.v_rules.rules import OVERLAP, VRuleSettings

    best = 1 + OVERLAP
    v = np.array([(0, 0, 0), (best, -0.4, 0), (-best, -0.4, 0), (2 * best, -0.8, 0)])
    apart = v + [(0, 0, 0), (9, 0, 0), (0, 0, 0), (9, 0, 0)]
    found = lasting(np.array([v] * 8 + [v, v, apart, apart, v, v, v, v]), VRuleSettings(), every=10)
    assert found["v_like"] == pytest.approx(6 / 8)
    assert found["persistence"] == pytest.approx(80 / 3)  # V, several groups, V
    assert found["mean_groups"] == pytest.approx((6 * 1 + 2 * 2) / 8)


def test_a_table_that_is_too_wide_leaves_measures_out_and_says_so(cli, tmp_path):
    path = tmp_path / "wide.sweep.toml"
    path.write_text(
        'schema = "flockbrush.sweep/1"\nexperiment = "level"\n[seeds]\ncount = 1\n'
        '[fixed]\nlevel = "meadow"\nseconds = 0.25\n[grid]\nagents = [5, 10]\n'
    )
    told = cli("sweep", path, "--out", tmp_path / "out", "--jobs", 1)
    assert told.code == 0, told.err
    lines = told.out.splitlines()
    head = next(line for line in lines if "polarization" in line)
    assert head.split()[:3] == ["agents", "runs", "runs/s/core"] and max(map(len, lines)) <= 160
    assert [line.split()[0] for line in lines if line.split()[1:2] == ["1"]] == ["5", "10"]
    assert "the table has no room for" in told.out and "summary.json" in told.out

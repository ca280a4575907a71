"""Sweeps: their files, their workers, their journal, and what comes of them."""

import csv
import importlib.util
import json
import os
import subprocess
import sys
import time
import tracemalloc
from concurrent.futures import Future, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from clusters import dask_cluster
from flockbrush.engine import limits
from flockbrush.engine.files import held
from flockbrush.engine.problems import ProblemsError
from pens import pen
from processes import environment
from workers import doublings

from flockbrush.studies.experiments import experiments, lasting, perform
from flockbrush.studies.sweep import Journal, jobs_of, processes, run_jobs, runs_done, sweep_to
from flockbrush.studies.sweep_file import parse_sweep, read_sweep
from flockbrush.studies.sweep_report import panels_of

FLOCKS = """
schema = "flockbrush.sweep/1"
title = "small flocks"
experiment = "v_rules"

[seeds]
count = 6

[grid]
birds = [3, 5]
angle = [180, 170]

[fixed]
steps = 300

[[expect]]
measure = "leads"
where = { angle = 180 }
mean = [0.5, 1.5]
"""


def sweep_file(folder, text=FLOCKS, name="flocks"):
    path = folder / f"{name}.sweep.toml"
    path.write_text(text)
    return path


def here():
    """Workers that are threads of this process."""
    return ThreadPoolExecutor(2)


def rows_without_times(folder):
    with open(folder / "runs.csv", newline="") as file:
        return [{k: v for k, v in row.items() if k != "core_seconds"} for row in csv.DictReader(file)]


# files -------------------------------------------------------------------------------------


def test_a_sweep_is_every_combination_with_every_seed(tmp_path):
    sweep = read_sweep(sweep_file(tmp_path))
    assert [tuple(s.varied.values()) for s in sweep.scenarios] == [(3, 180), (3, 170), (5, 180), (5, 170)]
    assert sweep.runs == 24
    assert len({s.hash for s in sweep.scenarios}) == 4
    assert sweep.scenarios[0].parameters["steps"] == 300


def test_cases_are_combined_with_the_grid():
    cases = '[[case]]\ntitle = "as settled"\n[[case]]\ntitle = "stacked"\nstation = "spaced"\n'
    sweep = parse_sweep((FLOCKS + cases).encode(), "c.sweep.toml")
    assert len(sweep.scenarios) == 8
    assert {s.varied["case"]: s.parameters["station"] for s in sweep.scenarios} == {
        "as settled": "clear",
        "stacked": "spaced",
    }


def test_seeds_may_be_listed_one_by_one():
    listed = FLOCKS.replace("count = 6", "list = [5, 1]")
    assert parse_sweep(listed.encode(), "c.sweep.toml").seeds == (5, 1)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (
            'experiment = "v_rules"',
            'experiment = "v_rule"',
            "4: experiment: there is no experiment 'v_rule'; did you mean",
        ),
        ("angle = [180, 170]", "angle = [180, 200]", "11: grid.angle[1]: must be from 1 to 180 degrees, got 200"),
        ("angle = [180, 170]", "angel = [180]", "11: grid.angel: unknown name; did you mean 'angle'?"),
        ("angle = [180, 170]", "angle = 180", "11: grid.angle: a grid takes an array of values, got 180"),
        ("angle = [180, 170]", "angle = [180, 180]", "11: grid.angle: has a value twice"),
        ("steps = 300", "steps = 300\nbirds = 4", "15: fixed.birds: is in [grid] as well"),
        ("steps = 300", 'steps = "300"', "14: fixed.steps: must be a whole number, got '300'; write the number alone"),
        ("count = 6", "", "6: seeds: takes count (and first), or list"),
        ("count = 6", "count = 0", "7: seeds.count: must be"),
        ('title = "small flocks"', "titel = 3", "3: titel: unknown name; did you mean 'title'?"),
        (
            'title = "small flocks"',
            'measures = ["lead"]',
            "3: measures: there is no measure 'lead'; did you mean 'leads'?",
        ),
        (
            'measure = "leads"',
            'measure = "lead"',
            "17: expect[0].measure: there is no measure 'lead'; did you mean 'leads'?",
        ),
        ("angle = 180 }", "angle = 175 }", "18: expect[0].where.angle: is never 175; it is 180, 170"),
        ("mean = [0.5, 1.5]", "", "16: expect[0]: takes mean or more_than"),
        (
            '"flockbrush.sweep/1"',
            '"flockbrush.sweep/2"',
            "2: schema: is 'flockbrush.sweep/2'; it must be 'flockbrush.sweep/1'",
        ),
        ("[grid]", "[grid", "is not TOML"),
    ],
)
def test_mistakes_are_told_with_their_line(old, new, said):
    assert old in FLOCKS
    with pytest.raises(ProblemsError) as found:
        parse_sweep(FLOCKS.replace(old, new, 1).encode(), "f.sweep.toml")
    assert any(f"f.sweep.toml:{said}" in line or said in line for line in str(found.value).splitlines()), found.value


def test_all_mistakes_are_told_at_once():
    wrong = FLOCKS.replace("angle", "angel").replace("steps = 300", "steps = -1").replace("[3, 5]", "[0, 5]")
    with pytest.raises(ProblemsError) as found:
        parse_sweep(wrong.replace("angel = 180 }", "angle = 180 }").encode(), "f.sweep.toml")
    assert len(found.value.problems) == 3


# workers -------------------------------------------------------------------------------------


def done(jobs, executor, width=2):
    return sorted(run_jobs(jobs, executor, width), key=lambda row: row["seed"])


def test_every_run_is_done_once_by_whatever_executor():
    rows = done(doublings(23, 4), here)
    assert [row["twice"] for row in rows] == [2 * seed for seed in range(23)]


def test_a_worker_that_is_killed_once_loses_nothing(tmp_path):
    rows = done(doublings(12, 3, deadly=4, note=str(tmp_path / "died")), lambda: processes(2))
    assert [row["twice"] for row in rows] == [2 * seed for seed in range(12)]


class DeadlyExecutor:
    """Breaks, as a pool of processes does, when it gets one seed; what it has not begun breaks with it."""

    def __init__(self, deadly):
        self.deadly, self.broken = deadly, False

    def submit(self, function, seeds, *arguments):
        future = Future()
        if self.broken or self.deadly in seeds:
            self.broken = True
            future.set_exception(BrokenProcessPool("a process was terminated abruptly"))
        else:
            future.set_result(function(seeds, -1, ""))
        return future

    def shutdown(self, wait=True, cancel_futures=False):
        pass


def test_a_run_that_kills_its_worker_every_time_fails_alone():
    rows = done(doublings(12, 3), lambda: DeadlyExecutor(4))
    assert [row["seed"] for row in rows] == list(range(12))
    assert [row["seed"] for row in rows if row["status"] == "failed"] == [4]
    assert "the worker died 3 times (BrokenProcessPool" in rows[4]["error"]


def test_a_run_that_raises_fails_alone(tmp_path, monkeypatch):
    kind = experiments()["v_rules"]
    run = type(kind).run

    def sometimes(self, parameters, files, seeds):
        if 2 in seeds:
            raise ArithmeticError("the second\n is wrong")
        return run(self, parameters, files, seeds)

    monkeypatch.setattr(type(kind), "run", sometimes)
    sweep = read_sweep(sweep_file(tmp_path))
    entries = perform("v_rules", sweep.scenarios[0].parameters, {}, (1, 2, 3), ("leads",))
    assert [(seed, error) for seed, _, error, _ in entries] == [
        (1, None), (2, "ArithmeticError: the second is wrong"), (3, None),
    ]  # fmt: skip


# journal ---------------------------------------------------------------------------------------


def test_a_sweep_that_was_stopped_goes_on_where_it_was(tmp_path):
    sweep = read_sweep(sweep_file(tmp_path))

    class Enough(Exception):
        pass

    def stop():
        raise Enough

    with pytest.raises(Enough):
        sweep_to(sweep, tmp_path / "out", here, 1, look=stop)
    journal = sweep_to(sweep, tmp_path / "out", here, 2, resume=True)
    whole = sweep_to(sweep, tmp_path / "at once", here, 2)
    assert {key: row["measures"] for key, row in journal.rows.items()} == {
        key: row["measures"] for key, row in whole.rows.items()
    }
    assert list(jobs_of(sweep, journal)) == []


def test_a_journal_is_not_begun_twice_by_mistake(tmp_path):
    sweep = read_sweep(sweep_file(tmp_path))
    sweep_to(sweep, tmp_path / "out", here, 2)
    with pytest.raises(ProblemsError, match="there are 24 runs already; continue with --resume"):
        sweep_to(sweep, tmp_path / "out", here, 2)


def test_a_line_cut_off_in_the_journal_is_done_again(tmp_path):
    sweep = read_sweep(sweep_file(tmp_path))
    before = sweep_to(sweep, tmp_path / "out", here, 2).rows
    path = tmp_path / "out" / "runs.jsonl"
    data = path.read_bytes()
    path.write_bytes(data[:-20])
    assert sum(len(job.seeds) for job in jobs_of(sweep, Journal(path))) == 1
    after = sweep_to(sweep, tmp_path / "out", here, 2, resume=True).rows
    assert {key: row["measures"] for key, row in after.items()} == {key: row["measures"] for key, row in before.items()}
    assert path.read_bytes().count(b"\n") == 1 + 24  # the build, and a line for each run


GOOD_ROW = '{"scenario": "a", "seed": 1, "status": "ok", "seconds": 0.5, "measures": {}}\n'


@pytest.mark.parametrize(
    "line",
    [
        "hello",
        '{"scenario": "a", "seed": 1}',
        GOOD_ROW.replace('"a"', "[]").strip(),
        GOOD_ROW.replace('"ok"', '"failed"').strip(),
        "[" * 5000,
        '"' + "x" * limits.JOURNAL_LINE + '"',
    ],
    ids=lambda line: line[:40],
)
def test_other_files_are_not_taken_for_a_journal(tmp_path, line):
    (tmp_path / "runs.jsonl").write_text(GOOD_ROW + line + "\n")
    with pytest.raises(ProblemsError, match=r"runs.jsonl:2: is no row of a sweep"):
        Journal(tmp_path / "runs.jsonl")


def test_a_hundred_million_seeds_are_never_listed(tmp_path):
    """Neither reading such a sweep, nor asking what is left of it, makes a list of them."""
    sweep = read_sweep(sweep_file(tmp_path, FLOCKS.replace("count = 6", "count = 100000000")))
    journal = Journal(tmp_path / "runs.jsonl")
    journal.rows[sweep.scenarios[0].hash, 0] = json.loads(GOOD_ROW) | {
        "measures": dict.fromkeys(sweep.scenarios[0].measures)
    }
    tracemalloc.start()
    try:
        left = jobs_of(sweep, journal)
        assert next(left).seeds[0] == 1
        assert runs_done(sweep, journal) == 1
        assert tracemalloc.get_traced_memory()[1] < 10 << 20
    finally:
        tracemalloc.stop()


def test_only_what_changed_in_the_file_is_run_anew(tmp_path):
    sweep_to(read_sweep(sweep_file(tmp_path)), tmp_path / "out", here, 2)
    more = read_sweep(sweep_file(tmp_path, FLOCKS.replace("[3, 5]", "[5, 7]").replace("count = 6", "count = 7")))
    left = jobs_of(more, Journal(tmp_path / "out" / "runs.jsonl"))
    assert sum(len(job.seeds) for job in left) == 2 * 7 + 2 * 1


def rows_in(journal):
    """How many rows are whole; the first line is the build."""
    return max(0, journal.read_bytes().count(b"\n") - 1) if journal.exists() else 0


def test_a_program_that_is_killed_leaves_no_workers_and_loses_no_row(cli, tmp_path):
    psutil = pytest.importorskip("psutil", reason="psutil is not installed; it comes with flockbrush[cluster]")
    long = sweep_file(tmp_path, FLOCKS.replace("count = 6", "count = 3000").replace("[3, 5]", "[15, 16]"))
    run = subprocess.Popen(
        [sys.executable, "-m", "flockbrush", "sweep", str(long), "--out", str(tmp_path / "out"), "--jobs", "2"],
        env=environment(), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    journal, end = tmp_path / "out" / "runs.jsonl", time.monotonic() + 240
    while rows_in(journal) < 50 and time.monotonic() < end and run.poll() is None:
        time.sleep(0.02)
    second = cli("sweep", long, "--out", tmp_path / "out", "--resume")
    assert second.code == 1 and f"runs.jsonl: process {run.pid} on " in second.err
    written = rows_in(journal)
    workers = psutil.Process(run.pid).children(recursive=True)
    run.kill()
    run.wait()
    gone, left = psutil.wait_procs(workers, timeout=120)
    assert len(gone) >= 2 and left == []
    done = Journal(journal).rows
    assert len(done) >= written >= 50
    assert all(row["status"] == "ok" for row in done.values())
    with held(journal):
        assert sorted(path.name for path in journal.parent.iterdir()) == [".runs.jsonl.flockbrush", "runs.jsonl"]


# the command -------------------------------------------------------------------------------------


def test_the_command_writes_rows_summary_and_plots(cli, tmp_path):
    told = cli("sweep", sweep_file(tmp_path), "--out", tmp_path / "out", "--jobs", 1, "--json")
    assert told.code == 0, told.err
    found = json.loads(told.out)
    assert (found["runs"], found["done"], found["failed"]) == (24, 24, 0)
    assert found["scenarios"][0]["parameters"] == {"birds": 3, "angle": 180}
    assert found["scenarios"][0]["means"]["leads"]["mean"] == pytest.approx(1.0, abs=0.5)
    assert [line["kept"] for line in found["expected"]] == [True, True]
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


def test_files_that_are_not_there_are_told(cli, tmp_path):
    assert "there is no such file" in cli("sweep", "nowhere.sweep.toml", "--out", tmp_path / "out").err
    assert (
        "no shipped sweep of that name; did you mean 'v_rules'?" in cli("sweep", "v_rule", "--out", tmp_path / "o").err
    )
    (tmp_path / "file").touch()
    assert "--out names a folder" in cli("sweep", sweep_file(tmp_path), "--out", tmp_path / "file").err
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
        ("march.sensitivity", "marsh.sensitivity", "8: grid.brush.marsh.sensitivity: the level uses no brush 'marsh'"),
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
        ('plane = "march"', 'plane = "march"\nlevel = "meadow"', "takes level, or plane"),
        ('plane = "march"\n', "", "takes level, or plane"),
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


# a cluster -----------------------------------------------------------------------------------------


@pytest.fixture
def cluster():
    with dask_cluster() as found:
        yield found


def test_a_cluster_does_what_processes_do_even_when_a_worker_is_killed(cli, tmp_path, cluster):
    address, workers = cluster
    many = FLOCKS.replace("count = 6", "count = 150").replace("[3, 5]", "[5, 7]")
    (tmp_path / "out").mkdir()
    run = subprocess.Popen(
        [sys.executable, "-m", "flockbrush", "sweep", str(sweep_file(tmp_path, many)), "--out", str(tmp_path / "out"),
         "--cluster", address],
        env=environment(), stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
    )  # fmt: skip
    journal, end = tmp_path / "out" / "runs.jsonl", time.monotonic() + 240
    while not rows_in(journal) and time.monotonic() < end and run.poll() is None:
        time.sleep(0.05)
    os.kill(workers[0].pid, 9)
    told = run.communicate(timeout=240)[0]
    assert run.returncode == 0, told
    assert "600 of 600 runs" in told
    rows = rows_without_times(tmp_path / "out")
    seeds = "count = 3"
    assert (
        cli(
            "sweep", sweep_file(tmp_path, many.replace("count = 150", seeds)), "--out", tmp_path / "few", "--jobs", 1
        ).code
        == 0
    )
    few = rows_without_times(tmp_path / "few")
    assert [row for row in rows if int(row["seed"]) < 3] == few


def test_a_scheduler_that_dies_is_told_in_one_line(tmp_path):
    many, begun = FLOCKS.replace("count = 6", "count = 2000"), []
    with dask_cluster(1, begun=begun) as (address, _):
        run = subprocess.Popen(
            [sys.executable, "-m", "flockbrush", "sweep", str(sweep_file(tmp_path, many)), "--out",
             str(tmp_path / "out"), "--cluster", address],
            env=environment(), stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
        )  # fmt: skip
        journal, end = tmp_path / "out" / "runs.jsonl", time.monotonic() + 240
        while rows_in(journal) < 5 and time.monotonic() < end and run.poll() is None:
            time.sleep(0.05)
        begun[0].kill()
        told = run.communicate(timeout=240)[0]
    assert run.returncode == 1
    assert told == f"{address}: is gone; finished work is in {tmp_path / 'out'}; continue with --resume\n"


def test_a_cluster_that_is_not_there_is_told(cli, tmp_path, monkeypatch):
    pytest.importorskip("distributed", reason="dask is not installed: pip install 'flockbrush[cluster]'")
    monkeypatch.setattr("flockbrush.studies.sweep.ANSWERS", "1s")
    told = cli("sweep", sweep_file(tmp_path), "--out", tmp_path / "out", "--cluster", "localhost:1")
    assert told.code == 1
    assert "no Dask scheduler answers there" in told.err


@pytest.mark.parametrize("address", ["nonsense://1", "localhost", "tcp://localhost", "two words:1", ""])
def test_an_address_that_is_none_is_told_at_once(cli, tmp_path, address):
    pytest.importorskip("distributed", reason="dask is not installed: pip install 'flockbrush[cluster]'")
    told = cli("sweep", sweep_file(tmp_path), "--out", tmp_path / "out", "--cluster", address)
    assert told.code == 1
    assert "such as tcp://host:8786" in told.err


def test_panels_of_a_sweep_name_units_of_parameters_and_measures():
    sweep = SimpleNamespace(
        varied={"birds": [5, 15, 25], "angle": [90.0, 170.0]}, measures=["distance"],
        plot=SimpleNamespace(across=None, lines=None, measures=None), experiment=experiments()["v_rules"],
    )  # fmt: skip
    found = [
        {"parameters": {"birds": birds, "angle": angle}, "means": {"distance": {"mean": 1.0, "error": 0.1}}}
        for birds in (5, 15, 25)
        for angle in (90.0, 170.0)
    ]
    (panel,) = panels_of(sweep, {"scenarios": found})
    assert (panel.title, panel.across) == ("distance, wingspans", "birds")
    assert [curve.name for curve in panel.curves] == ["angle 90°", "angle 170°"]
    sweep.plot.across = "angle"
    (panel,) = panels_of(sweep, {"scenarios": found})
    assert panel.across == "angle, degrees"

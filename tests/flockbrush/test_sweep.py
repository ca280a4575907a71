"""Sweeps: their files, their workers, their journal, and what comes of them."""

import json
import subprocess
import sys
import time
import tracemalloc
from concurrent.futures import Future
from concurrent.futures.process import BrokenProcessPool

import pytest
from flockbrush.engine import limits
from flockbrush.engine.files import held
from flockbrush.engine.problems import ProblemsError
from processes import environment
from small_sweep import FLOCKS, here, rows_in, sweep_file
from workers import doublings

from flockbrush.studies.experiments import experiments, perform
from flockbrush.studies.sweep import Journal, jobs_of, processes, run_jobs, runs_done, sweep_to
from flockbrush.studies.sweep_file import parse_sweep, read_sweep

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
        ("angle = [180, 170]", "angle = 180", "11: grid.angle: a grid must have an array of values, got 180"),
        ("angle = [180, 170]", "angle = [180, 180]", "11: grid.angle: contains a value twice"),
        ("angle = [180, 170]", "angle = [180, 180.0]", "11: grid.angle: contains a value twice"),
        ("angle = [180, 170]", "angle = {}", "11: grid.angle: a grid must have an array of values, got a table"),
        ("steps = 300", "steps = 300\nbirds = 4", "15: fixed.birds: is in [grid] as well"),
        ("steps = 300", 'steps = 300\n[[case]]\ntitle = "x"\nbirds = 4', "17: case[0].birds: is in [grid] as well"),
        ("steps = 300", 'steps = "300"', "14: fixed.steps: must be a whole number, got '300'; write the number alone"),
        ("count = 6", "", "6: seeds: must have either count (and first) or list"),
        ("count = 6", "count = 0", "7: seeds.count: must be"),
        ('title = "small flocks"', "titel = 3", "3: titel: unknown name; did you mean 'title'?"),
        (
            'title = "small flocks"',
            "level = 'x'",
            "3: level: unknown name; available: case, expect, experiment, fixed, grid",
        ),
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
        ("mean = [0.5, 1.5]", "", "16: expect[0]: must have either mean or more_than"),
        ("mean = [0.5, 1.5]", "more_than = { angle = 180 }", "19: expect[0].more_than: compares scenarios with thems"),
        ("mean = [0.5, 1.5]", "more_than = {}", "19: expect[0].more_than: compares scenarios with themselves alone"),
        (
            '"flockbrush.sweep/1"',
            '"flockbrush.sweep/2"',
            "2: schema: 'flockbrush.sweep/2' is of a newer Flockbrush; this one reads 'flockbrush.sweep/1'",
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
    kind = experiments()["v_rules"]()
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
    with pytest.raises(ProblemsError, match="the folder already has 24 runs; continue with --resume"):
        sweep_to(sweep, tmp_path / "out", here, 2)


@pytest.mark.parametrize("resume", [False, True])
def test_a_sweep_does_not_replace_the_results_of_another(tmp_path, resume):
    sweep_to(read_sweep(sweep_file(tmp_path)), tmp_path / "out", here, 2)
    before = (tmp_path / "out" / "runs.jsonl").read_bytes()
    other = read_sweep(sweep_file(tmp_path, FLOCKS.replace("steps = 300", "steps = 200"), "other"))
    with pytest.raises(ProblemsError, match="its 24 runs are of another sweep") as refusal:
        sweep_to(other, tmp_path / "out", here, 2, resume)
    assert "resume" not in str(refusal.value)
    assert (tmp_path / "out" / "runs.jsonl").read_bytes() == before


def test_runs_that_a_narrower_sweep_does_not_have_are_told_and_kept(tmp_path, capsys):
    sweep_to(read_sweep(sweep_file(tmp_path)), tmp_path / "out", here, 2)
    narrow = read_sweep(sweep_file(tmp_path, FLOCKS.replace("[3, 5]", "[3]").replace("count = 6", "count = 5")))
    with pytest.raises(ProblemsError, match=r"has 24 runs \(10 of them of this sweep\); continue with --resume"):
        sweep_to(narrow, tmp_path / "out", here, 2)
    assert len(sweep_to(narrow, tmp_path / "out", here, 2, resume=True).rows) == 24
    told = "runs.jsonl: 14 of its 24 runs are not of this sweep as it is now: they stay in this file, but not in the"
    assert told in " ".join(capsys.readouterr().err.split())


def test_files_with_names_of_results_that_are_of_no_sweep_are_refused_before_it_begins(tmp_path):
    sweep, foreign = read_sweep(sweep_file(tmp_path)), ("runs.csv", "summary.json", "forming.png")
    for name in foreign:
        (tmp_path / name).write_text("mine")
    with pytest.raises(ProblemsError, match="was not written by Flockbrush") as refusal:
        sweep_to(sweep, tmp_path, here, 2)
    assert [problem.file for problem in refusal.value.problems] == [str(tmp_path / name) for name in foreign]
    assert not (tmp_path / "runs.jsonl").exists()


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
    with pytest.raises(ProblemsError, match=r"runs.jsonl:2: is not a row of a sweep"):
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

"""Sweeps on a cluster: workers of other code, dead schedulers, the same rows."""

import itertools
import subprocess
import sys
import time
from types import SimpleNamespace

import pytest
from clusters import dask_cluster
from processes import environment
from small_sweep import FLOCKS, rows_in, rows_without_times, sweep_file

from flockbrush.studies.experiments import experiments
from flockbrush.studies.sweep_report import panels_of


@pytest.fixture(scope="module")
def cluster():
    """(address, processes: scheduler and two workers); the first test kills a worker, the next the scheduler."""
    begun = []
    with dask_cluster(begun=begun) as (address, _):
        yield address, begun


def test_a_cluster_does_what_processes_do_even_when_a_worker_is_killed(cli, tmp_path, cluster):
    address, begun = cluster
    many = FLOCKS.replace("count = 6", "count = 80").replace("[3, 5]", "[5, 7]")
    (tmp_path / "out").mkdir()
    run = subprocess.Popen(
        [sys.executable, "-m", "flockbrush", "sweep", str(sweep_file(tmp_path, many)), "--out", str(tmp_path / "out"),
         "--cluster", address],
        env=environment(), stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
    )  # fmt: skip
    journal, end = tmp_path / "out" / "runs.jsonl", time.monotonic() + 240
    while not rows_in(journal) and time.monotonic() < end and run.poll() is None:
        time.sleep(0.05)
    begun[1].kill()
    told = run.communicate(timeout=240)[0]
    assert run.returncode == 0, told
    assert "320 of 320 runs" in told
    rows = rows_without_times(tmp_path / "out")
    few = sweep_file(tmp_path, many.replace("count = 80", "count = 3"))
    assert cli("sweep", few, "--out", tmp_path / "few", "--jobs", 1).code == 0
    few = rows_without_times(tmp_path / "few")
    assert [row for row in rows if int(row["seed"]) < 3] == few


def test_a_scheduler_that_dies_is_told_in_one_line(tmp_path, cluster):
    many, (address, begun) = FLOCKS.replace("count = 6", "count = 2000"), cluster
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
    there = tmp_path / "out"
    assert told == f"{address}: cannot be reached any more; finished runs are in {there}; continue with --resume\n"


def test_a_cluster_that_is_not_there_is_told(cli, tmp_path, monkeypatch):
    pytest.importorskip("distributed", reason="dask is not installed: pip install 'flockbrush[cluster]'")
    monkeypatch.setattr("flockbrush.runs.cluster.ANSWERS", "1s")
    told = cli("sweep", sweep_file(tmp_path), "--out", tmp_path / "out", "--cluster", "localhost:1")
    assert told.code == 1
    assert "no Dask scheduler answers at this address" in told.err


@pytest.mark.parametrize("address", ["nonsense://1", "localhost", "tcp://localhost", "two words:1", ""])
def test_an_address_that_is_none_is_told_at_once(cli, tmp_path, address):
    pytest.importorskip("distributed", reason="dask is not installed: pip install 'flockbrush[cluster]'")
    told = cli("sweep", sweep_file(tmp_path), "--out", tmp_path / "out", "--cluster", address)
    assert told.code == 1
    assert "such as tcp://host:8786" in told.err


def test_panels_of_a_sweep_name_units_of_parameters_and_measures():
    sweep = SimpleNamespace(
        varied={"birds": [5, 15, 25], "angle": [90.0, 170.0]}, measures=["distance"],
        plot=SimpleNamespace(across=None, lines=None, measures=None), experiment=experiments()["v_rules"](),
    )  # fmt: skip
    found = [
        {"parameters": {"birds": birds, "angle": angle}, "means": {"distance": {"mean": 1.0, "error": 0.1}}}
        for birds in (5, 15, 25)
        for angle in (90.0, 170.0)
    ]
    (panel,), left_out = panels_of(sweep, {"scenarios": found})
    assert left_out == ""
    assert (panel.title, panel.across) == ("distance, wingspans", "birds")
    assert [curve.name for curve in panel.curves] == ["angle 90°", "angle 170°"]
    sweep.plot.across = "angle"
    (panel,), _ = panels_of(sweep, {"scenarios": found})
    assert panel.across == "angle, degrees"


def test_a_plot_says_which_scenarios_it_has_no_room_for():
    varied = {"birds": [3, 5], "angle": [float(angle) for angle in range(160, 170)], "steps": [100, 200]}
    sweep = SimpleNamespace(
        varied=varied, measures=["distance"], experiment=experiments()["v_rules"](),
        plot=SimpleNamespace(across="birds", lines="angle", measures=None),
    )  # fmt: skip
    found = [
        {"parameters": dict(zip(varied, values, strict=True)), "means": {"distance": {"mean": values[2], "error": 0.1}}}
        for values in itertools.product(*varied.values())
    ]
    (panel,), left_out = panels_of(sweep, {"scenarios": found})
    assert len(panel.curves) == 8 and {y for curve in panel.curves for y in curve.y} == {100.0}
    assert left_out == (
        "drawn: steps 100, of 2 values; the first 8 of 10 values of angle; all are in runs.csv and summary.json"
    )

"""An experiment of another package: it is run like ours, and named with its file where it fails."""

import re
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from flockbrush.engine.plugins import PluginError

from flockbrush.studies import experiments as experiments_module
from flockbrush.studies.experiments import Experiment, LevelRuns, Ready, experiment, experiments, perform
from flockbrush.studies.sweep import sweep_to
from flockbrush.studies.sweep_file import read_sweep
from flockbrush.studies.sweep_report import summarise, write_files

SWEEP = """
schema = "flockbrush.sweep/1"
experiment = "dice"
measures = ["sum"]
[seeds]
list = [3, 4]
[grid]
dice = [1, 2]
"""


class Dice(Experiment):
    """Throws dice."""

    name = "dice"

    def ready(self, parameters, folder):
        return Ready(parameters, {}, ["sum"])

    def run(self, parameters, files, seeds):
        return [{"sum": np.random.default_rng(seed).integers(1, 7, parameters["dice"]).sum()} for seed in seeds]


def read(folder, monkeypatch, **methods):
    """A sweep of dice, some of whose methods are others."""
    monkeypatch.setattr(experiments_module, "_registry", experiments())
    experiment(type("Dice", (Dice,), {"__module__": __name__, **methods}))
    (folder / "dice.sweep.toml").write_text(SWEEP)
    return read_sweep(folder / "dice.sweep.toml")


def failing(*_):
    return 1 / 0


def test_it_is_run_for_every_seed(tmp_path, monkeypatch):
    sweep = read(tmp_path, monkeypatch)
    rows = sweep_to(sweep, tmp_path / "out", lambda: ThreadPoolExecutor(1), width=1).rows
    for scenario in sweep.scenarios:
        for seed in (3, 4):
            thrown = np.random.default_rng(seed).integers(1, 7, scenario.varied["dice"])
            assert rows[scenario.hash, seed]["measures"] == {"sum": int(thrown.sum())}


@pytest.mark.parametrize(
    ("ready", "words"),
    [
        (failing, r":[0-9]+: experiment 'dice' of .*test_experiments_of_others failed: ZeroDivisionError"),
        (lambda *_: {}, ": experiment 'dice': ready must return Ready, got dict"),
        (lambda *_: Ready({"die": object()}, {}, ["sum"]), ": experiment 'dice' of .* object is not JSON serializable"),
    ],
)
def test_what_checks_its_parameters_is_named(ready, words, tmp_path, monkeypatch):
    with pytest.raises(PluginError, match=f"test_experiments_of_others.py{words}"):
        read(tmp_path, monkeypatch, ready=ready)


@pytest.mark.parametrize(
    ("run", "words"),
    [
        (failing, r":\d+: experiment 'dice' of .*test_experiments_of_others failed: ZeroDivisionError"),
        (lambda *_: [], "experiment 'dice' must return a row for each of 1 seeds, got 0"),
        (lambda *_: [7], "experiment 'dice' must return rows that are dicts, got int"),
        (lambda *_: [{"sum": np.ones(2)}], "experiment 'dice': sum must be a number, a text or None, got ndarray"),
    ],
)
def test_the_row_of_a_run_that_fails_names_it(run, words, tmp_path, monkeypatch):
    sweep = read(tmp_path, monkeypatch, run=run)
    rows = sweep_to(sweep, tmp_path / "out", lambda: ThreadPoolExecutor(1), width=1).rows
    assert len(rows) == 4
    assert all(re.search(words, row["error"]) for row in rows.values())


def test_what_draws_pictures_is_named_and_the_tables_are_there(tmp_path, monkeypatch):
    sweep = read(tmp_path, monkeypatch, pictures=failing)
    journal = sweep_to(sweep, tmp_path / "out", lambda: ThreadPoolExecutor(1), width=1)
    with pytest.raises(PluginError, match=r"test_experiments_of_others.py:\d+: experiment 'dice'"):
        write_files(sweep, journal, summarise(sweep, journal), tmp_path / "out")
    assert len((tmp_path / "out" / "runs.csv").read_text().splitlines()) == 5


def test_a_worker_that_lacks_it_says_so():
    ((seed, row, said, _),) = perform("darts", {}, {}, (3,), ("sum",))
    assert (seed, row) == (3, None)
    assert said.startswith("this worker has no experiment 'darts'; register it where workers do, too")


def test_a_name_that_is_taken_or_none_is_refused(monkeypatch):
    with pytest.raises(ValueError, match="experiment 'level' is already in flockbrush.studies.experiments"):
        experiment(type("Mine", (Dice,), {"name": "level", "__module__": __name__}))
    with pytest.raises(ValueError, match="must be a class of Experiment with a name"):
        experiment(type("Mine", (Experiment,), {}))
    assert experiments()["level"] is LevelRuns

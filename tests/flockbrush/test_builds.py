"""Builds in recordings, in the journals of sweeps and of workers: other code is named, or refused."""

import importlib
import json
import shutil
import subprocess
import sys

import pytest
from clusters import dask_cluster
from flockbrush.engine.commands import COMMANDS
from flockbrush.engine.fingerprint import Build
from flockbrush.engine.recording import open_recording
from flockbrush.systems import measures
from processes import HOUSE, environment, other_process
from small_sweep import FLOCKS, here, sweep_file
from test_replaying import copied

from flockbrush.runs.builds import OURS, build_of_run, build_of_sweep, build_of_worker, differences
from flockbrush.runs.cluster import MixedCode, OtherCode, work_as
from flockbrush.studies.experiments import perform
from flockbrush.studies.sweep import JOURNAL, Journal, jobs_of, run_jobs, sweep_to
from flockbrush.studies.sweep_file import read_sweep

PACE = "flockbrush/systems/pace.py"
FEW = FLOCKS.replace("count = 6", "count = 2")
MODEL = '''"""A model of one's own."""

import numpy as np

from flockbrush.behaviours.behaviour import Parameters, Wishes, behaviour


class Params(Parameters):
    pass


@behaviour("statue", Params)
def steer(scene, rows, params):
    return Wishes(scene.forward[rows], np.zeros(len(rows)))
'''
MEASURE = """from flockbrush.systems.measures import measure


@measure("breadth")
def breadth(herd):
    return 1.0
"""

COMMAND = """from flockbrush.engine.commands import command


@command
class WhistleTwice:
    def apply(self, world):
        pass
"""


@pytest.fixture(scope="session")
def edited(tmp_path_factory):
    """A copy of all our packages in which animals want to go a hair faster."""
    home = tmp_path_factory.mktemp("edited")
    for package in OURS:  # laid out as a wheel is
        folder = home.joinpath(*package.split("."))
        shutil.copytree(HOUSE / folder.name, folder, ignore=shutil.ignore_patterns("__pycache__"), dirs_exist_ok=True)
    pace = home / "flockbrush" / "systems" / "pace.py"
    text = pace.read_text(encoding="utf-8")
    assert text.count("\nclass Pace(System):") == 1
    pace.write_text(
        text.replace("\nclass Pace(System):", "\nFASTER = 1.0001\n\n\nclass Pace(System):"), encoding="utf-8"
    )
    return home


@pytest.fixture
def sweep(tmp_path):
    return read_sweep(sweep_file(tmp_path, FEW))


SWEEP = """
import sys
from concurrent.futures import ThreadPoolExecutor
from flockbrush.studies.sweep import sweep_to
from flockbrush.studies.sweep_file import read_sweep
sweep_to(read_sweep(sys.argv[1]), sys.argv[2], lambda: ThreadPoolExecutor(2), 2)
"""


# recordings --------------------------------------------------------------------------------


def build_without_tests():
    """`build_of_run` of a process that has imported flockbrush alone; tests register commands and models in theirs."""
    code = "import json; from flockbrush.runs.builds import build_of_run; print(json.dumps(build_of_run().as_json()))"
    done = subprocess.run(
        [sys.executable, "-c", code], env=environment(), capture_output=True, text=True, timeout=300, check=True
    )
    return Build(**json.loads(done.stdout))


def test_a_recording_says_what_made_it(recording):
    header, build = open_recording(recording).header, build_without_tests()
    assert (header["build"]["code"], header["build"]["cpu"]) == (build.code, build.cpu)
    assert header["build"]["sources"] == build.sources
    assert {"flockbrush/systems/pace.py", "flockbrush/engine/state.py", "flockbrush/behaviours/models/herd.py"} <= set(
        build.sources
    )
    assert header["packages"] == build.packages
    assert {"numba", "llvmlite", "numpy", "python"} <= set(build.packages)


def test_the_commands_of_a_user_are_part_of_the_code(monkeypatch, tmp_path):
    (tmp_path / "whistles.py").write_text(COMMAND)
    monkeypatch.syspath_prepend(tmp_path)
    before = build_of_run()
    importlib.import_module("whistles")
    try:
        after = build_of_run()
    finally:
        del COMMANDS["WhistleTwice"], sys.modules["whistles"]
    assert after.code != before.code
    assert set(after.sources) - set(before.sources) == {"whistles.py"}
    assert build_of_run() == before


def other_build(recording, path, **changed):
    return copied(recording, path, header={"build": open_recording(recording).header["build"] | changed})


def test_a_recording_by_other_code_opens_and_names_the_files(cli, recording, tmp_path):
    sources = open_recording(recording).header["build"]["sources"] | {PACE: "0" * 8, "old.py": ""}
    path = other_build(recording, tmp_path / "a.flock", code="0" * 64, sources=sources)
    done = cli("replay", path, "--verify")
    assert done.code == 0
    assert f"recorded with other code: {PACE}, old.py (not here): results may differ" in done.err
    assert cli("measure", path).code == 0


def test_another_processor_is_recorded_and_not_worth_a_word(cli, recording, tmp_path):
    path = other_build(recording, tmp_path / "a.flock", cpu="z80, spectrum, BASIC")
    assert open_recording(path).header["build"]["cpu"] == "z80, spectrum, BASIC"
    done = cli("replay", path, "--verify")
    assert (done.code, done.err) == (0, "")


@pytest.mark.parametrize("build", [None, 3, [], {}, {"code": 1}, {"code": "a", "sources": [1], "cpu": {}}], ids=str)
def test_a_recording_opens_whatever_its_build_says(cli, recording, tmp_path, build):
    path = copied(recording, tmp_path / "a.flock", header={"build": build})
    done = cli("replay", path, "--verify")
    assert done.code == 0
    assert "unknown code" in done.err


@pytest.fixture
def plugin(tmp_path):
    """A folder with a model that an installed package would bring."""
    folder = tmp_path / "site"
    (folder / "statues-1.0.dist-info").mkdir(parents=True)
    (folder / "statues-1.0.dist-info" / "METADATA").write_text("Metadata-Version: 2.1\nName: statues\nVersion: 1.0\n")
    (folder / "statues-1.0.dist-info" / "entry_points.txt").write_text("[flockbrush.behaviours]\nstatue = statues\n")
    (folder / "statues.py").write_text(MODEL)
    return folder


DIFFERING = """
import sys
from flockbrush.cli.level_commands import differing
from flockbrush.engine.recording import open_recording
print(differing(open_recording(sys.argv[1])).get("code"))
"""


def test_the_models_of_a_user_are_part_of_the_code(plugin, level, tmp_path):
    def code(**variables):
        words = [sys.executable, "-c", DIFFERING, tmp_path / "a.flock"]
        return subprocess.check_output(words, env=environment(**variables), text=True, timeout=300).strip()

    path = {"PYTHONPATH": f"{HOUSE}:{plugin}"}
    done = other_process("run", level, "--ticks", 2, "--record", tmp_path / "a.flock", **path)
    assert done.returncode == 0, done.stderr
    assert code(**path) == "None"
    with open(plugin / "statues.py", "a") as file:
        file.write("# more marble\n")
    assert code(**path) == "other code: statues.py"
    assert code() == "other code: statues.py (not here)"


# journals ----------------------------------------------------------------------------------


def builds_in(folder):
    rows = [json.loads(line) for line in (folder / JOURNAL).read_text().splitlines()]
    return [row["build"] for row in rows if "build" in row]


def test_a_journal_begins_with_its_build(sweep, tmp_path):
    sweep_to(sweep, tmp_path / "out", here, 2)
    sweep_to(sweep, tmp_path / "out", here, 2, resume=True)
    assert builds_in(tmp_path / "out") == [build_of_sweep().as_json()]
    assert "flockbrush/studies/sweep.py" in build_of_sweep().sources


def test_a_sweep_does_not_go_on_with_the_runs_of_other_code(edited, tmp_path):
    file, out = sweep_file(tmp_path, FEW), tmp_path / "out"
    subprocess.run([sys.executable, "-c", SWEEP, file, out], env=environment(), timeout=300, check=True)
    before = (out / JOURNAL).read_bytes()
    done = other_process("sweep", file, "--out", out, "--jobs", 1, "--resume", cwd=tmp_path, PYTHONPATH=edited)
    assert done.returncode == 1
    told = f"{out / JOURNAL}: its 8 runs were made by other code: {PACE}; choose another folder"
    assert done.stderr.strip() == told
    assert (out / JOURNAL).read_bytes() == before


def test_a_sweep_does_not_go_on_with_runs_of_nobody_knows_what(cli, sweep, tmp_path):
    out = tmp_path / "out"
    sweep_to(sweep, out, here, 2)
    path = out / JOURNAL
    path.write_bytes(path.read_bytes().split(b"\n", 1)[1])
    told = cli("sweep", sweep_file(tmp_path, FEW), "--out", out, "--jobs", 1, "--resume").err
    assert "its 8 runs were made by unknown code; choose another folder" in told


def test_other_libraries_are_named_and_another_processor_is_not(cli, sweep, tmp_path, monkeypatch):
    monkeypatch.setattr("flockbrush.studies.sweep_report.write_files", lambda *what: [])  # pictures take seconds
    out = tmp_path / "out"
    sweep_to(sweep, out, here, 2)
    path = out / JOURNAL
    first, rest = path.read_text().split("\n", 1)
    row = json.loads(first)
    row["build"]["cpu"] = "z80, spectrum, BASIC"
    path.write_text(json.dumps(row) + "\n" + rest)
    assert cli("sweep", sweep_file(tmp_path, FEW), "--out", out, "--jobs", 1, "--resume").err == ""
    row["build"]["packages"]["numpy"] = "0.1"
    path.write_text(json.dumps(row) + "\n" + rest)
    done = cli("sweep", sweep_file(tmp_path, FEW), "--out", out, "--jobs", 1, "--resume", "--json")
    assert "begun with numpy 0.1 (here" in done.err
    assert json.loads(done.out)["build"]["packages"]["numpy"] == build_of_sweep().packages["numpy"]


# workers -----------------------------------------------------------------------------------


def test_a_worker_refuses_work_for_other_code():
    parameters = ("v_rules", {"birds": 3, "steps": 1}, {}, (0,), ("leads",))
    assert work_as(build_of_worker().code, perform, *parameters)[0][2] is None
    with pytest.raises(OtherCode, match="has code .* here it is 000000000000"):
        work_as("0" * 64, perform, *parameters)


def test_a_worker_that_comes_later_with_other_code_ends_the_sweep(sweep, tmp_path, monkeypatch):
    """Workers may join a cluster at any time: each job says for which code it is."""
    monkeypatch.setattr("flockbrush.runs.cluster.build_of_worker", lambda: build_of_run())
    with pytest.raises(MixedCode, match="a worker on .* has code"):
        list(run_jobs(jobs_of(sweep, Journal(tmp_path / JOURNAL)), here, 2))


def test_a_model_that_a_program_registers_by_itself_is_of_the_journal_and_not_of_workers(monkeypatch, tmp_path):
    """Workers that are started anew do not have it, and need it only where a brush names it."""
    from flockbrush.behaviours import behaviour

    workers, sweeps = build_of_worker(), build_of_sweep()
    (tmp_path / "statues.py").write_text(MODEL)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(behaviour, "_registry", dict(behaviour._registry))
    importlib.import_module("statues")
    assert build_of_worker() == workers
    assert set(build_of_sweep().sources) - set(sweeps.sources) == {"statues.py"}
    monkeypatch.delitem(sys.modules, "statues")


def test_the_measures_and_the_experiment_of_a_user_are_of_the_journal(sweep, tmp_path, monkeypatch):
    monkeypatch.setattr(measures, "_registry", dict(measures._registry))
    monkeypatch.syspath_prepend(tmp_path)
    before, runs = build_of_sweep(), build_of_run()
    (tmp_path / "widths.py").write_text(MEASURE)
    (tmp_path / "skies.py").write_text("class Skies:\n    pass\n")
    importlib.import_module("widths")
    assert set(build_of_sweep("skies").sources) - set(before.sources) == {"widths.py", "skies.py"}
    assert build_of_run() == runs  # a measure changes no herd
    sweep_to(sweep, tmp_path / "out", here, 2)
    assert "widths.py" in builds_in(tmp_path / "out")[0]["sources"]
    monkeypatch.delitem(sys.modules, "widths")


def test_a_cluster_with_an_edited_speed_is_refused(cli, edited, tmp_path):
    with dask_cluster(1, cwd=tmp_path, PYTHONPATH=edited) as (address, _):
        done = cli("sweep", sweep_file(tmp_path, FEW), "--out", tmp_path / "out", "--cluster", address)
    assert done.code == 1
    assert f"has other code: {PACE}; install the same version there and restart the worker" in done.err
    assert not (tmp_path / "out" / JOURNAL).exists()


def test_differences_are_of_code_libraries_and_processor():
    build = build_of_sweep()
    assert differences(build.as_json(), build) == {}
    other = build.as_json() | {"packages": {"numba": "0.1"}, "cpu": "z80"}
    assert differences(other, build) == {
        "libraries": f"numba 0.1 (here {build.packages['numba']})",
        "cpu": f"z80 (here {build.cpu})",
    }


def test_learning_does_not_go_on_with_trials_of_other_code(edited):
    """Also where pip has installed us, and the folders do not stand beside one another."""

    def version():
        program = "from flockbrush.learning.recipe import _version; print(_version())"
        words = [sys.executable, "-c", program]
        done = subprocess.run(
            words, cwd=edited, env=environment(PYTHONPATH=edited), capture_output=True, text=True, check=True
        )
        return done.stdout

    before, pace = version(), edited / PACE
    text = pace.read_text(encoding="utf-8")
    try:
        pace.write_text(text + "# a step further\n", encoding="utf-8")
        assert version() != before
    finally:
        pace.write_text(text, encoding="utf-8")

"""Running levels from the command line: what is told, and that the same run is the same."""

import json
import math
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from flockbrush.engine.recording import open_recording
from pens import pen
from processes import environment, other_process

import flockbrush
from flockbrush.runs import run as running
from flockbrush.runs import terminal


def test_a_run_tells_everything_in_one_object(cli, level, tmp_path):
    before = time.perf_counter() - flockbrush.BEGAN  # how long this program has run
    report = json.loads(cli("run", level, "--ticks", 12, "--record", tmp_path / "a.flock", "--json").out)
    after = time.perf_counter() - flockbrush.BEGAN
    assert report["level"] == "pen"
    assert (report["seed"], report["ticks"], report["agents"]) == (3, 12, 24)
    assert 0 < report["seconds_per_tick"]["median"] <= report["seconds_per_tick"]["p95"] < 1
    assert before < report["startup_seconds"] < after
    assert {"See", "AskModels", "Move", "flush"} <= set(report["systems"])
    assert 0.5 < report["measures"]["polarization"] <= 1
    assert {"milling", "speed_mean", "speed_std", "nnd"} <= set(report["measures"])
    assert report["recording"] == str(tmp_path / "a.flock")
    assert report["exports"] == []
    assert {"flockbrush", "numpy", "numba"} <= set(report["versions"])
    assert 50 < report["peak_memory_mib"] < 4096
    assert len(report["hash"]) == 16


def test_the_times_of_the_systems_add_up_to_nearly_the_ticks(level):
    watch = running.Stopwatch(running.start(level))
    for _ in range(40):
        watch.tick()
    assert 0.5 * sum(watch.seconds) < sum(watch.systems().values()) <= sum(watch.seconds)


def test_a_number_without_meaning_is_null(cli, level):
    measures = json.loads(cli("run", level, "--ticks", 0, "--agents", 1, "--json").out)["measures"]
    assert measures["nnd"] is None
    assert measures["animals"] == 1


def test_no_ticks_at_all_is_a_run_too(cli, level):
    report = json.loads(cli("run", level, "--seconds", 0, "--json").out)
    assert report["ticks"] == 0
    assert report["seconds_per_tick"] == {"median": None, "p95": None}


def test_seconds_are_ticks_of_a_thirty_second(cli, level):
    assert json.loads(cli("run", level, "--seconds", 0.5, "--json").out)["ticks"] == 16


@pytest.mark.parametrize("more", [[], ["--agents", 5]], ids=["as it is", "with more"])
def test_a_level_without_animals_is_refused_with_what_to_draw(cli, tmp_path, more):
    done = cli("run", pen(tmp_path, sheep=0), "--ticks", 2, *more)
    assert done.code == 1
    assert "no animals: draw an area on an object layer 'spawns'" in done.err


def test_people_get_a_table_and_know_how_to_verify(cli, level, tmp_path):
    done = cli("run", level, "--ticks", 3, "--record", tmp_path / "a.flock")
    assert done.code == 0
    assert "pen: 24 animals after 0.09375 s" in done.out
    assert "polarization" in done.out
    assert f"flockbrush replay {tmp_path / 'a.flock'} --verify" in done.out
    assert done.err == "" or done.err.startswith("compiling")


def test_shipped_levels_go_by_name_even_beside_a_folder_of_that_name(cli, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "meadow").mkdir()
    report = json.loads(cli("run", "meadow", "--ticks", 1, "--agents", 10, "--json").out)
    assert report["level"] == "meadow"


def test_the_first_run_says_that_it_compiles_before_it_waits(tmp_path):
    program = """
import numpy, numba
from flockbrush.runs import terminal
with terminal.compiling():
    numba.njit(lambda x: x + 1)(1)
    print("done", file=__import__("sys").stderr)
    numba.njit(lambda x: x + 2)(1)
"""
    done = subprocess.run(
        [sys.executable, "-c", program], env=environment(), capture_output=True, text=True, check=True
    )
    assert done.stderr.splitlines() == [
        "compiling kernels; this takes about a minute, only at the first start ...",
        "done",
    ]


def test_a_run_whose_kernels_are_there_does_not_speak_of_compiling(level, recording):
    assert other_process("run", level, "--ticks", 2).stderr == ""


# stopping ----------------------------------------------------------------------------


def started(*arguments):
    """A run in another process that has come past its first ticks: its recording grows."""
    process = subprocess.Popen(
        [sys.executable, "-m", "flockbrush", *map(str, arguments)],
        env=environment(), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    recording = arguments[arguments.index("--record") + 1]
    deadline = time.monotonic() + 240
    while time.monotonic() < deadline and process.poll() is None:
        if recording.exists() and open_recording(recording).last_tick >= 32:
            return process
        time.sleep(0.05)
    process.kill()
    raise AssertionError(process.communicate())


def test_ctrl_c_keeps_what_was_written(cli, level, tmp_path):
    film, table, recording = tmp_path / "a.mp4", tmp_path / "a.csv", tmp_path / "a.flock"
    process = started("run", level, "--seconds", 9000, "--record", recording, "--export", film, "--export", table)
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=240)
    assert process.returncode == 130
    assert out == ""
    assert "Traceback" not in err
    assert "the written files are complete up to this tick" in err
    run = open_recording(recording)
    assert not run.truncated
    lines = table.read_text().splitlines()
    assert lines[-1].startswith(f"{run.last_tick},")
    assert frames_of(film) == run.last_tick + 1
    assert cli("replay", recording, "--verify").code == 0
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.csv", "a.csv.json", "a.flock", "a.mp4"]


def frames_of(film):
    import av

    with av.open(str(film)) as container:
        return sum(1 for _ in container.decode(video=0))


def test_a_recording_outlives_a_kill_and_half_written_files_go_with_the_next_run(cli, level, tmp_path):
    exports = [part for name in ("a.mp4", "a.csv", "a.parquet", "a.usdc") for part in ("--export", tmp_path / name)]
    process = started("run", level, "--seconds", 9000, "--record", tmp_path / "a.flock", *exports)
    process.kill()
    process.communicate(timeout=240)
    assert not (tmp_path / "a.mp4").exists()  # half a film is none
    assert len(list(tmp_path.iterdir())) == 1 + 5  # the recording, and five hidden folders
    done = cli("replay", tmp_path / "a.flock", "--verify")
    assert done.code == 0
    assert "the recording was not closed" in done.err or "cut off" in done.err
    assert "identical, bit for bit" in done.out
    assert cli("run", level, "--ticks", 3, "--export", tmp_path / "b.csv").code == 0
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.flock", "b.csv", "b.csv.json"]


def test_a_second_run_into_the_same_files_is_refused_and_the_first_goes_on(cli, level, tmp_path):
    recording, table = tmp_path / "a.flock", tmp_path / "a.csv"
    process = started("run", level, "--seconds", 9000, "--record", recording, "--export", table)
    for option, path in (("--record", recording), ("--export", table)):
        second = cli("run", level, "--ticks", 3, option, path)
        assert second.code == 1
        assert second.err.startswith(f"{path}: process {process.pid} on ")
        assert f"run {level} --seconds 9000" in second.err
        assert "has been writing it since" in second.err and "choose another file" in second.err
    process.send_signal(signal.SIGTERM)  # asked politely it ends as by Ctrl-C
    out, err = process.communicate(timeout=240)
    assert (process.returncode, out) == (130, "")
    assert "the written files are complete up to this tick" in err and not open_recording(recording).truncated
    assert cli("replay", recording, "--verify").code == 0
    assert table.read_text().splitlines()[-1].startswith(f"{open_recording(recording).last_tick},")
    assert cli("run", level, "--ticks", 3, "--record", recording, "--export", table).code == 0


def test_the_first_signal_waits_for_the_end_of_a_tick_and_the_second_does_not():
    with terminal.Interrupts() as interrupts:
        interrupts.gently()
        signal.raise_signal(signal.SIGINT)
        with pytest.raises(terminal.Stopped):
            interrupts.check()
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)


def test_before_the_first_tick_a_signal_stops_at_once():
    with terminal.Interrupts(), pytest.raises(KeyboardInterrupt):
        signal.raise_signal(signal.SIGTERM)


def test_a_disk_that_is_full_stops_the_run_in_plain_words(cli, level, tmp_path, monkeypatch):
    from flockbrush.output.formats.csv_table import Csv

    taken = []

    def full(self, moment):
        taken.append(moment)
        if len(taken) == 3:
            raise OSError(28, "No space left on device")

    monkeypatch.setattr(Csv, "take", full)
    (tmp_path / "a.csv").write_text("mine")
    done = cli("run", level, "--ticks", 9, "--export", tmp_path / "a.csv", "--record", tmp_path / "a.flock")
    assert done.code == 1
    assert "No space left on device" in done.err
    assert (tmp_path / "a.csv").read_text() == "mine"
    assert open_recording(tmp_path / "a.flock").last_tick == 2
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.csv", "a.flock"]


def test_an_export_that_is_refused_leaves_the_earlier_recording_where_it_is(cli, level, tmp_path):
    kept = tmp_path / "a.flock"
    assert cli("run", level, "--ticks", 4, "--record", kept).code == 0
    before = kept.read_bytes()
    for wrong in (["--export", tmp_path / "b.csv", "--fps", 60], ["--export", tmp_path / "b.xyz"]):
        done = cli("run", level, "--ticks", 4, "--record", kept, *wrong)
        assert done.code in (1, 2) and done.err
        assert kept.read_bytes() == before and [p.name for p in tmp_path.iterdir()] == ["a.flock"]


def test_options_of_exports_are_refused_where_nothing_is_exported(cli, level):
    for words in (["--fps", 10], ["--theme", "dark"], ["--no-overlays"]):
        done = cli("run", level, "--ticks", 2, *words)
        assert done.code == 2 and words[0] in done.err


def test_who_goes_ahead_of_a_run_to_compare_it_says_where_it_was_stopped(cli, level, tmp_path, monkeypatch):
    from flockbrush.runs.synctest import SyncTest

    whole = SyncTest._go_ahead

    def stopped(self):
        if self.compared:
            os.kill(os.getpid(), signal.SIGINT)
        whole(self)

    monkeypatch.setattr(SyncTest, "_go_ahead", stopped)
    done = cli("run", level, "--ticks", 30, "--synctest", 5, "--record", tmp_path / "a.flock")
    assert done.code == 130
    assert "stopped after tick 5; the written files are complete up to this tick" in done.err
    assert open_recording(tmp_path / "a.flock").last_tick == 5


# names and numbers --------------------------------------------------------------------


def test_files_of_a_level_are_rooted_in_the_folder_they_all_stand_in():
    files = {"a.tmj": b"1", "../tilesets/t.tsj": b"2", "brushes/b.toml": b"3"}
    name, rooted = running.rooted(files, "/designs/barn/a.tmj")
    assert name == "barn/a.tmj"
    assert rooted == {"barn/a.tmj": b"1", "tilesets/t.tsj": b"2", "barn/brushes/b.toml": b"3"}
    assert running.rooted({"a.tmj": b"1"}, "/designs/barn/a.tmj") == ("a.tmj", {"a.tmj": b"1"})


def test_numbers_for_people_are_short():
    assert [terminal.number(v) for v in (0.0, 12345, 0.123456, 1234567.0, math.nan, None)] == [
        "0", "12,345", "0.1235", "1.235e+06", "-", "-",
    ]  # fmt: skip


def test_json_has_no_numbers_that_json_does_not_know():
    values = {"a": math.nan, "b": [math.inf, 1.5], "c": np.float64(2), "d": np.array([1, 2]), "e": "x", "f": None}
    assert terminal.finite(values) == {"a": None, "b": [None, 1.5], "c": 2.0, "d": [1, 2], "e": "x", "f": None}

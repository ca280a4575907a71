"""Recordings lived again: the same bits on other threads, in other processes, for other processors; and found out."""

import json
import os
import re
import shutil
import subprocess
import sys

import pytest
from flockbrush.behaviours.brush import shipped
from flockbrush.engine.commands import Commands
from flockbrush.engine.locks import Advice
from flockbrush.engine.parallel import set_threads, threads
from flockbrush.engine.problems import ProblemsError
from flockbrush.engine.recording import Recording, open_recording, state_hash
from flockbrush.levels.build import build, plane
from flockbrush.levels.reader import read_level
from flockbrush.levels.sketch import LevelSketch
from flockbrush.levels.tiled import write_project
from flockbrush.systems.commands import AddAnimals, PaintBrush, SwitchBrush
from pens import pen
from processes import environment, other_process

import flockbrush
from flockbrush.output.notebook import recording_html
from flockbrush.runs.run import rebuild, record, start


def copied(source, target, hashes=None, assets=None, header=None, last=None):
    """A recording like another one, with some of it changed, and no checksum that tells."""
    run = open_recording(source)
    kept = {key: value for key, value in run.header.items() if key not in ("format", "packages", "assets")}
    with Recording.create(target, kept | (header or {}), run.assets | (assets or {})) as copy:
        for tick, command in run.commands:
            copy.command(tick, command)
        for tick, digest in (run.hashes | (hashes or {})).items():
            copy.hash(tick, digest)
        copy.close(last or run.last_tick)
    return target


def flipped(digest):
    """The same digits but for one bit."""
    return f"{int(digest, 16) ^ 1 << 20:016x}"


# the same bits ----------------------------------------------------------------------------


@pytest.mark.parametrize("count", [1, 2])
def test_a_recording_verifies_on_one_thread_and_on_two(cli, recording, count):
    done = cli("replay", recording, "--verify", "--threads", count)
    assert (done.code, done.err) == (0, "")
    assert ": 41 states up to tick 40 identical, bit for bit" in done.out


@pytest.fixture(scope="module")
def crowd(shared, command):
    """A recording of so many animals that two threads share them."""
    path, before = shared / "crowd.flock", threads()
    command("run", "crowded", "--agents", 5000, "--ticks", 4, "--threads", 2, "--record", path)
    set_threads(before)
    return path


@pytest.mark.parametrize("count", [1, 2, 3])
def test_a_crowd_that_threads_share_verifies_on_any_number_of_them(cli, crowd, count):
    report = json.loads(cli("replay", crowd, "--verify", "--threads", count, "--json").out)
    assert (report["verified"], report["threads"], report["agents"]) == (True, count, 5000)


def test_a_recording_verifies_in_another_process_with_other_hashes_of_strings_and_one_thread(recording):
    done = other_process("replay", recording, "--verify", PYTHONHASHSEED="1", FLOCKBRUSH_THREADS="1")
    assert done.returncode == 0, done.stderr + done.stdout


VERIFIED = """
import sys
from flockbrush.cli.main import called
for path in sys.argv[1:]:
    assert called(["replay", path, "--verify"]) == 0, path
"""


def test_a_recording_verifies_on_a_plain_processor(recording, crowd):
    """Kernels compiled without this machine's vector instructions; numba keeps them beside those for this machine.

    One process compiles all that both need: several would compile some of it more than once.
    """
    plain = environment(NUMBA_CPU_NAME="generic", NUMBA_CPU_FEATURES="", FLOCKBRUSH_THREADS=1)
    words = [sys.executable, "-c", VERIFIED, recording, crowd]
    done = subprocess.run(words, env=plain, capture_output=True, text=True, timeout=500, check=False)
    assert done.returncode == 0, done.stderr + done.stdout


def test_a_recording_needs_no_file_but_itself(cli, tmp_path):
    (tmp_path / "elsewhere").mkdir()
    path = pen(tmp_path / "elsewhere")
    cli("run", path, "--ticks", 20, "--record", tmp_path / "a.flock")
    shutil.rmtree(tmp_path / "elsewhere")
    done = other_process("replay", "a.flock", "--verify", cwd=tmp_path, PYTHONHASHSEED="4242")
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("name", ["mine", "march"])
def test_brushes_of_the_designers_own_are_in_the_recording(cli, tmp_path, name):
    """Also where one takes the place of a shipped brush."""
    folder = tmp_path / "designs"
    (folder / "brushes").mkdir(parents=True)
    text = shipped().path("march").read_text().replace("mean = 4.0", "mean = 1.0")
    assert "mean = 1.0" in text
    (folder / "brushes" / f"{name}.brush.toml").write_text(text)
    path = pen(folder, script=False)
    path.write_text(path.read_text().replace('"march"', f'"{name}"'))
    report = json.loads(cli("run", path, "--ticks", 20, "--record", tmp_path / "a.flock", "--json").out)
    assert report["measures"]["speed_mean"] < 2
    shutil.rmtree(folder)
    assert cli("replay", tmp_path / "a.flock", "--verify").code == 0


def test_a_brush_that_is_given_takes_the_place_of_a_file_of_its_name(tmp_path):
    march = shipped().get("march")
    (tmp_path / "own").mkdir()
    (tmp_path / "own" / "march.brush.toml").write_bytes(march.with_parameters(alignment_weight=0.2).source)
    write_project(tmp_path, shipped())
    sketch = LevelSketch(20, 20, 1.0, "tilesets", "wall", 3)
    sketch.box("Spawn", 10, 10, 12, 12, "flock", species="sheep", brush="graze", count=8)
    sketch.box("Zone", 10, 10, 16, 16, "hurry", brush="own/march.brush.toml")
    path, given = sketch.save(tmp_path / "pen.tmj"), march.with_parameters(alignment_weight=0.9)
    with pytest.warns(
        Advice, match=r"pen: the brush march that is given counts everywhere, not own/march\.brush\.toml"
    ):
        herd = start(path, brush=given)
    with record(tmp_path / "a.flock", herd) as recorder:
        for _ in range(12):
            herd.tick()
            recorder.take()
    run = open_recording(tmp_path / "a.flock")
    assert [data for name, data in run.assets.items() if name.endswith("march.brush.toml")] == [given.source]
    again = rebuild(run)
    again.run(12)
    assert state_hash(again.world) == state_hash(herd.world)


def test_seed_and_number_of_animals_come_from_the_recording(cli, level, tmp_path):
    cli("run", level, "--ticks", 20, "--seed", 77, "--agents", 60, "--record", tmp_path / "a.flock")
    report = json.loads(cli("replay", tmp_path / "a.flock", "--verify", "--json").out)
    assert (report["seed"], report["agents"], report["verified"]) == (77, 60, True)


def test_a_shipped_level_with_files_above_it_verifies(cli, tmp_path):
    cli("run", "predators-valley", "--ticks", 12, "--record", tmp_path / "a.flock")
    assert cli("replay", tmp_path / "a.flock", "--verify").code == 0


def test_what_a_designer_did_meanwhile_is_lived_again(cli, level, tmp_path):
    simulation = start(level)
    recorder = record(tmp_path / "a.flock", simulation)
    for _ in range(30):
        if simulation.clock.tick == 4:
            simulation.submit(AddAnimals("swarm", 30.0, 22.0, 3.0, 5, "goat"))
            simulation.submit(PaintBrush("swarm", 12.0, 15.0, 5.0))
        if simulation.clock.tick == 20:
            simulation.submit(SwitchBrush("march"))
        simulation.tick()
        recorder.take()
    recorder.close()
    report = json.loads(cli("replay", tmp_path / "a.flock", "--verify", "--json").out)
    assert (report["verified"], report["agents"]) == (True, 29)
    names = [type(command).__name__ for _, command in open_recording(tmp_path / "a.flock").commands]
    assert names == ["AddAnimals", "PaintBrush", "SwitchBrush", "SwitchBrush"]  # the third is the level's own


def test_ticks_that_were_not_recorded_one_by_one_are_compared_at_the_end(cli, level, tmp_path):
    simulation = start(level)
    with record(tmp_path / "a.flock", simulation):
        simulation.submit(AddAnimals("swarm", 30.0, 22.0, 3.0, 5, "goat"))
        simulation.run(30)
    done = cli("replay", tmp_path / "a.flock", "--verify")
    assert done.code == 0 and "all 2 of 31 states up to tick 30 that were recorded are identical" in done.out
    copied(tmp_path / "a.flock", tmp_path / "b.flock", {30: flipped(state_hash(simulation.world))})
    assert cli("replay", tmp_path / "b.flock", "--verify").code == 1


def test_a_level_that_was_read_and_built_is_recorded_too(cli, level, tmp_path):
    simulation = build(read_level(level), seed=8)
    with record(tmp_path / "a.flock", simulation):
        simulation.run(12)
    assert cli("replay", tmp_path / "a.flock", "--verify").code == 0
    assert open_recording(tmp_path / "a.flock").header["seed"] == 8


def test_what_has_run_or_has_no_level_is_not_recorded(level, tmp_path):
    path, edited, herd = tmp_path / "a.flock", start(level), plane(shipped().get("march"), 4)
    edited.world.resource(Commands).perform(edited.world, [SwitchBrush("swarm")])
    for simulation, said in ((edited, "commands have changed it already"), (herd, "not read from a level file")):
        with pytest.raises(ProblemsError, match=f"cannot be recorded: .*{said}"):
            record(path, simulation)
    edited.run(2)
    with pytest.raises(ProblemsError, match=f"{level.name}: .* at tick 2, .* would be lost; start the level anew"):
        record(path, edited)
    assert not path.exists()


def test_the_script_runs_once_though_level_and_recording_both_know_it(recording):
    run = open_recording(recording)
    simulation = rebuild(run)
    simulation.run(run.last_tick)
    applied = simulation.world.resource(Commands).log
    assert [type(command).__name__ for _, command in applied] == ["SwitchBrush"]


def test_going_to_a_tick_gives_the_state_recorded_there(cli, recording):
    report = json.loads(cli("replay", recording, "--to-tick", 25, "--json").out)
    assert report["tick"] == 25
    assert report["hash"] == open_recording(recording).hashes[25]


def test_a_snapshot_on_the_way_changes_nothing(cli, level, tmp_path):
    path = tmp_path / "long.flock"
    cli("run", level, "--ticks", 330, "--agents", 10, "--record", path)
    run = open_recording(path)
    assert list(run.keyframes) == [0, 1, 320, 330]
    report = json.loads(cli("replay", path, "--to-tick", 326, "--json").out)
    assert report["hash"] == run.hashes[326]


# found out -----------------------------------------------------------------------------------


@pytest.mark.parametrize("tick", [0, 1, 17, 40])
def test_one_bit_of_one_hash_is_found_and_its_tick_named(cli, recording, tmp_path, tick):
    digest = open_recording(recording).hashes[tick]
    path = copied(recording, tmp_path / "a.flock", hashes={tick: flipped(digest)})
    done = cli("replay", path, "--verify")
    assert done.code == 1
    where = f"in tick {tick}:" if tick else "before its first tick:"
    assert f"the replay differs {where} recorded {flipped(digest)}, replayed {digest}" in done.out
    report = json.loads(cli("replay", path, "--verify", "--json").out)
    assert (report["verified"], report["first_difference"]["tick"]) == (False, tick)


def test_the_first_of_two_differences_is_the_one_that_is_named(cli, recording, tmp_path):
    hashes = open_recording(recording).hashes
    path = copied(recording, tmp_path / "a.flock", hashes={t: flipped(hashes[t]) for t in (30, 12)})
    assert "in tick 12:" in cli("replay", path, "--verify").out


def test_up_to_a_tick_before_the_difference_all_is_well(cli, recording, tmp_path):
    path = copied(recording, tmp_path / "a.flock", hashes={30: flipped(open_recording(recording).hashes[30])})
    assert cli("replay", path, "--verify", "--to-tick", 29).code == 0
    assert cli("replay", path, "--verify", "--to-tick", 30).code == 1


def test_another_seed_differs_before_the_first_tick(cli, recording, tmp_path):
    path = copied(recording, tmp_path / "a.flock", header={"seed": 4})
    assert "before its first tick" in cli("replay", path, "--verify").out


def brush_in(run):
    return next(name for name in run.assets if name.endswith("march.brush.toml"))


def test_a_brush_changed_by_a_hair_inside_a_recording_is_found_out(cli, recording, tmp_path):
    run = open_recording(recording)
    name = brush_in(run)
    text, changes = re.subn(r"alignment_weight = 0\.4\d*", "alignment_weight = 0.41", run.assets[name].decode())
    assert changes == 1
    done = cli("replay", copied(recording, tmp_path / "a.flock", assets={name: text.encode()}), "--verify")
    assert done.code == 1
    assert "the replay differs before its first tick" in done.out  # the palette is part of the state


@pytest.mark.parametrize("damage", [b"\0\xff\0", b"", b'schema = "flockbrush.brush/1"\nmodel = "hered"\n'], ids=repr)
def test_a_damaged_brush_inside_a_recording_is_refused(cli, recording, tmp_path, damage):
    name = brush_in(open_recording(recording))
    path = copied(recording, tmp_path / "a.flock", assets={name: damage})
    done = cli("replay", path, "--verify")
    assert done.code == 1
    assert "march.brush.toml" in done.err
    assert done.out == ""


def test_a_flipped_bit_in_the_files_of_a_recording_is_refused(cli, recording, tmp_path):
    data = bytearray(recording.read_bytes())
    data[1500] ^= 4
    path = tmp_path / "a.flock"
    path.write_bytes(data)
    done = cli("replay", path, "--verify")
    assert done.code == 1
    assert "damaged" in done.err


@pytest.mark.parametrize(
    "header", [{"level": None}, {"level": "x.tmj"}, {"agents": "many"}, {"agents": -1}, {"dt": 0.5}]
)
def test_a_header_that_makes_no_sense_is_refused(cli, recording, tmp_path, header):
    done = cli("replay", copied(recording, tmp_path / "a.flock", header=header), "--verify")
    assert (done.code, done.out) == (1, "")
    assert len(done.err.splitlines()) == 1


def test_a_tick_after_the_end_is_refused(cli, recording):
    done = cli("replay", recording, "--to-tick", 41)
    assert done.code == 1
    assert "ends at tick 40; tick 41 is not in it" in done.err


def test_a_recording_of_other_versions_says_so(cli, recording, tmp_path, monkeypatch):
    monkeypatch.setattr("flockbrush.engine.recording.package_versions", lambda: {"python": "4.0", "numpy": "9.9"})
    path = copied(recording, tmp_path / "a.flock")
    monkeypatch.undo()
    done = cli("replay", path, "--verify")
    assert done.code == 0
    assert "recorded with numpy 9.9 (here " in done.err


def test_the_state_of_a_replay_is_the_state_of_the_run(cli, level, recording):
    report = json.loads(cli("run", level, "--ticks", 40, "--json").out)
    run = open_recording(recording)
    simulation = rebuild(run)
    simulation.run(40)
    assert report["hash"] == run.hashes[40] == state_hash(simulation.world)
    assert os.path.getsize(recording) < 60_000


@pytest.mark.parametrize(
    "command", [("replay",), ("measure", "--json"), ("export", "--to", "out.csv")], ids=lambda c: c[0]
)
def test_motion_that_was_not_recorded_is_not_shown_without_a_word(cli, recording, tmp_path, monkeypatch, command):
    monkeypatch.chdir(tmp_path)
    other = copied(recording, tmp_path / "other.flock", hashes={40: "0" * 16})
    name, *options = command
    assert "this is not what was recorded: the state at tick 40 differs" in cli(name, other, *options).err
    assert "not what was recorded" not in cli(name, recording, *options).err


def test_tables_and_pages_in_python_warn_of_motion_that_was_not_recorded(recording, tmp_path):
    pytest.importorskip("pandas")
    other = copied(recording, tmp_path / "other.flock", hashes={40: "0" * 16})
    for shown in (lambda run: run.to_dataframe(), recording_html):
        with pytest.warns(UserWarning, match="not what was recorded"):
            shown(flockbrush.open_recording(other))

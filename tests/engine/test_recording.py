"""Recordings: written as a herd runs, opened again whole, cut off or damaged, and lived again."""

import json
import os
import signal
import subprocess
import sys

import crafted
import numpy as np
import pytest
from flockbrush.components.agent import Position
from flockbrush.engine import recording as module
from flockbrush.engine import recording_format
from flockbrush.engine.clock import Clock
from flockbrush.engine.recording import Recorder, Recording, RecordingError, first_difference, open_recording, resume
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from small_meadow import Whistle, meadow, submit

HEADER = {"seed": 3, "dt": 1 / 32, "level": "meadow.tmj"}
ASSETS = {"meadow.tmj": b'{"a": 1}' * 40, "brushes/sheep.toml": b"x" * 5000}


def record(path, ticks=40, hash_every=1, keyframe_every=10):
    world, step = meadow()
    submit(world, Whistle(2.5, ["come", "by"]), tick=7)
    recorder = Recorder(Recording.create(path, HEADER, ASSETS), world, hash_every, keyframe_every)
    for tick in range(ticks):
        if tick == 20:
            submit(world, Whistle(-1.0))
        step()
        recorder.take()
    recorder.close()
    return world


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    path = tmp_path_factory.mktemp("recordings") / "run.fbr"
    record(path)
    return path.read_bytes()


@pytest.fixture
def path(tmp_path, written):
    (tmp_path / "run.fbr").write_bytes(written)
    return tmp_path / "run.fbr"


def test_a_recording_comes_back_as_it_was(path):
    run = open_recording(path)
    assert run.header | HEADER == run.header
    assert run.assets == ASSETS
    assert run.commands == [(7, Whistle(2.5, ["come", "by"])), (20, Whistle(-1.0))]
    assert (run.last_tick, run.truncated, run.notice) == (40, False, "")
    assert list(run.hashes) == list(range(41))
    assert list(run.keyframes) == [0, 1, 10, 20, 30, 40]  # both ends, the first tick, and every tenth


def test_a_replay_is_the_same_in_every_tick(path):
    run, (world, step) = open_recording(path), meadow()
    resume(run, world)
    assert first_difference(run, world, step) is None
    assert world.resource(Clock).tick == 40


@pytest.mark.parametrize("tick", [10, 15, 39])
def test_a_replay_may_begin_at_a_snapshot(path, tick):
    run, (world, step) = open_recording(path), meadow()
    resume(run, world, tick)
    assert world.resource(Clock).tick == tick // 10 * 10
    assert first_difference(run, world, step) is None


def test_a_replay_names_the_tick_in_which_a_lamb_was_pushed(path):
    run, (world, step) = open_recording(path), meadow()
    resume(run, world)

    def pushed():
        step()
        if world.resource(Clock).tick == 23:
            world.agents[Position.xyz][0, 2] += 1e-12

    found = first_difference(run, world, pushed)
    assert (found.tick, found.same_until) == (23, 22)
    assert "in tick 23" in str(found)


def test_sparse_hashes_name_the_ticks_between(tmp_path):
    record(tmp_path / "run.fbr", hash_every=8)
    run, (world, step) = open_recording(tmp_path / "run.fbr"), meadow(seed=4)
    assert "before its first tick" in str(first_difference(run, world, step))
    world, step = meadow()
    resume(run, world)
    world.agents[Position.xyz][-1, 2] += 1e-12
    del run.hashes[0]
    assert "between ticks 0 and 8" in str(first_difference(run, world, step))


def test_what_the_level_would_have_done_after_the_end_is_kept(path):
    run, (world, _) = open_recording(path), meadow()
    submit(world, Whistle(2.5, ["come", "by"]), tick=7)
    submit(world, Whistle(99.0), tick=60)
    resume(run, world)
    assert [tick for tick, _ in world.resource(module.Commands).pending] == [7, 20, 60]


def test_a_killed_run_loses_at_most_its_last_second(tmp_path):
    program = f"""
import os, signal, sys
sys.path[:0] = {sys.path!r}
from small_meadow import meadow
from flockbrush.engine.recording import Recorder, Recording
world, step = meadow()
recorder = Recorder(Recording.create({str(tmp_path / "run.fbr")!r}, {HEADER!r}, {{}}), world)
for tick in range(75):
    step()
    recorder.take()
os.kill(os.getpid(), signal.SIGKILL)
"""
    done = subprocess.run([sys.executable, "-c", program], check=False)
    assert done.returncode == -signal.SIGKILL
    run = open_recording(tmp_path / "run.fbr")
    assert run.truncated and "not closed" in run.notice
    assert 75 - 32 <= run.last_tick <= 75


def test_a_cut_off_file_says_where_it_ends(path, written):
    path.write_bytes(written[: len(written) * 2 // 3])
    run = open_recording(path)
    assert run.truncated
    assert run.last_tick < 40
    assert f"after tick {run.last_tick}" in run.notice
    world, step = meadow()
    resume(run, world)
    assert first_difference(run, world, step) is None


def test_an_existing_recording_survives_a_beginning_that_fails(path, written):
    with pytest.raises(RecordingError, match="needs seed"):
        Recording.create(path, {"dt": 1}, {})
    with pytest.raises(RecordingError, match="relative"):
        Recording.create(path, HEADER, {"../meadow.tmj": b""})
    with pytest.raises(RecordingError, match="JSON"):
        Recording.create(path, {**HEADER, "odd": float("nan")}, {})
    assert path.read_bytes() == written
    assert list(path.parent.iterdir()) == [path]


def test_a_recording_of_the_same_name_keeps_the_earlier_one_beside_it(path, written):
    with pytest.raises(RuntimeError), Recording.create(path, HEADER, ASSETS) as recording:
        assert recording.earlier == path.with_name("run.fbr.bak")
        raise RuntimeError
    assert recording.earlier.read_bytes() == written
    assert open_recording(path).last_tick == 0
    record(path.with_name("other.fbr"))
    assert not path.with_name("other.fbr.bak").exists()


def test_a_failing_run_leaves_a_recording_that_was_not_closed(tmp_path):
    with pytest.raises(ZeroDivisionError), Recording.create(tmp_path / "run.fbr", HEADER, {}) as recording:
        recording.hash(5, "ab" * 8)
        raise ZeroDivisionError
    run = open_recording(tmp_path / "run.fbr")
    assert (run.truncated, run.last_tick) == (True, 5)


def damaged(at, by):
    return lambda data: data[:at] + by + data[at + len(by) :]


@pytest.mark.parametrize(
    "change, words",
    [
        (lambda data: b"", "empty"),
        (lambda data: b"hello, world, this is text", "not a recording"),
        (lambda data: data[:5], "cut off in its header"),
        (lambda data: recording_format.file_header(9) + data[16:], "newer"),
        (damaged(8, b"\x07"), "header is damaged"),
        (damaged(60, b"\xff\xff"), "header is damaged"),
        (lambda data: data[:100], "header is damaged or was cut off"),
        (lambda data: data[: data.index(recording_format.ASSET + b"\x01") + 40], "cut off in its copy of"),
    ],
)
def test_what_is_no_whole_beginning_is_refused_in_a_sentence(path, written, change, words):
    path.write_bytes(change(written))
    with pytest.raises(RecordingError, match=words) as caught:
        open_recording(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_missing_file_and_a_folder_are_refused(tmp_path):
    with pytest.raises(RecordingError, match="no such file"):
        open_recording(tmp_path / "nothing.fbr")
    with pytest.raises(RecordingError, match="folder"):
        open_recording(tmp_path)
    with pytest.raises(RecordingError, match="cannot be written"):
        Recording.create(tmp_path / "no" / "folder.fbr", HEADER, {})
    with pytest.raises(RecordingError, match="cannot be written"):
        Recording.create(tmp_path, HEADER, {})


def beginning(header):
    return recording_format.file_header(1) + crafted.record(b"H", 1, json.dumps(header).encode())


@pytest.mark.parametrize(
    "header",
    [[], {}, {"seed": 1, "dt": 1}, {"seed": 1, "dt": "x", "assets": {}},
     {"seed": 1, "dt": 1, "assets": {"../x": {"bytes": 1}}},
     {"seed": 1, "dt": 1, "assets": {"x": {"bytes": -1}}}, {"seed": 1, "dt": 1, "assets": {"x": {"bytes": 1 << 50}}}],
    ids=str,
)  # fmt: skip
def test_a_forged_header_is_refused(tmp_path, header):
    (tmp_path / "run.fbr").write_bytes(beginning(header))
    with pytest.raises(RecordingError):
        open_recording(tmp_path / "run.fbr")


def test_a_forged_asset_is_refused(tmp_path):
    header = {"seed": 1, "dt": 1, "assets": {"x": {"bytes": 1, "sha256": "00" * 32}}}
    (tmp_path / "run.fbr").write_bytes(beginning(header) + crafted.record(b"A", 1, b"x\0y"))
    with pytest.raises(RecordingError, match="does not match its hash in the header"):
        open_recording(tmp_path / "run.fbr")


def test_a_bomb_is_not_let_off(tmp_path, monkeypatch):
    """A few thousand bytes that unpack to many more than they say, or than is allowed."""
    start = beginning({"seed": 1, "dt": 1, "assets": {}})
    for claimed in (10, 1 << 31):
        (tmp_path / "run.fbr").write_bytes(start + crafted.record(b"C", 1, b" " * 5_000_000, claimed))
        run = open_recording(tmp_path / "run.fbr")
        assert run.truncated and "are ignored" in run.notice


@pytest.mark.parametrize("text", ['["Fly", {}]', "[1, 2]", "{}", '["Whistle", {"metres": "far"}]', "[" * 9000, "\\"])
def test_a_forged_command_is_refused(tmp_path, text):
    (tmp_path / "run.fbr").write_bytes(
        beginning({"seed": 1, "dt": 1, "assets": {}}) + crafted.record(b"C", 1, text.encode(), pack=False)
    )
    with pytest.raises(RecordingError, match="tick 1"):
        _ = open_recording(tmp_path / "run.fbr").commands


def test_a_forged_snapshot_is_refused(tmp_path):
    start = beginning({"seed": 1, "dt": 1, "assets": {}})
    (tmp_path / "run.fbr").write_bytes(start + crafted.record(b"K", 1, b"no snapshot at all"))
    run, (world, _) = open_recording(tmp_path / "run.fbr"), meadow()
    before = module.state_hash(world)
    with pytest.raises(RecordingError, match="snapshot of tick 1"):
        resume(run, world, 5)
    assert module.state_hash(world) == before


def test_a_kind_of_record_that_comes_later_is_passed_over(tmp_path):
    start = beginning({"seed": 1, "dt": 1, "assets": {}})
    (tmp_path / "run.fbr").write_bytes(
        start + crafted.record(b"Z", 1, b"?") + crafted.record(b"S", 1, b"12345678") + crafted.record(b"E", 1, b"")
    )
    run = open_recording(tmp_path / "run.fbr")
    assert (list(run.hashes), run.truncated) == ([1], False)


def opened(path):
    """Everything of a recording that can be read, or None where it is refused."""
    try:
        run = open_recording(path)
        return (
            run.hashes,
            run.commands,
            {tick: run.keyframes[tick] for tick in run.keyframes},
            run.assets,
            run.truncated,
        )
    except RecordingError as error:
        assert "\n" not in str(error)
        return None


def check_part_of_the_whole(path, whole):
    part = opened(path)
    if part is not None:
        assert part[0].items() <= whole[0].items()
        assert part[1] == whole[1][: len(part[1])]
        assert part[2].items() <= whole[2].items()
        assert part[3] == whole[3]


fuzz = settings(max_examples=400, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


@fuzz
@given(data=st.data())
def test_a_recording_cut_off_anywhere_opens_or_is_refused(path, written, data):
    whole = opened(path) if path.read_bytes() == written else None
    length = data.draw(st.integers(0, len(written) - 1))
    other = path.with_name("cut.fbr")
    other.write_bytes(written[:length])
    check_part_of_the_whole(other, whole)
    assert opened(other) is None or opened(other)[4]


@fuzz
@given(data=st.data())
def test_a_recording_with_any_bytes_changed_opens_or_is_refused(path, written, data):
    whole = opened(path)
    changed = bytearray(written)
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(0, len(written) - 1))
        changed[at] ^= data.draw(st.integers(1, 255))
    other = path.with_name("changed.fbr")
    other.write_bytes(changed)
    check_part_of_the_whole(other, whole)


def test_hashes_cost_little(tmp_path):
    """Thousand ticks of hashes are a few tens of kilobytes: nobody need switch them off."""
    with Recording.create(tmp_path / "run.fbr", HEADER, {}) as recording:
        for tick in range(1000):
            recording.hash(tick, "0123456789abcdef")
    assert os.path.getsize(tmp_path / "run.fbr") < 50_000
    assert np.array_equal(list(open_recording(tmp_path / "run.fbr").hashes), np.arange(1000))

"""How large a recording becomes, said beforehand, and how much memory writing it takes."""

import gc
import tracemalloc

import pytest
from flockbrush.engine.keyframe_spacing import KeyframeSpacing
from flockbrush.engine.recording import Recording, open_recording
from flockbrush.engine.recording_format import KEYFRAME, packed_size, record, record_of
from flockbrush.engine.state import restore, snapshot, snapshot_parts, state_hash
from flockbrush.levels.build import Simulation
from pens import pen

from flockbrush.cli import level_commands
from flockbrush.runs import run as running


@pytest.fixture(scope="module")
def level(tmp_path_factory):
    return pen(tmp_path_factory.mktemp("pen"))


@pytest.fixture
def herd(level):
    simulation = running.start(level, agents=300)
    yield simulation
    simulation.close()


def recorded(simulation, path, ticks, keyframes):
    """The bytes of a recording of so many ticks."""
    recorder = running.record(path, simulation, keyframes)
    for _ in range(ticks):
        simulation.tick()
        recorder.take()
    recorder.close()
    return path.stat().st_size


@pytest.mark.parametrize(("ticks", "keyframes"), [(64, 4), (200, 400)])
def test_the_size_is_known_beforehand(tmp_path, herd, ticks, keyframes):
    said = running.recording_size(herd, ticks, keyframes)
    size = recorded(herd, tmp_path / "a.flock", ticks, keyframes)
    assert 0.7 < said / size < 1.4


def spacing(dt=1 / 32):
    """Of recordings for which nobody asked for another."""
    return running.usual_keyframes(type("Herd", (), {"clock": type("Clock", (), {"dt": dt})}))


@pytest.mark.parametrize(("animals", "ticks"), [(0, 320), (2500, 320), (10_000, 80), (100_000, 8), (10**6, 8)])
def test_large_herds_have_snapshots_more_often(animals, ticks):
    due = spacing()
    assert [due.passed(animals) for _ in range(2 * ticks)] == ([False] * (ticks - 1) + [True]) * 2
    assert spacing().expected(9 * ticks + ticks - 1, animals) == 9


def test_snapshots_come_sooner_when_a_herd_grows():
    due = spacing()
    assert not any(due.passed(1000) for _ in range(300))
    assert [due.passed(100_000) for _ in range(14)] == [False] * 4 + [True] + [False] * 7 + [True] + [False]


def test_a_long_recording_of_very_many_does_not_grow_as_fast_as_it_lasts():
    counts = [spacing().expected(minutes * 60 * 32, 100_000) for minutes in (1, 4, 16)]
    assert counts[0] < 60 * 32 / 8 and counts[1] < 2.2 * counts[0] and counts[2] < 2.2 * counts[1]
    due = spacing()
    assert abs(sum(due.passed(100_000) for _ in range(4 * 60 * 32)) - counts[1]) <= 1
    assert running.usual_keyframes(None, 5).expected(4 * 60 * 32, 100_000) == 4 * 60 * 32 // 5  # who asks has them
    assert KeyframeSpacing(0).expected(1000, 10) == 0 and not KeyframeSpacing(0).passed(10)


def test_a_recording_of_many_opens_near_a_snapshot(tmp_path, monkeypatch, herd):
    monkeypatch.setattr(running, "KEYFRAME_STEPS", 8 * len(herd.agents))
    recorded(herd, tmp_path / "a.flock", 30, None)
    run = open_recording(tmp_path / "a.flock")
    assert sorted(run.keyframes) == [0, 1, 8, 16, 24, 30]


def test_the_size_of_what_is_packed_is_known_before(herd):
    parts = snapshot_parts(herd.world)
    assert packed_size(parts) == pytest.approx(len(record_of(KEYFRAME, 1, parts)), rel=0.1)
    long = [bytes(3 << 20), bytes(range(256)) * (3 << 12), b""]
    assert packed_size(long) == pytest.approx(len(record_of(KEYFRAME, 1, long)), rel=0.2)


def test_a_large_recording_is_announced(capsys, tmp_path, monkeypatch):
    level_commands.tell_size(tmp_path / "a.flock", 10**6)
    assert capsys.readouterr().err == ""
    level_commands.tell_size(tmp_path / "a.flock", 10**8)
    assert "a.flock: the recording will need about 100 MB\n" in capsys.readouterr().err
    monkeypatch.setattr("shutil.disk_usage", lambda path: type("Usage", (), {"free": 5 * 10**7}))
    level_commands.tell_size(tmp_path / "a.flock", 10**8)
    assert "will need about 100 MB, but the disk has only 50 MB free\n" in capsys.readouterr().err
    monkeypatch.setattr("shutil.disk_usage", lambda path: type("Usage", (), {"free": 3 * 10**5}))
    level_commands.tell_size(tmp_path / "a.flock", 12 * 10**5)
    assert "will need about 1.2 MB, but the disk has only 0.3 MB free\n" in capsys.readouterr().err


def test_a_snapshot_packed_in_parts_is_the_snapshot(tmp_path, herd):
    whole, before = snapshot(herd.world), state_hash(herd.world)
    assert b"".join(snapshot_parts(herd.world)) == whole
    header = {"seed": 1, "dt": 1 / 32, "level": "a.tmj", "agents": None}
    with Recording.create(tmp_path / "a.flock", header, {}) as recording:
        recording.put(record_of(KEYFRAME, 5, snapshot_parts(herd.world)))
        recording.put(record(KEYFRAME, 6, whole))
        recording.put(record_of(KEYFRAME, 7, [b"ab", b"c"]))
    kept = open_recording(tmp_path / "a.flock").keyframes
    assert kept[5] == kept[6] == whole and kept[7] == b"abc"
    herd.tick()
    restore(herd.world, kept[5])
    assert state_hash(herd.world) == before


def test_recording_longer_takes_no_more_memory(tmp_path, level):
    def peak(work, ticks):
        simulation = running.start(level, agents=300)
        gc.collect()
        tracemalloc.start()
        work(simulation, ticks)
        most = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        simulation.close()
        return most

    def record(simulation, ticks):
        recorded(simulation, tmp_path / "a.flock", ticks, 8)

    for work in (Simulation.run, record):  # what is made once
        peak(work, 16)
    short, long = (peak(record, ticks) - peak(Simulation.run, ticks) for ticks in (16, 160))
    assert long < short + 100_000


def test_a_snapshot_is_packed_without_a_copy_of_it(tmp_path):
    simulation = running.start(pen(tmp_path), agents=4000)
    size = len(snapshot(simulation.world))
    tracemalloc.start()
    record_of(KEYFRAME, 1, snapshot_parts(simulation.world))
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    simulation.close()
    assert most < size

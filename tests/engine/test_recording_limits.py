"""Recordings with right checksums and wrong content: refused in a sentence, before time or memory is spent."""

import json

import pytest
from crafted import record, recording_of
from flockbrush.engine import limits
from flockbrush.engine.commands import CommandError, Commands
from flockbrush.engine.recording import Recorder, Recording, RecordingError, open_recording, resume, state_hash
from small_meadow import Whistle, meadow

HEADER = {"seed": 1, "dt": 1 / 32, "assets": {}, "packages": {"numpy": "2.0"}, "level": "a.tmj", "agents": None}
HASH = (b"S", 0, b"12345678")


def written(path, *records, header=HEADER):
    path.write_bytes(recording_of([(b"H", 0, json.dumps(header).encode()), *records]))
    return path


@pytest.fixture
def path(tmp_path):
    return tmp_path / "run.flock"


def refusal(path):
    with pytest.raises(RecordingError) as caught:
        open_recording(path)
    assert str(caught.value).startswith(f"{path}: ") and "\n" not in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize("kind", [b"E", b"S", b"C", b"K"])
@pytest.mark.parametrize("tick", [2**62, limits.TICKS + 1, limits.SILENT_TICKS + 1])
def test_a_recording_does_not_jump_to_a_far_tick(path, kind, tick):
    written(path, HASH, (kind, tick, b"x" * 8))
    assert f"a record of tick {tick:,} follows a record of tick 0" in refusal(path)


def test_a_recording_that_speaks_every_minute_may_be_long(path):
    ticks = range(0, 100 * limits.SILENT_TICKS, limits.SILENT_TICKS)
    run = open_recording(written(path, *[(b"S", t, b"12345678") for t in ticks], (b"E", ticks[-1], b"")))
    assert (run.last_tick, run.truncated) == (ticks[-1], False)


def test_a_recorder_speaks_at_least_every_minute(path):
    world, step = meadow()
    recorder = Recorder(Recording.create(path, HEADER, {}), world, hash_every=10**9)
    assert recorder.hash_every == limits.SILENT_TICKS
    recorder.close()


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"seed": "1"}, "seed must be a whole number"),
        ({"seed": True}, "seed must be a whole number"),
        ({"seed": -1}, "seed must be a whole number"),
        ({"seed": 2**63}, "seed must be a whole number"),
        ({"dt": 1e308}, "dt must be above 0 and at most 3600 s"),
        ({"dt": 0}, "dt must be above 0 and at most 3600 s"),
        ({"dt": float("nan")}, "dt must be above 0 and at most 3600 s"),
        ({"agents": 1.5}, "agents must be a whole number"),
        ({"agents": limits.ANIMALS + 1}, "agents must be a whole number"),
        ({"level": ["a"]}, "level must be a relative path"),
        ({"level": "../a.tmj"}, "level must be a relative path"),
        ({"packages": ["numpy"]}, "packages must be a table of strings"),
        ({"packages": {"numpy": 2}}, "packages must be a table of strings"),
        ({"flockbrush": 1}, "flockbrush must be a string"),
        ({"assets": []}, "assets must be a table of files"),
        ({"assets": {"a": {"bytes": 1}}}, "assets must be a table of files"),
        ({"assets": {"a": {"bytes": 1 << 60, "sha256": "0" * 64}}}, "it lists files of more than 256 MiB"),
    ],
    ids=str,
)
def test_a_header_that_breaks_the_schema_is_refused_by_its_key(path, changes, words):
    assert f"the recording's header is damaged: {words}" in refusal(written(path, HASH, header=HEADER | changes))


def test_what_a_later_version_adds_to_a_header_passes(path):
    assert open_recording(written(path, HASH, header=HEADER | {"weather": [1, {}]})).header["weather"] == [1, {}]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('["Whistle", {"metres": NaN}]', "Whistle.metres must be a finite number, got nan"),
        ('["Whistle", {"metres": 1, "words": [[1, -Infinity]]}]', "Whistle.words must be a finite number, got -inf"),
        ('["Whistle", {"metres": 1e300}]', "Whistle.metres must be within ±1e+15, got 1e+300"),
        ('["Whistle", {"metres": 1, "words": [1, [1e99]]}]', "Whistle.words must be within ±1e+15, got 1e+99"),
        ('["Whistle", {"metres": 1, "words": [36893488147419103232]}]', "Whistle.words must be within ±9.22337e+18"),
        (
            '["Whistle", {"metres": 1, "words": [[[[[[[[[[1]]]]]]]]]]}]',
            "Whistle.words has lists nested more than 8 deep",
        ),
        ('["Whistle", {"metres": 1, "words": ["\\ud800"]}]', "an incomplete character"),
        ('["Whistle", [["metres", 1]]]', "it must be [name, {field: value, ...}]"),
        ("[[], {}]", "it must be [name, {field: value, ...}]"),
        ('["' + "Fly" * 100_000 + '", {}]', "unknown command 'FlyFly"),
        ('["Whistle", {"' + "m" * 100_000 + '": 1}]', "Whistle has no field 'mmm"),
    ],
    ids=lambda text: text[:60],
)
def test_a_command_that_holds_no_sound_numbers_is_refused_in_a_sentence(path, text, words):
    run = open_recording(written(path, HASH, (b"C", 1, text.encode())))
    with pytest.raises(RecordingError) as caught:
        _ = run.commands
    said = str(caught.value)
    assert said.startswith(f"{path}: the command in tick 1 cannot be applied: ") and words in said
    assert len(said) < 1500 and "\n" not in said


def test_a_snapshot_is_refused_by_its_table_of_contents(path):
    """A megabyte that unpacks to a gigabyte of nothing is not unpacked."""
    world, step = meadow()
    start = recording_of([(b"H", 0, json.dumps(HEADER).encode()), HASH])
    path.write_bytes(start + record(b"K", 1, bytes(64 << 20), claimed=1 << 30))
    run, before = open_recording(path), state_hash(world)
    with pytest.raises(RecordingError, match="this is no snapshot of a world"):
        resume(run, world, 5)
    assert state_hash(world) == before


def test_commands_that_would_fill_the_memory_are_refused_before_they_are_held(path):
    """A hundred kilobytes that would be a gigabyte of lists."""
    many = ["Whistle", {"metres": 1, "words": [[] for _ in range(500_000)]}]
    text = json.dumps(many, separators=(",", ":")).encode()
    assert open_recording(written(path, *[(b"C", 1, text)] * 3)).last_tick == 1
    assert "its commands hold more than 4,000,000 values" in refusal(written(path, *[(b"C", 1, text)] * 5))
    texts = [(b"C", 1, b'["Whistle",{"metres":1,"words":["' + b"x" * (15 << 20) + b'"]}]')] * 5
    assert "its commands are more than 64 MiB" in refusal(written(path, *texts))


def test_no_recording_is_written_that_could_not_be_read(path, monkeypatch):
    """What is written and what is read are counted alike."""
    monkeypatch.setattr(limits, "RECORDING_VALUES", limits.Limit(40_000, "values", ""))
    recording = Recording.create(path, HEADER, {})
    with pytest.raises(RecordingError, match="its commands hold more than 40,000 values"):
        for _ in range(5):
            recording.command(1, Whistle(1.0, [[]] * 5_000))
    recording.close()
    assert len(open_recording(path).commands) == 3


class JumpBack:
    """What takes back a whistle is as long as one."""

    def taken(self, world):
        return None

    def back(self, world, taken):
        return [Whistle(-2.0, [[]] * 45)]


def test_a_command_without_room_is_refused_and_the_recording_goes_on(path, monkeypatch):
    """What takes back the others of a group has its place even then."""
    monkeypatch.setattr(limits, "RECORDING_VALUES", limits.Limit(1_000, "values", ""))
    monkeypatch.setattr(Whistle, "touches", lambda self, world: [JumpBack()], raising=False)
    world, step = meadow()
    recorder, queue = Recorder(Recording.create(path, HEADER, {}), world), world.resource(Commands)
    for _ in range(9):
        queue.perform(world, [Whistle(1.0, [[]] * 45)])
    before = state_hash(world)
    with pytest.raises(
        CommandError, match=r"no room for it: .*hold more than 1,000 values \(12.5% of that is kept free"
    ):
        queue.perform(world, [Whistle(2.0), Whistle(1.0, [[]] * 45)])
    assert state_hash(world) == before
    queue.submit(Whistle(1.0, [[]] * 45))
    with pytest.raises(CommandError, match="the recording has no room for it"):
        step()
    step()
    recorder.take()
    recorder.close()
    run = open_recording(path)
    assert [len(cmd.words or []) for _, cmd in run.commands] == [*[45] * 9, 0, 45] and not run.truncated
    queue.perform(world, [Whistle(1.0, [[]] * 45)])  # nobody records any more

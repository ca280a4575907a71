"""What goes wrong in a replay names the recording."""

import pytest
from flockbrush.engine.recording import Recording, open_recording
from flockbrush.systems.commands import RemoveObstacle
from test_replaying import copied

COMMANDS = [("replay", "IN", "--verify"), ("replay", "IN"), ("measure", "IN"), ("export", "IN", "--to", "OUT.csv")]


def with_command(source, target, tick, command):
    """A recording like another one, with one more command."""
    run = open_recording(source)
    kept = {key: value for key, value in run.header.items() if key not in ("format", "packages", "assets")}
    with Recording.create(target, kept, run.assets) as copy:
        for tick_of_hash, digest in run.hashes.items():
            if tick_of_hash == tick:
                copy.command(tick, command)
            copy.hash(tick_of_hash, digest)
        copy.close(run.last_tick)
    return target


@pytest.mark.parametrize("command", COMMANDS, ids=lambda words: " ".join(words))
def test_a_command_that_cannot_be_done_again_names_the_recording(cli, recording, tmp_path, command):
    path = with_command(recording, tmp_path / "a.flock", 7, RemoveObstacle("nowhere"))
    words = [{"IN": path, "OUT.csv": tmp_path / "out.csv"}.get(word, word) for word in command]
    done = cli(*words)
    assert done.code == 1
    assert f"{path}: tick 7: RemoveObstacle(name='nowhere'" in done.err
    assert not (tmp_path / "out.csv").exists()


def test_a_mistake_in_an_embedded_level_names_the_recording(cli, recording, tmp_path):
    run = open_recording(recording)
    name = run.header["level"]
    path = copied(recording, tmp_path / "a.flock", assets={name: run.assets[name].replace(b'"swarm"', b'"swann"')})
    assert open_recording(path).assets[name] != run.assets[name]
    done = cli("replay", path)
    assert done.code == 1
    assert f"{path}: {name.rsplit('/', 1)[-1]}:" in done.err


def test_a_mistake_in_an_embedded_brush_names_the_recording_and_is_told_once(cli, recording, tmp_path):
    run = open_recording(recording)
    name = next(name for name in run.assets if name.endswith("march.brush.toml"))
    path = copied(recording, tmp_path / "a.flock", assets={name: run.assets[name].replace(b'"herd"', b'"compass"')})
    done = cli("replay", path)
    (line,) = [line for line in done.err.splitlines() if "compass" in line]
    assert done.code == 1 and line.startswith(f"{path}: march.brush.toml:")

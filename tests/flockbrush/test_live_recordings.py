"""What a client asks that cannot be recorded or fails half-way: it loses nobody a recording."""

import json

import pytest

pytest.importorskip("websockets", reason="the package websockets is not installed (extra live)")

from flockbrush.engine import limits
from flockbrush.engine.plugins import PluginError
from flockbrush.engine.recording import open_recording
from flockbrush.systems.gusts import Gust
from flockbrush.systems.landscape import Landscape

from flockbrush.cli.level_commands import recorder_of
from flockbrush.output.live.messages import read_request
from flockbrush.output.live.serving import Serving
from flockbrush.runs import run as running


@pytest.fixture
def served(monkeypatch):
    """A meadow without clients; ``told`` is what they would hear."""
    made = Serving(running.start("meadow", agents=10))
    made.told = []
    monkeypatch.setattr(made.link, "tell", lambda client, text: made.told.append(json.loads(text)))
    monkeypatch.setattr(made.link, "tell_all", lambda text: made.told.append(json.loads(text)))
    yield made
    made.simulation.close()


def ask(served, *command):
    served.link.requests.put((None, read_request(json.dumps({"id": 1, "command": command}))))


def test_a_command_for_which_the_recording_has_no_room_is_refused_and_ends_nothing(served, tmp_path, monkeypatch, cli):
    monkeypatch.setattr(limits, "RECORDING_COMMANDS_BYTES", limits.Limit(800, "bytes", ""))
    path = tmp_path / "full.flock"
    with recorder_of(path, served.simulation) as recorder:
        served.after_tick = recorder.take
        for number in range(12):
            ask(served, "PlaceGoal", {"id": 90 + number, "name": f"pond {number}", "x": 30.0, "y": 30.0})
        served.run(lambda: served.simulation.clock.tick == 3)
    done = [answer["type"] for answer in served.told].count("done")
    assert [answer["type"] for answer in served.told] == ["done"] * done + ["error"] * (12 - done) and done > 3
    assert served.told[-1]["message"].startswith("the recording has no room for it: its commands ")
    goals = served.simulation.world.resource(Landscape).goals
    assert sum(goal.name.startswith("pond ") for goal in goals) == done
    run = open_recording(path)
    assert (run.last_tick, run.truncated, len(run.commands)) == (3, False, done)
    assert "identical, bit for bit" in cli("replay", path, "--verify").out


def test_a_command_of_a_package_that_fails_half_way_ends_the_server_in_good_order(served, tmp_path, monkeypatch):
    monkeypatch.setattr(Gust, "__module__", "somebodys")
    monkeypatch.setattr(Gust, "apply", lambda self, world: 1 / 0)
    said = "command 'Gust' of somebodys failed: ZeroDivisionError: division by zero"
    path = tmp_path / "half.flock"

    def taken():
        recorder.take()
        if served.simulation.clock.tick == 3:
            ask(served, "Gust", {"x": 3.0, "y": 0.0})

    with pytest.raises(PluginError, match=f"^module somebodys: {said}$"):
        with recorder_of(path, served.simulation) as recorder:
            served.after_tick = taken
            served.run(lambda: False)
    assert served.told == [{"type": "error", "id": None, "message": f"the server ends: {said}"}]
    run = open_recording(path)
    assert (run.last_tick, run.truncated, run.commands) == (3, False, [])

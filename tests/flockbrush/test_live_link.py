"""The live link: what a client sees and steers is the herd, and no client harms another or the herd."""

import importlib.util
import json
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from contextlib import contextmanager, suppress
from pathlib import Path
from types import SimpleNamespace
from urllib.parse import parse_qs, urlsplit

import numpy as np
import pytest
from blender import WITHOUT_BLENDER, blender_python
from processes import environment

pytest.importorskip("websockets", reason="the package websockets is not installed (extra live)")

from flockbrush.engine import limits
from flockbrush.engine.problems import ProblemsError
from flockbrush.engine.recording import open_recording
from flockbrush.systems.landscape import Landscape
from flockbrush.systems.obstacle_commands import RemoveObstacle
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

from flockbrush.output.live import link as live_link
from flockbrush.output.live.frame import COLUMNS, FrameError, pack, unpack
from flockbrush.output.live.messages import read_request
from flockbrush.output.live.serving import Serving
from flockbrush.runs import run as running
from flockbrush.runs.catalogue import LABELS, Label
from flockbrush.runs.snapshots import moment_of

EXAMPLES = Path(__file__).parents[2] / "examples"
GOAL = {"id": 99, "name": "pond", "x": 30.0, "y": 30.0, "radius": 4.0}


@contextmanager
def serving(level="meadow", agents=40, record=None, **options):
    """A level that is being served, on a thread of its own."""
    simulation = running.start(level, agents=agents)
    served = Serving(simulation, **options)
    recorder = running.record(record, simulation) if record else None
    served.after_tick = recorder.take if recorder else served.after_tick
    served.link.start()
    ended = threading.Event()
    thread = threading.Thread(target=served.run, args=(ended.is_set,))
    thread.start()
    try:
        yield served
    finally:
        ended.set()
        thread.join(30)
        if recorder:
            recorder.close()
        simulation.close()
    assert not thread.is_alive()


def client(served, **options):
    """A connection; one that has not read what it was sent does not hear that it is closed, and is not waited for."""
    return connect(served.link.address, max_size=None, compression=None, close_timeout=0.5, **options)


def texts(connection, kind, count=1, wait=10.0):
    """The next messages of a type."""
    found, end = [], time.monotonic() + wait
    while len(found) < count:
        message = connection.recv(timeout=max(0.0, end - time.monotonic()))
        if isinstance(message, str) and json.loads(message)["type"] == kind:
            found.append(json.loads(message))
    return found[-1]


def frame(connection, wait=10.0):
    """The next frame."""
    end = time.monotonic() + wait
    while True:
        message = connection.recv(timeout=max(0.0, end - time.monotonic()))
        if isinstance(message, bytes):
            return unpack(message)


def ask(connection, **asked):
    """The answer to a request."""
    connection.send(json.dumps({"id": 7, **asked}))
    end = time.monotonic() + 10
    while True:
        message = connection.recv(timeout=max(0.0, end - time.monotonic()))
        if isinstance(message, str) and (answer := json.loads(message)).get("id") == 7:
            return answer


class TestFrames:
    def test_a_frame_is_the_moment_it_was_packed_from(self):
        simulation = running.start("pillars", agents=30)
        simulation.run(40)
        moment = moment_of(simulation)
        found = unpack(pack(moment, 40, 12.5))
        assert (found["tick"], found["time"], found["made"]) == (40, moment.time, 12.5)
        assert np.array_equal(found["id"], moment.ids)
        assert np.allclose(found["xyz"], moment.xyz, atol=1e-4)
        ahead = np.stack(
            [np.cos(found["heading"]) * np.cos(found["pitch"]), np.sin(found["heading"]) * np.cos(found["pitch"])], -1
        )
        assert np.allclose(ahead, moment.forward[:, :2], atol=1e-5)
        assert np.array_equal(found["flags"] == 1, moment.leader)
        simulation.close()

    def test_what_is_no_frame_is_refused_in_words(self):
        with pytest.raises(FrameError, match="at least 32 bytes"):
            unpack(b"FLK1")
        with pytest.raises(FrameError, match="begins with FLK1"):
            unpack(b"x" * 32)
        with pytest.raises(FrameError, match="a frame of 0 animals has 32 bytes, got 33"):
            unpack(b"FLK1" + b"\0" * 29)

    def test_the_page_documents_every_column(self):
        page = (EXAMPLES.parent / "docs" / "live-link.md").read_text()
        rows = [line for line in page.splitlines() if line.startswith("| `")]
        kinds = {"<u4": "uint32", "<f4": "float32", "<u2": "uint16"}
        wanted = [f"| `{name}` | {kinds[kind]} | {width} | {meaning} |" for name, kind, width, meaning in COLUMNS]
        assert [row for row in rows if row in wanted] == wanted


class TestWatching:
    def test_a_client_is_greeted_and_then_sees_the_herd_as_it_is(self):
        with serving() as served, client(served) as connection:
            told = [json.loads(connection.recv(timeout=10)) for _ in range(3)]
            assert [message["type"] for message in told] == ["hello", "names", "place"]
            hello, names, place = told
            assert (hello["protocol"], hello["level"], hello["width"]) == (1, "meadow", 120.0)
            assert names["species"] == ["sheep"] and "graze" in names["brush"]
            assert place["guides"] and place["obstacles"]
            assert ask(connection, play=False)["type"] == "done"
            time.sleep(0.2)
            for _ in range(12):
                seen = frame(connection)
            now = moment_of(served.simulation)
            assert np.array_equal(seen["id"], now.ids)
            assert np.allclose(seen["xyz"], now.xyz, atol=1e-4)
            assert seen["tick"] == served.simulation.clock.tick

    def test_groups_which_no_frame_has_are_not_looked_for(self, monkeypatch):
        def looked_for(world):
            raise AssertionError

        monkeypatch.setitem(LABELS, "group", Label(looked_for, looked_for))
        with serving() as served, client(served) as connection:
            told = [json.loads(connection.recv(timeout=10)) for _ in range(3)]
            assert set(told[1]) == {"type", "species", "brush", "state"}
            assert ask(connection, play=False)["type"] == "done"
            assert len(frame(connection)["id"]) == len(served.simulation.agents)

    def test_frames_between_two_ticks_are_on_the_way(self):
        with serving(fps=60) as served, client(served) as connection:
            seen = [frame(connection) for _ in range(60)]
        times = [one["time"] for one in seen]
        assert times == sorted(times) and len(set(times)) > 40
        assert any(one["time"] % (1 / 32) > 1e-6 for one in seen)
        steps = [np.linalg.norm(b["xyz"] - a["xyz"], axis=1).max() for a, b in zip(seen, seen[1:], strict=False)]
        assert max(steps) < 1.0  # m; nobody jumps

    def test_frames_are_young(self):
        with serving() as served, client(served) as connection:
            frame(connection)
            ages = [time.time() - frame(connection)["made"] for _ in range(100)]
        assert np.percentile(ages, 90) < 0.3


class TestSteering:
    def test_a_command_changes_the_world_and_undo_takes_it_back(self):
        with serving() as served, client(served) as connection:
            goals = served.simulation.world.resource(Landscape).goals
            before = [goal.name for goal in goals]
            assert ask(connection, command=["PlaceGoal", GOAL])["type"] == "done"
            assert [goal["name"] for goal in texts(connection, "place")["goals"]] == [*before, "pond"]
            assert ask(connection, undo=True)["type"] == "done"
            assert [goal.name for goal in goals] == before
            assert ask(connection, undo=True)["message"] == "there is nothing to undo"

    def test_the_answer_to_undo_names_the_last_command_that_changed_something(self, monkeypatch):
        """Without ticks: the geese fly in line formation at first."""
        served, told = Serving(running.start("geese", agents=6)), []
        monkeypatch.setattr(served.link, "tell", lambda client, text: told.append(json.loads(text)))
        gust = {"x": 3.0, "y": 0.0}
        of_none = {**gust, "at_x": -500.0, "at_y": -500.0, "radius": 1.0}
        asked = [{"command": command} for command in (["PlaceGoal", GOAL], ["Gust", gust], ["Gust", of_none])]
        for number, request in enumerate([*asked, {"undo": True}, {"undo": True}]):
            served.link.requests.put((None, read_request(json.dumps({"id": number, **request}))))
        served.answer()
        served.simulation.close()
        assert [answer["type"] for answer in told] == ["done"] * 5
        assert [answer.get("undone") for answer in told] == [None, None, None, "Gust", "PlaceGoal"]

    def test_a_step_that_can_no_longer_be_undone_is_named_and_does_not_block_those_before_it(self):
        with serving() as served, client(served) as connection:
            goals = served.simulation.world.resource(Landscape).goals
            before = [goal.name for goal in goals]
            wall = {"name": "wall", "points": [[50, 50], [55, 50], [55, 55], [50, 55]], "solid": True}
            assert ask(connection, command=["PlaceGoal", GOAL])["type"] == "done"
            assert ask(connection, command=["AddObstacle", wall])["type"] == "done"
            assert ask(connection, play=False)["type"] == "done"
            served.simulation.submit(RemoveObstacle("wall"))  # as a script does
            assert ask(connection, play=True)["type"] == "done"
            while any(o.name == "wall" for o in served.simulation.world.resource(Landscape).obstacles):
                time.sleep(0.01)
            told = ask(connection, undo=True)
            assert told["type"] == "error"
            assert "AddObstacle can no longer be undone (there is no obstacle 'wall'" in told["message"]
            assert ask(connection, undo=True)["undone"] == "PlaceGoal"
            assert [goal.name for goal in goals] == before

    def test_a_command_of_the_script_that_cannot_be_done_is_told_to_all_and_ends_nothing(self):
        said = []
        with serving(say=said.append) as served, client(served) as one, client(served) as other:
            assert ask(one, play=False)["type"] == "done"
            when = (served.simulation.clock.tick + 2) * served.simulation.clock.dt
            key = {"id": 900, "name": "k", "when": when, "x": 0.0, "y": 0.0, "command": "MoveObstacle"}
            key["args"] = {"name": "tree 1", "x": 3.0, "y": 1.0}
            assert ask(one, command=["PlaceKey", key])["type"] == "done"
            assert ask(one, command=["RemoveObstacle", {"name": "tree 1"}])["type"] == "done"
            assert ask(one, play=True)["type"] == "done"
            told = [texts(connection, "error") for connection in (one, other)]
            assert told[0] == told[1] and told[0]["id"] is None
            assert "object 900 in layer 'script'" in told[0]["message"]
            assert "there is no obstacle 'tree 1'" in told[0]["message"]
            assert said == [told[0]["message"]]
            before = served.simulation.clock.tick
            while frame(other)["tick"] <= before:
                pass

    def test_steered_leaders_go_where_they_are_sent(self):
        with serving() as served, client(served) as connection:
            first = frame(connection)
            leaders = [int(number) for number in first["id"][:4]]
            target = first["xyz"][:4, :2].mean(0) + (15, 0)
            ask(connection, command=["Appoint", {"entities": leaders}])
            where = {"x": float(target[0]), "y": float(target[1]), "kind": "place"}
            assert ask(connection, command=["Steer", {"entities": leaders, **where}])["type"] == "done"
            time.sleep(4)
            while (last := frame(connection))["time"] < first["time"] + 4:
                pass
            ways = [np.linalg.norm(one["xyz"][:4, :2] - target, axis=1) for one in (first, last)]
            assert (ways[1] < ways[0] - 1).all()

    def test_the_recording_has_it_all_and_verifies(self, tmp_path, cli):
        path = tmp_path / "live.flock"
        with serving(record=path) as served, client(served) as connection:
            assert ask(connection, command=["PlaceGoal", GOAL])["type"] == "done"
            assert ask(connection, command=["Gust", {"x": 3.0, "y": 0.0}])["type"] == "done"
            time.sleep(0.3)
            assert ask(connection, play=False)["type"] == "done"
            assert ask(connection, command=["Gust", {"x": -3.0, "y": 0.0}])["type"] == "done"  # the last word, paused
        assert [type(cmd).__name__ for _, cmd in open_recording(path).commands] == ["PlaceGoal", "Gust", "Gust"]
        assert "identical, bit for bit" in cli("replay", path, "--verify").out


BAD_REQUESTS = [
    (b"bytes", "a request must be a text message with JSON, got bytes"),
    ("{", "this is not JSON"),
    ("[" * 100_000, "this is not JSON"),
    ("[]", "a request must be an object such as"),
    ('{"id": 1}', "a request must have exactly one of command, undo, play"),
    ('{"id": 1, "undo": true, "play": true}', "a request must have exactly one of command, undo, play"),
    ('{"id": [], "undo": true}', "id must be a whole number or a string"),
    ('{"undo": 1}', "undo must be true"),
    ('{"play": "yes"}', "play must be true or false"),
    ('{"command": "Gust"}', 'command must be ["NAME", {...}]'),
    ('{"command": ["Gusty", {}]}', "unknown command 'Gusty'; did you mean 'Gust'?"),
    ('{"command": ["Gust", {"x": 1, "y": 2, "w": 3}]}', "Gust has no field 'w'"),
    ('{"command": ["Gust", {"x": 1}]}', "Gust needs y"),
    ('{"command": ["Gust", {"x": NaN, "y": 2}]}', "NaN and Infinity are not allowed as numbers in a command"),
    ('{"command": ["Gust", {"x": 1e999, "y": 2}]}', "NaN and Infinity are not allowed as numbers in a command"),
    ('{"command": ["Gust", {"x": "east", "y": 2}]}', "Gust.x must be a number, got 'east'"),
    ('{"command": ["Steer", {"entities": [123456789]}]}', "123456789"),
]


@pytest.fixture(scope="module")
def served():
    with serving("sheep-pasture") as one:  # nobody is born or leaves
        yield one


class TestClientsThatMisbehave:
    @pytest.mark.parametrize(("message", "answer"), BAD_REQUESTS, ids=[str(m)[:24] for m, _ in BAD_REQUESTS])
    def test_rubbish_is_answered_by_a_sentence_and_the_herd_goes_on(self, served, message, answer):
        with client(served) as connection:
            connection.send(message)
            said = texts(connection, "error")["message"]
            assert answer in said and "Traceback" not in said
            before = served.simulation.clock.tick
            while frame(connection)["tick"] <= before:
                pass

    @pytest.mark.parametrize("address", ["/", "/?token=", "/?token=guess", "/?token=%00", "/?token=ä"])
    def test_who_does_not_know_the_token_is_sent_away(self, served, address):
        with pytest.raises(InvalidStatus) as caught, connect(f"ws://127.0.0.1:{served.link.port}{address}"):
            pass
        assert caught.value.response.status_code == 401
        assert b"the token is wrong or missing" in caught.value.response.body

    def test_a_huge_message_ends_that_client_alone(self, served):
        with client(served) as other, client(served) as connection:
            connection.send("x" * (limits.LIVE_MESSAGE + 1))
            with pytest.raises(ConnectionClosed):
                while True:
                    connection.recv(timeout=10)
            assert connection.close_code == 1009
            assert len(frame(other)["id"]) == 40

    def test_what_speaks_no_websocket_is_dropped(self, served):
        with socket.create_connection(("127.0.0.1", served.link.port), timeout=10) as plain:
            plain.sendall(b"\xff" * 20_000)
            with suppress(ConnectionResetError):
                while plain.recv(4096):
                    pass
        with client(served) as connection:
            assert len(frame(connection)["id"]) == 40

    def test_one_that_does_not_read_is_cut_off_and_delays_nobody(self, served, monkeypatch):
        monkeypatch.setattr(live_link, "STALL", 0.5)
        monkeypatch.setattr(live_link, "_SEND_BUFFER", 4096)
        with client(served) as other:
            frame(other)
            stuck = _asleep(served)
            end, ages = time.monotonic() + 30, []
            while len(served.link.clients) > 1 or len(ages) < 60:
                ages.append(time.time() - frame(other)["made"])
                assert time.monotonic() < end, "the client that stalls is still there"
            assert np.percentile(ages, 90) < 0.3
            stuck.close()

    def test_a_flood_is_read_no_faster_than_is_allowed(self, served, monkeypatch):
        monkeypatch.setattr(limits, "LIVE_MESSAGES", limits.Limit(50, "messages per second", "a client"))
        with client(served) as other, client(served) as connection:
            begun = time.monotonic()
            for number in range(150):
                connection.send(json.dumps({"id": number, "play": True}))
            texts(connection, "done", 150, wait=20)
            assert time.monotonic() - begun > 1.5  # 50 at once, 100 more at 50 a second
            while time.time() - frame(other)["made"] > 0.3:
                assert time.monotonic() - begun < 20

    def test_more_clients_than_there_may_be_are_sent_away(self, served, monkeypatch):
        monkeypatch.setattr(limits, "LIVE_CLIENTS", limits.Limit(1, "clients", "a live link"))
        while served.link.clients:
            time.sleep(0.05)
        with client(served) as connection:
            frame(connection)
            with pytest.raises(InvalidStatus) as caught, client(served):
                pass
        assert caught.value.response.status_code == 503
        assert caught.value.response.body == b"the maximum of 1 clients is reached\n"


def _asleep(served):
    """A client that never reads what it is sent."""
    plain = socket.socket()
    plain.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    plain.connect(("127.0.0.1", served.link.port))
    plain.sendall(
        f"GET /?token={served.link.token} HTTP/1.1\r\nHost: here\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
        "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n\r\n".encode()
    )
    return plain


class TestCommandLine:
    def begin(self, folder, *words):
        """(process, where its link is)."""
        command = [sys.executable, "-m", "flockbrush", "serve", "meadow", "--agents", "30", "--json", *words]
        process = subprocess.Popen(
            command, cwd=folder, env=environment(), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        line = process.stdout.readline()
        assert line, process.communicate()[1]
        return process, json.loads(line)

    @pytest.mark.skipif(os.name == "nt", reason="signals")
    def test_ctrl_c_ends_it_cleanly_with_the_recording_saved(self, tmp_path, cli):
        process, told = self.begin(tmp_path, "--record", "live.flock")
        assert told["address"].startswith("ws://127.0.0.1:")
        with connect(told["address"], max_size=None) as connection:
            assert ask(connection, command=["Gust", {"x": 3.0, "y": 0.0}])["type"] == "done"
            process.send_signal(signal.SIGINT)
            with pytest.raises(ConnectionClosed):
                while True:
                    connection.recv(timeout=20)
            assert connection.close_code == 1001  # going away
        out, err = process.communicate(timeout=30)
        assert (process.returncode, "Traceback" in err) == (0, False)
        assert "wrote live.flock" in err and "stopped after tick" in err and out == ""
        assert os.listdir(tmp_path) == ["live.flock"]
        assert "identical, bit for bit" in cli("replay", tmp_path / "live.flock", "--verify").out

    def test_a_port_in_use_is_a_sentence(self, cli):
        with socket.create_server(("127.0.0.1", 0)) as taken:
            port = taken.getsockname()[1]
            result = cli("serve", "meadow", "--port", port, "--agents", "20")
        assert result.code == 1
        assert result.err.strip().splitlines()[-1] == (
            f"127.0.0.1:{port}: this port is in use by another program; choose another port, or --port 0 for any "
            "free port"
        )

    def test_an_address_that_is_not_ours_is_a_sentence(self, cli):
        result = cli("serve", "meadow", "--host", "no.such.host.invalid", "--agents", "20")
        assert result.code == 1 and "no.such.host.invalid:0: this machine does not have this address" in result.err

    def test_on_all_addresses_it_names_one_to_connect_to(self, tmp_path, cli):
        result = cli("serve", "meadow", "--host", "0.0.0.0", "--agents", "20", "--seconds", "0")
        assert result.code == 0, result.err
        address, others = result.out.splitlines()[:2]
        assert "ws://127.0.0.1:" in address and "put the address of this one in place of 127.0.0.1" in others
        assert "other machines can connect" in result.err

    def test_a_recording_over_the_level_is_refused(self, cli, tmp_path):
        cli("level", "init", tmp_path)
        level = tmp_path / "first.tmj"
        before = level.read_bytes()
        assert cli("serve", level, "--record", level).code == 1
        assert level.read_bytes() == before

    def test_the_missing_package_is_named(self, monkeypatch):
        monkeypatch.setitem(sys.modules, "websockets.asyncio.server", None)
        simulation = running.start("meadow", agents=20)
        with pytest.raises(ProblemsError, match=r'pip install "flockbrush\[live\]"'):
            Serving(simulation).link.start()
        simulation.close()


class TestExamples:
    @pytest.mark.parametrize("name", ["blender/live_herd.py", "godot/live_herd.gd"])
    def test_each_is_short(self, name):
        assert len((EXAMPLES / name).read_text().splitlines()) <= 250

    def test_the_script_for_godot_knows_the_bytes_of_a_frame(self):
        text = (EXAMPLES / "godot/live_herd.gd").read_text()
        width = {name: np.dtype(kind).itemsize * width for name, kind, width, _ in COLUMNS}
        assert f"const ROW := {sum(width.values())} " in text
        ends = dict(zip(width, np.cumsum(list(width.values())).tolist(), strict=True))
        assert f"HEADER + {ends['id']} * count, HEADER + {ends['xyz']} * count" in text
        assert f"HEADER + {ends['xyz']} * count, HEADER + {ends['length']} * count" in text
        assert f"var brush_at := HEADER + {ends['species']} * count" in text

    def test_the_add_on_connects_again_when_the_server_has_closed_the_link(self, monkeypatch):
        """Without Blender, of which it only asks for classes here."""
        types = SimpleNamespace(Operator=object, Panel=object)
        monkeypatch.setitem(sys.modules, "bpy", SimpleNamespace(types=types))
        spec = importlib.util.spec_from_file_location("live_herd", EXAMPLES / "blender/live_herd.py")
        live_herd = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(live_herd)
        monkeypatch.setattr(live_herd, "RETRY", 0.05)

        def until(what):
            end = time.monotonic() + 10
            while not what() and time.monotonic() < end:
                time.sleep(0.02)
            return what()

        with serving(agents=20) as served:
            link, where = live_herd.LiveThread(served.link.address), urlsplit(served.link.address)
            assert until(lambda: link.frame) and link.status == "connected"
        assert until(lambda: link.status.startswith("closed, trying again: "))
        link.frame = None
        with serving(agents=20, port=where.port, token=parse_qs(where.query)["token"][0]):
            assert until(lambda: link.frame) and link.status == "connected"
            link.close()
            link.join(5)
        assert not link.is_alive()

    @pytest.mark.tools
    @pytest.mark.skipif(blender_python() is None, reason=WITHOUT_BLENDER)
    def test_the_add_on_draws_and_steers_in_blender(self):
        with serving(agents=60) as served:
            program = Path(__file__).parents[1] / "drive_blender.py"
            words = [blender_python(), program, EXAMPLES / "blender/live_herd.py", served.link.address, "60,40"]
            done = subprocess.run(words, capture_output=True, text=True, timeout=120)
        told = json.loads(done.stdout.split("TOLD")[1])
        assert "the token is wrong or missing" in told["refused"]
        assert (told["connected"], told["steered"]) == ("{'FINISHED'}", "{'FINISHED'}")
        assert told["drawn_again"] == pytest.approx(1 / 30)
        assert told["animals"][0] == told["animals"][1] >= 50  # one body for each; some may leave
        assert told["left"]
        assert told["nearer"] > 1 and told["ahead"] > 0.7

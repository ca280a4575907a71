"""The scripts for Godot 4, run in Godot itself."""

import json
from contextlib import ExitStack
from pathlib import Path
from urllib.parse import parse_qs, urlsplit

import cv2
import numpy as np
import pytest
from godot import WITHOUT_GODOT, godot_build, running_godot
from test_gltf import Scene, rotation, scenes  # noqa: F401  a fixture
from test_live_link import serving

EXAMPLES = Path(__file__).parents[2] / "examples/godot"
pytestmark = [pytest.mark.tools, pytest.mark.skipif(godot_build() is None, reason=WITHOUT_GODOT)]
CROWD = """extends Node
func _ready() -> void:
	var crowd = get_node("../Herd")
	for frame in [FRAMES]:
		crowd.show_frame(frame)
		var told := []
		for number in crowd.poses.size():
			var many: MultiMesh = crowd.poses[number]
			for k in many.visible_instance_count:
				var t: Transform3D = many.get_instance_transform(k)
				var c := many.get_instance_color(k)
				told.append([number, t.origin.x, t.origin.y, t.origin.z, t.basis.x.x, t.basis.x.y, t.basis.x.z,
					t.basis.y.length(), t.basis.z.length(), c.r, c.g, c.b])
		print("FRAME", frame, " ", JSON.stringify(told))
	await RenderingServer.frame_post_draw
	await RenderingServer.frame_post_draw
	print("DRAWN yes")
"""
LIVE = """extends Node
var herd: Node
var started := false
var count := 0
var hellos := 0
func _ready() -> void:
	herd = get_node("../Herd")
	herd.told.connect(heard)
	var camera := Camera3D.new()
	add_child(camera)
	camera.position = Vector3(60, 40, 10)
	camera.look_at(Vector3(60, 0, -40))
func heard(message: Dictionary) -> void:
	if message["type"] == "hello":
		hellos += 1
		print("HELLO", hellos, " ", message["level"])
	if message["type"] in ["done", "error"]:
		print("ANSWER ", JSON.stringify(message))
func _process(_delta: float) -> void:
	if herd.ids.is_empty():
		return
	if not started:
		started = true
		print("BEGUN ", JSON.stringify(state()))
		herd.steer_to(Vector3(60, 0, -40))
	count += 1
	if count == 240:
		print("LATER ", JSON.stringify(state()))
func state() -> Dictionary:
	var places := []
	for place in herd.places:
		places.append([place.x, place.y, place.z])
	var first: Transform3D = herd._herd.multimesh.get_instance_transform(0)
	var nose := -first.basis.z.normalized()
	return {"ids": Array(herd.ids), "places": places, "drawn": herd._herd.multimesh.instance_count,
		"nose": [nose.x, nose.y, nose.z], "length": first.basis.z.length(), "brushes": herd.names.get("brush")}
"""


def test_the_crowd_stands_in_godot_where_it_was(scenes, tmp_path):  # noqa: F811
    about, records = Scene(scenes["crowd"]).crowd()
    frames = (0, 7, about["frames"] - 1)
    probe = CROWD.replace("FRAMES", ", ".join(map(str, frames)))
    files = {"run.glb": scenes["crowd"].read_bytes()}
    with running_godot(tmp_path, EXAMPLES / "crowd.gd", probe, "speed = 0.0", files) as godot:
        told = {frame: np.array(json.loads(godot.told(f"FRAME{frame}"))) for frame in frames}
        godot.told("DRAWN")
        assert godot.complaints() == []
        godot.browser.picture(tmp_path / "godot.png")
    for frame in frames:
        expected = []
        for animal, record in enumerate(records[frame]):
            scale = about["scales"][about["first_body"][animal] + int(record["body"][0])]
            ahead = rotation(record["turn"].astype(float))[:, 0] * scale[0]
            colour = np.array(about["brush_colours"][int(record["brush"][0])]) * about["brightest"]
            expected.append([record["pose"][0], *record["place"], *ahead, *scale[1:], *colour])
        expected = np.array(sorted(expected), float)
        found = np.array(sorted(told[frame].tolist()))
        assert np.allclose(found, expected, atol=2e-3), frame
    picture = cv2.imread(str(tmp_path / "godot.png"))
    light = (picture.min(axis=2) > 250).mean()
    assert light < 0.05 and picture.std() > 15  # a scene that is not washed out


def test_a_live_herd_is_drawn_and_steered_in_godot(tmp_path):
    with serving(agents=60) as served:
        values = f'address = "{served.link.address}"'
        with running_godot(tmp_path, EXAMPLES / "live_herd.gd", LIVE, values) as godot:
            begun = json.loads(godot.told("BEGUN"))
            answer = json.loads(godot.told("ANSWER"))
            later = json.loads(godot.told("LATER"))
            godot.browser.picture(tmp_path / "live.png")
            assert godot.complaints() == []
    assert answer["type"] == "done"
    assert begun["drawn"] == len(begun["ids"]) == 60 and "graze" in str(begun["brushes"])
    assert 0.5 < begun["length"] < 3 and abs(np.linalg.norm(begun["nose"]) - 1) < 1e-3
    where = {state: dict(zip(told["ids"], np.array(told["places"]), strict=True))
             for state, told in (("begun", begun), ("later", later))}  # fmt: skip
    goal = np.array([60, 0, -40])
    near = sorted(begun["ids"], key=lambda animal: np.linalg.norm(where["begun"][animal] - goal))[:6]
    way = [np.linalg.norm(where["begun"][a] - goal) - np.linalg.norm(where["later"][a] - goal) for a in near]
    assert np.mean(way) > 0.5  # m nearer to where they were sent


def test_a_live_herd_comes_back_when_the_server_has_closed_the_link(tmp_path):
    with ExitStack() as served:
        first = served.enter_context(serving(agents=20))
        where = urlsplit(first.link.address)
        with running_godot(tmp_path, EXAMPLES / "live_herd.gd", LIVE, f'address = "{first.link.address}"') as godot:
            godot.told("HELLO1")
            served.close()
            with serving(agents=20, port=where.port, token=parse_qs(where.query)["token"][0]):
                assert godot.told("HELLO2")
            assert "the live link is closed" in str(godot.complaints())

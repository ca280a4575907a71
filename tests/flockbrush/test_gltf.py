"""glTF scenes: read back number by number, judged by Khronos' validator, drawn by three.js where they are installed."""

import importlib.util
import json
import os
import struct
import subprocess
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from browser import Browser, chromium
from flockbrush.components import Heading, Position
from flockbrush.systems.landscape import Landscape
from godot import node_module
from scene_in_browser import open_scene
from test_usd import turning

from flockbrush.output.formats.gltf_scene import GltfScene
from flockbrush.render.gaits import looks_of
from flockbrush.runs.run import start
from flockbrush.runs.run_edits import rows_of
from flockbrush.runs.snapshots import moment_of, words_of

ROOT = Path(__file__).parents[2]
MODES = ("nodes", "crowd")
KINDS = {5126: "<f4", 5121: "u1", 5123: "<u2", 5122: "<i2", 5125: "<u4"}
SHAPES = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}


class Scene:
    """A .glb as a reader of the specification sees it."""

    def __init__(self, path):
        data = Path(path).read_bytes()
        assert struct.unpack_from("<2I", data) == (0x46546C67, 2)  # "glTF", version 2
        (length,) = struct.unpack_from("<I", data, 12)
        self.document, self.data = json.loads(data[20 : 20 + length]), data[20 + length + 8 :]
        self.nodes = self.document["nodes"]
        self.parent = {child: k for k, node in enumerate(self.nodes) for child in node.get("children", [])}

    def node(self, name):
        return next(k for k, node in enumerate(self.nodes) if node["name"] == name)

    def numbers(self, index):
        accessor = self.document["accessors"][index]
        view = self.document["bufferViews"][accessor["bufferView"]]
        kind = np.dtype(KINDS[accessor["componentType"]])
        width = SHAPES[accessor["type"]]
        values = np.frombuffer(self.data, kind, accessor["count"] * width, view["byteOffset"]).reshape(-1, width)
        return values / np.iinfo(kind).max if accessor.get("normalized") else values

    def local(self, node, seconds):
        """(translation, quaternion, scale) of a node at a time that is a keyframe's."""
        still = (("translation", [0, 0, 0]), ("rotation", [0, 0, 0, 1]), ("scale", [1, 1, 1]))
        found = {path: self.nodes[node].get(path, rest) for path, rest in still}
        for animation in self.document.get("animations", []):
            for channel in animation["channels"]:
                if channel["target"]["node"] == node:
                    sampler = animation["samplers"][channel["sampler"]]
                    times = self.numbers(sampler["input"])[:, 0]
                    frame = np.searchsorted(times, seconds + 1e-6) - 1
                    found[channel["target"]["path"]] = self.numbers(sampler["output"])[frame]
        return [np.array(found[path], float) for path, _ in still]

    def matrix(self, node, seconds=0.0):
        """(4, 4) from a node's axes to the scene's, at a keyframe."""
        place, turn, scale = self.local(node, seconds)
        made = np.eye(4)
        made[:3, :3], made[:3, 3] = rotation(turn) * scale, place
        return self.matrix(self.parent[node], seconds) @ made if node in self.parent else made

    def crowd(self):
        """(what is told of the crowd buffer, its records (frames, animals))."""
        about = self.nodes[self.node("Herd")]["extras"]["crowd"]
        names = {"float32": "<f4", "int16": "<i2", "uint16": "<u2", "uint32": "<u4", "float16": "<f2"}
        kind = np.dtype(
            {
                "names": [field["name"] for field in about["fields"]],
                "formats": [(names[field["type"]], (field["count"],)) for field in about["fields"]],
                "offsets": [field["offset"] for field in about["fields"]],
                "itemsize": about["stride"],
            }
        )
        start = self.document["bufferViews"][about["bufferView"]]["byteOffset"]
        shape = about["frames"], about["animals"]
        return about, np.frombuffer(self.data, kind, shape[0] * shape[1], start).reshape(shape)


def rotation(quaternion):
    x, y, z, w = quaternion / np.linalg.norm(quaternion)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def y_up(xyz):
    x, y, z = np.transpose(xyz)
    return np.column_stack([x, z, -y])


@pytest.fixture(scope="module")
def scenes(shared, recording, command):
    """{mode: path} of the recording as glTF, at 16 frames a second."""
    paths = {mode: shared / f"pen-{mode}.glb" for mode in MODES}
    for mode, path in paths.items():
        command("export", recording, "--to", path, "--gltf-mode", mode)
    return paths


def test_every_animal_is_a_node_where_it_was_and_looks_where_it_looked(scenes, lived):
    scene, agents = Scene(scenes["nodes"]), lived.agents
    placed = [scene.matrix(scene.node(f"animal {animal}"), 1.25) for animal in agents.ids]
    assert np.allclose([matrix[:3, 3] for matrix in placed], y_up(agents[Position.xyz]), atol=1e-4)
    ahead = [matrix[:3, 0] for matrix in placed]
    assert np.allclose(ahead, y_up(agents[Heading.forward]), atol=1e-4)
    assert np.allclose([matrix[:3, 2] for matrix in placed], (0, 1, 0), atol=1e-4)  # backs are up on a flat pen


def test_the_crowd_buffer_has_the_same_herd(scenes, lived):
    about, records = Scene(scenes["crowd"]).crowd()
    last, agents = records[20], lived.agents
    assert (about["schema"], about["fps"], about["frames"]) == ("flockbrush.crowd/2", 16, 21)
    assert about["ids"] == agents.ids.tolist()
    assert np.allclose(last["place"], agents[Position.xyz], atol=1e-5)
    turns = last["turn"] / about["turn_scale"]
    assert np.allclose([rotation(turn)[:, 0] for turn in turns], agents[Heading.forward], atol=1e-4)
    assert {about["words"]["brush"][code] for code in last["brush"].ravel()} == {"swarm"}
    told = moment_of(lived)
    assert about["words"].keys() == {"species", "brush", "group"}  # no families and no states
    for name, codes in ((name, told.labels[name]) for name in about["words"] if name in told.labels):
        assert last[name].ravel().tolist() == codes.tolist()
        assert len(about["words"][name]) > codes.max()
    assert "group" in told.labels and about["stride"] % 4 == 0
    assert {about["words"]["brush"][code] for code in records[0]["brush"].ravel()} == {"march"}
    assert len(set(records["pose"][:, 0].ravel().tolist())) > 2  # its legs move
    shown = {about["poses"][number]["clip"] for number in records["pose"].ravel().tolist()}
    assert shown <= {"rest", "walk", "run"}


def test_a_body_is_as_long_as_the_animal_and_changes_its_brush_when_the_animal_does(scenes, lived):
    from flockbrush.components import Body

    scene, agents = Scene(scenes["nodes"]), lived.agents
    for row, animal in enumerate(agents.ids[:5]):
        node = scene.node(f"animal {animal}")
        bodies = {scene.nodes[k]["name"]: k for k in scene.nodes[node]["children"]}
        assert sorted(bodies) == ["march", "swarm"]
        long = {name: [scene.local(k, t)[2][0] for t in (0.0, 1.25)] for name, k in bodies.items()}
        told = float(agents[Body.length][row])
        assert np.allclose(long["march"], (told, 0), atol=1e-4) and np.allclose(long["swarm"], (0, told), atol=1e-4)
        words = scene.nodes[node]["extras"]
        assert words["id"] == animal and words["species"] == [[0, "sheep"]]
        assert [name for _, name in words["brush"]] == ["march", "swarm"]
        assert words["group"][-1][1] == words_of(lived)["group"][moment_of(lived).labels["group"][row]]


def test_feet_of_nodes_are_where_those_of_poses_are(scenes):
    from flockbrush.render.animal_looks import mesh_of, posed

    nodes, (about, records) = Scene(scenes["nodes"]), Scene(scenes["crowd"]).crowd()
    mesh = mesh_of("beast")
    for frame in (3, 9, 20):
        record = records[frame, 0]
        clip = about["poses"][int(record["pose"][0])]["clip"]
        expected = posed(mesh, clip, record["phase"][0] / about["phase_scale"])
        body = next(k for k in nodes.nodes[nodes.node("animal 1")]["children"] if nodes.local(k, frame / 16)[2][0] > 0)
        inverse = np.linalg.inv(nodes.matrix(body, frame / 16))
        for k, part in enumerate(mesh.parts):
            limb = next(c for c in nodes.nodes[body]["children"] if nodes.nodes[c]["name"] == part.name)
            rows = np.flatnonzero((mesh.part == k) & (mesh.points[:, 2] < 1e-9))
            own = np.column_stack([mesh.points[rows] - part.pivot, np.ones(len(rows))])
            at = (inverse @ nodes.matrix(limb, frame / 16) @ own.T).T[:, :3]
            assert np.abs(at.mean(axis=0) - expected[rows].mean(axis=0)).max() < 0.03


def test_the_place_is_there(scenes, lived):
    scene = Scene(scenes["nodes"])
    ground = scene.document["meshes"][scene.nodes[scene.node("Ground")]["mesh"]]["primitives"][0]
    points = scene.numbers(ground["attributes"]["POSITION"])
    assert np.allclose(points.max(axis=0), (lived.level.width, lived.level.height, 0))
    stone = scene.document["meshes"][scene.nodes[scene.node("stone")]["mesh"]]["primitives"][0]
    corners = scene.numbers(stone["attributes"]["POSITION"])
    assert np.allclose(corners[:, :2].min(0), (22, 13)) and np.allclose(corners[:, :2].max(0), (26, 17))
    way = scene.document["meshes"][scene.nodes[scene.node("way")]["mesh"]]["primitives"][0]
    curve = scene.numbers(way["attributes"]["POSITION"])[:, :2]  # as the ground shows it: through all corners
    corners = np.array([(4, 15), (20, 10), (36, 15)], float)
    assert len(curve) > 3 and np.allclose(curve[[0, -1]], corners[[0, -1]])
    assert np.linalg.norm(curve[:, None] - corners, axis=2).min(axis=0).max() < 1e-5
    view = scene.matrix(scene.node("Camera"))
    lens = scene.document["cameras"][0]["perspective"]
    seen = np.linalg.inv(view) @ np.array([[x, 0, -y, 1] for x in (0, 40) for y in (0, 30)], float).T
    assert (seen[2] < 0).all()  # before the camera
    assert (np.abs(seen[1] / seen[2]) < np.tan(lens["yfov"] / 2)).all()


@pytest.mark.parametrize("mode", MODES)
def test_who_is_not_born_yet_or_dead_is_not_shown(tmp_path, lived, mode):
    path = tmp_path / "turning.glb"
    made = GltfScene(path, lived, 24, gltf_mode=mode)
    made.open()
    for moment in turning():
        made.take(moment)
    made.close()
    scene = Scene(path)
    if mode == "crowd":
        about, records = scene.crowd()
        there = records["flags"][..., 0] & 1
        assert about["ids"] == [1, 2, 3, 4]
        assert there[:, 0].tolist() == [1] * 30 + [0] * 10 and there[:, 3].tolist() == [0] * 20 + [1] * 20
        return
    for animal, shown in ((1, [1, 1, 0, 0]), (4, [0, 0, 1, 1])):
        body = scene.nodes[scene.node(f"animal {animal}")]["children"][0]
        frames = (0, 29, 30, 39) if animal == 1 else (0, 19, 20, 39)
        assert [scene.local(body, frame / 24)[2][0] for frame in frames] == shown


def growing(simulation, frames=32):
    """Moments of two animals; the first is twice as large from 0.5 s on, and of another look from 1 s on."""
    moment = rows_of(moment_of(simulation), [0, 1])
    looks = looks_of(simulation)
    other = next(k for k, look in enumerate(looks) if look != looks[moment.species[0]])
    made = []
    for frame in range(frames):
        times, species = np.ones(2), moment.species.copy()
        times[0] = 2.0 if 0.5 <= frame / 24 < 1.25 else 1.0
        species[0] = other if frame >= 24 else species[0]
        made.append(
            replace(moment, time=frame / 24, species=species, length=moment.length * times,
                    radius=moment.radius * times)
        )  # fmt: skip
    return made


@pytest.mark.parametrize("mode", MODES)
def test_sizes_and_species_that_change_are_shown_when_they_change(tmp_path, mode):
    ridge = start("ridge", seed=1)
    moments = growing(ridge)
    path = tmp_path / "growing.glb"
    made = GltfScene(path, ridge, 24, gltf_mode=mode)
    made.open()
    for moment in moments:
        made.take(moment)
    made.close()
    ridge.close()
    scene, frames = Scene(path), (0, 11, 12, 23, 24, 29, 30, 31)
    names = words_of(ridge)["species"]
    for row, animal in enumerate(moments[0].ids.tolist()):
        expected = [(names[moments[f].species[row]], float(moments[f].length[row])) for f in frames]
        if mode == "crowd":
            about, records = scene.crowd()
            bodies = about["first_body"][row] + records["body"][list(frames), row, 0].astype(int)
            told = [(names[about["species_of"][body]], about["scales"][body][0]) for body in bodies]
            looks = [about["poses"][records["pose"][f, row, 0]]["look"] for f in frames]
        else:
            node = scene.node(f"animal {animal}")
            meshes = scene.document["meshes"]
            told, looks = [], []
            for f in frames:
                shown = [k for k in scene.nodes[node]["children"] if scene.local(k, f / 24)[2][0] > 0]
                assert len(shown) == 1
                name = [word for second, word in scene.nodes[node]["extras"]["species"] if second <= f / 24 + 1e-3][-1]
                told.append((name, scene.local(shown[0], f / 24)[2][0]))
                parts = [scene.nodes[k] for k in scene.nodes[shown[0]]["children"]]
                looks.append(next(meshes[part["mesh"]]["name"].split()[0] for part in parts if "mesh" in part))
        assert [name for name, _ in told] == [name for name, _ in expected]
        assert np.allclose([size for _, size in told], [size for _, size in expected], atol=1e-4)
        assert looks == [looks_of(ridge)[moments[f].species[row]] for f in frames]


def test_an_animal_takes_the_short_way_over_the_seam_of_a_periodic_map(tmp_path, lived, monkeypatch):
    monkeypatch.setattr(Landscape, "wrap", property(lambda _: (40.0, 30.0)))
    moments = []
    for frame, x in enumerate((38.0, 39.0, 1.0, 2.0)):  # at the third frame it is over the seam
        moment = turning(n=1, frames=1)[0]
        y = 29.5 + 0.5 * frame - 30 * (frame > 0)
        moments.append(replace(moment, time=frame / 24, xyz=np.array([[x, y, 0.0]])))
    for mode in MODES:
        made = GltfScene(tmp_path / f"{mode}.glb", lived, 24, gltf_mode=mode)
        made.open()
        for moment in moments:
            made.take(moment)
        made.close()
    scene = Scene(tmp_path / "nodes.glb")
    node = scene.node("animal 1")
    channel = next(c for c in scene.document["animations"][0]["channels"]
                   if c["target"] == {"node": node, "path": "translation"})  # fmt: skip
    sampler = scene.document["animations"][0]["samplers"][channel["sampler"]]
    times, places = scene.numbers(sampler["input"])[:, 0], scene.numbers(sampler["output"])
    middles = [np.interp(t, times, places[:, k]) for t in (0.5 / 24, 1.5 / 24, 2.5 / 24) for k in (0, 1)]
    assert np.allclose(middles, [38.5, 29.75, 40.0, 0.25, 1.5, 0.75], atol=0.06)
    assert np.allclose([np.interp(frame / 24, times, places[:, 0]) for frame in range(4)], [38, 39, 1, 2], atol=1e-4)
    assert Scene(tmp_path / "crowd.glb").crowd()[0]["wrap"] == [40.0, 30.0]


def test_a_herd_of_nobody_is_a_scene(tmp_path, lived):
    for mode in MODES:
        path = tmp_path / f"{mode}.glb"
        made = GltfScene(path, lived, 24, gltf_mode=mode)
        made.open()
        none = turning(frames=1)[0]
        made.take(replace(none, **{k: v[:0] for k, v in vars(none).items() if isinstance(v, np.ndarray)}))
        made.close()
        assert "Ground" in [node["name"] for node in Scene(path).nodes]
        assert [name for name in os.listdir(tmp_path) if "flockbrush" in name] == []


def test_too_many_animals_for_nodes_are_sent_to_the_crowd(cli, recording, tmp_path, monkeypatch):
    from flockbrush.output.gltf import animated_nodes

    monkeypatch.setattr(animated_nodes, "MOST", 10)
    done = cli("export", recording, "--to", tmp_path / "a.glb", "--fps", 1)
    assert done.code == 1
    assert "--gltf-mode crowd" in done.err
    assert list(tmp_path.iterdir()) == []


# other people's tools ------------------------------------------------------------------


@pytest.mark.tools
@pytest.mark.parametrize("mode", MODES)
def test_the_validator_finds_no_errors_and_no_warnings(scenes, mode):
    validator = node_module("gltf-validator")
    if validator is None:
        pytest.skip("gltf-validator is not installed (npm install -g gltf-validator)")
    program = (
        f"require({json.dumps(str(validator))}).validateBytes("
        f"new Uint8Array(require('fs').readFileSync({json.dumps(str(scenes[mode]))})))"
        ".then((told) => console.log(JSON.stringify(told.issues)))"
    )
    done = subprocess.run(["node", "-e", program], capture_output=True, text=True, timeout=120)
    told = json.loads(done.stdout)
    assert (told["numErrors"], told["numWarnings"]) == (0, 0), told["messages"]
    assert {message["code"] for message in told["messages"]} <= {"UNUSED_OBJECT", "IMAGE_NPOT_DIMENSIONS"}


@pytest.mark.tools
@pytest.mark.skipif(chromium() is None, reason="chromium is not installed (apt-get install chromium)")
def test_three_js_draws_the_herd_where_it_was_in_both_modes(scenes, lived, tmp_path):
    pictures = {}
    middle = y_up(lived.agents[Position.xyz].mean(axis=0)[None])[0].tolist()
    with Browser((640, 360)) as browser:
        for mode in MODES:
            open_scene(browser, scenes[mode], tmp_path)
            look = f"""window.shown.then((s) => {{ s.camera.removeFromParent(); s.scene.add(s.camera);
                s.camera.position.set({middle[0]} - 8, 7, {middle[2]} + 9); s.camera.lookAt(...{middle});
                s.camera.aspect = 16 / 9; s.camera.updateProjectionMatrix();
                s.gltf.scene.getObjectByName('Herd').visible = SECONDS >= 0;
                s.show(Math.max(0, SECONDS)); return 0; }})"""
            for seconds in ("0", "1.25", "-1"):
                browser.evaluate(look.replace("SECONDS", seconds))
                browser.picture(tmp_path / "a.png")
                pictures[mode, seconds] = cv2.imread(str(tmp_path / "a.png")).astype(int)
        assert browser.complaints == []
    differ = {key: np.abs(picture - pictures["nodes", "-1"]).max(axis=2) > 40 for key, picture in pictures.items()}
    for seconds in ("0", "1.25"):
        nodes, crowd = differ["nodes", seconds], differ["crowd", seconds]
        assert nodes.sum() > 4000  # pixels of the herd
        assert (nodes & crowd).sum() > 0.9 * (nodes | crowd).sum()  # poses draw the gait a little more coarsely
    assert (differ["crowd", "0"] & differ["crowd", "1.25"]).sum() < 0.9 * differ["crowd", "0"].sum()  # it moves
    assert not differ["crowd", "-1"].any()


@pytest.mark.tools
@pytest.mark.skipif(importlib.util.find_spec("gdtoolkit") is None, reason="pip install gdtoolkit parses GDScript")
def test_the_godot_script_parses():
    from gdtoolkit.parser import parser

    assert parser.parse((ROOT / "examples/godot/crowd.gd").read_text())


def test_the_godot_script_reads_the_fields_and_types_that_are_documented(scenes):
    """What it decodes by its own offsets is what is in the file."""
    import re

    text = (ROOT / "examples/godot/crowd.gd").read_text()
    about, _ = Scene(scenes["crowd"]).crowd()
    types = {"float32": "float", "int16": "s16", "uint16": "u16"}
    known = {field["name"]: types.get(field["type"]) for field in about["fields"]}
    for name, kind in (("flags", "u16"), ("brush", "u16"), ("pose", "u16")):
        assert re.search(rf'decode_{kind}\(record \+ at\["{name}"\]\)', text) and known[name] == kind
    assert 'var p: int = record + at["place"]' in text and known["place"] == "float"
    assert 'var q: int = record + at["turn"]' in text and known["turn"] == "s16"
    for name in re.findall(r'about\["(\w+)"\]', text):
        assert name in about
    for reader in ("examples/godot/crowd.gd", "examples/three/crowd.js"):
        assert len((ROOT / reader).read_text().splitlines()) < 90
    header = scenes["crowd"].read_bytes()
    length = int.from_bytes(header[12:16], "little")  # as the script finds the numbers
    start = 20 + length + 8 + Scene(scenes["crowd"]).document["bufferViews"][about["bufferView"]]["byteOffset"]
    first = np.frombuffer(header, "<f4", 3, start)
    assert np.allclose(first, Scene(scenes["crowd"]).crowd()[1][0, 0]["place"])


def test_more_animals_than_nodes_can_show_are_refused_before_the_run(cli, tmp_path, monkeypatch):
    from flockbrush.output.gltf import animated_nodes

    monkeypatch.setattr(animated_nodes, "MOST", 5)
    done = cli("run", "meadow", "--agents", 6, "--seconds", 100_000, "--export", tmp_path / "a.glb")
    assert done.code == 1 and "this run has 6; use --gltf-mode crowd" in done.err
    assert list(tmp_path.iterdir()) == []

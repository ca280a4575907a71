"""Ground that is painted during a run, in glTF: every frame shows the ground as it was, in readers and in Blender."""

import json
import subprocess
from pathlib import Path

import cv2
import numpy as np
import pytest
from blender import WITHOUT_BLENDER, blender_python
from flockbrush.components import Position
from flockbrush.systems.commands import PaintBrush
from test_gltf import Scene

from flockbrush.output.export import Exports
from flockbrush.output.scene_meshes import SceneMeshes
from flockbrush.runs.run import start

FPS = 16
FRAMES = 41  # two and a half seconds
SPOT = (8.0, 10.0)
STROKES = {15: "march", 23: "swarm", 63: "march"}  # by tick: one waits for a second to pass, the last for the end
SHOWN_FROM = (0, 8, 24, 40)  # frames


@pytest.fixture(scope="module")
def painted(level, shared):
    """(path, {frame: colour of the ground at the spot}, {frame: places of the animals by id})."""
    simulation, path = start(level), shared / "painted.glb"
    colours, places = {}, {}
    with Exports([path], simulation, FPS) as exports:
        for tick in range(2 * FRAMES - 1):
            if tick:
                simulation.tick()
            if tick // 2 in SHOWN_FROM and tick % 2 == 0:
                colours[tick // 2] = colour_at_spot(SceneMeshes(simulation, "light").painter().ground, simulation)
                ids = simulation.agents.ids.tolist()
                places[tick // 2] = dict(zip(ids, simulation.agents[Position.xyz].tolist(), strict=True))
            exports.take()
            if tick in STROKES:
                simulation.submit(PaintBrush(STROKES[tick], *SPOT, 3.0))
    return path, colours, places


def colour_at_spot(picture, simulation):
    high, wide = picture.shape[:2]
    x, y = SPOT[0] / simulation.level.width * wide, (1 - SPOT[1] / simulation.level.height) * high
    return picture[int(y) - 20 : int(y) + 20, int(x) - 20 : int(x) + 20].reshape(-1, 3).mean(axis=0)


def picture_of(scene, node):
    """The picture of a ground (h, w, 3), red first."""
    document = scene.document
    mesh = document["meshes"][scene.nodes[node]["mesh"]]
    surface = document["materials"][mesh["primitives"][0]["material"]]["pbrMetallicRoughness"]
    image = document["images"][document["textures"][surface["baseColorTexture"]["index"]]["source"]]
    view = document["bufferViews"][image["bufferView"]]
    data = scene.data[view["byteOffset"] : view["byteOffset"] + view["byteLength"]]
    return cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)[:, :, ::-1]


def test_each_frame_shows_one_ground_and_it_is_painted_as_it_was(painted, level):
    path, colours, _ = painted
    scene, simulation = Scene(path), start(level)
    grounds = [k for k, node in enumerate(scene.nodes) if node["name"].startswith("Ground")]
    assert len(grounds) == len(SHOWN_FROM)
    for frame in range(FRAMES):
        shown = [k for k in grounds if scene.local(k, frame / FPS)[2][0] > 0]
        since = sum(first <= frame for first in SHOWN_FROM) - 1
        assert shown == [grounds[since]], frame
        if frame in colours and frame != 24:
            assert colour_at_spot(picture_of(scene, shown[0]), simulation) == pytest.approx(colours[frame], abs=4)
    assert np.ptp([colours[frame] for frame in SHOWN_FROM], axis=0).max() > 12  # the strokes can be told apart


def test_everything_moves_in_one_animation(painted):
    assert [animation["name"] for animation in Scene(painted[0]).document["animations"]] == ["run"]


@pytest.mark.tools
@pytest.mark.skipif(blender_python() is None, reason=WITHOUT_BLENDER)
def test_blender_shows_the_herd_and_the_paint_as_they_were(painted, tmp_path):
    path, _, places = painted
    program = Path(__file__).parents[1] / "look_with_blender_gltf.py"
    frames = {"0": 0, "0.5": 8, "1.5": 24, "2.5": 40}
    words = [blender_python(), program, path, f"{tmp_path}/at-", *frames]
    done = subprocess.run(words, capture_output=True, text=True, timeout=600)
    assert "TOLD" in done.stdout, done.stderr
    told = json.loads(done.stdout.split("TOLD")[1].splitlines()[0])
    for moment, frame in frames.items():
        for animal, place in places[frame].items():
            assert told[moment]["animals"][f"animal {animal}"] == pytest.approx(place, abs=2e-3)
        assert told[moment]["grounds"] == ["Ground" + f" {SHOWN_FROM.index(frame)}" * (frame > 0)]
    pictures = [cv2.imread(f"{tmp_path}/at-{moment}.png").astype(int) for moment in frames]
    for before, after in zip(pictures, pictures[1:], strict=False):
        assert (np.abs(after - before).max(axis=2) > 12).sum() > 100  # pixels: another ground

"""Obstacles that move, come and go during a run, in the page, USD and glTF: what is exported is what was there."""

import time

import numpy as np
import pytest
from browser import Browser, chromium
from flockbrush.systems.commands import AddObstacle, MoveObstacle, RemoveObstacle
from flockbrush.systems.landscape import Landscape
from test_gltf import Scene

from flockbrush.output.export import Exports
from flockbrush.output.moving_solids import MovingSolids
from flockbrush.output.scene_meshes import SceneMeshes
from flockbrush.runs.run import start
from tests.flockbrush.pens import pen

FPS = 16
FRAMES = 33  # two seconds
SQUARE = [[30.0, 24.0], [32.0, 24.0], [32.0, 26.0], [30.0, 26.0]]


def middle_of(simulation, name):
    """Middle of an obstacle (2,) m, None where it is not."""
    found = simulation.world.resource(Landscape).find(name)
    return found[0].polygon.mean(axis=0).tolist() if found else None


@pytest.fixture(scope="module")
def exported(level, shared):
    """(paths by ending, [{name: middle}] of all frames): the stone glides, a box comes, the stone is taken away."""
    simulation = start(level)
    paths = {ending: shared / f"moving.{ending}" for ending in ("html", "usda", "glb")}
    truth = []
    with Exports(list(paths.values()), simulation, FPS) as exports:
        for tick in range(2 * FRAMES - 1):
            if tick:
                simulation.tick()
            if tick % 2 == 0:
                truth.append({name: middle_of(simulation, name) for name in ("stone", "box")})
            exports.take()
            if tick == 15:
                simulation.submit(MoveObstacle("stone", 30.0, 10.0, seconds=0.5))
            if tick == 31:
                simulation.submit(AddObstacle("box", SQUARE))
            if tick == 47:
                simulation.submit(RemoveObstacle("stone"))
    return paths, truth


def test_what_reaches_over_a_border_is_there_once_more_at_the_other_while_it_does(tmp_path):
    simulation = start(pen(tmp_path, sheep=1, script=False, boundary="wrap"))
    moving, places = MovingSolids(SceneMeshes(simulation)), []
    for x in (24.0, 0.5, -1.0, 24.0):
        simulation.submit(MoveObstacle("stone", x, 15.0), simulation.clock.tick)
        simulation.tick()
        moving.take()
        middles = [
            np.add(solid.faces.corners.mean(axis=(0, 1)), solid.keys[-1].offset)[0].item()
            for solid in moving.solids if solid.keys[-1].shown
        ]  # fmt: skip
        faces, _ = SceneMeshes(simulation).obstacles()
        assert len(faces.corners) == len(middles) * len(moving.solids[0].faces.corners)
        places.append(sorted(round(middle, 6) for middle in middles))
    assert places == [[24.0], [0.5, 40.5], [-1.0, 39.0], [24.0]]
    simulation.close()


def test_the_scene_is_the_one_that_is_meant(exported):
    truth = exported[1]
    assert len(truth) == FRAMES
    assert truth[0] == {"stone": [24.0, 15.0], "box": None}
    assert truth[20]["stone"] == pytest.approx([30.0, 10.0]) and truth[20]["box"] == [31.0, 25.0]
    assert truth[12]["stone"] not in ([24.0, 15.0], [30.0, 10.0])  # on its way
    assert truth[-1]["stone"] is None


def test_usd_has_obstacles_where_they_were_in_every_frame(exported):
    pytest.importorskip("pxr.Usd")
    from pxr import Gf, Usd, UsdGeom
    from test_usd import complaints

    paths, truth = exported
    stage = Usd.Stage.Open(str(paths["usda"]))
    prims = {p.GetName().rsplit("_", 1)[0]: p for p in stage.GetPrimAtPath("/World/Place/Obstacles").GetChildren()}
    assert sorted(prims) == ["box", "stone"]
    for frame, there in enumerate(truth):
        for name, middle in there.items():
            mesh = UsdGeom.Mesh(prims[name])
            matrix = mesh.ComputeLocalToWorldTransform(frame)
            shown = mesh.ComputeVisibility(frame) == "inherited"
            assert shown == (middle is not None)
            assert (matrix.TransformDir(Gf.Vec3d(1, 0, 0)).GetLength() > 0.5) == shown
            if shown:
                points = [matrix.Transform(Gf.Vec3d(*map(float, p))) for p in mesh.GetPointsAttr().Get()]
                low, high = np.min(points, axis=0), np.max(points, axis=0)
                assert np.allclose((low[:2] + high[:2]) / 2, middle, atol=1e-4)
    assert [error.GetMessage() for error in complaints(paths["usda"])] == []


def test_gltf_has_obstacles_where_they_were_in_every_frame(exported):
    paths, truth = exported
    scene = Scene(paths["glb"])
    first = {"stone": truth[0]["stone"], "box": truth[-1]["box"]}
    for name, start_at in first.items():
        node = scene.node(name)
        channels = {
            channel["target"]["path"]: animation["samplers"][channel["sampler"]]
            for animation in scene.document["animations"]
            for channel in animation["channels"]
            if channel["target"]["node"] == node
        }
        for frame, there in enumerate(truth):
            size = scene.local(node, frame / FPS)[2][0] if "scale" in channels else 1.0
            assert (size > 0) == (there[name] is not None)
            if there[name] is None:
                continue
            sampler = channels["translation"]
            times, values = scene.numbers(sampler["input"])[:, 0], scene.numbers(sampler["output"])
            assert (np.diff(times) > 0).all()
            offset = [np.interp(frame / FPS, times, values[:, axis]) for axis in range(2)]
            assert np.allclose(np.add(start_at, offset), there[name], atol=1e-4)


@pytest.mark.tools
@pytest.mark.skipif(chromium() is None, reason="chromium is not installed (apt-get install chromium)")
def test_the_page_has_obstacles_where_they_were(exported, tmp_path):
    import cv2

    paths, truth = exported
    with Browser() as browser:
        browser.open(paths["html"])
        until = time.monotonic() + 60
        while browser.evaluate("typeof window.flockbrush") != "object" and time.monotonic() < until:
            time.sleep(0.1)
        names = browser.evaluate("window.flockbrush.then((p) => p.about.moving.map((one) => one.name))")
        assert names == ["stone", "box"]
        pictures = []
        for frame in (0, 12, 20, 32):
            told = browser.evaluate(
                f"""window.flockbrush.then(async (p) => {{ p.view("plan"); p.seek({frame / FPS});
                const n = p.frames; p.dirty = true; while (p.frames === n) await new Promise(requestAnimationFrame);
                return p.place.moving.map(({{ mesh }}) => [mesh.visible, ...mesh.position.toArray()]); }})"""
            )
            for (shown, x, y, _), name, began in zip(told, names, (truth[0]["stone"], truth[20]["box"]), strict=True):
                there = truth[frame][name]
                assert shown == (there is not None)
                if shown:
                    assert np.allclose(np.add(began, (x, y)), there, atol=1e-3)
            browser.picture(tmp_path / "a.png")
            pictures.append(cv2.imread(str(tmp_path / "a.png")).astype(int)[100:560])
        assert browser.complaints == []
    for one, other in ((0, 1), (1, 2), (2, 3)):
        assert (np.abs(pictures[one] - pictures[other]).max(axis=2) > 40).sum() > 300


def test_obstacles_that_stand_cost_nothing(level, tmp_path):
    simulation = start(level)
    moving = MovingSolids(SceneMeshes(simulation))
    for _ in range(5):
        assert moving.take() == []
        simulation.tick()
    assert [solid.moves for solid in moving.solids] == [False]

"""Ground that is painted during a run: the page and USD show it as it was at each moment."""

import time

import cv2
import numpy as np
import pytest
from browser import Browser, chromium
from flockbrush.systems.commands import PaintBrush

from flockbrush.output.export import Exports
from flockbrush.output.painted_ground import PaintedGround
from flockbrush.output.scene_meshes import SceneMeshes
from flockbrush.runs.run import start

SPOTS = {8: (8.0, 24.0), 40: (30.0, 6.0)}  # tick: where a disc of 3 m is painted; ticks are 1/32 s


def painted(simulation, take, ticks=65):
    """Live two seconds, painted twice."""
    for tick in range(ticks):
        if tick:
            simulation.tick()
        take(tick)
        if tick in SPOTS:
            simulation.submit(PaintBrush("swarm", *SPOTS[tick], 3.0))


@pytest.fixture(scope="module")
def exported(level, shared):
    paths = {ending: shared / f"painted.{ending}" for ending in ("html", "usda")}
    simulation = start(level)
    with Exports(list(paths.values()), simulation, 16) as exports:
        painted(simulation, lambda tick: exports.take())
    return paths


def pixel(simulation, picture, x, y):
    """The colour at a place, (3,)."""
    scale = picture.shape[1] / simulation.level.width
    return picture[round((simulation.level.height - y) * scale), round(x * scale)].astype(int)


def test_patches_make_the_picture_that_drawing_the_whole_would_give(level):
    simulation = start(level)
    place = SceneMeshes(simulation)
    ground, patches = PaintedGround(place, 256), []
    canvas = ground.picture.copy()

    def take(tick):
        patch = ground.take(tick / 32)
        if patch is not None:
            patches.append(tick)
            height, width = patch.pixels.shape[:2]
            canvas[patch.top : patch.top + height, patch.left : patch.left + width] = patch.pixels

    painted(simulation, take)
    assert patches == [9, 41]
    assert (canvas == place.painter(256).ground).all()


def test_usd_has_a_picture_of_the_ground_for_each_time(exported):
    pytest.importorskip("pxr.Usd")
    from pxr import Usd, UsdShade
    from test_usd import complaints

    stage = Usd.Stage.Open(str(exported["usda"]))
    file = next(
        UsdShade.Shader(prim).GetInput("file").GetAttr() for prim in stage.Traverse() if prim.GetName() == "Picture"
    )
    names = [file.Get(frame).path for frame in (0, 4, 5, 20, 21)]
    first, second, third = "./painted.ground.jpg", "./painted.ground.1.jpg", "./painted.ground.2.jpg"
    assert names == [first, first, second, second, third]
    pictures = [cv2.imread(str(exported["usda"].parent / name)).astype(int) for name in (first, second, third)]
    changed = [np.argwhere(np.abs(b - a).max(axis=2) > 40) for a, b in zip(pictures, pictures[1:], strict=False)]
    scale = pictures[0].shape[1] / start_width(exported)
    for places, (x, y) in zip(changed, SPOTS.values(), strict=True):
        middle = places.mean(axis=0)[::-1] / scale
        assert middle == pytest.approx((x, pictures[0].shape[0] / scale - y), abs=0.5)
    assert [error.GetMessage() for error in complaints(exported["usda"])] == []


def start_width(exported):
    """m across the ground of the exported scene."""
    from pxr import Usd, UsdGeom

    stage = Usd.Stage.Open(str(exported["usda"]))
    return max(point[0] for point in UsdGeom.Mesh(stage.GetPrimAtPath("/World/Place/Ground")).GetPointsAttr().Get())


@pytest.mark.tools
@pytest.mark.skipif(chromium() is None, reason="chromium is not installed (apt-get install chromium)")
def test_the_page_shows_paint_when_it_was_there_also_when_scrubbed_back(exported):
    painted_ = """(p) => { p.seek(T); p.place.paint(p.time + p.run.times[0]);
        const c = p.place.canvas, brush = c.getContext("2d"), scale = c.width / p.place.place.width;
        const at = ([x, y]) => [...brush.getImageData(x * scale, c.height - y * scale, 1, 1).data];
        return [[8, 24], [30, 6]].map(at); }"""
    with Browser() as browser:
        browser.open(exported["html"])
        until = time.monotonic() + 60
        while browser.evaluate("typeof window.flockbrush") != "object" and time.monotonic() < until:
            time.sleep(0.1)

        def spots(at):
            told = browser.evaluate(f"window.flockbrush.then({painted_.replace('T', str(at), 1)})")
            return np.array(told)[:, :3].astype(int)

        bare, first, both, again = spots(0), spots(0.8), spots(2), spots(0.8)
    assert (np.abs(first - bare).max(axis=1) > 3).tolist() == [True, False]
    assert (np.abs(both - bare).max(axis=1) > 3).all()
    assert (again == first).all()

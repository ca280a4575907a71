"""Painting in a running world: the picture is mended where something changed, and is the one a new drawing gives."""

import numpy as np
import pytest
from flockbrush.behaviours.brush import shipped
from flockbrush.levels.build import build
from flockbrush.levels.reader import read_level
from flockbrush.systems.commands import AddObstacle, PaintBrush, PaintCap, RemoveObstacle
from flockbrush.systems.edits import DrawGuide, MarkSpawn, Paint, PlaceExit, RemoveThing

from flockbrush.render import Painter, Scenery
from flockbrush.render.view_camera import ViewCamera
from flockbrush.runs.run import open_level
from tests.flockbrush.pens import pen

SIZE = (480, 360)


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    return pen(tmp_path_factory.mktemp("pens"))


@pytest.fixture
def world(path):
    simulation = build(read_level(path), library=shipped())
    yield simulation
    simulation.close()


def painter(world, **options):
    return Painter(Scenery(world), SIZE, "light", **({"words": False, "labels": True} | options))


def apply(world, *commands):
    for command in commands:
        command.apply(world.world)


STROKES = {
    "a brush": (PaintBrush("march", 12.0, 12.0, 3.0), (9, 9, 15, 15)),
    "a cap": (PaintCap(0.5, 30.0, 20.0, 4.0), (26, 16, 34, 24)),
    "water": (Paint("surface", "water", 5.0, 22.0, 9.0, 24.0, 2.0), (3, 20, 11, 26)),
    "a soft stroke": (Paint("brush", "swarm", 25.0, 5.0, 32.0, 9.0, 3.0, 0.8), (22, 2, 35, 12)),
    "an exit": (PlaceExit(91, "way out", [[30, 3], [34, 3], [34, 6]]), (30, 3, 34, 6)),
    "a stone": (AddObstacle("stone", [[5, 5], [9, 5], [9, 8]]), (5, 5, 9, 8)),
}


@pytest.mark.parametrize("zoom", [1.0, 3.7])
@pytest.mark.parametrize("live", [False, True])
@pytest.mark.parametrize("name", STROKES)
def test_a_mended_picture_is_the_one_a_new_drawing_gives(world, name, live, zoom):
    stroke, box = STROKES[name]
    home = painter(world).home
    camera = home if zoom == 1 else home.zoomed(zoom).at((box[0] + box[2]) / 2 + 1, (box[1] + box[3]) / 2)
    old = painter(world, live=live)
    old.look(camera)
    before = _whole(old)
    apply(world, stroke)
    old.repaint(box)
    new = painter(world, live=live)
    new.look(camera)
    assert np.array_equal(old.ground, _whole(new))
    assert not np.array_equal(old.ground, before)


def test_what_reaches_over_the_border_of_a_periodic_map_is_mended_on_both_sides(tmp_path):
    world = build(read_level(pen(tmp_path, boundary="wrap")), library=shipped())
    stone, way_out = [[-2, 5], [2, 5], [2, 8]], [[20, 29], [24, 29], [24, 32]]
    steps = [
        AddObstacle("stone", stone),
        PlaceExit(91, "out", way_out),
        RemoveThing("exit", 91),
        RemoveObstacle("stone"),
    ]
    old = painter(world, live=True)
    _whole(old)
    for command in steps:
        box = command.ground_box(world.world)
        apply(world, command)
        old.repaint(box)
        assert np.array_equal(_whole(old), _whole(painter(world, live=True)))
    world.close()


def _whole(painter):
    while not painter.refine(1.0):
        pass
    return painter.ground.copy()


def test_mending_costs_what_the_box_costs(world):
    p = painter(world, live=True)
    p.look(p.home.zoomed(6.0))
    _whole(p)
    drawn = []
    p.tiles._sketcher.__class__.paint, paint = (
        lambda self, box: (drawn.append(box), paint(self, box))[1],
        p.tiles._sketcher.__class__.paint,
    )
    try:
        x, y = p.camera.centre
        p.repaint((x - 0.2, y - 0.2, x + 0.2, y + 0.2))
    finally:
        p.tiles._sketcher.__class__.paint = paint
    far = 2 * (16 + 4 * p.camera.scale) + 0.4 * p.camera.scale + 2
    (box,) = drawn
    assert 10 < box[2] - box[0] <= far and 10 < box[3] - box[1] <= far


@pytest.mark.parametrize("name", ["gorge", "predators-valley"])
@pytest.mark.parametrize("zoom", [1.0, 0.3, 5.3])
def test_any_box_has_the_pixels_it_has_in_the_whole(name, zoom):
    p = Painter(open_level(name)[0], (640, 400), "dark", words=False, labels=True)
    p.look(p.home.zoomed(zoom, (100, 300)).moved(13.4, -7.7))
    whole, rng = p.ground.copy(), np.random.default_rng(5)
    for _ in range(8):
        (left, top), (wide, tall) = rng.integers(0, (600, 360)), rng.integers(3, 150, 2)
        box = (int(left), int(top), int(min(left + wide, 640)), int(min(top + tall, 400)))
        p.tiles._bare[box[1] : box[3], box[0] : box[2]] = 77
        p.tiles._sketcher.paint(box)
        p.tiles._compose(box)
        assert np.array_equal(p.ground, whole), box


def test_what_is_painted_in_mid_run_is_in_the_picture(world):
    p = painter(world)
    before = p.frame()
    apply(world, PaintBrush("swarm", 30.0, 8.0, 4.0))
    rows, columns = np.nonzero((p.frame() != before).any(axis=2))
    x, y = p.camera.pixels((30, 8))
    assert abs(columns.mean() - x) < 8 and abs(rows.mean() - y) < 8
    apply(world, AddObstacle("wall", [[2, 25], [8, 25], [8, 27]]))
    x, y = p.camera.pixels((7, 25.8)).astype(int)
    assert not np.array_equal(p.frame()[y, x], before[y, x])


def test_dragging_shows_the_old_ground_at_once_and_keeps_it(world):
    p = painter(world, live=True, labels=False)
    p.look(p.home.zoomed(2.0))
    before = _whole(p)
    p.look(p.camera.moved(40, -20))
    shown = p.ground
    assert np.array_equal(shown[: -20 - 40, 40:-6], before[20:-40, : -40 - 6])
    fresh = painter(world, live=True, labels=False)
    fresh.look(p.camera)
    difference = np.abs(_whole(p).astype(int) - _whole(fresh))
    assert difference.mean() < 0.05  # the very numbers of a pixel may be rounded otherwise


def test_zooming_shows_the_old_ground_larger_until_it_is_drawn(world):
    p = painter(world, live=True)
    _whole(p)
    camera = p.home.zoomed(1.6, (100, 80))
    p.look(camera)
    stand_in = p.ground.astype(int)
    assert np.abs(stand_in - _whole(p)).mean() < 6
    new = painter(world, live=True)
    new.look(camera)
    assert np.array_equal(p.ground, _whole(new))


def test_a_budget_is_kept_and_what_is_in_the_middle_comes_first(world):
    p = painter(world, live=True)
    p.look(p.home.zoomed(1.5))
    assert not p.refine(0.0)
    left = len(p.tiles.stale)
    assert not p.refine(0.0)
    assert len(p.tiles.stale) == left - 1
    while not p.refine(0.0):
        pass
    whole = painter(world)
    whole.look(p.camera)
    assert np.array_equal(p.ground, whole.ground)


def test_a_scenery_tells_what_has_changed(world):
    scenery = Scenery(world)
    assert scenery.changes() == []
    apply(world, PaintBrush("swarm", 30.0, 8.0, 2.0), PaintCap(1.0, 5.0, 5.0, 1.5))
    (west, south, east, north), cap = scenery.changes()
    assert (west, south) == (28, 6) and (east, north) == (32, 10)
    assert cap == (4, 4, 6, 6) or cap[0] < 5 < cap[2]
    assert scenery.changes() == []
    apply(
        world, DrawGuide(77, "new", [[1, 1], [9, 9]]), MarkSpawn(78, "more", [[1, 1], [5, 1], [5, 5]], "march", count=2)
    )
    assert scenery.changes() == ["all"]


def test_a_camera_far_away_shows_paper(world):
    p = painter(world, live=True)
    p.look(ViewCamera((1e5, -1e5), 3.0, SIZE, (0, 0, *SIZE)))
    assert p.refine(1.0) and (p.ground == p.theme.paper).all()
    p.repaint((0, 0, 40, 30))
    assert (p.ground == p.theme.paper).all()


def test_a_video_shows_what_the_script_paints(tmp_path):
    import cv2

    from flockbrush.output.export import Exports
    from flockbrush.runs.run import start

    simulation = start(pen(tmp_path, sheep=2, script=False))
    simulation.submit(PaintBrush("march", 30.0, 8.0, 5.0), 4)
    with Exports([tmp_path / "a.mp4"], simulation, fps=32, size=(480, 360)) as exports:
        exports.take()
        for _ in range(8):
            simulation.tick()
            exports.take()
    video = cv2.VideoCapture(str(tmp_path / "a.mp4"))
    frames = [video.read()[1].astype(int) for _ in range(9)]
    x, y = Painter(Scenery(simulation), (480, 360)).camera.pixels((30, 5)).astype(int)
    shade = [frame[y - 2 : y + 3, x - 2 : x + 3].mean(axis=(0, 1)) for frame in frames]
    assert np.abs(shade[8] - shade[0]).max() > 6 > np.abs(shade[3] - shade[0]).max()
    simulation.close()

"""Animals drawn with the legs and wings of their species where they are large enough, in the plan and in space."""

import cv2
import numpy as np
import pytest

from flockbrush.output.pictures import herd_of
from flockbrush.render import space_view
from flockbrush.render.animal_figures import KINDS
from flockbrush.render.animal_looks import CLIPS
from flockbrush.render.facets import SpacePose
from flockbrush.render.gaits import Gaits
from flockbrush.render.mesh_bodies import LOOK_NAMES, Postures, draw_mesh, mesh_inks, meshes
from flockbrush.render.style import PLAN_SUN
from flockbrush.render.top_views import from_above
from flockbrush.runs.run import start
from flockbrush.runs.snapshots import moment_of
from tests.flockbrush.test_draw_animals import changed, herd, painter
from tests.flockbrush.test_draw_space import NOBODY, birds, camera
from tests.flockbrush.test_draw_space import painter as space_painter

MOVING = {"beast": "walk", "bird": "fly", "fish": "swim", "insect": "run", "person": "walk"}


def posture(look, phase):
    return Postures(
        np.array([LOOK_NAMES.index(look)]), np.array([CLIPS.index(MOVING[look])]), np.array([float(phase)])
    )  # fmt: skip


@pytest.mark.parametrize("look", MOVING)
def test_limbs_of_large_animals_move_through_a_cycle_and_come_back(look):
    p = painter()
    one, half, whole = (
        p.frame(herd((20, 15), length=6.0, radius=2.4, postures=posture(look, phase))) for phase in (0.1, 0.6, 1.1)
    )
    assert np.array_equal(one, whole)
    assert len(changed(one, half)) > 20
    assert len(changed(one, p.ground)) > 300


@pytest.mark.parametrize("look", MOVING)
@pytest.mark.parametrize("turn", [0.0, 0.7, 2.5])
def test_what_maps_show_from_above_is_what_triangles_show(look, turn):
    """`draw_mesh` is the oracle; it draws triangles half a pixel larger all around."""
    length, radius, at, heading = 7.0, 2.8, (20.0, 15.0), np.array([np.cos(turn), np.sin(turn)])
    told = dict(length=length, radius=radius, heading=turn, postures=posture(look, 0.2))
    p = painter(shadows=False)
    maps, triangles = p.frame(herd(at, **told)), p.ground.copy()
    axes = np.array([[*heading, 0.0], [-heading[1], heading[0], 0.0], [0.0, 0.0, 1.0]])
    ink = np.empty((4, 3))
    mesh_inks(ink, p._stamps.colours[KINDS], False)
    row = tuple(int(column[0]) for column in told["postures"][:2])
    buffer, pose = p._buffer(triangles), SpacePose(np.array([*at, 0.0]), axes)
    wide = 2 * radius / (0.4 * length)
    draw_mesh(buffer, from_above(p.camera), meshes(), (*row, 0.2), pose, length, wide, ink, 1.0, PLAN_SUN)
    seen, due = (np.abs(image.astype(int) - p.ground).sum(2) > 30 for image in (maps, triangles))
    assert due.sum() > 400 and (seen ^ due).sum() < 0.2 * due.sum(), "half a pixel around thin legs"
    inside = cv2.erode((seen & due).astype(np.uint8), np.ones((5, 5))) > 0
    assert np.abs(maps.astype(int) - triangles)[inside].mean() < 8


def test_small_animals_are_drawn_without_limbs():
    p = painter()
    frames = [p.frame(herd((20, 15), length=1.5, radius=0.3, postures=posture("beast", phase))) for phase in (0, 0.5)]
    assert np.array_equal(*frames)
    assert np.array_equal(frames[0], p.frame(herd((20, 15), length=1.5, radius=0.3)))


def test_leaders_and_predators_with_legs_bear_their_marks():
    p = painter()
    told = dict(length=6.0, radius=1.2, postures=posture("beast", 0.1))
    plain = p.frame(herd((20, 15), **told))
    leader = p.frame(herd((20, 15), leader=np.array([True]), **told)).astype(int)
    hunter = p.frame(herd((20, 15), predator=np.array([True]), **told)).astype(int)
    yellow = (leader[..., 0] > 200) & (leader[..., 1] > 170) & (leader[..., 2] < 60)
    red = (hunter[..., 0] > 150) & (hunter[..., 1] < 100) & (hunter[..., 2] < 90)
    assert yellow.sum() > 40 and red.sum() > 200
    assert len(changed(plain, leader.astype(np.uint8))) > 40


@pytest.mark.parametrize("look", MOVING)
def test_a_mesh_in_space_stands_where_the_animal_is(look):
    p = space_painter(shadows=False)
    p.look(camera(elevation=10.0, distance=8.0, target=(0, 0, 1.0)))
    empty = p.frame(NOBODY)
    one, other = (p.frame(birds((0, 0, 1.0), postures=posture(look, phase))) for phase in (0.1, 0.6))
    pixels = changed(one, empty)
    assert len(pixels) > 150 and len(changed(one, other)) > 20
    middle = p.camera.pixels((0.0, 0.0, 1.0))
    assert np.hypot(*(np.median(pixels, axis=0)[::-1] - middle)) < 80


def beasts(xyz, **told):
    """Beasts with legs for those that are large enough, facing east."""
    count = len(xyz)
    shown = Postures(*(np.repeat(column, count) for column in posture("beast", 0.1)))
    told |= {"wings": None, "brush": np.zeros(count, int), "brush_colours": ("#203050",), "postures": shown}
    return birds(xyz, heading=0.0, **told)


def test_those_of_a_species_at_one_distance_all_have_legs_or_none(monkeypatch):
    drawn = []
    monkeypatch.setattr(space_view, "draw_bodies", lambda buffer, cam, order, herd, *more: drawn.append(herd.postures))
    p = space_painter(shadows=False)
    sizes = np.array([0.8, 1.2, 0.8, 1.2, 4.0])  # the last one is of another species
    flock = beasts([(3.0 * k, 0.0, 0.0) for k in range(5)], length=sizes, species=np.array([0, 0, 0, 0, 1]))
    near, far = (camera().focal / pixels for pixels in (35.0, 25.0))
    for distance, legs in ((near, 5), (far, 1)):
        p.look(camera(elevation=10.0, distance=distance))
        p.frame(flock)
        assert (drawn[-1].look >= 0).sum() == legs, distance


def test_heads_are_as_pale_with_legs_as_without():
    p, pale = space_painter(shadows=False), []
    p.backdrop = np.zeros((*p.size[::-1], 3), np.uint8)
    for pixels in (20.0, 33.0):
        p.look(camera(elevation=25.0, distance=camera().focal / pixels))
        pale.append(int(p.frame(beasts([(0.0, 0.0, 0.0)]))[..., 0].max()))  # of a blue animal the head is the reddest
    assert pale[0] == pytest.approx(pale[1], rel=0.15)


def test_pictures_show_the_clips_and_phases_that_exports_show():
    run = start("lake", seed=1)
    gaits = Gaits(run)
    for _ in range(3):
        moment = moment_of(run)
        clip, phase = gaits.of(moment)
        shown = herd_of(run, moment).postures
        assert np.array_equal(shown.clip, clip) and np.array_equal(shown.phase, phase)
        run.run(8)
    run.close()

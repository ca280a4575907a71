"""Birds on the wing: wings that beat by the clock, and nobody else's pixels changed."""

from dataclasses import replace

import numpy as np
import pytest
from flockbrush.components import Position
from flockbrush.engine.raster import Raster
from small_herd import brush, meadow, put

from flockbrush.output.pictures import herd_of
from flockbrush.render.animal_figures import KINDS, NO_WINGS, figure
from flockbrush.render.gaits import sizes
from flockbrush.render.shapes import Pose
from flockbrush.render.sprites import Sprites, Stamps
from flockbrush.render.style import DARK, palette
from flockbrush.runs.run import start
from flockbrush.runs.snapshots import moment_of
from tests.flockbrush.test_draw_animals import changed, herd, painter


def spread(frame, ground):
    """How far a bird that flies east reaches from north to south, pixels."""
    return int(np.ptp(changed(frame, ground)[:, 0]))


@pytest.mark.parametrize("length", [1.0, 2.0, 5.0])  # two stamps, one without a sheet
def test_wings_are_widest_in_the_middle_of_a_beat(length):
    p = painter()
    frames = [
        p.frame(herd((20, 15), length=length, radius=length / 5, wings=np.array([b]))) for b in (-1.0, 0.0, 1.0, np.nan)
    ]
    down, level, up, folded = (spread(frame, p.ground) for frame in frames)
    assert level > max(down, up) > folded
    assert level == pytest.approx(1.9 * max(length * p.camera.scale, 5), abs=4)
    assert not np.array_equal(frames[0], frames[2])


@pytest.mark.parametrize("leader", [False, True])
@pytest.mark.parametrize("length", [5.0, 12.0, 24.0])
def test_a_stamp_of_a_bird_looks_like_its_figure(leader, length):
    stamps = Stamps(palette(1), DARK)
    look = np.array([KINDS + leader])
    clip, one = np.array([0, 0, 90, 90]), np.ones(1)
    stamped, drawn = np.full((2, 90, 90, 3), 90, np.uint8)
    forward = np.array([[0.0, -1.0]])
    animals = Sprites(np.array([[40.5, 44.0]]), forward, one * length, one, look, one, one * 0.5)
    stamps.draw(stamped, clip, animals, 1.0)
    pose, colours = Pose(40.5, 44.0, 0.0, -1.0), stamps.colours[look[0]]
    figure(drawn, clip, pose, length, 1.0, int(look[0] % 4), False, colours, 0.5)
    assert (stamped != 90).any()
    assert np.abs(stamped.astype(int) - drawn).max() <= 3


def test_animals_on_the_ground_keep_their_pixels_beside_birds():
    p = painter(shadows=True)
    alone = p.frame(herd((10, 15)))
    both = p.frame(herd((10, 15), (30, 15), wings=np.array([np.nan, 0.5])))
    assert np.array_equal(alone[:, :140], both[:, :140])
    assert NO_WINGS < -1


def test_birds_of_a_level_beat_by_the_clock_and_fold_their_wings_where_they_rest():
    geese = start("geese", seed=1)
    geese.run(32 * 12)
    moment = moment_of(geese)
    one, again = herd_of(geese, moment).wings, herd_of(geese, moment).wings
    assert np.array_equal(one, again) and np.isfinite(one).all() and np.ptp(one) > 0.5
    resting = replace(moment, xyz=moment.xyz * (1, 1, 0), velocity=moment.velocity * 0)
    assert herd_of(geese, resting).wings is None or not np.isfinite(herd_of(geese, resting).wings).any()
    geese.close()


@pytest.mark.parametrize("ground", [-30.0, 0.0, 30.0])
def test_a_slow_bird_flies_where_it_is_above_the_ground_however_high_that_is(ground):
    goose = brush("own", "line_formation", 14.0, body={"length": 0.8, "radius": 0.16, "contact": "disc"})
    simulation = meadow(goose, height_map=Raster(1.0, np.full((40, 40), ground)))
    put(simulation, [(10, 10), (20, 20), (30, 30)], speed=0.0, species="goose")
    simulation.agents[Position.xyz][:, 2] = ground + np.array([0.0, 0.1, 5.0])
    wings = herd_of(simulation, moment_of(simulation)).wings
    assert np.isfinite(wings).tolist() == [False, False, True]


def test_sizes_of_vectors_have_the_bits_of_norms():
    vectors = np.random.default_rng(3).normal(scale=(1.0, 1e-9, 1e9), size=(1000, 3))
    assert np.array_equal(sizes(vectors), np.linalg.norm(vectors, axis=1))

"""The films that learning is tried on show what they say they show."""

import numpy as np
import pytest
from flockbrush.systems.measures import compute_milling, compute_nnd, compute_polarization
from small_herd import gaps

from benchmarks import foreign_herds, herd_film

cv2 = pytest.importorskip("cv2")


def order(name, **more):
    """Polarization and milling of a herd in the middle of a film of 2 s."""
    truth = foreign_herds.herd(name, 60, 2.0, seed=1, **more)
    return compute_polarization(truth.forward[25]), compute_milling(truth.xy[25], truth.forward[25])


def test_a_band_marches_a_mill_turns_and_a_swarm_has_no_common_direction():
    assert order("band")[0] > 0.9
    polarization, milling = order("mill")
    assert polarization < 0.2 and milling > 0.8
    assert max(order("swarm")) < 0.35
    assert order("torus")[1] > 0.5
    assert order("topological")[0] > 0.8


def test_a_mill_that_drifts_is_somewhere_else_afterwards_and_still_a_mill():
    truth = foreign_herds.herd("drifting mill", 60, 6.0)
    assert np.allclose(truth.xy[-1].mean(0) - truth.xy[0].mean(0), [3.0, 1.2], atol=0.9)
    assert compute_milling(truth.xy[-1], truth.forward[-1]) > 0.7


def test_some_grazing_animals_stand_and_some_walk_all_well_apart():
    truth = foreign_herds.herd("graze", 50, 4.0)
    assert (truth.speed < 0.2).mean() > 0.1 and (truth.speed > 0.4).mean() > 0.1
    assert np.median(compute_nnd(truth.xy[0])) > 1.2


@pytest.mark.parametrize("name", ["band", "mill", "swarm", "school"])
def test_animals_hardly_lie_on_each_other(name):
    truth = foreign_herds.herd(name, 60, 1.0)
    half, radius = np.full(60, foreign_herds.HALF), np.full(60, foreign_herds.RADIUS)
    deep = gaps(truth.xy[10], truth.forward[10], half, radius)
    assert np.quantile(np.minimum(deep, 0), 0.002) > -0.3
    assert (deep < -0.15).sum() < 12


def test_a_herd_of_ours_is_what_the_simulation_says():
    truth = foreign_herds.herd("own:march", 30, 1.0, fps=16)
    moved = np.diff(truth.xy, axis=0)
    assert truth.xy.shape == (16, 30, 2)
    assert np.hypot(*moved.mean((0, 1))) * 16 == pytest.approx(4.0, rel=0.2)  # march: 4 BL/s


def test_a_herd_goes_another_way_from_a_frame_on():
    one, other = foreign_herds.herd("swarm", 10, 1.0), foreign_herds.herd("swarm", 10, 1.0, other=(10, 3))
    assert np.array_equal(one.xy[:11], other.xy[:11]) and not np.allclose(one.xy[12:], other.xy[12:])


def test_the_same_seed_films_the_same():
    truth = foreign_herds.herd("swarm", 10, 0.2)
    again = foreign_herds.herd("swarm", 10, 0.2)
    assert np.array_equal(truth.xy, again.xy)
    a, b = (herd_film.shoot(t, size=(160, 120)).frames for t in (truth, again))
    assert np.array_equal(np.array(a), np.array(b))


def test_animals_are_drawn_where_the_truth_says_they_are():
    truth = foreign_herds.herd("swarm", 25, 0.4, pull=0.0, room=4.0)
    look = herd_film.Appearance(head=None, noise=0.0, texture=0.0, varied=0.0, blur=0.0, shadow=None)
    film = herd_film.shoot(truth, size=(480, 360), body_px=14, look=look)
    for frame in (0, 9):
        bright = (film.frames[frame][..., 0] > 140).astype(np.uint8)
        _, _, stats, middles = cv2.connectedComponentsWithStats(bright)
        alone = compute_nnd(truth.xy[frame]) > 1.5
        inside = film.inside(frame, 20)
        for at in film.pixels(frame)[alone & inside]:
            nearest = np.hypot(*(middles[1:] + 0.5 - at).T)
            assert nearest.min() < 0.5
        areas = stats[1:, cv2.CC_STAT_AREA]
        scale = np.hypot(*film.to_pixels[frame][:, 0])
        capsule = (np.pi * foreign_herds.RADIUS**2 + 4 * foreign_herds.HALF * foreign_herds.RADIUS) * scale**2
        assert np.median(areas) == pytest.approx(capsule, rel=0.1)


def test_the_ground_moves_with_the_camera_and_the_film_knows_how():
    truth = foreign_herds.herd("swarm", 5, 1.0)
    look = herd_film.Appearance(noise=0.0)
    film = herd_film.shoot(
        truth, size=(320, 240), camera=herd_film.CameraDrift((2.0, 1.0), 0.2, 0.1), look=look, hide=range(25)
    )
    back = cv2.warpAffine(film.frames[24], film.between(24, 0), (320, 240))
    still = np.abs(film.frames[0].astype(float) - film.frames[24]).mean()
    warped = cv2.warpAffine(np.full((240, 320), 255, np.uint8), film.between(24, 0), (320, 240)) == 255
    assert np.abs(film.frames[0].astype(float) - back)[warped].mean() < 0.45 * still


def test_a_film_seen_from_a_reference_frame_is_the_truth_turned_and_scaled():
    truth = foreign_herds.herd("mill", 20, 0.4)
    film = herd_film.shoot(truth, size=(320, 240), body_px=12)
    seen = film.seen_from(3, corner=(0.0, 0.0))
    length = np.hypot(*film.to_pixels[3][:, 0])
    pixels = film.pixels(3)
    assert np.allclose(seen.xy[3] * length, np.column_stack([pixels[:, 0], 240 - pixels[:, 1]]))
    assert np.allclose(np.hypot(*seen.forward[0].T), 1)
    assert np.allclose(np.abs(seen.turn), np.abs(truth.turn))  # turned, not mirrored
    assert np.allclose(seen.turn, truth.turn)


def test_a_film_is_a_file_that_can_be_read(tmp_path):
    truth = foreign_herds.herd("band", 12, 0.4)
    film = herd_film.shoot(truth, tmp_path / "band.mp4", size=(160, 120), look="dun", keep=True)
    reader = cv2.VideoCapture(str(film.path))
    assert reader.get(cv2.CAP_PROP_FPS) == pytest.approx(25)
    frames = []
    while (read := reader.read())[0]:
        frames.append(read[1])
    assert len(frames) == 10 and frames[0].shape == (120, 160, 3)
    assert np.abs(frames[5].astype(float) - film.frames[5]).mean() < 6


def test_evidence_of_truth_counts_everybody_and_knows_their_ways():
    truth = foreign_herds.herd("mill", 40, 1.0)
    evidence = herd_film.evidence_of_truth(truth, grid=20)
    fields = evidence.fields
    assert np.allclose(fields.density.sum((1, 2)) * fields.cell**2, 40)
    assert (fields.count == 40).all()
    assert len(evidence.sightings) == 25 and len(evidence.sightings.xy) == 25 * 40
    row, column, inside = fields.cells_of(truth.xy[3])
    assert inside.all()
    alone = fields.density[3, row, column] * fields.cell**2 < 1.5
    assert np.allclose(fields.velocity[3, row, column][alone], (truth.forward * truth.speed[..., None])[3][alone])
    rows = evidence.sightings.of(3)
    assert np.allclose(evidence.sightings.xy[rows], truth.xy[3])


def test_chance_directions_have_the_angular_variance_of_chance():
    rng = np.random.default_rng(0)
    angle = rng.uniform(-np.pi, np.pi, (2, 4000))
    forward = np.stack([np.cos(angle), np.sin(angle)], -1)
    truth = foreign_herds.Truth("chance", 25.0, rng.uniform(0, 10, (2, 4000, 2)), forward, np.ones((2, 4000)))
    fields = herd_film.evidence_of_truth(truth, cell=12.0).fields
    assert fields.angular_variance[0, 0, 0] == pytest.approx(2700, rel=0.05)

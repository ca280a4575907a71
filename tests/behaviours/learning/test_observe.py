"""What is seen in films of herds is what was filmed: where the camera was, who is where, how fast and which way."""

from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from flockbrush.engine.problems import ProblemsError

from benchmarks import herd_film
from benchmarks.foreign_herds import herd
from benchmarks.herd_film import STILL, CameraDrift, shoot
from flockbrush.film.camera_maps import Steady, after, back, fitted, moved_by, smoothed
from flockbrush.film.clip_fields import Collector, grid_over, moments, painted, read_colours
from flockbrush.film.clip_reader import open_clip
from flockbrush.film.flow import gap_of
from flockbrush.film.landmarks import Landmark
from flockbrush.film.masks import colours_of
from flockbrush.film.observations import CannotObserve, Evidence
from flockbrush.film.observe import observe
from flockbrush.film.stabilise import GroundFollower, follow_landmarks, register
from flockbrush.learning.rollout import Gates
from flockbrush.learning.scores import spacings
from tests.clip_film import film

SIZE = (480, 360)


@pytest.fixture(scope="module")
def band(tmp_path_factory):
    """Forty animals march under a camera that drifts, turns, zooms and shakes."""
    truth = herd("band", count=40, seconds=0.8, fps=25, seed=1)
    camera = CameraDrift(drift=(1.5, 0.8), turn=0.15, zoom=0.06)
    return shoot(truth, tmp_path_factory.mktemp("band") / "band.mp4", SIZE, 16.0, camera, seed=2)


@pytest.fixture(scope="module")
def seen(band):
    return observe(band.path)


@pytest.fixture(scope="module")
def still(tmp_path_factory):
    """A swarm under a camera that stands."""
    truth = herd("swarm", count=40, seconds=0.8, fps=25, seed=3)
    return shoot(truth, tmp_path_factory.mktemp("still") / "still.mp4", SIZE, 16.0, STILL, seed=4)


def off(maps, film):
    """How far the maps put points of the ground from where they belong, px, the most of each frame."""
    corners = np.array([(0, 0), (SIZE[0], 0), (0, SIZE[1]), SIZE], float)
    return [np.abs(moved_by(m, corners) - moved_by(film.between(k), corners)).max() for k, m in enumerate(maps)]


def test_all_frames_of_a_film_have_the_speeds_of_the_film(seen):
    assert seen.part(slice(None)).speed == seen.speed


def test_bodies_of_a_film_are_as_wide_as_they_were_drawn(seen):
    """Forty animals, of which many touch."""
    assert seen.radius_bl == pytest.approx(herd_film.RADIUS, abs=0.02)


# the camera --------------------------------------------------------------------------


def test_the_ground_stays_where_it_is_while_the_camera_drifts_turns_and_zooms(band):
    steady = register(open_clip(band.path))
    assert steady.moved and max(off(steady.maps, band)) < 1.0


@pytest.mark.parametrize("tilt", [0.0005, 0.002])
def test_pictures_taken_aslant_at_first_do_not_spoil_those_taken_from_above(tilt):
    tile = herd_film.ground(herd_film.LOOKS["sheep"], 1, 1024).clip(0, 255).astype(np.uint8)
    middle = np.array([[1, 0, SIZE[0] / 2], [0, 1, SIZE[1] / 2], [0, 0, 1]])

    def ground_of(k):
        """(3, 3) from pixels of the k-th picture to those of the tile; from the fifth on the camera looks down."""
        slant = np.array([[1, 0, 0], [0, 1, 0], [0, tilt * max(0, 1 - k / 4), 1]])
        there = np.array([[1, 0, 280 + 2.0 * k], [0, 1, 330 + k], [0, 0, 1]])
        return middle @ there @ slant @ np.linalg.inv(middle)

    follower = GroundFollower(None, 1.0)
    for k in range(10):
        flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        assert follower.step(k, cv2.warpPerspective(tile, ground_of(k), SIZE, flags=flags, borderMode=cv2.BORDER_WRAP))
    corners = np.array([(0, 0), (SIZE[0], 0), (0, SIZE[1]), SIZE], float)
    for k in range(5, 10):
        found = after(back(follower.maps[4]), follower.maps[k])
        assert np.abs(moved_by(found, corners) - corners - (2 * (k - 4), k - 4)).max() < 0.5


def test_two_landmarks_do_as_well(band):
    marks = [Landmark(3, 30, 40, 60, 50), Landmark(12, 380, 260, 60, 50)]
    steady = follow_landmarks(open_clip(band.path), marks)
    assert max(off(steady.maps, band)) < 2.5 and np.median(off(steady.maps, band)) < 1.5


def test_a_landmark_that_leaves_the_picture_or_is_plain_is_told(band, tmp_path):
    truth = herd("band", count=6, seconds=1.0, fps=25, seed=1)
    away = shoot(truth, tmp_path / "away.mp4", SIZE, 16.0, CameraDrift(drift=(14.0, 0.0), turn=0, zoom=0), seed=2)
    with pytest.raises(CannotObserve, match=r"the rectangle of frame 0 was lost at frame \d+; draw it around"):
        follow_landmarks(open_clip(away.path), [Landmark(0, 20, 100, 60, 50)])
    with pytest.raises(CannotObserve, match="must be a rectangle .* inside the picture of 480 x 360"):
        follow_landmarks(open_clip(band.path), [Landmark(0, 470, 100, 60, 50)])
    with pytest.raises(CannotObserve, match="in a frame that is not used; used frames: 0 to 19"):
        follow_landmarks(open_clip(band.path), [Landmark(99, 20, 100, 60, 50)])


def test_a_landmark_has_enough_pixels_of_the_reduced_picture():
    picture = np.zeros((720, 1280, 3), np.uint8)
    large = SimpleNamespace(
        name="large.mp4", read=lambda: [(0, picture)], numbers=np.array([0]), scale=0.5, full=(2560, 1440)
    )
    with pytest.raises(CannotObserve, match="height of at least 16 pixels inside the picture of 2560 x 1440"):
        follow_landmarks(large, [Landmark(0, 100, 100, 15, 50)])
    with pytest.raises(CannotObserve, match="has no corners"):
        follow_landmarks(large, [Landmark(0, 100, 100, 16, 50)])


def test_a_camera_that_stands_is_left_alone(still):
    seen = observe(still.path)
    assert np.abs(seen.camera - np.eye(2, 3)).max() == 0


def test_smoothing_leaves_a_steady_drift_as_it_is():
    drift = np.array([[[1, 0, 3.0 * k], [0, 1, -2.0 * k]] for k in range(20)])
    np.testing.assert_allclose(smoothed(drift, np.array([50.0, 60.0])), drift, atol=1e-9)


def test_maps_are_undone_and_joined():
    m = fitted(np.array([(0, 0), (1, 0), (0, 1.0)]), np.array([(5, 5), (5, 7), (3, 5.0)]))
    np.testing.assert_allclose(m, [[0, -2, 5], [2, 0, 5]], atol=1e-12)
    np.testing.assert_allclose(after(back(m), m), np.eye(2, 3), atol=1e-12)


# the animals -------------------------------------------------------------------------


def test_density_is_that_of_the_animals_where_they_are(band, seen):
    fields, error = seen.fields, []
    truth = band.seen_from(0, seen.body_length_px)
    for t in range(len(fields)):
        row, column, inside = fields.cells_of(truth.xy[t])
        inside &= band.inside(t)
        true = np.zeros(fields.shape)
        np.add.at(true, (row[inside], column[inside]), 1 / fields.cell**2)
        blocks = [np.add.reduceat(np.add.reduceat(np.nan_to_num(d), np.arange(0, d.shape[0], 6), 0),
                                  np.arange(0, d.shape[1], 6), 1) for d in (true, fields.density[t])]  # fmt: skip
        error.append(np.abs(blocks[0] - blocks[1]).sum() / blocks[0].sum())
        assert abs(fields.count[t] - inside.sum()) < 0.15 * inside.sum()
    assert np.mean(error) < 0.25  # animals on the edges of blocks of 6 x 6 cells are counted on both sides


def test_the_length_of_a_body_is_measured_within_an_eighth(band, seen):
    true = np.hypot(*band.to_pixels[0][:, 0])
    assert seen.length_source == "blobs" and 0.87 < seen.body_length_px / true < 1.1
    assert 0.15 < seen.radius_bl < 0.3


def test_velocities_are_those_of_the_animals_and_not_of_the_camera(band, seen):
    truth = band.seen_from(0, seen.body_length_px)
    way = truth.forward.mean((0, 1))
    there = seen.fields.occupied
    v = np.average(seen.fields.velocity[there], axis=0, weights=seen.fields.density[there])
    assert v @ way / np.linalg.norm(v) / np.linalg.norm(way) > 0.995
    assert np.linalg.norm(v) == pytest.approx(
        np.linalg.norm((truth.forward * truth.speed[..., None]).mean((0, 1))), rel=0.15
    )
    assert seen.speed.mean == pytest.approx(truth.speed.mean(), rel=0.12)


def test_a_march_is_of_one_mind_and_a_swarm_is_not(seen, still):
    swarm = observe(still.path, grid=6)
    march = seen.fields.angular_variance[seen.fields.occupied]
    wild = swarm.fields.angular_variance[swarm.fields.density > 0.1]
    assert np.nanmedian(march) < 100 < 400 < np.nanmedian(wild)


def test_single_animals_are_sighted_where_they_are(band, seen):
    truth = band.seen_from(0, seen.body_length_px)
    far = []
    for t in range(2, len(seen.fields) - 2):
        at = seen.sightings.xy[seen.sightings.of(t)]
        far += np.linalg.norm(at[:, None] - truth.xy[t][None], axis=2).min(1).tolist()
    assert np.median(far) < 0.2


def test_the_same_is_seen_again(band, seen):
    again = observe(band.path)
    np.testing.assert_array_equal(again.fields.density, seen.fields.density)
    np.testing.assert_array_equal(again.fields.velocity, seen.fields.velocity)


def test_what_was_seen_survives_a_file(seen, tmp_path):
    seen.save(tmp_path / "seen.npz")
    back_again = Evidence.load(tmp_path / "seen.npz")
    np.testing.assert_array_equal(back_again.sightings.turn, seen.sightings.turn)
    assert back_again.speed == seen.speed and back_again.sha256 == seen.sha256


def test_a_colour_and_a_length_that_a_person_gives_are_taken(band, seen):
    given = observe(band.path, body_colour=(226, 222, 214), body_length_px=16.0)
    assert given.length_source == "given" and given.body_length_px == 16.0
    assert np.median(given.fields.count) == pytest.approx(np.median(seen.fields.count), rel=0.25)


@pytest.mark.parametrize("look", ["shadowed sheep", "cattle", "dun"])
def test_light_dark_and_dun_animals_are_found(tmp_path, look):
    truth = herd("swarm", count=30, seconds=0.6, fps=25, seed=5)
    film = shoot(truth, tmp_path / "film.mp4", SIZE, 18.0, STILL, look=look, seed=6)
    count = observe(film.path).fields.count
    assert np.median(count) == pytest.approx(film.inside(7).sum(), rel=0.25)


def test_a_photograph_tells_density_and_no_motion(band, tmp_path):
    truth = herd("swarm", count=30, seconds=0.2, fps=25, seed=5)
    film = shoot(truth, None, SIZE, 20.0, STILL, seed=6)
    cv2.imwrite(str(tmp_path / "photo.png"), film.frames[0])
    photo = observe(tmp_path / "photo.png")
    assert photo.still and photo.speed is None and not photo.fields.occupied.any()
    assert len(photo.sightings.xy) == film.inside(0).sum()  # touching ones, too
    assert spacings([photo.sightings.xy]) == pytest.approx(spacings([truth.xy[0]]), rel=0.1)


# what is painted ---------------------------------------------------------------------


def test_obstacles_and_regions_fall_on_the_cells_they_were_painted_over(still, tmp_path):
    wall, parts = np.zeros((*SIZE[::-1], 3), np.uint8), np.zeros((*SIZE[::-1], 3), np.uint8)
    wall[:, 400:] = 255
    parts[:100], parts[100:200] = (0, 0, 255), (0, 255, 0)  # blue, green, red: red above, green in the middle
    cv2.imwrite(str(tmp_path / "wall.png"), wall)
    cv2.imwrite(str(tmp_path / "parts.png"), parts)
    seen = observe(still.path, grid=12, obstacles=tmp_path / "wall.png", regions=tmp_path / "parts.png")
    fields = seen.fields
    assert fields.shape == (9, 12)
    assert fields.obstacle[:, 10:].all() and not fields.obstacle[:, :10].any()
    assert np.nan_to_num(fields.density[:, :, 10:]).max() == 0  # nobody is sought in walls
    assert fields.region[8, 0] == 2 and fields.region[5, 0] == 1 and fields.region[0, 0] == 0
    assert seen.region_colours.tolist() == [[0, 255, 0], [255, 0, 0]]


def test_a_mask_of_another_clip_is_refused(still, tmp_path):
    cv2.imwrite(str(tmp_path / "wall.png"), np.zeros((100, 400), np.uint8))
    with pytest.raises(ProblemsError, match=r"wall\.png: is 400 x 100 pixels, but the clip is 480 x 360"):
        observe(still.path, obstacles=tmp_path / "wall.png")
    (tmp_path / "wall.png").write_text("no picture")
    with pytest.raises(ProblemsError, match="is not a readable picture"):
        observe(still.path, obstacles=tmp_path / "wall.png")


# clips that tell nothing -------------------------------------------------------------


def test_a_clip_in_which_nothing_moves_is_refused_with_the_ground_it_showed(tmp_path):
    truth = herd("swarm", count=20, seconds=0.5, fps=25, seed=5)
    empty = shoot(truth, tmp_path / "empty.mp4", SIZE, 16.0, STILL, hide=range(13), seed=6)
    with pytest.raises(CannotObserve, match="nothing moves in frames 0 to") as told:
        observe(empty.path)
    assert "ground" in told.value.seen["pictures"]


def test_a_colour_that_nobody_has_and_one_that_everything_has_are_refused(still):
    with pytest.raises(CannotObserve, match="no animals were detected"):
        observe(still.path, body_colour=(255, 0, 255))
    with pytest.raises(CannotObserve, match=r"% of the picture looks like animals; give their colour"):
        observe(still.path, body_colour=(92, 112, 62))


# arithmetic --------------------------------------------------------------------------


def test_moments_of_two_bodies_that_part_at_a_right_angle():
    v = np.array([(1.0, 1.0), (1.0, -1.0), (2.0, 0.0)])
    mean, speed, spread, angle = moments(np.array([0, 0, 1]), v, 3, 0.0)
    assert mean[0].tolist() == [1.0, 0.0] and mean[1].tolist() == [2.0, 0.0] and np.isnan(mean[2]).all()
    assert speed[0] == pytest.approx(np.sqrt(2)) and spread[0] == pytest.approx(0.0, abs=1e-12)
    assert angle[0] == pytest.approx(0.0, abs=1e-9)  # unsigned: 45 degrees either side


def test_directions_by_chance_have_the_variance_of_a_uniform_angle():
    turn = np.random.default_rng(0).uniform(0, 2 * np.pi, 40_000)
    v = np.column_stack([np.cos(turn), np.sin(turn)])
    assert moments(np.zeros(len(v), int), v, 1, 0.0)[3][0] == pytest.approx(180**2 / 12, rel=0.02)


def test_a_still_cameras_grid_covers_the_picture_from_its_lower_left_corner():
    grid = grid_over((300, 150), np.eye(2, 3)[None], 10.0, 30)
    assert grid.shape == (15, 30) and grid.cell == 1.0 and grid.origin.tolist() == [0, 0]
    np.testing.assert_allclose(moved_by(grid.to_pixels, [(0.0, 0.0), (30.0, 15.0)]), [(0, 150), (300, 0)], atol=1e-9)
    mask = np.zeros((150, 300), np.uint8)
    mask[140:, :20] = 7
    assert painted(mask, grid, 1.0)[0, :3].tolist() == [7, 7, 0]


def test_regions_are_numbered_by_their_colours_and_black_is_none():
    mask = np.zeros((2, 2, 3), np.uint8)
    mask[0, 0], mask[0, 1] = (0, 0, 200), (200, 0, 0)  # BGR
    numbers, colours = read_colours(mask)
    assert numbers.tolist() == [[2, 1], [0, 0]] and colours.tolist() == [[0, 0, 200], [200, 0, 0]]


@pytest.mark.parametrize(("step", "gap"), [(0.0, 5), (0.5, 5), (2.4, 1), (1.2, 2), (30.0, 1)])
def test_slow_animals_are_watched_over_more_frames(step, gap):
    assert gap_of(np.full(9, step), 20.0, 25.0) == gap


def test_exposure_that_changes_does_not_change_who_is_an_animal(still, tmp_path):
    clip = open_clip(still.path)
    steady = Steady(np.tile(np.eye(2, 3), (len(clip), 1, 1)))
    colours = colours_of(clip, steady)
    k, picture = next(clip.read([9]))
    dim = cv2.convertScaleAbs(picture, alpha=0.65)
    one, other = colours.mask(k, picture), colours.mask(k, dim)
    assert (one != other).mean() < 0.01 and one.mean() > 0.02


@pytest.mark.parametrize(("top", "holds"), [(12, True), (2, False)])
def test_a_herd_near_the_edge_is_whole_unless_bodies_are_there(top, holds):
    """Bodies of 20 x 8 px, at the top one that is so many px from the edge, in a cell at the edge either way."""
    grid, mask = grid_over((400, 300), np.eye(2, 3)[None], 20.0, 10), np.zeros((300, 400), np.uint8)
    for y in (top, 100, 150, 200):
        mask[y : y + 8, 180:200] = 1
    collector = Collector(grid, (400, 300), 160.0)
    for frame in range(3):
        collector.add(frame, mask, np.eye(2, 3), 0.1, (np.array([(190.0, top + 4.0)]), np.array([(1.0, 0.0)])))
    fields = collector.fields(10.0)
    assert fields.holds_all is holds and fields.part(slice(1, 3)).holds_all is holds
    assert fields.density[0, -1].sum() > 0 and (Gates.of(fields) is None) is holds


@pytest.mark.parametrize("standing", [0, 3])
def test_a_film_too_short_for_places_to_be_left_tells_what_is_at_rest(tmp_path, standing):
    rough = np.random.default_rng(4).normal(size=(240, 320, 1)).astype(np.float32)
    ground = cv2.GaussianBlur(rough, (0, 0), 1.5)[..., None] * 60 + np.array((60, 110, 80))
    pictures = np.repeat(np.clip(ground, 0, 255).astype(np.uint8)[None], 9, axis=0)
    for t, picture in enumerate(pictures):
        for n in range(30):
            x, y = 30 + 50 * (n % 6) + 2 * t * (n % 5 >= standing), 25 + 44 * (n // 6)
            cv2.ellipse(picture, (x, y), (8, 4), 0, 0, 360, (235, 240, 240), cv2.FILLED)
    told = observe(film(tmp_path / "a.mp4", pictures, 30), body_colour=(240, 240, 235)).notes
    assert any("62% of what looks like animals never moves" in note for note in told) == bool(standing)

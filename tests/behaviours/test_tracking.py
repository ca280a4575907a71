"""Birds followed through a film of the sky, against the truth that the film was made from."""

import drawn_skies
import numpy as np
import pytest

from benchmarks.sky_film import compute_tracking, film
from flockbrush.film.tracking import Tracker, blobs_of
from flockbrush.lifting.lens import Camera

CAMERA = Camera(width=480, height=270, horizontal_fov_deg=60, fps=30, mean_speed=9, near=5, far=200)


def passing(frames=50):
    """Six birds to the right; the first overtakes the second behind its back, 20 m away, (F, N, 3) m."""
    t = np.arange(frames)[:, None] / 30
    start = np.array([[-7, 20, 0], [-6, 22, 0.1], [-4, 21, 3], [-2, 20, -2], [-8, 21, -4], [-3, 20, 5]], float)
    speed = np.array([6.0, 4.6, 5, 5, 5, 5])
    way = np.stack([speed * t, 0 * t + 0 * speed, 0.4 * np.sin(2 * t) + 0 * speed], axis=-1)
    return start + way


def followed(xyz, seeds=None, corrections=None):
    tracker = Tracker(seeds, corrections)
    for picture in film(xyz, CAMERA):
        tracker.step(picture)
    return tracker.tracks()


def seen(xyz):
    px = CAMERA.project(xyz)
    return px, ((px > 4) & (px < (CAMERA.width - 4, CAMERA.height - 4))).all(-1)


def test_every_bird_is_followed_and_nothing_else():
    xyz = passing()[:, 2:]
    told = compute_tracking(*seen(xyz), followed(xyz))
    assert told["recall"] > 0.98 and told["precision"] > 0.98
    assert (told["switches"], told["tracks"]) == (0, 4)


@pytest.mark.parametrize(("span", "thin"), [(12, True), (16, False), (19, True)])
def test_a_bird_with_drawn_wings_is_one_track(span, thin):
    places, pictures = drawn_skies.flapping_film(0, span, thin=thin)
    tracker = Tracker()
    for picture in pictures:
        tracker.step(picture)
    told = compute_tracking(places, np.ones(places.shape[:2], bool), tracker.tracks())
    assert (told["tracks"], told["switches"]) == (6, 0)
    assert told["recall"] > 0.99 and told["precision"] > 0.99


def test_a_bird_that_passes_behind_another_keeps_its_name():
    xyz = passing()
    px, visible = seen(xyz)
    gap = np.linalg.norm(px[:, 0] - px[:, 1], axis=1)
    assert gap.min() < 3 < gap[0] and gap[-1] > 8  # they do pass
    told = compute_tracking(px, visible, followed(xyz))
    assert told["switches"] == 0 and told["idf1"] > 0.97


def test_places_are_true_to_a_part_of_a_pixel():
    xyz = passing()[:, 2:]
    tracks, px = followed(xyz), CAMERA.project(xyz)
    gap = np.linalg.norm(tracks.px[:, :, None] - px[tracks.first :][:, None], axis=-1).min(2)
    assert np.nanmedian(gap) < 0.8


def test_a_bird_that_leaves_the_picture_ends_its_track():
    xyz = passing(60)[:, 3:5]
    xyz[:, 0, 0] += np.arange(60) * 0.45
    tracks = followed(xyz)
    first = tracks.seen[:, np.argmin(tracks.seen.sum(0))]
    assert 10 < first.sum() < 45 and not first[-5:].any()


def test_a_bird_behind_a_cloud_for_some_frames_is_the_same_bird():
    xyz = passing()[:, 2:5]
    tracker = Tracker()
    for f, picture in enumerate(film(xyz, CAMERA)):
        blobs = blobs_of(picture)
        if 20 <= f < 30:
            hidden = CAMERA.project(xyz[f, 0])
            blobs = [blob for blob in blobs if np.linalg.norm(blob.at - hidden) > 8]
        tracker.take(blobs)
    assert len(tracker.tracks().ids) == 3


def test_birds_named_by_hand_keep_their_names():
    xyz = passing()[:, 2:]
    px = CAMERA.project(xyz)
    tracks = followed(xyz, seeds={0: [(40 + n, *px[0, n]) for n in range(4)]})
    assert tracks.ids.tolist() == [40, 41, 42, 43]
    assert np.linalg.norm(tracks.px[:, 2] - px[:, 2], axis=1).max() < 3


def test_a_correction_moves_a_name_to_the_right_bird_from_there_on():
    xyz = passing()[:, 2:]
    px = CAMERA.project(xyz)
    seeds = {0: [(1 + n, *px[0, n]) for n in range(4)]}
    tracks = followed(xyz, seeds, {25: [(1, *px[25, 1]), (2, *px[25, 0])]})
    assert np.linalg.norm(tracks.px[:25, 0] - px[:25, 0], axis=1).max() < 4
    assert np.linalg.norm(tracks.px[26:, 0] - px[26:, 1], axis=1).max() < 4


def test_corrections_alone_keep_what_was_tracked_before_them():
    xyz = passing()[:, 2:]
    before = followed(xyz)
    one, other = before.ids[[1, 3]].tolist()
    at = before.px[25 - before.first]
    after = followed(xyz, None, {25: [(one, *at[3]), (other, *at[1])]})
    assert after.ids.tolist() == before.ids.tolist()
    assert np.array_equal(after.px[: 25 - before.first], before.px[: 25 - before.first], equal_nan=True)
    swapped = after.px[26 - after.first :][:, [0, 3, 2, 1]]
    assert np.nanmax(np.linalg.norm(swapped - before.px[26 - before.first :], axis=2)) < 2


def test_a_corrected_track_keeps_the_parts_that_it_is_joined_of():
    xyz = passing()[:, 2:5]
    px, pictures = CAMERA.project(xyz), [blobs_of(picture) for picture in film(xyz, CAMERA)]
    for f in range(10, 30):
        pictures[f] = [blob for blob in pictures[f] if np.linalg.norm(blob.at - px[f, 0]) > 8]

    def tracks(corrections):
        tracker = Tracker(None, corrections)
        for blobs in pictures:
            tracker.take(blobs)
        return tracker.tracks()

    before = tracks({})
    n = int(np.argmin(before.seen.sum(0)))
    assert len(before.ids) == 3 and not before.seen[29, n] and before.seen[45, n]
    after = tracks({45: [(before.ids[n], *before.px[45, n])]})
    assert np.array_equal(after.ids, before.ids) and np.array_equal(after.px[:45], before.px[:45], equal_nan=True)


def test_a_number_that_nobody_had_begins_where_a_correction_says_so():
    xyz = passing()[:, 2:4]
    tracker = Tracker(None, {20: [(1, *CAMERA.project(xyz)[20, 0]), (3, 30, 250)]})
    for picture in film(xyz, CAMERA):
        tracker.step(picture)
    assert tracker.begun == [(20, 3)]


def test_an_empty_sky_has_no_birds():
    tracker = Tracker()
    for _ in range(5):
        tracker.step(np.full((120, 160), 200, np.uint8))
    with pytest.raises(ValueError, match="no bird could be tracked"):
        tracker.tracks()


def meeting(rise, depth, frames=60):
    """Two birds side by side that cross, one from below and one from above, (F, 2, 3) m."""
    t = (np.arange(frames) / 30)[:, None] - 1
    return np.stack([4 * t + np.zeros(2), 0 * t + np.array(depth), t * [rise, -rise]], axis=-1)


@pytest.mark.parametrize(("rise", "depth"), [(0.8, (20, 24)), (2.0, (18, 26)), (1.2, (20, 20.5))])
def test_birds_that_merge_for_long_and_part_again_keep_their_names(rise, depth):
    xyz = meeting(rise, depth)
    told = compute_tracking(*seen(xyz), followed(xyz))
    assert (told["tracks"], told["switches"]) == (2, 0) and told["idf1"] > 0.98


def test_who_a_person_has_named_after_a_crossing_stays():
    xyz = meeting(1.2, (20, 24))
    x, y = CAMERA.project(xyz)[58].T
    swapped = {0: [(1, *CAMERA.project(xyz)[0, 0])], 58: [(1, x[1], y[1])]}  # by the person's word it is the other
    tracks = followed(xyz, swapped)
    at = tracks.px[58 - tracks.first, tracks.ids.tolist().index(1)]
    assert np.linalg.norm(at - (x[1], y[1])) < 2

"""Stones on the ground are no animals, and animals that rest are no stones."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from benchmarks import herd_film
from benchmarks.foreign_herds import Truth, herd
from benchmarks.herd_film import LOOKS, STILL, CameraDrift, shoot
from flockbrush.film.clip_reader import open_clip
from flockbrush.film.masks import _without_shadows
from flockbrush.film.observations import CannotObserve
from flockbrush.film.observe import observe
from flockbrush.film.plain_ground import ground_alone

HERD, RESTING = 24, 6


def stony(plain, contrast):
    """A ground with stones up to a body's size, that stand out from it so many times as much as animals do."""

    def ground(look, seed=0, side=1024):
        tile, rng = plain(look, seed, side), np.random.default_rng([seed, 8])
        colour = np.array(look.ground, float) + contrast * (np.array(look.body, float) - look.ground)
        for _ in range(150):
            place, length = rng.uniform(20, side - 20, 2), rng.uniform(4, 12)
            shape = np.zeros((side, side), np.uint8)
            cv2.ellipse(
                shape, (place, (length, length * rng.uniform(0.4, 0.9)), rng.uniform(0, 180)), 255, -1, cv2.LINE_AA
            )
            left, top, wide, tall = cv2.boundingRect(shape)
            near = np.s_[top : top + tall, left : left + wide]
            share = (shape[near] / 255.0)[..., None]
            tile[near] = tile[near] * (1 - share) + share * colour
        return tile

    return ground


@pytest.mark.parametrize("contrast", [0.33, 0.6])
def test_under_a_camera_that_turns_stones_are_no_animals_and_those_who_rest_are(contrast, tmp_path, monkeypatch):
    monkeypatch.setattr(herd_film, "ground", stony(herd_film.ground, contrast))
    band = herd("band", HERD, 1.2, 25, seed=3)
    rest = np.column_stack([np.linspace(-9, 9, RESTING), np.full(RESTING, -9.0)]) + band.xy[15].mean(0)
    xy = np.concatenate([band.xy, np.broadcast_to(rest, (30, RESTING, 2))], axis=1)
    forward = np.concatenate([band.forward, np.broadcast_to([0.6, 0.8], (30, RESTING, 2))], axis=1)
    truth = Truth("band", 25.0, xy, forward, np.zeros((30, HERD + RESTING)))
    film = shoot(truth, tmp_path / "stones.mp4", (480, 480), 16.0, CameraDrift(turn=0.25), LOOKS["sheep"], seed=5)
    seen = observe(film.path)
    found = np.diff(seen.sightings.first)
    assert abs(np.median(found) - (HERD + RESTING)) <= 1, found
    assert np.median(seen.fields.count) == pytest.approx(HERD + RESTING, rel=0.12)
    assert seen.fields.holds_all


@pytest.mark.parametrize(("texture", "told"), [(0.0, True), (8.0, False)])
def test_of_plain_ground_it_is_told_that_the_camera_is_unknown_and_landmarks_are_named(tmp_path, texture, told):
    look = replace(LOOKS["sheep"], texture=texture)
    film = shoot(herd("band", 30, 0.4, 25, seed=3), tmp_path / "plain.mp4", (400, 400), 16.0, STILL, look, seed=5)
    seen = observe(film.path)
    assert any("--landmark" in note for note in seen.notes) == told


def test_animals_over_plain_ground_are_no_ground(tmp_path):
    truth = herd("band", 30, 0.4, 25, seed=3)
    film = shoot(truth, tmp_path / "plain.mp4", (400, 400), 16.0, STILL, replace(LOOKS["sheep"], texture=0.0), seed=5)
    clip = open_clip(film.path)
    hidden = np.ones((400, 400), bool)  # of what is left nothing can be followed
    with pytest.raises(CannotObserve, match="--landmark"):
        ground_alone(clip, lambda k, picture: hidden, np.tile(np.eye(2, 3), (10, 1, 1)))


def test_what_is_left_out_is_told_as_shadows_only_where_it_looks_like_them():
    """Dark animals over light ones, or the ground where an animal stood, are none."""
    moving, lighter = np.ones((1, 10, 10), bool), np.zeros((1, 10, 10), bool)
    lighter[:, :5] = True
    for shade in (~lighter, np.zeros_like(lighter)):
        bodies, notes = _without_shadows(moving, shade, lighter)
        assert np.array_equal(bodies, lighter)
        assert notes == (["the shadows of the animals were left out"] if shade.any() else [])


def test_where_a_herd_rests_long_its_bodies_stay_whole(tmp_path):
    """The ground under those who rest for a part of the film is a mixture, as pale as a stone."""
    truth = herd("graze", 40, 4.0, seed=23)
    film = shoot(truth, tmp_path / "rest.mp4", (512, 512), 22.0, CameraDrift(follow=1.0), LOOKS["sheep"], seed=5)
    seen = observe(film.path)
    was, now = film.seen_from(0, seen.body_length_px), seen.sightings
    wrong = []
    for k in range(0, len(now), 5):
        rows = now.of(k)
        near = np.linalg.norm(now.xy[rows][:, None] - was.xy[k][None], axis=-1).argmin(1)
        wrong.append((now.forward[rows] * was.forward[k][near]).sum(1) < 0.0)
    assert np.concatenate(wrong).mean() < 0.025

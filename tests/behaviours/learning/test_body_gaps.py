"""Room between bodies: who touches others, how wide bodies are then, and speeds without contacts."""

import numpy as np
import pytest
from flockbrush.behaviours.brush import BodySpec, SpeedSpec, VisionSpec
from scipy.ndimage import gaussian_filter1d

from benchmarks.foreign_herds import herd
from benchmarks.herd_film import evidence_of_truth
from flockbrush.film.body_gaps import distances_of_axes, radius_of_touching, with_room
from flockbrush.film.observations import Sightings
from flockbrush.film.speed_process import speed_process
from flockbrush.film.speeds import speed_evidence
from flockbrush.learning.rollout import HerdStart, params_of, rollout

FPS = 25.0
MILLING = params_of(np.full(12, 0.4), {"wander": 0.6, "leader_neighbours": -1})


def seen(xy, forward, speed=1.0):
    """Sights of (T, n, 2) places and headings."""
    frames, n = xy.shape[:2]
    speeds = np.broadcast_to(speed, (frames, n)).ravel().copy()
    forward = np.broadcast_to(forward, xy.shape).reshape(-1, 2).copy()
    who = np.tile(np.arange(n), frames)
    return Sightings(np.arange(frames + 1) * n, xy.reshape(-1, 2), forward, speeds, np.full(frames * n, np.nan), who)


def test_distances_are_those_of_points_along_the_axes():
    rng = np.random.default_rng(3)
    angle = rng.uniform(-np.pi, np.pi, (3, 40))
    xy, forward = rng.uniform(0, 6, (3, 40, 2)), np.stack([np.cos(angle), np.sin(angle)], -1)
    found = distances_of_axes(seen(xy, forward), 0.2).reshape(3, 40)
    points = xy[:, :, None] + np.linspace(-0.3, 0.3, 121)[:, None] * forward[:, :, None]
    for t in range(3):
        off = points[t][:, None, :, None] - points[t][None, :, None]
        far = np.sqrt((off**2).sum(-1).min((2, 3)))
        np.fill_diagonal(far, np.inf)
        assert found[t] == pytest.approx(far.min(1), abs=0.005)


def test_one_that_is_alone_is_infinitely_far_from_others():
    assert np.isinf(distances_of_axes(seen(np.zeros((2, 1, 2)), [1.0, 0.0]), 0.2)).all()


def test_of_nobody_nothing_is_asked():
    nobody = Sightings(np.zeros(4, int), *(np.zeros((0, 2)),) * 2, *(np.zeros(0),) * 2, np.zeros(0, int))
    assert len(distances_of_axes(nobody, 0.2)) == len(with_room(nobody, 0.2, FPS)) == 0
    assert radius_of_touching(nobody, 0.2) == 0.2


def test_animals_have_no_room_while_they_pass_each_other_nor_shortly_before_and_after():
    along = np.linspace(-4.0, 4.0, 101)  # 2 BL/s each, in opposite directions, .5 BL apart; a third one far away
    xy = np.stack([np.column_stack([along, np.zeros(101)]), np.column_stack([-along, np.full(101, 0.5)]),
                   np.column_stack([along, np.full(101, 9.0)])], 1)  # fmt: skip
    free = with_room(seen(xy, [1.0, 0.0]), 0.2, FPS).reshape(101, 3)
    beside = distances_of_axes(seen(xy, [1.0, 0.0]), 0.2).reshape(101, 3)[:, 0] < 0.55
    frames = np.flatnonzero(beside)
    expected = np.ones(101, bool)
    expected[frames[0] - 3 : frames[-1] + 4] = False
    assert 5 < len(frames) < 40
    assert (free[:, 0] == expected).all() and (free[:, 1] == expected).all() and free[:, 2].all()


def test_where_hardly_anybody_has_room_all_are_taken():
    xy = np.stack(np.meshgrid(np.arange(6) * 1.05, np.arange(6) * 0.45), -1).reshape(1, 36, 2)
    assert with_room(seen(xy, [1.0, 0.0]), 0.2, FPS).all()


@pytest.mark.parametrize("width", [0.4, 0.46])
def test_bodies_are_as_wide_as_they_come_near_each_other(width):
    band = evidence_of_truth(herd("band", 50, 3.0, seed=4)).sightings
    assert radius_of_touching(band, 0.5 * width) == pytest.approx(0.2, abs=0.012)


def test_bodies_that_keep_apart_are_as_wide_as_in_the_picture():
    xy = np.stack(np.meshgrid(np.arange(8) * 2.0, np.arange(8) * 2.0), -1).reshape(1, 64, 2)
    assert radius_of_touching(seen(xy, [1.0, 0.0]), 0.23) == 0.23


def test_speeds_of_animals_with_room_are_those_they_choose_themselves():
    """A crowd in which contacts brake animals: what they do by themselves is known."""
    rng, spec = np.random.default_rng(5), SpeedSpec(mean=3.0, deviation=0.3, reversion=1.0)
    xy, angle = rng.uniform(-5, 5, (60, 2)), rng.uniform(-np.pi, np.pi, 60)
    start = HerdStart(xy, np.column_stack([np.cos(angle), np.sin(angle)]))
    run = rollout(start, MILLING, spec, BodySpec(radius=0.2), VisionSpec(), seconds=8.0, fps=FPS, seed=2)
    sights = Sightings(run.first, run.xy, run.forward, np.einsum("ij,ij->i", run.velocity, run.forward),
                       np.full(len(run.xy), np.nan), run.ids)  # fmt: skip
    room = with_room(sights, 0.2, FPS)
    assert 0.3 < room.mean() < 0.8
    everybody = speed_process(sights, FPS, 0.02)
    sights.speed = np.where(room, sights.speed, np.nan)
    those = speed_process(sights, FPS, 0.02)
    assert abs(those.mean - 3.0) < 0.5 * abs(everybody.mean - 3.0)
    assert abs(those.spread - spec.own_spread) < 0.5 * abs(everybody.spread - spec.own_spread)


def test_speeds_of_animals_that_are_beside_others_do_not_count():
    """As where bodies that touch are taken for each other: their speeds are wrong and soon forgotten."""
    clip = evidence_of_truth(herd("school", 60, 6.0, seed=11))
    right = speed_evidence(clip.fields, clip.sightings, smoothed=0.08)
    beside = ~with_room(clip.sightings, clip.radius_bl, FPS)
    wrong = gaussian_filter1d(np.random.default_rng(1).normal(size=(150, 60)), 2.0, axis=0).ravel()
    clip.sightings.speed = clip.sightings.speed + beside * wrong
    plain = speed_evidence(clip.fields, clip.sightings, smoothed=0.08)
    found = speed_evidence(clip.fields, clip.sightings, smoothed=0.08, radius=clip.radius_bl)
    assert plain.deviation > 1.3 * right.deviation
    assert found.deviation == pytest.approx(right.deviation, rel=0.15)

"""A herd is like itself, and a mill is not like a march; fields and animals tell the same."""

import dataclasses

import numpy as np
import pytest

from benchmarks.foreign_herds import Truth
from benchmarks.herd_film import evidence_of_truth
from flockbrush.film.pair_density import pairs_of_bodies
from flockbrush.learning.herd_views import fields_of, told_apart, view_of, view_of_run
from flockbrush.learning.rollout import Run
from flockbrush.learning.scores import (
    ClipTarget,
    beyond_chance,
    density_errors,
    distance,
    map_error,
    measures_of,
    neighbour_map,
    total,
    velocity_errors,
)

FPS = 10.0


def lattice(n=49):
    side = int(n**0.5)
    return np.argwhere(np.ones((side, side))) * 1.5 - 0.75 * (side - 1)


def march(frames=20):
    """Everybody to the right, at two body lengths a second."""
    t = np.arange(frames)[:, None, None] / FPS
    xy = lattice()[None] + t * np.array([2.0, 0.0])
    return xy, np.broadcast_to([1.0, 0.0], xy.shape).copy()


def mill(frames=20):
    """Everybody round the middle, at a quarter of a radian a second."""
    at = lattice()[np.hypot(*lattice().T) > 1]
    angle = np.arange(frames) / FPS * 0.25
    c, s = np.cos(angle), np.sin(angle)
    xy = np.einsum("tij,nj->tni", np.array([[c, -s], [s, c]]).transpose(2, 0, 1), at)
    across = np.stack([-xy[..., 1], xy[..., 0]], -1)
    return xy, across / np.linalg.norm(across, axis=-1, keepdims=True)


def run_of(xy, forward):
    frames, n = xy.shape[:2]
    velocity = np.gradient(xy, 1 / FPS, axis=0).reshape(-1, 2)
    first, ids = np.arange(frames + 1) * n, np.tile(np.arange(n), frames)
    return Run(np.arange(frames) / FPS, first, ids, xy.reshape(-1, 2), forward.reshape(-1, 2), velocity)


def clip_of(xy, forward, **more):
    speed = np.linalg.norm(np.gradient(xy, 1 / FPS, axis=0), axis=-1)
    return evidence_of_truth(Truth("a clip", FPS, xy, forward, speed), **more)


@pytest.mark.parametrize("sight", [True, False], ids=["animals", "fields"])
def test_a_march_is_polarized_and_a_mill_mills_in_whatever_way_they_are_seen(sight):
    marching = measures_of(view_of(clip_of(*march(), cell=1.0, sight=sight)))
    milling = measures_of(view_of(clip_of(*mill(), cell=1.0, sight=sight)))
    assert np.allclose(marching["polarization"], 1.0) and (marching["milling"] < 0.1).all()
    assert (milling["milling"] > 0.95).all() and (milling["polarization"] < 0.1).all()
    assert np.allclose(marching["speed"], 2.0)


@pytest.mark.parametrize("sight", [True, False], ids=["animals", "fields"])
def test_a_herd_is_no_distance_from_itself_and_far_from_another(sight):
    clip = clip_of(*march(), cell=1.0, sight=sight)
    target = ClipTarget.of(clip)
    assert told_apart(clip) == sight
    assert total(distance(run_of(*march()), clip, target)) < 0.15
    assert total(distance(run_of(*mill()), clip, target)) > 5.0


def test_what_should_last_is_compared_over_a_longer_run():
    clip = clip_of(*march())
    lasting = distance(run_of(*march(60)), clip, ClipTarget.of(clip), lasting=True)
    assert "aspect" not in lasting and max(lasting.values()) < 0.3
    apart = march(60)[0] * np.linspace(1, 3, 60)[:, None, None]  # three times as wide in the end
    assert distance(run_of(apart, march(60)[1]), clip, ClipTarget.of(clip), lasting=True)["spread"] > 5.0


def gathering(share, frames=60):
    """A herd on the spot whose animals turn to the right one after the other; so many do by the end."""
    n, rng = 100, np.random.default_rng(2)
    angle, turned = rng.uniform(-np.pi, np.pi, n), np.zeros((frames, n), bool)
    for t in range(frames):
        turned[t, : round(share * n * t / (frames - 1))] = True
    angle = np.where(turned, 0.0, angle)
    xy = np.broadcast_to(lattice(n), (frames, n, 2)).copy()
    return xy, np.stack([np.cos(angle), np.sin(angle)], -1)


def test_of_a_herd_that_comes_into_order_the_order_it_comes_to_should_last():
    clip = clip_of(*gathering(0.8), cell=1.5)
    target = ClipTarget.of(clip)
    xy, forward = gathering(0.8)
    in_order, on_the_way = np.repeat(forward[-1:], 60, 0), np.repeat(forward[20:21], 60, 0)
    stays = distance(run_of(xy, in_order), clip, target, lasting=True)["polarization"]
    stops = distance(run_of(xy, on_the_way), clip, target, lasting=True)["polarization"]
    assert stays < 0.6 and stops > 1.5 * stays
    xy, forward = march()
    steady = ClipTarget.of(clip_of(xy, forward, cell=1.0))
    assert steady.end == pytest.approx({name: steady.mean[name] for name in steady.end}, rel=0.01, nan_ok=True)


def test_of_fields_alone_a_trend_may_go_on_but_not_back():
    xy, forward = march(60)
    wider = lambda by: run_of(xy * np.broadcast_to(by, 60)[:, None, None], forward)  # noqa: E731
    clip = clip_of(wider(np.linspace(1.0, 1.5, 60)).xy.reshape(xy.shape), forward, cell=1.0)
    fields = dataclasses.replace(clip, sightings=None)
    off = [
        [distance(wider(by), seen, ClipTarget.of(seen), lasting=True)["spread"] for by in (1.0, 2.0)]
        for seen in (clip, fields)
    ]
    assert off[1][0] == pytest.approx(off[0][0], rel=0.3) and off[1][1] < 0.6 * off[0][1]


def test_of_a_measure_that_is_told_in_a_few_moments_nothing_follows():
    """Disordered animals have no front but in the moment in which chance polarizes them."""
    xy, forward = gathering(0.0, frames=20)
    forward[3] = [1.0, 0.0]
    clip = clip_of(xy, forward, cell=1.5)
    assert np.isfinite(ClipTarget.of(clip).over_time["aspect"]).sum() == 1
    assert "aspect" not in distance(run_of(*gathering(0.0, frames=20)), clip, ClipTarget.of(clip))


def test_a_run_is_put_on_the_grid_of_the_clip_and_nobody_is_lost():
    clip = clip_of(*march(), cell=0.9)
    fields = fields_of(run_of(*march(60)), clip.fields)  # farther than the clip's picture
    assert np.allclose((fields.density * fields.cell**2).sum((1, 2)), 49)
    begin = fields_of(run_of(*march()), clip.fields)
    assert max(np.nanmax(e) for e in density_errors(begin, clip.fields).values()) < 1e-9
    assert np.allclose(velocity_errors(run_of(*march()), clip.fields), 0.0, atol=1e-9)


def test_who_is_beside_the_picture_of_a_part_of_a_herd_is_not_seen():
    xy, forward = march()
    part = clip_of(xy, forward, window=(-3.0, -3.0, 3.0, 3.0), cell=1.0)
    view = view_of_run(run_of(xy, forward), part)
    assert len(view.xy[view.of(0)]) == len(part.sightings.xy[part.sightings.of(0)]) < 49


def test_neighbours_are_found_where_they_stand():
    around = neighbour_map(view_of(clip_of(*march())), reach=3.0, rings=3, sectors=4)
    assert around[0].sum() == 0.0  # nobody nearer than one body length
    assert around[1, 0] > 0 and around[1, 3] > 0  # ahead and behind, at 1.5
    assert map_error(around, around) == 0.0
    assert map_error(around, np.roll(around, 1, axis=1)) > 0.3


@pytest.mark.parametrize("animals", [5, 20, 80])
def test_strangers_have_no_order_however_few_they_are(animals):
    headings = np.exp(2j * np.pi * np.random.default_rng(animals).random((4000, animals)))
    polarization = np.sqrt((np.abs(headings.mean(1)) ** 2).mean())
    assert beyond_chance(polarization, animals, 1.0) < 0.1 < 1.2 * polarization
    assert beyond_chance(1.0, animals, 1.0) == 1.0


def test_neighbours_are_counted_as_by_brute_force():
    view = view_of(clip_of(*mill()))
    found = neighbour_map(view, reach=3.0, rings=3, sectors=4, every=len(view))
    xy, heading = view.xy[view.of(0)], view.heading[view.of(0)]
    number = np.zeros((3, 4))
    for me, ahead in zip(xy, heading, strict=True):
        for other in xy:
            far = np.hypot(*(other - me))
            if 0 < far <= 3:
                bearing = np.arccos(np.clip((other - me) @ ahead / far, -1, 1))
                number[min(int(far), 2), min(int(bearing / np.pi * 4), 3)] += 1
    area = np.pi * np.array([1.0, 3.0, 5.0]) / 4
    assert np.abs(found - number / len(xy) / area[:, None]).max() < 1e-12


def test_cells_are_neighbours_by_how_many_animals_they_hold():
    one = view_of(clip_of(*march(), cell=1.5), single=False)
    two = dataclasses.replace(one, weight=2 * one.weight)
    assert np.allclose(neighbour_map(two), 2 * neighbour_map(one)) and neighbour_map(one).sum() > 0


def test_a_clip_without_animals_told_apart_is_compared_by_its_fields():
    clip = dataclasses.replace(clip_of(*march(), cell=1.0), sightings=None)
    target, tight = ClipTarget.of(clip), march()
    assert not view_of(clip).single
    assert distance(run_of(*march()), clip, target)["neighbours"] < 0.1
    squeezed = run_of(0.7 * tight[0] + 0.3 * tight[0].mean(1, keepdims=True), tight[1])
    assert distance(squeezed, clip, target)["neighbours"] > 2.0


def test_the_mask_tells_spacing_that_cells_do_not():
    xy, forward = march()
    clip = dataclasses.replace(clip_of(xy, forward, cell=6.0), sightings=None)
    around = np.array([pairs_of_bodies(*frame, 0.2) for frame in zip(xy, forward, strict=True)])
    clip.fields.pairs = around
    target = ClipTarget.of(clip)
    two_by_two = xy + 0.5 * np.sign(np.arange(49) % 2 - 0.5)[None, :, None] * np.array([0.0, 1.0])
    same, paired = (distance(run_of(places, forward), clip, target) for places in (xy, two_by_two))
    assert same["pairs"] < 1e-9 and paired["pairs"] > 4.0
    assert paired["density"] < 2.0  # of cells of six body lengths
    partly = dataclasses.replace(clip, fields=dataclasses.replace(clip.fields, pairs=None))
    assert "pairs" not in distance(run_of(xy, forward), partly, ClipTarget.of(partly))


def test_of_a_photograph_the_directions_of_bodies_are_compared():
    xy, forward = march()
    film = clip_of(xy, forward, cell=3.0, sight=False)
    unknown, varied = np.full_like(film.fields.velocity, np.nan), np.where(film.fields.density > 0, 2700.0, np.nan)
    nobody_moves = {"velocity": unknown, "speed": unknown[..., 0], "angular_variance": varied}
    photo = dataclasses.replace(film, fields=dataclasses.replace(film.fields, **nobody_moves))
    angle = np.random.default_rng(2).uniform(-np.pi, np.pi, 49)
    lying = np.broadcast_to(np.column_stack([np.cos(angle), np.sin(angle)]), xy.shape)
    still = np.broadcast_to(xy[0], xy.shape)
    target = ClipTarget.of(photo)
    assert np.isnan(ClipTarget.of(film).directions) and target.directions == 2700.0
    assert distance(run_of(still, forward), photo, target)["directions"] > 9.0  # all lie alike
    assert distance(run_of(still, lying), photo, target)["directions"] < 2.5

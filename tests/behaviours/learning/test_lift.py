"""A flock lifted from one camera: what must hold for any film, and the objective against brute force."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flockbrush.film.tracks import Tracks, read_tracks, smoothed
from flockbrush.lifting.banded import banded_product, solve_banded
from flockbrush.lifting.lens import Camera
from flockbrush.lifting.lift_solver import (
    EVENNESS,
    FLOCK,
    VOLUME,
    LiftError,
    LiftWish,
    _System,
    lift,
    lift_sight,
    prepared,
)
from flockbrush.lifting.lift_thesis import _frame, energy, lift_by_thesis
from flockbrush.lifting.motion_prior import BOUNDS, Manner, compute_manner

CAMERA = Camera(width=1280, height=720, horizontal_fov_deg=60, fps=30, mean_speed=9, near=5, far=200)


def starlings(birds=5, frames=60, seed=0):
    """Birds abreast and behind each other that fly past in one gentle curve, (F, N, 3) m."""
    chance = np.random.default_rng(seed)
    t = np.arange(frames)[:, None] / 30
    way = np.stack([9 * t - 9, 40 + 3 * np.sin(t), 1.5 * t], axis=-1)
    own = chance.normal(0, 2.5, (birds, 3)) + chance.normal(0, 0.25, (birds, 3)) * t[..., None]
    return way + own


def filmed(xyz, noise=0.0, seed=0):
    px = CAMERA.project(xyz)
    return Tracks(px + noise * np.random.default_rng(seed).normal(size=px.shape), np.arange(1, px.shape[1] + 1))


def written(tmp_path, text):
    path = tmp_path / "tracks.csv"
    path.write_text(text)
    return path


# the camera ----------------------------------------------------------------------


@given(st.floats(-50, 50), st.floats(1, 200), st.floats(-50, 50))
def test_a_bird_is_found_again_on_the_ray_of_its_pixel(x, y, z):
    bird = np.array([x, y, z])
    ray = CAMERA.rays(CAMERA.project(bird))
    assert np.allclose(ray * np.linalg.norm(bird), bird, atol=1e-9)


def test_the_edge_of_the_picture_is_half_the_field_of_view_away():
    ray = CAMERA.rays((1280, 360))
    assert np.degrees(np.arctan2(ray[0], ray[1])) == pytest.approx(30)
    assert CAMERA.rays((640, 0))[2] > 0  # up in the picture is up in the world


# tracks ----------------------------------------------------------------------------


def test_tracks_are_read_with_gaps_and_birds_that_come_and_go(tmp_path):
    rows = ["frame,id,x,y"] + [f"{f},7,{f},0" for f in (3, 4, 6, 7)] + [f"{f},2,0,{f}" for f in (5, 6, 7, 8)]
    tracks = read_tracks(written(tmp_path, "\n".join(rows)))
    assert tracks.first == 3 and tracks.ids.tolist() == [2, 7]
    assert tracks.seen[:, 1].tolist() == [True, True, False, True, True, False]
    assert tracks.alive[:, 1].tolist() == [True] * 5 + [False]


def test_a_bird_seen_once_is_left_out_and_named(tmp_path):
    rows = ["frame,id,x,y", "0,9,5,5"] + [f"{f},{n},{f},{n}" for f in range(5) for n in (1, 2)]
    tracks = read_tracks(written(tmp_path, "\n".join(rows)))
    assert tracks.ids.tolist() == [1, 2]
    assert "bird 9" in tracks.notes[0]


def test_smoothing_takes_out_the_noise_and_knows_how_much_there_was():
    truth = filmed(starlings(10, 120)).px
    noisy = filmed(starlings(10, 120), noise=1.0)
    clean = smoothed(noisy)
    assert clean.noise == pytest.approx(1.0, rel=0.1)
    assert np.abs(clean.px - truth).mean() < 0.4 * np.abs(noisy.px - truth).mean()


@pytest.mark.parametrize("every", [2, 3, 4, 7])
def test_birds_marked_in_every_nth_frame_are_smoothed_as_if_these_were_all(every):
    px = filmed(starlings(10, 91), noise=0.5).px
    gaps = np.full(px.shape, np.nan)
    gaps[::every] = px[::every]
    one, other = smoothed(Tracks(gaps, np.arange(10))), smoothed(Tracks(px[::every], np.arange(10)))
    assert one.noise == pytest.approx(other.noise, rel=0.15) and 0.35 < one.noise < 0.6
    np.testing.assert_allclose(one.px[::every], other.px, atol=0.5)


def test_smoothing_carries_a_bird_through_a_gap():
    tracks = filmed(starlings(3, 60))
    truth = tracks.px.copy()
    tracks.px[20:30, 1] = np.nan
    clean = smoothed(tracks)
    assert clean.longest_gap == 10
    assert np.abs(clean.px[20:30, 1] - truth[20:30, 1]).max() < 1.0


# depths -----------------------------------------------------------------------------


MANNER = Manner(alignment=2.0, cohesion=0.3, turning=0.4)


def cost(depth, rays, wish, way=None):
    """The quadratic part of the objective as one reads it, brute force; `way` (F - 2, 3) is the flock's."""
    b = depth[..., None] * rays
    v = np.diff(b, axis=0) * CAMERA.fps
    a = np.diff(v, axis=0) * CAMERA.fps
    apart = v - v.mean(1, keepdims=True)
    total = wish.smoothness * ((a - a.mean(1, keepdims=True)) ** 2).sum()
    total += wish.smoothness * MANNER.turning * rays.shape[1] * (a.mean(1) ** 2).sum()
    total += FLOCK * wish.flock * MANNER.alignment * (apart**2).sum()
    total += FLOCK * wish.flock * MANNER.cohesion * ((b - b.mean(1, keepdims=True)) ** 2).sum()
    if way is not None:
        along = (a.mean(1) * way).sum(-1)
        total += wish.smoothness * wish.evenness * EVENNESS * rays.shape[1] * (along**2).sum()
    return total


def full(bands):
    """The whole matrix of a banded system."""
    size, wide = bands.shape
    whole = np.zeros((size, size))
    for i in range(size):
        for k in range(min(wide, size - i)):
            whole[i, i + k] = whole[i + k, i] = bands[i, k]
    return whole


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10_000), st.floats(0.1, 10), st.floats(0.1, 10), st.floats(0.1, 3))
def test_the_banded_system_is_the_objective(seed, smoothness, flock, evenness):
    chance = np.random.default_rng(seed)
    rays = CAMERA.rays(chance.uniform((0, 0), (1280, 720), (6, 2, 2)))
    wish = LiftWish(smoothness, flock, evenness)
    system = _System(rays, np.ones((6, 2), bool))
    depth = chance.uniform(20, 60, (6, 2))
    xyz = depth[..., None] * rays
    way = (xyz[2:] - xyz[:-2]).mean(1)
    way /= np.linalg.norm(way, axis=-1, keepdims=True)
    steady = system.steady(CAMERA.fps, MANNER, wish)
    even = system.evenness(depth, CAMERA.fps, wish)
    d = depth.ravel()
    assert d @ full(steady) @ d == pytest.approx(cost(depth, rays, wish), rel=1e-9)
    assert d @ full(steady + even) @ d == pytest.approx(cost(depth, rays, wish, way), rel=1e-9)
    assert banded_product(steady, d) == pytest.approx(full(steady) @ d)


def test_no_other_depths_of_two_birds_are_likelier():
    rays = CAMERA.rays(filmed(starlings(2, 8)).px)
    system = _System(rays, np.ones((8, 2), bool))
    bands = system.steady(CAMERA.fps, MANNER, LiftWish())
    best, change = np.ones((8, 2)), 1.0
    while change > 1e-9:
        best, change = system.newton(bands, best)

    def surprise(depth):
        return 0.5 * cost(depth, rays, LiftWish()) - VOLUME * np.log(depth).sum()

    chance = np.random.default_rng(1)
    for size in (1e-3, 0.03, 0.3):
        for _ in range(200):
            other = best * np.exp(size * chance.normal(size=best.shape))
            assert surprise(other) >= surprise(best)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10_000), st.integers(1, 12), st.integers(1, 6))
def test_banded_systems_are_solved_as_full_ones(seed, size, wide):
    chance = np.random.default_rng(seed)
    bands = chance.normal(size=(size, wide))
    bands[:, 0] = np.abs(bands).sum() + 1.0
    side = chance.normal(size=size)
    assert solve_banded(bands.copy(), side) == pytest.approx(np.linalg.solve(full(bands), side))


def test_a_system_that_is_not_positive_has_no_solution():
    assert np.isnan(solve_banded(np.array([[1.0, 2.0], [1.0, 0.0]]), np.ones(2))).all()


# how birds move about the middle of their flock ------------------------------------------


def wandering(alignment, cohesion, birds=20, frames=400, fps=32, seed=0):
    """Birds about a middle 40 m away whose ways have these weights, (F, N, 3) m."""
    chance, dt, fine = np.random.default_rng(seed), 1 / fps, 4
    x, v, path = np.zeros((birds, 3)), np.zeros((birds, 3)), []
    damping = np.sqrt(alignment + 2 * np.sqrt(cohesion))  # of the wandering whose spectrum has these weights
    for step in range(fine * (frames + 200)):
        v += dt / fine * (-damping * v - np.sqrt(cohesion) * x) + np.sqrt(dt / fine) * chance.normal(0, 1, v.shape)
        x = x + dt / fine * v
        if step % fine == 0 and step >= fine * 200:
            path.append(x.copy())
    return np.array(path) + (0, 40, 0)


def manner_of(alignment, cohesion):
    rays = CAMERA.rays(CAMERA.project(wandering(alignment, cohesion)))
    return compute_manner(rays, np.ones(rays.shape[:2], bool), 32)


def test_how_firmly_a_flock_holds_together_is_read_off_its_picture():
    for cohesion in (0.5, 5.0):
        assert manner_of(4.0, cohesion).cohesion == pytest.approx(cohesion, rel=0.5)


def test_birds_that_give_up_their_own_velocity_sooner_are_seen_to_align_more():
    found = [manner_of(alignment, 0.5).alignment for alignment in (1.0, 4.0, 16.0)]
    assert found[0] < 0.5 * found[1] < 0.25 * found[2]  # all too low by two thirds: accelerations here are no path's


def test_a_flock_twice_as_far_away_has_the_same_manner():
    near = wandering(4.0, 0.5, 5, 120)
    there = np.ones((120, 5), bool)
    one = compute_manner(CAMERA.rays(CAMERA.project(near + (0, 1000, 0))), there, 32)
    two = compute_manner(CAMERA.rays(CAMERA.project(near + (0, 3000, 0))), there, 32)
    assert (one.alignment, one.cohesion) == pytest.approx((two.alignment, two.cohesion), rel=0.03)


def test_a_flock_frozen_in_its_places_has_a_manner_within_bounds():
    rays = CAMERA.rays(CAMERA.project(starlings(4, 30)[:1] + np.linspace(0, 5, 30)[:, None, None] * [1.0, 0, 0]))
    found = compute_manner(rays, np.ones((30, 4), bool), 30)
    for value, (low, high) in zip((found.alignment, found.cohesion), BOUNDS, strict=True):
        assert low <= value <= high


def test_a_flock_that_turns_as_one_is_seen_to(frames=200, fps=25):
    """Ten birds in step on a circle of 40 m, seen from below and aside, against ten that fly straight on."""
    angle = np.arange(frames)[:, None] / fps * 0.4
    own = wandering(1.0, 0.3, 10, frames, fps, 3) * 0.3
    circle = own + np.stack([40 * np.cos(angle), 120 + 40 * np.sin(angle), 60 + 0 * angle], axis=-1)
    straight = own + np.stack([15 * angle, 120 + 15 * angle, 60 + 0 * angle], axis=-1)
    there = np.ones((frames, 10), bool)
    turning, on = (compute_manner(CAMERA.rays(CAMERA.project(xyz)), there, fps).turning for xyz in (circle, straight))
    assert turning < 0.05 and on > 0.5


# flights ---------------------------------------------------------------------------------


def test_every_bird_stays_on_the_ray_of_its_smoothed_track():
    tracks = filmed(starlings(), noise=0.5)
    flight = lift(tracks, CAMERA)
    assert np.allclose(CAMERA.project(flight.xyz), smoothed(tracks).px, atol=1e-6)


def test_the_flock_flies_at_the_speed_that_was_given():
    flight = lift(filmed(starlings(), noise=0.5), CAMERA)
    assert np.linalg.norm(np.diff(flight.xyz, axis=0), axis=-1).mean() * 30 == pytest.approx(9.0)


def test_a_quick_look_is_near_the_flight():
    sight = prepared(filmed(starlings(8, 121), noise=0.5), CAMERA)
    flight, glance = lift_sight(sight, CAMERA), lift_sight(sight, CAMERA, every=5)
    assert np.isfinite(glance.depth).all()
    assert np.abs(glance.depth / flight.depth - 1).mean() < 0.02


def test_the_weights_count_by_their_ratio_alone():
    sight = prepared(filmed(starlings(), noise=0.5), CAMERA)
    assert lift_sight(sight, CAMERA, LiftWish(3.0, 3.0)).depth == pytest.approx(
        lift_sight(sight, CAMERA).depth, rel=1e-3
    )


def test_who_flies_farther_away_is_lifted_farther_away():
    truth = starlings(10, 120)
    flight = lift(filmed(truth, noise=0.5), CAMERA)
    true = np.linalg.norm(truth, axis=-1)
    scaled = flight.depth * (true.mean() / flight.depth.mean())
    constant = np.sqrt(((true - true.mean()) ** 2).mean())
    assert np.sqrt(((scaled - true) ** 2).mean()) < 0.75 * constant
    assert np.corrcoef(true[60], flight.depth[60])[0, 1] > 0.8


def test_birds_that_come_late_and_leave_early_are_lifted_while_they_are_there():
    tracks = filmed(starlings(6, 90), noise=0.3)
    tracks.px[:30, 2] = np.nan
    tracks.px[70:, 4] = np.nan
    flight = lift(tracks, CAMERA)
    assert np.isnan(flight.depth[:30, 2]).all() and np.isfinite(flight.depth[30:, 2]).all()
    assert np.isnan(flight.depth[70:, 4]).all() and np.isfinite(flight.depth[:70, 4]).all()


def test_two_birds_on_one_pixel_are_no_trouble():
    truth = starlings(4, 40)
    truth[:, 1] = truth[:, 0] * 1.02
    assert np.isfinite(lift(filmed(truth), CAMERA).depth).all()


def test_birds_all_on_one_pixel_fly_at_one_depth():
    truth = np.repeat(starlings(1, 40), 3, axis=1)
    depth = lift(filmed(truth), CAMERA).depth
    assert depth == pytest.approx(np.repeat(depth[:, :1], 3, axis=1), rel=1e-3)


def test_a_straight_flight_costs_nothing_and_is_found():
    t = np.arange(30)[:, None] / 30
    truth = np.stack([9 * t - 4, 40 + 2 * t, 0 * t + 1], -1) + np.array([(0, 0, 0), (1, 3, 1), (2, 1, -2)])
    depth = lift(filmed(truth), CAMERA).depth
    true = np.linalg.norm(truth, axis=-1)
    assert depth / depth.mean() == pytest.approx(true / true.mean(), rel=0.05)


def test_separation_keeps_birds_apart():
    truth = starlings(6, 30)
    truth[:, 1] = truth[:, 0] + 0.1
    crowded = lift(filmed(truth), CAMERA)
    roomy = lift(filmed(truth), CAMERA, LiftWish(separation=1.0, separation_distance=2.0))

    def gap(flight):
        return np.linalg.norm(flight.xyz[:, 0] - flight.xyz[:, 1], axis=-1).min()

    assert gap(roomy) > 1.0 > gap(crowded)


def test_one_bird_has_no_depth_and_is_put_at_one_distance():
    flight = lift(filmed(starlings(1)), CAMERA)
    assert np.ptp(flight.depth) == pytest.approx(0)
    assert np.linalg.norm(np.diff(flight.xyz, axis=0), axis=-1).mean() * 30 == pytest.approx(9.0)
    assert "the depth of a single bird is undetermined" in flight.notes[0]


def test_birds_that_never_meet_are_no_flock_and_put_at_one_distance():
    tracks = filmed(starlings(2, 40))
    tracks.px[:20, 0] = tracks.px[20:, 1] = np.nan
    flight = lift(tracks, CAMERA)
    assert np.nanstd(flight.depth) == pytest.approx(0)
    assert "no two birds are visible together" in flight.notes[0]


@pytest.mark.parametrize("toward", [-4.0, 0.0, 4.0])
def test_a_bird_that_is_left_alone_flies_on_as_it_did(toward):
    truth = starlings(5, 120)
    truth[..., 1] += toward * np.arange(120)[:, None] / 30
    tracks = filmed(truth, noise=0.3)
    tracks.px[50:, 1:] = np.nan
    true = np.linalg.norm(truth[:, 0], axis=-1)
    assert lift(tracks, CAMERA).depth[:, 0] == pytest.approx(true, rel=0.25)


@pytest.mark.parametrize("name", ["smoothness", "flock", "evenness", "separation", "separation_distance"])
@pytest.mark.parametrize("value", [-1.0, float("nan"), float("inf"), 1e300])
def test_a_wish_of_nonsense_is_refused_by_name(name, value):
    with pytest.raises(LiftError, match=f"{name.replace('_', ' ')} must be from 0 to"):
        LiftWish(**{name: value})


def test_birds_that_stand_still_set_no_scale():
    with pytest.raises(LiftError, match="nothing moves"):
        lift(Tracks(np.full((20, 3, 2), 300.0) + np.arange(3)[:, None], np.arange(3)), CAMERA)


def test_depths_out_of_bounds_are_told():
    close = CAMERA.model_copy(update={"far": 20.0})
    assert any("near" in note and "far" in note for note in lift(filmed(starlings()), close).notes)


# the thesis' method --------------------------------------------------------------------


def energy_by_hand(d, ray, last, earlier, weights):
    """Algorithm 3 for two birds, written out."""
    smooth, flock, w_sep, d_sep, _ = weights
    b = [d[0] * ray[0], d[1] * ray[1]]
    total = 0.0
    for me, other in ((0, 1), (1, 0)):
        total += smooth * np.sum((b[me] - 2 * last[me] + earlier[me]) ** 2)
        gap = np.linalg.norm(b[me] - b[other])
        separation = (b[me] - b[other]) / gap if gap <= d_sep else np.zeros(3)
        target = last[me] + w_sep * separation + (1 - w_sep) * (b[other] - b[me])
        total += flock * np.sum((b[me] - target) ** 2)
    return total


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10_000))
def test_the_thesis_energy_of_two_birds_is_as_written(seed):
    chance = np.random.default_rng(seed)
    ray = CAMERA.rays(chance.uniform((0, 0), (1280, 720), (2, 2)))
    last, earlier = chance.normal(0, 10, (2, 2, 3))
    d = chance.uniform(20, 60, 2)
    weights = np.array([1.3, 0.7, 0.4, 30.0, 0.3])
    expected = energy_by_hand(d, ray, last, earlier, weights)
    assert energy(d, ray, last, earlier, weights) == pytest.approx(expected, rel=1e-9)


def test_the_thesis_method_keeps_rays_and_bounds():
    pytest.importorskip("nlopt")
    tracks = filmed(starlings(3, 12), noise=0.3)
    bounds = CAMERA.model_copy(update={"near": 30.0, "far": 50.0})
    flight = lift_by_thesis(tracks, bounds)
    assert (flight.depth >= 30.0).all() and (flight.depth <= 50.0).all()
    assert np.allclose(CAMERA.project(flight.xyz), smoothed(tracks).px, atol=1e-6)


@pytest.mark.parametrize("seed", range(4))
def test_the_thesis_method_finds_the_least_energy_of_two_birds(seed):
    nlopt = pytest.importorskip("nlopt")
    chance = np.random.default_rng(seed)
    rays = CAMERA.rays(CAMERA.project(starlings(2, 4, seed)[:3]))
    depth = np.full((3, 2), np.nan)
    depth[0] = chance.uniform(35, 45, 2)
    depth[1] = depth[0] + chance.normal(0, 0.2, 2)
    weights = np.array([1.0, chance.uniform(0.05, 1), chance.uniform(0, 1), chance.uniform(1, 8), 0.3])
    bounds = CAMERA.model_copy(update={"near": 30.0, "far": 50.0})
    found = _frame(nlopt, 2, np.array([0, 1]), rays, depth, bounds, weights)
    last, earlier = depth[1][:, None] * rays[1], depth[0][:, None] * rays[0]

    def cost(d):
        return energy_by_hand(d, rays[2], last, earlier, weights)

    grid = np.linspace(30, 50, 101)
    least = min(cost((one, other)) for one in grid for other in grid)
    assert cost(found) <= least * 1.02 + 1e-3


def test_the_first_frames_of_the_thesis_method_are_mid_range_and_the_initial_speed():
    pytest.importorskip("nlopt")
    tracks = filmed(starlings(3, 20))
    flight = lift_by_thesis(tracks, CAMERA.model_copy(update={"near": 30.0, "far": 50.0}), LiftWish(flock=1e-6))
    assert flight.depth[0] == pytest.approx(40.0)
    step = np.linalg.norm(flight.xyz[1] - flight.xyz[0], axis=-1)
    seen = 40.0 * np.linalg.norm(np.diff(CAMERA.rays(smoothed(tracks).px[:2]), axis=0)[0], axis=-1)
    assert step == pytest.approx(np.maximum(9.0 / 30, seen), rel=0.05)


def test_the_order_of_birds_that_show_their_depths_is_sure_and_that_of_birds_that_do_not_is_a_toss():
    """Birds that fly past at one pace differ in the picture by their distance; those that fly straight away do not."""
    chance, t = np.random.default_rng(3), np.arange(60)[:, None, None] / 30
    places = chance.normal(0, 2.5, (6, 3))
    past, away = places + [-9, 40, 0] + t * [9.0, 0.0, 1.5], 0.2 * places + [0, 150, 0] + t * [0.0, 9.0, 0.0]

    def right(xyz, flight):
        """Share of the pairs in the right order, in the middle of the film."""
        deep, found = np.linalg.norm(xyz, axis=-1)[30], flight.depth[30]
        i, j = np.triu_indices(len(deep), 1)
        return (np.sign(deep[i] - deep[j]) == np.sign(found[i] - found[j])).mean()

    sure, toss = lift(filmed(past, noise=0.5), CAMERA), lift(filmed(away, noise=1.0), CAMERA)
    assert sure.order > 0.65 and right(past, sure) > 0.8 and not sure.notes
    assert toss.order < 0.6 and right(away, toss) < 0.6
    assert any(note.startswith("which of two birds is nearer is uncertain") for note in toss.notes)
    alone = lift(filmed(past[:, :1]), CAMERA)
    assert np.isnan(alone.order)

"""Where animals are missing from tracks, turns and spacing of their neighbours count less, and densities count them."""

from dataclasses import replace

import numpy as np
import pytest
from flockbrush.behaviours.brush import BodySpec, SpeedSpec, VisionSpec
from flockbrush.behaviours.models.herd import Params
from scipy.spatial import cKDTree

from benchmarks.foreign_herds import herd
from benchmarks.herd_film import evidence_of_truth
from flockbrush.film.missing_animals import NEAREST, missing_places, neighbours_seen, share_lost
from flockbrush.film.observations import SIGHT_COLUMNS, Sightings
from flockbrush.film.track_evidence import evidence_of_tracks
from flockbrush.film.track_files import Trajectories
from flockbrush.learning.battery import Battery, _products_by_distance
from flockbrush.learning.herd_views import view_of
from flockbrush.learning.initial_conditions import start_of
from flockbrush.learning.rollout import NAMES, HerdStart, rollout
from flockbrush.learning.scores import measures_of
from flockbrush.learning.turns import fit_turns, predicted, turns_of

FPS = 16
SWARM = 0.68, 0.31, 0.80, 0.11, 1.0, 1.0, 0.001, 0.31, 0.98  # avoidance, cohesion, alignment, as in the benchmarks
THETA = np.array([*SWARM, 0.15, 0.5, 0.5])


def swarm(seed, params, animals=60, seconds=8):
    """Places (T, n, 2), BL."""
    rng = np.random.default_rng(seed)
    xy = np.argwhere(np.ones((8, 8)))[:animals] / 0.5**0.5 + rng.uniform(-0.3, 0.3, (animals, 2))
    angle = rng.uniform(-np.pi, np.pi, animals)
    start = HerdStart(xy, np.column_stack([np.cos(angle), np.sin(angle)]), np.full(animals, 1.28))
    speed = SpeedSpec(mean=1.28, deviation=0.13)
    run = rollout(start, params, speed, BodySpec(), VisionSpec(), seconds=seconds, fps=FPS, seed=seed)
    return run.xy.reshape(-1, animals, 2)


def evidence_of(xy):
    names = tuple(map(str, range(xy.shape[1])))
    return evidence_of_tracks(Trajectories(xy, names, float(FPS), "bl", frames=np.arange(len(xy))), 1.0)


def with_gaps(xy, seed):
    """Half of the animals are lost for about half of the time."""
    rng, xy, frames = np.random.default_rng([seed, 7]), xy.copy(), len(xy)
    for animal in np.flatnonzero(rng.random(xy.shape[1]) < 0.5):
        begin, end = rng.integers(5, frames // 4), rng.integers(frames // 2, 3 * frames // 4)
        xy[begin:end, animal] = np.nan
    return xy


@pytest.mark.parametrize("seed", [0, 1])
def test_gaps_spoil_less_where_turns_weigh_by_the_neighbours_seen(seed):
    params = Params(**dict(zip(NAMES, THETA.tolist(), strict=True)), wander=0.3)
    whole = turns_of(evidence_of(swarm(seed + 50, params)), params=params)
    truth = predicted(whole, THETA, params)[0]

    def error(turns):
        """Of turns as the fitted numbers foretell them in another, whole herd; 1 is no forecast."""
        off = predicted(whole, fit_turns(turns, THETA, params).theta, params)[0] - truth
        return float(np.sqrt(np.mean(off**2) / np.mean(truth**2)))

    turns = turns_of(evidence_of(with_gaps(swarm(seed, params), seed)), params=params)
    assert turns.weight.min() < 0.05 and turns.weight.max() == 1.0
    weighed, plain = error(turns), error(turns._replace(weight=np.ones(len(turns.weight))))
    assert weighed < 0.7 * plain


def test_gaps_spoil_less_of_the_spacing_where_it_weighs_by_the_neighbours_seen():
    params, off = Params(**dict(zip(NAMES, THETA.tolist(), strict=True)), wander=0.3), []
    for seed in range(3):
        xy = swarm(seed, params)
        gapped = evidence_of(with_gaps(xy, seed))
        rows = len(gapped.sightings.xy)
        plain = replace(gapped, sightings=replace(gapped.sightings, neighbours_seen=np.ones(rows)))
        truth, weighed, unweighed = (_spacing(one) for one in (evidence_of(xy), gapped, plain))
        off.append(np.abs([weighed / truth - 1.0, unweighed / truth - 1.0]))
    weighed, unweighed = np.mean(off, axis=0)
    assert (weighed < 0.8 * unweighed).all()


def _spacing(evidence):
    """(nearest neighbour and density of the search, nearest neighbour of the verdict)."""
    measured = measures_of(view_of(evidence), 4)
    of_search = [float(np.nanmean(measured[name])) for name in ("nearest neighbour", "density")]
    return np.array([*of_search, float(Battery.of(evidence).values["nearest neighbour"][0])])


def test_densities_count_animals_that_are_missing():
    params = Params(**dict(zip(NAMES, THETA.tolist(), strict=True)))
    xy = swarm(5, params)
    whole, gapped = evidence_of(xy).fields, evidence_of(with_gaps(xy, 5)).fields
    assert (gapped.count == 60).all()
    assert (gapped.density.sum((1, 2)) * gapped.cell**2 == pytest.approx(60)) and gapped.holds_all == whole.holds_all


def test_animals_that_begin_where_others_are_missing_head_as_those_next_to_them():
    frames, n = 64, 36
    xy = np.argwhere(np.ones((6, 6)))[None] * 1.5 + np.arange(frames)[:, None, None] * [1.0 / FPS, 0.0]
    xy[10:50, : n // 2] = np.nan
    start = start_of(evidence_of(xy), 30)
    assert len(start) == n
    assert start.forward[:, 0].min() > 0.9


def test_whole_tracks_weigh_fully():
    params = Params(**dict(zip(NAMES, THETA.tolist(), strict=True)))
    xy = swarm(3, params, seconds=2)
    xy[8:11, ::2] = np.nan  # short gaps are filled
    assert (evidence_of(xy).sightings.neighbours_seen == 1.0).all()


def test_a_missing_animal_is_thought_on_its_straight_way_and_near_its_ends_only():
    xy = np.full((100, 2, 2), np.nan)
    xy[20:30, 0, 0] = np.arange(10)
    xy[50:60, 0, 0] = 29 + np.arange(10)
    xy[:, 0, 1] = np.where(np.isfinite(xy[:, 0, 0]), 0.0, np.nan)
    xy[:, 1] = (5.0, 5.0)
    found = missing_places(xy, np.isfinite(xy[..., 0]), fps=10.0)
    assert np.isnan(found[:, 1]).all()  # never missing
    assert np.isnan(found[20:30, 0]).all() and np.isnan(found[50:60, 0]).all()
    assert found[40, 0, 0] == pytest.approx(9 + 20 * 11 / 21) and found[40, 0, 1] == 0.0
    assert found[10, 0, 0] == pytest.approx(-10.0) and found[70, 0, 0] == pytest.approx(38 + 11)
    assert np.isnan(found[:0, 0]).all() and np.isnan(found[80:, 0]).all()


def test_the_share_of_neighbours_seen_is_that_of_the_nearest():
    here = np.array([[(k, 0.0) for k in range(20)]], float)
    gone = np.array([[(0.5, 0.1), (100.0, 100.0)]])
    share = neighbours_seen(here, gone)[0]
    assert share[0] == share[1] == 1.0 - 1.0 / NEAREST
    assert (share[10:] == 1.0).all()


def test_animals_that_come_late_among_the_others_make_the_others_count_less_before():
    params = Params(**dict(zip(NAMES, THETA.tolist(), strict=True)))
    xy = swarm(4, params, seconds=4)
    xy[:32, ::2] = np.nan
    seen = evidence_of(xy).sightings
    before, after = (seen.neighbours_seen[seen.of(t)].mean() for t in (20, 50))
    assert before < 0.8 and after == 1.0


def test_where_a_film_takes_two_animals_for_one_their_distances_are_less_sure():
    whole = evidence_of_truth(herd("topological", 60, 4.0, seed=2))
    seen, rng = whole.sightings, np.random.default_rng(0)
    near = np.concatenate([cKDTree(xy).query(xy, k=2)[0][:, 1] for xy in np.split(seen.xy, seen.first[1:-1])])
    kept = (near > 0.5) | (rng.random(len(near)) < 0.4) | (seen.frame % 10 == 0)
    first = np.concatenate([[0], np.cumsum(np.bincount(seen.frame[kept], minlength=len(seen)))])
    columns = {name: getattr(seen, name)[kept] for name in SIGHT_COLUMNS}
    film = replace(whole, sightings=Sightings(first, **columns))
    assert share_lost(whole) == 0.0 and share_lost(film) == pytest.approx(1.0 - kept.mean(), abs=0.02)
    tracks = replace(film, picture=np.zeros((4, 4, 3), np.uint8))
    assert tracks.from_tracks and share_lost(tracks) == 0.0  # their gaps are known
    battery, exact = Battery.of(film), Battery.of(whole)
    distance = "nearest neighbour"
    farther = battery.values[distance][0] - exact.values[distance][0]
    row = battery.compared([exact.values])[list(battery.values).index(distance)]
    assert row.limit > farther > 0.1 * exact.values[distance][0]
    assert row.met


def test_a_clip_that_nobody_is_in_for_a_while_has_measures():
    """Pedestrians come and go.  Where nobody is, distances were NaN, and a kernel wrote outside of its array."""
    params = Params(**dict(zip(NAMES, THETA.tolist(), strict=True)))
    xy = swarm(4, params)
    xy[60:80] = np.nan
    evidence = evidence_of(xy)
    assert (np.diff(evidence.sightings.first) == 0).any()
    battery = Battery.of(evidence)
    assert np.isfinite(battery.series.yard.rings).all() and {"polarization", "speeds"} <= set(battery.values)
    pairs = _products_by_distance(xy[0], xy[1] - xy[0], np.full(11, np.nan))
    assert not pairs.any()

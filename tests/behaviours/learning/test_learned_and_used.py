"""Every quantity that is read from a clip means the same where a herd uses it.

| quantity | learned by | used by | test |
|---|---|---|---|
| crowding, and its factor of the speed | `speeds.table_of` | `systems.pace.crowding` | mean factor 1 on the clip |
| mean, spread and reversion of speeds | `speed_process` | `_pace` (eq. 6) | learned back from a herd that has them |
| speed of an animal in a frame | `sightings` (along the body) | `scores.view_of_run` | shoves count in neither |
| contacts | left out of speeds by `body_gaps.with_room` | `systems.contact` | `test_body_gaps` |
| body length and width | `bodies`, `setting.body_of` | `Herd`, levels | a body is one body length long |
| body lengths of another size | `in_lengths_of`, `brush_of` | levels | the same herd, larger |
"""

import dataclasses

import numpy as np
import pytest
from flockbrush.behaviours.brush import BodySpec, SpeedSpec, VisionSpec

from benchmarks import foreign_herds, herd_film
from flockbrush.film.observations import Sightings
from flockbrush.film.speed_process import speed_process
from flockbrush.film.speeds import crowding_of, speed_evidence
from flockbrush.learning.herd_views import view_of_run
from flockbrush.learning.initial_conditions import body_of, speed_of
from flockbrush.learning.rollout import HerdStart, PlaneHerd, Run, params_of, rollout

ALONE = params_of(np.full(12, 1e-3), {"wander": 0.0, "leader_neighbours": -1})


def packed_and_loose(seed=0, frames=12):
    """A clip of a tight core that goes slowly and a loose rim that goes fast."""
    rng = np.random.default_rng(seed)
    core, rim = rng.normal(0, 2.0, (60, 2)), rng.normal(0, 12.0, (60, 2))
    xy = np.concatenate([core, rim])
    speed = np.repeat([1.0, 3.0], 60)
    t = np.arange(frames)[:, None] / 12.5
    forward = np.broadcast_to([1.0, 0.0], (frames, 120, 2))
    places = xy[None] + (speed * t)[..., None] * forward
    return foreign_herds.Truth("packed", 12.5, places, forward.copy(), np.broadcast_to(speed, (frames, 120)).copy())


def used_factors(herd):
    """What the pace of a herd makes of its speeds."""
    herd.drawn[:] = 1.0
    one = {"mean": np.ones(1), "deviation": np.zeros(1), "reversion": np.full(1, 1e-9)}
    herd.pace_rules = herd.pace_rules._replace(**one)
    herd.tick()
    return herd.target


@pytest.mark.parametrize("sight", [True, False])
def test_crowding_slows_animals_of_the_clip_by_a_factor_whose_mean_is_one(sight):
    clip = herd_film.evidence_of_truth(packed_and_loose(), cell=2.0, sight=sight)
    clip.speed = speed_evidence(clip.fields, clip.sightings)
    spec = speed_of([clip])
    assert spec.by_density and spec.by_density[0][1] > 1.3 > 0.9 > spec.by_density[-1][1]
    xy = herd_film.evidence_of_truth(packed_and_loose(), cell=2.0).sightings.xy[:120]
    herd = PlaneHerd(HerdStart(xy, np.tile([1.0, 0.0], (120, 1))), ALONE, spec, BodySpec(radius=0.01, contact="disc"))
    assert used_factors(herd).mean() == pytest.approx(1.0, abs=0.03 if sight else 0.15)


def test_crowding_is_counted_as_the_pace_of_a_level_counts_it():
    xy = packed_and_loose().xy[0]
    far = np.hypot(*(xy[:, None] - xy[None]).transpose(2, 0, 1))
    assert np.allclose(crowding_of(xy), ((far < 2.0).sum(1) - 1) / (4 * np.pi))


def test_a_herd_has_the_speeds_that_were_learned_from_it():
    spec = SpeedSpec(mean=2.0, deviation=0.6, reversion=1.5)
    xy = np.stack(np.meshgrid(np.arange(10), np.arange(10)), -1).reshape(-1, 2) * 30.0
    run = rollout(HerdStart(xy, np.tile([1.0, 0.0], (100, 1))), ALONE, spec, seconds=12.0, fps=25.0, seed=1)
    seen = Sightings(run.first, run.xy, run.forward, run.speed, np.full(len(run.xy), np.nan), run.ids)
    found = speed_process(seen, 25.0, 0.02)
    assert found.mean == pytest.approx(2.0, rel=0.03)
    assert found.spread == pytest.approx(0.6 / np.sqrt(3.0), rel=0.08)
    assert found.reversion == pytest.approx(1.5, rel=0.3)


def test_a_herd_has_the_differences_and_common_changes_of_speed_that_were_learned_from_it():
    spec = SpeedSpec(mean=3.0, deviation=0.6, reversion=1.5, individual=0.2, common=0.5, common_time=1.5)
    xy = np.column_stack([np.zeros(24), 0.7 * np.arange(24)])  # abreast: nobody is in another's way
    start = HerdStart(xy, np.tile([1.0, 0.0], (24, 1)))
    found = []
    for seed in range(12):
        run = rollout(start, ALONE, spec, seconds=20.0, fps=10.0, seed=seed)
        seen = Sightings(run.first, run.xy, run.forward, run.speed, np.full(len(run.xy), np.nan), run.ids)
        found.append(speed_process(seen, 10.0, 0.02))
    assert np.mean([one.individual for one in found]) == pytest.approx(0.6, rel=0.15)
    assert np.mean([one.spread for one in found]) == pytest.approx(spec.own_spread, rel=0.1)
    assert np.mean([one.common for one in found]) == pytest.approx(0.5, rel=0.2)
    assert np.median([one.common_time for one in found]) == pytest.approx(1.5, rel=0.4)


def test_of_animals_that_are_alike_no_difference_or_common_change_is_learned():
    spec = SpeedSpec(mean=3.0, deviation=0.6, reversion=1.5)
    xy = np.column_stack([np.zeros(24), 0.7 * np.arange(24)])
    start = HerdStart(xy, np.tile([1.0, 0.0], (24, 1)))
    for seed in range(6):
        run = rollout(start, ALONE, spec, seconds=20.0, fps=10.0, seed=seed)
        seen = Sightings(run.first, run.xy, run.forward, run.speed, np.full(len(run.xy), np.nan), run.ids)
        found = speed_process(seen, 10.0, 0.02)
        assert found.individual < 0.1 and found.common == 0.0


def test_shoves_are_no_speed_of_an_animal():
    clip = herd_film.evidence_of_truth(packed_and_loose(frames=2), cell=2.0)
    run = Run(
        np.array([0.0]), np.array([0, 2]), np.arange(2), np.zeros((2, 2)) + clip.sightings.xy[0],
        np.array([[1.0, 0.0], [1.0, 0.0]]), np.array([[2.0, 1.5], [-1.0, 0.0]]),
    )  # fmt: skip
    assert view_of_run(run, clip).speed.tolist() == [2.0, 0.0]


def test_a_body_is_one_body_length_long_and_as_wide_as_seen():
    clip = herd_film.evidence_of_truth(packed_and_loose(), cell=2.0, sight=False)
    body = body_of([dataclasses.replace(clip, radius_bl=0.2)])
    herd = PlaneHerd(HerdStart(np.zeros((1, 2)), np.array([[1.0, 0.0]])), ALONE, SpeedSpec(mean=1.0), body)
    assert (2 * (herd.axis + herd.radius), herd.radius) == (1.0, 0.2)


def test_a_brush_of_larger_animals_makes_the_same_herd_larger():
    from flockbrush.components import Heading, Position, Speed
    from flockbrush.levels.build import plane

    from flockbrush.learning.learned_brush import brush_of
    from flockbrush.learning.learned_parameters import Learned

    clip = herd_film.evidence_of_truth(packed_and_loose(), cell=2.0)
    speed = SpeedSpec(mean=2.0, deviation=0.3, by_density=((0.1, 1.2), (0.6, 0.7)))
    theta = np.full(12, 0.5)
    learned = Learned(
        params_of(theta, {"wander": 0.2}), speed, BodySpec(radius=0.2), VisionSpec(range=5.0), theta
    )  # fmt: skip
    herds = []
    for length in (1.0, 1.5):
        brush = brush_of("x", learned, [clip], seed=1, length_m=length)
        simulation = plane(brush, 30, seed=3)
        agents = simulation.agents
        begun = agents[Position.xyz] / length, agents[Heading.forward].copy(), agents[Speed.drawn] / length
        simulation.run(32)
        herds.append((*begun, agents[Position.xyz] / length))
    for one, other in zip(*herds, strict=True):
        assert np.allclose(one, other, atol=1e-6)

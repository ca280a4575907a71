"""Animals that stand and walk by turns are learned as that, and go on so."""

import numpy as np
import pytest
from flockbrush.behaviours.brush import BodySpec, SpeedSpec, shipped
from flockbrush.components import Heading, Position, Speed
from flockbrush.levels.build import plane

from benchmarks.foreign_herds import herd
from benchmarks.herd_film import evidence_of_truth
from flockbrush.film.observations import Sightings
from flockbrush.film.pauses import pauses_of
from flockbrush.film.speeds import speed_evidence
from flockbrush.learning.initial_conditions import speed_of
from flockbrush.learning.rollout import HerdStart, PlaneHerd, params_of, rollout

GRAZERS = SpeedSpec(mean=1.0, deviation=0.2, reversion=2.0, stops=0.6, starts=0.3, imitation=2.0)
ALONE = params_of(np.full(12, 1e-3), {"wander": 0.0, "leader_neighbours": -1})


def grazers(spec=GRAZERS, seconds=40.0, seed=0, count=60):
    """Animals on a lattice, three body lengths apart, that keep their way."""
    side = int(np.ceil(np.sqrt(count)))
    xy = 3.0 * np.stack(np.meshgrid(np.arange(side), np.arange(side)), -1).reshape(-1, 2)[:count]
    start = HerdStart(xy, np.tile([1.0, 0.0], (count, 1)), np.full(count, spec.mean))
    return rollout(start, ALONE, spec, BodySpec(radius=0.01, contact="disc"), seconds=seconds, fps=12.5, seed=seed)


def sightings(run):
    return Sightings(run.first, run.xy, run.forward, run.speed, np.full(len(run.xy), np.nan), run.ids)


def test_states_are_learned_back_by_their_rates():
    found = pauses_of(sightings(grazers()), 12.5)
    assert found is not None and found.changes > 300
    assert found.imitation in (1.0, 2.0, 4.0)
    # what an animal does in mixed company is told better than the share that imitation has in it
    company = [(rate * (1 + 0.5 * found.imitation)) for rate in (found.stops, found.starts)]
    assert company == pytest.approx([0.6 * 2.0, 0.3 * 2.0], rel=0.3)


def test_as_many_stand_after_a_minute_as_in_the_clip():
    run = grazers()
    found = speed_of([_clip(run)])
    assert found.stops > 0 and found.mean == pytest.approx(1.0, rel=0.1)
    again = grazers(found, seconds=60.0, seed=5)
    share = [float((r.speed[r.first[len(r) // 2] :] < 0.1).mean()) for r in (run, again)]
    assert share[1] == pytest.approx(share[0], abs=0.1) and share[0] > 0.4


def _clip(run):
    clip = evidence_of_truth(herd("graze", 20, 0.4, 12.5, 0), grid=8)
    clip.speed = speed_evidence(clip.fields, sightings(run), 1.0, 0.08)
    return clip


def test_speeds_of_one_kind_have_no_states():
    steady = SpeedSpec(mean=1.0, deviation=0.5, reversion=1.0)
    assert pauses_of(sightings(grazers(steady)), 12.5) is None


def test_a_foreign_herd_that_stands_and_walks_goes_on_standing():
    """Ginelli's sheep, not ours: most stand, and so do those that were learned from them."""
    truth = herd("graze", 50, 8.0, 12.5, 2)
    clip = evidence_of_truth(truth)
    clip.speed = speed_evidence(clip.fields, clip.sightings)
    spec = speed_of([clip])
    assert spec.stops > 0 and spec.starts > 0
    stood = float((truth.speed < 0.15).mean())
    run = grazers(spec, seconds=30.0, count=50)
    assert float((run.speed[run.first[len(run) // 2] :] < 0.15).mean()) == pytest.approx(stood, abs=0.2)


def test_a_herd_that_pauses_is_the_same_here_and_in_a_level():
    brush = shipped().get("graze").model_copy(update={"speed": GRAZERS})
    simulation = plane(brush, 40, seed=5)
    agents = simulation.agents
    begin = HerdStart(
        agents[Position.xyz][:, :2].copy(), agents[Heading.forward][:, :2].copy(), agents[Speed.drawn].copy()
    )
    mine = PlaneHerd(begin, brush.params, brush.speed, brush.body, brush.vision, seed=5)
    for _ in range(96):
        simulation.tick()
        mine.tick()
    assert np.array_equal(agents[Position.xyz], mine.xyz)
    assert 0 < (mine.drawn == 0.0).sum() < 40

"""The program of merino sheep: slow spreading while they graze, sudden packing by imitation (Ginelli et al. 2015)."""

import numpy as np
import pytest
from flockbrush.behaviours.brush import shipped
from flockbrush.behaviours.program import shipped_programs
from flockbrush.components import Position
from flockbrush.levels.build import build
from flockbrush.levels.schema import Level, Spawn
from flockbrush.systems.program_commands import SetState
from small_program import box

from benchmarks.merino import AFTER, QUIET, hull_area, packing_events

SHEEP = 100


def pasture(low, high, seed=1):
    """A hundred sheep in a square of a pasture of 80 x 80 m."""
    spawn = Spawn(1, "", box(low, low, high, high), "sheep", "merino-rest", SHEEP)
    spawn.program = "merino"
    level = Level("pasture", None, 80.0, 80.0, 4.0, "wall", seed, spawns=[spawn])
    level.programs = {"merino": shipped_programs().get("merino")}
    return build(level, library=shipped())


def spacing(scene):
    """Mean distance to the six nearest, m."""
    xy = scene.agents[Position.xyz][:, :2]
    away = np.sqrt(((xy[:, None] - xy[None]) ** 2).sum(2))
    return float(np.sort(away, axis=1)[:, 1:7].mean())


def begins_to_run(scene):
    """Have the sheep in the middle run; how many have run at all 12 s later."""
    scene.submit(SetState("merino", "run", x=40.0, y=40.0, radius=7.0))
    before = scene.clock.tick
    scene.run(1)
    began = scene.states()["merino"]["run"]
    assert 0 < began < 0.3 * SHEEP and scene.clock.tick == before + 1
    scene.run(12 * 32)
    went = scene.transitions()["merino"]
    return sum(row.get("run", 0) for row in went.values())


def test_a_dense_herd_spreads_slowly_as_it_grazes_and_nobody_runs():
    scene = pasture(34, 46)
    spaced = [spacing(scene)]
    for _ in range(3):
        scene.run(20 * 32)
        spaced.append(spacing(scene))
    assert spaced == sorted(spaced) and 1.1 < spaced[-1] / spaced[0] < 1.6
    assert scene.states()["merino"]["run"] == 0 and scene.states()["merino"]["walk"] > 3


@pytest.mark.parametrize("seed", [1, 2])
def test_in_a_spread_herd_a_few_who_run_are_followed_by_all_and_the_herd_packs_within_half_a_minute(seed):
    scene = pasture(15, 65, seed)
    scene.run(4 * 32)
    before = spacing(scene)
    assert begins_to_run(scene) > 0.8 * SHEEP
    scene.run(18 * 32)
    assert spacing(scene) < 0.6 * before
    assert scene.states()["merino"]["run"] < 0.1 * SHEEP  # and stands again


def test_in_a_dense_herd_few_follow():
    scene = pasture(33, 47)
    scene.submit(SetState("merino", "run", x=40.0, y=40.0, radius=1.5))
    scene.run(3 * 32)
    assert sum(row.get("run", 0) for row in scene.transitions()["merino"].values()) < 0.5 * SHEEP


def test_events_are_told_by_pauses_and_measured_by_who_runs_and_by_the_hull():
    ring = np.array([(np.cos(a), np.sin(a)) for a in np.linspace(0, 2 * np.pi, 8, endpoint=False)])
    herd = np.r_[10.0 * ring, [[0.0, 0.0], [1.0, 0.0]]]
    xy = np.broadcast_to(herd, (600, 10, 2)).copy()
    runs = np.zeros((600, 10), bool)
    runs[100, 4] = runs[100 + QUIET, 1:4] = True  # one event: the pause is not longer
    runs[300, 8] = True  # another one, from the middle
    xy[102 + QUIET :] *= 0.5
    one, other = packing_events(runs, xy)
    assert (one.begin, one.end, one.size) == (100, 101 + QUIET, 4)
    assert (other.begin, other.end, other.size) == (300, 301, 1)
    assert one.before == pytest.approx(hull_area(herd)) == pytest.approx(8 * 100 * np.sin(np.pi / 4) / 2)
    assert one.after == pytest.approx(0.25 * one.before) and other.after == other.before
    assert one.outside > 0.2 > other.outside
    assert AFTER < 300 - 101 - QUIET
    assert packing_events(np.zeros((5, 10), bool), xy[:5]) == []

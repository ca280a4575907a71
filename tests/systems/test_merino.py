"""The program of merino sheep: slow spreading while they graze, sudden packing by imitation (Ginelli et al. 2015)."""

import numpy as np
import pytest
from flockbrush.behaviours.brush import shipped
from flockbrush.behaviours.program import shipped_programs
from flockbrush.components import Position, ProgramState
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


def hull(scene):
    return hull_area(scene.agents[Position.xyz][:, :2])


def begins_to_run(scene):
    """Have a few sheep in the middle run; how many run in 45 s, and the least hull then as a part of that before.

    Where nobody has run for 20 s nobody will.
    """
    before, least, ran, calm = hull(scene), 1.0, set(), 0
    scene.submit(SetState("merino", "run", x=40.0, y=40.0, radius=4.0))
    scene.run(1)
    assert 0 < scene.states()["merino"]["run"] < 0.1 * SHEEP
    run = list(scene.states()["merino"]).index("run")
    for _ in range(45):
        scene.run(32)
        running = scene.agents[ProgramState.state] == run
        ran |= set(scene.agents.ids[running].tolist())
        least = min(least, hull(scene) / before)
        calm = 0 if running.any() else calm + 1
        if calm == 20:
            break
    return len(ran), least


def test_a_dense_herd_spreads_slowly_as_it_grazes_and_nobody_runs():
    scene = pasture(34, 46)
    spaced = [spacing(scene)]
    for _ in range(3):
        scene.run(20 * 32)
        spaced.append(spacing(scene))
    assert spaced == sorted(spaced) and 1.1 < spaced[-1] / spaced[0] < 1.6
    assert scene.states()["merino"]["run"] == 0 and scene.states()["merino"]["walk"] > 3


def test_a_few_who_run_are_followed_by_few_or_by_most_and_the_herd_packs_suddenly_where_most_follow():
    events = []
    for seed in (3, 5, 6, 7, 8):
        scene = pasture(21, 59, seed)
        scene.run(4 * 32)
        events.append(begins_to_run(scene))
        scene.close()
    sizes, least = zip(*sorted(events), strict=True)
    assert sizes[0] < 0.2 * SHEEP and sizes[-1] > 0.6 * SHEEP  # of one kind of herd: the seed alone differs
    assert np.diff(sizes).max() < 0.3 * SHEEP  # and there are sizes between
    assert min(least[:3]) > 0.95 and max(least[-2:]) < 0.8


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

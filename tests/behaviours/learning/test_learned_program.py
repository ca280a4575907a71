"""A clip whose animals stand and walk by turns becomes a program with a brush of each state."""

from dataclasses import replace

import numpy as np
import pytest
from flockbrush.behaviours.brush import BrushLibrary, shipped
from flockbrush.behaviours.program import load_program
from flockbrush.components import Heading, Position
from flockbrush.levels.build import build
from flockbrush.levels.schema import Level, Spawn

from benchmarks.foreign_herds import herd
from benchmarks.herd_film import evidence_of_truth
from flockbrush.film.observations import Sightings
from flockbrush.film.pauses import limits_of, states_of
from flockbrush.film.speeds import speed_evidence
from flockbrush.learning.battery import MEASURES
from flockbrush.learning.initial_conditions import speed_of
from flockbrush.learning.learned_program import program_of

FPS, COUNT = 16.0, 60


@pytest.fixture(scope="module")
def learned():
    """A clip of sheep of another model, and the program of the brush with its speeds."""
    clip = evidence_of_truth(herd("graze", COUNT, 20.0, FPS, 4))
    clip.speed = speed_evidence(clip.fields, clip.sightings)
    brush = shipped().get("graze").model_copy(update={"name": "ewes", "speed": speed_of([clip])})
    return clip, program_of(brush, [clip])


def on_a_plane(program, folder, clip, seconds):
    """Sights of animals under the program, as dense as those of the clip."""
    folder.mkdir(exist_ok=True)
    written = program.write(folder / "ewes.brush.toml")
    xy = clip.sightings.xy[clip.sightings.of(0)]
    side, size = np.ptp(xy, axis=0), 300.0
    (west, south), (east, north) = 0.5 * size - 0.5 * side, 0.5 * size + 0.5 * side
    box = np.array([(west, south), (east, south), (east, north), (west, north)], float)
    spawn = Spawn(1, "herd", box, "sheep", "ewes-walk", COUNT, program="ewes")
    level = Level("plane", None, size, size, 8.0, "open", 1, spawns=[spawn])
    level.programs = {"ewes": load_program(written[0])}
    scene = build(level, library=BrushLibrary([folder, *shipped().folders]))
    length, every, looks = 1.0, round(1 / (FPS * scene.clock.dt)), []
    for _ in range(round(seconds * FPS)):
        before = scene.agents[Position.xyz][:, :2].copy()
        for _ in range(every):
            scene.tick()
        after = scene.agents[Position.xyz][:, :2].copy()
        looks.append((after / length, scene.agents[Heading.forward][:, :2].copy(), np.hypot(*(after - before).T) * FPS))
    place, forward, speed = (np.concatenate(column) for column in zip(*looks, strict=True))
    ids = np.tile(np.arange(COUNT), len(looks))
    first = np.arange(len(looks) + 1) * COUNT
    return Sightings(first, place, forward, speed, np.full(len(place), np.nan), ids), scene


def stood(sightings, limits):
    """(share standing, mean seconds of standing and of walking) of the sights, ends of the clip counted as open."""
    states, before, after = states_of(sightings, FPS, limits)
    known = states[states >= 0]
    lasts = []
    for state in (0, 1):
        mine = states[before] == state
        lasts.append(mine.sum() / FPS / max((states[after][mine] != state).sum(), 1))
    return float((known == 0).mean()), *lasts


def test_the_program_stands_as_often_and_as_long_as_the_clip(learned, tmp_path):
    clip, program = learned
    assert list(program.program.states) == ["stand", "walk"]
    assert sum(program.shares) == pytest.approx(1.0) and 0.1 < program.shares[0] < 0.9
    limits = limits_of(clip.sightings)
    run, scene = on_a_plane(program, tmp_path / "brushes", clip, 60.0)
    share, stand, walk = stood(clip.sightings, limits)
    again, stands, walks = stood(run, limits)
    assert abs(again - share) < MEASURES["share standing"].floor
    assert stands == pytest.approx(stand, rel=0.3) and walks == pytest.approx(walk, rel=0.3)
    assert scene.transitions()["ewes"]["stand"]["walk"] > COUNT


def test_three_speeds_are_three_states(learned):
    """Each animal changes at random, one way round: stand, walk, run and stand again."""
    clip, _ = learned
    rng, seen = np.random.default_rng(2), clip.sightings
    state, speed = np.zeros(COUNT, int), np.empty(len(seen.xy))
    for t in range(len(seen)):
        state = (state + (rng.uniform(size=COUNT) < 0.5 / FPS)) % 3
        speed[seen.of(t)] = np.array([0.02, 1.0, 4.0])[state] * rng.uniform(0.8, 1.2, COUNT)
    brush = shipped().get("graze").model_copy(update={"name": "ewes", "speed": speed_of([clip])})
    found = program_of(brush, [replace(clip, sightings=replace(seen, speed=speed))])
    assert list(found.program.states) == ["stand", "walk", "run"]
    assert [(c.source, c.to) for c in found.changes] == [(0, 1), (1, 2), (2, 0)]
    assert [c.rate for c in found.changes] == pytest.approx([0.5] * 3, rel=0.25)
    assert [found.brushes[f"ewes-{name}"].speed.mean for name in found.program.states] == pytest.approx(
        [0, 1, 4], rel=0.1
    )


def test_steady_animals_have_no_program(learned):
    clip, _ = learned
    assert program_of(shipped().get("march"), [clip]) is None

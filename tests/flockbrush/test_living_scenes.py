"""The scenes of docs/directing.md do what they promise: species, programs, events and terrain in one level."""

from pathlib import Path

import numpy as np
import pytest
from flockbrush.behaviours.brush import shipped
from flockbrush.components import Position, Role, Species, Velocity
from flockbrush.levels import reader
from flockbrush.levels.build import build
from flockbrush.levels.reader import read_level
from flockbrush.systems.ground_height import height_of_ground
from flockbrush.systems.groups import measures_of
from flockbrush.systems.landscape import Landscape
from flockbrush.systems.leaders import Steer
from flockbrush.systems.population import SpeciesList

from benchmarks.merino import hull_area
from flockbrush.runs.run import start

RATE = 32  # ticks a second
BIRDS = {"goose", "starling", "falcon"}


def places(scene, species):
    """(k, 3) m, of the animals of a species."""
    names = scene.world.resource(SpeciesList).names
    return scene.agents[Position.xyz][scene.agents[Species.index] == names.index(species)].copy()


def went(scene, program, before, after):
    """How often animals of a program have gone from one state to another."""
    return scene.transitions()[program].get(before, {}).get(after, 0)


def spread(xyz):
    """m, mean distance from the middle in plan."""
    return float(np.sqrt(((xyz[:, :2] - xyz[:, :2].mean(0)) ** 2).sum(1)).mean())


def run(scene, ticks):
    """Go on; and every two seconds nobody is faster than its species, or stands in the air."""
    species = scene.world.resource(SpeciesList)
    birds = [k for k, name in enumerate(species.names) if name in BIRDS]
    for since in range(0, ticks, 2 * RATE):
        scene.run(min(2 * RATE, ticks - since))
        kind, speed = scene.agents[Species.index], np.sqrt((scene.agents[Velocity.xyz] ** 2).sum(1))
        assert np.isfinite(speed).all() and (speed <= species.table.speed[kind].max(1) * 1.001).all()
        aloft = np.isin(kind, birds) & (scene.agents[Position.xyz][:, 2] > 5.0)
        assert (speed[aloft] > 0.5 * species.table.slowest[kind[aloft]]).all()


def test_savanna_thirst_lions_contagion_and_calm():
    scene = start("savanna")
    run(scene, 38 * RATE)
    assert scene.states()["lion"]["lie"] > 0 and scene.states()["zebra"]["bolt"] == 0
    assert went(scene, "zebra", "graze", "thirsty") > 60  # each at its own time
    first, near = None, 0
    while scene.clock.now < 80 and scene.states()["zebra"]["calm"] < 65:
        run(scene, RATE // 4)
        zebras, lions = places(scene, "zebra")[:, :2], places(scene, "lion")[:, :2]
        away = np.sqrt(((zebras[:, None] - lions[None]) ** 2).sum(2)).min(1)
        if scene.states()["zebra"]["bolt"]:
            first = scene.clock.now if first is None else first
            near = max(near, int((away <= 25).sum()))
    assert went(scene, "zebra", "thirsty", "drink") >= 5  # some came to the water before
    bolted = sum(went(scene, "zebra", state, "bolt") for state in ("graze", "thirsty", "drink"))
    assert first is not None and scene.clock.now - first < 22
    assert bolted >= 85 and near < 0.6 * bolted  # most of them from the others, not from the lions
    assert went(scene, "zebra", "bolt", "calm") >= 60 and scene.states()["zebra"]["bolt"] < 30  # the herd calms
    assert went(scene, "lion", "rush", "tired") + scene.states()["lion"]["rush"] >= 1
    assert len(places(scene, "zebra")) == 90  # and nobody was caught


def test_lake_skeins_meet_land_rest_and_leave_and_a_falcon_scatters_starlings():
    scene = start("lake")
    geese = places(scene, "goose")
    assert abs(geese[:11, 1].mean() - geese[11:, 1].mean()) > 165  # they see 160 m far
    goose = scene.agents[Species.index] == scene.world.resource(SpeciesList).names.index("goose")
    run(scene, 10 * RATE)
    assert scene.agents[Role.leader][goose].sum() == 2
    run(scene, 14 * RATE)
    assert scene.agents[Role.leader][goose].sum() == 1
    assert spread(places(scene, "goose")) < 20  # they have joined
    run(scene, 20 * RATE)
    geese, flock = places(scene, "goose"), spread(places(scene, "starling"))
    assert scene.states()["lake-goose"]["rest"] == 20 and (geese[:, 2] < 1).all()
    assert (np.abs(geese[:, :2] - (640, 400)) < (150, 90)).all()
    scattered = 0.0
    for _ in range(8):
        run(scene, 2 * RATE)
        scattered = max(scattered, spread(places(scene, "starling")))
    assert scattered > 2.5 * flock
    run(scene, 19 * RATE)
    assert scene.states()["lake-goose"]["rest"] == 20 and scene.states()["falcon"]["leave"] == 1
    closed = spread(places(scene, "starling"))
    while scene.clock.now < 100 and (places(scene, "goose")[:, 2] <= 25).any():
        run(scene, 3 * RATE)
        closed = min(closed, spread(places(scene, "starling")))
    assert scene.states()["lake-goose"]["away"] == 20 and (places(scene, "goose")[:, 2] > 25).all()
    assert closed < 0.6 * scattered  # it is gone


def test_merino_sheep_spread_slowly_and_pack_suddenly():
    scene, hulls, spreads, runners = start("merino"), [], [], []
    while scene.clock.now < 120 and not (any(runners) and runners[-1] == 0):
        sheep = places(scene, "sheep")
        hulls, spreads = [*hulls, hull_area(sheep[:, :2])], [*spreads, spread(sheep)]
        run(scene, 3 * RATE)
        runners.append(scene.states()["merino"]["run"])
    first = np.flatnonzero(runners)[0]
    assert first > 8 and hulls[first] > 1.05 * hulls[0]
    assert spread(places(scene, "sheep")) < 0.85 * max(spreads)
    assert hull_area(places(scene, "sheep")[:, :2]) < 0.7 * max(hulls)
    assert sum(row.get("run", 0) for row in scene.transitions()["merino"].values()) > 60


def test_ridge_the_herd_takes_the_pass_and_birds_follow_the_slope():
    scene = start("ridge")
    land, highest, clear, crossed = scene.world.resource(Landscape), 0.0, np.inf, 0.0
    while scene.clock.now < 120 and (places(scene, "reindeer")[:, 0] > 170).mean() <= 0.9:
        run(scene, RATE // 2)
        highest = max(highest, places(scene, "reindeer")[:, 2].max())
        birds = places(scene, "starling")
        ground = [height_of_ground(land.heights, x, y) for x, y in birds[:, :2]]
        clear, crossed = min(clear, (birds[:, 2] - ground).min()), max(crossed, max(ground))
    assert highest < 14 and (places(scene, "reindeer")[:, 0] > 170).mean() > 0.9  # the ridge is 40 m high
    assert crossed > 30 and clear > 0.04


def test_ridge_a_dog_brings_the_sheep_together():
    level = read_level(Path(reader.__file__).parent / "shipped" / "ridge.tmj")
    level.spawns = [spawn for spawn in level.spawns if spawn.species in ("sheep", "dog", "human")]
    level.script = [key for key in level.script if key.args.get("species") != "starling"]
    scene = build(level, library=shipped())
    apart, dog = spread(places(scene, "sheep")), places(scene, "dog")
    run(scene, 4 * RATE)
    assert np.abs(places(scene, "dog") - dog).max() < 0.1  # until the event fetch
    while scene.clock.now < 100 and spread(places(scene, "sheep")) >= 0.5 * apart:
        run(scene, 2 * RATE)
    run(scene, 16 * RATE)
    assert spread(places(scene, "sheep")) < 0.5 * apart  # and they stay together


def test_the_shepherd_stands_until_it_is_steered():
    scene = start("ridge")
    run(scene, 3 * RATE)
    stood = places(scene, "human")[0]
    run(scene, 2 * RATE)
    assert np.abs(places(scene, "human")[0] - stood).max() < 0.05
    scene.submit(Steer(species="human", x=0.0, y=1.0))
    run(scene, 6 * RATE)
    walked = places(scene, "human")[0] - stood
    assert 4 < walked[1] < 8 and abs(walked[0]) < 2
    scene.submit(Steer(species="human", x=0.0, y=0.0))
    run(scene, 2 * RATE)
    stood = places(scene, "human")[0]
    run(scene, RATE)
    assert np.abs(places(scene, "human")[0] - stood).max() < 0.05


def test_city_people_leave_by_all_gates_when_the_alarm_is_raised():
    scene = start("city")
    run(scene, 11 * RATE)
    there = len(scene.agents)
    assert scene.states()["evacuation"] == {"stroll": there, "leave": 0} and there > 170
    run(scene, 5 * RATE)
    assert scene.states()["evacuation"]["stroll"] == 0
    last = {}
    while scene.clock.now < 84 and len(scene.agents):
        last.update(zip(scene.agents.ids.tolist(), scene.agents[Position.xyz][:, :2].tolist(), strict=True))
        run(scene, RATE // 2)
    assert len(scene.agents) <= 0.04 * there
    gone = np.array([xy for entity, xy in last.items() if entity not in set(scene.agents.ids.tolist())])
    south, west = gone[:, 1] < 24, gone[:, 0] < 30
    assert min(south.sum(), (~south & west).sum(), (~south & ~west).sum()) > 15


def test_the_guide_round_the_ant_hill_reaches_its_wall():
    level = read_level(Path(reader.__file__).parent / "shipped" / "anthill.tmj")
    (guide,), (hill,) = level.guides, level.obstacles
    wall, way = finely(hill.polygon), finely(guide.points)
    apart = np.linalg.norm(wall[:, None] - way, axis=2).min(axis=1)
    assert apart.max() < guide.radius  # ants that are out of its reach pile up there


def finely(corners):
    """Points all along a closed line (k, 2)."""
    share = np.linspace(0.0, 1.0, 50)[:, None]
    return np.concatenate([a + share * (b - a) for a, b in zip(corners, np.roll(corners, -1, 0), strict=True)])


@pytest.mark.parametrize("seed", [3, 5])
def test_a_flock_that_pillars_tear_apart_becomes_one_again(seed):
    scene, parts = start("pillars", seed=seed), []
    for _ in range(22):
        scene.run(RATE)
        parts.append(measures_of(scene.world)["largest_part"])
    torn = next(k for k in range(5, 22) if parts[k] < 0.7)  # they begin scattered
    assert max(parts[3:torn]) > 0.95 and max(parts[torn : torn + 12]) > 0.95

"""The shipped levels of birds, lived through: split and joined, among elephants, recorded and lived again."""

import numpy as np
from flockbrush.components import Body, BrushBinding, Heading, Position, Velocity
from flockbrush.systems.foresight import solids_to_avoid
from flockbrush.systems.landscape import Landscape
from flockbrush.systems.measures import compute_largest_part, compute_polarization
from flockbrush.systems.palette import Palette
from small_herd import gaps_to_solid, room_in_the_air

from flockbrush.runs.run import start

ABOVE_THE_GATE, SIDES = 34.0, (36.0, 64.0)  # m: the lintel, and the walls to both sides


def test_starlings_are_split_by_the_tower_join_again_and_fly_through_the_gate():
    simulation = start("pillars")
    agents, parts, room = simulation.agents, [], np.inf
    before, crossings = agents[Position.xyz].copy(), {}
    for tick in range(1000):
        simulation.tick()
        xyz = agents[Position.xyz]
        for row in np.flatnonzero((before[:, 0] < 232) & (xyz[:, 0] >= 232)):
            crossings[int(row)] = xyz[row, 1:].copy()
        before = xyz.copy()
        if tick % 8 == 7:
            room = min(room, room_in_the_air(simulation).min())
            parts.append((xyz[:, 0].mean(), compute_largest_part(xyz, 4.0)))
    x, part = np.array(parts).T
    assert room > 0
    assert part[x < 60].min() == 1.0
    assert part[(x > 160) & (x < 190)].min() < 0.7  # behind the tower, which is 14 m wide
    assert part[-1] > 0.95
    assert len(crossings) == 200
    across = np.array(list(crossings.values()))
    assert ((across[:, 0] > SIDES[0]) & (across[:, 0] < SIDES[1]) & (across[:, 1] < ABOVE_THE_GATE)).all()
    assert compute_polarization(agents[Heading.forward]) > 0.95


def test_sparrows_fly_among_grazing_elephants_and_into_none_and_burst_before_the_falcon():
    simulation = start("elephants")
    world, land = simulation.world, simulation.world.resource(Landscape)
    near, spread, pace = 0, [], []
    for tick in range(560):
        simulation.tick()
        agents = simulation.agents
        if tick % 8:
            continue
        aloft = world.resource(Palette).aloft(agents[BrushBinding.brush])
        brush = agents[BrushBinding.brush]
        sparrows = np.flatnonzero(brush == np.bincount(brush[aloft]).argmax())
        xyz = agents[Position.xyz]
        spread.append(np.linalg.norm(xyz[sparrows] - xyz[sparrows].mean(0), axis=1).mean())
        pace.append(np.linalg.norm(agents[Velocity.xyz][sparrows], axis=1).mean())
        solids = solids_to_avoid(agents, land.sky, aloft)
        bodies = range(len(land.sky.kind), len(solids.kind))  # the elephants
        gaps = np.min([gaps_to_solid(solids, k, xyz[aloft]) for k in bodies], axis=0) - agents[Body.radius][aloft]
        assert gaps.min() > 0
        near += int((gaps < 2.0).sum())
    assert len(sparrows) == 120
    assert (~aloft).sum() == 14
    assert near > 20  # they do come near
    calm = slice(36, 55)  # the falcon comes after nine seconds, and is upon them after fifteen
    assert max(pace[55:]) > 1.4 * max(pace[calm])
    assert max(spread[55:]) > 3 * max(spread[calm])


def test_a_level_with_so_few_animals_that_the_falcon_stays_away_runs_all_the_same(cli):
    done = cli("run", "elephants", "--agents", 12, "--seconds", 10)
    assert (done.code, done.err) == (0, "")

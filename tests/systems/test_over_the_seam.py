"""A periodic map has no border: whatever lies across the seam is met, seen and kept to as anything else."""

import numpy as np
import pytest
from flockbrush.behaviours.behaviour import behaviours
from flockbrush.behaviours.drive import drives
from flockbrush.components import Alarm, FormationPlace, Heading, Position, Velocity
from flockbrush.engine.raster import Raster
from flockbrush.engine.seam import short_way
from flockbrush.systems.edits import Paint, PlaceExit
from flockbrush.systems.far_sight import sees_place
from flockbrush.systems.foresight import Ahead
from flockbrush.systems.ground_height import heights_of_ground
from flockbrush.systems.landscape import Landscape
from flockbrush.systems.mark_commands import DrawArea, DrawLine, DrawZone
from flockbrush.systems.named_regions import in_region
from flockbrush.systems.paint_commands import PaintBrush
from flockbrush.systems.program_senses import WorldSenses
from flockbrush.systems.programs import Programs
from flockbrush.systems.terrain import relief_of, steepness_of
from small_herd import box, brush, meadow, obstacle, put, put_aloft, straight

from flockbrush.runs.level_counts import Counts
from flockbrush.studio.tools.world_tools import KINDS, area_around, things_at

SIZE = np.array([64.0, 48.0])
Y, X = np.mgrid[:48, :64] + 0.5
HILLS = 4.0 * np.sin(2 * np.pi * X / 64) * np.cos(4 * np.pi * Y / 48) + 2.0 * np.cos(6 * np.pi * X / 64)
GOOSE = {"body": {"length": 0.8, "radius": 0.16, "contact": "disc"}, "vision": {"range": 25.0}}


def ends(x):
    """A map whose borders are joined, with a ground (48, 64) that rises at x m to the east and falls again."""
    away = np.abs((X - x - 10.0 + 32.0) % 64.0 - 32.0)
    return np.maximum(20.0 * (1.0 - away / 10.0), 0.0)


def on_the_torus(*brushes, height=None, **things):
    more = {} if height is None else {"height_map": Raster(1.0, height)}
    return meadow(*brushes, boundary="wrap", width=64, height=48, **more, **things)


def seam(shift):
    """Where x m from the middle of the map is, on a map that has been shifted."""
    return lambda x, y=24.0: np.mod((32.0 + x + shift, y), SIZE)


# the whole


def moved(model, shift):
    """Places, velocities and headings after some ticks among hills, a rock and a danger, shifted by whole cells."""
    shift, flies = np.array(shift, float), model.flight is not None
    own = brush("own", model.name, 16.0, **GOOSE) if flies else brush("own", model.name, 1.0)
    height = np.roll(HILLS * (0.1 if flies else 1.0), tuple(shift[::-1].astype(int)), axis=(0, 1))
    rock = obstacle(box(33, 25, 36, 27) + shift)
    simulation = on_the_torus(own, brush("stand", mean=0.0), height=height, obstacles=[rock])
    rng = np.random.default_rng(4)
    xy = np.mod(
        (26.0, 22.0) + 3.0 * np.array([(k % 3, k // 3) for k in range(9)]) + rng.uniform(0, 1, (9, 2)) + shift, SIZE
    )
    ground = heights_of_ground(simulation.world.resource(Landscape).heights, xy)
    if flies:
        put_aloft(simulation, np.column_stack([xy, ground + rng.uniform(4, 8, 9)]), (1.0, 0.3, 0.0), species="goose")
    else:
        put(simulation, xy, rng.uniform(0, 1, 9), species="sheep")
        simulation.agents[Position.xyz][:, 2] = ground
    put(simulation, np.mod((38.0, 23.0) + shift, SIZE), np.pi, species="fox" if flies else "wolf", brush="stand")
    simulation.run(12)
    agents = simulation.agents
    xyz = agents[Position.xyz].copy()
    xyz[:, :2] = short_way(xyz[:, :2] - shift - (32.0, 24.0), SIZE)
    return xyz, agents[Velocity.xyz].copy(), agents[Heading.forward].copy()


@pytest.mark.parametrize("model", sorted(behaviours().values(), key=lambda m: m.name), ids=lambda m: m.name)
def test_a_world_that_is_shifted_over_the_border_moves_alike(model):
    here, there = moved(model, (0, 0)), moved(model, (32, 22))
    assert np.ptp(here[0], axis=0).max() > 1.0
    for a, b in zip(here, there, strict=True):
        np.testing.assert_allclose(b, a, rtol=0, atol=1e-9)


# the ground


def test_heights_and_slopes_go_on_over_the_border():
    cell, shift = 1.0, (5, 9)
    relief, rolled = relief_of(HILLS, cell, True), relief_of(np.roll(HILLS, shift, (0, 1)), cell, True)
    np.testing.assert_allclose(np.roll(relief, shift, (0, 1)), rolled, atol=1e-12)
    steep = steepness_of(HILLS, cell, True)[1:, 1:]
    np.testing.assert_allclose(
        np.roll(steep, shift, (0, 1)), steepness_of(np.roll(HILLS, shift, (0, 1)), cell, True)[1:, 1:]
    )
    land = on_the_torus(height=HILLS).world.resource(Landscape)
    xy = np.array([(63.9, 10.2), (0.1, 47.8), (0.0, 0.0), (63.2, 47.2)])
    for image in ((0, 0), (-64, 0), (64, 48)):
        found = heights_of_ground(land.heights, xy + image)
        np.testing.assert_allclose(found, Raster(1.0, HILLS).sample(xy + image, SIZE), atol=1e-12)
        x, y = np.array([(xy - 0.5) % SIZE]).T[..., 0]
        i, k, a, b = x.astype(int), y.astype(int), x % 1, y % 1
        j, m = (i + 1) % 64, (k + 1) % 48
        south, north = HILLS[k, i] * (1 - a) + HILLS[k, j] * a, HILLS[m, i] * (1 - a) + HILLS[m, j] * a
        np.testing.assert_allclose(found, south * (1 - b) + north * b, atol=1e-12)


@pytest.mark.parametrize("model", ["boids", "line_formation"])
@pytest.mark.parametrize("foot", [24.0, 63.0])
def test_birds_foresee_a_slope_beyond_the_border_and_keep_above_it(model, foot):
    simulation = on_the_torus(brush("own", model, 14.0, **GOOSE), height=ends(foot))
    land = simulation.world.resource(Landscape)
    put_aloft(simulation, [(foot - 16, 24, 3.0), (foot - 16, 27, 3.0)], species="goose")
    least = np.inf
    for _ in range(60):
        simulation.run(1)
        xyz = simulation.agents[Position.xyz]
        least = min(least, (xyz[:, 2] - heights_of_ground(land.heights, xyz)).min())
    assert least > 0.5


@pytest.mark.parametrize("shift", [0.0, 32.0])
def test_a_bird_comes_into_no_cliff_on_the_border(shift):
    """The map fits itself nowhere: 30 m in the west, nothing in the east."""
    height = np.roll(np.where(X < 32, 30.0, 0.0), int(shift), axis=1)
    simulation = on_the_torus(brush("own", "line_formation", 14.0, **GOOSE), height=height)
    land, least = simulation.world.resource(Landscape), np.inf
    put_aloft(simulation, [(*seam(shift)(20.0), 10.0)], species="goose")
    for _ in range(64):
        simulation.run(1)
        xyz = simulation.agents[Position.xyz]
        least = min(least, (xyz[:, 2] - heights_of_ground(land.heights, xyz)).min())
    assert least > 0.0


# what is seen


def frightened(simulation, shift, wolf, sheep):
    put(simulation, seam(shift)(sheep), np.pi, species="sheep", brush="stand")
    put(simulation, seam(shift)(wolf), 0.0, species="wolf", brush="stand")
    simulation.run(1)
    return bool(simulation.agents[Alarm.level][0])


@pytest.mark.parametrize("shift", [0.0, 27.0, 32.0, 36.0])
def test_a_hill_hides_a_danger_on_both_sides_of_the_border(shift):
    height = np.roll(np.where(np.abs(X - 32) < 2, 8.0, 0.0), int(shift), axis=1)
    assert frightened(on_the_torus(brush("stand", mean=0.0)), shift, -9.0, 9.0)
    assert not frightened(on_the_torus(brush("stand", mean=0.0), height=height), shift, -9.0, 9.0)


@pytest.mark.parametrize("shift", [0.0, 12.0, 17.0, 44.0])
def test_ground_that_blocks_the_view_hides_as_far_as_anybody_looks(shift):
    """The brush sees 1 m, and so far do edges have copies across the seam."""
    simulation = on_the_torus(brush("stand", mean=0.0, vision={"range": 1.0}))
    land = simulation.world.resource(Landscape)
    land.blind[:] = np.roll(np.abs(X - 32) < 2, int(shift), axis=1)
    land.rebuild()
    assert not frightened(simulation, shift, -14.0, 16.0)
    simulation.world.insert(Programs())
    eyes = WorldSenses(simulation.world, simulation.world.resource(Programs), [])._eyes()
    there = (*seam(shift)(-14.0), 0.0), (*seam(shift)(5.0), 0.0)
    assert [sees_place(eyes, np.array([0]), place, np.array([40.0]))[0] for place in there] == [False, True]


@pytest.mark.parametrize("shift", [0.0, 30.0, 32.0, 33.0])
def test_birds_keep_out_of_animals_across_the_border(shift):
    elephant = brush("stand", mean=0.0, body={"length": 6.0, "radius": 1.5})
    simulation = on_the_torus(brush("own", "boids", 10.0, foresight=2.0, **GOOSE), elephant)
    put_aloft(simulation, (*seam(shift)(-6.0, 24.3), 1.4), species="goose")
    put(simulation, seam(shift)(3.0), np.pi / 2, brush="stand")
    simulation.run(1)
    assert simulation.world.resource(Ahead).hit[0] < 10.0
    for _ in range(40):
        simulation.run(1)
        xyz = simulation.agents[Position.xyz]
        away = np.hypot(*short_way(xyz[0, :2] - xyz[1, :2], SIZE))
        assert away > 3.0 or xyz[0, 2] > 3.0


@pytest.mark.parametrize("shift", [0.0, 22.0])
def test_a_wall_beyond_the_border_is_foreseen_from_farther_than_anybody_sees(shift):
    drive = drives()["avoid_obstacles"].Params(foresight=3.0)
    asset = straight(mean=6.0, vision={"range": 1.0}).model_copy(update={"drives": {"avoid_obstacles": drive}})
    x = seam(shift)(14.0)[0]
    simulation = on_the_torus(asset, obstacles=[obstacle(box(x, 18, x + 1, 29))])
    put(simulation, seam(shift)(0.0), 0.0)
    simulation.run(8)
    assert abs(simulation.agents[Heading.forward][0, 1]) > 0.3


# what is drawn

L = np.array([(-6.0, -5.0), (5.0, -5.0), (5.0, 1.0), (0.0, 1.0), (0.0, 6.0), (-6.0, 6.0)])


def drawn(shift):
    """(rasters, who is in what, crossings) of things in the middle of a map that is shifted; all shifted back."""
    middle = np.array([32.0, 24.0]) + shift
    simulation = on_the_torus(straight(), straight("stand", mean=0.0))
    land, points = simulation.world.resource(Landscape), (L + middle).tolist()
    for command in (
        DrawZone(1, "zone", points, "stand", 2.0, 0.5, 3.0),
        DrawZone(2, "soft", (L + middle + 3.0).tolist(), "stand", edge=2.0, share=True),
        Paint("cap", 1.0, *(middle - (9, 0)), *(middle + (12, 9)), 3.0, 0.5),
        PaintBrush("stand", *(middle + 8), 4.0),
        PlaceExit(3, "exit", points),
        DrawArea(4, "area", points),
        DrawLine(5, "line", (L + middle).tolist()),
    ):
        simulation.submit(command)
    xy = np.mod(np.array([(x, y) for x in np.arange(-8, 8, 1.5) for y in np.arange(-8, 8, 1.5)]) + middle, SIZE)
    put(simulation, xy, 0.0, brush="straight", speed=2.0)
    simulation.tick()
    counts = Counts(simulation)
    for k in range(2):
        simulation.agents[Position.xyz][:, :2] = np.mod(xy[: len(simulation.agents)] + (0.7 * k, 0.0), SIZE)
        counts.take()
    sheet = land.sheets.mixing[0]
    rasters = *land.surface.transpose(2, 0, 1), land.brush, land.transition, sheet.weight, sheet.brush
    rasters = [np.roll(raster, -np.array(shift[::-1]), (0, 1)) for raster in rasters]
    return rasters, in_region("zone", xy, land), counts.values(), len(simulation.agents)


@pytest.mark.parametrize("shift", [(32, 0), (-30, 22), (32, 25)])
def test_what_is_drawn_reaches_over_the_border(shift):
    (here, inside, counts, left), there = drawn((0, 0)), drawn(shift)
    for a, b in zip(here, there[0], strict=True):
        np.testing.assert_allclose(b, a, atol=1e-12)
        assert len(np.unique(a)) > 1
    assert np.array_equal(inside, there[1]) and 0 < inside.sum() < len(inside)
    assert counts == there[2] and min(counts[f"crossed line to its {side}"] for side in ("left", "right")) > 0
    assert left == there[3] < len(inside)


def test_what_reaches_over_the_border_is_found_on_both_sides():
    simulation = on_the_torus(straight())
    simulation.submit(PlaceExit(7, "out", box(-4, 10, 2, 20).tolist()))
    simulation.tick()
    for x in (1.0, 63.0):
        assert [thing.name for _, thing in [area_around(simulation, (x, 15.0), KINDS)]] == ["out"]
    assert [kind for kind, _ in things_at(simulation, [(60.2, 15.0)], 0.5, KINDS)] == ["exit"]  # its edge
    assert area_around(simulation, (32.0, 15.0), KINDS) is None


# where to


@pytest.mark.parametrize("x", [10.0, 55.0])
def test_who_seeks_a_place_takes_the_short_way(x):
    seek = drives()["seek"].Params(what="place", x=2.0, y=24.0)
    simulation = on_the_torus(straight(mean=2.0).model_copy(update={"drives": {"seek": seek}}))
    put(simulation, (x, 24.0), np.pi / 2)
    simulation.run(40)
    assert np.sign(simulation.agents[Velocity.xyz][0, 0]) == (-1 if x < 32 else 1)


@pytest.mark.parametrize("shift", [0.0, 30.0, 32.0, 35.0])
def test_the_foremost_bird_leads_a_new_skein(shift):
    simulation = on_the_torus(brush("own", "line_formation", 14.0, **GOOSE))
    places = [(0.0, 0.0), (-5.0, 2.0), (4.0, -1.0), (-2.0, -4.0)]
    put_aloft(simulation, [(*seam(shift)(x, 24.0 + y), 12.0) for x, y in places], species="goose")
    simulation.run(1)
    assert np.flatnonzero(simulation.agents[FormationPlace.place] == 0).tolist() == [2]

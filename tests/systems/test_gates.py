"""Obstacles that leave the ground and come down again: who passes, undo, and the state of the world."""

import numpy as np
import pytest
from edited_scene import do, land_of, scene, settled
from flockbrush.components import Position
from flockbrush.engine.commands import CommandError
from flockbrush.engine.state import restore, snapshot, state_hash
from flockbrush.systems.commands import AddObstacle, MoveObstacle, RemoveAnimals
from flockbrush.systems.edits import RemoveThing
from flockbrush.systems.landscape import PATIENCE
from flockbrush.systems.obstacle_commands import by_id
from flockbrush.systems.room import in_the_air
from small_herd import box, put

import flockbrush

GATE = box(28, 0, 29, 40).tolist()  # across the whole map
MIDDLE = 28.5, 20.0


def with_gate(z_min):
    simulation = scene()
    do(simulation, AddObstacle("gate", GATE, id=90, z_min=z_min, z_max=z_min + 3.0))
    simulation.run(PATIENCE + 2)
    return simulation


def bars(simulation):
    """Whether the gate stops bodies, and whether the navigation field knows it."""
    land = land_of(simulation)
    land.settle(10**9)
    crossing = (land.solid.ends[:, [0, 2]].min(1) == 28.0) & (land.solid.ends[:, [0, 2]].max(1) == 28.0)
    ways = bool(land.blocked[:, int(28.5 / land.cell)].all())
    assert bool(crossing.any()) == ways
    return ways


@pytest.mark.parametrize("seconds", [0.0, 0.25])
def test_a_raised_gate_lets_pass_and_a_lowered_one_bars(seconds):
    simulation = with_gate(0.0)
    assert bars(simulation)
    do(simulation, MoveObstacle("gate", *MIDDLE, rise=5.0, seconds=seconds))
    simulation.run(12)
    assert not bars(simulation)
    do(simulation, MoveObstacle("gate", *MIDDLE, rise=-5.0, seconds=seconds))
    simulation.run(12)
    assert bars(simulation)


def test_a_gate_that_was_born_high_bars_the_way_of_walkers_once_it_is_down():
    closed, opened = with_gate(0.0), with_gate(5.0)
    assert not bars(opened)
    do(opened, MoveObstacle("gate", *MIDDLE, rise=-5.0))
    opened.run(2)
    assert bars(opened)
    assert np.array_equal(land_of(opened).blocked, land_of(closed).blocked)


def test_who_stands_below_a_gate_that_comes_down_steps_aside():
    simulation = scene()
    do(simulation, AddObstacle("lid", box(9, 8, 13, 16).tolist(), z_min=5.0, z_max=8.0))
    do(simulation, MoveObstacle("lid", 11.0, 12.0, rise=-5.0))
    simulation.run(1)
    xy = simulation.agents[Position.xyz][:, :2]
    inside = ((xy > (9, 8)) & (xy < (13, 16))).all(axis=1)
    assert not inside.any()


def test_undo_puts_a_raised_gate_back_in_its_place_in_the_order():
    simulation = with_gate(0.0)
    do(simulation, AddObstacle("fence", box(35, 0, 36, 20).tolist(), id=91))
    simulation.run(PATIENCE + 2)
    before = settled(simulation)
    back = do(simulation, MoveObstacle("gate", *MIDDLE, rise=5.0))
    simulation.run(1)
    assert [o.name for o in land_of(simulation).overhead] == ["gate"]
    do(simulation, *back)
    assert settled(simulation)[0] == before[0]


def test_a_removed_gate_comes_back_as_high_as_it_was():
    simulation = with_gate(0.0)
    do(simulation, MoveObstacle("gate", *MIDDLE, rise=5.0))
    simulation.run(2)
    before = settled(simulation)[0]
    back = do(simulation, RemoveThing("obstacle", 90))
    do(simulation, *back)
    assert settled(simulation)[0] == before
    assert [o.name for o in land_of(simulation).overhead] == ["gate"]


def test_the_order_of_obstacles_on_and_above_the_ground_survives_a_snapshot():
    simulation = with_gate(5.0)
    do(simulation, AddObstacle("fence", box(35, 0, 36, 20).tolist(), id=91))
    names, kept = [o.name for o in land_of(simulation).obstacles], snapshot(simulation.world)
    assert names == ["barn", "gate", "fence"]
    hashed = state_hash(simulation.world)
    do(simulation, RemoveThing("obstacle", 90))
    restore(simulation.world, kept)
    assert [o.name for o in land_of(simulation).obstacles] == names
    assert state_hash(simulation.world) == hashed


def test_an_edit_may_lift_an_obstacle_and_put_it_down():
    simulation = with_gate(0.0)
    before = settled(simulation)[0]
    back = do(simulation, AddObstacle("gate", GATE, id=90, z_min=4.0, z_max=7.0))
    assert not bars(simulation)
    do(simulation, *back)
    assert bars(simulation)
    assert settled(simulation)[0] == before


def test_an_obstacle_cannot_be_sent_off_the_map():
    simulation = with_gate(0.0)
    with pytest.raises(CommandError, match="not on the map, which is 40 x 40 m"):
        do(simulation, MoveObstacle("gate", -50.0, 15.0))
    assert bars(simulation)


@pytest.mark.parametrize(("rise", "seconds"), [(2.0, 1.5), (3.0, 5.0), (1.1, 1.0)])
def test_a_gate_that_goes_up_and_down_again_is_closed(rise, seconds):
    simulation = with_gate(0.0)
    for way in (rise, -rise):
        do(simulation, MoveObstacle("gate", *MIDDLE, rise=way, seconds=seconds))
        simulation.run(round(32 * seconds) + 2)
    assert bars(simulation)


def test_birds_in_the_air_do_not_step_aside_from_what_is_put_below_them():
    lake = flockbrush.start("lake", agents=20)
    lake.run(64)
    agents, z = lake.agents, lake.agents[Position.xyz][:, 2]
    row = int(np.argmax(z))
    before = agents[Position.xyz].copy()
    x, y = before[row, :2]
    do(lake, AddObstacle("barn", box(x - 5, y - 5, x + 5, y + 5).tolist(), z_max=3.0))
    aloft = in_the_air(lake.world)
    assert z[row] > 10 and aloft[row]
    assert np.array_equal(agents[Position.xyz][aloft], before[aloft])


def test_what_is_on_its_way_goes_on_when_its_removal_is_undone():
    simulation = with_gate(0.0)
    do(simulation, MoveObstacle("gate", 34.0, 20.0, seconds=2.0))
    simulation.run(32)
    back = do(simulation, RemoveThing("obstacle", 90))
    simulation.run(8)
    assert land_of(simulation).glides == []
    do(simulation, *back)
    simulation.run(40)
    assert land_of(simulation).find("gate")[0].polygon.mean(0) == pytest.approx((34.0, 20.0))


def renamed(simulation, name, number=90):
    gate = land_of(simulation).obstacles[by_id(land_of(simulation).obstacles, number)]
    return do(simulation, AddObstacle(name, None, gate.solid, gate.blocks_view, number))


def test_what_is_renamed_on_its_way_goes_on():
    simulation = with_gate(0.0)
    do(simulation, MoveObstacle("gate", 34.0, 20.0, seconds=2.0))
    simulation.run(16)
    back = renamed(simulation, "door")
    simulation.run(16)
    do(simulation, *back)
    assert [glide.name for glide in land_of(simulation).glides] == ["gate"]
    renamed(simulation, "door")
    simulation.run(40)
    assert land_of(simulation).find("door")[0].polygon.mean(0) == pytest.approx((34.0, 20.0))
    assert land_of(simulation).glides == []


@pytest.mark.parametrize("others", ["gate", "fence"])
def test_undo_of_a_name_puts_glides_back(others):
    """Of two that move together one is renamed; one that moves gets the name of one that stands."""
    simulation = with_gate(0.0)
    do(simulation, AddObstacle(others, box(32, 5, 33, 9).tolist(), id=91))
    do(simulation, MoveObstacle("gate", 34.0, 20.0, seconds=2.0))
    simulation.run(16)
    before = settled(simulation)[0]
    back = renamed(simulation, "door" if others == "gate" else "fence")
    assert [glide.name for glide in land_of(simulation).glides] == ["door", "gate"][: 2 * (others == "gate")]
    do(simulation, *back)
    assert settled(simulation)[0] == before


def test_a_thing_of_no_file_is_removed_by_its_name():
    simulation = scene()
    for name in ("one", "other"):
        do(simulation, AddObstacle(name, box(2, 2, 3, 3).tolist()))
    do(simulation, RemoveThing("obstacle", 0, "other"))
    assert [o.name for o in land_of(simulation).obstacles] == ["barn", "one"]


def test_circles_reach_over_the_seam_of_a_periodic_map():
    simulation = scene(boundary="wrap")
    put(simulation, [(1.0, 20.0), (39.5, 20.0), (20.0, 20.0)], 0.0, brush="calm", species="goat")
    before = len(simulation.agents)
    do(simulation, RemoveAnimals(39.0, 20.0, 3.0))
    simulation.run(1)
    assert len(simulation.agents) == before - 2


def test_an_obstacle_over_the_seam_of_a_periodic_map_is_there_on_both_sides():
    simulation = scene(boundary="wrap")
    put(simulation, [(1.0, 20.0), (38.0, 20.0)], 0.0, brush="calm", species="goat")
    do(simulation, AddObstacle("cart", box(37, 18, 42, 22).tolist()))  # of 40 m
    land, xy = land_of(simulation), simulation.agents[Position.xyz][:, :2]
    inside = ((xy[:, 0] > 37) | (xy[:, 0] < 2)) & (abs(xy[:, 1] - 20) < 2)
    assert not inside.any()
    assert land.blocked[int(20 / land.cell), [0, int(1.5 / land.cell), int(38 / land.cell)]].all()
    assert not land.blocked[int(20 / land.cell), int(3.5 / land.cell)]


def test_a_snapshot_that_is_put_back_leaves_obstacles_the_same_objects():
    simulation = with_gate(0.0)
    kept, before = snapshot(simulation.world), list(land_of(simulation).obstacles)
    do(simulation, MoveObstacle("gate", 20.0, 20.0, rise=1.0))
    simulation.run(2)
    restore(simulation.world, kept)
    assert all(now is then for now, then in zip(land_of(simulation).obstacles, before, strict=True))
    assert land_of(simulation).find("gate")[0].polygon.mean(0) == pytest.approx(MIDDLE)


def test_undo_keeps_the_order_of_what_is_on_its_way():
    simulation = with_gate(0.0)
    do(simulation, AddObstacle("fence", box(35, 5, 36, 20).tolist(), id=91))
    do(simulation, MoveObstacle("gate", 31.0, 20.0, seconds=4.0), MoveObstacle("fence", 37.0, 12.5, seconds=4.0))
    before = settled(simulation)[0]
    back = do(simulation, RemoveThing("obstacle", 91))
    do(simulation, *back)
    assert [glide.name for glide in land_of(simulation).glides] == ["fence", "gate"]
    assert settled(simulation)[0] == before


def test_what_joins_a_glide_must_not_leave_the_map_with_it():
    simulation = with_gate(0.0)
    do(simulation, MoveObstacle("gate", 39.0, 20.0, seconds=4.0))
    with pytest.raises(CommandError, match="not on the map"):
        do(simulation, AddObstacle("gate", box(33, 2, 34, 3).tolist()))

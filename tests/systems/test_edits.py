"""What a designer does to a living level: strokes, things, animals, and the way back from each."""

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from edited_scene import CALM, NEW, RUN, SQUARE, do, land_of, nobody_in_walls, scene, settled
from flockbrush.components import Destination, Position
from flockbrush.engine.commands import CommandError, to_json
from flockbrush.levels.schema import Zone
from flockbrush.systems.commands import AddAnimals, AddObstacle, MoveGoal, RemoveAnimals, SendTo, SwitchBrush
from flockbrush.systems.edits import (
    DrawGuide,
    MarkSpawn,
    Paint,
    PlaceExit,
    PlaceGoal,
    RemoveThing,
    UseBrush,
    fill,
    pick,
    region,
)
from flockbrush.systems.landscape import NATIVE, PATIENCE, Landscape
from flockbrush.systems.life import Nursery, inside_polygon
from flockbrush.systems.painting import blended, cells_of, connected, runs_of, stroke_cells
from flockbrush.systems.palette import Palette
from hypothesis import given
from hypothesis import strategies as st
from small_herd import box, gaps_of, meadow, obstacle, put, xy_of

# strokes ------------------------------------------------------------------------------------

place = st.floats(-5, 45)


@given(place, place, place, place, st.floats(0.8, 12))
def test_a_stroke_covers_the_cells_within_its_radius(ax, ay, bx, by, radius):
    iy, ix, weight = stroke_cells((ax, ay), (bx, by), radius, 0.0, (40, 30), 1.0)
    along = np.array([bx - ax, by - ay])
    centres = np.stack(np.meshgrid(np.arange(30) + 0.5, np.arange(40) + 0.5), -1) - (ax, ay)
    t = np.clip(centres @ along / max(along @ along, 1e-300), 0, 1)
    distance = np.hypot(*np.moveaxis(centres - t[..., None] * along, -1, 0))
    sure = np.abs(distance - radius) > 1e-9
    painted = np.zeros((40, 30), bool)
    painted[iy, ix] = True
    assert np.array_equal(painted[sure], (distance <= radius)[sure])
    assert (weight == 1).all()


def test_the_thinnest_stroke_still_paints_the_cell_it_is_on():
    for x, y in ((10.0, 10.0), (10.01, 10.99), (0.0, 0.0), (40.0, 39.99)):
        assert len(stroke_cells((x, y), (x, y), 0.0, 0.0, (40, 40), 1.0)[0]) >= 1


def test_a_soft_stroke_takes_fewer_cells_to_the_rim_and_the_same_ones_when_it_passes_again():
    hard = Paint("brush", "run", 10.0, 10.0, 30.0, 10.0, 6.0)
    soft = Paint("brush", "run", 10.0, 10.0, 30.0, 10.0, 6.0, 1.0)
    whole, some = ({*zip(*c.cells((40, 40), 1.0)[:2], strict=True)} for c in (hard, soft))
    assert some < whole
    near = {(iy, ix) for iy, ix in whole if abs(iy - 9.5) < 1}
    assert len(some & near) / len(near) > 0.75 > 0.6 > len(some) / len(whole)
    simulation, twice = scene(), scene()
    do(simulation, soft)
    do(twice, soft, soft)
    assert np.array_equal(land_of(simulation).brush, land_of(twice).brush)


def test_a_soft_stroke_past_the_corner_of_the_map_is_off_it():
    with pytest.raises(CommandError, match="the stroke is not on the map"):
        do(scene(), Paint("brush", "run", -2.0, -2.0, -2.0, -2.0, 2.5, 0.5))


def test_caps_blend_to_two_digits():
    before = np.array([4.0, 4.0, np.inf, np.inf, 4.0])
    assert blended(before, 1.0, np.array([1.0, 0.25, 0.6, 0.4, 0.0])).tolist() == [1.0, 3.2, 1.0, np.inf, 4.0]
    assert blended(np.array([3.0]), np.inf, np.array([0.7])).tolist() == [np.inf]


@given(st.sets(st.tuples(st.integers(0, 9), st.integers(0, 9)), min_size=1), st.integers(1, 3))
def test_cells_in_words_are_the_cells(cells, kinds):
    iy, ix = np.array(sorted(cells)).T
    index = (iy * 7 + ix) // 4 % kinds
    back = cells_of(runs_of(iy, ix, index))
    assert [a.tolist() for a in back] == [iy.tolist(), ix.tolist(), index.tolist()]


def test_zones_lie_above_paint():
    zone = Zone(5, "yard", box(8, 8, 14, 14), "run", 0.5, 1.0, 0.2)
    simulation = scene(zones=[zone])
    do(simulation, Paint("brush", "calm", 5.0, 10.0, 20.0, 10.0, 2.0), Paint("cap", 3.0, 5.0, 10.0, 20.0, 10.0, 2.0))
    land = land_of(simulation)
    assert land.brush[10, 10] == 1
    assert land.brush[10, 6] == 0
    assert land.surface[10, [6, 10], 1].tolist() == [3.0, 0.5]
    do(simulation, Paint("cap", 0.25, 5.0, 10.0, 20.0, 10.0, 2.0))
    assert land.surface[10, 10, 1] == 0.25


def test_painting_costs_what_it_paints_and_not_what_the_map_is_large():
    def memory(size):
        simulation = meadow(CALM, RUN, width=size, height=size)
        strokes = [Paint(*what, 20.0, 20.0, 24.0, 22.0, 3.0, 0.4) for what in (("brush", "run"), ("cap", 1.5))]
        do(simulation, *strokes)
        tracemalloc.start()
        do(simulation, *strokes)
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return peak

    assert memory(1200) < 1.5 * memory(40) < 200_000  # bytes; a mask of the large map alone would be 1.4 million


def test_what_is_painted_can_be_picked():
    simulation = scene()
    do(simulation, Paint("brush", "run", 10.0, 10.0, 10.0, 10.0, 2.0), Paint("cap", 1.5, 10.0, 10.0, 10.0, 10.0, 2.0))
    do(simulation, Paint("surface", "sand", 10.0, 30.0, 10.0, 30.0, 2.0))
    found = [pick(simulation.world, layer, 10.2, 9.8) for layer in ("brush", "cap", "surface")]
    assert found == ["run", 1.5, ""]
    assert pick(simulation.world, "surface", 10.0, 30.0) == "sand"
    assert [pick(simulation.world, layer, -3.0, 500.0) for layer in ("brush", "cap", "surface")] == ["", 0.0, ""]


def test_a_region_is_filled_to_its_border_and_no_further():
    simulation = scene()
    ring = [(15, 15, 25, 15), (25, 15, 25, 25), (25, 25, 15, 25), (15, 25, 15, 15)]
    do(simulation, *(Paint("brush", "run", *map(float, side), 0.8) for side in ring))
    inside = region(simulation.world, "brush", 20.0, 20.0)
    assert 40 < inside.sum() < 100
    do(simulation, fill(simulation.world, "brush", 20.0, 20.0, "calm"))
    assert (land_of(simulation).brush == 0).sum() == inside.sum()
    assert (land_of(simulation).brush[inside] == 0).all()


def test_a_region_goes_on_over_the_borders_of_a_periodic_map():
    values = np.array([[0, 1, 0, 0], [1, 1, 1, 1], [0, 1, 1, 0], [0, 1, 0, 1], [0, 0, 1, 0]])
    zeros, ones = values == 0, values == 1
    zeros[3, 2] = False  # alone
    assert (connected(values, 4, 3, True) == zeros).all() and connected(values, 4, 3).sum() == 1
    ones[[4, 3], [2, 3]] = False
    assert (connected(values, 3, 1, True) == ones).all()
    assert connected(np.zeros((3, 3)), 1, 1, True).all()


def test_a_fill_goes_on_over_the_border_of_a_map_that_wraps():
    simulation = scene(boundary="wrap")
    do(simulation, Paint("brush", "run", 20.0, 0.0, 20.0, 39.0, 0.4))
    do(simulation, fill(simulation.world, "brush", 5.0, 20.0, "calm"))
    names = [pick(simulation.world, "brush", x, 20.0) for x in (5.0, 20.0, 35.0)]
    assert names == ["calm", "run", "calm"]


def test_who_stands_where_water_is_painted_steps_out_of_it_at_once():
    simulation = scene()
    put(simulation, [(22 + 1.2 * i, 20 + 1.2 * j) for i in range(4) for j in range(4)], 0.4, brush="calm")
    stood = simulation.agents[Position.xyz].copy()
    do(simulation, Paint("surface", "deep water", 18.0, 22.0, 26.0, 22.0, 4.0))
    assert (simulation.agents[Position.xyz] != stood).any()
    nobody_in_walls(simulation)
    for _ in range(40):
        simulation.tick()
        nobody_in_walls(simulation)


def test_slow_ground_slows_and_bare_ground_does_not():
    simulation = scene()
    do(simulation, Paint("surface", "mud", 10.0, 10.0, 30.0, 10.0, 2.0))
    land = land_of(simulation)
    assert land.surface[10, 15, 0] == 0.5
    assert land.cost[10, 15] == 3.0
    do(simulation, Paint("surface", "", 10.0, 10.0, 30.0, 10.0, 2.0))
    assert (land.surface[..., 0] == 1).all()
    assert (land.cost == 1).all()


def test_the_navigation_field_is_made_anew_some_ticks_after_the_last_change():
    simulation = scene()
    land, before = land_of(simulation), land_of(simulation).navigation
    do(simulation, Paint("surface", "cliff", 5.0, 20.0, 20.0, 20.0, 1.5))
    assert land.blocked[20, 10]
    simulation.run(4)
    do(simulation, Paint("surface", "cliff", 20.0, 20.0, 30.0, 20.0, 1.5))
    simulation.run(PATIENCE)
    assert land.navigation is before
    simulation.run(1)
    assert np.isinf(land.navigation.times[0][20, 25])
    assert np.isfinite(before.times[0][20, 25])


def test_a_change_taken_back_in_time_needs_no_new_field():
    simulation = scene()
    before = land_of(simulation).state()
    do(simulation, *do(simulation, Paint("surface", "cliff", 5.0, 20.0, 20.0, 20.0, 1.5)))
    assert land_of(simulation).state() == before
    assert (land_of(simulation).painted.ground == NATIVE).all()


# things ------------------------------------------------------------------------------------------


def test_the_first_goal_binds_everybody_and_goes_without_a_trace():
    simulation = meadow(CALM)
    put(simulation, [(10, 10), (12, 10)])
    back = do(simulation, PlaceGoal(7, "home", 30.0, 30.0))
    assert simulation.agents[Destination.goal].tolist() == [0, 0]
    do(simulation, *back)
    assert simulation.agents[Destination.goal].tolist() == [-1, -1]
    assert land_of(simulation).goals == []


@pytest.mark.parametrize(
    ("command", "names", "then"),
    [
        (RemoveThing("goal", 22), ["gate"], [0, 0, -1, -1, -1]),
        (RemoveThing("goal", 21), ["well"], [0, 0, -1, 0, 0]),  # as in the saved level, where all go to the first
        (PlaceGoal(40, "pen", 20.0, 20.0, at=0), ["pen", "gate", "well"], [0, 0, -1, 2, 2]),
        (PlaceGoal(40, "pen", 20.0, 20.0, at=1), ["gate", "pen", "well"], [0, 0, -1, 2, 2]),
    ],
)
def test_animals_of_the_first_goal_go_to_what_is_first_and_those_of_others_are_free(command, names, then):
    simulation = scene()
    do(simulation, SendTo("well", "dog"), SendTo("", x=20.0, y=10.0, radius=1.0))
    bound = simulation.agents[Destination.goal].tolist()
    assert bound == [0, 0, -1, 1, 1]
    for _ in range(2):
        back = do(simulation, command)
        assert [goal.name for goal in land_of(simulation).goals] == names
        assert simulation.agents[Destination.goal].tolist() == then
        simulation.run(3)
        again = do(simulation, *back)
        assert [goal.name for goal in land_of(simulation).goals] == ["gate", "well"]
        assert simulation.agents[Destination.goal].tolist() == bound
        back = do(simulation, *again)
        assert simulation.agents[Destination.goal].tolist() == then
        do(simulation, *back)


def test_a_goal_that_was_given_an_area_is_a_point_again():
    simulation = scene()
    before = settled(simulation)
    area = do(simulation, PlaceGoal(21, "gate", 20.0, 20.0, 1.0, points=box(18, 18, 22, 22).tolist()))
    moved = do(simulation, MoveGoal("gate", 25.3, 20.7))
    again = do(simulation, *moved, *area)
    assert settled(simulation) == before
    do(simulation, *again)
    assert land_of(simulation).goals[0].polygon.mean(0) == pytest.approx([25.3, 20.7])


def test_a_goal_that_is_an_area_is_in_the_middle_of_it():
    simulation = scene()
    do(simulation, PlaceGoal(21, "gate", None, None, points=[[1.0, 1.0], [7.0, 1.0], [1.0, 7.0]]))
    assert land_of(simulation).goals[0].xy.tolist() == [3.0, 3.0]


def test_goals_lead_to_one_another_by_name():
    simulation = scene()
    do(simulation, PlaceGoal(30, "pen", 20.0, 30.0, 1.0, "next", "well"))
    assert [goal.next_index for goal in land_of(simulation).goals] == [-1, -1, 1]
    do(simulation, RemoveThing("goal", 21))
    assert [goal.next_index for goal in land_of(simulation).goals] == [-1, 0]


def test_a_guide_is_drawn_reshaped_and_taken_away():
    simulation = scene()
    land = land_of(simulation)
    do(simulation, DrawGuide(40, "way", [[5.0, 20.0], [35.0, 20.0]], radius=3.0, decay=1.0))
    assert land.navigation.guidance[20, 20].tolist() == pytest.approx([1.0, 0.0])
    do(simulation, DrawGuide(40, "way", [[35.0, 20.0], [5.0, 20.0]], radius=3.0, decay=1.0))
    assert len(land.guides) == 1
    assert land.navigation.guidance[20, 20].tolist() == pytest.approx([-1.0, 0.0])
    do(simulation, RemoveThing("guide", 40))
    assert not land.navigation.guidance.any()


def test_what_hangs_over_the_ground_is_taken_away_by_its_id_and_comes_back():
    simulation = scene()
    land = simulation.world.resource(Landscape)
    do(simulation, AddObstacle("beam", SQUARE, id=50, z_min=5.0, z_max=6.0))
    assert [b.name for b in land.overhead] == ["beam"]
    back = do(simulation, RemoveThing("obstacle", 50))
    assert land.overhead == []
    for command in back:
        command.apply(simulation.world)
    assert [(b.name, b.z_min) for b in land.overhead] == [("beam", 5.0)]


def test_obstacles_on_the_ground_and_above_it_have_the_order_of_the_level():
    cloud = replace(obstacle(box(3, 3, 6, 6), "cloud"), z_min=3.0, z_max=5.0)
    edited = meadow(CALM, obstacles=[cloud])
    do(edited, AddObstacle("stone", box(9, 9, 12, 12).tolist(), id=30))
    built = meadow(CALM, obstacles=[cloud, obstacle(box(9, 9, 12, 12), "stone")])
    assert [[thing.name for thing in land_of(each).obstacles] for each in (edited, built)] == [["cloud", "stone"]] * 2


def test_animals_leave_by_an_exit_drawn_in_mid_run():
    simulation = scene()
    do(simulation, PlaceExit(41, "out", box(9, 9, 13, 11).tolist()))
    simulation.run(2)
    assert len(simulation.agents) == 3


def test_a_spawn_brings_its_animals_when_it_is_drawn_and_only_the_missing_when_it_grows():
    simulation = scene()
    simulation.run(5)
    back = do(simulation, MarkSpawn(42, "pen", box(20, 14, 30, 22).tolist(), "run", "goat", 6))
    assert len(simulation.agents) == 11
    more = do(simulation, MarkSpawn(42, "pen", box(20, 14, 30, 22).tolist(), "run", "goat", 8))
    assert len(simulation.agents) == 13
    simulation.run(10)
    assert len(simulation.agents) == 13
    do(simulation, *more)
    assert len(simulation.agents) == 11
    do(simulation, *back)
    assert simulation.agents.ids.tolist() == [1, 2, 3, 4, 5]
    assert simulation.world.resource(Nursery).find(42) is None


def test_a_spawn_with_a_rate_counts_from_when_it_was_drawn():
    simulation = scene()
    simulation.run(64)
    do(simulation, MarkSpawn(42, "gate", box(20, 14, 30, 22).tolist(), "calm", count=9, rate=4.0, start=1.0))
    simulation.run(31)
    assert len(simulation.agents) == 5
    simulation.run(17)
    assert len(simulation.agents) == 5 + 3
    simulation.run(200)
    assert len(simulation.agents) == 5 + 9


def test_a_brush_is_brought_into_the_world_and_forgotten_again():
    simulation = scene()
    before = settled(simulation)
    back = do(simulation, UseBrush("new", NEW), Paint("brush", "new", 10.0, 10.0, 12.0, 10.0, 3.0))
    assert simulation.world.resource(Palette).names == ["calm", "run", "new"]
    assert land_of(simulation).reach >= 9.0
    land_of(simulation).reach = 4.0  # how far the edges are sorted is no thing of the designer's
    do(simulation, *back)
    land_of(simulation).reach = 4.0
    land_of(simulation).rebuild()
    assert settled(simulation) == before


def test_a_brush_somebody_still_has_is_not_forgotten():
    simulation = scene()
    back = do(simulation, UseBrush("new", NEW))
    do(simulation, SwitchBrush("new", "dog"))
    do(simulation, *back)
    assert "new" in simulation.world.resource(Palette).names


# animals ---------------------------------------------------------------------------------------------


def columns_of(simulation):
    return {repr(f): simulation.agents[f].tobytes() for f in simulation.agents.arrays} | {
        "ids": simulation.agents.ids.tolist()
    }


def crowd():
    simulation = scene()
    do(simulation, AddAnimals("run", 20.0, 20.0, 6.0, 60))
    simulation.run(20)
    return simulation


def test_animals_taken_away_come_back_as_they_were():
    simulation = crowd()
    before = columns_of(simulation)
    back = do(simulation, RemoveAnimals(20.0, 20.0, 4.0))
    assert len(simulation.agents) < 50
    assert len(to_json(back[0])) < 30_000
    do(simulation, *back)
    assert columns_of(simulation) == before


def test_animals_added_go_again_and_nobody_else():
    simulation = crowd()
    before = columns_of(simulation)
    back = do(simulation, AddAnimals("calm", 8.0, 28.0, 4.0, 10))
    do(simulation, *back)
    assert columns_of(simulation) == before


def test_who_finds_another_in_its_place_stands_beside_it():
    simulation = scene()
    back = do(simulation, RemoveAnimals(10.0, 10.0, 1.0))
    put(simulation, [(10.1, 10.0)], 1.0, brush="calm")
    do(simulation, AddObstacle("rock", box(9, 10.3, 10, 11).tolist()))
    do(simulation, *back)
    assert simulation.agents.ids.tolist() == [1, 2, 3, 4, 5, 6]
    assert gaps_of(simulation).min() > -1e-6
    assert not inside_polygon(xy_of(simulation), box(9, 10.3, 10, 11)).any()
    simulation.run(5)

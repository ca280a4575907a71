"""Whom paint binds: by species, medium and height; and nobody stands in the air."""

import numpy as np
import pytest
from flockbrush.behaviours.brush import shipped
from flockbrush.components import BrushBinding, Heading, Position, Species, Transit, Velocity
from flockbrush.components.agent import LANDING, SETTLED, TAKING_OFF
from flockbrush.engine.commands import CommandError, Commands
from flockbrush.engine.state import state_hash
from flockbrush.levels.build import build
from flockbrush.levels.schema import BrushLayer, PaintBounds, Zone
from flockbrush.systems.binding import binds_nobody
from flockbrush.systems.commands import AddAnimals, PaintBrush, SwitchBrush
from flockbrush.systems.fauna import SpeciesList
from flockbrush.systems.palette import Palette
from flockbrush.systems.undo import GiveBrush
from small_herd import boids, box, brush, level, meadow, put, put_aloft, spawn

from flockbrush.runs.run import start


def painted(name, weight=1.0, bounds=None, west=0):
    index = np.full((40, 40), -1)
    index[:, west:] = 0
    return BrushLayer("brush", weight, [name], index, bounds or PaintBounds())


def made(name, model="herd", made_for=(), **more):
    return brush(name, model, **more).model_copy(update={"made_for": made_for})


GOOSE = {"mean": 20.0, "body": {"length": 0.8, "radius": 0.16, "contact": "disc"}}


def world(*layers, zones=(), more=()):
    brushes = (
        made("walk"), made("graze", made_for=("grazer",), mean=0.3), made("hunt", "hunt", made_for=("hunter",)),
        made("fly", "line_formation", **GOOSE), made("flock", "boids", **GOOSE, min_speed=5.0), *more,
    )  # fmt: skip
    return meadow(*brushes, brush_layers=list(layers), zones=list(zones))


def brush_of(simulation, entity):
    agents = simulation.agents
    return simulation.world.resource(Palette).names[agents[BrushBinding.brush][agents.row(entity)]]


def test_paint_binds_those_its_brush_is_made_for():
    simulation = world(painted("graze"))
    (wolf,) = put(simulation, (5, 5), species="wolf", brush="hunt")
    (sheep,) = put(simulation, (35, 35), species="sheep", brush="walk")
    (unknown,) = put(simulation, (5, 35), species="unheard-of", brush="walk")
    simulation.run(2)
    assert [brush_of(simulation, one) for one in (wolf, sheep, unknown)] == ["hunt", "graze", "graze"]


@pytest.mark.parametrize("blend", ["cover", "share"])
def test_beyond_the_border_of_an_open_map_nobody_is_painted(blend):
    simulation = world(painted("graze", bounds=PaintBounds(blend=blend), west=30))
    sheep = put(simulation, [(38, 20), (42, 20), (400, 20), (38, 44)], species="sheep", brush="walk")
    simulation.run(2)
    assert [brush_of(simulation, one) for one in sheep] == ["graze", "walk", "walk", "walk"]


@pytest.mark.parametrize(
    ("brush", "species", "why"),
    [
        ("graze", "sheep", ""),
        ("graze", "wolf", "it is made for grazer, and they are wolf"),
        ("fly", "sheep", "species 'sheep' cannot use brush 'fly', which flies: its media are walk"),
        ("fly", "goose", ""),
        ("walk", "goose", "now: it walks or swims, and they are in the air"),
    ],
)
def test_why_paint_of_a_brush_binds_nobody_is_said(brush, species, why):
    simulation = world(painted(brush))
    if species == "goose":
        put_aloft(simulation, (5, 5, 20), species=species, brush="flock")
    else:
        put(simulation, (5, 5), species=species, brush="walk")
    agents, palette, fauna = simulation.agents, *map(simulation.world.resource, (Palette, SpeciesList))
    before = agents[BrushBinding.brush].copy()
    said = binds_nobody(palette, fauna, brush, agents[Species.index], palette.flies_free[before])
    assert why in said and bool(why) == said.startswith(f"Paint of {brush} binds none")
    simulation.run(2)
    assert (agents[BrushBinding.brush] == before).all() == bool(why)
    assert binds_nobody(palette, fauna, brush, agents[Species.index][:0], before[:0] > 0) == ""


def test_hunters_are_bound_by_paint_made_for_hunters_and_prey_by_the_layer_below():
    simulation = world(painted("graze"), painted("hunt", west=20))
    (wolf,) = put(simulation, (35, 5), species="wolf", brush="walk")
    (sheep,) = put(simulation, (35, 35), species="sheep", brush="walk")
    simulation.run(1)
    assert [brush_of(simulation, one) for one in (wolf, sheep)] == ["hunt", "graze"]


def test_a_layer_may_say_whom_it_binds_and_a_zone_below_which_height():
    simulation = world(
        painted("graze", bounds=PaintBounds(species=("wolf", "ant"))),
        zones=[Zone(1, "low", box(0, 0, 40, 40), "flock", np.inf, 1.0, 0.5, bounds=PaintBounds(z_max=10.0))],
    )
    (wolf,) = put(simulation, (5, 5), species="wolf", brush="hunt")
    (sheep,) = put(simulation, (35, 35), species="sheep", brush="walk")
    (high, low) = put_aloft(simulation, [(20, 20, 15), (20, 10, 5)], species="goose", brush="fly")
    simulation.run(1)
    assert [brush_of(simulation, one) for one in (wolf, sheep, high, low)] == ["graze", "walk", "fly", "flock"]


@pytest.mark.parametrize("model", ["fly", "flock"])
def test_ground_paint_stops_no_bird_in_mid_air(model):
    simulation = world(painted("graze"))
    (bird,) = put_aloft(simulation, (2.0, 20.0, 31.0), species="goose", brush=model)
    simulation.run(32)
    assert brush_of(simulation, bird) == model
    assert np.linalg.norm(simulation.agents[Velocity.xyz][0]) > 8.0


def test_air_paint_makes_no_sheep_and_no_walking_goose_fly():
    simulation = world(painted("flock"))
    (sheep,) = put(simulation, (5, 5), species="sheep", brush="walk")
    (goose,) = put(simulation, (20, 20), species="goose", brush="walk")
    simulation.run(4)
    assert [brush_of(simulation, one) for one in (sheep, goose)] == ["walk", "walk"]


@pytest.mark.parametrize("model", ["fly", "flock"])
def test_a_goose_that_is_told_to_graze_lands_and_one_that_is_told_to_fly_takes_off(model):
    simulation = world()
    (bird,) = put_aloft(simulation, (-200.0, 20.0, 31.0), species="goose", brush=model)
    simulation.run(16)
    simulation.submit(SwitchBrush("graze"))
    before = simulation.agents[Velocity.xyz][0].copy()
    heights = []
    while brush_of(simulation, bird) == model:
        simulation.tick()
        now = simulation.agents[Velocity.xyz][0].copy()
        assert np.linalg.norm(now - before) * 32 <= 12.0 + 10.0  # the goose's own, and weight and lift
        heights.append(simulation.agents[Position.xyz][0, 2])
        assert np.linalg.norm(now) > 0.5 or heights[-1] < 1.0  # nobody hovers
        before = now
        assert len(heights) < 32 * 30
    assert (np.diff(heights) < 0.05).all()
    assert len(heights) * 3.0 / 32 > 25.0  # it does not fall faster than a goose sinks
    simulation.run(96)
    agents = simulation.agents
    assert agents[Position.xyz][0, 2] == 0.0
    assert agents[Transit.kind][0] == SETTLED
    assert np.linalg.norm(agents[Velocity.xyz][0]) < 1.0
    simulation.submit(SwitchBrush(model), simulation.clock.tick)
    simulation.tick()
    assert agents[Transit.kind][0] == TAKING_OFF
    simulation.run(32 * 25)
    assert simulation.agents[Position.xyz][0, 2] > 30.0
    assert agents[Transit.kind][0] == SETTLED
    assert np.linalg.norm(agents[Velocity.xyz][0]) > 9.0


def test_a_landing_can_be_broken_off():
    simulation = world()
    (bird,) = put_aloft(simulation, (-200.0, 20.0, 31.0), species="goose", brush="flock")
    simulation.submit(SwitchBrush("graze"))
    simulation.run(16)
    assert simulation.agents[Transit.kind][0] == LANDING
    simulation.submit(SwitchBrush("flock"), simulation.clock.tick)
    simulation.run(2)
    assert simulation.agents[Transit.kind][0] == SETTLED
    assert brush_of(simulation, bird) == "flock"


def test_who_cannot_is_refused_by_species_and_brush():
    simulation = world()
    put(simulation, [(5, 5), (9, 9)], species="sheep", brush="walk")
    sentence = "species 'sheep' cannot use brush 'flock', which flies: its media are walk"
    for command in (SwitchBrush("flock"), SwitchBrush("flock", "sheep"), GiveBrush("flock", [1]),
                    AddAnimals("flock", 20.0, 20.0, 3.0, 1, "sheep")):  # fmt: skip
        with pytest.raises(CommandError, match=sentence):
            simulation.world.resource(Commands).perform(simulation.world, [command])
    simulation.run(2)
    assert brush_of(simulation, 1) == "walk"


def test_of_many_only_those_who_can_take_the_brush():
    simulation = world()
    (sheep,) = put(simulation, (5, 5), species="sheep", brush="walk")
    (goose,) = put(simulation, (20, 20), species="goose", brush="walk")
    simulation.submit(SwitchBrush("flock"))
    simulation.run(2)
    assert [brush_of(simulation, one) for one in (sheep, goose)] == ["walk", "flock"]


def test_birds_that_are_put_down_on_the_ground_take_off():
    geese = shipped().get("geese")
    ground = level(spawns=[spawn(box(10, 10, 30, 30), "geese", 5, species="goose")])

    class Shelf:
        def get(self, name):
            return geese

    simulation = build(ground, library=Shelf())
    assert not simulation.agents[Velocity.xyz].any()
    simulation.run(32 * 20)
    assert (simulation.agents[Position.xyz][:, 2] > 20.0).all()


def test_who_walks_does_not_stand_in_the_air():
    simulation = world()
    put(simulation, (20, 20), species="sheep", brush="walk")
    simulation.agents[Position.xyz][0, 2] = 5.0
    simulation.run(128)
    assert simulation.agents[Position.xyz][0, 2] == pytest.approx(0.0, abs=1e-6)


def test_wolves_on_painted_meadow_stay_wolves():
    simulation = start("meadow", seed=7)
    simulation.world.resource(Palette).add(shipped().get("wolf-hunt"))
    simulation.submit(PaintBrush("graze", 60.0, 40.0, 500.0))
    simulation.submit(AddAnimals("wolf-hunt", 60.0, 40.0, 6.0, 3, "wolf"), 1)
    simulation.run(16)
    agents, names = simulation.agents, simulation.world.resource(Palette).names
    assert [names[k] for k in agents[BrushBinding.brush][-3:]] == ["wolf-hunt"] * 3
    assert {names[k] for k in agents[BrushBinding.brush][:140]} == {"graze"}


def test_paint_bounded_in_height_lets_birds_pass_above_and_makes_those_below_land_once():
    low = PaintBounds(medium="any", z_max=15.0)
    simulation = world(painted("graze", bounds=low))
    (high, under) = put_aloft(simulation, [(20, 20, 31), (20, 10, 10)], species="goose", brush="flock")
    took = []
    for _ in range(32 * 12):
        simulation.tick()
        x = simulation.agents[Position.xyz]
        x[:, :2] = [(20, 20), (20, 10)]  # held over the paint: the map is small and geese are fast
        took.append([brush_of(simulation, one) for one in (high, under)])
    assert {names[0] for names in took} == {"flock"}
    changes = [k for k in range(1, len(took)) if took[k][1] != took[k - 1][1]]
    assert len(changes) == 1 and took[-1][1] == "graze"  # it lands, and stays


def test_a_switch_under_bounded_paint_is_undone():
    simulation = world(painted("graze", bounds=PaintBounds(medium="any", z_max=15.0)))
    (sheep,) = put(simulation, (5, 5), species="sheep", brush="walk")
    simulation.run(2)
    before = state_hash(simulation.world)
    commands = simulation.world.resource(Commands)
    back = commands.perform(simulation.world, [SwitchBrush("hunt")])
    assert brush_of(simulation, sheep) == "graze"  # paint stands above the animal's own brush
    commands.perform(simulation.world, back)
    assert state_hash(simulation.world) == before


def test_a_bird_that_dives_to_land_turns_no_faster_than_it_can():
    simulation = meadow(boids(min_speed=0.0), brush("walk"))
    put_aloft(simulation, (20, 20, 15), (0.25, 0.0, -0.97), species="starling", brush="boids")
    agents, flying = simulation.agents, []
    agents[Velocity.xyz][:] = (0.0, 0.0, -8.0)
    simulation.submit(SwitchBrush("walk"))
    most = simulation.world.resource(SpeciesList).table.turn[agents[Species.index][0]].max() / 32
    for _ in range(400):
        simulation.tick()
        if agents[Transit.kind][0] == LANDING:
            flying.append(agents[Heading.forward][0].copy())
    flying = np.array(flying)
    turns = np.arccos(np.clip((flying[1:] * flying[:-1]).sum(axis=1), -1.0, 1.0))
    assert turns.max() < most + 1e-6 and np.hypot(*flying[:, :2].T).min() < 0.21  # it has pointed steeply down
    assert agents[Transit.kind][0] == SETTLED and agents[Heading.forward][0, 2] == agents[Position.xyz][0, 2] == 0.0

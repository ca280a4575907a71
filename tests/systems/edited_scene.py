"""A small scene that is edited while it lives."""

import numpy as np
from flockbrush.behaviours.brush_writer import brush_to_toml
from flockbrush.components import Body, BrushBinding, Destination, Position
from flockbrush.engine.commands import Commands
from flockbrush.levels.schema import Goal
from flockbrush.systems.landscape import Landscape
from flockbrush.systems.life import Nursery
from flockbrush.systems.palette import Palette
from flockbrush.systems.spawning import touching
from small_herd import box, brush, gaps_of, meadow, obstacle, put, straight, xy_of

CALM, RUN = straight("calm", mean=0.0), brush("run", mean=2.0)
NEW = brush_to_toml(brush("new", vision={"range": 9.0}))
SQUARE = box(12, 20, 15, 23).tolist()


def scene(boundary="wall", **things):
    goals = [
        Goal(21, "gate", np.array([35.0, 5.0]), 1.0, "stay", ""),
        Goal(22, "well", np.array([5.0, 35.0]), 1.0, "stay", ""),
    ]
    barn = obstacle(box(30, 30, 33, 33), "barn")
    barn.id = 20
    simulation = meadow(CALM, RUN, boundary=boundary, goals=goals, obstacles=[barn], **things)
    put(simulation, [(10, 10), (12, 10), (20, 10)], 0.0, brush="calm", species="sheep")
    put(simulation, [(10, 14), (25, 25)], 0.0, brush="run", species="dog")
    return simulation


def land_of(simulation):
    return simulation.world.resource(Landscape)


def do(simulation, *commands):
    """What takes them back."""
    return simulation.world.resource(Commands).perform(simulation.world, commands)


def settled(simulation):
    """Everything a designer can change, once the navigation field is up to date; animals by who and whose they are."""
    world = simulation.world
    land = land_of(simulation)
    land.settle(10**9)
    agents = world.agents
    columns = [agents[f].tobytes() for f in (BrushBinding.home, Destination.goal)]
    return [
        land.state(),
        world.resource(Nursery).state(),
        world.resource(Palette).state(),
        agents.ids.tolist(),
        *columns,
    ]


def nobody_in_walls(simulation):
    land, agents = land_of(simulation), simulation.agents
    xy = xy_of(simulation)
    assert land.walkable[land_cells(land, xy)].all()
    edges = np.ascontiguousarray(land.solid.ends)
    thin = agents[Body.radius] - 1e-6
    assert not touching(agents[Position.xyz], forward(agents), agents[Body.axis], thin, edges).any()
    assert gaps_of(simulation).min(initial=0) > -1e-6


def forward(agents):
    from flockbrush.components import Heading

    return agents[Heading.forward]


def land_cells(land, xy):
    at = np.clip((xy / land.cell).astype(int), 0, np.array(land.brush.shape)[::-1] - 1)
    return at[:, 1], at[:, 0]

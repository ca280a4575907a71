"""The smallest world that has everything the engine knows: a few animals, noise, births, deaths, commands."""

import numpy as np
from flockbrush.components.agent import AGENT, Heading, Position, Velocity
from flockbrush.engine.clock import Clock
from flockbrush.engine.commands import Commands, command
from flockbrush.engine.noise import Noise
from flockbrush.engine.schedule import Schedule, Stage, System
from flockbrush.engine.world import World


class Births:
    """How many lambs there have been."""

    def __init__(self):
        self.count = 0

    def state(self):
        return str(self.count).encode()

    def set_state(self, data):
        self.count = int(data)


@command
class Whistle:
    """Everybody jumps to the east."""

    metres: float
    words: list | None = None

    def apply(self, world):
        world.agents[Position.xyz][:, 0] += self.metres


class Obey(System):
    stage, writes = Stage.COMMANDS, (Commands, Position)

    def process(self, world):
        world.resource(Commands).apply(world)


class Wander(System):
    stage, reads, writes = Stage.MOVE, (Noise, Clock, Velocity), (Position, Velocity)

    def process(self, world):
        agents, clock = world.agents, world.resource(Clock)
        agents[Velocity.xyz][:] += world.resource(Noise).normal("wander", clock.tick, agents.ids, 3)
        agents[Position.xyz][:] += agents[Velocity.xyz] * clock.dt


class Multiply(System):
    """Every fourth tick one dies and two are born beside the youngest."""

    stage, reads, writes = Stage.LIVE, (Position, Clock), (Births,)

    def process(self, world):
        if world.resource(Clock).tick % 4 == 3 and len(world.agents):
            world.delete_entity(int(world.agents.ids[0]))
            world.resource(Births).count += 2
            world.create_agents(2, {Position.xyz: world.agents[Position.xyz][-1] + 1})


def meadow(animals=5, seed=3):
    """(world, step) of a meadow."""
    world = World(AGENT)
    for resource in (Clock(), Noise(seed), Commands(), Births()):
        world.insert(resource)
    xy = np.arange(3.0 * animals).reshape(animals, 3)
    world.create_agents(animals, {Position.xyz: xy, Heading.forward: (0, 1, 0)})
    schedule = Schedule([Multiply(), Wander(), Obey()])

    def step():
        schedule.run(world)
        world.resource(Clock).tick += 1

    return world, step


def submit(world, cmd, tick=0):
    world.resource(Commands).submit(cmd, tick)

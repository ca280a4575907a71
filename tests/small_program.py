"""Animals at places one can draw, each in a program of two states, for tests of triggers."""

import numpy as np
from flockbrush.behaviours.brush import BrushLibrary, shipped
from flockbrush.behaviours.program import load_program
from flockbrush.components import Body, BrushBinding, Heading, Position, ProgramState, Speed, Velocity
from flockbrush.levels.build import build
from flockbrush.levels.schema import Area, Goal, Level, Obstacle, Spawn, Zone
from flockbrush.systems.programs import enrol

SIZE = 200.0  # m


def program(text, name="small"):
    """A program from its text without the first line."""
    return load_program(f'schema = "flockbrush.program/1"\n{text}'.encode(), f"{name}.program.toml")


def two_states(when, more=""):
    """Animals are calm until the condition holds."""
    return program(f'[state.calm]\n{more}\n[state.moved]\n[[trigger]]\nfrom = "calm"\nto = "moved"\nwhen = {when}\n')


def box(west, south, east, north):
    """A rectangle."""
    return np.array([(west, south), (east, south), (east, north), (west, north)], float)


def still(name, **changes):
    """A shipped brush whose animals stand still."""
    brush = shipped().get(name)
    speed = brush.speed.model_copy(update={"mean": 0.0, "deviation": 0.0})
    return brush.model_copy(update={"speed": speed, **changes})


def world(prog, places, species="sheep", brush="graze", changes=None, level=None, relief=None, **things):
    """A level with one animal at each place, (x, y) or (x, y, z), in m from its middle; all stand still, facing east.

    ``species`` and ``brush`` are one for all or one for each; ``things`` are goals, zones, areas, obstacles.
    Only sheep follow the program.
    """
    n = len(places)
    kinds = [species] * n if isinstance(species, str) else species
    names = [brush] * n if isinstance(brush, str) else brush
    library = BrushLibrary(
        files={f"{b}.brush.toml": still(b, **(changes or {})).source for b in {*names, *prog.brushes}}
    )
    spawns = []
    for k, (kind, name) in enumerate(zip(kinds, names, strict=True)):
        corner = 10.0 + 6.0 * k  # born on a diagonal, and put in its place at once
        follows = prog.name if kind == "sheep" else ""
        spawns.append(
            Spawn(k + 1, "", box(corner, corner, corner + 5, corner + 5), kind, name, 1, 0.0, 0.0,
                  program=follows)
        )  # fmt: skip
    whole = Level(
        "small", None, SIZE, SIZE, 4.0, "open", 1, height_map=relief, spawns=spawns, programs={prog.name: prog}
    )
    for name, value in {**things, **(level or {})}.items():
        setattr(whole, name, value)
    simulation = build(whole, library=library)
    put(simulation, places)
    entities = [k + 1 for k, kind in enumerate(kinds) if kind == "sheep"]
    enrol(simulation.world, entities, prog.name)
    return simulation


def put(simulation, places):
    """Have the animals stand at these places, facing east."""
    agents = simulation.agents
    xyz = np.array([(*place, 0.0)[:3] for place in places], float)
    agents[Position.xyz][:] = xyz + (SIZE / 2, SIZE / 2, 0.0)
    agents[Heading.forward][:] = (1.0, 0.0, 0.0)
    agents[Velocity.xyz][:] = 0.0
    agents[Speed.drawn][:] = 0.0
    agents[Speed.target][:] = 0.0
    agents[Body.length][:] = 1.0  # whatever their species


def at(x, y):
    """A place as the level has it."""
    return np.array([x + SIZE / 2, y + SIZE / 2])


def region(west, south, east, north):
    """A rectangle as the level has it, from places in m from its middle."""
    return box(west, south, east, north) + SIZE / 2


def area(name, *sides):
    return Area(900, name, region(*sides))


def zone(name, *sides, **told):
    return Zone(901, name, region(*sides), None, np.inf, 1.0, 0.5, **told)


def goal(name, x, y, radius=2.0):
    return Goal(902, name, at(x, y), radius, "stay", "")


def wall(*sides):
    return Obstacle(903, "wall", region(*sides), True, True, 0.0, 0.0, 3.0, "box")


def moved(simulation, ticks=1):
    """Whether each animal has left its first state after so many ticks."""
    simulation.run(ticks)
    return (simulation.agents[ProgramState.state] == 1).tolist()


def states(simulation):
    """The state of each animal by name; None for one without a program."""
    from flockbrush.systems.programs import Programs

    programs, agents = simulation.world.resource(Programs), simulation.agents
    pairs = zip(agents[ProgramState.program].tolist(), agents[ProgramState.state].tolist(), strict=True)
    return [None if p < 0 else programs.compiled[p].names[s] for p, s in pairs]


def brushes(simulation):
    """The brush that moves each animal."""
    from flockbrush.systems.palette import Palette

    names = simulation.world.resource(Palette).names
    return [names[k] for k in simulation.agents[BrushBinding.brush].tolist()]

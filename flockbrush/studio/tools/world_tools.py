"""What tools ask of the world: which things there are, and which of them lies where."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from flockbrush.components import Body, Position
from flockbrush.engine.seam import images
from flockbrush.levels.geometry import distance_to_line, inside, sign_of
from flockbrush.studio.outlines import rows
from flockbrush.systems.edits import as_command
from flockbrush.systems.landscape import Landscape
from flockbrush.systems.life import Nursery

KINDS = ("goal", "guide", "obstacle", "exit", "spawn", "line", "zone", "area", "key")  # of things one can take hold of
SPOKEN = {  # where it is not the kind itself
    "spawn": "spawn area",
    "line": "counting line",
    "area": "measured area",
    "key": "script key",
}


def things(simulation) -> list[tuple[str, object]]:
    """(kind, thing) of all that a designer drew, but for paint; the first are drawn below the last."""
    land = simulation.world.resource(Landscape)
    nursery = simulation.world.resource(Nursery)
    result: list[tuple[str, object]] = [("zone", thing) for thing in land.marks.zones]
    result += [("spawn", spawn) for spawn in nursery.spawns if hasattr(spawn, "polygon")]
    result += [("area", thing) for thing in land.marks.areas]
    result += [("exit", thing) for thing in land.exits if hasattr(thing, "polygon")]
    result += [("obstacle", thing) for thing in land.obstacles]
    result += [("guide", thing) for thing in land.guides]
    result += [("goal", thing) for thing in land.goals]
    result += [("line", thing) for thing in land.marks.lines]
    result += [("key", thing) for thing in land.marks.keys]
    return result


def touches(kind, thing, xy, reach) -> bool:
    """Whether a point of the ground lies on a thing, or not farther from it than so many metres."""
    if kind in ("guide", "line"):
        return bool(distance_to_line(xy, thing.points, getattr(thing, "loop", False))[0] <= reach)
    if kind in ("goal", "key"):
        near = bool(np.hypot(*(sign_of(thing) - xy)) <= max(reach, 0.25 * getattr(thing, "radius", 0.0)))
        if near or getattr(thing, "polygon", None) is None:
            return near
    edge = distance_to_line(xy, thing.polygon, True)[0] <= reach
    if kind == "obstacle":
        return bool(edge or inside([xy], thing.polygon)[0])
    return bool(
        edge
    )  # an exit, a zone, an area to spawn or to measure is a large place where other things may be meant


def _places(simulation, xy):
    """(k, 2) m: a point of the ground, and where it lies for things that reach over the border of a periodic map."""
    return np.asarray(xy, float) + images([xy], simulation.world.resource(Landscape).wrap, np.inf)


def things_at(simulation, places, reach, kinds) -> list[tuple[str, object]]:
    """Things under any of some points of the ground, topmost first, each once."""
    places = [there for xy in places for there in _places(simulation, xy)]
    return [
        (kind, thing)
        for kind, thing in reversed(things(simulation))
        if kind in kinds and any(touches(kind, thing, xy, reach) for xy in places)
    ]


def area_around(simulation, xy, kinds):
    """(kind, object) of the smallest area that a point of the ground lies in, or None."""
    of_kinds = [(kind, thing) for kind, thing in things(simulation) if kind in kinds]
    areas = [(kind, thing) for kind, thing in of_kinds if getattr(thing, "polygon", None) is not None]
    around = [(kind, thing) for kind, thing in areas if inside(_places(simulation, xy), thing.polygon).any()]
    return min(around, key=lambda one: float(np.prod(np.ptp(np.asarray(one[1].polygon), axis=0))), default=None)


def animal_at(simulation, xy, reach):
    """Id of the animal nearest to a point, or None when none is within so many metres of it."""
    agents = simulation.agents
    if not len(agents):
        return None
    away = np.hypot(*(agents[Position.xyz][:, :2] - xy).T) - 0.5 * agents[Body.length]
    nearest = int(np.argmin(away))
    return int(agents.ids[nearest]) if away[nearest] <= reach else None


def outline(kind, thing):
    """Points (k, 2) m around a thing, and whether they close."""
    if kind in ("guide", "line"):
        return np.asarray(thing.points), bool(getattr(thing, "loop", False))
    if kind in ("goal", "key") and getattr(thing, "polygon", None) is None:
        radius = max(getattr(thing, "radius", 0.5), 0.1)
        turn = np.linspace(0, 2 * np.pi, 32, endpoint=False)
        return np.asarray(thing.xy) + radius * np.stack([np.cos(turn), np.sin(turn)], axis=1), True
    return np.asarray(thing.polygon), True


def free_name(simulation, kind) -> str:
    """A name that no thing of this kind has yet: "goal 2"."""
    used_names = {getattr(thing, "name", "") for other_kind, thing in things(simulation) if other_kind == kind}
    return next(name for n in range(1, len(used_names) + 2) if (name := f"{kind} {n}") not in used_names)


def thing_of(simulation, kind, number):
    """The thing of a kind with this id as it is now, or None: ticks, undo and time travel change and remove things."""
    return next((thing for one, thing in things(simulation) if (one, thing.id) == (kind, number)), None)


def change(app, label, kind, number, make):
    """Do the command that ``make`` gives for a thing as it is now; show a message if it is gone."""
    if thing_of(app.session.simulation, kind, number) is None:
        app.notify(f"this {SPOKEN.get(kind, kind)} is no longer there", "warning")
    else:
        app.do(label, [make(as_command(app.session.simulation.world, kind, number))])


def moved(command, shift):
    """The command that puts a thing so many metres (2,) elsewhere, with everything else as it is."""
    points = getattr(command, "points", None)
    changes = {"points": rows(np.asarray(points) + shift)} if points else {}
    if hasattr(command, "x"):
        changes = {"points": []} if points else {}  # those of a goal move with it
        changes |= dict(zip("xy", (np.array([command.x, command.y]) + shift).tolist(), strict=True))
    args = getattr(command, "args", {})
    if args.get("points"):  # a key that is drawn as an outline moves what it gives
        changes["args"] = args | {"points": (np.asarray(args["points"]) + shift).tolist()}
    return replace(command, **changes)

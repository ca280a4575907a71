"""Warnings of ``flockbrush level check``: what is allowed in a level and rarely what its designer meant."""

from __future__ import annotations

import functools
import shlex
from pathlib import Path, PurePosixPath

import numpy as np
from flockbrush.behaviours.brush import PATH_SUFFIX, flies_free, shipped
from flockbrush.behaviours.mixture import can_mix, path_between
from flockbrush.engine.problems import did_you_mean
from flockbrush.engine.raster import Raster
from flockbrush.engine.seam import images, wrap_of
from flockbrush.levels import geometry
from flockbrush.levels.libraries import input_files
from flockbrush.levels.properties import is_number
from flockbrush.levels.terrain_kinds import Terrain
from flockbrush.systems.navigation import navigation_of
from flockbrush.systems.terrain import compose_blocked, steepest_within, steepness_of

_ANYWHERE = 100.0  # slope that every climbing species walks on
_CLIFF = 1.0  # m of height between opposite borders below which nothing is said
_AHEAD = 2.0  # cells before the end of a guide in which a wall is looked for


def layer_hints(layers):
    """Warn about hidden layers and parallax of those layers that are read.

    Parameters
    ----------
    layers : iterable of Layer
    """
    for layer in layers:
        if layer.hidden:
            layer.place.warn("is hidden in Tiled but still used; delete it, or name it 'notes ...' to have it ignored")
        if any(is_number(layer.node.get(key)) and layer.node[key] != 1 for key in ("parallaxx", "parallaxy")):
            layer.place.warn("has a parallax factor, which is ignored")


def paint_hints(level, places, library):
    """Warn about ground paint that makes birds land and lets them go on their way down.

    Parameters
    ----------
    places : sequence of Place
        Of the brush layers, then of the zones.
    library : BrushLibrary
    """
    for thing, here in zip([*level.brush_layers, *level.zones], places, strict=True):
        bounds = thing.bounds
        if bounds.medium not in ("air", "any") or not 0.0 < bounds.z_min < np.inf:
            continue
        for name in _brushes_of(thing):
            if not flies_free(library.get(name)):
                here.warn(
                    f"brush {name!r} makes birds land, but acts only above z_min {bounds.z_min:g} m: below, they take "
                    "off again; set z_min to 0"
                )


def _brushes_of(thing):
    """Names of the brushes of a brush layer or a zone."""
    return getattr(thing, "assets", [thing.brush] if getattr(thing, "brush", None) else [])


def mixing_hints(level, places, library):
    """Warn about paint of part weight whose brush is of another model than the herd's, or that nobody has measured.

    Parameters
    ----------
    places : sequence of Place
        Of the brush layers, then of the zones.
    library : BrushLibrary
    """
    for thing, here in zip([*level.brush_layers, *level.zones], places, strict=True):
        if thing.bounds.blend != "mix":
            continue
        for start in sorted({spawn.brush for spawn in level.spawns}):
            for end in _brushes_of(thing):
                hint = "" if end == start else _mixing_hint(level, library, start, end)
                if hint:
                    here.warn(hint)


def _morph(level, library, start, end):
    """The command that measures a path between two brushes and puts it where this level finds it."""
    folder = next((f for f in library.folders if f not in shipped().folders), Path(level.path).parent / "brushes")
    brushes = [_brush_argument(level, library, name) for name in (start, end)]
    output = _from_here(folder / f"{start}--{end}{PATH_SUFFIX}")
    return shlex.join(["flockbrush", "brush", "morph", *brushes, "-o", output])


def _brush_argument(level, library, name):
    """How a command names a brush of a level: a shipped one by name, others by file."""
    file = library.path(name)
    if file.parent == Path():  # embedded: the level names it as a file, or it is in a recording
        named = [own for own in level.files if PurePosixPath(own).name == file.name]
        file = next(iter(input_files(level.path, named)), None)
    return name if file is None or file.parent in shipped().folders else _from_here(file)


def _from_here(file):
    """A path as it is written in the current folder."""
    file, here = Path(file).absolute(), Path.cwd()
    return str(file.relative_to(here) if file.is_relative_to(here) else file)


def _mixing_hint(level, library, start, end):
    if not can_mix(library.get(start), library.get(end)):
        return f"brushes {start!r} and {end!r} have different models, so a share of the animals takes {end!r}"
    path = path_between(library, start, end)
    if path is not None and not path.even:
        kind = "bistable: herds keep their previous behaviour" if path.bistable else "uneven: behaviour may jump"
        return f"the measured path from {start!r} to {end!r} is {kind} (the table is in its file)"
    if path is None:
        return (
            f"there is no measured path from {start!r} to {end!r}: parameters are mixed linearly, and behaviour may "
            f"jump; {_morph(level, library, start, end)} measures a path"
        )
    if other := path.replaced(map(library.get, (start, end))):
        return (
            f"the path from {start!r} to {end!r} was measured with another brush {' and '.join(map(repr, other))}, "
            f"so behaviour may jump; {_morph(level, library, start, end)} measures it anew"
        )
    return ""


def level_hints(level, places):
    """Warn about goals that no animal goes to and guides that lead into a wall.

    Parameters
    ----------
    places : dict of int to Place
        By the id of the object.
    """
    for goal in _unlinked(level):
        places[goal.id].warn(
            f"no animal goes to goal {goal.name[:60]!r}: animals start with the first goal, "
            f"{level.goals[0].name[:60]!r}; make it the 'next' of a goal, or send animals there in the script"
        )
    for guide in level.guides:
        wall = "" if guide.loop else _wall_after(level, guide)
        if wall:
            places[guide.id].warn(
                f"ends at {wall}, where animals will jam; end it at a goal or an exit, or set its 'loop'"
            )


def species_hints(level, places, fauna):
    """Warn about spawns of a species without a file whose name is nearly that of one."""
    for spawn in level.spawns:
        hint = did_you_mean(spawn.species, fauna.names()) if spawn.species not in fauna.names() else ""
        if "did you mean" in hint:
            places[spawn.id].warn(f"there is no species {spawn.species[:60]!r}{hint}")


def program_hints(level, places):
    """Warn about programs that name places which are not in the level.

    Parameters
    ----------
    places : dict of int to Place
        By the id of the object.
    """
    goals = [goal.name for goal in level.goals]
    known = {"goal": goals, "place": [*goals, *(thing.name for thing in (*level.zones, *level.areas))]}
    known["region"] = known["place"]
    mentioned = {value for key in level.script for value in key.args.values() if isinstance(value, str)}
    for spawn in level.spawns:
        program = level.programs.get(spawn.program)
        for what, names in known.items() if program is not None else ():
            for name in program.references(what):
                if name not in names and name not in mentioned:
                    places[spawn.id].warn(
                        f"program {spawn.program!r} names the {what} {name[:60]!r}, which is not in this level: no "
                        f"animal is ever in it or near it{did_you_mean(name, names)}"
                    )
        for name in program.references("state") if program is not None else ():
            other, slash, state = name.partition("/")
            if not slash or other in mentioned:
                continue
            found = level.programs.get(other)
            if found is None:
                wrong = f"program {other[:60]!r}, which no animal of this level follows"
                hint = did_you_mean(other, level.programs)
            elif state not in found.states:
                wrong = f"state {state[:60]!r}, which program {other[:60]!r} does not have"
                hint = did_you_mean(state, found.states)
            else:
                continue
            places[spawn.id].warn(f"program {spawn.program!r} names the {wrong}: no animal is ever in it{hint}")


def event_hints(level, places):
    """Warn about zones that raise events for which no program listens.

    Parameters
    ----------
    places : dict of int to Place
        By the id of the object.
    """
    heard = sorted({event for program in level.programs.values() for event in program.events})
    for zone in level.zones:
        if zone.event and zone.event not in heard:
            hint = did_you_mean(zone.event, heard)
            places[zone.id].warn(f"no program of this level listens for the event {zone.event[:60]!r}{hint}")


def script_hints(level, places):
    """Warn about commands of the script that change no animal.

    Parameters
    ----------
    places : dict of int to Place
        By the id of the object.
    """
    commands = {key.command for key in level.script}
    for key in level.script:
        if key.command == "Steer" and "Appoint" not in commands:
            places[key.id].warn("Steer changes no animal: it sends appointed animals, and the script has no Appoint")
        meant = [spawn for spawn in level.spawns if key.args.get("species", "") in ("", spawn.species)]
        if key.command != "SwitchBrush" or commands & {"GiveProgram", "UseProgram", "AddAnimals", "MarkSpawn"}:
            continue  # it may mean animals that the script brings or frees
        if meant and all(_chooses(level.programs.get(spawn.program)) for spawn in meant):
            places[key.id].warn(
                "SwitchBrush changes no animal: all follow programs whose states choose their brushes; use SetState, "
                "GiveProgram or Event"
            )


def _chooses(program):
    """Whether every state of a program has a brush, which wins over that of the animal."""
    return program is not None and all(state.brush for state in program.states.values())


def _unlinked(level):
    """Goals that neither birth, nor a goal before them, nor the script leads to."""
    if not level.goals:
        return []
    mentioned = {value for key in level.script for value in key.args.values() if isinstance(value, str)}
    followed = {goal.name: goal.next for goal in level.goals}
    reached, waiting = set(), [level.goals[0].name, *mentioned]
    while waiting:
        name = waiting.pop()
        if name in followed and name not in reached:
            reached.add(name)
            waiting.append(followed[name])
    if any(_may_send(program) for program in level.programs.values()):
        return []
    return [goal for goal in level.goals if goal.name not in reached]


def _may_send(program):
    """Whether a program speaks of goals at all."""
    return b"goal" in program.source


def _wall_after(level, guide):
    """What stands at the end of a guide, in words; "" where animals get on."""
    end, along = guide.points[-1], guide.points[-1] - guide.points[-2]
    step = along / np.linalg.norm(along) * level.cell
    if any(_ends_well(level, point) for point in end - step * np.linspace(0, 1, 5)[:, None]):
        return ""
    ahead = end + step * np.linspace(0, _AHEAD, 9)[:, None]
    for k, point in enumerate(ahead):
        if _ends_well(level, point):
            return ""
        wall = _wall_at(level, point)
        if wall:
            return "" if any(_ends_well(level, before) for before in ahead[: k + 1]) else wall
    return ""


def _everywhere(level, point):
    """(k, 2) m: a point and, where the map goes on at its borders, all places that it is; first one on the map."""
    wrap = wrap_of(level)
    point = point if wrap is None else np.mod(point, wrap)
    return point + images([point], wrap, np.inf)


def _ends_well(level, point):
    """Whether animals arrive or leave here."""
    points = _everywhere(level, point)
    for goal in level.goals:
        if np.hypot(*(goal.xy - points).T).min() <= goal.radius:
            return True
        if goal.polygon is not None and geometry.inside(points, goal.polygon).any():
            return True
    return any(geometry.inside(points, exit_.polygon).any() for exit_ in level.exits)


def _wall_at(level, point):
    points = _everywhere(level, point)
    x, y = points[0]
    if not (0 <= x < level.width and 0 <= y < level.height):
        return "the edge of the map" if level.boundary == "wall" else ""
    for o in level.obstacles:
        if o.solid and o.on_the_ground and geometry.inside(points, o.polygon).any():
            return f"obstacle {o.name[:60] or o.id!r}"
    if level.terrain is not None and not level.terrain.walkable[int(y / level.cell), int(x / level.cell)]:
        return "ground that no animal walks on"
    return ""


def slope_hints(level, places, library, fauna):
    """Warn about animals on ground that their species does not walk, and about goals behind such ground.

    Parameters
    ----------
    places : dict of int to Place
        By the id of the object.
    library : BrushLibrary
    fauna : SpeciesLibrary
    """
    hills = level.height_map
    if hills is None:
        return
    steepness = steepness_of(hills.values, hills.cell, level.boundary == "wrap")
    steep = Raster(level.cell, steepest_within(steepness, hills.cell, level.shape, level.cell))
    costs = functools.cache(lambda limit: Raster(level.cell, _costs(level, steep.values > limit)))
    for spawn in level.spawns:
        species = fauna.find(spawn.species)
        if species is None or not species.can("walk") or flies_free(library.get(spawn.brush)):
            continue
        limit, points = species.walk.steepest, geometry.sample(spawn.polygon)
        if steep.values.max() <= limit:
            continue
        walks = f"steeper than species {spawn.species!r} walks (walk.steepest is {limit:g})"
        if (steep.at(points) > limit).mean() > 0.5:
            places[spawn.id].warn(f"more than half of it is {walks}")
        elif level.goals and costs(limit).at(points).min() == np.inf > costs(_ANYWHERE).at(points).min():
            places[spawn.id].warn(f"no way leads to goal {level.goals[0].name[:60]!r}: the ground between is {walks}")


def seam_hints(level, place):
    """Warn about a height picture whose opposite borders do not fit on a map that goes on there.

    Parameters
    ----------
    place : Place
        Of the map.
    """
    if level.boundary != "wrap" or level.height_map is None:
        return
    height = level.height_map.values
    for axis, borders in ((1, "west and east"), (0, "south and north")):
        step = np.abs(height.take(0, axis) - height.take(-1, axis)).max()
        elsewhere = np.abs(np.diff(height, axis=axis)).max(initial=0.0)
        if step > max(2.0 * elsewhere, _CLIFF):
            place.warn(
                f"boundary is wrap, but heights on the {borders} borders differ by up to {step:g} m: there is a cliff "
                "where the map goes on; the height picture should fit itself there"
            )


def _costs(level, steep):
    """(ny, nx) least cost to the first goal, round steep ground; infinite where no way leads."""
    terrain, goal = level.terrain or Terrain.blank(level.shape), level.goals[0]
    solid = [o for o in level.obstacles if o.solid and o.on_the_ground]
    blocked = steep | compose_blocked(level.shape, level.cell, terrain.walkable, solid)
    goes_on = level.boundary == "wrap"
    size = (level.width, level.height) if goes_on else (0.0, 0.0)
    height = level.height_map.sample(Raster(level.cell, blocked).centres(), size)
    return navigation_of([], [goal], blocked, terrain.cost, level.cell, height, goes_on).times[0]

"""A level with another number of animals at the same density."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
from flockbrush.engine.commands import commands, place_fields
from flockbrush.engine.raster import Raster
from flockbrush.systems import edits as _edits  # noqa: F401  a designer's commands are known wherever a level is


def scaled(level, agents):
    """The same level with another number of animals at the same density."""
    total = sum(spawn.count for spawn in level.spawns)
    if agents < 1:
        raise ValueError(f"there must be at least 1 animal, got {agents}")
    if not total:
        raise ValueError(f"{level.name} has no spawn with a count to scale")
    factor = agents / total
    counts = _shares([spawn.count for spawn in level.spawns], agents)
    spawns = []
    for spawn, count in zip(level.spawns, counts, strict=True):
        middle = spawn.polygon.mean(0)
        polygon = middle + (spawn.polygon - middle) * math.sqrt(factor) if factor > 1 else spawn.polygon
        if factor < 1:
            polygon = middle + (spawn.polygon - middle) * math.sqrt(max(count, 1) / max(spawn.count, 1))
        spawns.append(dataclasses.replace(spawn, count=count, polygon=polygon, rate=spawn.rate * factor))
    endless = {spawn.id for spawn in level.spawns if spawn.rate and not spawn.count}
    return _grown(dataclasses.replace(level, spawns=[s for s in spawns if s.count or s.id in endless]))


def _shares(counts, total):
    """Whole numbers in proportion to ``counts`` that add up to ``total``, at least 1 each if it is enough for all."""
    exact = np.array(counts, float) * total / sum(counts)
    whole = np.floor(exact).astype(int)
    for k in np.argsort(whole - exact, kind="stable")[: total - whole.sum()]:
        whole[k] += 1
    none = np.flatnonzero((np.array(counts) > 0) & (whole == 0))
    for k in none if total >= np.count_nonzero(counts) else ():
        whole[np.argmax(whole)] -= 1
        whole[k] = 1
    return whole.tolist()


def _grown(level):
    """The level on a map large enough for its spawn areas: plain ground is added around the old map."""
    low = np.min([s.polygon.min(0) for s in level.spawns], axis=0)
    high = np.max([s.polygon.max(0) for s in level.spawns], axis=0)
    before = [max(0, math.ceil(-v / level.cell)) for v in low]
    after = [
        max(0, math.ceil((v - size) / level.cell)) for v, size in zip(high, (level.width, level.height), strict=True)
    ]
    if not any(before + after):
        return level
    shift = np.array(before) * level.cell
    pad = (before[1], after[1]), (before[0], after[0])

    def moved(thing, *names):
        return dataclasses.replace(
            thing, **{n: getattr(thing, n) + shift for n in names if getattr(thing, n) is not None}
        )

    def grid(values, fill):
        return np.pad(values, pad, constant_values=fill)

    size = level.width + sum(pad[1]) * level.cell, level.height + sum(pad[0]) * level.cell
    return dataclasses.replace(
        level,
        width=size[0],
        height=size[1],
        terrain=level.terrain and level.terrain.padded(pad),
        art=level.art and level.art.padded(pad),
        height_map=level.height_map and _hills(level.height_map, shift, size, level.cell),
        cap=None if level.cap is None else Raster(level.cap.cell, grid(level.cap.values, np.inf)),
        factor=None if level.factor is None else Raster(level.factor.cell, grid(level.factor.values, 1.0)),
        brush_layers=[dataclasses.replace(b, index=grid(b.index, -1)) for b in level.brush_layers],
        obstacles=[moved(o, "polygon") for o in level.obstacles],
        guides=[moved(g, "points") for g in level.guides],
        goals=[moved(g, "xy", "polygon") for g in level.goals],
        zones=[moved(z, "polygon") for z in level.zones],
        spawns=[moved(s, "polygon") for s in level.spawns],
        exits=[moved(e, "polygon") for e in level.exits],
        lines=[moved(line, "points") for line in level.lines],
        areas=[moved(a, "polygon") for a in level.areas],
        script=[
            dataclasses.replace(key, xy=key.xy + shift, args=_moved_args(key.command, key.args, shift))
            for key in level.script
        ],
    )


def _moved_args(command, args, shift):
    """The arguments of a command whose map has grown to the south-west."""
    moved = dict(args)
    for pair in place_fields(commands()[command], args) if command in commands() else ():
        for name, metres in zip(pair, shift.tolist(), strict=True):
            if isinstance(args.get(name), (int, float)):
                moved[name] = args[name] + metres
    points = args.get("points")
    if isinstance(points, list) and all(isinstance(p, list) and len(p) == 2 for p in points):
        moved["points"] = [[x + shift[0], y + shift[1]] for x, y in points]
    return moved


def _hills(raster, shift, size, cell):
    """Heights on a map of another size whose south-west corner lies ``shift`` m further out; those of its edge around.

    Pixels that do not fit the shift are made as fine as the map, for hills stay where they are.
    """
    fine = raster.cell if np.allclose(shift / raster.cell, np.round(shift / raster.cell)) else min(raster.cell, cell)
    nx, ny = (max(1, round(length / fine)) for length in size)
    places = Raster(fine, np.zeros((ny, nx))).centres() - shift
    return Raster(fine, raster.sample(places))

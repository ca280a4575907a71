"""Formations that meet something: do they open, pass and form again?

    python benchmarks/formation_scenes.py [--brush geese skein] [--scene pillars ridge falcon] [--seeds 9001:9020]

Geese in line formation (`geese`) and geese that keep the V rules (`skein`) start at random places and form up; then a
field of pillars stands in their way, or a ridge that is higher than they fly, or a falcon stoops through them.  The
things are drawn for every seed.

A seed passes when the flock stood in formation before, nobody was ever inside a solid with any part of its body or
under the ground, nobody ever flew, climbed or turned faster than its species, and all are one formation again, for two
seconds or more, within 60 s: of when the last had passed the thing, or the falcon was 80 m away.

One formation is, in line formation, one leader, no place taken twice and everybody within half a wingspan of its place;
by V rules one lead, one group and a V, a J or an echelon (`flockbrush.runs.v_measures`) within a wingspan of height.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))
sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from flockbrush.behaviours.brush import shipped
from flockbrush.behaviours.species import shipped_species
from flockbrush.components import Body, FormationPlace, Heading, Position, Species, Velocity
from flockbrush.engine.raster import Raster
from flockbrush.systems.commands import Migrate
from flockbrush.systems.fauna import SpeciesList
from flockbrush.systems.palette import Palette
from small_herd import box, brush, meadow, obstacle, put_aloft, room_in_the_air

from flockbrush.runs.v_measures import v_indicators

BIRDS, HEIGHT = 9, 40.0  # m above the ground
FORMS = 16.0  # s that they have before they meet the thing
WITHIN = 60.0  # s after it
LOOK, STAYS = 0.25, 2.0  # s from one look at the shape to the next, and for which it must stay
NEAR, STOOP = 25.0, 36.0  # m from a goose, where the falcon ends its stoop and goes straight on; m/s
LIMIT = 200.0  # s, the longest that a passage takes
MIDDLE = 600.0  # m north, of a map that is twice as wide
SCENES = ("pillars", "ridge", "falcon")


class Outcome(NamedTuple):
    """What became of one flock."""

    formed: float  # s until it first stood in formation
    room: float  # m, the least between a body and a solid or the ground, in any tick
    nearest: float  # m, how near a falcon came
    apart: float  # s for which it was no formation since it first was, until the thing was over
    again: float  # s after the thing until it was one formation again, to stay; inf: not in time
    faults: tuple  # sentences

    @property
    def passed(self):
        return np.isfinite(self.formed) and self.room >= 0.0 and np.isfinite(self.again) and not self.faults


def flock_before(scene, kind, seed, birds=BIRDS, forms=FORMS):
    """(simulation, where the thing is along the way): geese that fly east, scattered, and what they will meet."""
    rng = np.random.default_rng(seed)
    asset, falcon = shipped().get(kind), brush("stoop", "raptor", STOOP / 0.45, min_speed=10.0, max_speed=90.0)
    way = asset.speed.mean * 0.8 * forms + 100.0  # m, to the thing
    things = {"obstacles": pillars(rng, way)} if scene == "pillars" else {}
    if scene == "ridge":
        things["height_map"] = Raster(10.0, ridge(rng, way))
    simulation = meadow(asset, falcon, width=4000, height=2 * MIDDLE, cell=10.0, seed=seed, **things)
    side = 3.0 * 1.6 * np.sqrt(birds)
    xyz = rng.uniform(-0.5, 0.5, (birds, 3)) * (side, side, 0.0) + (60.0, MIDDLE, HEIGHT)
    for i in range(1, birds):
        while np.hypot(*(xyz[:i, :2] - xyz[i, :2]).T).min() < 1.8:
            xyz[i, :2] = rng.uniform(-0.5, 0.5, 2) * side + (60.0, MIDDLE)
    put_aloft(simulation, xyz, (1.0, 0.0, 0.0), brush=kind, species="goose", length=0.8)
    simulation.submit(Migrate(1.0, 0.0, 0.0, kind="direction"))
    return simulation, way


def pillars(rng, way, count=16):
    """Round and square pillars in a field of 120 by 100 m, nowhere nearer than 8 m to one another."""
    found = []
    while len(found) < count:
        x, y, r = way + 120 * rng.uniform(), MIDDLE + 100 * (rng.uniform() - 0.5), rng.uniform(0.8, 3.0)
        if all(np.hypot(x - a, y - b) > r + c + 8.0 for a, b, c, _ in found):
            found.append((x, y, r, rng.choice(["cylinder", "box"])))
    things = []
    for k, (x, y, r, shape) in enumerate(found):
        things.append(obstacle(box(x - r, y - r, x + r, y + r), f"pillar {k}"))
        things[-1].shape, things[-1].z_max = str(shape), 150.0
    return things


def ridge(rng, way):
    """(my, mx) m: a ridge across the way, 10 to 30 m higher than they fly."""
    y, x = (np.mgrid[:120, :400] + 0.5) * 10.0
    deep, wide = rng.uniform(60, 120), rng.uniform(120, 240)
    aside, top = rng.uniform(-100, 100), HEIGHT + rng.uniform(10, 30)
    across = np.exp(-(((y - MIDDLE - aside) / wide) ** 2))
    return top * across * np.exp(-(((x - way - 2 * deep) / deep) ** 2))


def one_formation(simulation, kind, mine):
    """Whether all geese fly in one formation."""
    if shipped().get(kind).model == "v_rules":
        seen = v_indicators(simulation)
        z = simulation.agents[Position.xyz][mine, 2]
        return seen["leads"] == seen["groups"] == 1 and seen["shape"] in ("V", "J", "echelon") and np.ptp(z) < 1.6
    agents, palette = simulation.agents, simulation.world.resource(Palette)
    place, arm = agents[FormationPlace.place][mine], agents[FormationPlace.arm][mine]
    if (place == 0).sum() != 1 or place.min() < 0 or len({*zip(place.tolist(), arm.tolist(), strict=True)}) < len(mine):
        return False
    lead = mine[place == 0][0]
    row = {entity: k for k, entity in enumerate(agents.ids.tolist())}
    wing = palette.brushes[palette.named(kind)].params.wingspan * float(agents[Body.length][lead])
    ahead = agents[Heading.forward][lead, :2] / np.hypot(*agents[Heading.forward][lead, :2])
    right = np.array([ahead[1], -ahead[0]])
    xyz, offset = agents[Position.xyz], agents[FormationPlace.offset]
    for i in mine[place > 0]:
        j = row.get(int(agents[FormationPlace.reference][i]), -1)
        if j < 0:
            return False
        away = xyz[i] - xyz[j]
        off = away[:2] @ right - offset[i, 0], away[:2] @ ahead - offset[i, 1], away[2]
        if np.linalg.norm(off) > 0.5 * wing:
            return False
    return True


def geese_of(simulation):
    names = simulation.world.resource(SpeciesList).names
    return np.flatnonzero(simulation.agents[Species.index] == names.index("goose"))


def send_the_falcon(simulation, rng):
    """It comes from anywhere around them, 90 m off and 40 m up, with the speed of a stoop."""
    middle = simulation.agents[Position.xyz][geese_of(simulation)].mean(0)
    angle = rng.uniform(0, 2 * np.pi)
    away = np.array([90.0 * np.cos(angle), 90.0 * np.sin(angle), 40.0])
    put_aloft(simulation, [middle + away], -away, brush="stoop", species="falcon", length=0.45)
    stoop(simulation, geese_of(simulation))


def stoop(simulation, mine):
    """It makes for where the middle of them will be when it is there."""
    agents = simulation.agents
    hunter = np.setdiff1d(np.arange(len(agents)), mine)[0]
    away = agents[Position.xyz][mine].mean(0) - agents[Position.xyz][hunter]
    soon = np.linalg.norm(away) / STOOP
    way = away + soon * agents[Velocity.xyz][mine].mean(0)
    way /= np.linalg.norm(way)
    simulation.submit(Migrate(*way.tolist(), kind="direction", species="falcon"))


def passage(scene, kind, seed, birds=BIRDS, forms=FORMS):
    """The `Outcome` of one flock."""
    simulation, way = flock_before(scene, kind, seed, birds, forms)
    formed = nearest = again = np.inf
    room, apart, last, since, faults = np.inf, 0.0, None, None, set()
    before = simulation.agents[Heading.forward].copy()
    while simulation.clock.now < LIMIT:
        if scene == "falcon" and simulation.clock.now == forms:
            send_the_falcon(simulation, np.random.default_rng(seed))
        simulation.tick()
        now, mine = simulation.clock.now, geese_of(simulation)
        room = min(room, float(room_in_the_air(simulation)[mine].min()))
        before = limits(simulation, mine, before, faults)
        if len(simulation.agents) > birds:
            nearest = min(nearest, float(falcon_to(simulation, mine)))
            if nearest > NEAR and now % LOOK == 0:
                stoop(simulation, mine)
        if last is None and over(scene, simulation, mine, way, nearest):
            last = now
        if now % LOOK:
            continue
        stands = one_formation(simulation, kind, mine)
        if last is None:
            formed = min(formed, now) if stands else formed
            apart += 0.0 if stands or not np.isfinite(formed) else LOOK
            continue
        since = (now if since is None else since) if stands else None
        if since is not None and now - since >= STAYS:
            again = since - last
            break
        if now - last > WITHIN + STAYS:
            break
    simulation.close()
    return Outcome(formed, room, nearest, apart, again, tuple(sorted(faults)))


def limits(simulation, mine, before, faults):
    """Whether anybody was faster or turned faster than a goose can; the headings, for the next tick."""
    agents, goose = simulation.agents, shipped_species().get("goose").fly
    forward = agents[Heading.forward].copy()
    if not np.isfinite(agents[Position.xyz]).all():
        faults.add("not finite")
    if np.linalg.norm(agents[Velocity.xyz][mine], axis=1).max() > goose.speed + 1e-6:
        faults.add("faster than its species")
    if agents[Velocity.xyz][mine, 2].max() > goose.climb + 1e-6:
        faults.add("climbs faster than its species")
    now, then = forward[mine], before[mine]
    turned = np.arctan2(np.linalg.norm(np.cross(now, then), axis=1), (now * then).sum(1))
    if turned.max() > goose.turn / 32 + 1e-5:
        faults.add("turns faster than its species")
    return forward


def falcon_to(simulation, mine):
    """m from the falcon to the nearest goose."""
    hunter = np.setdiff1d(np.arange(len(simulation.agents)), mine)[0]
    xyz = simulation.agents[Position.xyz]
    return np.linalg.norm(xyz[mine] - xyz[hunter], axis=1).min()


def over(scene, simulation, mine, way, nearest):
    """Whether the thing is behind them: the field, the ridge, or a falcon that came near and is 80 m away again."""
    if scene == "falcon":
        return nearest <= NEAR and falcon_to(simulation, mine) > 80.0
    beyond = way + (130.0 if scene == "pillars" else 480.0)
    return bool((simulation.agents[Position.xyz][mine, 0] > beyond).all())


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--brush", nargs="+", default=["geese", "skein"])
    parser.add_argument("--scene", nargs="+", default=SCENES, choices=SCENES)
    parser.add_argument("--seeds", default="9001:9020", help="first:last")
    told = parser.parse_args()
    first, last = (int(seed) for seed in (told.seeds.split(":") * 2)[:2])  # one seed stands for itself
    for kind in told.brush:
        for scene in told.scene:
            print(f"{kind}, {scene}: formed after, least room, falcon as near as, not formed for, again after")
            passed, waits = 0, []
            for seed in range(first, last + 1):
                found = passage(scene, kind, seed)
                passed += found.passed
                waits.append(found.again)
                print(
                    f"{seed}  {found.formed:5.1f} s  {found.room:6.3f} m  {found.nearest:5.1f} m  "
                    f"{found.apart:5.1f} s  {found.again:5.1f} s  "
                    f"{'yes' if found.passed else 'no'}  {'; '.join(found.faults)}",
                    flush=True,
                )
            half = np.median(waits)
            print(f"{passed} of {last - first + 1} seeds; half of them one again within {half:.1f} s\n", flush=True)


if __name__ == "__main__":
    main()

"""Test whether formations pass an obstacle or a predator and form again.

    python benchmarks/formation_scenes.py [--brush geese skein] [--scene pillars ridge falcon guide] [--seeds 9001:9020]

Geese in line formation (`geese`) and geese with V rules (`skein`) start at random positions and form up.  Then they
meet a field of pillars, a ridge that is higher than they fly, or a falcon that stoops through them.  Each seed has its
own pillars, ridge or falcon.  They are bound east; in the scene `guide`, which has a falcon, they follow a painted
guide that bends twice instead.

A seed passes if the flock was in formation before; no part of a bird was ever inside a solid or below the ground; no
bird ever flew, climbed or turned faster than its species can; and within 60 s all birds are one formation again for at
least two seconds.  The 60 s start when the last bird has passed the obstacle, or when the falcon is 80 m away.

In line formation, one formation means one leader, no place taken twice and every bird within half a wingspan of its
place.  With V rules it means one lead, one group and a V, a J or an echelon (`flockbrush.runs.v_measures`), with
heights within a wingspan.
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
from flockbrush.levels.schema import Guide
from flockbrush.systems.commands import Migrate
from flockbrush.systems.fauna import SpeciesList
from flockbrush.systems.palette import Palette
from small_herd import box, brush, meadow, obstacle, put_aloft, room_in_the_air

from flockbrush.runs.v_measures import v_indicators

BIRDS, HEIGHT = 9, 40.0  # m above the ground
FORMS = 16.0  # s to form up before the obstacle
WITHIN = 60.0  # s after the obstacle
LOOK, STAYS = 0.25, 2.0  # s between checks of the shape, and for which it must last
NEAR, STOOP = 25.0, 36.0  # m from a goose at which the falcon stops aiming and flies straight on; m/s
LIMIT = 200.0  # s, the longest passage
MIDDLE = 600.0  # m north, of a map that is twice as wide
SCENES = ("pillars", "ridge", "falcon", "guide")
FALCON = ("falcon", "guide")  # scenes with one


class Outcome(NamedTuple):
    """The result of one flock."""

    formed: float  # s until the first formation
    room: float  # m, the least between a body and a solid or the ground, in any tick
    nearest: float  # m, least distance of the falcon
    apart: float  # s without formation, from the first formation until the obstacle is passed
    again: float  # s after the obstacle until the formation is back for good; inf: not in time
    faults: tuple  # messages

    @property
    def passed(self):
        return np.isfinite(self.formed) and self.room >= 0.0 and np.isfinite(self.again) and not self.faults


def flock_before(scene, kind, seed, birds=BIRDS, forms=FORMS):
    """Return (simulation, distance of the obstacle): scattered geese that fly east, and the obstacle."""
    rng = np.random.default_rng(seed)
    asset, falcon = shipped().get(kind), brush("stoop", "raptor", STOOP / 0.45, min_speed=10.0, max_speed=90.0)
    way = asset.speed.mean * 0.8 * forms + 100.0  # m, to the obstacle
    things = {"obstacles": pillars(rng, way)} if scene == "pillars" else {}
    if scene == "guide":
        east, north = (-way, 150.0, 400.0, 900.0, 4000.0 - way), (0.0, 0.0, 400.0, -300.0, -300.0)
        bends = np.column_stack([way + np.array(east), MIDDLE + np.array(north)])
        things["guides"] = [Guide(1, "way", bends, 1.0, 30.0, 60.0, "", False)]
    if scene == "ridge":
        things["height_map"] = Raster(10.0, ridge(rng, way))
    simulation = meadow(asset, falcon, width=4000, height=2 * MIDDLE, cell=10.0, seed=seed, **things)
    side = 3.0 * 1.6 * np.sqrt(birds)
    xyz = rng.uniform(-0.5, 0.5, (birds, 3)) * (side, side, 0.0) + (60.0, MIDDLE, HEIGHT)
    for i in range(1, birds):
        while np.hypot(*(xyz[:i, :2] - xyz[i, :2]).T).min() < 1.8:
            xyz[i, :2] = rng.uniform(-0.5, 0.5, 2) * side + (60.0, MIDDLE)
    put_aloft(simulation, xyz, (1.0, 0.0, 0.0), brush=kind, species="goose", length=0.8)
    if scene != "guide":
        simulation.submit(Migrate(1.0, 0.0, 0.0, kind="direction"))
    return simulation, way


def pillars(rng, way, count=16):
    """Return round and square pillars in a field of 120 by 100 m, at least 8 m apart."""
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
    """Return the heights of a ridge across the course, 10 to 30 m higher than the flock flies, (my, mx) m."""
    y, x = (np.mgrid[:120, :400] + 0.5) * 10.0
    deep, wide = rng.uniform(60, 120), rng.uniform(120, 240)
    aside, top = rng.uniform(-100, 100), HEIGHT + rng.uniform(10, 30)
    across = np.exp(-(((y - MIDDLE - aside) / wide) ** 2))
    return top * across * np.exp(-(((x - way - 2 * deep) / deep) ** 2))


def one_formation(simulation, kind, mine):
    """Return whether all geese fly in one formation."""
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
    """Add a falcon in a random direction, 90 m away and 40 m up, at the speed of a stoop."""
    middle = simulation.agents[Position.xyz][geese_of(simulation)].mean(0)
    angle = rng.uniform(0, 2 * np.pi)
    away = np.array([90.0 * np.cos(angle), 90.0 * np.sin(angle), 40.0])
    put_aloft(simulation, [middle + away], -away, brush="stoop", species="falcon", length=0.45)
    stoop(simulation, geese_of(simulation))


def stoop(simulation, mine):
    """Send the falcon to where the centre of the flock will be when it arrives."""
    agents = simulation.agents
    hunter = np.setdiff1d(np.arange(len(agents)), mine)[0]
    away = agents[Position.xyz][mine].mean(0) - agents[Position.xyz][hunter]
    soon = np.linalg.norm(away) / STOOP
    way = away + soon * agents[Velocity.xyz][mine].mean(0)
    way /= np.linalg.norm(way)
    simulation.submit(Migrate(*way.tolist(), kind="direction", species="falcon"))


def passage(scene, kind, seed, birds=BIRDS, forms=FORMS):
    """Return the `Outcome` of one flock."""
    simulation, way = flock_before(scene, kind, seed, birds, forms)
    formed = nearest = again = np.inf
    room, apart, last, since, faults = np.inf, 0.0, None, None, set()
    before = simulation.agents[Heading.forward].copy()
    while simulation.clock.now < LIMIT:
        if scene in FALCON and simulation.clock.now == forms:
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
    """Add a message for every exceeded limit of a goose; return the headings for the next tick."""
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
    """Return the distance from the falcon to the nearest goose, m."""
    hunter = np.setdiff1d(np.arange(len(simulation.agents)), mine)[0]
    xyz = simulation.agents[Position.xyz]
    return np.linalg.norm(xyz[mine] - xyz[hunter], axis=1).min()


def over(scene, simulation, mine, way, nearest):
    """Return whether all have passed the pillars or the ridge, or the falcon came near and is 80 m away again."""
    if scene in FALCON:
        return nearest <= NEAR and falcon_to(simulation, mine) > 80.0
    beyond = way + (130.0 if scene == "pillars" else 480.0)
    return bool((simulation.agents[Position.xyz][mine, 0] > beyond).all())


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--brush", nargs="+", default=["geese", "skein"])
    parser.add_argument("--scene", nargs="+", default=SCENES, choices=SCENES)
    parser.add_argument("--seeds", default="9001:9020", help="first:last")
    options = parser.parse_args()
    first, last = (int(seed) for seed in (options.seeds.split(":") * 2)[:2])  # a single seed is a range of one
    for kind in options.brush:
        for scene in options.scene:
            print(f"{kind}, {scene}: formed after, clearance, nearest falcon, out of formation for, formed again after")
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
            print(f"{passed} of {last - first + 1} seeds; median time to form again {half:.1f} s\n", flush=True)


if __name__ == "__main__":
    main()

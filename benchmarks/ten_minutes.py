"""Ten minutes of every shipped level: who is still there, who still moves, who stands at a wall.

    python benchmarks/ten_minutes.py                        all levels, as a table
    python benchmarks/ten_minutes.py elephants --stills DIR with pictures after 0, 120, 300 and 600 s
    python benchmarks/ten_minutes.py crowded --agents 500

An animal *moves* when it was, within the last minute, ever further than five body lengths from where it was at the
minute's beginning.  It is *jammed* when it did not, stands within two body lengths of the border, of an obstacle or
of ground that bars its way, and its speed is not 0, as that of those who rest is.  `gone` counts animals that left
the world by a goal, an exit or a hunter.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from flockbrush.components import Body, Heading, Position, Velocity
from flockbrush.systems.landscape import Landscape
from flockbrush.systems.measures import compute_polarization

from flockbrush.runs.run import shipped_levels, start

SECONDS, STILLS = 600, (0, 120, 300, 600)
MINUTE = 60  # samples, one a second
FAR, NEAR = 5.0, 2.0  # body lengths


@dataclass
class Look:
    """What is seen of a level at the end."""

    level: str
    alive: int
    gone: int
    on_map: float
    moved: float
    jammed: float
    polarization: float


class Minute:
    """Where everybody was in the last minute, by id."""

    def __init__(self):
        self.then, self.farthest, self.samples = {}, {}, []

    def see(self, ids, xyz):
        """A second later."""
        self.samples = [*self.samples[-MINUTE:], dict(zip(ids.tolist(), xyz.tolist(), strict=True))]

    def way(self, ids):
        """(n,) m that each was away from its place at the beginning of the minute, at most."""
        first = {}
        for sample in self.samples:
            for one, at in sample.items():
                first.setdefault(one, at)
        far = dict.fromkeys(ids.tolist(), 0.0)
        for sample in self.samples:
            for one in far.keys() & sample.keys():
                far[one] = max(far[one], float(np.linalg.norm(np.subtract(sample[one], first[one]))))
        return np.array([far[one] for one in ids.tolist()])


def watched(name, seconds=SECONDS, agents=None, at_still=lambda simulation, second: None):
    """A `Look` at a level after so many seconds; `at_still` is called at each second of `STILLS`."""
    simulation = start(name, agents=agents)
    minute, ticks, seen = Minute(), round(1 / simulation.clock.dt), set()
    for second in range(seconds + 1):
        if second in STILLS:
            at_still(simulation, second)
        animals = simulation.agents
        seen.update(animals.ids.tolist())
        minute.see(animals.ids, animals[Position.xyz])
        if second < seconds:
            simulation.run(ticks)
    look = _look(name, simulation, minute, seen)
    simulation.close()
    return look


def _look(name, simulation, minute, seen):
    animals, level = simulation.agents, simulation.level
    xy, length = animals[Position.xyz][:, :2], animals[Body.length]
    inside = ((xy >= 0) & (xy <= (level.width, level.height))).all(axis=1)
    moved = minute.way(animals.ids) > FAR * length
    jammed = ~moved & (_room(simulation, xy) < NEAR * length) & (np.linalg.norm(animals[Velocity.xyz], axis=1) > 0)
    share = [float(k.mean()) if len(k) else float("nan") for k in (inside, moved, jammed)]
    return Look(name, len(xy), len(seen) - len(xy), *share, compute_polarization(animals[Heading.forward]))


def _room(simulation, xy):
    """(n,) m to the next thing that bars the way: the border of the map, an obstacle or ground."""
    level, land = simulation.level, simulation.world.resource(Landscape)
    room = np.minimum(xy, np.subtract((level.width, level.height), xy)).min(axis=1)
    for x0, y0, x1, y1 in land.solid.ends:
        start, way = np.array((x0, y0)), np.array((x1 - x0, y1 - y0))
        share = np.clip((xy - start) @ way / max(way @ way, 1e-12), 0.0, 1.0)
        room = np.minimum(room, np.linalg.norm(xy - start - share[:, None] * way, axis=1))
    return room


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("levels", nargs="*")
    parser.add_argument("--seconds", type=int, default=SECONDS)
    parser.add_argument("--agents", type=int)
    parser.add_argument("--stills", type=Path, metavar="DIR", help="put pictures there")
    told = parser.parse_args()
    print("| level | animals | gone | on the map | moved | jammed | polarization |\n|---|---|---|---|---|---|---|")
    for name in told.levels or shipped_levels():
        look = watched(name, told.seconds, told.agents, _stills(told.stills, name))
        print(
            f"| `{name}` | {look.alive} | {look.gone} | {look.on_map:.0%} | {look.moved:.0%} | {look.jammed:.0%} | "
            f"{look.polarization:.2f} |",
            flush=True,
        )


def _stills(folder, name):
    if folder is None:
        return lambda simulation, second: None

    def draw(simulation, second):
        from flockbrush.output.pictures import herd_of, painter_of
        from flockbrush.render import write_png
        from flockbrush.runs.snapshots import moment_of

        folder.mkdir(parents=True, exist_ok=True)
        painter = painter_of(simulation, (760, 480))
        picture = painter.frame(herd_of(simulation, moment_of(simulation)), time=second, title=name)
        write_png(folder / f"{name}-{second:03d}.png", picture)

    return draw


if __name__ == "__main__":
    main()

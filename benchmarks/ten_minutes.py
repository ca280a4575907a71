"""Run every shipped level for ten minutes and count the animals that are left, that move and that are jammed.

    python benchmarks/ten_minutes.py                        all levels, as a table
    python benchmarks/ten_minutes.py elephants --stills DIR  pictures after 0, 120, 300 and 600 s
    python benchmarks/ten_minutes.py crowded --agents 500

An animal *moves* if, in the last minute, it was ever more than five body lengths away from its position at the start
of that minute.  It is *jammed* if it does not move and covered less than half of the distance that it tried to cover:
bodies, a wall or the border block it.  `gone` counts animals removed by a goal, an exit or a hunter.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from flockbrush.components import Body, Heading, Position, Speed, Velocity
from flockbrush.systems.measures import compute_polarization

from flockbrush.runs.run import shipped_levels, start

SECONDS, STILLS = 600, (0, 120, 300, 600)
MINUTE = 60  # samples, one per second
FAR = 5.0  # body lengths
HELD = 0.5  # of the distance that it tried to cover


@dataclass
class MinuteLook:
    """The result of a level at the end."""

    level: str
    alive: int
    gone: int
    on_map: float
    moved: float
    jammed: float
    polarization: float


class Minute:
    """Positions, speeds and target speeds of all animals in the last minute, by id, m and m/s."""

    def __init__(self):
        self.samples, self.speeds = [], []

    def see(self, ids, xyz, speed, target):
        """Add the sample of one second."""
        self.samples = [*self.samples[-MINUTE:], dict(zip(ids.tolist(), xyz.tolist(), strict=True))]
        both = zip(speed.tolist(), target.tolist(), strict=True)
        self.speeds = [*self.speeds[-MINUTE:], dict(zip(ids.tolist(), both, strict=True))]

    def way(self, ids):
        """Return the largest distance of each animal from its first position of the minute, (n,) m."""
        first = {}
        for sample in self.samples:
            for one, at in sample.items():
                first.setdefault(one, at)
        far = dict.fromkeys(ids.tolist(), 0.0)
        for sample in self.samples:
            for one in far.keys() & sample.keys():
                far[one] = max(far[one], float(np.linalg.norm(np.subtract(sample[one], first[one]))))
        return np.array([far[one] for one in ids.tolist()])

    def jammed(self, ids, length):
        """Return whether each animal is jammed, (n,) bool."""
        sums = np.array(
            [np.sum([sample[one] for sample in self.speeds if one in sample], axis=0) for one in ids.tolist()]
        )
        gone, tried = sums.reshape(-1, 2).T
        return (self.way(ids) <= FAR * length) & (gone < HELD * tried)


def watched(name, seconds=SECONDS, agents=None, at_still=lambda simulation, second: None):
    """Return a `MinuteLook` at a level after `seconds`; `at_still` is called at each second of `STILLS`."""
    simulation = start(name, agents=agents)
    minute, ticks, seen = Minute(), round(1 / simulation.clock.dt), set()
    for second in range(seconds + 1):
        if second in STILLS:
            at_still(simulation, second)
        animals = simulation.agents
        seen.update(animals.ids.tolist())
        speed = np.linalg.norm(animals[Velocity.xyz], axis=1)
        minute.see(animals.ids, animals[Position.xyz], speed, animals[Speed.target])
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
    jammed = minute.jammed(animals.ids, length)
    share = [float(k.mean()) if len(k) else float("nan") for k in (inside, moved, jammed)]
    return MinuteLook(name, len(xy), len(seen) - len(xy), *share, compute_polarization(animals[Heading.forward]))


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("levels", nargs="*")
    parser.add_argument("--seconds", type=int, default=SECONDS)
    parser.add_argument("--agents", type=int)
    parser.add_argument("--stills", type=Path, metavar="DIR", help="folder for pictures")
    options = parser.parse_args()
    print("| level | animals | gone | on the map | moved | jammed | polarization |\n|---|---|---|---|---|---|---|")
    for name in options.levels or shipped_levels():
        look = watched(name, options.seconds, options.agents, _stills(options.stills, name))
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

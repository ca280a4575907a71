"""Draw the pictures of the README: ``python docs/pictures.py``."""

from pathlib import Path

from flockbrush.output.pictures import herd_of, painter_of
from flockbrush.render import contact_sheet, write_png
from flockbrush.runs.run import start
from flockbrush.runs.snapshots import moment_of

HERE = Path(__file__).parent
TRAIL = 2  # s
SECONDS = {
    "sheep-pasture": 26,
    "meadow": 8,
    "gorge": 22,
    "anthill": 12,
    "river": 20,
    "predators-valley": 20,
    "crowded": 2,
}


def walked(name, size=None):
    """A level after its seconds, with trails of the last few; (h, w, 3)."""
    simulation = start(name)
    painter = painter_of(simulation, size)
    ticks = round(SECONDS[name] / simulation.clock.dt)
    simulation.run(ticks - 32 * TRAIL)
    for _ in range(8 * TRAIL):
        painter.frame(herd_of(simulation, moment_of(simulation)), time=simulation.clock.now)
        simulation.run(4)
    return painter.frame(herd_of(simulation, moment_of(simulation)), time=simulation.clock.now, title=name)


if __name__ == "__main__":
    write_png(HERE / "sheep-pasture.png", walked("sheep-pasture"))
    pictures = [(name, walked(name, (760, 480))) for name in SECONDS if name != "sheep-pasture"]
    write_png(HERE / "levels.png", contact_sheet(pictures, columns=2))

"""Make a film of the shipped scenes: ``python docs/showreel.py [FILE] [--seconds 30] [--levels NAME ...]``."""

import argparse
from pathlib import Path

from flockbrush.output.pictures import herd_of, painter_of
from flockbrush.render import Video
from flockbrush.runs.run import start
from flockbrush.runs.snapshots import moment_of

SIZE, FPS = (1280, 720), 32
SCENES = {  # level: simulated seconds before the scene, then azimuth and elevation in degrees, or "plan"
    "meadow": (6, "plan"),
    "gorge": (16, "plan"),
    "merino": (63, 90, 18),
    "predators-valley": (12, 90, 18),
    "anthill": (12, "plan"),
    "river": (20, 60, 32),
    "pillars": (8, 90, 18),
    "geese": (20, 90, 18),
    "skein": (8, 130, 24),
    "sheep-pasture": (26, 110, 20),
}


def scene(name, seconds):
    """Yield pictures (h, w, 3) of a level, `FPS` per second."""
    before, *look = SCENES[name]
    space = look != ["plan"]
    simulation = start(name)
    try:
        azimuth, elevation = look if space else (90, None)
        view = "space" if space else "plan"
        painter = painter_of(simulation, SIZE, view=view, azimuth=azimuth, elevation=elevation)
        step = max(1, round(1 / (FPS * simulation.clock.dt)))
        simulation.run(round(before / simulation.clock.dt))
        for frame in range(round(seconds * FPS)):
            moment = moment_of(simulation)
            herd = herd_of(simulation, moment)
            if space:
                painter.chase(herd, 1 / FPS if frame else None)
            yield painter.frame(herd, time=moment.time, title=name)
            simulation.run(step)
    finally:
        simulation.close()


def main(arguments=None):
    """Write the film."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("file", nargs="?", default="showreel.mp4")
    parser.add_argument("--seconds", type=float, default=30.0)
    parser.add_argument("--levels", nargs="+", default=list(SCENES), choices=list(SCENES))
    told = parser.parse_args(arguments)
    with Video(Path(told.file), FPS, SIZE) as film:
        for name in told.levels:
            for picture in scene(name, told.seconds / len(told.levels)):
                film.write(picture)
    print(f"wrote {told.file}: {', '.join(told.levels)}")


if __name__ == "__main__":
    main()

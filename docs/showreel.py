"""Make a film of the shipped scenes: ``python docs/showreel.py [FILE] [--seconds 30] [--levels NAME ...]``."""

import argparse
from pathlib import Path

from flockbrush.output.pictures import herd_of, painter_of
from flockbrush.render import Video
from flockbrush.runs.run import start
from flockbrush.runs.snapshots import moment_of

SIZE, FPS = (1280, 720), 32
SCENES = {  # level: seconds that it has run when it is shown, and from where one looks
    "meadow": (6, "plan"),
    "gorge": (16, "plan"),
    "merino": (20, "space"),
    "predators-valley": (12, "space"),
    "anthill": (12, "plan"),
    "river": (20, "plan"),
    "pillars": (8, "space"),
    "geese": (20, "space"),
    "skein": (8, "space"),
    "sheep-pasture": (26, "plan"),
}


def scene(name, seconds):
    """Pictures (h, w, 3) of a level, `FPS` a second."""
    before, view = SCENES[name]
    simulation = start(name)
    try:
        painter = painter_of(simulation, SIZE, view=view, elevation=18.0 if view == "space" else None)
        step = max(1, round(1 / (FPS * simulation.clock.dt)))
        simulation.run(round(before / simulation.clock.dt))
        for frame in range(round(seconds * FPS)):
            moment = moment_of(simulation)
            herd = herd_of(simulation, moment)
            if view == "space":
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

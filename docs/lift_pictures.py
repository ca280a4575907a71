"""Draw the picture of the flight window: ``python -m docs.lift_pictures``.  No screen is needed."""

import os
import tempfile
from pathlib import Path

os.environ["SDL_VIDEODRIVER"] = os.environ["SDL_AUDIODRIVER"] = "dummy"
os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
os.environ["XDG_CONFIG_HOME"] = os.environ["XDG_STATE_HOME"] = tempfile.mkdtemp()  # default settings
import numpy as np
import pygame

from benchmarks.lift import filmed, flight, seen, turned
from flockbrush.lifting.flight_show import Show
from flockbrush.render import write_png
from flockbrush.studio.lift_window import LiftWindow

HERE = Path(__file__).parent


def window(frame=120, bird=5):
    """Return a picture of the window with twenty boids lifted from their tracks."""
    truth, camera = filmed(turned(flight(20, 3, "tight"), 2), 20.0)
    camera = camera.model_copy(update={"near": 10.0, "far": 200.0})
    made = LiftWindow(Show.lifted(seen(truth, camera, 0.5, 0), camera, "starlings.csv", 0.8), (1280, 720), "light")
    made.step(frame)
    made.bird = bird
    made.look_from(made.painter.camera.turned(np.radians(25), np.radians(-6)))
    made.fit()
    for _ in range(3):
        made.frame(1 / 30)
    picture = pygame.surfarray.array3d(made.screen).swapaxes(0, 1)
    made.close()
    return np.ascontiguousarray(picture)


if __name__ == "__main__":
    write_png(HERE / "lift.png", window())

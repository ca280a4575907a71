"""Draw the picture of the film window: ``python -m docs.clip_pictures``.  No screen is needed."""

import os
import tempfile
import time
from pathlib import Path

os.environ["SDL_VIDEODRIVER"] = os.environ["SDL_AUDIODRIVER"] = "dummy"
os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
os.environ["XDG_CONFIG_HOME"] = os.environ["XDG_STATE_HOME"] = tempfile.mkdtemp()  # default settings

import cv2
import numpy as np
import pygame

from benchmarks.lift import crossing
from benchmarks.sky_film import film
from docs.contact_sheet import contact_sheet
from flockbrush.film.clip_document import Book
from flockbrush.film.clip_frames import Film, Sky
from flockbrush.film.landmarks import Landmark
from flockbrush.output.pictures import herd_of, painter_of
from flockbrush.render import Video, write_png
from flockbrush.runs.run import start
from flockbrush.runs.snapshots import moment_of
from flockbrush.studio.film.clip_window import ClipWindow

HERE = Path(__file__).parent
SIZE = (960, 600)


def herd_film(path, frames=40):
    """Film a shipped level from above, as a drone would."""
    simulation = start("sheep-pasture")
    painter = painter_of(simulation, (1280, 800))
    simulation.run(800)
    with Video(path, 16, (960, 368)) as video:
        for _ in range(frames):
            shot = painter.frame(herd_of(simulation, moment_of(simulation)), time=simulation.clock.now)
            video.write(np.ascontiguousarray(shot[200:568, 160:1120]))
            simulation.run(2)
    simulation.close()
    return Film(path)


def bird_film(path, frames=60):
    """Film birds that cross in the sky."""
    xyz, camera = crossing(20, 1)
    with Video(path, 30, (camera.width, camera.height)) as video:
        for picture in film(xyz[:frames], camera):
            video.write(np.repeat(picture[..., None], 3, axis=2))
    return Film(path)


class PictureStage:
    """A film window with simulated mouse input."""

    def __init__(self, film, mode, folder):
        self.window = ClipWindow(Book(film, folder), SIZE, "light", mode=mode)

    def wait(self):
        """Wait until all background work is done."""
        self.window.frame(1 / 30)
        while self.window.jobs:
            self.window.frame(1 / 30)
            time.sleep(0.02)

    def stroke(self, *places):
        """Drag with the left button along points of the film."""
        mode, at = self.window.mode, self.window.at
        mode.press(places[0], at(places[0]))
        for a, b in zip(places, places[1:], strict=False):
            for share in np.linspace(0.1, 1, 10):
                place = tuple(np.add(a, np.subtract(b, a) * share))
                self.window.now += 0.02
                mode.drag(place, at(place))
        mode.release(places[-1], at(places[-1]))

    def picture(self):
        """Close the window and return its picture, (h, w, 3) uint8."""
        self.window.toasts.shown.clear()
        for _ in range(3):
            self.window.frame(1 / 30)
        shot = np.ascontiguousarray(pygame.surfarray.array3d(self.window.screen).swapaxes(0, 1))
        self.window.close()
        return shot


def landmarks(film, folder):
    stage = PictureStage(film, "landmarks", folder)
    marks = (Landmark(4, 30, 90, 90, 70), Landmark(30, 680, 190, 90, 80))
    stage.window.book.mark("landmarks", "landmarks", 0, landmarks=marks)
    for _ in marks:
        stage.wait()
    stage.window.go(20)
    return stage.picture()


def masks(film, folder):
    stage = PictureStage(film, "mask", folder)
    stage.window.mode.set_size(40)
    for wall in (
        ((160, 285), (200, 285)),
        ((310, 145), (350, 135)),
        ((520, 230), (525, 230)),
        ((640, 145), (710, 110)),
    ):
        stage.stroke(*wall)
    stage.window.mode.take_layer("regions")
    stage.window.mode.set_size(110)
    for region, stroke in ((2, ((90, 90), (420, 90))), (6, ((470, 290), (880, 300)))):
        stage.window.mode.take_region(region)
        stage.stroke(*stroke)
    return stage.picture()


def birds(film, folder):
    stage = PictureStage(film, "birds", folder)
    stage.window.mode.follow_all()
    stage.wait()
    stage.window.go(45)
    here = stage.window.book.state.birds.at(45)
    stage.window.mode.select(min(here))
    return stage.picture()


def sketch(folder):
    stage = PictureStage(Sky(), "sketch", folder)
    for k in range(4):
        x = np.linspace(120, 1160, 24)
        stage.stroke(*zip(x, 150 + 110 * k + 50 * np.sin(x / 160 + 0.3 * k), strict=True))
    stage.window.go(110)
    return stage.picture()


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        herd, sky = herd_film(Path(folder) / "herd.mp4"), bird_film(Path(folder) / "birds.mp4")
        scenes = [
            ("landmarks hold the camera still", landmarks(herd, folder)),
            ("obstacles and regions", masks(herd, folder)),
            ("birds, put right by hand", birds(sky, folder)),
            ("a sketched flock", sketch(folder)),
        ]
    small = [(name, cv2.resize(shot, (800, 500), interpolation=cv2.INTER_AREA)) for name, shot in scenes]
    write_png(HERE / "clip.png", contact_sheet(small, columns=2))

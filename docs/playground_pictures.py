"""Draw the pictures of the playground: ``python -m docs.playground_pictures``.  No screen is needed."""

import os
import tempfile
from pathlib import Path

os.environ["SDL_VIDEODRIVER"] = os.environ["SDL_AUDIODRIVER"] = "dummy"
os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
os.environ["XDG_CONFIG_HOME"] = os.environ["XDG_STATE_HOME"] = tempfile.mkdtemp()  # default settings

import cv2
import numpy as np
import pygame
from flockbrush.components import BrushBinding, Position

from docs.contact_sheet import contact_sheet
from flockbrush.render import write_png
from flockbrush.studio.app import App
from flockbrush.studio.session import Session
from flockbrush.studio.thumbnails import make_in_background

HERE = Path(__file__).parent


class PictureStage:
    """A playground window with simulated mouse input."""

    def __init__(self, level, theme="light", size=(1280, 720), seconds=6.0):
        self.app = App(Session.open(level), size, theme)
        self.app.overlays = {"trails", "shadows"}
        self.app.thumbnails.start()
        self.app.session.play()
        self.live(seconds)

    def live(self, seconds):
        """Run the window for some frames."""
        for _ in range(round(30 * seconds)):
            self.app.frame(1 / 30)

    def settle(self):
        """Wait with the herd paused until ground, thumbnails and labels are drawn."""
        self.app.session.pause()
        make_in_background((), self.app.thumbnails.SIDE, self.app.theme).wait()
        for _ in range(200):
            self.app.frame(1 / 30)
            pygame.time.wait(5)

    def post(self, kind, **values):
        pygame.event.post(pygame.event.Event(kind, **values))
        self.app.frame(1 / 30)

    def at(self, xy):
        return tuple(round(v) for v in self.app.canvas.pixels(xy))

    def drag(self, *points, steps=8):
        """Drag with the left button along points, in metres."""
        self.post(pygame.MOUSEBUTTONDOWN, pos=self.at(points[0]), button=1)
        for a, b in zip(points, points[1:], strict=False):
            for k in range(1, steps + 1):
                to = self.at(np.add(a, np.subtract(b, a) * k / steps))
                self.post(pygame.MOUSEMOTION, pos=to, rel=(0, 0), buttons=(1, 0, 0))
        self.post(pygame.MOUSEBUTTONUP, pos=self.at(points[-1]), button=1)

    def hover(self, xy):
        self.post(pygame.MOUSEMOTION, pos=self.at(xy), rel=(0, 0), buttons=(0, 0, 0))

    def panel(self, name):
        self.app.column.show_titled(name.capitalize())

    def select(self, brush, near):
        """Zoom in on the animal of a brush nearest to a point."""
        world = self.app.session.simulation.world
        names = self.app.world_palette().names
        mine = np.flatnonzero(world.agents[BrushBinding.brush] == names.index(brush))
        gap = np.linalg.norm(world.agents[Position.xyz][mine, :2] - near, axis=1)
        self.app.select(int(world.agents.ids[mine[np.argmin(gap)]]))

    def picture(self):
        """Close the window and return its picture, (h, w, 3) uint8."""
        self.settle()
        shot = np.ascontiguousarray(pygame.surfarray.array3d(self.app.screen).swapaxes(0, 1))
        self.app.close()
        return shot


def painting():
    """A brush stroke across the path of a herd, which mills inside it."""
    stage = PictureStage("meadow", seconds=7)
    level = stage.app.session.level
    stage.app.choose("brush", "mill-hollow")
    stage.app.set_size(11.0)
    w, h = level.width, level.height
    stage.drag((0.40 * w, 0.30 * h), (0.47 * w, 0.27 * h))
    stage.live(3)
    stage.hover((0.60 * w, 0.55 * h))
    return stage.picture()


def why():
    """A fleeing animal and the explanation of its motion."""
    stage = PictureStage("predators-valley", seconds=9)
    level = stage.app.session.level
    stage.app.take_tool("select")
    stage.app.overlays |= {"forces", "field_of_view", "occlusion"}
    stage.select("reindeer-flee", (0.5 * level.width, 0.5 * level.height))
    stage.panel("animal")
    return stage.picture()


def crowding():
    """The density overlay and the measures over time."""
    stage = PictureStage("gorge", "dark", seconds=24)
    stage.app.overlays |= {"density"}
    stage.panel("charts")
    return stage.picture()


def ways():
    """The navigation field that leaders follow."""
    stage = PictureStage("gorge", seconds=3)
    stage.app.overlays |= {"navigation", "leaders"}
    stage.app.take_tool("goal")
    stage.panel("view")
    return stage.picture()


def regions():
    """Painted brushes and speed limits."""
    stage = PictureStage("river", seconds=6)
    stage.app.overlays |= {"regions", "caps"}
    stage.app.take_tool("cap")
    stage.panel("view")
    return stage.picture()


def arrows():
    """A guide while it is drawn."""
    stage = PictureStage("meadow", "dark", seconds=5)
    level = stage.app.session.level
    stage.app.take_tool("guide")
    w, h = level.width, level.height
    stage.drag((0.62 * w, 0.72 * h), (0.5 * w, 0.62 * h), (0.42 * w, 0.45 * h), (0.46 * w, 0.3 * h))
    stage.live(2)
    stage.panel("profile")
    return stage.picture()


def space(level, theme, seconds, closer=1.0, turn=0.0, over=0.0, overlays=()):
    """A herd in the 3D view, from a good angle."""
    stage = PictureStage(level, theme, seconds=seconds)
    stage.app.overlays |= set(overlays)
    if not stage.app.canvas.in_space:  # levels of birds open in space
        stage.app.toggle_space()
    canvas = stage.app.canvas
    canvas.look(canvas.camera.turned(np.radians(turn), np.radians(over)))
    canvas.fit_herd()
    canvas.look(canvas.camera.zoomed(closer))
    if not canvas.follows:
        canvas.follow()
    stage.live(1)  # trails in the 3D view start when it opens
    stage.panel("view")
    return stage


def starlings():
    """A flock between pillars with one bird selected."""
    stage = space("pillars", "light", 7)  # the default view: in others a pillar may hide the flock
    stage.app.take_tool("select")
    stage.app.select(int(stage.app.session.simulation.agents.ids[40]))
    return stage.picture()


def skein():
    """A skein of birds high above the ground in the dark theme."""
    return space("skein", "dark", 14, turn=50, over=10).picture()


def elephants():
    """A falcon that scatters sparrows above a herd on the ground, with the explanation of its turns."""
    stage = space("elephants", "light", 15.6, turn=-30, over=2)
    stage.select("falcon", (0.0, 0.0))
    app = stage.app
    falcon = app.session.simulation.world.agents.row(app.selected)
    x, y, z = app.session.simulation.world.agents[Position.xyz][falcon]
    app.canvas.look(app.canvas.camera.at(x, y, z - 1.0).zoomed(3.0))
    stage.panel("animal")
    return stage.picture()


def sheep():
    """Walking sheep, with the view of one of them on the ground."""
    return space("sheep-pasture", "light", 12, closer=1.2, turn=30, over=6, overlays=("density",)).picture()


if __name__ == "__main__":
    scenes = [
        ("why does it turn?", why()),
        ("density, and measures over time", crowding()),
        ("the way to a goal", ways()),
        ("brushes and speed limits", regions()),
        ("a new arrow for leaders", arrows()),
        ("painting", painting()),  # last, when the palette has all its thumbnails
    ]
    write_png(HERE / "playground.png", scenes[-1][1])
    small = [(name, cv2.resize(shot, (960, 540), interpolation=cv2.INTER_AREA)) for name, shot in scenes]
    write_png(HERE / "playground-gallery.png", contact_sheet(small, columns=2))
    scenes = [
        ("starlings between pillars", starlings()),
        ("a skein, from behind", skein()),
        ("sparrows among elephants, and a falcon", elephants()),
        ("sheep, and how crowded it is", sheep()),
    ]
    small = [(name, cv2.resize(shot, (960, 540), interpolation=cv2.INTER_AREA)) for name, shot in scenes]
    write_png(HERE / "playground-space.png", contact_sheet(small, columns=2))

"""A close-up video of a flock in line formation: beating wings, the leader, and the power each bird saves."""

from __future__ import annotations

import os

import numpy as np

from flockbrush.components import FormationPlace, Heading, Position, Velocity
from flockbrush.engine.files import refused
from flockbrush.render import write_png
from flockbrush.render.canvas import Canvas
from flockbrush.render.drawn_terrain import nice
from flockbrush.render.picture_files import Video
from flockbrush.render.style import mix, rgb, theme_of
from flockbrush.runs.power_savings import savings_of, wingspans_of
from flockbrush.runs.run import start
from flockbrush.systems.palette import Palette

SIZE = 1120, 680
GROUND, BARS = 560, 90  # pixels of height: the view, and the bars below
BEAT = 4.0  # wing beats a second of a goose
LEAST, MOST = 34.0, 150.0  # m across the view
LARGER = 1.5  # birds are drawn so much larger than they are
SAVED = rgb("#1f9d7a"), rgb("#d08a3a")  # much, little
FULL = 0.35  # Σ g at which a bird is drawn as saving much


class FollowCamera:
    """A camera that follows a flock smoothly."""

    def __init__(self):
        self.middle, self.across = None, LEAST

    def look(self, xy, dt):
        low, high = xy.min(axis=0), xy.max(axis=0)
        middle, wide = (low + high) / 2, (high - low) * (1.15, 1.15 * SIZE[0] / GROUND)
        across = float(np.clip(wide.max() + 8.0, LEAST, MOST))
        if self.middle is None:
            self.middle, self.across = middle, across
        share = min(1.0, 1.5 * dt)
        self.middle = self.middle + min(1.0, 4.0 * dt) * (middle - self.middle)
        self.across += share * (across - self.across)

    def at(self, xy):
        """Pixels of places in metres, north up."""
        scale = SIZE[0] / self.across
        return (np.asarray(xy) - self.middle) * (scale, -scale) + (SIZE[0] / 2, 30 + GROUND / 2)

    @property
    def scale(self):
        return SIZE[0] / self.across


def film(level, path, seconds=60.0, seed=None, fps=16, theme="light", say=lambda done: None):
    """Run a level and write a video of its flock.

    Parameters
    ----------
    level : str
        A file, or the name of a shipped level.
    path : path
        ``.mp4`` for a film; ``.png`` for its last frame.
    seconds : float
        The film ends then, or when the last bird has left.

    Returns
    -------
    dict
        ``frames``, and ``saved``: Σ g of a bird, mean over the birds in formation at the end of the film.
    """
    simulation, look, camera = start(level, seed=seed), theme_of(theme), FollowCamera()
    if os.path.realpath(path) in map(os.path.realpath, simulation.inputs([path])):
        raise refused(path, "the level is made of this file; choose another name")
    if not simulation.world.resource(Palette).flies.any():
        raise refused(level, "none of its animals fly; a film of a formation needs a level with birds, such as geese")
    every = max(1, round(32 / fps))
    image, summary = None, {"frames": 0, "saved": float("nan")}

    def frames():
        nonlocal image
        for k in range(int(seconds * 32 / every)):
            simulation.run(every)
            if not len(simulation.agents):
                return
            image = np.full((SIZE[1], SIZE[0], 3), look.ground, np.uint8)
            mean = _frame(Canvas(image), simulation, camera, every / 32, look)
            summary.update(frames=k + 1, saved=mean)
            say(k)
            yield image

    if str(path).lower().endswith(".png"):
        for _ in frames():
            pass
        write_png(path, image)
    else:
        with Video(path, 32 / every, SIZE) as video:
            for frame in frames():
                video.write(frame)
    return summary


def _frame(canvas, simulation, camera, dt, look):
    """Draw one frame; returns the mean power saved by birds in formation."""
    agents, time = simulation.agents, simulation.clock.tick / 32
    xyz, forward = agents[Position.xyz], agents[Heading.forward]
    place = agents[FormationPlace.place]
    palette_wing = wingspans_of(simulation.world)
    camera.look(xyz[:, :2], dt)
    _grid(canvas, camera, look)
    saved = savings_of(simulation.world)
    flying = agents[FormationPlace.track].any(axis=1)
    for i in np.argsort(xyz[:, 2]):
        at = camera.at(xyz[i, :2])
        wing = max(LARGER * palette_wing[i] * camera.scale, 9.0)
        height = xyz[i, 2] - xyz[:, 2].min() + 0.12 * min(xyz[i, 2], 40.0)
        shade = at + (0.6 * height * camera.scale / 4, 0.9 * height * camera.scale / 4)
        beat = 0.0 if not flying[i] else np.sin(2 * np.pi * (BEAT * time + 0.37 * agents.ids[i]))
        skin = mix(SAVED[1], SAVED[0], float(np.clip(saved[i] / FULL, 0, 1))) if flying[i] else look.muted
        _bird(canvas, shade, forward[i], 0.85 * wing, beat, flying[i], look.shadow, None, 0.16)
        _bird(canvas, at, forward[i], wing, beat, flying[i], look.leader if place[i] == 0 else skin, look.outline, 1.0)
    metres = nice(60 / camera.scale)
    bar = f"{metres:g} m; birds {LARGER:g} times as large"
    canvas.scale_bar((SIZE[0] - 12, 30 + GROUND - 14), metres * camera.scale, bar, look)
    _bars(canvas, agents, saved, flying, look)
    phase = "on the ground" if not flying.any() else "in the air"
    top = xyz[:, 2].max()
    canvas.area([(0, 0), (SIZE[0], 0), (SIZE[0], 30), (0, 30)], look.paper)
    speed = float(np.linalg.norm(agents[Velocity.xyz], axis=1).mean())
    words = f"{len(xyz)} birds {phase}   {top:.0f} m up   {speed:.1f} m/s"
    canvas.words(words, (12, 15), 17, look.ink, anchor=(0, 0.5))
    canvas.words(f"{int(time // 60)}:{time % 60:04.1f}", (SIZE[0] - 12, 15), 17, look.ink, anchor=(1, 0.5))
    return float(saved[flying].mean()) if flying.any() else float("nan")


def _grid(canvas, camera, look):
    """Draw lines every ten metres, which show the motion of the flock."""
    half = camera.across / 2
    for axis in (0, 1):
        low, high = camera.middle[axis] - half, camera.middle[axis] + half
        for value in np.arange(np.ceil(low / 10) * 10, high, 10):
            ends = np.array([[value, camera.middle[1] - half], [value, camera.middle[1] + half]])
            if axis:
                ends = np.array([[camera.middle[0] - half, value], [camera.middle[0] + half, value]])
            canvas.line(camera.at(ends), 2 if value % 100 == 0 else 1, look.muted, 0.3 if value % 100 == 0 else 0.12)


WING = np.array([(0.0, 0.10), (0.16, 0.17), (0.34, 0.15), (0.5, -0.02), (0.33, 0.02), (0.17, -0.02), (0.0, -0.10)])
BODY = np.array([(0.0, 0.42), (0.05, 0.25), (0.06, 0.0), (0.045, -0.2), (0.07, -0.33), (0.0, -0.30)])


def _bird(canvas, at, forward, wing, beat, flying, colour, rim, alpha):
    """A bird from above: wings foreshortened and swept by their beat, folded on the ground."""
    size = max(float(np.hypot(forward[0], forward[1])), 1e-9)
    fx, fy = forward[0] / size, -forward[1] / size
    spread = np.cos(0.75 * beat) if flying else 0.24
    sweep = 0.10 * beat
    for side in (-1, 1):
        points = WING.copy()
        points[:, 1] -= sweep * points[:, 0] * 2 + (0.0 if flying else 0.25 * points[:, 0])
        canvas.area(_placed(points * (side * spread, 1.0), at, fx, fy, wing), colour, alpha)
    outline = np.vstack([BODY, BODY[-2:0:-1] * (-1, 1)])
    body = _placed(outline * 0.9, at, fx, fy, wing)
    canvas.area(body, colour, alpha)
    if rim is not None and wing > 14:
        canvas.line(body, 1.0, rim, 0.35, closed=True)


def _placed(points, at, fx, fy, wing):
    """Points (aside, along) of a bird in pixels."""
    aside, along = points[:, 0:1] * wing, points[:, 1:2] * wing
    return np.asarray(at) + along * (fx, fy) + aside * (-fy, fx)


def _bars(canvas, agents, saved, flying, look):
    """Draw bars of the power saved by each bird, from left to right."""
    top = 30 + GROUND
    canvas.area([(0, top), (SIZE[0], top), SIZE, (0, SIZE[1])], look.paper)
    title = "power saved by each bird (sum of g, dimensionless), from left to right"
    canvas.words(title, (12, top + 12), 14, look.muted, anchor=(0, 0.5))
    birds = np.flatnonzero(flying)
    if not len(birds):
        return
    track = agents[FormationPlace.track][birds]
    aside = agents[Position.xyz][birds, 0] * track[:, 1] - agents[Position.xyz][birds, 1] * track[:, 0]
    wide = min(40.0, (SIZE[0] - 40) / len(birds))
    left = SIZE[0] / 2 - wide * len(birds) / 2
    for value in (0.0, FULL):
        y = SIZE[1] - 6 - (BARS - 34) * value / (1.3 * FULL)
        canvas.line([(left, y), (left + wide * len(birds), y)], 1, look.muted, 0.5, dash=(4, 4))
        canvas.words(f"{value:g}", (left - 6, y), 12, look.muted, anchor=(1, 0.5))
    for k, i in enumerate(birds[np.argsort(aside, kind="stable")]):
        tall = (BARS - 34) * min(saved[i] / (1.3 * FULL), 1.0)
        x = left + k * wide
        colour = (
            look.leader if agents[FormationPlace.place][i] == 0 else mix(SAVED[1], SAVED[0], min(saved[i] / FULL, 1))
        )
        corners = [
            (x + 2, SIZE[1] - 6 - tall),
            (x + wide - 2, SIZE[1] - 6 - tall),
            (x + wide - 2, SIZE[1] - 6),
            (x + 2, SIZE[1] - 6),
        ]
        canvas.area(corners, colour)
        canvas.line(corners, 1, look.outline, 0.4, closed=True)

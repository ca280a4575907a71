"""Dust behind runners on dry ground, and ripples behind swimmers and waders.

Nothing is kept from frame to frame.  Each animal leaves a puff (or a ring) whenever its own clock strikes; where it was
then follows from its place, velocity and the time since, and how the puff lies from its id and the number of the
strike.  So a film shows the same dust wherever it begins.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flockbrush.render.facets import NEARER
from flockbrush.render.gaits import RESTING, RUN, SWIM, sizes
from flockbrush.render.shapes import ink_of, kernel, over, window
from flockbrush.render.style import mix
from flockbrush.systems.landscape import Landscape

# how much dust a runner raises, by eye
DUSTY = {"dirt": 1.0, "sand": 1.0, "road": 0.9, "dry grass": 0.7, "gravel": 0.6, "snow": 0.5}
WET = ("water", "shallows", "deep water")
FULL = 4.5  # body lengths a second: who runs so fast raises all the dust that there is
EVERY, LASTS = (0.16, 0.24), (0.8, 1.2)  # s from one puff, or ring, to the next, and that one is seen
FAINT = 4.0  # pixels of a body length; smaller animals raise nothing that one could see
MOST = 4000  # puffs of a frame: of more runners each has fewer
THICK = 1.4  # pixels to both sides of a ring's line
DUST, RING = 0, 1


class Wakes(NamedTuple):
    """What animals leave behind them, one row each."""

    # dust, rings: (n,); how strong, 0 to 1
    dust: np.ndarray
    rings: np.ndarray
    velocity: np.ndarray  # (n, 2); m/s


class WakeMarks(NamedTuple):
    """Puffs or rings of a moment, one row each: the animal's row, place (m, 2) m, radius m, opacity 0 to 1."""

    row: np.ndarray
    xy: np.ndarray
    radius: np.ndarray
    alpha: np.ndarray


class MarksInView(NamedTuple):
    """Puffs or rings as they are drawn, one row each."""

    at: np.ndarray  # (m, 2); pixels
    # wide, high: (m,); half axes, pixels
    wide: np.ndarray
    high: np.ndarray
    near: np.ndarray  # (m,); 1 / m; what lies nearer hides a mark, if that is larger than 0
    alpha: np.ndarray  # (m,)
    # (m, 2); unit vectors in the picture: rings are strongest to both sides of it, so that together they are a wake
    course: np.ndarray


def wakes_of(simulation, moment, clip, flying) -> Wakes:
    """The wakes of the animals of a moment, which show these clips (n,); who flies leaves none."""
    land = simulation.world.resource(Landscape)
    names = [kind.name for kind in land.kinds]
    (ny, nx), cells = land.brush.shape, moment.xyz[:, :2] / land.cell
    ix, iy = np.clip(cells, 0, (nx - 1, ny - 1)).astype(int).T
    painted = land.painted.ground[iy, ix]
    kind = np.where(painted < -1, land.native.kind[iy, ix], painted)
    dusty = np.array([DUSTY.get(name, 0.0) for name in names] + [0.0])[
        kind
    ]  # -1, the last, is bare ground, drawn as grass
    wet = np.array([name in WET for name in names] + [False])[kind]
    lengths = sizes(moment.velocity) / moment.length
    runs = (clip == RUN) & ~wet & ~flying
    wades = ((clip == SWIM) | wet) & ~flying & (lengths > 4 * RESTING)
    return Wakes(
        np.where(runs, dusty * np.clip(lengths / FULL, 0, 1), 0.0), np.where(wades, np.clip(lengths, 0.3, 1), 0.0),
        moment.velocity[:, :2],
    )  # fmt: skip


def marks_of(herd, rows, time, kind) -> WakeMarks:
    """Puffs (DUST) or rings (RING) of these rows of a checked herd with wakes at a time, s; old ones first."""
    every, lasts = EVERY[kind], LASTS[kind]
    strength = herd.wakes[kind][rows]
    rows, strength = rows[strength > 0.02], strength[strength > 0.02]
    count = int(np.clip(MOST // max(len(rows), 1), 1, lasts / every))
    ids = np.arange(len(herd.xy)) if herd.ids is None else np.asarray(herd.ids)
    beat = time / every + 0.381966 * ids[rows]  # no two neighbours at once
    struck = np.floor(beat)[None] - np.arange(count)[::-1, None]
    age = (beat - struck) * every  # (count, n)
    left = 1 - age / (count * every)
    u, v = scatter(ids[rows], struck, 1), scatter(ids[rows], struck, 2)
    length = np.asarray(herd.length)[rows]
    back = age[..., None] * herd.wakes.velocity[rows] + 0.4 * length[:, None] * herd.forward[rows, :2]
    if kind == DUST:
        radius, alpha = length * (0.1 + 0.1 * u + 0.26 * age / lasts), strength * left**1.5
        aside = np.stack([u - 0.5, v - 0.5], axis=-1) * (0.5 * length)[:, None]
    else:
        radius, alpha, aside = length * (0.14 + 0.6 * age / lasts), 0.7 * strength * left**2, 0.0
    place = herd.xy[rows] - back + aside
    every_row = np.broadcast_to(rows, age.shape)
    return WakeMarks(every_row.ravel(), place.reshape(-1, 2), radius.ravel(), alpha.ravel())


def wake_ink(theme, kind):
    """Red, green and blue of dust, or of rings on water."""
    colour = (
        mix(theme.cap, theme.paper if sum(theme.paper) > 384 else theme.ink, 0.4)
        if kind == DUST
        else mix(theme.water, (255, 255, 255), 0.75)
    )
    return ink_of(colour)


def scatter(ids, numbers, salt):
    """Numbers from 0 to 1 that belong to an id and a strike of its clock, of the shape of both."""
    mixed = np.sin(12.9898 * (ids % 4096) + 78.233 * (numbers % 4096) + 37.719 * salt) * 43758.5453
    return mixed - np.floor(mixed)


@kernel
def draw_marks(buffer, marks, ring, ink):
    """Draw soft discs, or both sides of rings."""
    frame, depth, clip = buffer
    alpha, near, course = marks.alpha, marks.near, marks.course
    for i in range(len(alpha)):
        x, y, a, b = marks.at[i, 0], marks.at[i, 1], marks.wide[i], marks.high[i]
        if alpha[i] < 0.01 or a < 0.5 or b < 0.2:
            continue
        thin = THICK / min(a, 3.0 * b)
        outer, inner = (1.0 + thin if ring else 1.0), (max(1.0 - thin, 0.0) if ring else 0.0)
        left, right, top, bottom = window(clip, x, y, a * outer, b * outer)
        hides = near[i] * NEARER if near[i] > 0 else np.inf
        for row in range(top, bottom):
            v = (row + 0.5 - y) / b
            half = a * np.sqrt(max(outer * outer - v * v, 0.0))
            for col in range(max(left, int(x - half)), min(right, int(x + half) + 1)):
                u = (col + 0.5 - x) / a
                far = u * u + v * v
                if far >= outer * outer or far < inner * inner or depth[row, col] > hides:
                    continue
                if ring:
                    far = np.sqrt(far)
                    aside = u * course[i, 1] - v * course[i, 0]
                    cover = (1.0 - abs(1.0 - far) / thin) * aside * aside
                else:
                    cover = 1.0 - far
                over(frame, row, col, ink[0], ink[1], ink[2], cover * alpha[i])


def wakes_on_plan(buffer, camera, theme, herd, time):
    """Draw the wakes of a checked herd on the plan that a `ViewCamera` shows; the depth is all 0."""
    if herd.wakes is None or time is None:
        return
    at, reach = camera.pixels(herd.xy), 4.0 * herd.length[:, None] * camera.scale
    visible = ((at + reach > buffer.clip[:2]) & (at - reach < buffer.clip[2:])).all(axis=1)
    rows = np.flatnonzero(visible & (herd.length * camera.scale > FAINT))
    for kind in (DUST, RING):
        marks = marks_of(herd, rows, time, kind)
        wide, course = marks.radius * camera.scale, herd.forward[marks.row] * (1.0, -1.0)
        shown = MarksInView(camera.pixels(marks.xy), wide, wide, np.zeros(len(wide)), marks.alpha, course)
        draw_marks(buffer, shown, kind == RING, wake_ink(theme, kind))


def wakes_in_space(buffer, camera, floor, theme, herd, xyz, time):
    """Draw the wakes of a checked herd at places (n, 3): dust hangs over the ground, ripples lie on it."""
    if herd.wakes is None or time is None:
        return
    far = (xyz - camera.eye) @ camera.axes[2]
    rows = np.flatnonzero((far > 0) & (herd.length * camera.focal > FAINT * far))
    for kind in (DUST, RING) if len(rows) else ():
        marks = marks_of(herd, rows, time, kind)
        high = floor + (0.3 if kind == DUST else 0.0) * marks.radius
        at, away = camera.project(np.column_stack([marks.xy, high]))
        visible = away > camera.numbers()[15]
        at, away, wide = at[visible], away[visible], (marks.radius * camera.focal / np.maximum(away, 1e-9))[visible]
        flat = 0.7 if kind == DUST else np.clip((camera.eye[2] - floor) / away, 0.05, 1.0)
        course = (herd.forward[marks.row] @ camera.axes[:2, :2].T)[visible] * (1.0, -1.0)
        shown = MarksInView(at, wide, wide * flat, 1 / away, marks.alpha[visible], course)
        draw_marks(buffer, shown, kind == RING, wake_ink(theme, kind))

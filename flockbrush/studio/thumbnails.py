"""Thumbnails of brushes, made by running them, for the palette of the playground and as tiles for Tiled.

A picture takes about a second to make and is kept in the user's cache folder, under a name that changes with the
brush.
"""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
from contextlib import suppress
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from types import SimpleNamespace

import numpy as np

from flockbrush.behaviours.behaviour import behaviours
from flockbrush.behaviours.species import shipped_species
from flockbrush.components import Heading, Position
from flockbrush.engine import files, picture_decoding
from flockbrush.engine.problems import ProblemsError
from flockbrush.levels.build import plane
from flockbrush.render.animal_looks import CLIPS, mesh_of
from flockbrush.render.canvas import Canvas
from flockbrush.render.drawn_herd import DrawnHerd
from flockbrush.render.gaits import RESTING
from flockbrush.render.mesh_bodies import LOOK_NAMES, Postures
from flockbrush.render.painter import Painter
from flockbrush.render.style import mix, rgb, theme_of
from flockbrush.render.view_camera import ViewCamera
from flockbrush.systems.measures import compute_milling, compute_polarization

ANIMALS, PACK = 40, 14
SECONDS = 8.0  # after which a herd does what its brush makes it do
TRAIL = 1.1  # s
LARGER = 1.1  # animals are drawn so many times as large as they are
FINE = 3  # drawn so many times as large, and shrunk
WINDOW = (8.0, 14.0)  # body lengths across: those outside are left out rather than drawn too small to see
TILE_WINDOW = (6.5, 9.0)  # the same for tiles, which are smaller
SKY = 60.0  # body lengths across at most, of birds
LEAST = 14.0  # a bird is drawn at least as large as the picture over this
LEAST_WINGED = 18.0  # the same with its wings spread
MILL = 0.7  # milling that makes a mill, of a herd that began on a ring
SOME = 0.35  # polarization out of disorder that makes a march
ALONG = np.pi / 7  # rad; marches go up to the right
AS_STORED = -1  # cv2.IMREAD_UNCHANGED
LIMBS = 12.0  # pixels of the picture before it is shrunk, from which animals have legs
VERSION = 4  # of these pictures: counts up when they look otherwise


def thumbnail(brush, size=64, theme="light", colour=None, body=None) -> np.ndarray:
    """What animals do under a brush: a disc with a moving group and short trails, ringed with the brush's colour.

    Parameters
    ----------
    size : int
        Pixels.
    theme : {"light", "dark", "vivid"} or Theme
    colour : "#rrggbb", optional
        Instead of the brush's own.
    body : str, optional
        How the animals look, as `body_of` tells it; by default as the shipped species that the brush is made for.

    Returns
    -------
    (size, size, 4) uint8
        Red, green, blue and opacity.
    """
    look = theme_of(theme)
    path = _path(brush, size, look, colour, body)
    picture = _kept(path, size)
    if picture is None:
        picture = draw_thumbnail(brush, size, look, colour, body)
        _keep(path, picture)
    return picture


def cached(brush, size=64, theme="light", colour=None, body=None) -> np.ndarray | None:
    """The picture if it has been made before, else None; at once."""
    return _kept(_path(brush, size, theme_of(theme), colour, body), size)


def placeholder(brush, size=64, theme="light", colour=None) -> np.ndarray:
    """What stands in for a picture that is still being made: the empty disc in the brush's ring."""
    return _empty_disc(size, rgb(colour or brush.colour), theme_of(theme))


@lru_cache(maxsize=256)
def _empty_disc(size, colour, theme):
    image = np.empty((FINE * size, FINE * size, 3), np.uint8)
    image[:] = theme.ground
    disc = _ringed(image, size, colour, theme)
    disc.flags.writeable = False  # many may hold it
    return disc


def make_in_background(names=(), size=64, theme="light") -> subprocess.Popen:
    """Begin to make the pictures of shipped brushes (all unless named) in a process of its own; `cached` finds them."""
    command = [sys.executable, "-m", "flockbrush.studio.thumbnails", "--size", str(size)]
    command += ["--theme", theme_of(theme).name]
    quiet = subprocess.DEVNULL
    return subprocess.Popen([*command, *names], stdin=quiet, stdout=quiet, stderr=quiet)


# the picture ---------------------------------------------------------------------


def draw_thumbnail(brush, size, theme, colour=None, body=None) -> np.ndarray:
    """The picture of a brush, made now."""
    look, colour = replace(theme, texture=theme.texture / 2, palette="own"), colour or brush.colour
    image = _picture(brush, FINE * size, look, colour, WINDOW, body or body_of(brush))
    return _ringed(image, size, rgb(colour), look)


def draw_tile(brush, size) -> np.ndarray:
    """The tile of a brush for Tiled, (size, size, 4): white animals on its colour."""
    colour = rgb(brush.colour)
    flat = replace(
        theme_of("light"), ground=colour, texture=0.0, trail=0.5, shadow_alpha=0.0, head_share=0.0, rim=0.0,
        outline=mix(colour, (0, 0, 0), 0.5), predator=(255, 255, 255), leader=(255, 255, 255),
    )  # fmt: skip
    image = _picture(brush, FINE * size, flat, "#ffffff", TILE_WINDOW)
    image = np.dstack([_shrunk(image, size), np.full((size, size), 255, np.uint8)])
    edge = mix(colour, (0, 0, 0), 0.22)
    image[[0, -1], :, :3] = image[:, [0, -1], :3] = edge
    return image


def body_of(brush, fauna=None) -> str:
    """How animals under a brush look: as the species it is named after, of this library or the shipped, or usual."""
    fauna, first = fauna or shipped_species(), next(iter(brush.made_for), "")
    with suppress(ProblemsError):
        if first in fauna.names():
            return fauna.get(first).look
    return "bird" if _in_the_air(brush) else "beast"


def _picture(brush, side, theme, colour, window, body=None):
    """Animals under a brush after some seconds, with trails, on a square of bare ground; with legs and wings of a body.

    Only a bird's wings make it larger: that one sees them is worth more than how far apart the birds are.
    """
    simulation = _settled(brush)
    try:
        step = max(1, round(TRAIL / 16 / simulation.clock.dt))
        moments = [_moment(simulation)]
        for _ in range(16):
            simulation.run(step)
            moments.append(_moment(simulation))
    finally:
        simulation.close()
    xy, length = moments[-1][0], brush.body.length
    flies = behaviours()[brush.model].flight is not None  # birds keep apart by many lengths, and some stray
    middle = _middle(xy, 0.4 * SKY * length if flies else None)
    far = float(np.quantile(np.abs(xy - middle).max(axis=1), 0.6 if flies else 0.9)) / length
    window = (window[0], SKY) if flies else window
    across = float(np.clip(2.3 * far + 1.5, *window)) * length
    winged = body is not None and _in_the_air(brush)
    larger = max(LARGER, across / length / (LEAST_WINGED if winged else LEAST))
    level = SimpleNamespace(width=across, height=across, name="")
    painter = Painter(level, (side, side), theme, words=False)
    painter.limbs = LIMBS
    painter.look(ViewCamera.fit(across, across, (side, side)))
    painter.backdrop = np.empty((side, side, 3), np.uint8)
    painter.backdrop[:] = theme.ground
    danger = behaviours()[brush.model].danger
    phase = 0.381966 * np.arange(len(xy)) % 1.0
    beats = np.sin(2 * np.pi * phase) if winged else None
    moved = np.linalg.norm(xy - moments[0][0], axis=1) > RESTING * TRAIL * length
    postures = None if body is None else _postures(body, moved, winged, phase)
    for k, (xy, forward) in enumerate(moments):
        herd = DrawnHerd(
            xy - middle + across / 2, forward, larger * length, larger * brush.body.radius,
            brush=np.zeros(len(xy), int), brush_colours=(colour,), predator=np.full(len(xy), danger),
            ids=np.arange(len(xy)), wings=beats, postures=postures,
        )  # fmt: skip
        frame = painter.frame(herd, time=k * step * simulation.clock.dt, legend=False)
    return frame


def _postures(look, moved, winged, phase):
    """What the bodies of animals show."""
    clip = "fly" if winged else next(clip for clip in ("swim", "walk") if clip in mesh_of(look).clips)
    clips = np.where(moved | winged, CLIPS.index(clip), CLIPS.index("rest"))
    return Postures(np.full(len(phase), LOOK_NAMES.index(look)), clips, phase)


def _in_the_air(brush):
    """Whether animals under a brush have wings: they fly, and are not held to the ground."""
    flight = behaviours()[brush.model].flight
    return flight is not None and not flight(brush.params).grounded


def _middle(xy, reach=None):
    """The middle of a herd, (2,) m; of birds, some of which stray, that of those within reach of each other."""
    if reach is None:
        return np.quantile(xy, (0.1, 0.9), axis=0).mean(axis=0)
    away = np.linalg.norm(xy[:, None] - xy[None], axis=-1)
    near = xy[away[np.argmax((away <= reach).sum(axis=1))] <= reach]
    return 0.5 * (near.min(0) + near.max(0))


def _settled(brush):
    """A herd under the brush that shows what it does, some seconds after it stood there."""
    ring = _run(brush, "ring", None)
    if compute_milling(ring.agents[Position.xyz][:, :2], ring.agents[Heading.forward]) > MILL:
        return ring
    ring.close()
    disorder = _run(brush, "scatter", None)
    if compute_polarization(disorder.agents[Heading.forward]) < SOME:
        return disorder
    disorder.close()
    return _run(brush, "scatter", ALONG)


def _run(brush, start, heading):
    hunts = behaviours()[brush.model].danger
    simulation = plane(brush, PACK if hunts else ANIMALS, start=start, seed=1, heading=heading)
    simulation.run(round(SECONDS / simulation.clock.dt))
    return simulation


def _moment(simulation):
    agents = simulation.agents
    return agents[Position.xyz][:, :2].copy(), agents[Heading.forward][:, :2].copy()


def _ringed(image, size, colour, theme):
    """The disc in the middle of a square picture, in a ring of this colour, shrunk to so many pixels."""
    side = len(image)
    canvas = Canvas(image)
    middle, wide = (side / 2, side / 2), 0.06 * side
    canvas.ring(middle, side / 2 - wide / 2 - FINE, wide, colour)
    canvas.ring(middle, side / 2 - wide - FINE, FINE * 0.7, theme.ink, 0.25)
    away = np.hypot(*(np.indices((side, side)) + 0.5 - side / 2))
    alpha = np.clip(side / 2 - FINE + 0.5 - away, 0, 1) * 255
    return np.dstack([_shrunk(image, size), _shrunk(alpha.astype(np.uint8), size)])


def _shrunk(image, size):
    import cv2

    return cv2.resize(image, (size, size), interpolation=cv2.INTER_AREA)


# the cache -----------------------------------------------------------------------


def cache_folder() -> Path:
    """Where pictures are kept: FLOCKBRUSH_CACHE, or the folder that the system has for such files."""
    own = os.environ.get("FLOCKBRUSH_CACHE")
    return Path(own) if own else files.cache_folder() / "thumbnails"


def _path(brush, size, theme, colour, body):
    """The file of a picture."""
    shown = f"{VERSION} {size} {theme.name} {colour or ''} {body or body_of(brush)}"
    return cache_folder() / f"{hashlib.sha256(shown.encode() + brush.source).hexdigest()[:32]}.png"


def _kept(path, size):
    """The picture in a file; None when there is none, or none that can be used."""
    from flockbrush.film.media import picture_size

    try:
        data = path.read_bytes()
    except OSError:
        return None
    image = picture_decoding.decoded(data, AS_STORED) if picture_size(data) == (size, size) else None
    if image is None or image.shape != (size, size, 4) or image.dtype != np.uint8:
        return None
    return np.ascontiguousarray(image[..., [2, 1, 0, 3]])


def _keep(path, image):
    """Write a picture into the cache; where that cannot be, it is made again next time."""
    import cv2

    with suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        files.write_bytes(path, cv2.imencode(".png", image[..., [2, 1, 0, 3]])[1].tobytes())


def write_tiles(path, library):
    """Put the pictures of a library's brushes into the tiles that Tiled shows, as the file assigns them."""
    import cv2

    from flockbrush.levels.tile_pictures import BRUSHES_FILE, known_brushes
    from flockbrush.levels.tilesets_data import COLUMNS, TILE

    image = Path(path) / Path(BRUSHES_FILE).with_suffix(".png")
    sheet = cv2.imread(str(image), cv2.IMREAD_UNCHANGED)
    known = known_brushes(Path(path) / BRUSHES_FILE)
    rows = -(-len(known) // COLUMNS) * TILE
    sheet = np.pad(sheet[:rows], [(0, max(0, rows - len(sheet))), (0, 0), (0, 0)])
    for number, name in enumerate(known):
        if name in library.names():
            y, x = (TILE * k for k in divmod(number, COLUMNS))
            sheet[y : y + TILE, x : x + TILE] = draw_tile(library.get(name), TILE)[..., [2, 1, 0, 3]]
    files.write_bytes(image, cv2.imencode(".png", sheet)[1].tobytes())


def main(arguments=None):
    """Make pictures of shipped brushes, or with ``--tiles FOLDER`` their tiles in a Tiled project."""
    import argparse

    from flockbrush.behaviours.brush import shipped

    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("names", nargs="*")
    parser.add_argument("--size", type=int, default=64)
    parser.add_argument("--theme", default="light")
    parser.add_argument("--tiles", metavar="FOLDER")
    options = parser.parse_args(arguments)
    library = shipped()
    if options.tiles:
        write_tiles(options.tiles, library)
        return
    window = os.getppid()
    for name in options.names or library.names():
        if os.getppid() != window:  # it has been killed, and nobody waits for pictures
            return
        thumbnail(library.get(name), options.size, options.theme)


if __name__ == "__main__":
    main()

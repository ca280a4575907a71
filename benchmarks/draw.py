"""Time drawing of frames, compared with the same animals drawn by pygame blits and by OpenCV.

Run from the repository's root::

    python benchmarks/draw.py

All programs draw the same animals, capsules of 1.2 x 0.7 m at one per 4 square metres, on one thread at 1280 x 720.
``animals`` is the rasteriser alone; ``frame`` adds the copy of the ground, legend and checks; ``trails`` adds trails.
``look`` are four-legged animals and flying birds, 38 pixels long; ``none`` is the same without legs and wings.  Then
the other work of a window is timed on a running level: redrawing the ground under a stroke, moving the camera, and
every overlay; ``anew`` is the time of an overlay after the camera or the ground has changed.  pygame blits pre-rotated
sprites (64 headings); OpenCV draws an anti-aliased line per animal.
"""

from __future__ import annotations

import argparse
import json
import os
import time
from types import SimpleNamespace

import numpy as np

from flockbrush.render.drawn_herd import DrawnHerd
from flockbrush.render.painter import Painter

SIZE = (1280, 720)
AREA = 4.0  # square metres per animal
LENGTH, RADIUS = 1.2, 0.35  # m


def scene(count, rng):
    """Return an empty level of a size for `count` animals, and the animals."""
    height = np.sqrt(count * AREA * SIZE[1] / SIZE[0])
    level = SimpleNamespace(name="bench", width=height * SIZE[0] / SIZE[1], height=height)
    turn = rng.uniform(0, 2 * np.pi, count)
    herd = DrawnHerd(
        xy=rng.uniform(0, 1, (count, 2)) * (level.width, level.height),
        forward=np.stack([np.cos(turn), np.sin(turn)], axis=1),
        length=LENGTH,
        radius=RADIUS,
        leader=rng.random(count) < 0.05,
        brush=rng.integers(0, 3, count),
        brush_colours=("#4b7bc9", "#c94ba8", "#6aa84f"),
        brush_names=("one", "two", "three"),
    )
    return level, herd


def median(draw, frames):
    """Return median and least milliseconds of `draw(k)` over frames, after a few for warm-up."""
    for k in range(3):
        draw(k)
    spent = []
    for k in range(3, frames + 3):
        start = time.perf_counter()
        draw(k)
        spent.append(1000 * (time.perf_counter() - start))
    return float(np.median(spent)), float(min(spent))


def moved(herd, k):
    """Return the herd k frames later, at walking speed."""
    return herd._replace(xy=herd.xy + herd.forward * (0.04 * k))


def ours(level, herd, frames):
    """Return the times of Flockbrush: the rasteriser, a frame, a frame with trails."""
    painter = Painter(level, SIZE, trails=3.0)
    out = painter.ground.copy()

    def animals(k):
        from flockbrush.render.drawn_herd import checked
        from flockbrush.render.sprites import looks_of

        ready = checked(moved(herd, k))
        stamps = painter._stamps_of(ready)
        look = looks_of(ready, len(stamps.brush_colours))
        painter._animals(out, ready, look, stamps)

    return {
        "animals": median(animals, frames),
        "frame": median(lambda k: painter.frame(moved(herd, k), time=k / 30, trails=False, out=out), frames),
        "trails": median(lambda k: painter.frame(moved(herd, k), time=k / 30, out=out), frames),
    }


def blits(level, herd, frames):
    """Return the times of pygame: a pre-rotated sprite for every animal."""
    os.environ.setdefault("SDL_VIDEODRIVER", "dummy")
    os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
    import pygame

    camera = Painter(level, SIZE).camera
    side = max(6, int(np.ceil(LENGTH * camera.scale)) + 2)
    base = pygame.Surface((side, side), pygame.SRCALPHA)
    pygame.draw.ellipse(base, (75, 123, 201), (0, side // 4, side, max(2, side // 2)))
    sprites = [pygame.transform.rotate(base, 360 * k / 64) for k in range(64)]
    screen, ground = pygame.Surface(SIZE), pygame.Surface(SIZE)

    def draw(k):
        now = moved(herd, k)
        corner = (camera.pixels(now.xy) - side / 2).astype(int).tolist()
        turn = (np.rint(np.arctan2(now.forward[:, 1], now.forward[:, 0]) * 64 / (2 * np.pi)).astype(int) % 64).tolist()
        screen.blit(ground, (0, 0))
        screen.blits([(sprites[t], at) for t, at in zip(turn, corner, strict=True)], False)

    return median(draw, frames)


def lines(level, herd, frames):
    """Return the times of OpenCV: an anti-aliased line for every animal."""
    import cv2

    cv2.setNumThreads(1)
    camera = Painter(level, SIZE).camera
    frame, ground = np.zeros((2, SIZE[1], SIZE[0], 3), np.uint8)
    thick = max(1, round(2 * RADIUS * camera.scale))

    def draw(k):
        now = moved(herd, k)
        half = now.forward * (LENGTH / 2)
        ends = np.rint(16 * np.hstack([camera.pixels(now.xy - half), camera.pixels(now.xy + half)])).astype(int)
        np.copyto(frame, ground)
        for ax, ay, bx, by in ends.tolist():
            cv2.line(frame, (ax, ay), (bx, by), (75, 123, 201), thick, cv2.LINE_AA, 4)

    return median(draw, frames)


def legs(look, clip, frames, count=338, long=38.0):
    """Return {name: (median, least)} ms of a frame of large animals, with and without legs or wings."""
    from flockbrush.render.animal_looks import CLIPS
    from flockbrush.render.mesh_bodies import LOOK_NAMES, Postures

    level, herd = scene(count, np.random.default_rng(1))
    painter = Painter(level, SIZE, trails=None, words=False, live=True)
    painter.refine(np.inf)
    flat = herd._replace(length=long / painter.camera.scale, radius=0.2 * long / painter.camera.scale)
    if clip == "fly":
        flat = flat._replace(wings=np.linspace(-1, 1, count), z=np.full(count, 3.0))
    phase, out = np.linspace(0, 1, count), painter.ground.copy()
    told = np.full(count, LOOK_NAMES.index(look)), np.full(count, CLIPS.index(clip))
    return {
        f"{count} of look {look}": median(
            lambda k: painter.frame(flat._replace(postures=Postures(*told, phase + k / 30)), out=out), frames
        ),
        f"{count} of look {look}, none": median(lambda k: painter.frame(flat, out=out), frames),
    }


def window(count, frames, name="gorge"):
    """Return {name: (median, least)} milliseconds of the other work of a window."""
    from flockbrush.render import Scenery
    from flockbrush.render.overlay_registry import OVERLAYS, load_overlays
    from flockbrush.render.overlays import Overlays
    from flockbrush.runs.run import start
    from flockbrush.runs.snapshots import moment_of

    load_overlays()
    simulation = start(name, agents=count)
    simulation.run(32)
    scenery, moment = Scenery(simulation), moment_of(simulation)
    painter = Painter(scenery, SIZE, words=False, labels=True, live=True)
    painter.refine(np.inf)
    frame, middle = painter.ground.copy(), painter.camera.centre
    stroke = (middle[0] - 3, middle[1] - 3, middle[0] + 3, middle[1] + 3)
    table = {
        "ground, whole": median(lambda k: (painter.repaint("all"), painter.refine(np.inf)), 5),
        "ground, stroke of 6 m": median(lambda k: painter.repaint(stroke), frames),
        "looking 9 pixels on": median(lambda k: (painter.look(painter.camera.moved(9, 0)), painter.refine(0)), frames),
        "zooming, first look": median(
            lambda k: (painter.look(painter.home.zoomed(1 + k / 50)), painter.refine(0)), frames
        ),
    }
    selected, camera = int(moment.ids[count // 2]), painter.home
    for overlay in OVERLAYS:
        overlays = Overlays(scenery)

        def draw(k, overlays=overlays, shown=frozenset([overlay])):
            overlays.under(frame, camera, shown, moment)
            overlays.over(frame, camera, shown, moment, selected)

        table[overlay] = median(draw, frames)
        if OVERLAYS[overlay].below:

            def anew(k, overlay=overlay, shown=frozenset([overlay])):
                Overlays(scenery).under(frame, camera, shown, moment)

            table[f"{overlay}, anew"] = median(anew, max(frames // 3, 3))
    return table


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--counts", type=int, nargs="+", default=[1_000, 10_000, 50_000])
    parser.add_argument("--frames", type=int, default=31)
    parser.add_argument("--window", type=int, default=2_000, help="animals of the level with overlays; 0: skip them")
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    rng, table = np.random.default_rng(1), {}
    for count in options.counts:
        level, herd = scene(count, rng)
        peers = {"pygame blits": blits(level, herd, options.frames), "cv2 lines": lines(level, herd, options.frames)}
        table[count] = ours(level, herd, options.frames) | peers
    beside = legs("beast", "walk", options.frames) | legs("bird", "fly", options.frames)
    beside |= window(options.window, options.frames) if options.window else {}
    if options.json:
        print(json.dumps(table | {"window": beside}, indent=2))
        return
    names = list(next(iter(table.values())))
    print(f"ms per frame at {SIZE[0]} x {SIZE[1]}, one thread: median (least) of {options.frames} frames")
    print(f"{'animals':>9}" + "".join(f"{name:>18}" for name in names))
    for count, row in table.items():
        print(f"{count:>9,}" + "".join(f"{row[name][0]:>10.2f} ({row[name][1]:.2f})" for name in names))
    for what, (middle, least) in beside.items():
        print(f"{what:>26}{middle:>10.2f} ({least:.2f})")


if __name__ == "__main__":
    main()

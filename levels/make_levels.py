"""Draws the shipped levels: ``python -m levels.make_levels [NAME ...]``.

Some of them were afterwards opened, changed and saved in Tiled (``shipped/README.md`` says which); those are left
alone unless named.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from behaviours.brush import shipped
from levels.sketch import Sketch
from levels.tiled import BRUSHES_FILE, known_brushes, write_project

HERE = Path(__file__).parent
LEVELS = {}


def level(draw):
    """Register a drawing under its name, dashes for underscores."""
    LEVELS[draw.__name__.replace("_", "-")] = draw
    return draw


def new(nx, ny, metres, **options) -> Sketch:
    """A sketch that knows the shipped tilesets."""
    return Sketch(nx, ny, metres, "../tilesets", known_brushes(HERE / BRUSHES_FILE), **options)


# ---------------------------------------------------------------- helpers for good-looking ground


def rolling(x, y, seed, length, count=7):
    """A smooth random landscape about -1..1 with hills this long: a sum of waves."""
    state = np.random.default_rng(seed)
    total = np.zeros_like(x)
    for a, p, k in zip(*state.uniform(0, 2 * np.pi, (2, count)), state.uniform(0.6, 1.8, count), strict=True):
        total += np.sin(2 * np.pi * k / length * (x * np.cos(a) + y * np.sin(a)) + p)
    return total / np.sqrt(count / 2)


def polygon_about(x, y, radius, corners, seed, rough=0.25, flat=1.0):
    """A rock: corners about a centre, (corners, 2) m."""
    state = np.random.default_rng(seed)
    a = (np.arange(corners) + state.uniform(-0.25, 0.25, corners)) * 2 * np.pi / corners
    r = radius * (1 + state.uniform(-rough, rough, corners))
    return np.column_stack([x + r * np.cos(a), y + flat * r * np.sin(a)])


def near_line(x, y, points):
    """Distance of every cell from a polyline, m."""
    best = np.full(x.shape, np.inf)
    for (ax, ay), (bx, by) in zip(points[:-1], points[1:], strict=True):
        dx, dy = bx - ax, by - ay
        t = np.clip(((x - ax) * dx + (y - ay) * dy) / (dx * dx + dy * dy), 0, 1)
        best = np.minimum(best, np.hypot(x - ax - t * dx, y - ay - t * dy))
    return best


# ---------------------------------------------------------------- the levels


@level
def meadow():
    """Sixty by forty tiles of grass, a pond, a wood, a herd that wanders and one that crosses."""
    s = new(60, 40, 2.0, seed=7)
    hills = rolling(s.x, s.y, 1, 60)
    s.ground("grass")
    s.ground("meadow", hills > 0.35)
    s.ground("dry grass", hills < -1.1)
    wood = rolling(s.x, s.y, 2, 45) - 0.02 * np.hypot(s.x - 100, s.y - 66)
    s.ground("forest floor", wood > 0.2)
    pond = ((s.x - 34) / 13) ** 2 + ((s.y - 54) / 9) ** 2 + 0.25 * rolling(s.x, s.y, 3, 18, 4)
    s.ground("sand", pond < 1.55)
    s.ground("shallows", pond < 1.15)
    s.ground("deep water", pond < 0.75)
    path = [(0, 22), (28, 24), (56, 16), (88, 22), (120, 18)]
    s.ground("dirt", near_line(s.x, s.y, path) < 2.4)
    for k, (x, y, r) in enumerate([(98, 62, 2.2), (105, 58, 1.8), (108, 67, 2.6), (94, 70, 1.7), (113, 60, 1.9)]):
        s.box("Obstacle", x, y, 2 * r, 2 * r, f"tree {k + 1}", round_=True, shape="cylinder")
    s.draw("Obstacle", polygon_about(70, 42, 5, 7, 4), "boulder", margin=0.5)
    s.draw("Obstacle", polygon_about(78, 37, 2.5, 6, 5), "stone", margin=0.3)
    s.draw("Guide", path, "path", closed=False, strength=1, radius=6, decay=6)
    s.brush("graze", (s.x > 60) & (s.y > 44) & (wood <= 0.2))
    s.box("Spawn", 82, 58, 22, 16, "grazing", species="sheep", brush="graze", count=60, body_length=1.2)
    s.box("Spawn", 15, 23, 20, 10, "walking", species="sheep", brush="march", count=80, heading="east", body_length=1.2)
    s.draw("Line", [(60, 8), (60, 30)], "half way", closed=False)
    s.box("Area", 82, 58, 30, 24, "pasture")
    return s


def main(names):
    """Draw the project, the tilesets and the levels named, or all."""
    write_project(HERE, shipped())
    for name in names or LEVELS:
        LEVELS[name]().save(HERE / "shipped" / f"{name}.tmj")
        print(f"drew {name}")


if __name__ == "__main__":
    main(sys.argv[1:])

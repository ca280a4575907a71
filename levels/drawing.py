"""What drawings of shipped levels share: their register, new sketches, and ground that looks good."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from pathlib import Path

import numpy as np
from flockbrush.levels.sketch import LevelSketch
from flockbrush.levels.tile_pictures import BRUSHES_FILE, known_brushes

HERE = Path(__file__).parent
LEVELS: dict[str, Callable[[], LevelSketch]] = {}


def level(draw):
    """Register a drawing under its name, dashes for underscores."""
    LEVELS[draw.__name__.replace("_", "-")] = draw
    return draw


def new(nx, ny, metres, **options) -> LevelSketch:
    """A sketch that knows the shipped tilesets."""
    return LevelSketch(nx, ny, metres, "../tilesets", known_brushes(HERE / BRUSHES_FILE), **options)


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
    for (ax, ay), (bx, by) in itertools.pairwise(points):
        dx, dy = bx - ax, by - ay
        t = np.clip(((x - ax) * dx + (y - ay) * dy) / (dx * dx + dy * dy), 0, 1)
        best = np.minimum(best, np.hypot(x - ax - t * dx, y - ay - t * dy))
    return best

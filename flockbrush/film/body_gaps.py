"""How much room there is between bodies: who touches others, and how wide bodies are when they do."""

from __future__ import annotations

import numpy as np
from numba import njit
from scipy.ndimage import binary_dilation

from flockbrush.systems.contact import nearest_of_segments_

BESIDE = 0.15  # BL from another: whoever is nearer may be held up or pushed
SOON = 0.12  # s before and after that, for which it may show
LEAST = 0.3  # of the sights are enough to tell the speeds of those who have room
NEAR = 2.4  # radii: the axes of bodies that may touch are so near to each other
PRESSED = 0.1  # of those are nearer than bodies that only touch: sights have errors, and bodies give way
NARROW = 0.75  # of the width in the picture, which blur and shadows make wider: none is narrower than that
FEW = 30  # of those, below which their distances tell no width


def distances_of_axes(sightings, radius) -> np.ndarray:
    """(m,) BL from the axis of each body to that of the nearest other in its frame; infinite for one that is alone.

    Parameters
    ----------
    sightings : Sightings
    radius : float
        Half the width of a body, BL: axes end so far from the ends of bodies.
    """
    found = np.full(len(sightings.xy), np.inf)
    xy, forward = np.asarray(sightings.xy, float), np.asarray(sightings.forward, float)
    _distances(np.asarray(sightings.first, np.int64), xy, forward, max(0.5 - radius, 0.0), found)
    return found


@njit(cache=True, nogil=True, error_model="numpy")
def _distances(first, xy, forward, half, found):
    for t in range(len(first) - 1):
        for i in range(first[t], first[t + 1]):
            for j in range(i + 1, first[t + 1]):
                x, y = xy[j, 0] - xy[i, 0], xy[j, 1] - xy[i, 1]
                if x * x + y * y >= (max(found[i], found[j]) + 2.0 * half) ** 2:
                    continue
                x, y = nearest_of_segments_(
                    0.0, 0.0, forward[i, 0], forward[i, 1], half, x, y, forward[j, 0], forward[j, 1], half
                )
                far = np.sqrt(x * x + y * y)
                found[i], found[j] = min(found[i], far), min(found[j], far)


def with_room(sightings, radius, fps) -> np.ndarray:
    """(m,) bool, sights of animals that nobody holds up or pushes; all, where less than `LEAST` of them are.

    Speeds of the others show their contacts, which a simulation adds by itself.
    """
    beside = distances_of_axes(sightings, radius) < 2.0 * radius + BESIDE
    frames = round(SOON * fps)
    names, who = np.unique(sightings.track, return_inverse=True)
    table = np.zeros((len(sightings), len(names)), bool)
    table[sightings.frame, who] = beside
    table = binary_dilation(table, np.ones((2 * frames + 1, 1), bool))
    free = ~table[sightings.frame, who]
    return free if free.sum() >= LEAST * len(free) else np.ones(len(free), bool)


def radius_of_touching(sightings, radius) -> float:
    """Half the width of bodies, BL: that of the picture, or less if bodies come nearer to each other."""
    near = distances_of_axes(sightings, radius)
    near = near[near < NEAR * radius]
    if len(near) < FEW:
        return radius
    return float(np.clip(0.5 * np.quantile(near, PRESSED), NARROW * radius, radius))

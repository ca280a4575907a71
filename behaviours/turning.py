"""Why an animal turns, by the forces across its heading: for models to explain themselves, written plainly."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


class InView(NamedTuple):
    """What an animal sees, in its own body lengths."""

    who: np.ndarray  # (k,) rows of others
    offset: np.ndarray  # (k, 2) to them
    kin: np.ndarray  # (k,) bool, whether they are of its species
    walls: np.ndarray  # (j, 2) to the nearest points of obstacles

    @classmethod
    def of(cls, scene, row: int) -> InView:
        """That of one animal of a scene."""
        seen = slice(scene.first[row], scene.first[row + 1])
        walls = slice(scene.obstacle_first[row], scene.obstacle_first[row + 1])
        who, length = scene.near[seen], scene.length[row]
        kin = scene.species[who] == scene.species[row]
        return cls(who, scene.offset[seen] / length, kin, scene.obstacle_offset[walls] / length)


def guide_force(scene, row: int, weight: float) -> dict[str, np.ndarray]:
    """The force of a guide on an animal that follows it, {"guide": (2,)}; {} where none is."""
    guidance = scene.guidance[row]
    size = float(np.hypot(*guidance))
    return {"guide": weight * guidance / size} if scene.leader[row] and size > 1e-6 else {}


def turn_contributions(forward, forces, per_force: float, most: float) -> dict[str, np.ndarray]:
    """What the next heading is the sum of: what is left of the old one, and what each force adds, {reason: (2,)}.

    Parameters
    ----------
    forward : (2,) ndarray
        Unit heading.
    forces : dict of str to (2,) ndarray
    per_force : float
        rad that the animal turns to the left for each unit of force to its left.
    most : float
        rad, the largest turn.
    """
    left = np.array([-forward[1], forward[0]])
    across = {name: float(force @ left) for name, force in forces.items()}
    total = sum(across.values())
    turn = float(np.clip(total * per_force, -most, most))
    reasons = {"heading": np.cos(turn) * forward}
    if total != 0.0:
        reasons |= {name: np.sin(turn) * part / total * left for name, part in across.items() if part != 0.0}
    return reasons


def decaying_sum(offset, reach: float) -> np.ndarray:
    """The sum (2,) of unit vectors to ``offset`` (n, 2), each e times shorter for each ``reach`` of distance."""
    far = np.hypot(*offset.T)
    there = far > 0
    return (np.exp(-far[there] / reach) / far[there]) @ offset[there]

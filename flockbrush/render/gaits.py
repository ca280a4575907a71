"""How animals move their limbs, from how they move: which clip, and where in its cycle.

The phase grows with the way gone, so that feet stand where they stand; wing beats grow with the climb.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flockbrush.render.animal_looks import BEAT_ANGLE, CLIPS, GLIDING, LOOKS, mesh_of
from flockbrush.runs.catalogue import catalogue_of
from flockbrush.systems.ground_height import heights_of_ground
from flockbrush.systems.landscape import Landscape

BEAT, FASTEST_BEAT = 3.4, 6.0  # wing beats a second: of a bird 1 m long, and as many as can be seen in a video
WALKING = 2.0  # body lengths a second: a bird on the ground that is faster flies
RUNNING = 2.4  # body lengths a second: who is faster runs
RESTING = 0.03  # body lengths a second: who is slower rests
SINKING = -0.08  # of the speed: birds that sink faster glide
TAIL = 0.7  # body lengths of way in one beat of a tail
CLIMB = 2.0  # times as many wing beats when going straight up
WALK, RUN, FLY, GLIDE, SWIM = (CLIPS.index(name) for name in ("walk", "run", "fly", "glide", "swim"))


def looks_of(simulation) -> list[str]:
    """The look of each species by index; those without a file look like what their brushes let them do."""
    catalogue = catalogue_of(simulation.world, labels=())
    flies = catalogue.palette.flies
    guess = "bird" if len(flies) and flies.all() else "beast"
    return [getattr(asset, "look", guess) for asset in catalogue.species.values()]


def sizes(vectors) -> np.ndarray:
    """(n,) lengths of vectors (n, 3), with the bits of `numpy.linalg.norm` in a quarter of its time."""
    x, y, z = vectors.T
    return np.sqrt(x * x + y * y + z * z)


def above_ground(world, xyz, length) -> np.ndarray:
    """(n,) heights over the ground, m; 0 within half a body length of it, as between two ticks on hills."""
    above = xyz[:, 2] - heights_of_ground(world.resource(Landscape).heights, np.ascontiguousarray(xyz))
    return np.where(above < 0.5 * length, 0.0, above)


def in_flight(world, moment) -> np.ndarray:
    """(n,) bool: animals whose brush flies and that are above the ground, or too fast for walking."""
    kinds = catalogue_of(world, labels=()).palette.flies_free
    birds = kinds[moment.brush] if len(kinds) else np.zeros(len(moment), bool)
    fast = sizes(moment.velocity) > WALKING * moment.length
    return birds & ((above_ground(world, moment.xyz, moment.length) > 0) | fast)


def wings_of(clip, phase, flying) -> np.ndarray:
    """(n,) how high wings are, -1 to 1, NaN for who does not fly; gliding wings are held a little up."""
    beat = np.where(clip == GLIDE, GLIDING / BEAT_ANGLE, np.sin(2 * np.pi * phase))
    return np.where(flying, beat, np.nan)


class Limbs(NamedTuple):
    """What each species can do with its limbs, a row each."""

    look: np.ndarray  # index into `LOOKS`
    walk: np.ndarray  # body lengths of a cycle, NaN for who does not walk
    run: np.ndarray
    swims: np.ndarray  # bool
    flies: np.ndarray

    @classmethod
    def of(cls, looks):
        """Of species with these looks."""
        meshes = [mesh_of(look) for look in looks]

        def stride(clip):
            return np.array([mesh.strides[clip].length if clip in mesh.strides else np.nan for mesh in meshes])

        return cls(
            np.array([list(LOOKS).index(look) for look in looks], np.int64), stride("walk"), stride("run"),
            np.array(["swim" in mesh.clips for mesh in meshes], bool),
            np.array(["fly" in mesh.clips for mesh in meshes], bool),
        )  # fmt: skip


class Gaits:
    """Clips and phases of the animals of a run, moment after moment."""

    def __init__(self, simulation):
        self.world = simulation.world
        self._looks: tuple = ((), None)
        self._ids, self._phase, self._time = np.zeros(0, np.int64), np.zeros(0), 0.0

    def limbs(self) -> Limbs:
        """Of the species that there are now."""
        looks = tuple(looks_of(self))
        if self._looks[0] != looks or self._looks[1] is None:
            self._looks = looks, Limbs.of(looks)
        return self._looks[1]

    def of(self, moment):
        """(clip, phase): (n,) int indices into `CLIPS`, and (n,) from 0 to 1; of moments in the order of time."""
        clip, pace = self._clips(moment)
        passed = max(0.0, moment.time - self._time)
        if np.array_equal(self._ids, moment.ids):
            phase = (self._phase + pace * passed) % 1.0
        else:
            phase = (0.381966 * moment.ids) % 1.0  # no two neighbours at once
            _, old, new = np.intersect1d(self._ids, moment.ids, assume_unique=True, return_indices=True)
            phase[new] = (self._phase[old] + pace[new] * passed) % 1.0
        self._ids, self._phase, self._time = moment.ids, phase, moment.time
        return clip, phase

    def _clips(self, moment):
        """(clip, cycles a second) of each animal."""
        limbs, species = self.limbs(), moment.species
        speed = sizes(moment.velocity)
        lengths = speed / moment.length  # body lengths a second
        walk, run = limbs.walk[species], limbs.run[species]
        clip, pace = np.zeros(len(moment), np.int64), np.zeros(len(moment))
        for number, stride, least in ((WALK, walk, RESTING), (RUN, run, RUNNING)):
            moves = np.isfinite(stride) & (lengths > least)
            clip[moves], pace[moves] = number, lengths[moves] / stride[moves]
        swims = limbs.swims[species]
        clip[swims], pace[swims] = SWIM, lengths[swims] / TAIL
        flying = limbs.flies[species] & in_flight(self.world, moment)
        self._fly(moment, flying, speed, clip, pace)
        return clip, pace

    def _fly(self, moment, rows, speed, clip, pace):
        if not rows.any():
            return
        climb = moment.velocity[:, 2] / np.maximum(speed, 1e-9)
        beat = np.minimum(BEAT / np.sqrt(moment.length) * (1 + CLIMB * np.clip(climb, 0, 1)), FASTEST_BEAT)
        clip[rows], pace[rows] = FLY, beat[rows]
        clip[rows & (climb < SINKING)] = GLIDE

"""How animals move their limbs, from how they move: which clip, and where in its cycle.

The phase grows with the way gone, so that feet stand where they stand; wing beats grow with the climb.
"""

from __future__ import annotations

import numpy as np

from flockbrush.render.animal_looks import CLIPS, mesh_of
from flockbrush.systems.fauna import SpeciesList
from flockbrush.systems.palette import Palette

BEAT, FASTEST_BEAT = 3.4, 6.0  # wing beats a second: of a bird 1 m long, and as many as can be seen in a video
WALKING = 2.0  # body lengths a second: a bird on the ground that is faster flies
RUNNING = 2.4  # body lengths a second: who is faster runs
RESTING = 0.03  # body lengths a second: who is slower rests
SINKING = -0.08  # of the speed: birds that sink faster glide
TAIL = 0.7  # body lengths of way in one beat of a tail
CLIMB = 2.0  # times as many wing beats when going straight up


def looks_of(simulation) -> list[str]:
    """The look of each species by index; those without a file look like what their brushes let them do."""
    species, palette = simulation.world.resource(SpeciesList), simulation.world.resource(Palette)
    assets = getattr(species, "assets", None) or [None] * len(species.names)
    flies = getattr(palette, "flies", None)
    guess = "bird" if flies is not None and len(flies) and flies.all() else "beast"
    return [getattr(asset, "look", guess) for asset in assets]


def in_flight(moment, palette) -> np.ndarray:
    """(n,) bool: animals whose brush flies and that are above the ground, or too fast for walking."""
    kinds = palette.flies & ~palette.grounded
    birds = kinds[moment.brush] if len(kinds) else np.zeros(len(moment), bool)
    fast = np.linalg.norm(moment.velocity, axis=1) > WALKING * moment.length
    return birds & ((moment.xyz[:, 2] > 0) | fast)  # on flat ground who is fast is taken to fly


class Gaits:
    """Clips and phases of the animals of a run, moment after moment."""

    def __init__(self, simulation):
        self.simulation = simulation
        self._ids, self._phase, self._time = np.zeros(0, np.int64), np.zeros(0), 0.0

    def of(self, moment):
        """(clip, phase): (n,) int indices into `CLIPS`, and (n,) from 0 to 1; of moments in the order of time."""
        clip, pace = self._clips(moment)
        phase = (0.381966 * moment.ids) % 1.0  # no two neighbours at once
        _, old, new = np.intersect1d(self._ids, moment.ids, assume_unique=True, return_indices=True)
        phase[new] = (self._phase[old] + pace[new] * max(0.0, moment.time - self._time)) % 1.0
        self._ids, self._phase, self._time = moment.ids, phase, moment.time
        return clip, phase

    def _clips(self, moment):
        """(clip, cycles a second) of each animal."""
        looks = looks_of(self.simulation)
        speed = np.linalg.norm(moment.velocity, axis=1)
        lengths = speed / moment.length  # body lengths a second
        clip, pace = np.zeros(len(moment), np.int64), np.zeros(len(moment))
        flying = in_flight(moment, self.simulation.world.resource(Palette))
        for k, look in enumerate(looks):
            mine = moment.species == k
            mesh = mesh_of(look)
            for name in ("walk", "run"):
                if name in mesh.strides:
                    moves = mine & (lengths > (RESTING if name == "walk" else RUNNING))
                    clip[moves], pace[moves] = CLIPS.index(name), lengths[moves] / mesh.strides[name].length
            if "swim" in mesh.clips:
                clip[mine], pace[mine] = CLIPS.index("swim"), lengths[mine] / TAIL
            if "fly" in mesh.clips:
                self._fly(moment, mine & flying, speed, clip, pace)
        return clip, pace

    def _fly(self, moment, rows, speed, clip, pace):
        climb = moment.velocity[:, 2] / np.maximum(speed, 1e-9)
        beat = np.minimum(BEAT / np.sqrt(moment.length) * (1 + CLIMB * np.clip(climb, 0, 1)), FASTEST_BEAT)
        glides = rows & (climb < SINKING)
        clip[rows], pace[rows] = CLIPS.index("fly"), beat[rows]
        clip[glides] = CLIPS.index("glide")

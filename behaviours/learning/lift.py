"""How far away each bird of a film was: the flight of a flock in space from its tracks in one camera.

Lin 2019 [1]_ asks for the depths that make every path smooth and the flock fly as one.  His frame-by-frame descent
(`behaviours.learning.lift_thesis`) keeps the films' reprojection but does not find depth; here the same idea is one
quadratic problem over all frames and birds, solved at once.  With ``b = d * ray`` (his eq. 1.1) everything is quadratic
in the depths d::

    |acceleration|^2  +  alignment |v - mean v|^2  +  cohesion |b - mean b|^2  [+ evenness (|v| - mean |v|)^2]

under a fixed mean depth; the mean speed of the birds sets the scale afterwards.  Birds may come and go.

.. [1] Lin, C.-A. (2019). Predicting 3D bird flock motion from 2D projection. Master's thesis, The University of Tokyo.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.linalg import LinAlgError, solveh_banded

from behaviours.learning.camera import Camera
from behaviours.learning.tracks import Tracks, smoothed

# Deviations within which a tight flock flies, from own boids filmed by a virtual camera: .0042 m/frame^2 and
# .03 m/frame at 30 frames a second.
ACCELERATION = 0.0042 * 30**2  # m/s^2
VELOCITY = 0.03 * 30  # m/s
ALIGNMENT, COHESION, EVENNESS = 0.1, 0.003, 0.3
SOLVES = 8  # with evenness: the directions of flight settle


class LiftError(ValueError):
    """Tracks that cannot be lifted, in a sentence for whoever asked."""


@dataclass(frozen=True)
class Wish:
    """What a flight should be like.

    Parameters
    ----------
    smoothness : float
        Weight of smooth paths (λ_t).
    flock : float
        Weight of flying as one (λ_f): alignment, cohesion and evenness of speeds together.  Only the ratio of the two
        matters.
    evenness : float
        Weight of equal speeds; helps flocks of five, hurts loose ones.
    separation : float
        Weight of keeping apart, 0 to 1; for looks, it does not make the depths truer.
    separation_distance : float
        Metres below which birds are pushed apart.
    """

    smoothness: float = 1.0
    flock: float = 1.0
    evenness: float = EVENNESS
    separation: float = 0.0
    separation_distance: float = 1.2

    def __post_init__(self):
        for name in ("smoothness", "flock", "evenness", "separation", "separation_distance"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value >= 0):
                raise LiftError(f"{name.replace('_', ' ')} must be at least 0, got {value:g}")
        if self.smoothness == 0:
            raise LiftError("smoothness must be above 0: without it any depth is as good as another")


@dataclass
class Flight:
    """A flock in space.

    Attributes
    ----------
    xyz : (F, N, 3) ndarray
        Metres, the camera at the origin: x right, y forward, z up; NaN where a bird is not there.
    depth : (F, N) ndarray
        Metres along the ray.
    ids : (N,) ndarray of int
    first : int
        Number of the first frame.
    fps : float
    stiffness, noise : float
        Of the smoothing of the tracks; noise in pixels.
    notes : list of str
        What whoever uses this should know.
    """

    xyz: np.ndarray
    depth: np.ndarray
    ids: np.ndarray
    first: int
    fps: float
    stiffness: float = float("nan")
    noise: float = float("nan")
    notes: list[str] = field(default_factory=list)


def lift(tracks: Tracks, camera: Camera, wish: Wish | None = None) -> Flight:
    """The flight of a flock from its tracks, by one global solve.

    Parameters
    ----------
    tracks : Tracks
        With noise and gaps; they are smoothed first.
    camera : Camera
    wish : Wish, optional

    Returns
    -------
    Flight

    Raises
    ------
    LiftError
        When nothing can be known of the depths, as of a single bird.
    """
    wish = wish or Wish()
    clean, rays, there, notes = prepared(tracks, camera)
    depth = _depths(rays, there, camera.fps, wish, camera.mean_speed)
    xyz = depth[..., None] * rays
    flight = Flight(xyz, depth, tracks.ids, tracks.first, camera.fps, clean.stiffness, clean.noise, notes)
    notes += _out_of_bounds(flight, camera)
    return flight


def prepared(tracks: Tracks, camera: Camera):
    """(smoothed tracks, rays (F, N, 3), who is there (F, N), notes); LiftError when there is no flock in the tracks."""
    clean = smoothed(tracks)
    there = np.isfinite(clean.px).all(-1)
    return clean, camera.rays(clean.px), there, list(tracks.notes) + _warnings(tracks, clean, there, camera)


def _warnings(tracks, clean, there, camera):
    """What to know before the depths are believed; LiftError when there can be none."""
    if tracks.px.shape[1] < 2:
        raise LiftError(
            "one bird alone has no depth: a flock is needed, two birds at least that are seen at the same time"
        )
    together = (there.sum(1) >= 2).sum()
    if together < 3:
        raise LiftError("no two birds are seen at the same time for three frames; there is no flock in these tracks")
    notes = []
    moved = np.abs(np.diff(clean.px, axis=0))
    if not np.nanmax(moved, initial=0.0) > 1e-3:
        raise LiftError("nothing moves in these tracks: the speed of the birds cannot set the scale")
    if clean.longest_gap > camera.fps:
        notes.append(f"the longest gap is {clean.longest_gap} frames: the path through it is a guess")
    outside = tracks.seen & ((tracks.px < 0) | (tracks.px > (camera.width, camera.height))).any(-1)
    if outside.any():
        notes.append(
            f"{int(outside.sum())} sights lie outside the {camera.width} x {camera.height} picture: is this the camera?"
        )
    if camera.horizontal_fov_deg < 25:
        notes.append("with so long a lens towards and away can hardly be told apart")
    return notes


def _out_of_bounds(flight, camera):
    with np.errstate(invalid="ignore"):
        out = (flight.depth < camera.near) | (flight.depth > camera.far)
    if not out.any():
        return []
    low, high = np.nanmin(flight.depth), np.nanmax(flight.depth)
    share = out.sum() / np.isfinite(flight.depth).sum()
    return [
        f"{share:.0%} of the depths ({low:.1f} to {high:.1f} m) are not between near ({camera.near:g} m) and far "
        f"({camera.far:g} m): the mean speed of {camera.mean_speed:g} m/s or the bounds may be wrong"
    ]


# the solve ---------------------------------------------------------------------------


def _depths(rays, there, fps, wish, mean_speed):
    """(F, N) m."""
    system = _System(rays, there)
    fixed = system.steady(fps, wish)
    weight = wish.flock * wish.evenness / VELOCITY**2 * fps**2
    depth = system.solve(fixed)
    for _ in range(SOLVES if weight else 0):
        depth = system.solve(fixed + system.evenness(depth, weight))
    depth = depth * (mean_speed / _mean_speed(rays, depth, fps))
    if wish.separation:
        depth = _apart(system, fixed + system.evenness(depth, weight), depth, wish)
        depth = depth * (mean_speed / _mean_speed(rays, depth, fps))
    return depth


def _mean_speed(rays, depth, fps):
    """Of all birds over all frames, m/s."""
    step = np.diff(depth[..., None] * rays, axis=0)
    return float(np.nanmean(np.linalg.norm(step, axis=-1)) * fps)


class _System:
    """The banded equations: unknowns are the depths of birds that are there, in the order of frame, then bird."""

    def __init__(self, rays, there):
        self.rays, self.there = np.where(there[..., None], rays, 0.0), there
        self.frames = [np.flatnonzero(row) for row in there]
        self.number = np.full(there.shape, -1)
        self.number[there] = np.arange(there.sum())
        self.size = int(there.sum())
        self.band = self._bandwidth()

    def _bandwidth(self):
        """The farthest apart two unknowns are that meet in one term."""
        wide = max((len(birds) for birds in self.frames), default=1) - 1
        for step in (1, 2):
            both = self.there[step:] & self.there[:-step]
            for f in np.flatnonzero(both.any(1)):
                if step == 1:
                    wide = max(wide, self.number[f + 1][both[f]].max() - self.number[f][both[f]].min())
                else:
                    wide = max(wide, (self.number[f + 2] - self.number[f])[both[f]].max())
        return int(wide)

    def empty(self):
        return np.zeros((self.band + 1, self.size))

    def add(self, bands, rows, columns, values):
        """Add values[a, b] at (rows[a], columns[b]); of the diagonal blocks and those above."""
        across = columns[None, :] - rows[:, None]
        upper = across >= 0
        flat = (self.band - across) * self.size + columns[None, :]  # each place once: no unbuffered add is needed
        bands.ravel()[flat[upper]] += values[upper]

    def steady(self, fps, wish):
        """Smooth paths, alignment, cohesion: what does not depend on the depths."""
        bands = self.empty()
        self._acceleration(bands, wish.smoothness * fps**4 / ACCELERATION**2)
        self._alignment(bands, wish.flock * ALIGNMENT * fps**2 / VELOCITY**2)
        self._cohesion(bands, max(wish.flock, 1e-6) * COHESION)  # without any the depths of two birds are not tied
        return bands

    def _acceleration(self, bands, weight):
        triple = self.there[2:] & self.there[1:-1] & self.there[:-2]
        f, n = np.nonzero(triple)
        step = (1.0, -2.0, 1.0)
        for a in range(3):
            for b in range(a, 3):
                dots = np.einsum("kc,kc->k", self.rays[f + a, n], self.rays[f + b, n])
                i, j = self.number[f + a, n], self.number[f + b, n]
                bands[self.band - (j - i), j] += weight * step[a] * step[b] * dots  # each place once

    def _alignment(self, bands, weight):
        for f, birds in self._pairs():
            spread = np.eye(len(birds)) - 1.0 / len(birds)
            before, after = self.rays[f, birds], self.rays[f + 1, birds]
            i, j = self.number[f, birds], self.number[f + 1, birds]
            self.add(bands, i, i, weight * spread * (before @ before.T))
            self.add(bands, j, j, weight * spread * (after @ after.T))
            self.add(bands, i, j, -weight * spread * (before @ after.T))

    def _cohesion(self, bands, weight):
        for f, birds in enumerate(self.frames):
            if len(birds):
                spread = np.eye(len(birds)) - (1.0 / len(birds) if len(birds) > 1 else 0.0)
                ray, i = self.rays[f, birds], self.number[f, birds]
                self.add(bands, i, i, weight * spread * (ray @ ray.T))

    def evenness(self, depth, weight):
        """Equal speeds, along the directions of flight that these depths give."""
        bands = self.empty()
        if not weight:
            return bands
        xyz = depth[..., None] * self.rays
        for f, birds in self._pairs():
            way = xyz[f + 1, birds] - xyz[f, birds]
            way /= np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-12)
            before = -np.einsum("kc,kc->k", way, self.rays[f, birds])
            after = np.einsum("kc,kc->k", way, self.rays[f + 1, birds])
            spread = weight * (np.eye(len(birds)) - 1.0 / len(birds))
            i, j = self.number[f, birds], self.number[f + 1, birds]
            self.add(bands, i, i, spread * np.outer(before, before))
            self.add(bands, j, j, spread * np.outer(after, after))
            self.add(bands, i, j, spread * np.outer(before, after))
        return bands

    def _pairs(self):
        """(f, birds) that are there in frames f and f + 1, two at least."""
        both = self.there[1:] & self.there[:-1]
        for f in range(len(both)):
            birds = np.flatnonzero(both[f])
            if len(birds) > 1:
                yield f, birds

    def solve(self, bands, side=None, mean=1.0):
        """Depths (F, N) of least cost with this mean depth."""
        sides = np.ones((self.size, 1)) if side is None else np.column_stack([np.ones(self.size), side])
        lifted = bands.copy()
        lifted[-1] *= 1.0 + 1e-13
        try:
            found = solveh_banded(lifted, sides, check_finite=False)
        except LinAlgError:
            raise LiftError("the tracks do not determine any depth; are they all of one bird?") from None
        flat = found[:, 0] * (mean / found[:, 0].mean()) if side is None else _meeting(found, mean)
        depth = np.full(self.there.shape, np.nan)
        depth[self.there] = flat
        if not (flat > 0).all():
            raise LiftError("no flight in front of the camera fits these tracks; is the camera file the right one?")
        return depth


def _meeting(found, mean):
    """The solution for the right-hand side, moved along that for ones until its mean is right."""
    free, ones = found[:, 1], found[:, 0]
    return free + ones * ((mean - free.mean()) / ones.mean())


def _apart(system, bands, depth, wish, rounds=6):
    """Push birds nearer than the separation distance apart, along their rays; for looks."""
    mean = float(depth[system.there].mean())
    scale = float(np.median(bands[-1])) * wish.separation
    for _ in range(rounds):
        stronger, side = bands.copy(), np.zeros(system.size)
        xyz = depth[..., None] * system.rays
        crowded = False
        for f, birds in enumerate(system.frames):
            for a, b in _close(xyz[f, birds], wish.separation_distance):
                crowded = True
                _push(system, stronger, side, f, birds[a], birds[b], xyz, scale, wish.separation_distance)
        if not crowded:
            break
        depth = system.solve(stronger, side, mean)
    return depth


def _close(xyz, distance):
    gaps = np.linalg.norm(xyz[:, None] - xyz[None], axis=-1)
    return np.argwhere(np.triu(gaps < distance, 1))


def _push(system, bands, side, f, a, b, xyz, weight, distance):
    """(way . (b_a - b_b) - distance)^2, the way as it is now; for two on one ray, along it."""
    way = xyz[f, a] - xyz[f, b]
    size = np.linalg.norm(way)
    way = way / size if size > 1e-9 else system.rays[f, a]
    along = np.array([way @ system.rays[f, a], -(way @ system.rays[f, b])])
    rows = system.number[f, [a, b]]
    system.add(bands, rows, rows, weight * np.outer(along, along))
    side[rows] += weight * distance * along

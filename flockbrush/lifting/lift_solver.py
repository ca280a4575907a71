"""How far away each bird of a film was: the flight of a flock in space from its tracks in one camera.

Lin 2019 [1]_ asks for the depths that make every path smooth and the flock fly as one.  His frame-by-frame descent
(`flockbrush.lifting.lift_thesis`) keeps the films' reprojection but does not find depth; here the same idea is one
convex problem over all frames and birds, solved at once.  With ``b = d * ray`` (his eq. 1.1)::

    |a - mean a|^2 + alignment |v - mean v|^2 + cohesion |b - mean b|^2
        + turning |mean a|^2 + evenness (way . mean a)^2 - 2 sum(log d)

The first three say how birds of a flock move about its middle.  How strong they are is read off the picture: across the
line of sight that movement is seen, and along it it is taken for alike (`compute_manner`).  The other two are the
flock's own flight: it may turn, by as much as is seen, but speeds up and slows down little.  The logarithm is the
volume that a pixel sees, which grows with the square of the distance: without it depths shrink wherever birds are seen
to move about.  It also keeps all birds before the camera, and makes a factor common to all weights a mere scale of the
flight.  That scale no camera knows; the mean speed of the birds sets it.  Birds may come and go.

.. [1] Lin, C.-A. (2019). Predicting 3D bird flock motion from 2D projection. Master's thesis, The University of Tokyo.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from flockbrush.film.track_table import evened, rounding, unevenness
from flockbrush.film.tracks import Tracks, smoothed
from flockbrush.lifting.banded import add_squares, banded_product, solve_banded
from flockbrush.lifting.lens import Camera
from flockbrush.lifting.motion_prior import Manner, compute_manner
from flockbrush.lifting.order_confidence import order_confidence

EVENNESS = 10.0  # of speeding up over turning, for the whole flock.  By trial: 1 to 30 will do for boids and pigeons
FLOCK = 8.0  # of alignment and cohesion over their values in the picture.  By trial: 4 to 16
VOLUME = 2.0  # what a pixel sees grows with depth to this
STEPS, SETTLED = 16, 2e-3  # of Newton's method at most; the largest relative change of a depth at which it ends
TOSS = 0.6  # share of pairs expected in the right order, below which there is a note
EVEN = "all birds are placed at one distance, so that their mean speed is the one in the camera file"
COARSE = 0.1  # the same, for a look while a slider is dragged
WISHES = {"smoothness": 1e6, "flock": 1e6, "evenness": 1e6, "separation": 1.0, "separation_distance": 1e3}  # at most
MOST = 150_000_000  # numbers in the banded system: 1.2 GB


class LiftError(ValueError):
    """Tracks that cannot be lifted; the message is for the user."""


@dataclass(frozen=True)
class LiftWish:
    """What a flight should be like."""

    smoothness: float = 1.0  # weight of smooth paths (λ_t)
    # weight of flying as one (λ_f): alignment and cohesion together. Only the ratio of the two matters; 1 and 1 is what
    # the tracks themselves tell of the birds.
    flock: float = 1.0
    # weight of the flock's speed being even: 1 for flocks on the wing, less for birds that brake and dash
    evenness: float = 1.0
    separation: float = 0.0  # weight of keeping apart, 0 to 1; for looks, it does not make the depths truer
    separation_distance: float = 1.2  # metres below which birds are pushed apart

    def __post_init__(self):
        for name, most in WISHES.items():
            value = getattr(self, name)
            if not 0 <= value <= most:
                raise LiftError(f"{name.replace('_', ' ')} must be from 0 to {most:g}, got {value:g}")
        if self.smoothness == 0:
            raise LiftError("smoothness must be above 0: without it, the depth is undetermined")


@dataclass
class LiftedFlight:
    """A flock in space."""

    # (F, N, 3); metres, the camera at the origin: x right, y forward, z up; NaN where a bird is not there
    xyz: np.ndarray
    depth: np.ndarray  # (F, N); metres along the ray
    ids: np.ndarray  # (N,) of int
    frames: np.ndarray  # (F,) of int; their numbers
    fps: float
    # stiffness, noise: of the smoothing of the tracks; noise in pixels
    stiffness: float = float("nan")
    noise: float = float("nan")
    notes: list[str] = field(default_factory=list)  # what whoever uses this should know
    manner: Manner | None = None  # how its birds move about its middle, as read off the tracks
    # share of the pairs of birds whose order in depth is expected to be right; NaN where that was not asked
    order: float = float("nan")
    start: float = float("nan")  # s, time of the first frame; by default what its number says
    names: tuple[str, ...] = ()  # (N,) of the birds in their file; the ids by default

    def __post_init__(self):
        if np.isnan(self.start):
            self.start = float(self.frames[0] / self.fps)
        self.names = self.names or tuple(map(str, self.ids.tolist()))

    @property
    def times(self) -> np.ndarray:
        """(F,) s."""
        return self.start + np.arange(len(self.frames)) / self.fps


@dataclass
class PreparedTracks:
    """Tracks prepared for lifting: everything that does not depend on the settings."""

    px: np.ndarray  # (F, N, 2); smoothed, gaps bridged; NaN where a bird is not there
    rays: np.ndarray  # (F, N, 3); unit vectors
    there: np.ndarray  # (F, N) of bool
    manner: Manner
    # ids, frames, stiffness, noise, notes: as in `LiftedFlight`
    ids: np.ndarray
    frames: np.ndarray
    stiffness: float
    noise: float
    notes: list[str]


def lift(tracks: Tracks, camera: Camera, wish: LiftWish | None = None) -> LiftedFlight:
    """The flight of a flock from its tracks, by one global solve.

    Parameters
    ----------
    tracks : Tracks
        With noise and gaps; they are smoothed first.

    Returns
    -------
    Flight

    Raises
    ------
    LiftError
        When there is no flight in them, as of birds that do not move.
    """
    return lift_sight(prepared(tracks, camera), camera, wish)


def lift_sight(sight: PreparedTracks, camera: Camera, wish: LiftWish | None = None, every: int = 1) -> LiftedFlight:
    """The same from tracks that are ready; with `every` above 1 only those frames are solved, for a quick look."""
    depth = _sparsely(sight, camera, wish or LiftWish(), every)
    flight = LiftedFlight(
        depth[..., None] * sight.rays, depth, sight.ids, sight.frames, camera.fps, sight.stiffness, sight.noise,
        list(sight.notes), sight.manner,
    )  # fmt: skip
    flight.notes += _out_of_bounds(flight, camera)
    if every <= 1:
        flight.order = _order(sight, camera, wish or LiftWish(), depth)
        if flight.order < TOSS:
            flight.notes.append(
                f"which of two birds is nearer is uncertain: about {flight.order:.0%} of the pairs are expected to be "
                "in the right order (chance: 50%), and the flock may be mirrored in depth"
            )
    return flight


def _order(sight, camera, wish, depth):
    """As `order_confidence` of these depths, m."""
    if not _is_flock(sight.there):
        return float("nan")
    system = _System(sight.rays, sight.there)
    bands = system.steady(camera.fps, sight.manner, wish) + system.evenness(depth, camera.fps, wish)
    own = depth * np.sqrt(system.volume.sum() / _cost(bands, depth[sight.there]))  # the scale that the cost has
    bands[:, 0] += system.volume / own[sight.there] ** 2
    return order_confidence(bands, own, system.number, sight.there)


def prepared(tracks: Tracks, camera: Camera) -> PreparedTracks:
    """Smoothed tracks as rays; LiftError when there is no flight in them."""
    if tracks.times is not None and (uneven := unevenness(tracks.times, rounding(tracks.times))):
        raise LiftError(f"{uneven}, so speeds, and with them depths, would be wrong; {evened(tracks.times)}")
    clean = smoothed(tracks)
    there = np.isfinite(clean.px).all(-1)
    notes = list(tracks.notes) + _warnings(tracks, clean, there, camera)
    rays = camera.rays(clean.px)
    manner = compute_manner(rays, there, camera.fps)
    frames = tracks.first + np.arange(len(rays))
    return PreparedTracks(clean.px, rays, there, manner, tracks.ids, frames, clean.stiffness, clean.noise, notes)


def _warnings(tracks, clean, there, camera):
    """What to know before the depths are believed; LiftError when there can be no flight."""
    notes = []
    if tracks.px.shape[1] < 2:
        notes.append(
            f"the depth of a single bird is undetermined: two birds that are visible together are needed; {EVEN}"
        )
    elif not _is_flock(there):
        notes.append(f"no two birds are visible together for three frames, so depths are undetermined; {EVEN}")
    moved = np.abs(np.diff(clean.px, axis=0))
    if not np.nanmax(moved, initial=0.0) > 1e-3:
        raise LiftError("nothing moves in these tracks: the speed of the birds cannot set the scale")
    if clean.longest_gap > camera.fps:
        notes.append(f"the longest gap is {clean.longest_gap} frames: the path in the gap is interpolated")
    outside = tracks.seen & ((tracks.px < 0) | (tracks.px > (camera.width, camera.height))).any(-1)
    if outside.any():
        notes.append(
            f"{int(outside.sum())} sights lie outside the {camera.width} x {camera.height} picture: the camera "
            "file may be wrong"
        )
    if camera.horizontal_fov_deg < 25:
        notes.append(
            "with a field of view this narrow, motion towards and away from the camera can hardly be distinguished"
        )
    return notes


def _is_flock(there):
    return (there.sum(1) >= 2).sum() >= 3


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


def _sparsely(sight, camera, wish, every):
    """(F, N) m: depths of every so manieth frame, and between them by their neighbours."""
    chosen = np.unique(np.r_[0 : len(sight.rays) : every, len(sight.rays) - 1])
    if every <= 1 or len(chosen) < 4 or (sight.there[chosen].sum(0) < 2).any():
        return _depths(sight.rays, sight.there, camera.fps, sight.manner, wish, camera.mean_speed)
    even = chosen[:-1] if chosen[-1] - chosen[-2] != every else chosen
    rays, there = sight.rays[even], sight.there[even]
    some = _depths(rays, there, camera.fps / every, sight.manner, wish, camera.mean_speed, COARSE)
    depth = np.full(sight.there.shape, np.nan)
    for n in range(depth.shape[1]):
        frames = np.flatnonzero(sight.there[:, n])
        known = np.isfinite(some[:, n])
        depth[frames, n] = np.interp(frames, even[known], some[known, n])
    return depth


def _depths(rays, there, fps, manner, wish, mean_speed, settled=SETTLED):
    """(F, N) m."""

    def scaled(depth):
        """To the mean speed of the birds."""
        step = np.diff(depth[..., None] * rays, axis=0)
        return depth * (mean_speed / float(np.nanmean(np.linalg.norm(step, axis=-1)) * fps))

    if not _is_flock(there):
        return scaled(np.where(there, 1.0, np.nan))
    system = _System(rays, there)
    fixed = system.steady(fps, manner, wish)
    bands, depth = fixed, system.filled(1.0)
    for step in range(STEPS):
        bands = fixed + system.evenness(depth, fps, wish) if step else fixed
        depth, change = system.newton(bands, depth)
        if change < settled and step:
            break
    depth = scaled(depth)
    return scaled(_apart(system, bands, depth, wish)) if wish.separation else depth


class _System:
    """The banded equations: unknowns are the depths of birds that are there, in the order of frame, then bird."""

    def __init__(self, rays, there):
        self.rays, self.there = np.where(there[..., None], rays, 0.0), there
        self.frames = [np.flatnonzero(row) for row in there]
        self.number = np.full(there.shape, -1)
        self.number[there] = np.arange(there.sum())
        self.size = int(there.sum())
        self.band = self._bandwidth()
        crowd = np.where(there.sum(1, keepdims=True) > 1, there, False)
        self.volume = VOLUME * crowd[there].astype(float)  # a bird alone goes on as it flew, be it near or far

    def _bandwidth(self):
        """The farthest apart two unknowns are that meet in one term: those of three frames on end."""
        wide = max((len(birds) for birds in self.frames), default=1) - 1
        for step in (1, 2):
            both = self.there[step:] & self.there[:-step]
            for f in np.flatnonzero(both.any(1)):
                wide = max(wide, self.number[f + step][both[f]].max() - self.number[f][both[f]].min())
        if (wide + 1) * self.size > MOST:
            raise LiftError(
                f"{len(self.there)} frames of up to {max(map(len, self.frames))} birds do not fit into"
                " memory; split the tracks into parts"
            )
        return int(wide)

    def filled(self, depth):
        """(F, N) of one depth, NaN where there is no bird."""
        return np.where(self.there, depth, np.nan)

    def empty(self):
        return np.zeros((self.size, self.band + 1))

    def add(self, bands, rows, columns, values):
        """Add values[a, b] at (rows[a], columns[b]); of the diagonal blocks and those above."""
        across = columns[None, :] - rows[:, None]
        upper = across >= 0
        flat = rows[:, None] * (self.band + 1) + across  # each place once: no unbuffered add is needed
        bands.ravel()[flat[upper]] += values[upper]

    def steady(self, fps, manner, wish):
        """Smooth paths, alignment, cohesion: what does not depend on the depths."""
        bands = self.empty()
        self._acceleration(bands, wish.smoothness * fps**4)
        self._turning(bands, wish.smoothness * (manner.turning - 1.0) * fps**4)
        self._alignment(bands, FLOCK * wish.flock * manner.alignment * fps**2)
        self._cohesion(bands, FLOCK * max(wish.flock, 1e-6) * manner.cohesion)
        return bands

    def _acceleration(self, bands, weight):
        triple = self.there[2:] & self.there[1:-1] & self.there[:-2]
        f, n = np.nonzero(triple)
        step = (1.0, -2.0, 1.0)
        for a in range(3):
            for b in range(a, 3):
                dots = np.einsum("kc,kc->k", self.rays[f + a, n], self.rays[f + b, n])
                i, j = self.number[f + a, n], self.number[f + b, n]
                bands[i, j - i] += weight * step[a] * step[b] * dots  # each place once

    def _triples(self):
        """(f, birds, rows of the system) of those that are there in frame f and the two after it."""
        triple = self.there[2:] & self.there[1:-1] & self.there[:-2]
        for f in np.flatnonzero(triple.any(1)):
            birds = np.flatnonzero(triple[f])
            yield f, birds, self.number[f : f + 3, birds].ravel()

    def _turning(self, bands, weight):
        """The middle's own acceleration, over what it has in that of all birds."""
        for f, birds, places in self._triples() if weight else ():
            bend = (self.rays[f : f + 3, birds] * np.array([1.0, -2.0, 1.0])[:, None, None]).reshape(-1, 3)
            add_squares(bands, places, np.ascontiguousarray(bend.T), weight / len(birds))

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
            if len(birds) > 1:
                spread = np.eye(len(birds)) - 1.0 / len(birds)
                ray, i = self.rays[f, birds], self.number[f, birds]
                self.add(bands, i, i, weight * spread * (ray @ ray.T))

    def evenness(self, depth, fps, wish):
        """No speeding up or slowing down of the whole flock, along the way it flies with these depths."""
        bands = self.empty()
        weight = wish.smoothness * wish.evenness * EVENNESS * fps**4
        if not weight:
            return bands
        xyz = np.nan_to_num(depth)[..., None] * self.rays
        for f, birds, places in self._triples():
            way = (xyz[f + 2, birds] - xyz[f, birds]).mean(0)
            way /= max(np.linalg.norm(way), 1e-12)
            along = (self.rays[f : f + 3, birds] @ way * [[1.0], [-2.0], [1.0]]).ravel()
            add_squares(bands, places, along[None], weight / len(birds))
        return bands

    def _pairs(self):
        """(f, birds) that are there in frames f and f + 1, two at least."""
        both = self.there[1:] & self.there[:-1]
        for f in range(len(both)):
            birds = np.flatnonzero(both[f])
            if len(birds) > 1:
                yield f, birds

    def newton(self, bands, depth):
        """(better depths, largest relative change): a step of Newton's method from these depths.

        Their scale is set first, as the logarithm has it; the problem is convex, and no depth becomes negative.
        """
        d = depth[self.there]
        d = d * np.sqrt(self.volume.sum() / _cost(bands, d))
        stiff = bands.copy()
        stiff[:, 0] += self.volume / d**2
        step = self._solved(stiff, self.volume / d - banded_product(bands, d))
        short = min(1.0, 0.9 / max(float((-step / d).max()), 1e-12))
        better = self.filled(0.0)
        better[self.there] = d + short * step
        return better, float(np.abs(step / d).max())

    def _solved(self, bands, side):
        solution = solve_banded(bands, side)
        if not np.isfinite(solution).all():
            raise LiftError("the tracks do not determine any depth; they may all be of one bird")
        return solution


def _cost(bands, d):
    """The quadratic form at d; of a flight that costs nothing, what rounding leaves of it."""
    return max(float(d @ banded_product(bands, d)), 1e-12 * float(bands[:, 0] @ d**2))


def _apart(system, bands, depth, wish, rounds=4):
    """Push birds nearer than the separation distance apart, along their rays, at the least cost; for looks."""
    depths = depth[system.there]
    stiff = bands * (system.volume.sum() / _cost(bands, depths))
    stiff[:, 0] += system.volume / depths**2
    pull = banded_product(stiff, depths)
    weight = float(np.median(stiff[:, 0])) * wish.separation
    behind = np.sign(np.nan_to_num(depth[:, :, None] - depth[:, None]).sum(0))  # order in depth of every pair
    behind += np.triu(behind == 0) - np.tril(behind == 0).astype(float)
    crowded: set = set()
    for _ in range(rounds):
        before = len(crowded)
        xyz = depth[..., None] * system.rays
        for f, birds in enumerate(system.frames):
            crowded |= {(f, birds[a], birds[b]) for a, b in _close(xyz[f, birds], wish.separation_distance)}
        if len(crowded) == before:
            break
        stronger, side = stiff.copy(), pull.copy()
        for f, a, b in sorted(crowded):
            _push(system, stronger, side, f, a, b, depth, weight, behind[a, b], wish.separation_distance)
        depth = system.filled(0.0)
        depth[system.there] = np.maximum(system._solved(stronger, side), 0.1 * depths)
    return depth


def _close(xyz, distance):
    gaps = np.linalg.norm(xyz[:, None] - xyz[None], axis=-1)
    return np.argwhere(np.triu(gaps < distance, 1))


def _push(system, bands, side, f, a, b, depth, weight, behind, distance):
    """(d_a - d_b - room)^2, the room that is left along the rays when birds lie so far apart across them."""
    across = 0.5 * (depth[f, a] + depth[f, b]) * np.linalg.norm(system.rays[f, a] - system.rays[f, b])
    room = behind * np.sqrt(max(distance**2 - across**2, 0.0))
    rows = system.number[f, [a, b]]
    system.add(bands, rows, rows, weight * np.array([[1.0, -1.0], [-1.0, 1.0]]))
    side[rows] += weight * room * np.array([1.0, -1.0])

"""A clip and simulations of it, frame by frame, measured in the same way: by the fields of both.

References
----------
.. [1] Gong, X. et al. (2025). Herds from video: learning a microscopic herd model from macroscopic motion data.
   Computer Graphics Forum 44(6), e70225.  Section 7.1.2.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from behaviours.learning.evidence import Evidence, Fields
from behaviours.learning.rollout import Run

COARSE = 10  # cells across, in which density and velocity are compared [1]_
TAIL = 0.01  # of the animals at each end, left out of the width and length of a herd
MEASURES = "polarization", "milling", "milling_image", "aspect"
TITLES = {
    "polarization": "Polarization",
    "milling": "Milling about the middle of the herd",
    "milling_image": "Milling about the middle of the picture",
    "aspect": "Width over length",
    "density_error": "Density error",
    "density_difference": "Density misplaced",
    "velocity_error": "Velocity error",
}
JUDGED = "polarization", "milling"
DEVIATIONS, LEAST = 2.0, 0.05  # a measure is met within two of the clip's own deviations, or .05
REACH, BINS = 3.0, 25  # of the map of neighbours, body lengths and cells across
SLOTS = 8  # of the curve of speed against density


@dataclass
class Verdict:
    """One measure of the clip against the simulations, over all frames."""

    name: str
    clip: float
    clip_deviation: float
    herd: float
    herd_deviation: float
    frame_error: float  # mean over frames of the difference, as the paper gives it
    allowed: float

    @property
    def off(self) -> float:
        """Difference of the means."""
        return abs(self.herd - self.clip)

    @property
    def met(self) -> bool:
        """Whether the simulated herd is like the clip in this."""
        return bool(self.off <= self.allowed)


@dataclass
class Comparison:
    """What became of simulations that began as the clip did.

    Attributes
    ----------
    frames : (T,) int ndarray
        Of the clip.
    times : (T,) ndarray
        Seconds since the beginning.
    clip : dict of str to (T,) ndarray
    herds : list of dict of str to (T,) ndarray
        One for each simulation, with the errors besides the measures.
    run : Run
        The first simulation.
    """

    frames: np.ndarray
    times: np.ndarray
    clip: dict[str, np.ndarray]
    herds: list[dict[str, np.ndarray]]
    run: Run
    maps: dict[str, np.ndarray] = field(default_factory=dict)  # neighbours about an animal, of clip and simulation
    speeds: dict[str, tuple[np.ndarray, np.ndarray]] = field(default_factory=dict)  # (density, speed)

    def herd(self, name) -> np.ndarray:
        """(T,) mean over the simulations."""
        return _mean([one[name] for one in self.herds])

    def verdict(self, name) -> Verdict:
        """The clip and the simulations in one measure."""
        clip, herds = self.clip[name], np.array([one[name] for one in self.herds])
        mean, deviation = _moments(clip)
        return Verdict(
            name,
            mean,
            deviation,
            _moments(herds)[0],
            float(_mean([np.array(_moments(h)[1]) for h in herds])),
            _moments(np.abs(herds - clip))[0],
            max(DEVIATIONS * deviation, LEAST),
        )

    def verdicts(self) -> list[Verdict]:
        """Of every measure that the clip tells."""
        return [v for v in map(self.verdict, MEASURES) if np.isfinite(v.clip)]

    @property
    def met(self) -> bool:
        """Whether polarization and milling are met."""
        return all(self.verdict(name).met for name in JUDGED)

    def figures(self, prefix) -> dict[str, float]:
        """What goes into a brush's provenance."""
        found = {}
        for v in self.verdicts():
            words = v.name.replace("_", " ")
            found |= {f"{prefix} {words}, clip": v.clip, f"{prefix} {words}, clip deviation": v.clip_deviation}
            found |= {f"{prefix} {words}, simulated": v.herd, f"{prefix} {words}, error": v.off}
        for name in ("density_error", "density_difference", "velocity_error"):
            series = self.herd(name)
            words = name.replace("_", " ")
            found[f"{prefix} {words}"] = _moments(series)[0]
            found[f"{prefix} {words} at the end"] = float(series[-1])
        found[f"{prefix} horizon, s"] = float(self.times[-1])
        return found


def _moments(values):
    """(mean, deviation) of what is a number; NaN where nothing is."""
    values = np.asarray(values, float)
    values = values[np.isfinite(values)]
    return (float(values.mean()), float(values.std())) if len(values) else (np.nan, np.nan)


def _mean(series):
    stack = np.array(series, float)
    known = np.isfinite(stack)
    total = np.where(known, stack, 0.0).sum(0)
    return np.divide(total, known.sum(0), out=np.full(total.shape, np.nan), where=known.sum(0) > 0)


def compared(evidence: Evidence, runs: list[Run]) -> Comparison:
    """Compare a clip with simulations of it that began in its first frame, at the clip's frame rate.

    Parameters
    ----------
    evidence : Evidence
    runs : list of Run
        At least as many frames as the clip.
    """
    fields = evidence.fields
    simulated = [fields_of(run, fields) for run in runs]
    herds = [field_measures(one) | field_errors(fields, one) for one in simulated]
    made = Comparison(fields.frames.copy(), np.arange(len(fields)) / fields.fps, field_measures(fields), herds, runs[0])
    made.speeds = {"clip": speed_by_density(fields), "simulation": speed_by_density(simulated[0])}
    if evidence.sightings is not None:
        s = evidence.sightings
        made.maps = {"clip": neighbours(s.xy, s.forward, s.first), "simulation": _neighbours_of(runs[0], len(s))}
    return made


def fields_of(run: Run, like: Fields) -> Fields:
    """The fields of a simulation, on the cells of a clip and only where its picture was."""
    shape = like.density.shape
    count, speed, heading = np.zeros(shape), np.zeros(shape), np.zeros((*shape, 2))
    for t in range(shape[0]):
        rows = run.of(t)
        row, column, inside = like.cells_of(run.xy[rows])
        at = t, row[inside], column[inside]
        v = run.velocity[rows][inside]
        np.add.at(count, at, 1.0)
        np.add.at(heading, at, v)
        np.add.at(speed, at, np.hypot(*v.T))
    count *= like.seen
    some = np.where(count > 0, count, np.nan)
    unknown = np.full(shape, np.nan)
    return replace(
        like,
        density=np.where(like.seen, count / like.cell**2, np.nan),
        velocity=heading / some[..., None],
        speed=speed / some,
        speed_variance=unknown,
        angular_variance=unknown,
        count=count.sum((1, 2)),
    )


# measures of one frame after the other ----------------------------------------------------


def field_measures(fields: Fields) -> dict[str, np.ndarray]:
    """{measure: (T,)} of fields; every cell counts by its animals."""
    rows = [_measures(fields, t) for t in range(len(fields))]
    return {name: np.array([row[name] for row in rows]) for name in MEASURES}


def _measures(fields, t):
    there = fields.occupied[t] & (np.nan_to_num(fields.density[t]) > 0) & fields.seen[t]
    w, v, xy = fields.density[t][there], fields.velocity[t][there], fields.centres[there]
    u = _unit(v)
    if not len(w) or not u.any():
        return dict.fromkeys(MEASURES, np.nan)
    mean = np.average(u, axis=0, weights=w)
    picture = fields.centres[fields.seen[t]].mean(0)
    return {
        "polarization": float(np.hypot(*mean)),
        "milling": _turning(xy - np.average(xy, axis=0, weights=w), u, w),
        "milling_image": _turning(xy - picture, u, w),
        "aspect": _aspect(xy, mean, w),
    }


def _unit(v):
    size = np.linalg.norm(v, axis=-1, keepdims=True)
    return np.divide(v, size, out=np.zeros_like(v), where=size > 0)


def _turning(away, u, w):
    r = _unit(away)
    return float(abs(np.average(r[:, 0] * u[:, 1] - r[:, 1] * u[:, 0], weights=w)))


def _aspect(xy, mean, w):
    """Width over length along the common heading, without the outermost animals; NaN without a common heading."""
    if np.hypot(*mean) < 0.3 or len(w) < 3:
        return np.nan
    along = mean / np.hypot(*mean)
    spans = [_span(xy @ axis, w) for axis in ((-along[1], along[0]), along)]
    return float(spans[0] / spans[1]) if spans[1] > 0 else np.nan


def _span(x, w):
    order = np.argsort(x)
    share = np.cumsum(w[order]) / w.sum()
    low, high = np.searchsorted(share, [TAIL, 1 - TAIL])
    return x[order][min(high, len(x) - 1)] - x[order][low]


# errors in a coarse grid --------------------------------------------------------------------


def field_errors(clip: Fields, herd: Fields) -> dict[str, np.ndarray]:
    """{error: (T,)}: how far densities and velocities differ in cells of a tenth of the picture.

    ``density_error`` is the paper's, over the cells that the simulation occupies; ``density_difference`` is the share
    of animals in the wrong cell; ``velocity_error`` the mean distance of unit velocities, 0 to 2.
    """
    step = max(1, -(-max(clip.shape) // COARSE))
    (rho, u), (sim, v) = _coarse(clip, step), _coarse(herd, step)
    found: dict[str, list[float]] = {"density_error": [], "density_difference": [], "velocity_error": []}
    for t in range(len(rho)):
        there = sim[t] > 0
        both = there & (rho[t] > 0) & u[t].any(-1) & v[t].any(-1)
        total = rho[t].sum() + sim[t].sum()
        relative = np.abs(rho[t] - sim[t])[there] / (rho[t][there] + 0.1)
        found["density_error"].append(float(relative.mean()) if there.any() else np.nan)
        found["density_difference"].append(float(np.abs(rho[t] - sim[t]).sum() / total) if total > 0 else np.nan)
        apart = np.linalg.norm(u[t] - v[t], axis=-1)[both]
        weights = sim[t][both]
        found["velocity_error"].append(float(np.average(apart, weights=weights)) if len(apart) else np.nan)
    return {name: np.array(values) for name, values in found.items()}


def _coarse(fields, step):
    """(density, unit velocity) in cells ``step`` times as large."""
    count = np.nan_to_num(fields.density) * fields.seen
    flow = np.nan_to_num(fields.velocity) * count[..., None]
    seen = _blocks(fields.seen.astype(float), step)
    density = _blocks(count, step) / np.maximum(seen, 1.0)
    return density, _unit(np.stack([_blocks(flow[..., k], step) for k in (0, 1)], axis=-1))


def _blocks(values, step):
    """(T, ny, nx) summed in squares of ``step`` cells."""
    frames, ny, nx = values.shape
    padded = np.pad(values, [(0, 0), (0, -ny % step), (0, -nx % step)])
    return padded.reshape(frames, padded.shape[1] // step, step, -1, step).sum((2, 4))


# where the others stand, and how fast a crowd is ------------------------------------------------


def neighbours(xy, forward, first, most=40) -> np.ndarray:
    """Mean density of others about an animal that faces up, (BINS, BINS) per BL²; at most so many frames."""
    from systems.measures import compute_neighbour_map

    frames = np.unique(np.linspace(0, len(first) - 2, most).round().astype(int))
    squares = [
        compute_neighbour_map(xy[first[t] : first[t + 1]], forward[first[t] : first[t + 1]], REACH, BINS)
        for t in frames
        if first[t + 1] - first[t] > 1
    ]
    return np.mean(squares, axis=0) if squares else np.full((BINS, BINS), np.nan)


def _neighbours_of(run, frames):
    return neighbours(run.xy, run.forward, run.first[: frames + 1])


def speed_by_density(fields: Fields) -> tuple[np.ndarray, np.ndarray]:
    """(densities, mean speeds there): slots that hold equally many animals."""
    there = fields.occupied & (np.nan_to_num(fields.density) > 0)
    density, speed = fields.density[there], fields.speed[there]
    known = np.isfinite(speed)
    density, speed = density[known], speed[known]
    if len(density) < SLOTS:
        return np.zeros(0), np.zeros(0)
    order = np.argsort(density, kind="stable")
    share = np.cumsum(density[order]) / density.sum()
    slots = np.split(order, np.searchsorted(share, np.arange(1, SLOTS) / SLOTS))
    slots = [slot for slot in slots if len(slot)]
    at = [np.average(density[slot], weights=density[slot]) for slot in slots]
    return np.array(at), np.array([np.average(speed[slot], weights=density[slot]) for slot in slots])

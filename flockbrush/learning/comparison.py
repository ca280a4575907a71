"""A clip and simulations of it, frame by frame, measured in the same way.

References
----------
.. [1] Gong, X. et al. (2025). Herds from video: learning a microscopic herd model from macroscopic motion data.
   Computer Graphics Forum 44(6), e70225.  Section 7.1.2.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from flockbrush.film.observations import Evidence, Fields
from flockbrush.learning.axis_variance import variance_of_run, variance_told
from flockbrush.learning.herd_views import HerdView, fields_of, told_apart, view_of, view_of_run
from flockbrush.learning.rollout import Run
from flockbrush.learning.scores import ClipTarget, density_errors, distance, measures_of, total, velocity_errors

SHOWN = (
    "polarization",
    "milling",
    "milling in the picture",
    "aspect",
    "order nearby",
    "nearest neighbour",
    "density",
    "directions",
    "largest part",
    "speed",
)
TITLES = {
    "polarization": "Polarization",
    "milling": "Milling about the middle of the herd",
    "milling in the picture": "Milling about the middle of the picture",
    "aspect": "Width over length",
    "order nearby": "Order among neighbours",
    "nearest neighbour": "Nearest neighbour, BL",
    "density": "Density, animals per BL²",
    "directions": "Variance of directions, degrees²",
    "largest part": "Share of the largest part",
    "speed": "Speed, BL/s",
    "density error": "Density error (paper)",
    "symmetric density error": "Share of animals in the wrong cell",
    "velocity error": "Velocity error (paper)",
}
ERRORS = "density error", "symmetric density error", "velocity error"
JUDGED = "polarization", "milling"
MOVING = "polarization", "milling", "milling in the picture", "order nearby", "speed"  # not shown by one picture
DEVIATIONS, LEAST = 2.0, 0.05  # a measure is met within two of the clip's own deviations, or .05
REACH, BINS, LOOKS = 3.0, 25, 40  # of the map of neighbours: body lengths, cells across, frames at most
HORIZONS = 0.25, 0.5, 0.75, 1.0  # shares of the time at which errors are reported
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
    """What became of simulations that began as the clip did."""

    frames: np.ndarray  # (T,) int; of the clip
    times: np.ndarray  # (T,); seconds since the beginning
    clip: dict[str, np.ndarray]  # str to (T,)
    # list of dict of str to (T,); one for each simulation, with the errors besides the measures
    herds: list[dict[str, np.ndarray]]
    run: Run  # the first simulation
    # str to (BINS, BINS); neighbours about an animal that faces up, per BL², of clip and simulation; empty without
    # single animals
    maps: dict[str, np.ndarray] = field(default_factory=dict)
    speeds: dict[str, tuple[np.ndarray, np.ndarray]] = field(default_factory=dict)  # str to (densities, speeds)
    # how unlike the clip the simulations are in all they are scored by, in the clip's own deviations
    unlike: float = np.nan
    of_tracks: bool = False

    @property
    def subject(self) -> str:
        """What the simulations are compared with: a clip, tracks, or one photograph."""
        return "photograph" if (self.frames == self.frames[0]).all() else "tracks" if self.of_tracks else "clip"

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
        """A verdict for every measure that the clip determines."""
        return [v for v in map(self.verdict, (n for n in SHOWN if n in self.clip)) if np.isfinite(v.clip)]

    def at_horizons(self, name) -> list[tuple[float, float]]:
        """[(seconds, error)] of one of `ERRORS`, at `HORIZONS`; means over the simulations."""
        rows = np.unique(np.round(np.asarray(HORIZONS) * (len(self.times) - 1)).astype(int))
        series = self.herd(name)
        return [(float(self.times[t]), float(series[t])) for t in rows]

    @property
    def met(self) -> bool:
        """Whether polarization and milling are met."""
        return all(self.verdict(name).met for name in JUDGED)

    def figures(self, prefix) -> dict[str, float]:
        """What goes into a brush's provenance."""
        found: dict[str, float] = {}
        for v in self.verdicts():
            found |= {f"{prefix} {v.name}, clip": v.clip, f"{prefix} {v.name}, clip deviation": v.clip_deviation}
            found |= {f"{prefix} {v.name}, simulated": v.herd, f"{prefix} {v.name}, error": v.off}
        for name in ERRORS:
            series = self.herd(name)
            found |= {f"{prefix} {name}": _moments(series)[0], f"{prefix} {name} at the end": float(series[-1])}
        found[f"{prefix} unlike the clip by"] = self.unlike
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
    runs : list of Run
        As many frames as the clip has.
    """
    fields, single = evidence.fields, told_apart(evidence)
    view, views = view_of(evidence, single), [view_of_run(run, evidence, single) for run in runs]
    simulated = [fields_of(run, fields) for run in runs]
    herds = [
        measures_of(seen) | density_errors(as_fields, fields) | {"velocity error": velocity_errors(run, fields)}
        for run, seen, as_fields in zip(runs, views, simulated, strict=True)
    ]
    times = np.arange(len(fields)) / fields.fps
    clip = measures_of(view)
    if not fields.tells_motion:  # one picture: nothing is known of motion
        clip |= {name: np.full(len(fields), np.nan) for name in MOVING if name in clip}
        clip["directions"] = np.full(len(fields), variance_told(evidence))
        for herd, run in zip(herds, runs, strict=True):
            herd["directions"] = variance_of_run(run, fields, range(len(run)))
    made = Comparison(fields.frames.copy(), times, clip, herds, runs[0], of_tracks=evidence.from_tracks)
    target = ClipTarget.of(evidence)
    made.unlike = float(np.mean([total(distance(run, evidence, target)) for run in runs]))
    made.speeds = {"clip": speed_by_density(fields), "simulation": speed_by_density(simulated[0])}
    if single and fields.tells_motion:
        made.maps = {"clip": neighbours(view), "simulation": neighbours(views[0])}
    return made


# where the others stand, and how fast a crowd is ------------------------------------------------


def neighbours(view: HerdView) -> np.ndarray:
    """Mean density of others about an animal that faces up, (BINS, BINS) per BL²."""
    from flockbrush.systems.measures import compute_neighbour_map

    looks = np.unique(np.linspace(0, len(view) - 1, LOOKS).round().astype(int))
    rows = [view.of(t) for t in looks]
    squares = [compute_neighbour_map(view.xy[r], view.heading[r], REACH, BINS) for r in rows if len(view.xy[r]) > 1]
    return np.mean(squares, axis=0) if squares else np.full((BINS, BINS), np.nan)


def speed_by_density(fields: Fields) -> tuple[np.ndarray, np.ndarray]:
    """(densities, mean speeds there): slots that hold equally many animals."""
    there = fields.occupied & (np.nan_to_num(fields.density) > 0)
    density, speed = fields.density[there], np.asarray(fields.speed)[there]
    known = np.isfinite(speed)
    density, speed = density[known], speed[known]
    if len(density) < SLOTS:
        return np.zeros(0), np.zeros(0)
    order = np.argsort(density, kind="stable")
    share = np.cumsum(density[order]) / density.sum()
    slots = [slot for slot in np.split(order, np.searchsorted(share, np.arange(1, SLOTS) / SLOTS)) if len(slot)]
    at: list[float] = []
    mean: list[float] = []
    for slot in slots:
        here = float(np.average(density[slot], weights=density[slot]))
        if at and here < 1.05 * at[-1]:  # cells of one animal are many
            continue
        at.append(here)
        alike = (density >= density[slot].min()) & (density <= density[slot].max())
        mean.append(float(np.average(speed[alike], weights=density[alike])))
    return np.array(at), np.array(mean)

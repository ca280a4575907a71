"""Films that Flockbrush exports of its own levels, and what is seen in them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from flockbrush.systems.measures import compute_polarization

from flockbrush.film.observe import observe
from flockbrush.output.export import Exports
from flockbrush.runs.run import start

WALKS = 0.6  # lengths of its own that an animal goes in a film that is none of the ground


class Herd(NamedTuple):
    """Means over the frames of a film."""

    polarization: float
    speed: float  # m/s
    count: float
    length: float  # m, the median animal


def film(level, path, seconds=1.6, fps=10, warm=1.0, overlays=False):
    """Film a level from above into ``path``; (the herd as it was, pixels a metre)."""
    simulation = start(level)
    dt = simulation.clock.dt
    for _ in range(round(warm / dt)):
        simulation.tick()
    moments = []
    with Exports([path], simulation, fps=fps, overlays=overlays) as exports:
        kind, sampler = exports._pairs[0]
        for _ in range(round(seconds / dt)):
            simulation.tick()
            for moment in sampler.due():
                kind.take(moment)
                moments.append(moment)
        scale = kind._painter.camera.scale
    simulation.close()
    return _truth(moments), scale


def _truth(moments):
    """Of the animals that walk: those that rest all the while are ground, as `docs/fields.md` says."""
    low, high, long = {}, {}, {}
    for m in moments:
        for name, at, length in zip(m.ids.tolist(), m.xyz[:, :2], m.length, strict=True):
            low[name], high[name] = np.minimum(low.get(name, at), at), np.maximum(high.get(name, at), at)
            long[name] = length
    walks = {name for name in low if np.linalg.norm(high[name] - low[name]) > WALKS * long[name]}
    rows = [(m, np.isin(m.ids, list(walks))) for m in moments]
    rows = [(m, chosen) for m, chosen in rows if chosen.any()]
    if not rows:
        return Herd(np.nan, 0.0, 0.0, np.nan)
    orders = [compute_polarization(m.forward[chosen]) for m, chosen in rows]
    speeds = [np.linalg.norm(m.velocity[chosen, :2], axis=1).mean() for m, chosen in rows]
    length = float(np.median(np.concatenate([m.length[chosen] for m, chosen in rows])))
    count = float(np.mean([chosen.sum() for _, chosen in rows]))
    return Herd(float(np.mean(orders)), float(np.mean(speeds)), count, length)


def seen(path, scale, **options):
    """(The herd as it is seen in a film, what was observed)."""
    told = observe(path, **options)
    worked = np.sqrt(abs(np.linalg.det(told.camera[0, :, :2])))  # px of the pictures worked on, for one of the film's
    px = told.body_length_px / worked / scale
    if told.sightings is None:
        return Herd(np.nan, np.nan, float(told.fields.count.mean()), px), told
    rows = told.sightings
    orders = [np.linalg.norm(rows.forward[rows.of(t)].mean(0)) for t in range(len(rows)) if len(rows.xy[rows.of(t)])]
    speed = float(np.nanmean(rows.speed)) * px
    return Herd(float(np.mean(orders)), speed, float(np.diff(rows.first).mean()), px), told

"""Learn from one photograph and compare the spacing and the directions of the simulated herd with it.

    python benchmarks/learning.py photos [--models band swarm graze] [--seeds 7] [--full]

A herd of another model (``benchmarks/foreign_herds.py``) is photographed from above.  A brush is learned from the
picture alone and three herds are simulated from it for 10 s.  Goals: the median of the distances to the nearest
neighbour and each of their deciles within 15 % of the picture, and the variance of the axes within a factor of 1.5;
simulated values are means over the last two thirds.  Axes of simulated animals get the error that the axes seen in the
picture have. ``truth`` is the herd that was photographed, in the body lengths of the picture, and ``itself`` whether
its model reaches the goals if it goes on for 10 s: one picture of 60 animals does not tell what they are usually like.
"""

from __future__ import annotations

import dataclasses
import tempfile
import time
from pathlib import Path

import numpy as np

MODELS = "band", "swarm", "graze"
SPEED = 1.0  # BL/s, given to the command
SECONDS, RUNS, LOOKS = 10.0, 3, 12
SPACING, VARIANCE = 0.15, 1.5  # goals


def add(commands):
    """Add the command's options."""
    parser = commands.add_parser("photos", help="spacing and directions of herds learned from one photograph")
    parser.add_argument("--models", nargs="*", default=list(MODELS), help="models of foreign_herds")
    parser.add_argument("--animals", type=int, default=60)
    parser.add_argument("--seeds", type=int, nargs="*", default=[7], help="of the herds that are photographed")
    parser.add_argument("--full", action="store_true", help="learn with the full settings instead of --quick's")
    parser.add_argument("--jobs", type=int, default=1)
    parser.set_defaults(run=run)


def run(options):
    """Run the study; print a line for each photograph."""
    print("photograph | animals | median, BL: truth, picture, herd | worst decile | deg²: picture, herd", end=" | ")
    print("met | itself | s")
    rows = []
    for seed in options.seeds:
        for model in options.models:
            rows.append(_of_model(model, seed, options))
            print(" | ".join(str(value) for value in rows[-1].values()), flush=True)
    met, itself = (sum(row[name] for row in rows) for name in ("met", "itself"))
    print(f"within the goals: {met} of {len(rows)}; models themselves: {itself} of {len(rows)}")
    return rows


def _of_model(model, seed, options):
    from flockbrush.learning.axis_variance import variance_told
    from flockbrush.learning.scores import spacings

    began = time.perf_counter()
    clip, film, error = _photograph(model, options.animals, seed)
    truth, rng = film.seen_from(0, clip.body_length_px), np.random.default_rng(1)
    found, looks = _learned(clip, options), []
    for one in range(RUNS):
        ran = _simulated(clip, found, one)
        for t in range(len(ran) // 3, len(ran)):
            angle = np.arctan2(*ran.forward[ran.of(t)].T[::-1])
            angle += error * rng.normal(size=len(angle))
            looks.append((ran.xy[ran.of(t)], np.column_stack([np.cos(angle), np.sin(angle)])))
    seen, told = clip.sightings.xy[clip.sightings.of(0)], variance_told(clip)
    off, mean, met = _compared(looks, seen, told)
    later = range(len(truth.xy) // 3, len(truth.xy), max(1, len(truth.xy) // LOOKS))
    itself = _compared([(truth.xy[t], truth.forward[t]) for t in later], seen, told)[2]
    of_truth, of_picture = spacings([truth.xy[0]])[4], spacings([seen])[4]
    worst = int(np.abs(off).argmax())
    return {
        "photograph": f"{model} {seed}", "animals": f"{len(seen)} of {options.animals}",
        "median": f"{of_truth:.2f}, {of_picture:.2f}, {of_picture * (1 + off[4]):.2f} ({off[4]:+.0%})",
        "worst decile": f"{worst + 1}: {off[worst]:+.0%}", "variance": f"{told:.0f}, {mean:.0f}", "met": met,
        "itself": itself, "s": round(time.perf_counter() - began),
    }  # fmt: skip


def _compared(looks, seen, told):
    """(how far each decile is off, the variance of axes, whether the goals are reached) of some (xy, forward)."""
    from flockbrush.learning.axis_variance import mean_variance
    from flockbrush.learning.scores import spacings

    off = spacings([xy for xy, _ in looks]) / spacings([seen]) - 1.0
    mean = float(np.nanmean([mean_variance(*look) for look in looks]))
    return off, mean, bool(np.abs(off).max() <= SPACING and 1 / VARIANCE <= mean / told <= VARIANCE)


def _photograph(model, animals, seed):
    """(the evidence of a photograph, a film with it and all that follows, the error of its axes, rad)."""
    import cv2
    from scipy.spatial import cKDTree

    from benchmarks.foreign_herds import herd
    from benchmarks.herd_film import CameraDrift, shoot
    from flockbrush.film.observe import observe
    from flockbrush.learning.photo import standing

    truth = herd(model, animals, SECONDS, seed=seed)
    first = dataclasses.replace(truth, **{name: getattr(truth, name)[:1] for name in ("xy", "forward", "speed")})
    extent = float(np.ptp(truth.xy[0], axis=0).max()) + 6.0
    body = float(np.clip(620.0 / extent, 11.0, 22.0))
    side = int(np.ceil(extent * body / 16) * 16)
    middle = 0.5 * (truth.xy[0].min(0) + truth.xy[0].max(0))
    camera = CameraDrift((0.0, 0.0), 0.0, 0.0, 0.0, look_at=tuple(middle.tolist()))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "photo.png"
        film = dataclasses.replace(shoot(first, None, (side, side), body, camera, seed=5), truth=truth)
        cv2.imwrite(str(path), film.frames[0])
        clip = standing(observe(path), SPEED)
    true, seen, rows = film.seen_from(0, clip.body_length_px), clip.sightings, clip.sightings.of(0)
    far, who = cKDTree(true.xy[0]).query(seen.xy[rows])
    mine, theirs = seen.forward[rows], true.forward[0][who]
    off = np.arcsin(np.clip(mine[:, 0] * theirs[:, 1] - mine[:, 1] * theirs[:, 0], -1.0, 1.0))[far < 0.5]
    return clip, film, 1.48 * float(np.median(np.abs(off)))


def _learned(clip, options):
    from flockbrush.learning.learn import BUDGET, QUICK_BUDGET, QUICK_STARTS
    from flockbrush.learning.recipe import SearchSettings, learn

    quick = {"budget_s": QUICK_BUDGET, "starts": QUICK_STARTS, "quick": True}
    how = {"budget_s": BUDGET} if options.full else quick
    return learn(clip, SearchSettings(use=frozenset({"density", "variance"}), **how), jobs=options.jobs)


def _simulated(clip, found, seed):
    from flockbrush.learning.initial_conditions import start_of
    from flockbrush.learning.rollout import rollout

    return rollout(
        start_of(clip, 0, seed, found.body), found.params, found.speed, found.body, found.vision, seconds=SECONDS,
        fps=LOOKS / SECONDS, seed=seed,
    )  # fmt: skip

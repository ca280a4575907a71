"""Learn one clip at several compressions and crops, and compare the measured behaviour of the brushes.

    python benchmarks/learning.py variants [--models band mill] [--full]

A herd of another model is filmed once (``benchmarks/herd_film.py``).  The same pictures are encoded at three
compressions (x264 at crf 18, 23 and 30) and cropped in four ways: a band is cut off at the left, right, top or bottom,
beside the herd.  A brush is learned from the first half of each, and every brush is simulated from the second half of
the clip at crf 23.  Two brushes agree in a measure if they differ by no more than the limit of the report, for the
measures of the report in which the clip at crf 23 has a value (``flockbrush.learning.battery``).  ``seeds`` is the
floor: the same clip learned with other random numbers.
"""

from __future__ import annotations

import tempfile
import time
from pathlib import Path

import numpy as np

MODELS = "band", "mill"  # of benchmarks/foreign_herds.py
COMPRESSIONS = 18, 23, 30
ROOM = 3.0  # body lengths beside the herd, of which most is cropped
CUT = 2.0
USUAL = "crf 23"
RUNS = 6


def add(commands):
    """Add the command's options."""
    parser = commands.add_parser("variants", help="one clip at several compressions and crops")
    parser.add_argument("--models", nargs="*", default=list(MODELS), help="models of foreign_herds")
    parser.add_argument("--animals", type=int, default=50)
    parser.add_argument("--seconds", type=float, default=4.0)
    parser.add_argument("--full", action="store_true", help="learn with the full settings instead of --quick's")
    parser.add_argument("--jobs", type=int, default=1)
    parser.set_defaults(run=run)


def run(options):
    """Run the study; print a line for each variant."""
    rows = []
    for model in options.models:
        rows += _of_model(model, options)
    agreed, asked = (sum(row[key] for row in rows) for key in ("agree", "of"))
    print(f"measures that agree: {agreed} of {asked}")
    return rows


def _of_model(model, options):
    from flockbrush.learning.battery import Battery

    with tempfile.TemporaryDirectory() as folder:
        clips = _films(model, options, Path(folder))
        usual = clips.pop(USUAL)
        learned = {USUAL: _learned(usual, options)}
        learned |= {f"seed {seed}": _learned(usual, options, seed) for seed in (1, 2)}
        learned |= {name: _learned(path, options) for name, path in clips.items()}
        battery = Battery.of(_held(usual))
    rows, base = [], _measured(battery, learned.pop(USUAL))
    print(f"{model}: clip | " + ", ".join(f"{name} {_text(value)}" for name, value in battery.values.items()))
    print(f"{model}: {USUAL} | " + ", ".join(f"{row.name} {row.herd:.3g}" for row in base))
    for name, found in learned.items():
        measured = _measured(battery, found)
        off = [
            f"{one.name} {mine.herd:.3g} and {one.herd:.3g} (limit {max(mine.limit, one.limit):.2g})"
            for mine, one in zip(base, measured, strict=True)
            if not abs(mine.herd - one.herd) <= max(mine.limit, one.limit)
        ]
        row = {"clip": model, "variant": name, "agree": len(base) - len(off), "of": len(base), "differs": off}
        print(f"{model} | {name} | {row['agree']} of {row['of']} | {'; '.join(off)}", flush=True)
        rows.append(row)
    return rows


def _text(value):
    return f"{float(np.mean(value)):.3g}"


def _films(model, options, folder):
    """{variant: path} of one herd, filmed once."""
    from benchmarks.foreign_herds import herd
    from benchmarks.herd_film import LOOKS, CameraDrift, _Writer, shoot

    truth = herd(model, options.animals, options.seconds, seed=5)
    extent = float(np.ptp(truth.xy - truth.xy.mean(1, keepdims=True), axis=(0, 1)).max()) + 2 * ROOM
    body = float(np.clip(620.0 / extent, 11.0, 22.0))
    side = int(np.ceil(extent * body / 16) * 16)
    film, cut = shoot(truth, None, (side, side), body, CameraDrift(follow=1.0), seed=5), int(CUT * body) // 2 * 2
    whole = slice(None)
    kinds = {f"crf {crf}": (crf, whole, whole) for crf in COMPRESSIONS}
    kinds |= {
        f"cropped at the {side}": (LOOKS["sheep"].crf, *slices)
        for side, slices in {
            "left": (whole, slice(cut, None)), "right": (whole, slice(None, -cut)),
            "top": (slice(cut, None), whole), "bottom": (slice(None, -cut), whole),
        }.items()
    }  # fmt: skip
    paths = {}
    for name, (crf, rows, columns) in kinds.items():
        paths[name] = folder / f"{name}.mp4"
        pictures = [np.ascontiguousarray(picture[rows, columns]) for picture in film.frames]
        writer = _Writer(paths[name], truth.fps, pictures[0].shape[1::-1], crf)
        for picture in pictures:
            writer.write(picture)
        writer.close()
    return paths


def _frames(path):
    from flockbrush.film.clip_reader import open_clip

    return len(open_clip(path))


def _learned(path, options, seed=0):
    """A brush learned from the first half."""
    from flockbrush.film.observe import observe
    from flockbrush.learning.learn import BUDGET, QUICK_BUDGET, QUICK_STARTS
    from flockbrush.learning.recipe import SearchSettings, learn

    began = time.perf_counter()
    first = observe(path, frames=(0, _frames(path) // 2 - 1))
    how = (
        {"budget_s": BUDGET / 3} if options.full else {"budget_s": QUICK_BUDGET, "starts": QUICK_STARTS, "quick": True}
    )
    found = learn(first, SearchSettings(seed, **how), jobs=options.jobs)
    print(f"  learned {path.stem}, seed {seed}: {time.perf_counter() - began:.0f} s", flush=True)
    return found


def _held(path):
    """The second half, seen with the whole clip."""
    from flockbrush.film.observe import observe

    whole = observe(path)
    return whole.part(slice(len(whole.fields) // 2, None))


def _measured(battery, learned):
    from flockbrush.learning.simulate import simulated

    runs = [battery.measured(simulated(battery.clip, learned, seed, True)) for seed in range(RUNS)]
    return battery.compared(runs)

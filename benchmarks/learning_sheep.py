"""Compare where animals are in a film of real sheep with simulated herds, on halves that were not learned from.

    python benchmarks/learning.py sheep [--budget 90] [--runs 5] [--data DIR]

The film is sheep_0043.mp4 of the data set Aerial Sheep (public domain; not part of Flockbrush).  Three halves are held
out in turn: the second and the first of frames 11 to 72, and the second of frames 2 to 72.  The other half is observed
by itself and learned from.

The density overlap of a frame is 1 less the share of animals in the wrong cell, on 10 x 10 cells over the picture: 1 is
the same density everywhere, 0 no common cell.  The table gives means over the frames of a half and over runs, for the
learned brush, for animals that stand or keep their velocity, and for the best shipped brush with the speeds and bodies
of the half that was learned from.  ``verdict`` is the sentence that `flockbrush learn` would give.
"""

from __future__ import annotations

import json
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np

from benchmarks.learning_halves import DATA, SHEEP, learned_from

HALVES = {  # frames, and which half is held out: 0 the second, 1 the first
    "second half of 11:72": ((11, 72), 0),
    "first half of 11:72": ((11, 72), 1),
    "second half of 2:72": ((2, 72), 0),
}


def add(commands):
    """Add the command's options."""
    parser = commands.add_parser("sheep", help="density overlap with a film of real sheep")
    parser.add_argument("--budget", type=float, default=90.0, help="seconds of trials and evolution, counted in work")
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--data", type=Path, default=DATA, help="folder with the data sets")
    parser.set_defaults(run=run)


def run(options):
    """Learn from each half; print a line for each, and the table."""
    if not (options.data / SHEEP).exists():
        print(f"skipped, there is no {options.data / SHEEP}")
        return []
    rows = []
    for name in HALVES:
        rows.append(overlap_of(name, options))
        print(json.dumps(rows[-1]), flush=True)
    print(table(rows))
    return rows


def overlap_of(name, options):
    """Return the overlaps and the verdict of one half."""
    from flockbrush.behaviours.brush import shipped

    from flockbrush.film.open_clip import Looking, look_at, looked_apart
    from flockbrush.learning.simulate import simulated
    from flockbrush.learning.verdict import IDLE, idle, judge

    begun, (frames, part) = time.process_time(), HALVES[name]
    film, how = options.data / SHEEP, Looking(frames=frames)
    seen, held = looked_apart(film, how, look_at(film, how), 0.5, rotate=part > 0)[part]
    found = learned_from(seen, options.budget)

    def overlap(brush):
        return float(np.mean([_overlap(simulated(held, brush, seed), held) for seed in range(options.runs)]))

    brushes = [shipped().get(one) for one in shipped().names()]
    others = {
        brush.name: SimpleNamespace(params=brush.params, speed=found.speed, body=found.body, vision=brush.vision)
        for brush in brushes
        if brush.model == "herd" and brush.provenance.kind != "learned"
    }
    shipped_ones = {one: overlap(brush) for one, brush in others.items()}
    best = max(shipped_ones, key=shipped_ones.get)
    verdict = judge(held, found, others)
    return {
        "half": name, "model": found.kind, "animals": round(float(np.nanmedian(held.fields.count))),
        "frames": len(held.fields), "learned": overlap(found),
        **{one: _overlap(idle(held, 0, moves), held) for one, moves in IDLE.items()},
        "best shipped brush": best, "of that": shipped_ones[best], "kind": verdict.kind, "verdict": verdict.sentence,
        "CPU, s": round(time.process_time() - begun),
    }  # fmt: skip


def _overlap(run, clip):
    from flockbrush.learning.herd_views import fields_of
    from flockbrush.learning.scores import density_errors

    off = density_errors(fields_of(run, clip.fields), clip.fields)["symmetric density error"]
    return 1.0 - float(np.mean(off))


def table(rows):
    """Return the results as Markdown."""
    from flockbrush.learning.verdict import ONWARDS, STILL

    lines = [
        "| held out | learned | nobody moves | all keep their velocity | best shipped brush | verdict |",
        "|---|---|---|---|---|---|",
    ]
    for row in rows:
        cells = (f"{row[key]:.3f}" for key in ("learned", STILL, ONWARDS))
        shipped = f"{row['of that']:.3f} ({row['best shipped brush']})"
        lines.append(f"| {row['half']} | " + " | ".join([*cells, shipped, row["verdict"]]) + " |")
    better = [row for row in rows if row["learned"] > max(row[STILL], row["of that"])]
    untold = [row for row in rows if row["kind"] == "untold"]
    lines.append(
        f"\nlearned brush nearer than standing animals and the best shipped brush: {len(better)} of {len(rows)}; "
        f"verdict 'cannot be told': {len(untold)} of {len(rows)}"
    )
    return "\n".join(lines)

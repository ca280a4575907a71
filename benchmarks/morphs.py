"""Measure how evenly herds change along the shipped paths between brushes.

    python benchmarks/morphs.py [A--B ...] --seeds 64 --animals 100 400

For each path and herd size, on new seeds, it prints the largest change of polarization or milling in one step, the
largest deviation between seeds, and whether both change monotonically within two standard errors
(`flockbrush.studies.morph`); and the same for the straight line between the brushes with as many steps.  Pairs without
a shipped path get only the straight line, in eighths.
"""

from __future__ import annotations

import argparse

import numpy as np
from flockbrush.behaviours.brush import shipped
from flockbrush.behaviours.mixture import STEPS, can_mix, load_path, mixed

from flockbrush.studies.morph import Trial, faults, measured

FIRST = 9001  # seed; the searches used no seeds from here to a million


def shipped_paths():
    """Return the shipped paths by name."""
    found = {}
    for folder in shipped().folders:
        for file in sorted(folder.glob("*.path.toml")):
            path = load_path(file.read_bytes(), file.name)
            found[f"{path.start}--{path.end}"] = path
    return found


def judged(start, end, path, trial):
    """Return a `Measured` for the path, if there is one, and for the straight line."""
    shares = np.linspace(0.0, 1.0, len(path.along) if path else STEPS + 1)
    ways = {"path": path, "straight line": None} if path else {"straight line": None}
    return {
        name: measured(lambda share, w=way: mixed(start, end, share, w), shares, trial, FIRST)
        for name, way in ways.items()
    }


def brushes_of(pair):
    """Return the two shipped brushes named by ``A--B``; raises ValueError."""
    names = pair.split("--")
    if len(names) != 2 or set(names) - set(shipped().names()):
        raise ValueError(f"{pair!r}: invalid pair A--B of shipped brushes; there are {', '.join(shipped().names())}")
    start, end = (shipped().get(name) for name in names)
    if not can_mix(start, end):
        raise ValueError(f"{pair!r}: brushes of different models or media cannot be mixed")
    return start, end


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("paths", nargs="*", metavar="A--B", help="default: all shipped paths")
    parser.add_argument("--seeds", type=int, default=64)
    parser.add_argument("--animals", type=int, nargs="+", default=[100, 400])
    parser.add_argument("--seconds", type=float, default=20.0)
    told = parser.parse_args()
    paths = shipped_paths()
    try:
        pairs = {name: brushes_of(name) for name in told.paths or paths}
    except ValueError as error:
        parser.error(str(error))
    print(f"{told.seeds} seeds from {FIRST} on, {told.seconds:g} s")
    print(f"{'path':<24} animals  way            largest step  largest deviation  goes back")
    for name, (start, end) in pairs.items():
        for animals in told.animals:
            trial = Trial(animals, told.seeds, seconds=told.seconds)
            for way, found in judged(start, end, paths.get(name), trial).items():
                back = "yes" if any("goes back" in fault for fault in faults(found)) else "no"
                step = np.abs(np.diff(found.mean, axis=0)).max()
                line = f"{name:<24} {animals:>7}  {way:<13} {step:>13.2f} {found.deviation.max():>18.2f}  {back}"
                print(line, flush=True)


if __name__ == "__main__":
    main()

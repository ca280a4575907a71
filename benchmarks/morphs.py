"""Measure how evenly herds change along the shipped paths between brushes.

    python benchmarks/morphs.py [A--B ...] --seeds 64 --animals 100 400

For each path and herd size, on new seeds, it prints the largest change of polarization or milling in one step, the
largest deviation between seeds, the largest reversal (`flockbrush.studies.morph` says what chance explains), the least
number of standard errors within which a monotonic curve passes all means (no error is taken to be larger than it is),
and a verdict: "even"; or "bistable", with both branches at one step, for herds that are swept along the way and back;
or "uneven".  The same is printed for the straight line between the brushes.  Start and duration of the runs come from
the path.  Pairs without a shipped path get only the straight line, in twelfths, as the options say.
"""

from __future__ import annotations

import argparse
from dataclasses import replace

import numpy as np
from flockbrush.behaviours.brush import shipped
from flockbrush.behaviours.mixture import STEPS, can_mix, load_path, mixed

from flockbrush.studies.morph import (
    BEGINNINGS,
    MEASURES,
    Measured,
    Trial,
    faults,
    goes_back,
    measured,
    sweep,
    verdict,
)

FIRST = 9001  # seed; the searches used no seeds from here to a million


def shipped_paths():
    """Return the shipped paths by name."""
    found = {}
    for folder in shipped().folders:
        for file in sorted(folder.glob("*.path.toml")):
            path = load_path(file.read_bytes(), file.name)
            found[f"{path.start}--{path.end}"] = path
    return found


def errors_from_monotonic(found: Measured) -> np.ndarray:
    """Return (2,) least number of standard errors within which a monotonic curve passes all means.

    A curve passes between two points exactly if the earlier mean less so many of its errors is not beyond the later
    mean and as many of its own.
    """
    error = found.deviation / np.sqrt(found.seeds)
    way = found.mean * np.where(found.mean[-1] >= found.mean[0], 1.0, -1.0)
    earlier, later = np.triu_indices(len(way), 1)
    fallen, errors = way[earlier] - way[later], error[earlier] + error[later]
    back = fallen > 0.0
    return np.divide(fallen, errors, out=np.where(back, np.inf, 0.0), where=back & (errors > 0.0)).max(0)


WAYS = ("path", "straight line")


def judged(start, end, path, trial, swept_herds, ways=WAYS, first=FIRST, sweep_all=False):
    """What herds do at the steps of paint on a path, if there is one, and on the straight line: `Measured`, and words.

    The words say whether the way is even or bistable.
    """
    shares = np.linspace(0.0, 1.0, STEPS + 1)  # those that paint takes
    found = {}
    for name, way in zip(WAYS, (path, None), strict=True):
        if name not in ways or (name == "path" and path is None):
            continue

        def at(share, w=way):
            return mixed(start, end, share, w)

        seen = measured(at, shares, trial, first)
        words = "uneven" if (wrong := faults(seen)) else "even"
        if wrong or sweep_all:
            swept = sweep(at, shares, replace(trial, seeds=swept_herds), first)
            if swept.hysteresis or sweep_all:
                words = verdict(swept) if swept.hysteresis else f"{words}; {verdict(swept)}"
        found[name] = seen, words
    return found


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
    parser.add_argument("--first", type=int, default=FIRST, help="first seed")
    parser.add_argument("--animals", type=int, nargs="+", default=[100, 400])
    parser.add_argument("--swept", type=int, default=16, help="herds that are swept along a way that is not even")
    parser.add_argument("--sweep-all", action="store_true", help="sweep herds along even ways, too")
    parser.add_argument("--seconds", type=float, default=20.0, help="of pairs without a path")
    parser.add_argument("--begin", choices=BEGINNINGS, default="random", help="of pairs without a path")
    parser.add_argument("--way", choices=WAYS, nargs="+", default=WAYS, help="both unless told")
    parser.add_argument("--steps", action="store_true", help="print what herds do at every step, too")
    told = parser.parse_args()
    paths = shipped_paths()
    try:
        pairs = {name: brushes_of(name) for name in told.paths or paths}
    except ValueError as error:
        parser.error(str(error))
    where = "" if told.sweep_all else " where a way is not even"
    print(f"{told.seeds} seeds from {told.first} on, {told.swept} herds swept{where}")
    print(
        f"{'pair':<22} animals  begin    s    way            "
        "largest step  largest deviation  goes back  errors  verdict"
    )
    for name, (start, end) in pairs.items():
        path = paths.get(name)
        begin, seconds = (path.begin, path.seconds) if path else (told.begin, told.seconds)
        for animals in told.animals:
            trial = Trial(animals, told.seeds, seconds=seconds, begin=begin)
            ways = judged(start, end, path, trial, told.swept, told.way, told.first, told.sweep_all)
            for way, (seen, words) in ways.items():
                back = goes_back(seen)[0].max()
                step = np.abs(np.diff(seen.mean, axis=0)).max()
                print(
                    f"{name:<22} {animals:>7}  {begin:<7}  {seconds:<3g}  {way:<13} {step:>13.2f} "
                    f"{seen.deviation.max():>18.2f}  {back:>9.2f}  {errors_from_monotonic(seen).max():>6.1f}  {words}",
                    flush=True,
                )
                for k in range(len(seen.mean) if told.steps else 0):
                    cells = [
                        f"{name} {mean:.2f} ± {deviation:.2f}"
                        for name, mean, deviation in zip(MEASURES, seen.mean[k], seen.deviation[k], strict=True)
                    ]
                    print(f"    {k}/{len(seen.mean) - 1}  {'  '.join(cells)}", flush=True)


if __name__ == "__main__":
    main()

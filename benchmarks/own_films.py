"""Film the shipped levels, observe the films, and compare the observed herds with the simulated ones.

    python benchmarks/own_films.py [LEVEL ...] [--overlays]

Each level is filmed from above for 1.6 s at 10 frames per second, as `run --export walk.mp4 --no-overlays` does, and
the film is observed as `learn` does.  Each cell shows simulated / observed.  Only walking animals are counted in the
simulation.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
sys.path[:0] = [str(ROOT), str(ROOT / "tests")]

from own_film import film, seen  # noqa: E402

from flockbrush.film.observations import CannotObserve  # noqa: E402
from flockbrush.runs.run import shipped_levels  # noqa: E402


def main():
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("levels", nargs="*", metavar="LEVEL")
    parser.add_argument("--overlays", action="store_true", help="film with text, guides and trails")
    args = parser.parse_args()
    print("| level | body, px | polarization | speed, m/s | animals | length, m | note |")
    print("|---|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        for level in args.levels or shipped_levels():
            print(_row(level, Path(folder) / f"{level}.mp4", args.overlays), flush=True)


def _row(level, path, overlays):
    was, scale = film(level, path, overlays=overlays)
    begin = f"| {level} | {was.length * scale:.1f} |"
    try:
        now, told = seen(path, scale)
    except CannotObserve as error:
        return (
            f"{begin} {was.polarization:.2f} | {was.speed:.2f} | {was.count:.0f} | {was.length:.2f} | {_said(error)} |"
        )
    pairs = zip(was, now, (".2f", ".2f", ".0f", ".2f"), strict=True)
    cells = " | ".join(f"{a:{form}} / {b:{form}}" for a, b, form in pairs)
    warnings = "too ", "only", "unreliable", "never moves", "several species"
    said = "; ".join(note.split(":")[0] for note in told.notes if any(word in note for word in warnings))
    return f"{begin} {cells} | {said} |"


def _said(error):
    return error.problems[0].message.split(":")[0]


if __name__ == "__main__":
    main()

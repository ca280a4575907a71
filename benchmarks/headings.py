"""Errors of positions and headings that `flockbrush fields` finds in films of dense herds.

    python benchmarks/headings.py [--looks sheep fish ...] [--lengths 11 20]

Two herds of 60 animals (``benchmarks/foreign_herds.py``: a band, in which bodies overlap, and a school) are filmed for
2 s from a camera that drifts, turns and zooms, with each look of ``benchmarks/herd_film.py``, and bodies of so many
pixels.  Errors are root mean squares and, of headings, also 1.48 times the median of their sizes, which a few heads
at the wrong end do not change.  ``lost``: share of the animals that no sight is near to.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
MODELS, LENGTHS, ANIMALS, SECONDS = ("band", "school"), (11.0, 20.0), 60, 2.0
NEAR = 0.4  # BL: a sight that is farther from all animals is of none


def film_of(model, look, length, folder, seed=4):
    """A film of a herd in which a body is so many pixels long."""
    from benchmarks.foreign_herds import herd
    from benchmarks.herd_film import CameraDrift, shoot

    truth = herd(model, ANIMALS, SECONDS, seed=seed)
    extent = float(np.ptp(truth.xy - truth.xy.mean(1, keepdims=True), axis=(0, 1)).max()) + 6.0
    side = int(np.ceil(extent * length / 16) * 16)
    return shoot(truth, Path(folder) / "clip.mp4", (side, side), length, CameraDrift(follow=1.0), look, seed=5)


def errors_of(film, seen):
    """{what: figure} of the sightings of a film, in body lengths and radians."""
    truth, sights = film.seen_from(0, seen.clip_body_px), seen.sightings
    turned, away, found = [], [], []
    for t in range(len(sights)):
        rows, at = sights.of(t), truth.xy[t]
        xy = sights.xy[rows] + at.mean(0) - sights.xy[rows].mean(0)  # the corner of the picture is not known
        for _ in range(5):
            far, nearest = cKDTree(at).query(xy)
            xy = xy - np.median(xy - at[nearest], axis=0)
        near = far < NEAR
        angle, true = (np.arctan2(v[:, 1], v[:, 0]) for v in (sights.forward[rows], truth.forward[t][nearest]))
        turned.append(((angle - true + np.pi) % (2 * np.pi) - np.pi)[near])
        away.append((xy - at[nearest])[near])
        found.append(len(np.unique(nearest[near])))
    turned, away = np.concatenate(turned), np.concatenate(away)
    return {
        "heading": float(np.sqrt(np.mean(turned**2))), "usual": float(1.4826 * np.median(np.abs(turned))),
        "position": float(np.sqrt(np.mean(away**2))), "lost": 1.0 - float(np.mean(found)) / ANIMALS,
    }  # fmt: skip


def main():
    """Print a line for each film."""
    from benchmarks.herd_film import LOOKS
    from flockbrush.film.observe import observe

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--looks", nargs="+", choices=sorted(LOOKS), default=list(LOOKS))
    parser.add_argument("--lengths", nargs="+", type=float, default=list(LENGTHS), help="of a body, px")
    options = parser.parse_args()
    print("herd | look | body, px | heading, rad | usual heading, rad | position, BL | lost")
    rows = []
    for model in MODELS:
        for look in options.looks:
            for length in options.lengths:
                with tempfile.TemporaryDirectory() as folder:
                    film = film_of(model, look, length, folder)
                    rows.append(errors_of(film, observe(film.path)))
                cells = [f"{value:.3f}" for value in rows[-1].values()]
                print(" | ".join([model, look, f"{length:g}", *cells]), flush=True)
    print("median | | | " + " | ".join(f"{np.median([row[name] for row in rows]):.3f}" for name in rows[0]))


if __name__ == "__main__":
    main()

"""Draw the picture of a learned brush: ``python -m docs.learning_pictures``.  It takes some minutes.

A mill of another model (D'Orsogna et al. 2006) is filmed by a camera that drifts and turns.  The picture is taken from
the report and shows held-out frames.
"""

import subprocess
import sys
import tempfile
from pathlib import Path

import cv2
import numpy as np

from benchmarks.foreign_herds import herd
from benchmarks.herd_film import CameraDrift, shoot
from flockbrush.render import write_png

HERE = Path(__file__).parent
MOMENTS = 2, 4


def moments(folder):
    """Return film and simulation side by side at two moments, stacked."""
    film = shoot(herd("mill", 90, 5.0, seed=4), folder / "mill.mp4", (720, 560), 12, CameraDrift(), seed=4)
    command = [sys.executable, "-m", "flockbrush", "learn", str(film.path), "--out", str(folder / "mill.brush.toml")]
    subprocess.run([*command, "--report", str(folder / "report")], check=True)
    rows = [cv2.imread(str(folder / "report" / f"moment-{k}.png"))[:, :, ::-1] for k in MOMENTS]
    wide = min(row.shape[1] for row in rows)
    gap = np.full((12, wide, 3), 255, np.uint8)
    return np.ascontiguousarray(np.vstack([rows[0][:, :wide], gap, rows[1][:, :wide]]))


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as temporary:
        write_png(HERE / "learning.png", moments(Path(temporary)))

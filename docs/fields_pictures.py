"""Draw the picture of the fields of a film: ``python -m docs.fields_pictures``.  No screen is needed."""

import tempfile
from pathlib import Path

import numpy as np

from benchmarks.foreign_herds import herd
from benchmarks.herd_film import CameraDrift, shoot
from flockbrush.cli.field_commands import drawing
from flockbrush.film.observe import observe
from flockbrush.render import write_png

HERE = Path(__file__).parent
FRAME = 12


def main():
    """Draw the `fields` preview of a mill (D'Orsogna et al.) under a camera that drifts, turns and zooms."""
    shown = {}

    def show(glance, watch, fields):
        if glance.k == FRAME:
            shown["picture"] = drawing(glance, watch, fields)

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "mill.mp4"
        camera = CameraDrift(drift=(1.0, 0.6), turn=0.1, zoom=0.05)
        shoot(herd("mill", count=70, seconds=1.0, fps=25, seed=5), path, (640, 420), 17.0, camera, seed=6)
        observe(path, show=show)
    write_png(HERE / "fields.png", np.ascontiguousarray(shown["picture"][..., ::-1]))


if __name__ == "__main__":
    main()

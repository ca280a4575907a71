"""Flockbrush: paint how a herd behaves, and watch it walk.

What a library user needs, loaded when first asked for::

    import flockbrush

    simulation = flockbrush.start("meadow")
    simulation.run(320)
    simulation.measures()["polarization"]
"""

from __future__ import annotations

import importlib
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING

from flockbrush.engine import kernel_cache

if TYPE_CHECKING:  # what type checkers and editors see; at run time __getattr__ loads it
    from flockbrush.behaviours.brush import Brush, BrushLibrary, load_brush, save_brush, shipped
    from flockbrush.engine.problems import ProblemsError
    from flockbrush.engine.recording import RecordingError, open_recording
    from flockbrush.learning.api import LearnedBrush, learn
    from flockbrush.levels.build import Simulation, build, plane
    from flockbrush.levels.reader import read_level
    from flockbrush.runs.run import rebuild, record, start

BEGAN = time.perf_counter()  # as near to the start of the program as we get
__version__ = "0.1.0"

_HOMES = {
    "read_level": "flockbrush.levels.reader",
    "build": "flockbrush.levels.build",
    "plane": "flockbrush.levels.build",
    "Simulation": "flockbrush.levels.build",
    "Brush": "flockbrush.behaviours.brush",
    "BrushLibrary": "flockbrush.behaviours.brush",
    "load_brush": "flockbrush.behaviours.brush",
    "save_brush": "flockbrush.behaviours.brush",
    "shipped": "flockbrush.behaviours.brush",
    "ProblemsError": "flockbrush.engine.problems",
    "open_recording": "flockbrush.engine.recording",
    "RecordingError": "flockbrush.engine.recording",
    "start": "flockbrush.runs.run",
    "rebuild": "flockbrush.runs.run",
    "record": "flockbrush.runs.run",
    "learn": "flockbrush.learning.api",
    "LearnedBrush": "flockbrush.learning.api",
}
__all__ = [
    "__version__",
    "Brush",
    "BrushLibrary",
    "LearnedBrush",
    "ProblemsError",
    "RecordingError",
    "Simulation",
    "build",
    "learn",
    "load_brush",
    "open_recording",
    "plane",
    "read_level",
    "rebuild",
    "record",
    "save_brush",
    "shipped",
    "start",
]


def __getattr__(name):
    if name not in _HOMES:
        raise AttributeError(f"flockbrush has no {name!r}; it has {', '.join(sorted(_HOMES))}")
    found = getattr(importlib.import_module(_HOMES[name]), name)
    if name == "open_recording":
        importlib.import_module("flockbrush.output.recording_tables")
    if "IPython" in sys.modules:  # in a notebook, worlds and recordings show themselves as pages
        importlib.import_module("flockbrush.output.notebook")
    return found


def __dir__():
    return sorted({*globals(), *_HOMES})


KERNEL_CACHE = kernel_cache.prepare(Path(__file__).parents[1], __version__)  # what a person should know of it

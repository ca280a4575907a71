"""Flockbrush: paint how a herd behaves, and watch it walk.

What a library user needs, loaded when first asked for::

    import flockbrush

    simulation = flockbrush.build(flockbrush.read_level("meadow.tmj"))
    simulation.run(320)
    simulation.measures()["polarization"]
"""

from __future__ import annotations

import importlib
import time

BEGAN = time.perf_counter()  # as near to the start of the program as we get
__version__ = "0.1.0"

_HOMES = {
    "read_level": "levels.reader",
    "build": "levels.build",
    "plane": "levels.build",
    "Simulation": "levels.build",
    "Brush": "behaviours.brush",
    "BrushLibrary": "behaviours.brush",
    "load_brush": "behaviours.brush",
    "save_brush": "behaviours.brush",
    "shipped": "behaviours.brush",
    "ProblemsError": "behaviours.problems",
    "open_recording": "engine.recording",
    "RecordingError": "engine.recording",
    "rebuild": "flockbrush.run",
    "record": "flockbrush.run",
}
__all__ = ["__version__", *_HOMES]


def __getattr__(name):
    if name not in _HOMES:
        raise AttributeError(f"flockbrush has no {name!r}; it has {', '.join(sorted(_HOMES))}")
    return getattr(importlib.import_module(_HOMES[name]), name)


def __dir__():
    return sorted({*globals(), *_HOMES})

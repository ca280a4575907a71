"""Display of simulations and recordings in notebooks: the page of the run, or a picture if the page is too large.

Importing this file gives `Simulation` and `RecordedRun` their ``_repr_html_``; `flockbrush` does so in a notebook.
"""

from __future__ import annotations

import base64
import html
import shlex
import tempfile
import warnings
from pathlib import Path

from flockbrush.engine.recording import RecordedRun
from flockbrush.levels.build import Simulation
from flockbrush.output.export import exported
from flockbrush.runs.run import rebuild, source_of, unlike_recorded

HIGH = 560  # pixels of the frame in the notebook
MOST = 200_000  # animals times frames: a longer run is shown as a still picture
FPS = 8.0


def simulation_html(simulation) -> str:
    """A frame with the page of this moment of a simulation."""
    return _frame(_exported(simulation, "now.html", FPS))


def recording_html(run) -> str:
    """A frame with the page of a recording; a picture of its end and how to write the page where that is too large."""
    simulation = rebuild(run)
    seconds = run.last_tick * simulation.clock.dt
    small = len(simulation.agents) * seconds * FPS <= MOST
    name = "run.html" if small else "run.png"
    data = _exported(simulation, name, FPS if small else 0.5, run.last_tick, source=source_of(run.path))
    if unlike := unlike_recorded(run, simulation):
        warnings.warn(unlike, stacklevel=2)
    if small:
        return _frame(data)
    picture = base64.b64encode(data).decode()
    command = html.escape(shlex.join(["flockbrush", "export", str(run.path), "--to", "run.html"]))
    return (
        f'<img style="max-width:100%" alt="the last frame" src="data:image/png;base64,{picture}">'
        f"<p>{len(simulation.agents):,} animals, {seconds:g} s: too large to show here. "
        f"<code>{command}</code> writes it as a page.</p>"
    )


def _exported(simulation, name, fps, last_tick=0, **options) -> bytes:
    """The bytes of an export of a simulation up to a tick."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / name
        exported(simulation, path, fps, last_tick, **options)
        return path.read_bytes()


def _frame(page: bytes) -> str:
    source = html.escape(page.decode(), quote=True)
    return f'<iframe style="width:100%;height:{HIGH}px;border:0" sandbox="allow-scripts" srcdoc="{source}"></iframe>'


Simulation._repr_html_ = simulation_html  # type: ignore[attr-defined]
RecordedRun._repr_html_ = recording_html  # type: ignore[attr-defined]

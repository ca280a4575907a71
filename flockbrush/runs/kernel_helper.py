"""The helper process that compiles kernels for another process; started by `flockbrush.runs.compile_ahead`.

Nothing that imports numba may be imported before a task begins: a scout sets what numba reads when it is imported.
"""

from __future__ import annotations

import importlib
import os
import signal
import sys

FEW = 24  # animals; Python runs their kernels
RECORDING = ".flock"
TICKS = 2  # some kernels are first called when there is a tick before


def scout(parent, rehearsal, work):
    """Send the calls of kernels in a rehearsal (``module:function``) of the work."""
    _be_quiet()
    if "numba" in sys.modules:  # by a main program that imports it first of all: kernels would be compiled
        return
    os.environ |= {"NUMBA_DISABLE_JIT": "1", "FLOCKBRUSH_THREADS": "1"}
    from flockbrush.engine.kernel_calls import watch

    watch(parent.send)
    module, name = rehearsal.split(":")
    getattr(importlib.import_module(module), name)(**work)


def rehearse(**work):
    """The beginning of a run, with few animals."""
    from flockbrush.engine.recording import state_hash

    simulation = _begun(work)
    simulation.run(TICKS)
    simulation.measures()
    simulation.parts()
    state_hash(simulation.world)


def _begun(work):
    """The world of a level, or of a recording, with as many animals as it has if they are few."""
    from flockbrush.engine.recording_reader import open_recording
    from flockbrush.runs import run

    if work["name"].endswith(RECORDING):
        level, library = run.embedded_level(open_recording(work["name"]))
        return run.begin(level, library, agents=_few(level, None))
    return run.start(**work | {"agents": _few(run.open_level(work["name"])[0], work["agents"])})


def _few(level, agents):
    return agents if (agents or level.agents) <= FEW else FEW


def compile_calls(parent):
    """Compile each requested kernel until there are no more requests."""
    _be_quiet()
    import flockbrush.runs.run  # noqa: F401  most kernels

    while True:
        parent.send(None)
        call = parent.recv()
        if call is None:
            return
        call.compile()


def _be_quiet():
    """Leave Ctrl-C and the terminal to the parent, which ends its helpers."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    nowhere = os.open(os.devnull, os.O_WRONLY)
    for stream in (1, 2):
        os.dup2(nowhere, stream)

"""Jobs whose workers die, for the tests of sweeps: spawned processes import them from here."""

import os
import signal
from dataclasses import dataclass, replace
from pathlib import Path

from flockbrush.studies.sweep_file import Scenario

SCENARIO = Scenario("0" * 16, {}, {}, {}, ("twice",))


def double(seeds, deadly, note):
    """Twice each seed; at the deadly one the process is killed, once only if there is a note to leave."""
    for seed in seeds:
        if seed == deadly and not (note and Path(note).exists()):
            if note:
                Path(note).touch()
            os.kill(os.getpid(), signal.SIGKILL)
    return [(seed, {"twice": 2 * seed}, None, 0.0) for seed in seeds]


@dataclass(frozen=True)
class Doubling:
    """A job of `flockbrush.studies.sweep` that needs no experiment."""

    seeds: tuple
    deadly: int = -1
    note: str = ""
    deaths: int = 0

    def submit(self, executor):
        return executor.submit(double, self.seeds, self.deadly, self.note)

    def rows(self, entries):
        for seed, values, error, _ in entries:
            yield {"scenario": SCENARIO.hash, "seed": seed, "status": "failed" if error else "ok", "error": error} | (
                values or {}
            )


def doublings(count, batch, **more):
    seeds = range(count)
    return [Doubling(tuple(seeds[k : k + batch]), **more) for k in range(0, count, batch)]


__all__ = ["SCENARIO", "Doubling", "doublings", "replace"]

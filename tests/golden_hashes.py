"""Remake the golden hashes: ``python tests/golden_hashes.py``; then add a line marked **herd** to the CHANGELOG."""

import json
from pathlib import Path

from flockbrush.engine.recording import state_hash

from flockbrush.runs.run import shipped_levels, start

FILE = Path(__file__).with_suffix(".json")
TICKS = 320  # ten seconds


def hash_of(level):
    """The state hash of a shipped level after ten seconds with its own seed."""
    simulation = start(level)
    simulation.run(TICKS)
    return state_hash(simulation.world)


if __name__ == "__main__":
    hashes = {level: hash_of(level) for level in shipped_levels()}
    old = json.loads(FILE.read_text()) if FILE.exists() else {}
    FILE.write_text(json.dumps(hashes, indent=2) + "\n")
    print("changed:", ", ".join(name for name in hashes if hashes[name] != old.get(name)) or "none")

"""Brushes like those that `flockbrush learn` makes, of kinds that none of the shipped ones is.

Their speeds are those of `march`: ``benchmarks/learning_halves.json`` does not store the learned ones.
"""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path

from flockbrush.behaviours.brush import SUFFIX, BodySpec, VisionSpec, brush_to_toml, shipped

from flockbrush.learning.likelihood import likelihoods

HALVES = Path(__file__).with_name("learning_halves.json")
# brushes, and the clips that they were learned from
LEARNED = {"school": "school, seed 23", "torus": "torus, seed 23", "mill": "mill", "flurry": "swarm, seed 23"}


@cache
def learned():
    """Return {file: content} of march with topological sight, and of what was learned from clips."""
    march, rows = shipped().get("march"), json.loads(HALVES.read_text())
    made = [march.model_copy(update={"name": "topological", "vision": VisionSpec(range=8.0, sight="topological")})]
    for name, clip in LEARNED.items():
        row = rows[clip]
        kind = likelihoods()[row["kind"]]
        own = {"model": kind.model, "params": kind.behaviour.Params(**row["params"]), "body": BodySpec(**row["body"])}
        made.append(march.model_copy(update={"name": name, "vision": VisionSpec(**row["vision"])} | own))
    return {brush.name + SUFFIX: brush_to_toml(brush).encode() for brush in made}

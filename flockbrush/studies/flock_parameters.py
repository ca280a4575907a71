"""What a study of flocks by V rules may change."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from flockbrush.behaviours.behaviour import quantity
from flockbrush.behaviours.v_rules.flights import SIDE
from flockbrush.behaviours.v_rules.rules import VRuleSettings


class FlockParameters(VRuleSettings):
    """The rules, and how a flock begins and how long it flies."""

    birds: int = Field(15, ge=1, le=1000, description="number of birds (n)")
    steps: int = Field(2000, ge=0, le=10_000_000, description="maximum number of time steps (T)")
    side: float = quantity(SIDE, "wingspans", "side of the square in which the birds start", 0.1, 10_000)
    start: Literal["apart", "anywhere"] = Field(
        "apart", description="whether birds that overlap at the start are placed again"
    )
    every: int = Field(0, ge=0, description="time steps between samples; if given, lasting formations are measured too")

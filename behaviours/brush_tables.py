"""The tables of a brush file: speed, vision, and where the numbers come from."""

from __future__ import annotations

import datetime
import itertools
import math
from typing import Annotated, Literal, get_args

from flockbrush.behaviours.spec import Finite, Line, Spec, Text, spec_field
from pydantic import Field, model_validator


class SpeedSpec(Spec):
    """How fast the animals go: an Ornstein-Uhlenbeck process (Gong et al. 2025, eq. 6).

    In body lengths (BL), so that a brush fits animals of all sizes.
    """

    mean: float = spec_field(..., "the mean speed", "BL/s", ge=0, le=100)
    deviation: float = spec_field(
        0.0,
        "noise of the speed (v_sigma of eq. 6); speeds spread by deviation / sqrt(2 reversion)",
        "BL/s",
        ge=0,
        le=50,
    )
    reversion: float = spec_field(1.0, "rate at which speeds return to the mean (theta of eq. 6)", "1/s", gt=0, le=100)
    individual: float = spec_field(
        0.0, "how much animals differ for life: standard deviation of their usual speeds, as a share of the mean",
        ge=0, le=1,
    )  # fmt: skip
    common: float = spec_field(
        0.0, "what the animals of a neighbourhood do together: standard deviation of the usual speed in time", "BL/s",
        ge=0, le=50,
    )  # fmt: skip
    common_time: float = spec_field(
        3.0, "time for which a herd keeps being faster or slower than usual", "s", ge=0.1, le=1000
    )
    stops: float = spec_field(0.0, "rate at which a walking animal stops; 0: never", "1/s", ge=0, le=20)
    starts: float = spec_field(0.0, "rate at which a standing animal starts to walk", "1/s", ge=0, le=20)
    imitation: float = spec_field(
        0.0, "gain of both rates for neighbours within 4 body lengths that already do the same (Ginelli et al. 2015)",
        ge=0, le=100,
    )  # fmt: skip
    by_density: tuple[tuple[Annotated[Finite, Field(ge=0, le=100)], Annotated[Finite, Field(ge=0, le=10)]], ...] = (
        spec_field((), "pairs of density (animals per BL²) and speed factor, interpolated linearly", max_length=64)
    )

    @property
    def own_spread(self) -> float:
        """Standard deviation of the speeds of one animal in time, without what the herd does, BL/s."""
        return self.deviation / math.sqrt(2 * self.reversion)

    @property
    def spread(self) -> float:
        """Standard deviation of the speeds of a herd at all times, BL/s: own, between animals, and in common."""
        return math.sqrt(self.own_spread**2 + (self.individual * self.mean) ** 2 + self.common**2)

    @model_validator(mode="after")
    def _densities_rise(self):
        densities = [density for density, _ in self.by_density]
        if any(after <= before for before, after in itertools.pairwise(densities)):
            raise ValueError("the densities of by_density must rise from pair to pair")
        return self


Sight = Literal["exact", "metric", "hidden_points", "topological", "voronoi"]
SIGHTS = get_args(Sight)


class VisionSpec(Spec):
    """What the animals see."""

    range: float = spec_field(4.0, "distance to which animals see", "BL", gt=0, le=1000)
    field_of_view: float = spec_field(360.0, "full angle of view, centred ahead", "degrees", gt=0, le=360)
    occlusion: bool = spec_field(True, "whether nearer bodies and obstacles hide the animals behind them")
    sight: Sight = spec_field(
        "exact", "which animals in view count; metric: bodies hide no animal; hidden_points: those left "
        "by hidden-point removal; topological: the nearest; voronoi: the first shell"
    )  # fmt: skip
    neighbours: int = spec_field(
        7, "number of nearest animals that count in topological sight", "animals", ge=1, le=1000
    )


class Provenance(Spec):
    """Where the numbers come from, what is known of them and what is not."""

    kind: Literal["published", "hand-set", "searched", "learned"] = spec_field(..., "how the numbers were found")
    source: Line = spec_field(..., "the paper, clip or map of parameters", min_length=1)
    date: datetime.date = spec_field(..., "when the brush was made")
    by: Line = spec_field(..., "the person or tool that made it", min_length=1)
    notes: Text = spec_field("", "how the numbers were found, and what is not known")
    seed: int | None = spec_field(None, "seed of the search or the learning", ge=0, le=2**63 - 1)
    clip: Line | None = spec_field(None, "clip that the brush was learned from")
    frames: tuple[int, int] | None = spec_field(None, "first and last frame that the brush was learned from")
    clip_sha256: Annotated[str, Field(pattern="^[0-9a-f]{64}$")] | None = spec_field(
        None, "SHA-256 of the clip", examples=["64 of 0-9 and a-f"]
    )
    licence: Line | None = spec_field(None, "licence of the clip or the numbers")
    versions: dict[Line, Line] = spec_field({}, "versions of the tools", max_length=100)
    report: dict[Line, Finite] = spec_field({}, "measured figures: losses, held-out errors, bands", max_length=1000)

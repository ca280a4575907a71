"""What every animal has, as columns, and the few things that stand in the landscape, as dataclasses."""

from components.agent import (
    AGENT,
    Body,
    BrushBinding,
    Destination,
    Ground,
    Heading,
    Memory,
    Position,
    ReferenceBird,
    Role,
    Species,
    Speed,
    Velocity,
    Vision,
    Wish,
)

__all__ = [
    "AGENT",
    "Body",
    "BrushBinding",
    "Destination",
    "Ground",
    "Heading",
    "Memory",
    "Position",
    "ReferenceBird",
    "Role",
    "Species",
    "Speed",
    "Velocity",
    "Vision",
    "Wish",
]

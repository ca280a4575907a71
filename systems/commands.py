"""Everything that may be done to a running world from outside: mouse, level script, tests and replay submit these."""

from __future__ import annotations

from flockbrush.engine.clock import Clock
from flockbrush.engine.columns import Component
from flockbrush.engine.commands import Commands, command
from flockbrush.engine.noise import Noise
from flockbrush.engine.problems import ProblemsError
from flockbrush.engine.schedule import Stage, System
from flockbrush.systems.animal_commands import AddAnimals, Migrate, RemoveAnimals, SendTo, SwitchBrush
from flockbrush.systems.edits import MoveGoal
from flockbrush.systems.fauna import SpeciesList
from flockbrush.systems.landscape import Landscape
from flockbrush.systems.obstacle_commands import AddObstacle, MoveObstacle, RemoveObstacle, StandObstacle, advance
from flockbrush.systems.paint_commands import PaintBrush, PaintCap, PaintCells
from flockbrush.systems.palette import Palette
from flockbrush.systems.programs import Programs
from flockbrush.systems.undo import TouchedBrushes

__all__ = [
    "AddAnimals", "AddObstacle", "ApplyCommands", "Migrate", "MoveGoal", "MoveObstacle", "PaintBrush", "PaintCap",
    "PaintCells", "RemoveAnimals", "RemoveObstacle", "SendTo", "SetParameter", "StandObstacle", "SwitchBrush",
]  # fmt: skip


class ApplyCommands(System):
    """Apply what is due."""

    stage, reads = Stage.COMMANDS, (Clock, Noise)
    writes = (Commands, Landscape, Palette, Programs, SpeciesList, Component)

    def process(self, world):
        world.resource(Commands).apply(world, world.resource(Landscape).marks.keys if world.has(Landscape) else [])
        if world.has(Landscape):
            land, clock = world.resource(Landscape), world.resource(Clock)
            for glide in list(land.glides):
                advance(world, land, glide, clock)
            land.settle(clock.tick)


@command
class SetParameter:
    """Change one number of a brush in the running world, such as ``cohesion_weight``."""

    brush: str
    name: str
    value: float

    def check(self, world):
        self.changed(world.resource(Palette))

    def changed(self, palette):
        """The brush with the number changed; ValueError when it has none of that name or it is out of bounds."""
        brush = palette.brushes[palette.named(self.brush)]
        try:
            return brush.with_parameters(**{self.name: self.value})
        except ProblemsError as error:
            raise ValueError(str(error)) from None

    def touches(self, world):
        return [TouchedBrushes()]

    def apply(self, world):
        palette = world.resource(Palette)
        palette.add(self.changed(palette))

"""The tools of the playground, in the order of their buttons.  A new one is a class in here, and its name below."""

from flockbrush.play.tools.animals import AddAnimals, Predator, RemoveAnimals, Select
from flockbrush.play.tools.paint import Erase, Fill, PaintBrush, PaintCap, PaintSurface, Pick
from flockbrush.play.tools.things import Exit, Goal, Guide, Obstacle, SpawnArea
from flockbrush.play.tools.tool import Tool

TOOLS: tuple[type[Tool], ...] = (
    PaintBrush, PaintCap, PaintSurface, Fill, Erase,
    Pick, Obstacle, Guide, Goal, Exit,
    SpawnArea, AddAnimals, RemoveAnimals, Predator, Select,
)  # fmt: skip

__all__ = ["TOOLS", "Tool"]

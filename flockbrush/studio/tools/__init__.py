"""The tools of the playground, in the order of their buttons.  A new one is a class in here, and its name below."""

from flockbrush.studio.tools.animal_tools import AddAnimalsTool, Predator, RemoveAnimalsTool, Select
from flockbrush.studio.tools.edit_recorded import EditRecorded
from flockbrush.studio.tools.lead import Lead
from flockbrush.studio.tools.mark_tools import KeyTool, LineTool, MeasuredAreaTool, ZoneTool
from flockbrush.studio.tools.paint import Erase, Fill, PaintBrushTool, PaintCapTool, PaintSurface, Pick
from flockbrush.studio.tools.things import ExitTool, GoalTool, GuideTool, ObstacleTool, SpawnAreaTool
from flockbrush.studio.tools.tool import Tool

TOOLS: tuple[type[Tool], ...] = (
    PaintBrushTool, PaintCapTool, PaintSurface, Fill, Erase,
    Pick, ObstacleTool, GuideTool, GoalTool, ExitTool,
    SpawnAreaTool, ZoneTool, LineTool, MeasuredAreaTool, KeyTool,
    AddAnimalsTool, RemoveAnimalsTool, Predator, Select, Lead,
)  # fmt: skip

OF_RECORDINGS: tuple[type[Tool], ...] = (EditRecorded,)  # offered where a recording is open


def offered(session) -> tuple[type[Tool], ...]:
    """The tools for what is open."""
    return TOOLS if session.edits is None else TOOLS + OF_RECORDINGS


__all__ = ["OF_RECORDINGS", "TOOLS", "Tool", "offered"]

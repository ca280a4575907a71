"""Tools for things that block no animal: zones, counting lines, measured areas, keys of the script."""

from __future__ import annotations

from flockbrush.studio.tools.things import OutlineTool, PathTool
from flockbrush.studio.tools.tool import Tool
from flockbrush.studio.tools.world_tools import things
from flockbrush.systems.mark_commands import DrawArea, DrawLine, DrawZone


class ZoneTool(OutlineTool):
    """Draws zones, whose brush animals take up while they are inside."""

    name, title, key, icon = "zone", "Zone", "u", "zone"
    tip = "Draw a zone in which animals follow the selected brush; P adds a speed limit or an event"
    hint, label, palette = "Drag to draw a zone with the selected brush.", "draw a zone", "brush"

    def command(self, name, points):
        return DrawZone(self.app.new_id(), name, points, self.app.brush)


class LineTool(PathTool):
    """Draws lines whose crossings are counted."""

    name, title, key, icon, spoken, makes = "line", "Counting line", "y", "line", "a counting line", DrawLine
    tip = "Draw a line that counts the animals that cross it; drag its points to reshape it"
    hint = "Drag to draw a line that counts crossings. Drag its points to reshape it."


class MeasuredAreaTool(OutlineTool):
    """Draws areas in which animals are counted."""

    name, title, key, icon, ink = "area", "Measured area", "m", "area", "muted"
    tip = "Draw an area in which animals are counted; programs can use it too"
    hint, label = "Drag to draw an area in which animals are counted.", "draw a measured area"

    def command(self, name, points):
        return DrawArea(self.app.new_id(), name, points)


class KeyTool(Tool):
    """Puts timed commands into the level's script, and opens those there are."""

    name, title, key, icon = "key", "Script key", "j", "key"
    tip = "Add a timed command to the script of the level; it runs at its time if that is in the future"
    hint = "Click where the command should act; click a key to change it. Ctrl+R restarts the level with it."

    def press(self, xy, button, mods):
        if button != 1 or self.app.is_off_map(xy, xy, 0.0):
            return
        hits = self.app.things_at([xy], self.reach(), kinds=("key",))
        self.app.ask_key(xy, hits[0][1] if hits else None)

    def cursor(self, surface, camera):
        keys = [thing.xy for kind, thing in things(self.app.session.simulation) if kind == "key"]
        self.dots(surface, camera, keys, self.app.theme.ink)

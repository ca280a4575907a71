"""Lead: takes an animal by the hand, with the mouse or with keys, while the others follow it by what they see."""

from __future__ import annotations

import itertools

import numpy as np

from flockbrush.components import Leading, Position
from flockbrush.studio.tools.tool import Tool
from flockbrush.systems.leaders import Appoint, Steer

_holds = itertools.count(1)
WAYS = {
    "w": (0, 1), "up": (0, 1), "s": (0, -1), "down": (0, -1),
    "a": (-1, 0), "left": (-1, 0), "d": (1, 0), "right": (1, 0),
}  # fmt: skip
STEP = 8.0  # pixels that the mouse goes for the next command


class Lead(Tool):
    """Steers one animal, which becomes a leader; one hold, from press to release, is one step of undo."""

    name, title, key, icon = "lead", "Lead", "l", "lead"
    tip = "Lead an animal: click it, then hold the button where it should go, or steer with WASD or the arrow keys"
    hint = "Click an animal to lead it; then hold the button where it should go, or use WASD or arrows."

    def __init__(self, app):
        super().__init__(app)
        self.held: set[str] = set()  # keys
        self.place: tuple[float, float] | None = None  # m, where the mouse last sent it
        self._way: tuple[float, float] | None = None  # east and north, what the keys last said
        self._join = ""

    # mouse -------------------------------------------------------------------------

    def press(self, xy, button, mods):
        if button != 1:
            return
        animal = self.app.animal_at(xy, self.reach(9))
        if animal is not None:
            self._free()
            self.app.select(animal)
        elif self._is_there():
            self._send_to(xy)

    def drag(self, xy):
        if self.place is not None and not self._is_there():  # it has left the world
            self._free()
        start = self.place or self._position()
        if start is not None and np.hypot(xy[0] - start[0], xy[1] - start[1]) >= self.reach(STEP):
            self._send_to(xy)

    def release(self, xy):
        if self.place is not None and not self.held:
            self._free()

    # keys --------------------------------------------------------------------------

    def hear(self, key, down) -> bool:
        if key not in WAYS:
            return False
        if self._position() is None:  # arrows move the view then; a letter must not take another tool
            self.let_go()
            return down and len(key) == 1 and not self._is_there()
        (self.held.add if down else self.held.discard)(key)
        east, north = (sum(WAYS[one][axis] for one in self.held) for axis in (0, 1))
        size = float(np.hypot(east, north))
        way = (east / size, north / size) if size else None
        if way != self._way:
            if way is None:
                self._free()
            else:
                self._steer(*way, "direction")
                self._way, self.place = way, None
        return True

    def let_go(self):
        self.held.clear()
        self._free()

    def cancel(self) -> bool:
        going = self.place is not None or bool(self.held)
        self.let_go()
        return going

    # what is said to the world --------------------------------------------------------

    def _position(self):
        """m, where the animal is that is led; None without one."""
        agents, animal = self.app.session.simulation.agents, self.app.selected
        if animal is None or animal not in agents.ids:
            return None
        return tuple(agents[Position.xyz][agents.row(animal), :2].tolist())

    def _is_there(self):
        if self._position() is None:
            self.app.notify("no animal is led: click an animal first")
            return False
        return True

    def _send_to(self, xy):
        level = self.app.session.simulation.level
        self.place = min(max(xy[0], 0.0), level.width), min(max(xy[1], 0.0), level.height)
        self._steer(*self.place, "place")

    def _steer(self, x, y, kind):
        animal, agents = self.app.selected, self.app.session.simulation.agents
        if not self._join:
            self._join = f"{self.name} {next(_holds)}"
        commands = [] if agents[Leading.appointed][agents.row(animal)] else [Appoint([animal])]
        self.app.do("lead", [*commands, Steer([animal], float(x), float(y), kind)], self._join)

    def _free(self):
        """It follows its own mind again; it stays a leader."""
        going, self.place, self._way = self.place is not None or self._way is not None, None, None
        if going and self._position() is not None:
            self._steer(0.0, 0.0, "free")
        self._join = ""

    def cursor(self, surface, camera):
        position = self._position()
        if position is None:
            return
        ink = self.app.accent
        target = self.place
        if self._way is not None:
            far = self.reach(60)
            target = position[0] + far * self._way[0], position[1] + far * self._way[1]
        self.circle(surface, camera, position, self.reach(10), ink, max(1, round(2 * self.app.scale)))
        if target is not None:
            self.path(surface, camera, [position, target], ink)
            self.dots(surface, camera, [target], ink)

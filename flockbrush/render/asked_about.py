"""What overlays were told of an animal, asked once for each tick."""

from __future__ import annotations

from flockbrush.systems.explain import explain


class AskedAbout:
    """The explanation of an animal of a running world, asked once for each tick."""

    def __init__(self, simulation):
        # held: while a tick runs nobody looks at the world: what was told before it still holds
        self.simulation, self.held = simulation, False
        self._known: tuple = (None, None)

    def of(self, entity):
        """What `explain` says of an animal; None when it is not there, or was not asked about before a tick."""
        if self.held:
            return self._known[1] if self._known[0] and self._known[0][0] == entity else None
        key = (entity, self.simulation.clock.tick, id(self.simulation.world))
        if self._known[0] != key:
            try:
                self._known = (key, explain(self.simulation.world, entity))
            except KeyError:
                self._known = (key, None)
        return self._known[1]

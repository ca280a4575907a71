"""The explanation of the selected animal for overlays, computed once per tick."""

from __future__ import annotations

from flockbrush.systems.explain import explain


class ExplanationCache:
    """The explanation of an animal of a running world, computed once per tick."""

    def __init__(self, simulation):
        # held: a tick is running, so the world must not be read and the last explanation is kept
        self.simulation, self.held = simulation, False
        self._known: tuple = (None, None)

    def of(self, entity):
        """The `Explanation` of an animal; None if it does not exist, or was not known before the running tick."""
        if self.held:
            return self._known[1] if self._known[0] and self._known[0][0] == entity else None
        key = (entity, self.simulation.clock.tick, id(self.simulation.world))
        if self._known[0] != key:
            try:
                self._known = (key, explain(self.simulation.world, entity))
            except KeyError:
                self._known = (key, None)
        return self._known[1]

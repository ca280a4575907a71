"""A world: one esper context, its agents by column and its resources."""

from __future__ import annotations

import itertools

import esper

from engine.columns import Component, Table

_names = (f"world-{n}" for n in itertools.count(1))


class World:
    """esper's functions as methods, for a context of its own.

    Agents, that is entities with at least one column component, get every
    column of ``kinds``, so a row has no holes.  Entities without any, such as
    obstacles or goals, stay plain esper entities.

    Parameters
    ----------
    kinds : sequence of Component subclasses
        The columns that every agent of this world has.
    """

    def __init__(self, kinds=(), capacity=256):
        self.name = next(_names)
        self.agents = Table(kinds, capacity)
        self._resources: dict[type, object] = {}
        self._dying: set[int] = set()
        self._enter()

    def _enter(self):
        if esper.current_world != self.name:
            esper.switch_world(self.name)

    def close(self):
        """Forget the world and all that is in it."""
        esper.switch_world("default")
        esper.delete_world(self.name)

    # entities ---------------------------------------------------------------

    def create_entity(self, *components):
        """Create one entity; with any column component it becomes an agent with every column."""
        self._enter()
        if not any(isinstance(c, Component) for c in components):
            return esper.create_entity(*components)
        given = {type(c) for c in components}
        unknown = [k.__name__ for k in given if issubclass(k, Component) and k not in self.agents.kinds]
        if unknown:
            raise TypeError(f"{self.name} has no columns for {', '.join(unknown)}")
        components += tuple(kind() for kind in self.agents.kinds if kind not in given)
        entity = esper.create_entity(*components)
        self.agents.append([entity])
        for component in components:
            if isinstance(component, Component):
                _move_in(component, self.agents, entity)
        return entity

    def create_agents(self, count, values):
        """Create many agents at once.

        Parameters
        ----------
        count : int
        values : dict of Field to array_like
            ``count`` rows, or one value for all.

        Returns
        -------
        list of int
            The new entities, ascending.
        """
        self._enter()
        kinds, table = self.agents.kinds, self.agents
        entities = []
        for _ in range(count):
            handles = [kind.__new__(kind) for kind in kinds]
            entity = esper.create_entity(*handles)
            for handle in handles:
                handle._home, handle._entity = table, entity
            entities.append(entity)
        rows = table.append(entities)
        for field, value in values.items():
            table.arrays[field][rows] = value
        return entities

    def delete_entity(self, entity):
        """Mark an entity; it goes at the next `flush`."""
        self._enter()
        if not esper.entity_exists(entity):
            raise KeyError(f"no entity {entity} in {self.name}")
        esper.delete_entity(entity)
        self._dying.add(entity)

    def flush(self):
        """Make pending deletions real.

        The only moment at which rows move: an array taken before is another
        animal's afterwards.
        """
        if not self._dying:
            return
        self._enter()
        gone = {entity for entity in self._dying if entity in self.agents}
        self._dying = set()
        esper.clear_dead_entities()
        if gone:
            self.agents.remove(gone)

    def component_for_entity(self, entity, kind):
        """One component of one entity; for an agent, a window on its row."""
        self._enter()
        return esper.component_for_entity(entity, kind)

    def get_component(self, kind):
        """(entity, component) pairs in order of entity: for the few, never per tick for the many."""
        self._enter()
        return sorted(esper.get_component(kind), key=lambda pair: pair[0])

    def entity_exists(self, entity):
        self._enter()
        return esper.entity_exists(entity)

    # resources --------------------------------------------------------------

    def insert(self, resource):
        """Put one object of its type into the world, replacing the one there was."""
        self._resources[type(resource)] = resource
        return resource

    def has(self, kind):
        return kind in self._resources

    def resource(self, kind):
        """The object of this type; LookupError with what there is."""
        try:
            return self._resources[kind]
        except KeyError:
            have = ", ".join(k.__name__ for k in self._resources) or "none"
            raise LookupError(f"no {kind.__name__} in {self.name}; resources: {have}") from None


def _move_in(component, table, entity):
    values, row = component._home, table.row(entity)
    for field, value in values.items():
        table.arrays[field][row] = value
    component._home, component._entity = table, entity

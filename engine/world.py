"""A world: one esper context, its agents by column and its resources."""

from __future__ import annotations

import copy
import itertools
import threading
import weakref
from collections.abc import Callable, MutableMapping
from functools import wraps
from typing import Any, TypeVar, cast

import esper
import numpy as np
from flockbrush.engine.columns import Component, Table

T = TypeVar("T")
F = TypeVar("F", bound=Callable[..., Any])
_numbers = itertools.count(1)
_context = threading.RLock()  # esper keeps the context that it is in in module variables
_forgotten: list[str] = []  # contexts whose world is gone, but which esper was in at that moment


def in_its_context(method: F) -> F:
    """A method of a world during which esper is in that world's context, whatever other threads do with theirs."""

    @wraps(method)
    def alone(world, *args, **options):
        with _context:
            world._enter()
            return method(world, *args, **options)

    return cast(F, alone)


class Counter:
    """The entity ids of one world in order.  Unlike itertools.count it can say what comes next."""

    def __init__(self, first=1):
        self.next = first

    def __next__(self):
        value = self.next
        self.next += 1
        return value


class World:
    """esper's functions as methods, for a context of its own.

    Agents, that is entities with at least one column component, get every
    column of ``kinds``, so a row has no holes.  Entities without any, such as
    obstacles or goals, stay plain esper entities.

    One thread at a time may use a world; several threads may use one each.

    Parameters
    ----------
    kinds : sequence of Component subclasses
        The columns that every agent of this world has.
    """

    def __init__(self, kinds=(), capacity=256):
        self.agents = Table(kinds, capacity)
        self._resources: dict[type, object] = {}
        self._dying: set[int] = set()
        self._counter = Counter()
        self._open()

    def _open(self):
        """Get an esper context of its own, without entities."""
        self.name = f"world-{next(_numbers)}"
        self._agent_set: set[int] = set()  # esper asks which entities have a kind: the same ones for every column
        with _context:
            self._enter()
            esper._entity_count = self._counter  # type: ignore[assignment]
        weakref.finalize(self, _forget, self.name)

    def _enter(self):
        if esper.current_world != self.name:
            esper.switch_world(self.name)
            while _forgotten:
                esper._context_map.pop(_forgotten.pop(), None)

    def close(self):
        """Forget the world and all that is in it."""
        with _context:
            if esper.current_world == self.name:
                esper.switch_world("default")
            _forget(self.name)

    # copies -----------------------------------------------------------------

    @in_its_context
    def __getstate__(self):
        """What a copy or a pickle of it needs: all but esper's context."""
        kinds = set(self.agents.kinds)
        plain = {e: [own[kind] for kind in own if kind not in kinds] for e, own in esper._entities.items()}
        return {
            "agents": self.agents, "_resources": self._resources, "_dying": self._dying, "_counter": self._counter,
            "plain": {e: own for e, own in plain.items() if own or e not in self._agent_set},
        }  # fmt: skip

    def __setstate__(self, state):
        plain = state.pop("plain")
        self.__dict__.update(state)
        self._open()
        self._fill(plain)

    @in_its_context
    def _fill(self, plain):
        """Have the agents of the columns and these plain components, {entity: [component, ...]}."""
        for entity, own in plain.items():
            esper._entities[entity] = {}
            for component in own:
                esper.add_component(entity, component)
        self._register(self.agents.ids.tolist())
        for entity in self._dying:
            esper.delete_entity(entity)

    def __copy__(self):
        return copy.deepcopy(self)  # rows and resources belong to one world

    # entities ---------------------------------------------------------------

    @property
    def next_entity(self):
        """The id that the next birth will get."""
        return self._counter.next

    @in_its_context
    def create_entity(self, *components):
        """Create one entity; with any column component it becomes an agent with every column."""
        columns = [c for c in components if isinstance(c, Component)]
        unknown = [type(c).__name__ for c in columns if type(c) not in self.agents.kinds]
        if unknown:
            raise TypeError(f"{self.name} has no columns for {', '.join(unknown)}")
        in_columns = [c for c in columns if not isinstance(c._home, dict)]
        if in_columns:
            raise ValueError(f"this {type(in_columns[0]).__name__} belongs to agent {in_columns[0]._entity} already")
        entity = esper.create_entity(*(c for c in components if not isinstance(c, Component)))
        if columns:
            self.agents.append([entity])
            self._register([entity])
            for component in columns:
                _move_in(component, self.agents, entity)
                esper._entities[entity][type(component)] = component
        return entity

    @in_its_context
    def create_agents(self, count, values):
        """Create many agents at once.

        Parameters
        ----------
        count : int
        values : dict of Field to array_like
            ``count`` rows, or one value for all; the other columns get their defaults.

        Returns
        -------
        list of int
            The new entities, ascending.

        Raises
        ------
        KeyError, ValueError
            When a column is not of this world, or a value does not fit or is not finite.
            Nobody has been born then.
        """
        table = self.agents
        unknown = [repr(field) for field in values if field not in table.arrays]
        if unknown:
            raise KeyError(f"{self.name} has no column {', '.join(unknown)}")
        rows = {field: field.checked_rows(value, (count,)) for field, value in values.items()}
        entities = list(range(self._counter.next, self._counter.next + count))
        self._counter.next += count
        into = table.append(entities)
        for field, value in rows.items():
            table.arrays[field][into] = value
        self._register(entities)
        return entities

    def _register(self, entities):
        """Make esper know these agents; their windows are made when somebody asks."""
        table, database = self.agents, esper._entities
        for entity in entities:
            database[entity] = Windows(table, entity, database.get(entity))
        self._agent_set.update(entities)
        for kind in table.kinds:
            esper._components[kind] = self._agent_set
        esper.clear_cache()

    @in_its_context
    def delete_entity(self, entity):
        """Mark an entity; it goes at the next `flush`.  Marking it twice is once."""
        if entity in self._dying:
            return
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
        dead = self._dying & self._agent_set
        self._dying = set()
        self._clear_dead()
        self._agent_set -= dead
        if dead:
            self.agents.remove(dead)

    @in_its_context
    def _clear_dead(self):
        esper.clear_dead_entities()

    @in_its_context
    def component_for_entity(self, entity, kind: type[T]) -> T:
        """One component of one entity; for an agent, a window on its row."""
        try:
            return esper.component_for_entity(entity, kind)
        except KeyError:
            raise KeyError(self._missing(entity, kind)) from None

    def _missing(self, entity, kind):
        if not esper.entity_exists(entity):
            return f"no entity {entity} in {self.name}"
        have = ", ".join(k.__name__ for k in esper._entities[entity])
        return f"entity {entity} has no {kind.__name__}; it has {have or 'no components'}"

    @in_its_context
    def get_component(self, kind: type[T]) -> list[tuple[int, T]]:
        """(entity, component) pairs in order of entity: for the few, never per tick for the many."""
        return sorted(esper.get_component(kind), key=lambda pair: pair[0])

    @in_its_context
    def entity_exists(self, entity):
        """Whether an entity lives and is not marked for deletion."""
        return esper.entity_exists(entity)

    @in_its_context
    def plain_entities(self):
        """Ids of the entities that are no agents, ascending."""
        return sorted(set(esper._entities) - self._agent_set)

    @in_its_context
    def components_of(self, entity):
        """The components of an entity, by type."""
        return dict(esper._entities[entity])

    # resources --------------------------------------------------------------

    def insert(self, resource: T) -> T:
        """Put one object of its type into the world, replacing the one there was."""
        self._resources[type(resource)] = resource
        return resource

    def has(self, kind):
        """Whether there is a resource of this type."""
        return kind in self._resources

    def resource(self, kind: type[T]) -> T:
        """The object of this type; LookupError with what there is."""
        try:
            return self._resources[kind]  # type: ignore[return-value]
        except KeyError:
            have = ", ".join(k.__name__ for k in self._resources) or "none"
            raise LookupError(f"no {kind.__name__} in {self.name}; resources: {have}") from None

    def resources(self):
        """All resources in order of the name of their type."""
        return sorted(self._resources.values(), key=lambda r: (type(r).__name__, type(r).__module__))

    # snapshots --------------------------------------------------------------

    @in_its_context
    def become(self, ids, columns, plain, next_entity):
        """Have exactly these agents and plain entities, and number births from ``next_entity``.

        Windows on agents that live before and after stay good.

        Parameters
        ----------
        ids : (n,) int64, ascending
        columns : dict of Field to array
            Every column of this world, n rows each.
        plain : collection of int
            Plain entities to keep; all others go.
        next_entity : int
        """
        kept_ids = set(plain)
        for entity in self.plain_entities():
            if entity not in kept_ids:
                esper.delete_entity(entity, immediate=True)
        new_ids = set(np.asarray(ids).tolist())
        for entity in self._agent_set - new_ids:
            esper.delete_entity(entity, immediate=True)
        esper._dead_entities.clear()
        self._dying = set()
        born = sorted(new_ids - self._agent_set)
        self._agent_set.intersection_update(new_ids)
        self.agents.replace(ids, columns)
        self._register(born)
        self._counter.next = int(next_entity)


class Windows(MutableMapping):
    """What esper holds for an agent: its components by type, made when first asked for.

    A hundred thousand animals would otherwise be over a million small objects that nobody looks at.
    """

    __slots__ = ("_entity", "_made", "_table")

    def __init__(self, table, entity, made=None):
        self._table, self._entity, self._made = table, entity, made or None

    def __getitem__(self, kind):
        if self._made is None:
            self._made = {}
        if kind not in self._made and kind in self._table.kinds:
            window = kind.__new__(kind)
            window._home, window._entity = self._table, self._entity
            self._made[kind] = window
        return self._made[kind]

    def __setitem__(self, kind, component):
        if kind in self._table.kinds and not isinstance(component._home, Table):
            _move_in(component, self._table, self._entity)
        if self._made is None:
            self._made = {}
        self._made[kind] = component

    def __delitem__(self, kind):
        if kind in self._table.kinds:
            raise TypeError(f"every agent has a {kind.__name__}; it cannot be taken away")
        del (self._made or {})[kind]

    def __iter__(self):
        yield from self._table.kinds
        for kind in self._made or ():
            if kind not in self._table.kinds:
                yield kind

    def __len__(self):
        return sum(1 for _ in self)

    def __contains__(self, kind):
        return kind in self._table.kinds or kind in (self._made or ())


def _move_in(component: Any, table, entity):
    values, row = component._home, table.row(entity)
    for field, value in values.items():
        table.arrays[field][row] = value
    component._home, component._entity = table, entity


def _forget(name):
    """Drop an esper context, at once or, when esper is in it, as soon as it is in another."""
    with _context:
        if esper.current_world == name:
            _forgotten.append(name)
        else:
            esper._context_map.pop(name, None)

"""The lists of level things that a running world keeps, and what undo puts back in them."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import contextmanager
from copy import copy
from dataclasses import replace
from operator import attrgetter
from typing import Any, NamedTuple

from flockbrush.engine.commands import blaming_of
from flockbrush.systems.fauna import SpeciesList
from flockbrush.systems.landscape import Landscape
from flockbrush.systems.life import Nursery
from flockbrush.systems.palette import Palette
from flockbrush.systems.programs import Programs


class ThingKind(NamedTuple):
    """A kind of level thing."""

    paths: tuple  # attributes of the landscape, or of the nursery for spawns, that hold its lists
    put: Callable[[Any, int], Any]  # the command that puts a thing at a place of its list, or changes it to be so
    away: Callable[[Any, int, int], Any]  # the command that takes away a thing at a place of list number n


KINDS: dict[str, ThingKind] = {}


def without_place(command, now):
    """A command that changes a thing, without what it only repeats of where the thing stands and how high.

    ``now`` is the command that puts the thing as it is.  The class of both says in ``as_it_stands`` which fields tell
    this together, and with which values they leave it as it is.
    """
    for kept in getattr(command, "as_it_stands", ()):
        if all(getattr(command, name) == getattr(now, name) for name in kept):
            command = replace(command, **kept)
    return command


def lists_of(world, kind):
    """The lists of the things of a kind."""
    owner = world.resource(Nursery if kind == "spawn" else Landscape)
    return [attrgetter(path)(owner) for path in KINDS[kind].paths]


@contextmanager
def rehearsal(world):
    """What a script is checked in: things, species, brushes and programs that `rehearse` commands change, and that
    come back."""
    resources = [world.resource(kind) for kind in (Palette, Programs)]
    lists = [things for kind in KINDS for things in lists_of(world, kind)]
    lists += [world.resource(Nursery).born, world.resource(SpeciesList).names]
    before = [list(things) for things in lists]
    for resource in resources:
        twin = world.insert(copy(resource))
        twin.set_state(resource.state())
    try:
        yield
    finally:
        for resource in resources:
            world.insert(resource)
        for things, kept in zip(lists, before, strict=True):
            things[:] = kept


def rehearse(world, command):
    """Check a command as if those foreseen before it had been applied; the `rehearsal` then has what it brings.

    Of one that rehearses others itself the form alone is checked (``check_form``).

    Raises
    ------
    ValueError, LookupError
        When the command cannot be done.
    """
    check = getattr(command, "check_form", None) or getattr(command, "check", None)
    with blaming_of(command):
        if check is not None:
            check(world)
        if hasattr(command, "foresee"):
            command.foresee(world)


class TouchedThings(NamedTuple):
    """The things of a kind: a command replaces what it changes, and leaves the others as they are.

    What is put back stays where it is by then, unless the command has moved it.
    """

    kind: str

    def taken(self, world):
        born = list(world.resource(Nursery).born) if self.kind == "spawn" else []
        return [list(things) for things in lists_of(world, self.kind)], born

    def back(self, world, taken):
        known, (before, born), out = KINDS[self.kind], taken, []
        for n, (was, now) in enumerate(zip(before, lists_of(world, self.kind), strict=True)):
            stays = {id(thing) for thing in was} & {id(thing) for thing in now}
            removed = [(k, thing) for k, thing in enumerate(was) if id(thing) not in stays]
            changed = {thing.id or thing.name for _, thing in removed}
            added = [(k, thing) for k, thing in enumerate(now) if id(thing) not in stays]
            new = [(k, thing) for k, thing in added if (thing.id or thing.name) not in changed]
            others = {thing.id: known.put(thing, k) for k, thing in added if thing.id in changed}
            out += [known.away(thing, k, n) for k, thing in reversed(new)]
            for k, thing in removed:
                put = known.put(thing, k)
                put = without_place(put, others[thing.id]) if thing.id in others else put
                out.append(replace(put, born=born[k]) if born else put)
        return out

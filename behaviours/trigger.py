"""What a trigger's condition is, what it perceives, and which kinds there are.

A kind is one file in ``behaviours/triggers`` with a frozen class::

    @condition
    class Sees(Condition):
        sees: Names = named("species it sees")
        within: Length | None = given(None, "only nearer than this")

        def holds(self, senses, rows):
            ...

The name of its first field is the word by which a program asks for it: ``when = { sees = "wolf", within = "20 m" }``.
The folder is scanned; third parties register through the entry point group ``flockbrush.triggers``.
"""

from __future__ import annotations

import math
import typing
from collections.abc import Iterator
from functools import cache
from typing import Annotated, Any, ClassVar, NamedTuple, Protocol

import numpy as np
from flockbrush.behaviours.amounts import Amount, Dimension
from flockbrush.behaviours.validation import shown, validated
from flockbrush.engine.limits import PROGRAM_DEPTH
from flockbrush.engine.parallel import over_rows
from flockbrush.engine.plugins import blaming, load_entry_points, load_modules
from flockbrush.engine.problems import did_you_mean
from numba import njit
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field

Key = tuple[str | int, ...]
ANYONE, KIN, OTHERS = "anyone", "kin", "others"  # beside the names of species


class SeenNeighbours(NamedTuple):
    """Lists of visible neighbours: those of row i are ``near[first[i]:first[i + 1]]``, at ``offset`` (m) from it."""

    first: np.ndarray  # (n + 1,)
    near: np.ndarray  # (m,) rows
    offset: np.ndarray  # (m, 2 or 3) m


class NeighbourFilter(NamedTuple):
    """Which neighbours a condition asks about."""

    species: np.ndarray  # (n,) uint8, animals of a species that it names
    kind: np.ndarray  # (n,) the same number for animals of one kind
    kin: bool  # whether it asks about those of its own kind,
    others: bool  # and about all others


class Happening(NamedTuple):
    """A named event, or the death of an animal of a species, in the last tick."""

    name: str
    xyz: tuple[float, float, float]  # m
    reach: float = math.inf  # m from there, in plan; inf: everywhere
    entity: int = 0  # the only animal that it concerns; 0: all


class Senses(Protocol):
    """What conditions may ask about all n animals; `systems.senses_of_programs` answers.

    Arrays are by row and read-only, in metres and seconds.
    """

    dt: float  # s
    tick: int
    ids: np.ndarray  # (n,) entity ids, for noise
    xyz: np.ndarray  # (n, 3) m
    velocity: np.ndarray  # (n, 3) m/s
    before: np.ndarray  # (n, 3) m/s, the velocity one tick ago; kept for conditions that need it (`Condition.needs`)
    length: np.ndarray  # (n,) m, body length
    kin: np.ndarray  # (n,) the same number for animals of one kind: a species, or several that are kin
    slope: np.ndarray  # (n, 2) rise per metre, east and north
    since: np.ndarray  # (n,) tick in which the present state was entered
    wrap: tuple[float, float]  # m, size of a periodic map; (0, 0) of another
    seen: tuple[SeenNeighbours, ...]  # on the ground, and in the air where somebody flies
    events: list[Happening]
    deaths: list[Happening]  # in the last tick; likewise
    births: np.ndarray  # (n,) uint8, animals born since the last tick; likewise

    def stream(self, name: str) -> np.uint64:
        """Noise stream of a name, for `flockbrush.engine.noise.key_`."""

    def key(self, name: str) -> np.uint64:
        """Noise key of a stream in this tick."""

    def flags(self, names: tuple[str, ...]) -> np.ndarray:
        """(n,) uint8, who is of one of these species; `kin` and `others` are for the kernels to tell."""

    def is_kin(self, name: str) -> np.ndarray:
        """(n,) bool, whose own kind a species is."""

    def in_state(self, name: str) -> np.ndarray:
        """(n,) uint8, who is in the state of this name of the same program; PROGRAM/STATE is that of another."""

    def inside(self, region: str) -> np.ndarray:
        """(n,) bool, who is in the region of this name."""

    def at_goal(self, goal: str) -> np.ndarray:
        """(n,) bool, who stands in this goal; "" is each one's own."""

    def away(self, place: str) -> np.ndarray:
        """(n,) m in plan to the middle of the nearest goal or region of this name."""

    def height(self) -> np.ndarray:
        """(n,) m above the ground."""

    def ground(self, name: str) -> np.ndarray:
        """(n,) a property of the ground under each animal (`flockbrush.levels.terrain_kinds.terrain_property`)."""

    def last(self, memory: Condition, rows: np.ndarray) -> np.ndarray:
        """(k,) tick in which what the condition remembers last held; two ticks before the first where it never did."""

    def count_far(self, rows: np.ndarray, flags: np.ndarray, reach: np.ndarray) -> np.ndarray:
        """(k,) how many of the animals with a flag are seen within a reach (n,), by the eyes of the species."""

    def drawn(self, name: str, amount: Amount, rows: np.ndarray, ticks: np.ndarray | None = None) -> np.ndarray:
        """(k,) an amount, drawn for each animal where it is a range: the same number for the same ``ticks``."""

    def perceives(self, rows: np.ndarray, happening: Happening, within) -> np.ndarray:
        """(k,) bool, who has this place within a distance (m), in range, in view and not behind a wall."""


class Reference(NamedTuple):
    """A name in a condition that must exist elsewhere."""

    what: str  # "state", "region", "goal", "place", "species" or "event"
    name: str


class Condition(BaseModel):
    """Base of all kinds of condition."""

    model_config = ConfigDict(
        frozen=True, extra="forbid", allow_inf_nan=False, arbitrary_types_allowed=True, validate_default=True
    )
    word: ClassVar[str] = ""  # by which a program asks for it; "": the name of the first field
    inner: ClassVar[str] = ""  # "one" or "many": the first field holds conditions
    remembers: ClassVar[bool] = False  # it asks `Senses.last`: `held` is remembered for it
    needs: ClassVar[tuple[str, ...]] = ()  # which of "before", "deaths" and "births" it asks `Senses` for

    def holds(self, senses: Senses, rows: np.ndarray) -> np.ndarray:
        """(k,) bool: for whom it holds."""
        raise NotImplementedError

    def held(self, senses: Senses, rows: np.ndarray) -> np.ndarray:
        """(k,) bool: what is remembered; the ticks since it last held are what `holds` may use."""
        raise NotImplementedError

    def memory(self) -> tuple:
        """What is remembered, so that conditions that remember the same share one memory."""
        return ()

    def oddity(self) -> str:
        """Why it holds always or never, whatever happens; "" where it does not."""
        return ""

    def references(self) -> Iterator[Reference]:
        """Names that must exist."""
        return iter(())

    def parts(self) -> tuple[Condition, ...]:
        """Conditions inside this one."""
        return ()

    def walk(self) -> Iterator[Condition]:
        """This condition and all inside it, outermost first."""
        yield self
        for part in self.parts():
            yield from part.walk()

    @property
    def stream(self) -> str:
        """The name of its noise: set by the program, so that no two triggers draw the same numbers."""
        return self._stream

    _stream: str = ""


def answer(condition: Condition, senses: Senses, rows: np.ndarray, question: str = "holds") -> np.ndarray:
    """(k,) bool: what `Condition.holds`, or ``held``, says; an error with the condition's word for anything else."""
    with blaming("condition", condition.word, type(condition).__module__):
        said = getattr(condition, question)(senses, rows)
        if isinstance(said, np.ndarray) and said.dtype == bool and said.shape == rows.shape:
            return said
        got = f"{said.dtype} of shape {said.shape}" if isinstance(said, np.ndarray) else shown(said)
        must = f"{question}(senses, rows) must return a bool array of shape {rows.shape}"
        raise TypeError(f"condition {condition.word!r}: {must}, got {got}")


def field(default, meaning: str, **bounds):
    """A field of a condition with one line of meaning; the docs row comes from it."""
    return Field(default, description=meaning, **bounds)


def _names(value):
    names = (value,) if isinstance(value, str) else tuple(value) if isinstance(value, (list, tuple)) else None
    if not names or not all(isinstance(name, str) and name.strip() for name in names):
        raise ValueError("must be a name or an array of names")
    return names


Names = Annotated[tuple[str, ...], BeforeValidator(_names)]

_kinds: dict[str, type[Condition]] = {}


def condition(kind: type[Condition]) -> type[Condition]:
    """Register a kind of condition under the name of its first field."""
    kind.word = kind.word or next(iter(kind.model_fields))
    word = kind.word
    if word in _kinds and _kinds[word].__module__ != kind.__module__:
        raise ValueError(f"condition {word!r} is already in {_kinds[word].__module__}")
    _kinds[word] = kind
    return kind


@cache
def _scan() -> None:
    import flockbrush.behaviours.triggers as package

    load_modules(package)
    load_entry_points("flockbrush.triggers")


def conditions() -> dict[str, type[Condition]]:
    """All kinds of condition by their word, in order of name."""
    _scan()
    return dict(sorted(_kinds.items()))


def read_condition(value: Any, where: Key = (), depth: int = 0) -> tuple[Condition | None, list[tuple[Key, str]]]:
    """A condition from plain data: (condition or None, [(path, what is wrong)])."""
    kinds = conditions()
    if not isinstance(value, dict):
        return None, [(where, f'must be a table such as {{ sees = "wolf", within = "20 m" }}, got {shown(value)}')]
    if depth > PROGRAM_DEPTH:
        return None, [(where, f"conditions may be nested {PROGRAM_DEPTH} deep")]
    words = [word for word in value if word in kinds]
    if len(words) != 1:
        return None, [(where, _no_kind(value, words, kinds))]
    kind = kinds[words[0]]
    if not kind.inner:
        made, mistakes = validated(kind, value, where)
        if made is not None:
            _check_answers(made)
        return made, mistakes
    others = [word for word in value if word != words[0]]
    if others:
        return None, [(where + (others[0],), f"unknown name; '{words[0]}' must be the only key of its table")]
    return _read_inner(kind, words[0], value[words[0]], where + (words[0],), depth)


def _check_answers(condition):
    """Ask a condition what programs ask it later, and name it where it fails."""
    with blaming("condition", condition.word, type(condition).__module__):
        hash(condition.memory())
        for ref in condition.references():
            if not isinstance(ref, Reference):
                must = f"references() must give Reference, got {shown(ref)}"
                raise TypeError(f"condition {condition.word!r}: {must}")
        if not isinstance(condition.oddity(), str):
            raise TypeError(f"condition {condition.word!r}: oddity() must return a string")


def _read_inner(kind, word, value, where, depth):
    """A condition made of others."""
    field = next(iter(kind.model_fields))
    if kind.inner == "one":
        part, mistakes = read_condition(value, where, depth + 1)
        return (None if part is None else kind(**{field: part})), mistakes
    if not isinstance(value, (list, tuple)) or not value:
        return None, [(where, f"must be an array of conditions, got {shown(value)}")]
    read = [read_condition(item, where + (k,), depth + 1) for k, item in enumerate(value)]
    mistakes = [mistake for _, wrong in read for mistake in wrong]
    return (None if mistakes else kind(**{field: tuple(part for part, _ in read)})), mistakes


def _no_kind(value, words, kinds):
    if len(words) > 1:
        return f"asks for {' and '.join(words)} at once; write {{ all = [{{ ... }}, {{ ... }}] }}"
    if not value:
        return "is empty; a condition has one of " + ", ".join(kinds)
    return f"there is no condition {shown(next(iter(value)))}{did_you_mean(str(next(iter(value))), kinds)}"


def plain(condition: Condition) -> dict[str, Any]:
    """A condition as a program's file has it, without what is left at its default."""
    out: dict[str, Any] = {}
    for k, (name, field) in enumerate(type(condition).model_fields.items()):
        value = getattr(condition, name)
        if k and (name not in condition.model_fields_set or value == field.default):
            continue
        name = name if k else condition.word
        if isinstance(value, Condition):
            out[name] = plain(value)
        elif isinstance(value, tuple) and value and isinstance(value[0], Condition):
            out[name] = [plain(part) for part in value]
        elif isinstance(value, tuple):
            out[name] = value[0] if len(value) == 1 else list(value)
        else:
            out[name] = value if isinstance(value, (bool, int, float, str)) else str(value)
    return out


def dimension_of(field) -> Dimension | None:
    """The dimension of a field that holds an amount."""
    for item in (*field.metadata, *_metadata(field.annotation)):
        if isinstance(item, Dimension):
            return item
    return None


def _metadata(annotation):
    for part in (annotation, *typing.get_args(annotation)):
        yield from getattr(part, "__metadata__", ())


# kernels that several kinds share -----------------------------------------------------------------


def count_seen(senses: Senses, rows, names=(ANYONE,), within=None, flags=None):
    """(k,) how many visible others are of these species, or have a flag, within a distance.

    Parameters
    ----------
    names : tuple of str
        Species, `anyone`, `kin` or `others`.
    within : Amount, optional
        Where only species are named, the eyes of the species look as far as this; else only neighbours that the brush
        perceives are counted.
    flags : (n,) uint8, optional
        Count only those with a flag.
    """
    count = np.zeros(len(rows), np.int64)
    reach = np.full(len(senses.ids), np.inf) if within is None else within.of(senses.length) + 0.0 * senses.length
    wanted = senses.flags(names)
    if within is not None and not {ANYONE, KIN, OTHERS} & set(names):
        return senses.count_far(rows, wanted if flags is None else wanted & flags, reach)
    flagged = senses.flags((ANYONE,)) if flags is None else flags
    query = NeighbourFilter(wanted, senses.kin, KIN in names, OTHERS in names)
    for lists in senses.seen:
        over_rows(_count_seen, len(rows), rows, lists, query, flagged, reach, count)
    return count


@njit(cache=True, nogil=True, error_model="numpy")
def _count_seen(lo, hi, rows, lists, asked, flagged, reach, count):
    first, near, offset = lists
    wanted, kind, kin, others = asked
    for k in range(lo, hi):
        i = rows[k]
        r2 = reach[i] * reach[i]
        for at in range(first[i], first[i + 1]):
            j = near[at]
            same = kind[j] == kind[i]
            if not flagged[j] or not (wanted[j] or (kin and same) or (others and not same)):
                continue
            d2 = 0.0
            for c in range(offset.shape[1]):
                d2 += offset[at, c] * offset[at, c]
            count[k] += d2 <= r2

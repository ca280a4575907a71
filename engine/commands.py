"""Commands: changes of the world as data; submitted, applied at the start of a tick, recorded and replayed."""

from __future__ import annotations

import functools
import heapq
import json
import math
import types
import typing
from collections.abc import Callable
from dataclasses import MISSING, dataclass, fields
from difflib import get_close_matches

import numpy as np
from flockbrush.engine import limits
from flockbrush.engine.arguments import whole
from flockbrush.engine.clock import Clock
from flockbrush.engine.plugins import blaming, load_entry_points

COMMANDS: dict[str, type] = {}
GONE = {"PutGoal": "PlaceGoal replaced it; replay it with the version that made the recording"}
_FARTHEST = {int: 2**63 - 1, float: limits.COMMAND_SIZE}  # from 0; whole numbers are ids and seeds too
_WORDS = {
    float: "a number",
    int: "a whole number",
    str: "a string",
    bool: "true or false",
    list: "a list",
    dict: "a table",
}


class CommandError(ValueError):
    """A command failed; ``str()`` tells tick, command and reason.  The world is unchanged.

    ``source`` is the recording that it is from, if it is from one, and ``key`` the object of the script, or 0.
    """

    def __init__(self, tick, cmd, reason, source="", key=0):
        shown = repr(cmd)
        place = f"{source}: tick {tick}" if source else f"tick {tick}"
        place += f", object {key} in layer 'script'" if key else ""
        super().__init__(f"{place}: {shown if len(shown) < 200 else shown[:190] + '...'}: {reason}")
        self.tick, self.command, self.reason, self.source = tick, cmd, str(reason), source


@typing.dataclass_transform(frozen_default=True)
def command(cls):
    """Make a class with an ``apply(world)`` method a frozen dataclass, recordable by its name.

    What cannot be done raises a ValueError or a LookupError before anything has been changed; after any other error
    the world may be half changed, and does not go on (`flockbrush.engine.plugins.PluginError`).  A command may also
    have a ``check(world)`` that raises for what can be known beforehand, such as the name of a brush, and a
    ``touches(world)``: the parts of the world that it changes, so that it can be undone (see `Commands.perform`).
    Both ``touches`` and ``apply`` begin with the check.  A ``foresee(world)`` changes the lists of level things, the
    brushes and the programs as ``apply`` will, and nothing else: scripts are checked by it in the order of their times.
    Its fields must be numbers, strings, booleans, None, or lists and dicts of those, so that a
    recording can hold them as JSON.

    Raises
    ------
    TypeError
        When it lacks a field that its base class names in ``needs_fields``, such as ``"x or at_x: float"``.
    ValueError
        When another module has a command of this name.
    """
    cls = dataclass(frozen=True)(cls)
    _check_needs(cls)
    known = COMMANDS.get(cls.__name__)
    if known is not None and known.__module__ != cls.__module__:
        raise ValueError(f"command {cls.__name__} is already registered by {known.__module__}")
    for name in ("touches", "apply") if hasattr(cls, "check") else ():
        if hasattr(cls, name):
            setattr(cls, name, _checked(getattr(cls, name)))
    COMMANDS[cls.__name__] = cls
    return cls


def _check_needs(cls):
    """TypeError when a command lacks what its base class uses."""
    has, needs = {*dir(cls), *(field.name for field in fields(cls))}, getattr(cls, "needs_fields", ())
    missing = [how for how in needs if has.isdisjoint(how.split(":")[0].split(" or "))]
    if missing:
        base = next(base for base in cls.__mro__ if "needs_fields" in vars(base)).__name__
        raise TypeError(f"command {cls.__name__} lacks {', '.join(missing)}; {base} needs {', '.join(needs)}")


@functools.cache
def _load_commands_of_others():
    load_entry_points("flockbrush.commands")


def commands() -> dict[str, type]:
    """All commands by name; modules under the entry point group ``flockbrush.commands`` add theirs."""
    _load_commands_of_others()
    return COMMANDS


def _checked(method):
    @functools.wraps(method)
    def after_check(self, world):
        self.check(world)
        return method(self, world)

    return after_check


def place_fields(cls, values):
    """Pairs of fields of a command's class that are a place on the map, with these values, not a direction or a speed.

    A class says in ``place_kinds`` of which ``kind`` (x, y) is a place: all, if it says nothing.
    """
    known = {f.name: f.default for f in fields(cls)}
    kinds = getattr(cls, "place_kinds", None)
    of_x = kinds is None or values.get("kind", known.get("kind")) in kinds
    pairs = [("x", "y")] if of_x else []
    return [pair for pair in (*pairs, ("to_x", "to_y"), ("at_x", "at_y")) if set(pair) <= set(known)]


def default_values(cls):
    """{field: value} of what a command of this class has where nothing is given."""
    values = {f.name: f.default if f.default_factory is MISSING else f.default_factory() for f in fields(cls)}
    return {name: value for name, value in values.items() if value is not MISSING}


def to_record(cmd):
    """(name, fields) of a command, ready for JSON."""
    return type(cmd).__name__, {f.name: getattr(cmd, f.name) for f in fields(cmd)}


def from_record(name, values):
    """The command of this name with these fields.

    Raises
    ------
    ValueError
        For an unknown name or field, a missing one, or a value of the wrong type, with what there is; for one that is
        not finite or out of all bounds.
    """
    if not isinstance(values, dict):
        raise ValueError(f"the fields of command {_short(name)} must be an object, got {_short(repr(values))}")
    for field, value in values.items():
        _check_sound(f"{_short(name)}.{_short(field)}", value, limits.COMMAND_DEPTH)
    known_commands = commands()
    if name not in known_commands:
        instead = f"; {GONE[name]}" if name in GONE else _instead(name, known_commands)
        raise ValueError(f"unknown command {_short(name)!r}{instead}")
    cls = known_commands[name]
    known = {f.name: f for f in fields(cls)}
    for field in values:
        if field not in known:
            raise ValueError(f"{name} has no field {_short(field)!r}{_instead(field, known)}")
    missing = [f for f in known if f not in values and known[f].default is known[f].default_factory is MISSING]
    if missing:
        raise ValueError(f"{name} needs {', '.join(missing)}")
    hints = _hints(cls)
    return cls(**{field: _fitting(f"{name}.{field}", hints[field], value) for field, value in values.items()})


def to_json(cmd):
    """A command as JSON, ``[name, fields]``, with numpy's numbers and arrays as Python's.

    Numbers that are not finite are written as NaN or Infinity, which `from_json` refuses with their field.

    Raises
    ------
    ValueError
        When a field cannot be.
    """
    name, values = to_record(cmd)
    written = (f"{json.dumps(field)}:{_written(f'{name}.{field}', value)}" for field, value in values.items())
    return f"[{json.dumps(name)},{{{','.join(written)}}}]"


def _written(where, value):
    try:
        return json.dumps(value, default=_as_python, separators=(",", ":"))
    except (TypeError, ValueError, RecursionError) as error:
        raise ValueError(f"{where} cannot be recorded: {error}") from None


def _as_python(value):
    """A number or an array of numpy as Python's, for JSON."""
    if isinstance(value, (np.generic, np.ndarray)):
        return value.tolist()
    raise TypeError(f"{_short(repr(value))} is neither a number nor a string, boolean, list or dict")


def from_json(text):
    """The command in a JSON text of `to_json`; all values are validated.

    Raises
    ------
    ValueError
        When it is no such text, or a value in it is of the wrong type, not finite or out of all bounds.
    """
    try:
        pair = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise ValueError(f"it is not valid JSON: {error}") from None
    if not (isinstance(pair, list) and len(pair) == 2 and isinstance(pair[0], str) and isinstance(pair[1], dict)):
        raise ValueError("it must be [name, {field: value, ...}]")
    return from_record(*pair)


def _check_sound(where, value, depth):
    """ValueError unless every number in a value is finite and within `limits.COMMAND_SIZE`, and every text is one."""
    if isinstance(value, (list, tuple, dict)):
        if not depth:
            raise ValueError(f"{where} has lists nested more than {limits.COMMAND_DEPTH} deep")
        parts = [*value, *value.values()] if isinstance(value, dict) else value
        if set(map(type, parts)) <= {int, float}:
            parts = [part for part in parts if part != part] or ((min(parts), max(parts)) if parts else ())
        for part in parts:
            _check_sound(where, part, depth - 1)
    elif isinstance(value, str):
        if not value.isascii() and any("\ud800" <= letter <= "\udfff" for letter in value):
            raise ValueError(f"{where} contains an incomplete character (a lone surrogate)")
    elif isinstance(value, float) and not math.isfinite(value):
        raise ValueError(f"{where} must be a finite number, got {value}")
    elif type(value) in _FARTHEST and abs(value) > _FARTHEST[type(value)]:
        raise ValueError(f"{where} must be within ±{_FARTHEST[type(value)]:g}, got {_short(repr(value))}")


def _short(text):
    return text if len(text) <= 60 else text[:57] + "..."


def _as_replayed(cmd):
    """The command as a recording gives it back, so that a 2 that will be a 2.0 is one from the first."""
    return from_json(to_json(cmd))


@functools.cache
def _hints(cls):
    return typing.get_type_hints(cls)


def _fitting(where, hint, value):
    """The value as this type, an int as a float where one is wanted; ValueError when it is something else."""
    union = typing.get_origin(hint) in (typing.Union, types.UnionType)
    kinds = [typing.get_origin(h) or h for h in (typing.get_args(hint) if union else (hint,))]
    if value is None and type(None) in kinds:
        return None
    whole = isinstance(value, int) and not isinstance(value, bool)
    if float in kinds and (whole or isinstance(value, float)) and abs(value) < 1e300:
        return float(value)
    if type(value) in kinds and not isinstance(value, float):
        return value
    if not set(kinds) & set(_WORDS):  # a type we cannot judge
        return value
    wanted = " or ".join(_WORDS[k] for k in kinds if k in _WORDS)
    finite = "finite " if isinstance(value, float) and not math.isfinite(value) else ""
    raise ValueError(f"{where} must be {wanted.replace('a number', f'a {finite}number')}, got {_short(repr(value))}")


def _instead(word, known):
    close = get_close_matches(_short(word), list(known), 1)
    return f"; did you mean {close[0]!r}?" if close else f"; available: {', '.join(sorted(known)) or 'none'}"


def blaming_of(cmd):
    """A context that names the package of a command in errors that it must not raise."""
    return blaming("command", type(cmd).__name__, type(cmd).__module__, (ValueError, LookupError))


class Commands:
    """The queue of commands, and the log of those that were applied."""

    refusal: Callable[[object], str] | None = None  # a recorder says of a command why it cannot be kept, or ""
    hashed = False  # a replay knows from the start what a designer submitted in the middle of the run

    def __init__(self):
        self._order = 0  # of the next to be pushed: of one tick, the first comes first
        self._pending: list[tuple[int, int, object, int]] = []
        self.log: list[tuple[int, object]] = []  # (tick, command), as applied
        self.lived: float = -1  # until this tick what the script does comes from a log
        self.source = ""  # the recording that is lived again, for messages

    def __getstate__(self):
        return {name: value for name, value in vars(self).items() if name != "refusal"}  # a copy is not recorded

    def submit(self, cmd, tick=0, key=0):
        """Apply a command at the start of the given tick, or of the next one if that has begun.

        ``key``: of the script that gives it, 0 for none (see `follow`).

        Raises
        ------
        TypeError
            When it is no registered command, or the tick no whole number.
        ValueError
            When a field is of the wrong type or no recording can hold it; for a tick below 0.
        """
        if whole("tick", tick) < 0:
            raise ValueError(f"tick must be at least 0, got {tick}")
        if COMMANDS.get(type(cmd).__name__) is not type(cmd):
            raise TypeError(f"{type(cmd).__name__} is not a command; mark its class with @command")
        self._push(tick, _as_replayed(cmd), key)

    def follow(self, key, tick, cmd):
        """Have a key of the level's script give this command at this tick, instead of what it was to give.

        Parameters
        ----------
        key : int
            Identity of the key, at least 1.
        tick : int
        cmd : command or None
            None: the key is gone.
        """
        self.replace([entry for entry in self.waiting if entry[2] != key])
        if cmd is not None and tick > self.lived:
            self._push(tick, _as_replayed(cmd), key)

    def _push(self, tick, cmd, key=0):
        heapq.heappush(self._pending, (int(tick), self._order, cmd, key))
        self._order += 1

    @property
    def waiting(self):
        """(tick, command, key of the script or 0) of what is still to come, in the order of its ticks."""
        return [(tick, cmd, key) for tick, _, cmd, key in sorted(self._pending, key=lambda entry: entry[:2])]

    @property
    def pending(self):
        """(tick, command) of what is still to come, in the order of its ticks."""
        return [(tick, cmd) for tick, cmd, _ in self.waiting]

    def replace(self, entries):
        """Have exactly these waiting, as a replay does: (tick, command) of a log or a recording, or `waiting`."""
        self._pending = []
        for tick, cmd, *key in entries:
            self._push(tick, cmd, *key)

    def apply(self, world, script=()):
        """Apply all that is due, in order of tick, then of submission.

        Parameters
        ----------
        world : World
        script : sequence with ``id``
            The keys of the level's script: in this order comes what they give in one tick.

        Raises
        ------
        CommandError
            When one of them cannot be done.  It is dropped and not in the log; those after it still wait, so that
            whoever goes on can call this again.
        """
        now = world.resource(Clock).tick
        if self._pending and self._pending[0][0] <= now:
            self._order_keys(script, now)
        while self._pending and self._pending[0][0] <= now:
            _, _, cmd, key = heapq.heappop(self._pending)
            try:
                self._check_refusal(cmd)
                with blaming_of(cmd):
                    cmd.apply(world)
            except (ValueError, LookupError) as error:
                raise CommandError(now, cmd, error.args[0] if error.args else error, self.source, key) from error
            self._applied(world, cmd)

    def _order_keys(self, script, now):
        """Have keys of one tick that are due take their turns in the order of the script."""
        rank = {key.id: k for k, key in enumerate(script)}
        turns = sorted((entry for entry in self._pending if entry[0] <= now and entry[3] in rank), key=lambda e: e[:2])
        if len(turns) > 1:
            others = [entry for entry in self._pending if entry[0] > now or entry[3] not in rank]
            due = sorted(turns, key=lambda entry: (entry[0], rank[entry[3]]))
            self._pending = [*others, *((*turn[:2], *entry[2:]) for turn, entry in zip(turns, due, strict=True))]
            heapq.heapify(self._pending)

    def perform(self, world, commands):
        """Do these at once, all of them or none, before whatever waits: an edit of a designer.

        Each is logged at the tick to come, so that a replay does it there.

        Parameters
        ----------
        world : World
        commands : sequence of command

        Returns
        -------
        list of command
            What takes them back, in order.  Each part that a command touches has ``taken(world)``, what is kept of
            it just before the command is applied, and ``back(world, taken)``, called just after: the commands that
            put back what differs.  A command without ``touches`` has nothing to take back.

        Raises
        ------
        CommandError
            When one of them cannot be done.  Those before it have been taken back then.
        PluginError
            When one of another package failed with any other error.  The world may be half changed then.
        """
        back: list[object] = []
        for cmd in commands:
            try:
                undo = self._do(world, cmd)
            except CommandError:
                for taken in back:
                    self._do(world, taken, takes_back=True)
                raise
            back[:0] = undo
        return back

    def _check_refusal(self, cmd):
        if self.refusal is not None and (reason := self.refusal(cmd)):
            raise ValueError(reason)

    def _do(self, world, cmd, takes_back=False):
        """Apply one command now and log it; what takes it back."""
        now = world.resource(Clock).tick
        try:
            cmd = _as_replayed(cmd)
            if not takes_back:
                self._check_refusal(cmd)
            with blaming_of(cmd):
                parts = cmd.touches(world) if hasattr(cmd, "touches") else []
                before = [part.taken(world) for part in parts]
                cmd.apply(world)
        except (ValueError, LookupError) as error:
            raise CommandError(now, cmd, error.args[0] if error.args else error) from error
        self._applied(world, cmd)
        back = (one for part, taken in zip(parts, before, strict=True) for one in part.back(world, taken))
        return [_as_replayed(one) for one in back]

    def _applied(self, world, cmd):
        """Log a command, and follow the script as it is from now on."""
        clock = world.resource(Clock)
        self.log.append((clock.tick, cmd))
        for key, tick, given in _rescripted(cmd, clock.dt):
            self.follow(key, tick, given if tick >= clock.tick else None)

    def state(self):
        """What waits, as bytes (see `flockbrush.engine.state`)."""
        return json.dumps([[tick, *to_record(cmd), key] for tick, cmd, key in self.waiting], allow_nan=False).encode()

    def set_state(self, data):
        """Put back what `state` gave."""
        self.replace([(tick, from_record(name, values), *key) for tick, name, values, *key in json.loads(data)])


def tick_at(seconds, dt):
    """The first tick that is no earlier than so many seconds after the start."""
    return math.ceil(seconds / dt)


def _rescripted(cmd, dt):
    """[(key, tick, command or None)] for a command that changes the level's script: its ``rescript()`` says how."""
    change = cmd.rescript() if hasattr(cmd, "rescript") else None
    if change is None:
        return []
    key, seconds, given = change
    return [(key, tick_at(seconds, dt), given)]


def script_after(script, commands, dt):
    """What a script will do once commands were applied that may change it.

    Parameters
    ----------
    script : list of (tick, command, key)
    commands : iterable of (tick, command)
    dt : float
        Seconds of a tick.

    Returns
    -------
    list of (tick, command, key)
    """
    for _, cmd in commands:
        for key, tick, given in _rescripted(cmd, dt):
            script = [entry for entry in script if entry[2] != key]
            script += [] if given is None else [(tick, given, key)]
    return script

"""Analysis of runs that should be identical but differ: the system, the parts of the state, the animals, both values.

A recording keeps a hash and sums of every tick, and a snapshot now and then.  `investigate` lives the last tick before
a difference again, from the nearest snapshot, to see which system writes what; what differs then follows from the sums,
or from a snapshot of that very tick where there is one.
"""

from __future__ import annotations

import csv
import json
from dataclasses import asdict, dataclass, field
from functools import partial
from pathlib import Path

import numpy as np

from flockbrush.engine.files import refused, whole, write_text
from flockbrush.engine.problems import ProblemsError
from flockbrush.engine.recording import RecordingError, resume
from flockbrush.engine.schedule import Stage
from flockbrush.engine.state import StateError, check_beginning, column_of, parts_of, snapshot, state_hash
from flockbrush.engine.state_comparison import Difference, compare
from flockbrush.engine.trail import as_row, column_named, column_sum, only_row, rows_in, traces, values_of
from flockbrush.runs.terminal import finite

HERE = "replayed"
THERE = "recorded"
IDS = "ids"  # the part of the state that says which animals live


@dataclass
class Desync:
    """The report on a difference between two runs."""

    tick: int  # the states differ after so many ticks
    exact: bool = True  # and not after one tick less; False: somewhere between
    system: str | None = None  # the first one that gives something else in this tick; None: not known
    parts: list[str] = field(default_factory=list)  # what differs after this tick
    differences: list[Difference] = field(default_factory=list)  # with values, where they are known
    later: int | None = None  # the next tick of which both states are known
    later_differences: list[Difference] = field(default_factory=list)
    repeatable: bool = True  # living the tick again gives the same state again
    states: dict[str, tuple[int, bytes]] = field(default_factory=dict)  # {name: (tick, snapshot)}
    notes: list[str] = field(default_factory=list)

    def as_json(self):
        """Everything but the states, as JSON can hold it."""
        table = asdict(self)
        del table["states"]
        return finite(table)


def investigate(run, divergence, simulation, rebuilt) -> Desync:
    """Analyse a difference found by `flockbrush.engine.recording.first_difference`.

    Parameters
    ----------
    run : RecordedRun
    simulation : Simulation
        The replay, at the tick that differs; it is run on to the next snapshot.
    rebuilt : callable
        Makes a simulation of the recording that has not run yet.
    """
    tick, world = divergence.tick, simulation.world
    report = Desync(tick, exact=tick <= divergence.same_until + 1)
    here = snapshot(world)
    try:
        there = _recorded(run, tick, world)
        again, written = _once_more(run, divergence, rebuilt())
        sums = run.sums(tick)
    except (RecordingError, StateError) as error:
        report.notes.append(f"no more details are available: {error}")
        return report
    there = _judge(report, divergence, again.world, there)
    again.close()
    mine = _sums_of(world)
    report.parts = _apart(world, sums, mine) if sums else []
    report.states[HERE] = (tick, here)
    if there is not None:
        report.states[THERE] = (tick, there)
        report.differences = _compared(report, world, there, here)
        report.parts = sorted({*report.parts, *(d.part for d in report.differences)})
    else:
        report.differences = [
            _by_sums(world, n, sums, mine) for n in report.parts if column_named(world, n) is not None
        ]
    if tick and report.exact:
        report.system = _first_system(report.parts, written, simulation.schedule)
    if there is None:
        _go_on(run, report, simulation)
    return report


def _recorded(run, tick, world):
    """The snapshot of this tick that the recording holds, or None; StateError when it is of another kind of world."""
    return run.keyframes.read(tick, partial(check_beginning, world)) if tick in run.keyframes else None


def _apart(world, sums, mine):
    """Names of what differs; where animals have come or gone, their other columns cannot be told apart by sums."""
    names = {name for name in {*sums, *mine} if sums.get(name) != mine.get(name)}
    return sorted(names - set(world.agents.fields) if IDS in names else names)


def _sums_of(world):
    """What a trail keeps of a world as it is."""
    marks: dict[str, bytes] = {}
    state_hash(world, marks)
    return values_of(world, marks | traces(world))


def _judge(report, divergence, again, there):
    """The recorded state, as far as it is known, after looking at the tick once more."""
    digest = state_hash(again)
    report.repeatable = digest == divergence.replayed
    if digest == divergence.recorded:
        report.notes.append("simulating this tick again gave the recorded state: this build produces both states")
        return snapshot(again) if there is None else there
    if not report.repeatable:
        report.notes.append("simulating this tick again gave a third state")
    return there


def _compared(report, world, one, other):
    try:
        return compare(world, one, other)
    except StateError as error:
        report.notes.append(f"the states cannot be compared: {error}")
        return []


# the tick again ------------------------------------------------------------------------------


def _once_more(run, divergence, simulation):
    """(the simulation after the tick that differs, {system: names of what it changed}) from the nearest snapshot."""
    resume(run, simulation.world, divergence.same_until)
    while simulation.clock.tick < divergence.tick - 1:
        simulation.tick()
    if simulation.clock.tick >= divergence.tick:
        return simulation, {}
    before, written = [_copies(simulation.world)], {}

    def watch(system):
        after = _copies(simulation.world)
        written[system] = {name for name in after if _changed(before[0].get(name), after[name])}
        before[0] = after

    with simulation.schedule.watched(watch):
        simulation.tick()
    return simulation, written


def _copies(world):
    """{name: value} of the whole state as it is, with the ids of the animals beside each column."""
    ids = world.agents.ids.copy()
    columns = {name: (ids, world.agents[f].copy()) for name, f in world.agents.fields.items()}
    resources = {f"resource {type(r).__name__}": r.state() for r in world.resources() if hasattr(r, "state")}
    return {IDS: [who for who in ids.tolist() if world.entity_exists(who)], **columns, **resources, **traces(world)}


def _changed(before, after):
    """Whether a system changed columns of animals that exist before and after it."""
    if not isinstance(after, tuple) or before is None:
        return before != after
    (ids, old), (later, new) = before, after
    return old[np.isin(ids, later)].tobytes() != new[np.isin(later, ids)].tobytes()


def _first_system(parts, written, schedule):
    """The first system whose last word on something is not what was recorded.

    What several systems write in one tick is the work of the last of them.  Where none of them wrote here, the
    recorded run may have had one that did: what the systems declare counts.
    """
    order = [type(system).__name__ for system in schedule.systems]
    candidates = []
    for part in parts:
        writers = [name for name in order if part in written.get(name, ())] or _declared(part, schedule)
        candidates += writers[-1:]
    return min(candidates, key=order.index, default=None)


def _declared(part, schedule):
    """Systems that say they write a part of the state; animals come and go in the last stage that changes anything."""
    owner = part.removeprefix("resource ").split(".")[0]
    return [
        type(system).__name__
        for system in schedule.systems
        if owner in {kind.__name__ for kind in system.writes} or (part == IDS and system.stage == Stage.LIVE)
    ]


# who it is -----------------------------------------------------------------------------------


def _by_sums(world, name, sums, mine):
    """The one animal that differs in a column, when it is one."""
    column, ids = column_named(world, name), world.agents.ids
    if name == IDS:
        return _by_count(sums.get(IDS, b""), mine[IDS])
    single = only_row(sums.get(name, b""), column)
    if single is None:
        return Difference(name, None, [], [], [], None)
    row, words = single
    then = as_row(words, column)
    with np.errstate(invalid="ignore", over="ignore"):
        size = float(np.abs(then.astype(float) - column[row].astype(float)).max())
    return Difference(
        name, 1, [int(ids[row])], [then.tolist()], [column[row].tolist()], size if size == size else np.inf
    )


def _by_count(there, here):
    """Who lives in one state only, when it is one."""
    more = rows_in(here) - rows_in(there)
    if abs(more) != 1:
        return Difference(IDS, abs(more) or None, [], [], [], None)
    words = ["not alive", "lives"][::more]
    return Difference(IDS, 1, [more * (column_sum(here) - column_sum(there))], words[:1], words[1:], None)


def _go_on(run, report, simulation):
    """Compare where both states are known again: in the next snapshot."""
    later = min((tick for tick in run.keyframes if tick > report.tick), default=None)
    if later is None:
        report.notes.append("the recording has no snapshot after this tick")
        return
    try:
        there = _recorded(run, later, simulation.world)
        while simulation.clock.tick < later:
            simulation.tick()
    except (ValueError, LookupError, ArithmeticError, ProblemsError, RecordingError) as error:
        report.notes.append(f"the replay does not reach the next snapshot, of tick {later}: {error}")
        return
    report.later = later
    report.states |= {f"{THERE} later": (later, there), f"{HERE} later": (later, snapshot(simulation.world))}
    report.later_differences = _compared(report, simulation.world, there, report.states[f"{HERE} later"][1])


# files ---------------------------------------------------------------------------------------


def check_folder(folder):
    """Make sure that a report can be written into a folder, which is made if need be; ProblemsError."""
    folder = Path(folder)
    if folder.exists() and not folder.is_dir():
        raise refused(folder, "is a file; --report must be a folder")
    if not folder.parent.is_dir():
        raise refused(folder, f"there is no folder {str(folder.parent)!r}")


def write_report(folder, world, report, more):
    """Write ``report.json`` and both states, each as a snapshot and as a table; other files there are left alone.

    Parameters
    ----------
    folder : path
    world : World
        A world of the kind the states are of.
    report : Desync
    more : dict
        What else the report says.

    Returns
    -------
    list of Path
    """
    folder = Path(folder)
    folder.mkdir(exist_ok=True)
    paths = [folder / "report.json"]
    write_text(paths[0], json.dumps({**more, **report.as_json()}, indent=2, ensure_ascii=False) + "\n")
    for name, (tick, state) in report.states.items():
        stem = f"{name.split()[0]}-{tick}".replace(" ", "-")
        with whole(folder / f"{stem}.state") as temporary:
            temporary.write_bytes(state)
        paths += [folder / f"{stem}.state", folder / f"{stem}.csv"]
        _write_table(paths[-1], world, state)
    return paths


def _write_table(path, world, state):
    """The columns of a snapshot as CSV, a line for each animal."""
    parts = parts_of(world, state)
    ids = np.frombuffer(parts["ids"], np.int64)
    columns = {"id": ids}
    for name, f in world.agents.fields.items():
        values = column_of(f, parts[name], len(ids))
        flat = values.reshape(len(ids), int(np.prod(values.shape[1:])))
        names = [name] if values.ndim == 1 else [f"{name}.{k}" for k in range(flat.shape[1])]
        columns |= dict(zip(names, flat.T, strict=True))
    with whole(path) as temporary, open(temporary, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(columns)
        writer.writerows(zip(*(column.tolist() for column in columns.values()), strict=True))

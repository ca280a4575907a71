"""The determinism test of ``run --synctest``: simulate ticks twice from a snapshot and compare.

What is not part of a snapshot and changes a herd all the same is found this way, and so is what threads decide.
"""

from __future__ import annotations

from flockbrush.engine.commands import Commands
from flockbrush.engine.state import pieces, restore, snapshot, state_hash
from flockbrush.engine.state_comparison import compare
from flockbrush.engine.trail import traces
from flockbrush.runs.desync import Desync

FIRST, AGAIN = "first", "again"


class OutOfSync(Exception):
    """A tick that was simulated twice gave different states."""

    def __init__(self, report: Desync):
        super().__init__(f"tick {report.tick} gives another state when it is simulated again")
        self.report = report


class SyncTest:
    """Simulates every tick twice and compares the states.

    Call `tick` in the place of the simulation's own.  It goes ahead by ``every`` ticks, comes back to the snapshot it
    took before, and then does the ticks one by one, each compared with what it was the first time.  Commands are
    handed in where it goes ahead, every ``every`` ticks: in between they would be news the second time.

    Parameters
    ----------
    every : int
        Ticks between snapshots.
    last : int
        No tick after this one is lived ahead.
    tick : callable
        Does one tick of the simulation, the second time.
    look : callable
        Called after each tick that is lived ahead; what it raises ends the test, back at the snapshot.
    """

    def __init__(self, simulation, every, last, tick, look=lambda: None):
        self.simulation, self.every, self.last, self._tick, self.look = simulation, every, last, tick, look
        self.compared = 0  # ticks
        self._ahead: list[_Lived] = []

    def tick(self):
        """One tick of the simulation; OutOfSync when it is not what it was the first time."""
        if not self._ahead:
            self._go_ahead()
        first = self._ahead.pop(0)
        again = _Lived(self.simulation, self._tick)
        self.compared += 1
        if again.hash != first.hash:
            raise OutOfSync(_report(self.simulation, first, again))

    def _go_ahead(self):
        world = self.simulation.world
        start, log = snapshot(world), world.resource(Commands).log
        known = len(log)
        try:
            for _ in range(min(self.every, self.last - self.simulation.clock.tick)):
                self._ahead.append(_Lived(self.simulation, self.simulation.tick, self._ahead[-1:]))
                self.look()
        finally:
            restore(world, start)
            del log[known:]


class _Lived:
    """One tick as it was: what each system left behind, and the state at its end.

    Pieces of the state that are as they were ``before`` are kept once.
    """

    def __init__(self, simulation, tick, before=()):
        self.marks: dict[str, dict[str, bytes]] = {}  # by system, in running order
        with simulation.schedule.watched(lambda system: self.marks.update({system: _marks(simulation.world)})):
            tick()
        self.tick = simulation.clock.tick
        self.hash = state_hash(simulation.world)
        self._pieces = pieces(snapshot(simulation.world))
        for lived in before:
            old = {piece: piece for piece in lived._pieces}
            self._pieces = [old.get(piece, piece) for piece in self._pieces]

    @property
    def state(self):
        """The snapshot at the end of the tick."""
        return b"".join(self._pieces)


def _marks(world):
    marks: dict[str, bytes] = {}
    state_hash(world, marks)
    return marks | traces(world)


def _report(simulation, first, again):
    report = Desync(first.tick)
    for system, marks in first.marks.items():
        apart = [name for name in {**marks, **again.marks[system]} if marks.get(name) != again.marks[system].get(name)]
        if apart:
            report.system, report.parts = system, sorted(apart)
            break
    report.states = {FIRST: (first.tick, first.state), AGAIN: (again.tick, again.state)}
    report.differences = compare(simulation.world, first.state, again.state)
    report.repeatable = False
    return report

"""Runs ticks in a thread, while the window draws the last finished state."""

from __future__ import annotations

import contextvars
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from flockbrush.engine.commands import CommandError
from flockbrush.runs.snapshots import between, moment_of
from flockbrush.studio.gauges import Pacemaker, Profile
from flockbrush.studio.timeline import WentWrong

_SOON = 1e-9  # of a tick; rounding of what real time adds up to


@dataclass
class TickResult:
    """The result of ticks that ran together."""

    count: int  # finished ticks
    # before, after: the last two states, between which the window interpolates
    before: Any
    after: Any
    error: BaseException | None = None  # that ended them early


class BackgroundWork:
    """Runs one function at a time in a thread.

    The thread is a daemon: Ctrl-C ends the program even while a model never returns.
    """

    def __init__(self):
        self._thread: threading.Thread | None = None
        self._left: list = []

    @property
    def busy(self):
        """Whether work was started whose result was not taken yet."""
        return self._thread is not None

    def begin(self, work: Callable[[], TickResult]):
        """Begin; `work` catches its own errors."""
        if self._thread is not None:
            raise RuntimeError("one piece of work at a time: take the result of the last one first")
        context = contextvars.copy_context()  # numpy keeps there what it says of overflows
        self._thread = threading.Thread(target=lambda: self._left.append(context.run(work)), name="ticks", daemon=True)
        self._thread.start()

    def is_done(self, patience_s=None):
        """Whether the result is there, waiting for it no longer than so many seconds; None for as long as it takes."""
        if self._thread is not None:
            self._thread.join(patience_s)
        return self._thread is None or not self._thread.is_alive()

    def take(self) -> TickResult:
        """The result, waited for."""
        self.is_done()
        self._thread = None
        return self._left.pop()


class TickRunner:
    """Methods of a session that run ticks while the window draws."""

    _timeline: Any
    playing: bool
    scene: Any
    wrap: Any
    _goal: int | None
    _stop: Callable
    _go: Callable

    def _stand_still(self):
        """While the run is paused."""
        self._beside = BackgroundWork()
        self._rate = 1.0
        self._owed = 0.0  # ticks of real time that have not been simulated yet
        self._due = 0  # ticks that run beside
        self._behind = 0.0  # ticks by which what is shown lags behind real time: what the last frame brought
        self._passed = 0  # ticks since somebody asked how many
        self._cost = 0.0  # s of a tick, recent mean
        self._pace, self._profile = Pacemaker(), Profile()

    @property
    def ticking(self):
        """Whether ticks run beside: what is not from `view` or `scene` is waited for."""
        return self._beside.busy

    @property
    def moment(self):
        """The animals as they are after the last tick that is shown."""
        return self._after

    def view(self):
        """The animals for drawing, between the last two ticks while time goes on."""
        if not self.playing or self._before is None:
            return self._after
        start, end = self._before.time, self._after.time
        share = min(max(self._owed + self._due - self._behind, 0.0), 1.0)
        return between(self._before, self._after, start + share * (end - start), self.wrap)

    def catch_up(self, wall_seconds, budget_s, patience_s=None):
        """Let real time pass, have the ticks that ran beside, and go on with a scrub; whether the world stands still.

        The first half of a frame; `set_off` is the second.  In between nothing happens, and the world can be looked
        at.

        Parameters
        ----------
        wall_seconds : float
            Real time since the last call.
        budget_s : float
            Seconds that a scrub may take.
        patience_s : float, optional
            Seconds to wait for ticks that still run; as long as they take by default.  While they run, nobody who
            has no time to wait may ask for the world: `simulation`, `timeline` and all that comes from there.
        """
        if self._beside.is_done(patience_s):
            self._collect()
        if self._goal is not None:
            self._go(budget_s)
        elif self.playing:
            self._behind = wall_seconds * self._rate / self.scene.clock.dt
            self._owed += self._behind
            ticks, self._passed = self._passed, 0
            self._pace.passed(wall_seconds, ticks * self.scene.clock.dt)
        return not self._beside.busy

    def set_off(self, budget_s):
        """Have the ticks that are due run beside, as far as a budget in seconds allows.

        At least one tick, if one is due, and never one that is not expected to fit; what could not be done is
        forgotten, so a slow machine plays slower and never falls behind.

        Those in which commands are due are waited for: what they change of the ground is drawn by nobody before.
        """
        due = int(self._owed + _SOON) if self.playing and self._goal is None else 0
        if due and not self._beside.busy:
            self._owed = max(self._owed - due, 0.0)  # what does not fit into the budget is forgotten
            self._due, deadline = due, time.perf_counter() + budget_s
            at_once = self._timeline.changes_within(due)
            self._beside.begin(lambda: self._live(due, deadline))
            if at_once:
                self._collect()

    def _live(self, due, deadline):
        """So many ticks, as far as there is time: in the thread beside, which alone touches the world meanwhile."""
        lived = TickResult(0, self._before, self._after)
        while lived.count < due:
            begin = time.perf_counter()
            if lived.count and begin + self._cost > deadline:
                break
            if not self._tick(lived):
                break
            self._cost += 0.2 * (time.perf_counter() - begin - self._cost)
        return lived

    def _tick(self, lived):
        """One tick more; whether it came to its end."""
        try:
            self._timeline.step()
            lived.before, lived.after = lived.after, moment_of(self._timeline.simulation, labels=())
            self._profile.passed(self._timeline.simulation.schedule)
        except BaseException as error:  # noqa: BLE001  raised again where somebody hears of it
            lived.error = error
            return False
        lived.count += 1
        return True

    def _collect(self):
        """Wait for the ticks that run beside, and have what they left; a notice and a pause if one went wrong."""
        if self._beside.busy:
            self._have(self._beside.take())

    def _have(self, lived):
        self._before, self._after, self._due = lived.before, lived.after, 0.0
        self._passed += lived.count
        if isinstance(lived.error, (CommandError, WentWrong)):
            self._stop(str(lived.error))
        elif lived.error is not None:
            raise lived.error

"""Runs a level in real time for the clients of a live link."""

from __future__ import annotations

import json
import queue
import time

from flockbrush.engine import limits
from flockbrush.engine.commands import CommandError, Commands
from flockbrush.engine.plugins import PluginError
from flockbrush.levels.steps import CommandStack
from flockbrush.output.live.frame import LABELLED, pack
from flockbrush.output.live.link import Link
from flockbrush.output.live.messages import hello, names, place
from flockbrush.runs.snapshots import between, moment_of
from flockbrush.systems.landscape import Landscape

FASTEST = 60.0  # frames a second
_BEHIND = 0.25  # s; a machine that is slower than the herd drops what it is behind
_AT_ONCE = 64  # requests that are answered between two ticks
_LOOK_AGAIN = 0.5  # s between two looks at what stands in the level


class Serving:
    """A simulation that clients watch and control.

    Parameters
    ----------
    simulation : Simulation
        As `flockbrush.start` makes it.
    host, port, token
        As `flockbrush.output.live.link.Link`; call ``link.start()`` before `run`.
    fps : float
        Frames per second; between two ticks animals are where they pass.
    after_tick : function (), optional
        Called after every tick, by a recorder.
    say : function (text), optional
        Told what clients are told that no request asked for.
    """

    def __init__(self, simulation, host="127.0.0.1", port=0, fps=FASTEST, after_tick=None, token=None, say=None):
        self.simulation, self.fps = simulation, fps
        self.after_tick, self.say = after_tick or (lambda: None), say or (lambda text: None)
        self.wrap = simulation.world.resource(Landscape).wrap
        self.playing = True
        self.steps = CommandStack(int(limits.LIVE_UNDO))
        self.unrecorded = False  # commands since the last tick
        self._texts = self._described()
        self.link = Link(host, port, lambda: list(self._texts.values()), token)
        self._moments = [self._moment()] * 2
        self._made = time.time()
        self._looked = time.monotonic()

    def _moment(self):
        return moment_of(self.simulation, LABELLED)

    def _described(self):
        messages = hello(self.simulation, self.fps), names(self.simulation), place(self.simulation)
        return {message["type"]: json.dumps(message) for message in messages}

    def run(self, stop, seconds=None):
        """Serve until ``stop()`` is true or so many simulated seconds are over; the link is open meanwhile."""
        dt = self.simulation.clock.dt
        last = None if seconds is None else round(seconds / dt)
        tick_due = frame_due = time.monotonic()
        try:
            while not stop() and (last is None or self.simulation.clock.tick < last):
                now = time.monotonic()
                if now >= tick_due:
                    self.answer()
                    if self.playing:
                        self.tick()
                    tick_due += dt
                    if now - tick_due > _BEHIND:
                        tick_due = now
                if now >= frame_due:
                    self.show(tick_due)
                    frame_due = max(frame_due + 1 / self.fps, now)
                time.sleep(max(0.0, min(tick_due, frame_due) - time.monotonic()))
            if self.unrecorded:
                self.tick()  # a recording holds commands with the tick that they come before
        except PluginError as error:  # the world may be half changed
            text = " ".join(problem.message for problem in error.problems)
            self.link.tell_all(json.dumps({"type": "error", "id": None, "message": f"the server ends: {text}"}))
            raise
        finally:
            self.link.close()

    def tick(self):
        """One step of the world; sends all clients the script commands that failed."""
        while True:
            try:
                self.simulation.tick()
                break
            except CommandError as error:  # that command is dropped, and no tick has passed
                self.say(str(error))
                self.link.tell_all(json.dumps({"type": "error", "id": None, "message": str(error)}))
        self._made = time.time()
        self.unrecorded = False
        self.after_tick()
        self._moments = [self._moments[1], self._moment()]

    def show(self, tick_due):
        """Send a frame with the animals."""
        if not self.link.clients:
            return
        self._tell_changes()
        before, after = self._moments
        share = 1 - min(max((tick_due - time.monotonic()) / self.simulation.clock.dt, 0.0), 1.0)
        if self.playing and after.time > before.time and share < 1:
            after = between(before, after, before.time + share * (after.time - before.time), self.wrap)
        self.link.show(pack(after, self.simulation.clock.tick, self._made))

    def _tell_changes(self):
        """Send what has another meaning or place since the last look: names before the frame that uses them."""
        kinds = [names]
        if time.monotonic() - self._looked >= _LOOK_AGAIN:
            self._looked = time.monotonic()
            kinds.append(place)
        for describe in kinds:
            message = describe(self.simulation)
            text = json.dumps(message)
            if text != self._texts[message["type"]]:
                self._texts = {**self._texts, message["type"]: text}
                self.link.tell_all(text)

    # what clients ask -------------------------------------------------------------------

    def answer(self):
        """Execute the requests of clients and answer them."""
        for _ in range(_AT_ONCE):
            try:
                client, request = self.link.requests.get_nowait()
            except queue.Empty:
                return
            self.link.tell(client, json.dumps(self._done(request)))

    def _done(self, request):
        clock = self.simulation.clock
        try:
            told = self._do(request)
        except CommandError as error:
            return {"type": "error", "id": request.id, "message": error.reason}
        return {"type": "done", "id": request.id, "tick": clock.tick, **told}

    def _do(self, request):
        """Carry out a request; returns further fields of the answer."""
        told = {}
        if request.play is not None:
            self.playing = request.play
        elif request.undo:
            told["undone"] = self._undo()
        else:
            back = self._perform([request.command])
            if back:
                name, tick = type(request.command).__name__, self.simulation.clock.tick
                self.steps.note(name, [request.command], back, tick, None)
        if not self.playing:
            self._moments = [self._moment()] * 2
        return told

    def _undo(self):
        """Take back the last command, and forget it, also when the herd can no longer be changed back; its name."""
        name, commands = self.steps.undo_label, self.steps.undo_commands
        if commands is None:
            raise CommandError(self.simulation.clock.tick, None, "there is nothing to undo")
        self.steps.take_back()
        try:
            self._perform(commands)
        except CommandError as error:
            reason = f"{name} can no longer be undone ({error.reason}); the next undo is of what was done before it"
            raise CommandError(self.simulation.clock.tick, error.command, reason) from error
        return name

    def _perform(self, commands):
        """Do these at once; what takes them back."""
        back = self.simulation.world.resource(Commands).perform(self.simulation.world, commands)
        self.unrecorded = True
        return back

"""A session without editing, until `flockbrush.play.session` is there."""

from __future__ import annotations

from flockbrush.moments import between, moment_of
from flockbrush.run import start
from systems.landscape import Landscape


class Session:
    """A running level."""

    playing, rate, dirty, undo_label, redo_label, editor = True, 1.0, False, None, None, None
    branches: list = []

    def __init__(self, name, seed, agents):
        self.name, self.seed, self.agents = name, seed, agents
        self.restart()

    @classmethod
    def open(cls, name, seed=None, agents=None, record=None, state_folder=None):
        return cls(name, seed, agents)

    def restart(self):
        self.simulation = start(self.name, self.seed, self.agents)
        self.before = self.moment = moment_of(self.simulation)
        self.last_tick, self._ahead = 0, 0.0

    level = property(lambda self: self.simulation.level)
    clock = property(lambda self: self.simulation.clock)
    tick = property(lambda self: self.simulation.clock.tick)
    wrap = property(lambda self: self.simulation.world.resource(Landscape).wrap)

    def play(self):
        self.playing = True

    def pause(self):
        self.playing = False

    def step(self, n=1):
        for _ in range(n):
            self.simulation.tick()
            self.before, self.moment = self.moment, moment_of(self.simulation)
        self.last_tick = self.tick

    def advance(self, wall_seconds, budget_s):
        if self.playing:
            self._ahead = min(self._ahead + wall_seconds * self.rate / self.clock.dt, 2.0)
            while self._ahead >= 1:
                self._ahead -= 1
                self.step()

    def view(self):
        if self.before.time == self.moment.time:
            return self.moment
        share = self._ahead if self.playing else 1.0
        return between(self.before, self.moment, self.before.time + share * self.clock.dt, self.wrap)

    def do(self, label, commands, join=None):
        for command in commands:
            self.simulation.submit(command)

    def notices(self):
        return []

    def ground_changes(self):
        return []

    def profile(self):
        return {}

    def chart(self):
        return []

    def autosave(self):
        pass

    def changed_on_disk(self):
        return False

"""Schedules: stages in order, no quarrel inside a stage, honest declarations."""

import pytest
from flockbrush.components.agent import Position, Velocity
from flockbrush.engine.clock import Clock
from flockbrush.engine.columns import Component
from flockbrush.engine.recording import state_hash
from flockbrush.engine.schedule import Ambiguity, Schedule, Stage, System
from small_meadow import Births, Multiply, Obey, Wander, meadow


class Push(System):
    stage, reads, writes = Stage.MOVE, (Velocity,), (Position,)

    def process(self, world):
        world.agents[Position.xyz][:] += 1


class Brake(System):
    stage, writes = Stage.MOVE, (Velocity,)

    def process(self, world):
        world.agents[Velocity.xyz][:] = 0


class Anything(System):
    stage, writes = Stage.MOVE, (Component,)

    def process(self, world):
        pass


class Watch(System):
    stage, reads = Stage.RECORD, (Position, Velocity)

    def process(self, world):
        pass


class Liar(System):
    stage, writes = Stage.RECORD, (Births,)

    def process(self, world):
        world.resource(Births).count += 1
        world.resource(Clock).dt = 1.0
        world.agents[Position.xyz][0] += 1


def test_systems_run_by_stage():
    names = [type(s).__name__ for s in Schedule([Watch(), Multiply(), Wander(), Obey()]).systems]
    assert names == ["Obey", "Wander", "Multiply", "Watch"]


def test_two_writers_of_one_stage_are_refused():
    with pytest.raises(Ambiguity, match="Push and Brake both access Velocity in one stage"):
        Schedule([Push(), Brake()])
    with pytest.raises(Ambiguity, match="Push and Anything both access Position, Velocity|Component"):
        Schedule([Push(), Anything()])


def test_every_quarrel_is_told():
    with pytest.raises(Ambiguity) as caught:
        Schedule([Push(), Brake(), Anything()])
    assert len(str(caught.value).splitlines()) == 3


def test_a_reader_of_another_stage_is_no_quarrel():
    assert Schedule([Push(), Watch()]).ambiguities() == []


def test_a_system_must_say_its_stage():
    class Lost(System):
        pass

    with pytest.raises(TypeError, match="Lost must declare its stage, one of COMMANDS"):
        Schedule([Lost()])


def test_systems_are_timed_without_being_asked():
    world, _ = meadow()
    schedule = Schedule([Wander()])
    schedule.run(world)
    assert set(schedule.nanoseconds) == {"Wander", "flush"}
    assert schedule.nanoseconds["Wander"] > 0


def test_the_herd_does_not_notice_a_shuffle():
    def after(seed):
        world, _ = meadow()
        schedule = Schedule([Obey(), Wander(), Multiply(), Watch()], shuffle_seed=seed)
        for _ in range(9):
            schedule.run(world)
            world.resource(Clock).tick += 1
        return state_hash(world)

    assert len({after(seed) for seed in (None, 1, 2, 3)}) == 1


def test_who_writes_what_it_does_not_say_is_found():
    world, _ = meadow()
    assert Schedule([Obey(), Wander(), Multiply()]).undeclared_writes(world) == []
    assert sorted(Schedule([Liar()]).undeclared_writes(world)) == [("Liar", "Clock"), ("Liar", "Position")]


def test_births_and_deaths_are_no_undeclared_writes():
    world, _ = meadow()
    world.resource(Clock).tick = 3
    assert Schedule([Wander(), Multiply()]).undeclared_writes(world) == []
    assert len(world.agents) == 6

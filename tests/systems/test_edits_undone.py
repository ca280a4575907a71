"""Edits taken back, replayed and kept in snapshots."""

from dataclasses import replace

import numpy as np
import pytest
from edited_scene import CALM, NEW, RUN, SQUARE, do, land_of, nobody_in_walls, scene, settled
from flockbrush.behaviours.brush_writer import brush_to_toml
from flockbrush.components import FormationPlace, Heading, Leading, Migration
from flockbrush.engine import commands as commands_module
from flockbrush.engine.clock import Clock
from flockbrush.engine.commands import COMMANDS, CommandError, Commands
from flockbrush.engine.state import restore, snapshot, state_hash
from flockbrush.levels.build import build
from flockbrush.levels.schema import Goal
from flockbrush.systems.commands import (
    AddAnimals,
    AddObstacle,
    Migrate,
    MoveGoal,
    MoveObstacle,
    PaintBrush,
    PaintCap,
    PaintCells,
    RemoveAnimals,
    RemoveObstacle,
    SendTo,
    SetParameter,
    SwitchBrush,
)
from flockbrush.systems.edits import (
    KINDS,
    DrawGuide,
    MarkSpawn,
    OfThing,
    Paint,
    PlaceExit,
    PlaceGoal,
    RemoveThing,
    UseBrush,
)
from flockbrush.systems.gusts import Gust
from flockbrush.systems.leaders import Appoint
from flockbrush.systems.mark_commands import DrawArea, DrawLine, DrawZone, PlaceKey
from flockbrush.systems.marks import Key
from flockbrush.systems.paint_commands import OnDisc
from flockbrush.systems.selection import OfAnimals
from hypothesis import given, settings
from hypothesis import strategies as st
from small_herd import Shelf, box, level, spawn

spot = st.floats(1, 39)
corner = st.tuples(spot, spot, st.floats(1, 8), st.floats(1, 8)).map(
    lambda v: box(v[0], v[1], min(v[0] + v[2], 40), min(v[1] + v[3], 40)).tolist()
)
names = st.sampled_from(["calm", "run", "", "?"])
strokes = st.one_of(
    st.builds(Paint, st.just("brush"), names, spot, spot, spot, spot, st.floats(0, 6), st.sampled_from([0.0, 0.6])),
    st.builds(Paint, st.just("cap"), st.sampled_from([0.0, 0.5, 2.0]), spot, spot, spot, spot, st.floats(0, 6), spot),
    st.builds(Paint, st.just("cap"), st.floats(0, 4), spot, spot, spot, spot, st.floats(0, 6), st.floats(0, 1)),
    st.builds(
        Paint, st.just("surface"), st.sampled_from(["", "mud", "deep water", "thicket"]), spot, spot, spot, spot,
        st.floats(0, 3),
    ),
    st.builds(PaintBrush, names, spot, spot, st.floats(0, 5)),
    st.builds(PaintCap, st.floats(-1, 5), spot, spot, st.floats(0, 5)),
    st.builds(PaintCells, st.just("brush"), st.just(["run", ""]), st.just([[3, 4, 5, 0], [3, 9, 2, 1], [4, 0, 40, 0]])),
)  # fmt: skip
ids = st.integers(19, 24)
goals = st.sampled_from(["gate", "well", "pen", ""])
things = st.one_of(
    st.builds(AddObstacle, st.sampled_from(["rock", "barn"]), corner, id=st.sampled_from([0, 20, 30]), margin=spot),
    st.builds(RemoveObstacle, st.sampled_from(["rock", "barn"]), st.sampled_from([0, 20, 30])),
    st.builds(DrawGuide, ids, st.just("way"), corner, goal=goals),
    st.builds(
        PlaceGoal, ids, goals, spot, spot, st.floats(0.5, 3), st.sampled_from(["stay", "next"]), goals,
        at=st.sampled_from([-1, 0]),
    ),
    st.builds(PlaceExit, ids, st.just("out"), corner),
    st.builds(MarkSpawn, ids, st.just("pen"), corner, names, count=st.integers(0, 4), rate=st.sampled_from([0.0, 1.0])),
    st.builds(DrawZone, ids, st.just("zone"), corner, names, st.sampled_from([0.0, 0.5]), st.sampled_from([1.0, 0.5])),
    st.builds(DrawLine, ids, goals, corner),
    st.builds(DrawArea, ids, goals, corner),
    st.builds(RemoveThing, st.sampled_from(sorted(KINDS)), ids),
    st.builds(MoveGoal, goals, spot, spot),
)  # fmt: skip
metres = st.sampled_from([0.0, 1.0, 3.0])  # of keys: directions often have the numbers of places
given_by_keys = st.one_of(
    st.tuples(st.just("Gust"), st.fixed_dictionaries({"x": metres, "y": metres})),
    st.tuples(
        st.just("Steer"),
        st.sampled_from([{"x": 1.0, "y": 0.0, "kind": "direction"}, {"x": 3.0, "y": 3.0, "kind": "place"}]),
    ),
    st.tuples(st.just("Migrate"), st.sampled_from([{"x": 1.0, "y": 3.0, "z": 0.0, "kind": "direction"}, {"z": 3.0}])),
    st.tuples(st.just("SwitchBrush"), st.sampled_from([{"brush": "run", "x": 3.0, "radius": 9.0}, {"brush": "calm"}])),
)
keys = st.builds(
    lambda number, tick, given, x, y, at: PlaceKey(number, "cue", tick / 32, *given, x, y, at),
    ids, st.sampled_from([0, 1, 1, 2]), given_by_keys, metres, metres, st.sampled_from([-1, -1, 0]),
)  # fmt: skip
SCRIPT = [
    Key(19, "cue", 1 / 32, "SwitchBrush", {"brush": "run", "x": 1.0, "y": 1.0}, np.ones(2)),
    Key(20, "cue", 1 / 32, "SwitchBrush", {"brush": "calm", "x": 1.0, "y": 1.0}, np.ones(2)),
    Key(21, "cue", 1 / 32, "Steer", {"x": 1.0, "y": 0.0, "kind": "direction"}, np.ones(2)),
]
animals = st.one_of(
    st.builds(AddAnimals, names, spot, spot, st.floats(1, 5), st.integers(1, 5)),
    st.builds(RemoveAnimals, spot, spot, st.floats(0, 20)),
    st.builds(SwitchBrush, names, x=spot, y=spot, radius=st.floats(0, 20)),
    st.builds(SendTo, goals, x=spot, y=spot, radius=st.floats(0, 20)),
    st.builds(SetParameter, names, st.just("cohesion_weight"), st.floats(0, 1)),
    st.builds(UseBrush, st.sampled_from(["run", "other"]), st.just(brush_to_toml(RUN))),
)


def to_come(simulation):
    """(tick, command) of the script, in the order in which the level has its keys."""
    queue, keys = simulation.world.resource(Commands), [key.id for key in land_of(simulation).marks.keys]
    script = sorted(queue.waiting, key=lambda entry: (entry[0], keys.index(entry[2])))
    return [(tick, command) for tick, command, _ in script]


@settings(max_examples=60, deadline=None)
@given(
    st.sampled_from(["wall", "wrap", "open", "despawn"]),
    st.lists(st.one_of(strokes, things, animals), min_size=1, max_size=8),
    st.lists(keys, max_size=2),
    st.integers(0, 3),
)
def test_whatever_is_done_is_taken_back_without_a_trace(boundary, commands, placed, ticks):
    simulation = scene(boundary, script=SCRIPT)
    queue = simulation.world.resource(Commands)
    before, done, script_before = settled(simulation), [], to_come(simulation)
    for command in [*commands, *placed]:
        whole = state_hash(simulation.world)
        try:
            done.append((command, do(simulation, command)))
        except CommandError:
            assert state_hash(simulation.world) == whole, command
        else:
            nobody_in_walls(simulation)
    after, forward, script_after = settled(simulation), [], to_come(simulation)
    for _, back in reversed(done):
        forward.append(do(simulation, *back))
    assert settled(simulation) == before and to_come(simulation) == script_before
    for again in reversed(forward):
        do(simulation, *again)
    assert settled(simulation) == after and to_come(simulation) == script_after
    queue.log.clear()
    simulation.run(ticks)
    assert queue.log == [entry for entry in script_after if entry[0] < ticks]


def test_a_command_of_a_user_is_taken_back_whatever_columns_it_changes(monkeypatch):
    monkeypatch.setattr(commands_module, "COMMANDS", dict(COMMANDS))

    @commands_module.command
    class Spook(OfAnimals):
        changes = (Heading.forward,)
        x: float
        y: float
        radius: float
        species: str = ""

        def apply(self, world):
            world.agents[Heading.forward][self.chosen(world)] = (0.0, 1.0, 0.0)

    simulation = scene("wall")
    world, before = simulation.world, settled(simulation)
    back = world.resource(Commands).perform(world, [Spook(20, 20, 100)])
    assert (world.agents[Heading.forward] == (0.0, 1.0, 0.0)).all() and len(world.agents)
    world.resource(Commands).perform(world, back)
    assert settled(simulation) == before
    (damaged,) = back
    with pytest.raises(CommandError, match="Position.xyz cannot be put back; available"):
        world.resource(Commands).perform(world, [replace(damaged, columns={"Position.xyz": "?"})])


@pytest.mark.parametrize(
    ("base", "words"),
    [
        (OfAnimals, "lacks x or at_x: float, y or at_y: float, radius: float; OfAnimals needs species: str, x or"),
        (OnDisc, "lacks layer: str, x: float, y: float, radius: float; OnDisc needs"),
        (OfThing, "lacks kind: str, id: int; OfThing needs"),
    ],
)
def test_a_command_that_lacks_what_its_base_class_uses_is_refused_where_it_is_defined(base, words):
    with pytest.raises(TypeError, match=f"command Shout {words}"):

        @commands_module.command
        class Shout(base):
            dx: float
            species: str = ""

    assert "Shout" not in COMMANDS


def test_an_edit_of_several_commands_is_done_whole_or_not_at_all():
    simulation = scene()
    before = settled(simulation)
    good = [Paint("brush", "run", 10.0, 10.0, 12.0, 10.0, 3.0), DrawGuide(40, "way", [[5.0, 20.0], [35.0, 20.0]])]
    with pytest.raises(CommandError, match="no goal 'nowhere'"):
        do(simulation, *good, SendTo("nowhere"))
    assert settled(simulation) == before


@pytest.mark.parametrize(
    "command", [Appoint(), Migrate(5.0, 15.0, 0.0), Gust(5.0, 0.0), SendTo("well")], ids=lambda c: type(c).__name__
)
def test_animals_that_have_left_the_world_hinder_no_undo(command):
    simulation = scene()
    before = {
        field: simulation.world.agents[field].copy()
        for field in (Leading.appointed, Migration.kind, FormationPlace.gust)
    }
    back = do(simulation, command)
    do(simulation, RemoveAnimals(10.0, 10.0, 1.0))
    ids = np.asarray(simulation.world.agents.ids)
    assert len(ids) == 4
    do(simulation, *back)
    for field, values in before.items():
        np.testing.assert_array_equal(simulation.world.agents[field], values[1:])


@pytest.mark.parametrize(
    "command",
    [MoveGoal("gate", 20.0, 20.0), PlaceGoal(0, "gate", 20.0, 20.0), PlaceGoal(0, "pen", 20.0, 20.0, at=1)],
    ids=["moved", "changed", "new"],
)
def test_a_goal_that_is_in_no_level_file_is_put_back(command):
    simulation = scene()
    for goal in land_of(simulation).goals:
        goal.id = 0
    do(simulation, SendTo("well", x=10.0, y=10.0, radius=3.0))
    before = settled(simulation)
    back = do(simulation, command)
    assert settled(simulation) != before
    do(simulation, *back)
    assert settled(simulation) == before


def test_a_property_of_what_has_moved_since_is_taken_back_where_it_is_by_then():
    simulation = scene()
    land = land_of(simulation)
    do(simulation, MoveObstacle("barn", 26.5, 31.5, 1.0, seconds=10.0))
    simulation.run(64)
    (barn,), goal = land.obstacles, land.goals[0]
    margin = do(simulation, AddObstacle("barn", barn.polygon.tolist(), id=20, margin=0.5, z_min=barn.z_min))
    radius = do(simulation, PlaceGoal(21, "gate", *goal.xy.tolist(), radius=2.0))
    assert land.obstacles[0].margin == 0.5 and land.goals[0].radius == 2.0
    do(simulation, MoveGoal("gate", 20.0, 20.0))
    simulation.run(192)
    before = land.obstacles[0].polygon.copy()
    do(simulation, *radius)
    again = do(simulation, *margin)
    assert (land.obstacles[0].polygon == before).all() and before.mean(0) == pytest.approx((27.5, 31.5))
    assert (land.goals[0].xy.tolist(), land.goals[0].radius) == ([20.0, 20.0], 1.0)
    simulation.run(80)
    do(simulation, *again)
    barn = land.obstacles[0]
    assert barn.polygon.mean(0) == pytest.approx((26.5, 31.5))
    assert (barn.z_min, barn.margin) == (pytest.approx(1.0), 0.5)


# replay and snapshots --------------------------------------------------------------------------------------

DAY = {
    2: [Paint("brush", "run", 8.0, 10.0, 14.0, 10.0, 3.0, 0.5), Paint("cap", 0.5, 18.0, 10.0, 22.0, 10.0, 3.0, 0.5)],
    5: [Paint("surface", "deep water", 20.0, 26.0, 26.0, 26.0, 2.0), UseBrush("new", NEW)],
    9: [AddObstacle("rock", box(9, 9, 11, 12).tolist(), id=50), MarkSpawn(51, "pen", SQUARE, "new", count=3)],
    12: [DrawGuide(52, "way", [[5.0, 20.0], [35.0, 20.0]]), RemoveThing("goal", 21), RemoveAnimals(20.0, 10.0, 3.0)],
    16: [PlaceExit(53, "out", box(30, 0, 40, 40).tolist()), SwitchBrush("new"), AddAnimals("new", 8.0, 28.0, 3.0, 4)],
}


def fresh():
    """A herd of a level, so that it can be built twice."""
    goals = [Goal(21, "gate", np.array([35.0, 5.0]), 1.0, "stay", "")]
    spawns = [spawn(box(8, 8, 24, 20), "run", 20), spawn(box(1, 1, 2, 2), "calm", 0, id=2)]
    return build(level(boundary="wall", goals=goals, spawns=spawns), library=Shelf(CALM, RUN))


def lived(simulation, until, each=lambda: None):
    """Ticks with the edits of the day and everything taken back again after 20."""
    back = []
    while simulation.clock.tick < until:
        tick = simulation.clock.tick
        if tick in DAY:
            back.append(do(simulation, *DAY[tick]))
        if tick == 20:
            for commands in reversed(back):
                do(simulation, *commands)
        each()
        simulation.tick()
    return simulation


def test_a_replay_of_edits_lives_the_same_life():
    hashes = []
    simulation = fresh()
    lived(simulation, 40, lambda: hashes.append(state_hash(simulation.world)))
    replay = fresh()
    replay.world.resource(Commands).replace(simulation.world.resource(Commands).log)
    for digest in hashes:
        tick = replay.clock.tick
        if tick in DAY or tick == 20:  # the edits of a tick are done before the hash above was taken
            replay.tick()
            continue
        assert state_hash(replay.world) == digest, tick
        replay.tick()
    assert state_hash(replay.world) == state_hash(simulation.world)


@pytest.mark.parametrize("tick", [3, 6, 10, 13, 17, 21, 30])
def test_a_snapshot_in_the_middle_of_edits_goes_on_the_same(tick):
    simulation = lived(fresh(), tick)
    kept = snapshot(simulation.world)
    other = fresh()
    lived(other, 19)  # another world, full of other things
    restore(other.world, kept)
    assert state_hash(other.world) == state_hash(simulation.world)
    assert np.array_equal(land_of(other).navigation.fields, land_of(simulation).navigation.fields)
    for _ in range(14):
        simulation.tick()
        other.tick()
        assert state_hash(other.world) == state_hash(simulation.world)
    assert other.world.resource(Clock).tick == tick + 14

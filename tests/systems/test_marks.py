"""Zones, counting lines and measured areas that are drawn, moved and taken away in a living level."""

from dataclasses import replace

import numpy as np
import pytest
from edited_scene import do, land_of
from flockbrush.behaviours.brush import shipped
from flockbrush.components import BrushBinding
from flockbrush.engine.commands import CommandError, Commands
from flockbrush.engine.state import restore, snapshot, state_hash
from flockbrush.levels.build import build
from flockbrush.levels.schema import Zone
from flockbrush.systems.edits import RemoveThing, as_command
from flockbrush.systems.gusts import Gust  # noqa: F401
from flockbrush.systems.leaders import Steer  # noqa: F401
from flockbrush.systems.mark_commands import DrawArea, DrawLine, DrawZone, PlaceKey
from flockbrush.systems.marks import Key
from flockbrush.systems.named_regions import in_region
from flockbrush.systems.palette import Palette
from flockbrush.systems.programs import Programs
from small_herd import Shelf, box, brush, level, spawn, straight
from small_program import two_states

from flockbrush.runs.level_counts import Counts

CALM, RUN = straight("calm", mean=1.0), brush("run", mean=2.0)
HERE = box(8, 8, 20, 20)
PROGRAM = two_states('{ event = "go" }').source.decode()


def field(**things):
    spawns = [spawn(box(9, 9, 19, 19), "calm", 12, heading=0.0), spawn(box(1, 1, 2, 2), "run", 0, id=2)]
    return build(level(boundary="wall", spawns=spawns, **things), library=Shelf(CALM, RUN))


def brushes(simulation):
    return simulation.agents[BrushBinding.brush].tolist()


def test_a_zone_that_is_drawn_is_that_of_a_level_read_with_it():
    told = dict(brush="run", max_speed=0.5, factor=0.8, blend=0.25)
    read = field(zones=[Zone(30, "pen", HERE, *told.values())])
    drawn = field()
    do(drawn, DrawZone(30, "pen", HERE.tolist(), **told))
    for name in ("brush", "surface", "transition"):
        assert np.array_equal(getattr(land_of(drawn), name), getattr(land_of(read), name)), name
    for simulation in (read, drawn):
        simulation.run(20)
    assert brushes(read) == brushes(drawn) == [1] * 12
    assert np.array_equal(read.agents[BrushBinding.brush], drawn.agents[BrushBinding.brush])


def test_marks_are_taken_back_without_a_trace_and_come_with_a_snapshot():
    simulation = field()
    before = state_hash(simulation.world)
    back = do(
        simulation,
        DrawZone(30, "pen", HERE.tolist(), "run", event="in"),
        DrawLine(31, "gate", [[10.0, 0.0], [10.0, 40.0]]),
        DrawArea(32, "yard", HERE.tolist()),
    )
    drawn = state_hash(simulation.world)
    assert drawn != before
    kept = snapshot(simulation.world)
    assert in_region("yard", np.array([[10.0, 10.0, 0.0], [30.0, 30.0, 0.0]]), land_of(simulation)).tolist() == [1, 0]
    do(simulation, *back)
    assert state_hash(simulation.world) == before
    restore(simulation.world, kept)
    assert state_hash(simulation.world) == drawn
    simulation.run(10)
    assert brushes(simulation) == [1] * 12


def test_a_zone_tells_all_it_says_when_it_is_moved():
    zone = DrawZone(
        30, "pen", HERE.tolist(), "run", 2.0, 0.5, 1.5, "in", -1.0, "sheep", "ground", 0.0, 9.0, 0.5, 2.0, True
    )
    simulation = field()
    do(simulation, zone)
    told = as_command(simulation.world, "zone", 30)
    assert {**vars(told), "at": -1} == vars(zone)


def test_a_line_counts_from_when_it_is_drawn():
    simulation = field()
    counts = Counts(simulation)
    for tick in range(700):
        if tick == 4:
            do(simulation, DrawLine(31, "gate", [[21.0, 0.0], [21.0, 40.0]]), DrawArea(32, "yard", HERE.tolist()))
            assert counts.values()["in yard"] == 12
        simulation.tick()
        counts.take()
    assert counts.values()["crossed gate to its right"] == 12 and counts.values()["in yard"] == 0


def test_a_key_may_be_about_what_an_earlier_key_brings():
    simulation, gate = field(), {"name": "gate", "points": [[30.0, 30.0], [32.0, 30.0], [32.0, 32.0]]}
    move, before = PlaceKey(41, "key", 0.2, "MoveObstacle", {"name": "gate"}, 25.0, 25.0), state_hash(simulation.world)
    with pytest.raises(CommandError, match="there is no obstacle 'gate'"):
        do(simulation, move)
    back = do(simulation, PlaceKey(40, "key", 0.1, "AddObstacle", gate, 31.0, 31.0), move)
    with pytest.raises(CommandError, match="there is no obstacle 'gate'"):
        do(simulation, PlaceKey(41, "key", 0.05, "MoveObstacle", {"name": "gate"}, 25.0, 25.0))
    do(simulation, *back)
    assert state_hash(simulation.world) == before


def test_a_key_may_name_a_brush_or_a_program_that_an_earlier_key_brings():
    simulation, name = field(), "new"
    palette = simulation.world.resource(Palette)
    source = shipped().get("march").source.decode()
    brings = PlaceKey(40, "key", 0.1, "UseBrush", {"name": name, "source": source}, 1, 1)
    programs = PlaceKey(42, "key", 0.2, "UseProgram", {"name": name, "source": PROGRAM}, 1, 1)
    come = PlaceKey(41, "key", 0.3, "AddAnimals", {"brush": name, "radius": 3.0, "program": name}, 31.0, 31.0)
    for missing in (f"no brush '{name}'", f"no program '{name}'"):
        with pytest.raises(CommandError, match=missing):
            do(simulation, come)
        do(simulation, brings)
    do(simulation, programs, come)
    assert simulation.world.resource(Palette) is palette and palette.names == ["calm", "run"]
    simulation.run(16)
    assert palette.names == ["calm", "run", name] and simulation.world.resource(Programs).names == [name]


def test_keys_are_moved_and_brought_back_whatever_has_become_of_what_they_are_about():
    simulation, gate = field(), {"name": "gate", "points": [[30.0, 30.0], [32.0, 30.0], [32.0, 32.0]]}
    do(simulation, PlaceKey(40, "key", 0.1, "AddObstacle", gate, 31.0, 31.0))
    do(simulation, PlaceKey(41, "key", 0.2, "RemoveObstacle", {"name": "gate"}, 25.0, 25.0))
    backs = [do(simulation, RemoveThing("key", number)) for number in (40, 41)]
    for back in reversed(backs):  # the later key first, while the one it needs is gone
        do(simulation, *back)
    simulation.run(16)  # both are past, and so is the obstacle
    do(simulation, PlaceKey(41, "moved", 0.2, "RemoveObstacle", {"name": "gate"}, 20.0, 20.0))
    with pytest.raises(CommandError, match="there is no obstacle 'gate'"):
        do(simulation, PlaceKey(41, "later", 9.0, "RemoveObstacle", {"name": "gate"}, 20.0, 20.0))


def test_a_key_may_bring_a_key_and_another_take_it_away():
    simulation, gate = field(), {"name": "gate", "points": [[30.0, 30.0], [32.0, 30.0], [32.0, 32.0]]}
    brought = {"id": 60, "name": "", "when": 2.0, "command": "AddObstacle", "args": gate, "x": 30.0, "y": 30.0}
    do(simulation, PlaceKey(40, "key", 0.1, "PlaceKey", brought, 31.0, 31.0))
    do(simulation, PlaceKey(41, "key", 0.2, "RemoveThing", {"kind": "key", "id": 60}, 31.0, 31.0))
    simulation.run(5)
    assert [key.id for key in land_of(simulation).marks.keys] == [40, 41, 60]
    simulation.run(5)
    assert [key.id for key in land_of(simulation).marks.keys] == [40, 41]


BAD = [
    (DrawZone(30, "pen", HERE.tolist()), "the zone does nothing"),
    (DrawZone(30, "pen", HERE.tolist(), "rnu"), "no brush 'rnu'"),
    (DrawZone(30, "pen", HERE.tolist(), "run", edge=2.0), "set share to yes"),
    (DrawZone(30, "pen", HERE.tolist(), "run", species="shep"), "no species or tag 'shep'; did you mean 'sheep'"),
    (DrawZone(30, "pen", HERE.tolist(), "run", medium="sea"), "medium must be one of brush, ground, air, any"),
    (DrawZone(30, "pen", HERE.tolist(), "run", z_min=5.0, z_max=5.0), "z_min must be below z_max, got 5 and 5 m"),
    (DrawZone(30, "pen", HERE.tolist(), factor=0.0), "factor must be 0.01 to 10, got 0"),
    (DrawZone(30, "pen", box(50, 50, 60, 60).tolist(), "run"), "the zone is not on the map"),
    (DrawLine(31, "gate", [[1.0, 1.0]]), "a line has 2 to 2000 points, got 1"),
    (DrawLine(31, "", [[1.0, 1.0], [2.0, 1.0]]), "needs a name"),
    (DrawArea(31, "yard", [[1.0, 1.0], [2.0, 1.0]]), "an area has 3 to"),
    (RemoveThing("zone", 30), "there is no zone 30 in this world"),
]


@pytest.mark.parametrize(("command", "reason"), BAD, ids=lambda value: str(value)[:40])
def test_marks_that_cannot_be_say_why_and_change_nothing(command, reason):
    simulation = field()
    before = state_hash(simulation.world)
    with pytest.raises(CommandError) as caught:
        do(simulation, command)
    assert reason in str(caught.value)
    assert state_hash(simulation.world) == before


def test_two_counts_of_one_name_are_refused():
    simulation = field()
    do(simulation, DrawArea(31, "yard", HERE.tolist()))
    with pytest.raises(CommandError, match="there is a line or an area 'yard' already"):
        do(simulation, DrawLine(32, "yard", [[1.0, 1.0], [2.0, 1.0]]))


def placed(when, number=40, name="RemoveAnimals", **args):
    return PlaceKey(number, "key", when, name, args or {"radius": 50.0}, 14.0, 14.0)


def test_a_key_placed_in_a_run_acts_at_its_time_and_a_replay_does_the_same():
    simulation = field()
    do(simulation, placed(0.5))
    simulation.run(16)
    assert len(simulation.agents) == 12
    simulation.run(1)
    assert len(simulation.agents) == 0
    log, hashed = simulation.world.resource(Commands).log, state_hash(simulation.world)
    assert [(tick, type(cmd).__name__) for tick, cmd in log] == [(0, "PlaceKey"), (16, "RemoveAnimals")]
    twin = field()
    queue = twin.world.resource(Commands)
    queue.replace(log)
    queue.lived = 17
    twin.run(17)
    assert state_hash(twin.world) == hashed and queue.log == log


@pytest.mark.parametrize(
    ("change", "gone_at"),
    [
        (None, 16),
        (RemoveThing("key", 40), None),
        (placed(0.75), 24),
        (placed(0.1), None),  # its time has passed
        (placed(0.25), 8),  # this very tick
    ],
)
def test_a_key_follows_what_is_done_to_it_until_its_time(change, gone_at):
    simulation = field()
    do(simulation, placed(0.5))
    simulation.run(8)
    if change is not None:
        do(simulation, change)
    for tick in range(8, 32):
        assert (len(simulation.agents) == 0) == (gone_at is not None and gone_at < tick), tick
        simulation.run(1)


def test_undo_takes_back_what_a_key_was_to_do():
    simulation = field()
    back = do(simulation, placed(0.5))
    again = do(simulation, placed(0.25))
    do(simulation, *again)
    assert [tick for tick, _ in simulation.world.resource(Commands).pending] == [16]
    do(simulation, *back)
    assert simulation.world.resource(Commands).pending == []


@pytest.mark.parametrize(
    "edit",
    [
        [],
        [lambda: switch(40, 0.25, "calm"), "undo"],
        [lambda: RemoveThing("key", 40), "undo"],
        [lambda: switch(40, 0.25, "run"), lambda: switch(41, 0.25, "calm")],  # the later in the file wins
        [lambda: switch(42, 0.25, "calm")],
    ],
)
def test_keys_of_one_tick_take_their_turns_in_the_order_of_the_script_however_they_were_edited(edit):
    script = [
        Key(40, "first", 0.5, "SwitchBrush", {"brush": "run"}, np.array([14.0, 14.0])),
        Key(41, "second", 0.25, "SwitchBrush", {"brush": "calm"}, np.array([14.0, 14.0])),
        Key(42, "third", 0.5, "SwitchBrush", {"brush": "run"}, np.array([14.0, 14.0])),
    ]
    simulation, back = field(script=script), []
    do(simulation, switch(40, 0.25, "run"))
    for step in edit:
        back = do(simulation, *(back if step == "undo" else [step()]))
    kept = snapshot(simulation.world)
    saved = field(script=land_of(simulation).marks.keys)
    for lived in (simulation, saved, simulation):
        lived.run(10)
        assert set(lived.agents[BrushBinding.home].tolist()) == {0}
        restore(simulation.world, kept)


def switch(number, when, brush):
    return PlaceKey(number, "key", when, "SwitchBrush", {"brush": brush, "species": ""}, 14.0, 14.0)


@pytest.mark.parametrize(
    ("name", "args"),
    [
        ("Gust", {"x": 14.0, "y": 1.0}),
        ("Steer", {"x": 1.0, "y": 0.0, "kind": "direction"}),
        ("Migrate", {"x": 3.0, "y": 14.0, "z": 0.0, "kind": "direction"}),
        ("RemoveAnimals", {"x": 14.0, "y": 3.0, "radius": 50.0}),
    ],
)
def test_undo_keeps_a_direction_with_the_numbers_of_the_place_of_its_key(name, args):
    simulation = field()
    placed = PlaceKey(40, "key", 0.5, name, args, 1.0 if name == "Steer" else 14.0, 14.0)
    do(simulation, placed)
    pending, before = simulation.world.resource(Commands).pending, state_hash(simulation.world)
    back = do(simulation, replace(placed, when=0.75))
    do(simulation, *back)
    assert simulation.world.resource(Commands).pending == pending
    assert state_hash(simulation.world) == before


def test_a_key_of_the_level_that_is_moved_acts_once_and_a_snapshot_has_what_waits():
    script = [Key(40, "key", 0.5, "RemoveAnimals", {"x": 14.0, "y": 14.0, "radius": 50.0}, np.array([14.0, 14.0]))]
    simulation = field(script=script)
    (moved,) = (as_command(simulation.world, "key", 40),)
    do(simulation, PlaceKey(40, "key", 0.25, moved.command, moved.args, 15.0, 15.0))
    kept = snapshot(simulation.world)
    for _ in range(2):
        simulation.run(20)
        log = simulation.world.resource(Commands).log
        assert [tick for tick, cmd in log if type(cmd).__name__ == "RemoveAnimals"] == [8]
        restore(simulation.world, kept)
        del log[1:]

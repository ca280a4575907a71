"""A run that is edited is that of the saved level, and what script keys a level's file can hold."""

from contextlib import nullcontext, suppress
from dataclasses import replace

import numpy as np
import pytest
from edited_level import done, editor, read
from flockbrush.components import Destination
from flockbrush.engine.commands import CommandError, Commands
from flockbrush.engine.problems import ProblemsError
from flockbrush.levels.build import build
from flockbrush.levels.editor import EditError
from flockbrush.systems.commands import AddObstacle
from flockbrush.systems.edits import MarkSpawn, PlaceGoal, RemoveThing, as_command
from flockbrush.systems.landscape import Landscape
from flockbrush.systems.leaders import Steer  # noqa: F401
from flockbrush.systems.life import Nursery
from flockbrush.systems.mark_commands import DrawArea, PlaceKey
from hypothesis import given, settings
from hypothesis import strategies as st
from small_level import herd, objects, properties, thing, tiles

metres = st.sampled_from([2.0, 3.0, 4.0])  # of keys: a wind may have the numbers of the place of its key
areas = st.sampled_from([[[2.0, 2.0], [9.0, 2.0], [9.0, 9.0]], [[10.0, 3.0], [14.0, 3.0], [14.0, 7.0], [10.0, 7.0]]])
names, first = st.sampled_from(["a", "b"]), st.sampled_from([-1, 0])
given_by_keys = st.one_of(
    st.tuples(st.just("Gust"), st.fixed_dictionaries({"x": metres, "y": metres})),
    st.tuples(st.just("SwitchBrush"), st.fixed_dictionaries({"brush": st.just("march"), "x": metres | st.just(0.0)})),
    st.tuples(st.just("Appoint"), st.sampled_from([{"entities": [1]}, {"entities": []}, {"yes": False, "radius": 1}])),
    st.tuples(st.just("AddAnimals"), st.just({"brush": "march", "radius": 1.0, "heading": None})),
)
edits = st.one_of(
    st.builds(PlaceGoal, st.integers(11, 13), names, metres, metres, points=st.sampled_from([None, []]), at=first),
    st.builds(PlaceGoal, st.integers(11, 13), names, st.none(), st.none(), points=st.none() | areas, at=first),
    st.builds(AddObstacle, names, areas, id=st.integers(21, 23), z_min=st.sampled_from([None, 0.0, 3.0]), at=first),
    st.builds(
        lambda number, given, x, at: PlaceKey(number, "cue", 1.0, *given, x, 3.0, at),
        st.integers(31, 33), given_by_keys, metres, first,
    ),
    st.builds(RemoveThing, st.just("goal"), st.integers(11, 13)),
    st.builds(RemoveThing, st.just("obstacle"), st.integers(21, 23)),
    st.builds(RemoveThing, st.just("key"), st.integers(31, 33)),
    st.builds(
        MarkSpawn, st.just(7), st.just("pen"), st.just([[2.0, 12.0], [9.0, 12.0], [9.0, 19.0]]), st.just("march"),
        st.just("sheep"), st.just(2), st.floats(-7, 7), st.sampled_from([None, 0.0, 1.0]), start=st.just(1.0),
    ),
)  # fmt: skip


@settings(max_examples=30, deadline=None)
@given(st.lists(edits, min_size=2, max_size=7))
def test_a_run_that_is_edited_at_its_start_is_that_of_the_saved_level(commands):
    edit = editor(tiles(), objects("spawns", herd()))
    run = build(read(edit))
    for command in commands:
        with suppress(EditError, CommandError):
            edit.check([command])
            run.world.resource(Commands).perform(run.world, [command])
            done(edit, command)
    saved = build(read(edit))
    for ours, others in zip(plain_things(run), plain_things(saved), strict=True):
        assert ours == others


BOX = [[2.0, 2.0], [9.0, 2.0], [9.0, 9.0]]
HULL = {"shape": "hull", "corners": [[-2.0, -2.0, 0.0], [2.0, -2.0, 0.0], [0.0, 2.0, 0.1], [0.3, 0.0, 5.0]]}
REMOVED = {
    "an obstacle in the air": (
        "obstacle",
        AddObstacle("a", BOX, id=21, z_min=3.0, z_max=5.0),
        AddObstacle("a", BOX, id=21),
    ),
    "a hull": ("obstacle", AddObstacle("a", BOX, id=21, **HULL), AddObstacle("a", BOX, id=21)),
    "an area goal": ("goal", PlaceGoal(21, "a", None, None, points=BOX), PlaceGoal(21, "a", 3.0, 4.0)),
}


@pytest.mark.parametrize(("kind", "first", "again"), REMOVED.values(), ids=REMOVED)
def test_what_is_not_told_of_a_thing_that_was_removed_is_as_in_a_new_one(kind, first, again):
    edit, new = editor(tiles(), objects("spawns", herd())), editor(tiles(), objects("spawns", herd()))
    run, backs = build(read(edit)), []
    for command in (first, RemoveThing(kind, 21), again):
        backs.append(run.world.resource(Commands).perform(run.world, [command]))
        done(edit, command)
    runs = run, build(read(edit)), build(read(done(new, again)))
    ours, *others = ([list(things) for things in plain_things(one)] for one in runs)
    assert all(ours == other for other in others)
    for back in reversed(backs[1:]):
        run.world.resource(Commands).perform(run.world, back)
        edit.undo()
    assert list(plain_things(run)) == list(plain_things(build(read(edit))))


def two_layers():
    """A level with goals, and areas without a class, in two layers each; those of the second layers are shifted."""
    point = {"point": True}
    goals = [thing(n, "Goal", 16 * n, 16, name=f"goal {n}", extra=point | {"type": ""}) for n in (2, 3, 4)]
    yards = [thing(n, "", 16, 16, 32, 32, f"yard {n}") for n in (5, 6)]
    return editor(
        tiles(), objects("spawns", herd()),
        objects("goals", *goals[:2]), objects("measure", yards[0]),
        objects("goals 2", goals[2], offsetx=8, offsety=4), objects("measure 2", yards[1], offsetx=8),
    )  # fmt: skip


@pytest.mark.parametrize(
    ("commands", "order"),
    [
        ([PlaceGoal(9, "new", 4.0, 5.0)], [2, 3, 4, 9]),
        ([PlaceGoal(9, "new", 4.0, 5.0, at=2)], [2, 3, 9, 4]),
        ([PlaceGoal(9, "new", 4.0, 5.0, at=0)], [9, 2, 3, 4]),
        ([RemoveThing("goal", 2), PlaceGoal(2, "goal 2", 4.0, 5.0)], [3, 4, 2]),
        ([RemoveThing("goal", 4), PlaceGoal(4, "goal 4", 4.0, 5.0, at=0)], [4, 2, 3]),
        ([RemoveThing("goal", 4), PlaceGoal(4, "goal 4", 4.0, 5.0)], [2, 3, 4]),
        ([PlaceGoal(2, "goal 2", 4.0, 5.0)], [2, 3, 4]),
        ([DrawArea(9, "new", BOX)], [5, 6, 9]),
        ([DrawArea(6, "yard 6", BOX)], [5, 6]),
        ([RemoveThing("area", 5), DrawArea(5, "yard 5", BOX)], [6, 5]),
    ],
)
def test_what_is_drawn_has_its_place_in_the_order_of_the_level_whatever_layers_there_are(commands, order):
    edit = two_layers()
    start, run = edit.text(), build(read(edit))
    for command in commands:
        run.world.resource(Commands).perform(run.world, [command])
        done(edit, command)
    land, saved = run.world.resource(Landscape), read(edit)
    goals = isinstance(commands[-1], PlaceGoal)
    ours, theirs = (land.goals, saved.goals) if goals else (land.marks.areas, saved.areas)
    assert [thing.id for thing in ours] == [thing.id for thing in theirs] == order
    for mine, other in zip(ours, theirs, strict=True):
        np.testing.assert_allclose(*(t.xy if goals else t.polygon for t in (mine, other)), atol=1e-6)
    for _ in commands:
        edit.undo()
    assert edit.text() == start


def plain_things(simulation):
    """All that is edited above, as it can be compared."""
    land, spawns = simulation.world.resource(Landscape), simulation.world.resource(Nursery).spawns
    waiting, order = simulation.world.resource(Commands).waiting, [key.id for key in land.marks.keys]
    yield [(goal.id, goal.name, rounded(goal.xy), rounded(goal.polygon)) for goal in land.goals]
    yield simulation.agents[Destination.goal].tolist()
    yield [(o.id, o.name, o.z_min, o.z_max, o.shape, rounded(o.corners), rounded(o.polygon)) for o in land.obstacles]
    yield sorted(waiting, key=lambda entry: order.index(entry[2]))
    yield [(spawn.id, spawn.heading, spawn.speed, spawn.body_length) for spawn in spawns]


def rounded(points):
    return None if points is None else np.round(points, 5).tolist()


@pytest.mark.parametrize("heading", [None, 0.0, 1.0, -1.0, 7.3, np.pi / 4, 0.7853981633974484])
def test_a_spawn_of_the_run_is_that_of_the_saved_level_to_the_bit(heading):
    edit = editor(tiles(), objects("spawns", herd()))
    simulation = build(read(edit))
    for speed in (0.0, 1.5):
        pen = MarkSpawn(7, "pen", [[2.0, 2.0], [9.0, 2.0], [9.0, 9.0]], "march", "sheep", 2, heading, speed, start=1.0)
        for mark in (pen, replace(pen, body_length=0.0)):
            simulation.world.resource(Commands).perform(simulation.world, [mark])
            ours, saved = simulation.world.resource(Nursery).spawns[-1], read(done(edit, mark)).spawns[-1]
            assert (ours.heading, ours.speed, ours.body_length) == (saved.heading, speed or None, None)
            assert (saved.speed, saved.body_length) == (speed or None, None)
            again = as_command(simulation.world, "spawn", 7)
            simulation.world.resource(Commands).perform(simulation.world, [again])
            assert simulation.world.resource(Nursery).spawns[-1].heading == ours.heading


@pytest.mark.parametrize(
    ("species", "brush", "more", "reason"),
    [
        ("sheep", "march", {"altitude": 3.0}, "species 'sheep' does not fly; altitude and depth must be 0"),
        ("sheep", "march", {"depth": 2.0, "start": 9.0}, "species 'sheep' does not fly; altitude and depth must be 0"),
        ("sheep", "geese", {}, "species 'sheep' cannot use brush 'geese', which flies: its media are walk"),
        ("goose", "march", {"altitude": 3.0}, ""),
        ("unheard-of", "march", {"altitude": 3.0}, ""),
    ],
)
def test_a_spawn_is_refused_in_the_run_with_the_words_of_the_reader(species, brush, more, reason):
    edit = editor(
        tiles(), objects("spawns", herd(), thing(2, "Spawn", 64, 128, 16, 16, "geese", brush="geese", count=1))
    )
    run = build(read(edit))
    mark = MarkSpawn(7, "pen", [[12.0, 2.0], [18.0, 2.0], [18.0, 5.0]], brush, species, 1, **more)
    done(edit, mark)
    with pytest.raises(CommandError, match=f": {reason}$") if reason else nullcontext():
        run.world.resource(Commands).perform(run.world, [mark])
    with pytest.raises(ProblemsError, match=f": {reason}$") if reason else nullcontext():
        read(edit)


def key(command, **args):
    return PlaceKey(6, "cue", 1.0, command, args, 3.0, 3.0)


@pytest.mark.parametrize(
    ("command", "reason"),
    [
        (key("Steer", entities=[2], x=1.0, y=0.0), r"no key of a level can hold entities = \[2\] of Steer: it must be"),
        (key("RemoveEntities", entities=[]), r"can hold entities = \[\] of RemoveEntities"),
        (key("DrawArea", id=9, name="yard", points=[[1.0, 1.0], [2.0, 1.0], [2.0, 2.0]]), "hold points .* of DrawArea"),
        (key("MixBrush", name="march", paths={}), "can hold paths = {} of MixBrush"),
        (key("PlaceGoal", id=9, name="pen", x=None, y=2.0), "can hold x = None of PlaceGoal"),
        (key("RemoveObstacle", name="stone", at=1), "can hold at = 1 of RemoveObstacle: a key has its own at"),
        (key("NoSuch"), "there is no command 'NoSuch'"),
    ],
)
def test_a_key_that_no_file_can_hold_is_refused_and_nothing_has_changed(command, reason):
    edit = editor(tiles(), objects("spawns", herd()))
    start = edit.text()
    for refused in (edit.check, lambda commands: edit.do("edit", commands)):
        with pytest.raises(EditError, match=reason):
            refused([command])
        assert edit.text() == start


def test_a_key_leaves_out_what_it_has_by_default_and_no_property_can_be():
    edit = editor(tiles(), objects("spawns", herd()))
    done(edit, key("AddAnimals", brush="march", radius=1.0, heading=None))
    done(edit, replace(key("RemoveObstacle", name="a", at=-1), id=7))
    done(edit, replace(key("Steer", entities=[], x=1.0, y=0.0, kind="direction"), id=8))
    add, remove, steer = (given.args for given in read(edit).script)
    assert add == {"brush": "march", "radius": 1.0, "x": 3.0, "y": 3.0} and remove == {"name": "a"}
    assert steer == {"x": 1.0, "y": 0.0, "kind": "direction"}


def test_a_key_that_is_drawn_as_an_outline_moves_with_what_it_gives():
    area = thing(6, "Key", 16, 16, 32, 32, "cue", at=1.0, command="DrawZone", id=9, brush="march")
    area["properties"] += properties(name="pen")
    edit = editor(tiles(), objects("spawns", herd()), objects("script", area))
    (given,) = read(edit).script
    place = PlaceKey(6, "cue", 1.0, given.command, given.args, *given.xy.tolist())
    with pytest.raises(EditError, match="can hold points"):
        edit.check([replace(place, x=9.0)])
    points = (np.array(given.args["points"]) + (1.5, -2.25)).tolist()
    done(edit, replace(place, x=place.x + 1.5, y=place.y - 2.25, args=given.args | {"points": points}))
    (after,) = read(edit).script
    np.testing.assert_allclose(after.args["points"], points, atol=1e-6)

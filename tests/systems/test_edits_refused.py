"""Edits that are refused, in words, with nothing changed."""

import pytest
from edited_scene import SQUARE, do, scene
from flockbrush.behaviours.brush import shipped
from flockbrush.engine.commands import CommandError, Commands
from flockbrush.engine.state import state_hash
from flockbrush.systems.commands import AddObstacle, PaintCells, RemoveObstacle
from flockbrush.systems.edits import DrawGuide, MarkSpawn, Paint, PlaceExit, PlaceGoal, RemoveThing, UseBrush
from flockbrush.systems.program_commands import UseProgram
from small_herd import box

RUN = shipped().get("march").source.decode()
PROGRAM = 'schema = "flockbrush.program/1"\n[state.a]\n'
BAD = [
    (Paint("brush", "run", -50.0, 5.0, -40.0, 5.0, 3.0), "the stroke is not on the map, which is 40 x 40 m"),
    (Paint("brush", "rnu", 5.0, 5.0, 6.0, 5.0, 3.0), "no brush 'rnu'; it has calm, run"),
    (Paint("brush", 2.0, 5.0, 5.0, 6.0, 5.0, 3.0), "a brush must be given by its name, got 2.0"),
    (Paint("cap", "fast", 5.0, 5.0, 6.0, 5.0, 3.0), "a speed cap must be a number, got 'fast'"),
    (Paint("cap", 5000.0, 5.0, 5.0, 6.0, 5.0, 3.0), "at most 1000 m/s, got 5000"),
    (Paint("surface", "watr", 5.0, 5.0, 6.0, 5.0, 3.0), "no ground called 'watr'; did you mean 'water'"),
    (Paint("brushes", "run", 5.0, 5.0, 6.0, 5.0, 3.0), "no layer 'brushes'; did you mean 'brush'"),
    (Paint("brush", "run", 5.0, 5.0, 6.0, 5.0, -3.0), "radius must be 0 to 1e+06 m, got -3"),
    (Paint("brush", "run", 5.0, 5.0, 6.0, 5.0, 3.0, 2.0), "softness must be 0 to 1, got 2"),
    (Paint("brush", "run", 5.0, 5.0, 6e9, 5.0, 3.0), "not on the map"),
    (Paint("surface", "deep water", 20.0, 20.0, 20.0, 20.0, 60.0), "has no room to step aside"),
    (PaintCells("brush", ["run"], [[5, 38, 3, 0]]), "leaves the map, which has 40 x 40 cells"),
    (PaintCells("brush", ["run"], [[5, 3, 3, 1]]), "has no name; there are 1"),
    (PaintCells("brush", ["run"], [[5, 3, 3]]), "four whole numbers"),
    (PaintCells("brush", ["run"], [[5, 3, 3, 0], [5, 5, 1, 0]]), "two runs meet in row 5, column 5"),
    (PaintCells("brush", ["rnu"], [[5, 3, 3, 0]]), "no brush 'rnu'"),
    (AddObstacle("all", box(-1, -1, 41, 41).tolist(), id=50), "has no room to step aside"),
    (AddObstacle("odd", None, id=50), "obstacle 'odd' needs points: there is no obstacle 50 in this world"),
    (PlaceGoal(50, "odd", None, None), "goal 'odd' needs x and y"),
    (PlaceGoal(21, "gate", 3.0, None), "goal 'gate' needs x and y"),
    (PlaceGoal(21, "gate", 3.0, 3.0, points=SQUARE), "must be the middle of the points, (13.5, 21.5), or left out"),
    (AddObstacle("odd", SQUARE, id=50, margin=-1.0), "margin must be 0 to 1000 m, got -1"),
    (RemoveObstacle(id=77), "no obstacle 77 in this world"),
    (DrawGuide(40, "way", [[5.0, 5.0]]), "a guide needs at least two different points, got 1"),
    (DrawGuide(40, "way", [[5.0, 5.0], [5.0, 5.0]]), "at least two different points"),
    (DrawGuide(40, "way", [[5.0, 5.0], [9.0, 5.0]], goal="gaet"), "no goal 'gaet'; did you mean 'gate'"),
    (DrawGuide(40, "way", [[50.0, 5.0], [90.0, 5.0]]), "the guide is not on the map"),
    (DrawGuide(40, "way", [[5.0, 5.0], [9.0, 5.0]], radius=-1.0), "radius must be 0 to"),
    (DrawGuide(0, "way", [[5.0, 5.0], [9.0, 5.0]]), "id must be at least 1, got 0"),
    (PlaceGoal(40, "pen", 5.0, 5.0, 1.0, "next", "wel"), "next: there is no goal 'wel'; did you mean 'well'"),
    (PlaceGoal(40, "pen", 5.0, 5.0, 1.0, "next"), "so next must name a goal"),
    (PlaceGoal(40, "pen", 5.0, 5.0, 1.0, "stay", "well"), "on_arrive must be 'next', got 'stay'"),
    (PlaceGoal(40, "pen", 5.0, 5.0, 1.0, "rest"), "must be one of stay, despawn, next, disperse, got 'rest'"),
    (PlaceGoal(40, "gate", 5.0, 5.0), "a goal named 'gate' already exists"),
    (PlaceGoal(40, "pen", 50.0, 5.0), "(50, 5) is not on the map"),
    (PlaceExit(40, "out", [[0.0, 0.0], [1.0, 1.0]]), "an exit has 3 to 2000 points, got 2"),
    (MarkSpawn(40, "pen", SQUARE, "rnu", count=3), "no brush 'rnu'"),
    (MarkSpawn(40, "pen", SQUARE, "run"), "count must be at least 1, got 0"),
    (MarkSpawn(40, "pen", SQUARE, "run", count=400), "of 400 animals fit"),
    (MarkSpawn(40, "pen", box(38, 38, 44, 44).tolist(), "run", count=4), "the spawn reaches off the map"),
    (RemoveThing("goal", 77), "there is no goal 77 in this world"),
    (RemoveThing("gaol", 21), "there is no 'gaol' to remove; did you mean 'goal'"),
    (UseBrush("bad", "schema = 3"), "bad.brush.toml"),
    (UseBrush("../run", RUN), "name must be letters, digits, - and _, at most 64, got '../run'"),
    (UseBrush("a/run", RUN), "name must be letters, digits, - and _, at most 64, got 'a/run'"),
    (UseBrush("run a", RUN), "name must be letters, digits, - and _, at most 64, got 'run a'"),
    (UseProgram("a/small", PROGRAM), "name must be letters, digits, - and _, at most 64, got 'a/small'"),
]


@pytest.mark.parametrize(("command", "reason"), BAD, ids=lambda value: str(value)[:50])
def test_what_cannot_be_done_says_why_and_changes_nothing(command, reason):
    simulation = scene()
    simulation.run(3)
    before = state_hash(simulation.world)
    with pytest.raises(CommandError) as caught:
        do(simulation, command)
    assert reason in str(caught.value)
    assert state_hash(simulation.world) == before
    assert simulation.world.resource(Commands).log == []
    simulation.run(2)


def test_a_goal_that_others_lead_to_stays():
    simulation = scene()
    do(simulation, PlaceGoal(30, "pen", 20.0, 30.0, 1.0, "next", "well"))
    do(simulation, DrawGuide(40, "way", [[5.0, 5.0], [9.0, 5.0]], goal="gate"))
    for command, reason in (
        (RemoveThing("goal", 22), "goal 'pen' leads to goal 'well'; change that first"),
        (PlaceGoal(21, "door", 5.0, 5.0), "guide 'way' leads to goal 'gate'; change that first"),
    ):
        with pytest.raises(CommandError, match=reason):
            do(simulation, command)

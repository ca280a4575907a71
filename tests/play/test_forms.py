"""Forms made from commands: properties of things of the level, and commands of scripts given by hand."""

import numpy as np
import pytest
from flockbrush.behaviours.program import shipped_programs
from flockbrush.components import Leading, Position
from flockbrush.levels.reader import read_level
from flockbrush.systems.commands import MoveObstacle
from flockbrush.systems.edits import MarkSpawn, MoveGoal, PlaceGoal
from flockbrush.systems.palette import Palette
from flockbrush.systems.programs import Programs
from window import pygame

from flockbrush.studio.forms import blank, changed, live_commands, rows_of


def fill(window, **texts):
    """Write into fields of the form, and accept it."""
    for name, text in texts.items():
        window.dialog.entries[name].set_text(text)
    window.key("return")
    window.frames(2)


def test_units_and_meanings_of_a_form_are_those_of_the_level_schema():
    rows = {row.name: row for row in rows_of(MarkSpawn(3, "herd", [], "graze", heading=np.pi / 2), "Spawn")}
    assert rows["altitude"].label == "altitude, m" and rows["altitude"].tip
    assert rows["heading"].text == "90" and "points" not in rows and "id" not in rows


def test_texts_of_a_form_become_fields_and_wrong_ones_are_named():
    spawn = MarkSpawn(3, "herd", [[0, 0], [1, 0], [1, 1]], "graze", count=4)
    told = changed(spawn, {"depth": "12.5", "heading": "180", "speed": "", "count": "7"})
    assert (told.depth, told.heading, told.speed, told.count) == (12.5, np.pi, None, 7)
    for texts, said in (({"count": "many"}, "count must be a number"), ({"count": "1.5"}, "whole number")):
        with pytest.raises(ValueError, match=said):
            changed(spawn, texts)


def test_commands_of_scripts_begin_where_the_mouse_is():
    known = live_commands()
    assert {"Appoint", "Gust", "Migrate", "MoveObstacle", "SendTo", "Steer"} <= set(known)
    assert not {"PutColumns", "UseBrush", "Paint"} & set(known)
    gust = blank(known["Gust"], (3.0, 4.0))
    assert (gust.x, gust.at_x, gust.at_y) == (0.0, 3.0, 4.0)
    assert "m/s" in rows_of(gust)[0].tip and "`" not in rows_of(gust)[0].tip
    for kind in known.values():
        rows = rows_of(blank(kind, (1.0, 2.0)))
        assert rows and all(row.tip for row in rows)


def test_a_chain_of_goals_is_made_in_the_window_undone_and_saved(window, tmp_path):
    window.key("h")
    window.click((5, 3))
    window.click((20, 13))
    one, two = window.land.goals[-2:]
    window.key("v")
    window.click(tuple(one.xy))
    window.key("p")
    assert window.dialog is not None and "next" in window.dialog.entries
    fill(window, on_arrive="next", next=two.name)
    assert {goal.name: goal.next for goal in window.land.goals}[one.name] == two.name
    window.key("ctrl+z")
    window.frames(2)
    assert not any(goal.next for goal in window.land.goals)
    window.key("ctrl+y")
    window.frames(2)
    assert window.session.save(tmp_path / "chain.tmj")
    saved = {goal.name: goal.next for goal in read_level(tmp_path / "chain.tmj").goals}
    assert saved[one.name] == two.name


def test_the_letter_that_opens_a_form_is_not_typed_into_it(window):
    def press(kind):
        window.post(kind, key=pygame.K_k, mod=0, unicode="k")

    press(pygame.KEYDOWN)
    first = next(iter(window.dialog.entries.values()))
    before = first.get_text()
    window.post(pygame.TEXTINPUT, text="k")
    press(pygame.KEYDOWN)  # it is held, and repeats
    window.post(pygame.TEXTINPUT, text="k")
    assert first.get_text() == before
    press(pygame.KEYUP)
    window.post(pygame.TEXTINPUT, text="k")
    assert first.get_text() == "k"


def test_what_a_form_cannot_take_is_said_and_the_form_stays(window):
    window.key("h")
    window.click((5, 3))
    window.key("v")
    window.click((5, 3))
    window.key("p")
    fill(window, radius="wide")
    assert window.dialog.alive() and window.said("error")
    window.key("escape")
    window.frames(2)
    assert window.dialog is None or not window.dialog.alive()


def test_an_obstacle_is_moved_by_a_command_given_in_the_window(window):
    name = window.land.barriers[0].name
    before = window.land.barriers[0].polygon.mean(0)
    window.ask_command("MoveObstacle", (float(before[0]) - 2, float(before[1])))
    window.frames(2)
    fill(window, name=name)
    window.session.play()
    window.frames(6)
    after = next(barrier for barrier in window.land.barriers if barrier.name == name).polygon.mean(0)
    assert after == pytest.approx(before - (2, 0), abs=0.05)
    assert window.said("error") == []


def test_leaders_are_appointed_and_steered_by_commands_given_in_the_window(window):
    at = window.session.simulation.agents[Position.xyz][0, :2].tolist()
    window.ask_command("Appoint", at)
    window.frames(2)
    fill(window, radius="0.01")
    assert led(window).sum() == 1
    window.ask_command("Steer", at)
    window.frames(2)
    fill(window, kind="place", x="12", y="9")
    assert window.said("error") == []
    leader = np.flatnonzero(led(window))[0]
    assert window.session.simulation.agents[Leading.target][leader].tolist() == [12.0, 9.0]
    window.session.undo()
    window.session.undo()
    assert not led(window).any()


def led(window):
    """(n,) bool: who is appointed."""
    window.frames(2)
    return window.session.simulation.agents[Leading.appointed] > 0


def test_tab_goes_from_field_to_field_and_changes_no_brush(window):
    brush = window.brush
    window.key("k")
    assert window.dialog.menu is not None
    first, second = list(window.dialog.entries)[:2]
    window.key("tab")
    assert window.dialog.entries[second] in window.manager.get_focus_set()
    window.key("shift+tab")
    assert window.dialog.entries[first] in window.manager.get_focus_set()
    assert window.brush == brush
    window.key("escape")
    assert len(window.agents[Position.xyz])


def test_forms_load_the_brushes_and_programs_that_they_name(window, tmp_path):
    world = window.session.simulation.world
    window.key("v")
    window.click((3, 6))  # the edge of the spawn area
    assert window.tool.thing[0] == "spawn"
    window.key("p")
    fill(window, brush="no-such")
    assert "there is no brush 'no-such'" in window.said("error").pop() and window.dialog.alive()
    fill(window, brush="stampede", program="no-such")
    assert "there is no program 'no-such'" in window.said("error").pop()
    fill(window, program="stampede")
    window.ask_command("AddAnimals", (20.0, 3.0))
    fill(window, brush="graze", radius="3", species="sheep", count="2", program="merino")
    window.ask_command("SwitchBrush", (20.0, 3.0))
    fill(window, brush="column")
    assert set(world.resource(Programs).names) == {"stampede", "merino"}
    brushes = {"stampede", "column", *shipped_programs().get("merino").brushes}
    assert brushes <= set(world.resource(Palette).index)
    window.ask_key((5.0, 5.0), name="GiveProgram")
    fill(window, program="sheepdog")
    assert "sheepdog" in world.resource(Programs).names and len(window.land.marks.keys) == 1
    assert window.session.save(tmp_path / "named.tmj")
    spawn = read_level(tmp_path / "named.tmj").spawns[0]
    assert (spawn.brush, spawn.program) == ("stampede", "stampede")
    for _ in range(4):
        window.key("ctrl+z")
    assert world.resource(Programs).names == [] and "stampede" not in world.resource(Palette).index


def test_what_the_script_has_moved_stays_in_the_file_where_it_was_when_a_property_changes(window, tmp_path):
    window.do("a goal", [PlaceGoal(window.new_id(), "well", 5.0, 13.0, 1.0)])
    assert window.session.save(tmp_path / "moved.tmj")
    before = window.session.editor.text()
    window.session.timeline.perform([MoveObstacle("stone", 19.0, 9.0, 3.0), MoveGoal("well", 9.0, 3.0)])
    window.session.step(1)
    assert not window.session.dirty
    window.move((12, 15))
    window.key("p")
    assert "first click an object" in window.said()[-1]
    for place, row, value in (((19, 9.5), "margin", "0.5"), ((9, 3), "radius", "2")):
        window.key("v")
        window.click(place)
        window.key("p")
        fill(window, **{row: value})
    (stone,), (goal,) = window.land.obstacles, window.land.goals
    assert (stone.polygon.mean(0).tolist(), stone.z_min, stone.margin) == ([19.0, 9.0], 3.0, 0.5)
    assert (goal.xy.tolist(), goal.radius) == ([9.0, 3.0], 2.0)
    window.session.save(tmp_path / "moved.tmj")
    level = read_level(tmp_path / "moved.tmj")
    (stone,), (goal,) = level.obstacles, level.goals
    assert (stone.polygon.mean(0).tolist(), stone.z_min, stone.margin) == ([16.0, 8.0], 0.0, 0.5)
    assert (goal.xy.tolist(), goal.radius) == ([5.0, 13.0], 2.0)
    window.key("ctrl+z")
    window.key("ctrl+z")
    assert window.session.editor.text() == before
    assert window.land.obstacles[0].polygon.mean(0).tolist() == [19.0, 9.0]
    assert window.said("error") == []

"""Every tool, used with the mouse: what it does to the ground, to things and to animals."""

import numpy as np
import pytest
from flockbrush.behaviours.behaviour import behaviours
from flockbrush.behaviours.brush import shipped
from flockbrush.behaviours.program import shipped_programs
from flockbrush.components.agent import Alarm, Species
from flockbrush.levels.geometry import sign_of
from flockbrush.levels.reader import read_level
from flockbrush.systems.edits import PlaceGoal, UseBrush
from flockbrush.systems.population import SpeciesList
from flockbrush.systems.program_commands import GiveProgram, UseProgram

from flockbrush.studio.tools import TOOLS
from flockbrush.studio.tools.world_tools import outline, touches


@pytest.fixture(autouse=True)
def no_errors(window):
    yield
    assert window.said("error") == []


def obstacles(window):
    return {barrier.name: barrier for barrier in window.land.barriers}


def guides(window):
    return {guide.name: np.round(guide.points, 1).tolist() for guide in window.land.guides}


def goals(window):
    return {goal.name: goal for goal in window.land.goals}


# the ground --------------------------------------------------------------------------


def test_brushes_of_ones_own_come_before_those_that_are_shipped(window):
    assert window.brush_names()[0] != "zigzag"
    window.session.save_brush(shipped().get("march").model_copy(update={"name": "zigzag"}))
    assert window.brush_names() == ["zigzag", *(name for name in window.brush_names() if name != "zigzag")]
    assert set(shipped().names()) < set(window.brush_names())


def test_a_speed_limit_is_painted_and_erased(window):
    window.key("c")
    window.choose("cap", 0.5)
    window.drag((4, 13), (8, 13))
    assert window.cap((6, 13)) == 0.5
    window.key("e")
    window.drag((4, 13), (8, 13))
    assert window.cap((6, 13)) == np.inf


def test_whom_paint_does_not_bind_is_told_once(window):
    window.drag((4, 13), (8, 13))
    assert window.said("info") == []
    source = shipped_programs().get("merino").source.decode()
    brushes = [UseBrush(name, shipped().get(name).source.decode()) for name in shipped_programs().get("merino").brushes]
    window.do("program", [*brushes, UseProgram("merino", source), GiveProgram("merino")])
    window.frames(3)
    window.drag((4, 15), (8, 15))
    window.drag((4, 16), (8, 16))
    animals = len(window.session.simulation.agents)
    told = f"Paint does not bind {animals} animals: the states of their program choose their brushes."
    assert [text for text in window.said("info") if text.startswith("Paint")] == [told]


def test_a_surface_is_painted(window):
    window.key("s")
    window.choose("surface", "mud")
    window.drag((4, 13), (8, 13))
    assert window.ground((6, 13)) == "mud"


def test_the_eraser_leaves_surfaces_unless_told(window):
    window.key("e")
    window.drag((12, 13), (14, 13))
    assert window.ground((13, 13)) == "grass"
    window.set_option("erase", "surface")
    window.drag((12, 13), (14, 13))
    assert window.ground((13, 13)) is None


def test_the_eraser_takes_things_away_that_it_touches(window):
    window.key("e")
    window.click((16, 8))
    assert obstacles(window) == {} and guides(window) == {}
    window.key("ctrl+z")
    assert set(obstacles(window)) == {"stone"} and set(guides(window)) == {"way"}


def test_filling_covers_all_of_a_region_and_no_more(window):
    window.choose("brush", "graze")
    window.drag((12, 1), (12, 15), steps=20)
    window.key("f")
    window.choose("brush", "swarm")
    window.click((20, 3))
    assert window.painted((23, 15)) == "swarm" and window.painted((12, 8)) == "graze"
    assert window.painted((2, 2)) is None
    window.choose("brush", "column")
    window.click((20, 3))
    assert window.painted((23, 15)) == "column"
    window.key("ctrl+z")
    assert window.painted((23, 15)) == "swarm"
    assert "column" not in window.world_palette().index


def test_filling_works_with_speed_limits_too(window):
    window.key("f")
    window.set_option("layer", "cap")
    window.choose("cap", 2.0)
    window.click((20, 3))
    assert window.cap((1, 1)) == 2.0


def test_picking_takes_what_is_painted_into_the_hand(window):
    window.choose("brush", "graze")
    window.drag((18, 3), (20, 3))
    window.choose("brush", "swarm")
    window.key("i")
    window.click((19, 3))
    assert (window.brush, window.tool.name) == ("graze", "brush")


def test_picking_an_animal_takes_its_behaviour(window):
    window.choose("brush", "swarm")
    window.key("i")
    window.click(window.standing()[0])
    assert window.brush == "march"


def test_the_right_button_picks_while_one_paints(window):
    window.choose("brush", "graze")
    window.drag((18, 3), (20, 3))
    window.choose("brush", "swarm")
    window.click((19, 3), button=3)
    assert window.brush == "graze"


# things --------------------------------------------------------------------------------


def test_an_obstacle_is_drawn_with_a_round_pen(window):
    window.key("o")
    window.set_size(0.6)
    window.drag((10, 2), (14, 2))
    (x, y), (x2, y2) = (bound(obstacles(window)["obstacle 1"].polygon, axis=0) for bound in (np.min, np.max))
    assert np.allclose((x, y, x2, y2), (9.4, 1.4, 14.6, 2.6), atol=0.25)


def test_a_ring_of_stones_leaves_its_inside_free(window):
    window.key("o")
    window.set_size(0.5)
    turn = np.linspace(0, 2 * np.pi, 30)
    window.drag(*np.stack([18 + 2.5 * np.cos(turn), 12 + 2.5 * np.sin(turn)], axis=1), steps=2)
    assert len(obstacles(window)) > 2
    window.key("n")
    window.set_size(0.5)
    window.options["count"] = 1
    window.click((18, 12))
    assert np.hypot(*(window.standing()[-1] - (18, 12))) < 1


def test_a_rectangle_is_drawn_from_corner_to_corner(window):
    window.key("o")
    window.set_option("shape", "rectangle")
    window.drag((10, 2), (13, 4))
    assert np.allclose(np.ptp(obstacles(window)["obstacle 1"].polygon, axis=0), (3, 2), atol=0.1)


@pytest.mark.parametrize("end", ["return", "first corner", "double click", "right button"])
def test_a_polygon_is_clicked_together(window, end):
    window.key("o")
    window.set_option("shape", "polygon")
    for corner in ((10, 2), (13, 2), (13, 5)):
        window.click(corner)
        window.frames(20)
    if end == "return":
        window.key("return")
    elif end == "first corner":
        window.click((10, 2))
    elif end == "double click":
        window.click((13, 5))
        window.click((13, 5))
    else:
        window.click((5, 5), button=3)
    assert len(obstacles(window)["obstacle 1"].polygon) == 3


def test_a_half_drawn_polygon_is_dropped_with_escape_and_shortened_with_backspace(window):
    window.key("o")
    window.set_option("shape", "polygon")
    for corner in ((10, 2), (13, 2), (13, 5), (11, 9)):
        window.click(corner)
    window.key("backspace")
    assert len(window.tool.points) == 3
    window.key("escape")
    window.key("return")
    assert set(obstacles(window)) == {"stone"}


def test_an_obstacle_may_be_one_that_only_hides(window):
    window.key("o")
    window.push(next(box for box, name in window.toolbox.switches.items() if name == "solid"))
    window.drag((10, 2), (12, 2))
    assert (obstacles(window)["obstacle 1"].solid, obstacles(window)["obstacle 1"].blocks_view) == (False, True)


def test_a_guide_is_drawn_in_one_go(window):
    window.key("g")
    window.drag((3, 3), (8, 3), (12, 5))
    points = guides(window)["guide 1"]
    assert np.allclose(points[0], (3, 3), atol=0.2) and np.allclose(points[-1], (12, 5), atol=0.2)
    assert len(points) < 6


def test_a_guide_is_clicked_together(window):
    window.key("g")
    for point in ((3, 3), (8, 3), (12, 5)):
        window.click(point)
        window.frames(20)
    window.key("return")
    assert np.allclose(guides(window)["guide 1"], [(3, 3), (8, 3), (12, 5)], atol=0.2)


def test_a_guide_is_reshaped_by_its_points(window):
    window.key("g")
    window.drag((21, 8), (21, 12))
    assert np.allclose(guides(window)["way"], [(3, 8), (21, 12)], atol=0.2)


def test_a_new_point_comes_where_one_pulls_a_guide(window):
    window.key("g")
    window.drag((10, 8), (10, 5))
    assert np.allclose(guides(window)["way"], [(3, 8), (10, 5), (21, 8)], atol=0.2)
    window.drag((10, 5), (10, 4))
    assert len(guides(window)["way"]) == 3


@pytest.mark.parametrize("how", ["delete", "right button"])
def test_a_point_is_taken_out_of_a_guide(window, how):
    window.key("g")
    window.drag((10, 8), (10, 5))
    if how == "delete":
        window.move((10, 5))
        window.key("delete")
    else:
        window.click((10, 5), button=3)
    assert np.allclose(guides(window)["way"], [(3, 8), (21, 8)], atol=0.2)


def test_a_guide_of_two_points_goes_with_one_of_them(window):
    window.key("g")
    window.click((21, 8), button=3)
    assert guides(window) == {}


def test_a_goal_is_placed_and_moved(window):
    window.key("h")
    window.drag((10, 3), (12, 3))
    assert abs(goals(window)["goal 1"].radius - 2) < 0.2
    window.drag((10, 3), (15, 4))
    assert np.allclose(goals(window)["goal 1"].xy, (15, 4), atol=0.2)
    assert abs(goals(window)["goal 1"].radius - 2) < 0.2


def test_a_goal_that_is_clicked_can_be_seen(window):
    window.key("h")
    window.click((10, 3))
    assert goals(window)["goal 1"].radius >= 1


def test_animals_leave_through_an_exit(window):
    window.key("x")
    window.drag((3, 5), (9, 11))
    window.session.play()
    window.frames(3)
    assert len(window.agents) < 9


def test_animals_are_born_in_a_spawn_area(window):
    window.key("a")
    window.choose("brush", "graze")
    window.options["count"] = 5
    window.drag((12, 2), (18, 5))
    assert len(window.agents) == 14
    newborn = window.standing()[9:]
    assert (newborn >= (11.9, 1.9)).all() and (newborn <= (18.1, 5.1)).all()


# animals ---------------------------------------------------------------------------------


def test_animals_are_added_and_taken_away(window):
    window.key("n")
    window.choose("brush", "graze")
    window.options["count"] = 4
    window.click((18, 13))
    assert len(window.agents) == 13
    window.key("r")
    window.click((18, 13))
    assert len(window.agents) == 9
    window.key("ctrl+z")
    assert len(window.agents) == 13


def species_of(window):
    """Species of every animal, in the order of their birth."""
    known = window.session.simulation.world.resource(SpeciesList).names
    return [known[k] for k in window.agents[Species.index]]


def test_a_predator_is_put_down_once_a_click(window):
    window.key("w")
    window.drag((18, 13), (20, 13))
    assert len(window.agents) == 10
    model = window.find_brush(window.behaviour()[-1]).model
    assert behaviours()[model].danger


def test_the_predator_of_sheep_is_no_falcon_and_another_one_can_be_chosen(window):
    window.key("w")
    names = list(window.choices("hunter"))
    assert {"wolf", "lion", "falcon"} <= set(names)
    assert names[0] in ("wolf", "lion") and names[-1] == "falcon"
    assert list(window.toolbox.menus.values()) == ["hunter"]
    window.set_option("hunter", "wolf")
    window.click((20, 12))
    window.set_option("hunter", "falcon")
    window.click((4, 12))
    assert species_of(window)[-2:] == ["wolf", "falcon"]
    assert window.behaviour()[-2:] == ["wolf-hunt", "falcon"]


def test_a_predator_is_in_the_level_and_hunts_on_painted_ground(window):
    window.key("b")
    window.choose("brush", "swarm")
    window.drag((18, 13), (20, 13))
    assert window.painted((19, 13)) == "swarm"
    window.key("w")
    window.set_option("hunter", "wolf")
    window.click((19, 13))
    window.session.play()
    window.frames(8)
    assert (window.behaviour()[-1], species_of(window)[-1]) == ("wolf-hunt", "wolf")
    assert window.session.save()
    spawn = read_level(window.session.path).spawns[-1]
    assert (spawn.species, spawn.brush, spawn.count, spawn.name) == ("wolf", "wolf-hunt", 1, "wolf 1")
    window.key("ctrl+z")
    assert len(window.agents) == 9


def test_sheep_run_from_a_wolf_that_was_put_down(window):
    window.session.play()
    window.frames(4)
    window.key("w")
    window.set_option("hunter", "wolf")
    x, y = window.standing().mean(axis=0)
    window.click((x + 5.5, y))
    window.frames(30)
    agents = window.agents
    sheep = np.array(species_of(window)) == "sheep"
    assert (agents[Alarm.level][sheep] > 0).sum() >= 5


def test_added_animals_say_when_the_ground_gives_them_another_brush(window):
    window.key("b")
    window.choose("brush", "swarm")
    window.drag((18, 13), (20, 13))
    window.key("n")
    window.choose("brush", "graze")
    window.options["count"] = 3
    window.click((8, 3))
    assert not any("painted" in text for text in window.said())
    window.click((19, 13))
    assert [text for text in window.said() if "the ground here is painted with swarm" in text]


def test_an_animal_is_selected_and_let_go(window):
    window.key("v")
    window.click(window.standing()[4])
    assert window.selected == window.agents.ids[4]
    window.click((20, 2))
    assert window.selected is None


def test_a_thing_is_selected_and_deleted(window):
    window.key("v")
    window.click((16, 8.7))
    window.key("delete")
    assert obstacles(window) == {}


def test_a_goal_is_moved_with_the_select_tool(window):
    window.key("h")
    window.click((10, 3))
    window.key("v")
    window.drag((10, 3), (12, 4))
    assert np.allclose(goals(window)["goal 1"].xy, (12, 4), atol=0.2)


def test_a_goal_that_lies_around_a_place_is_held_by_its_flag_and_edge_and_not_in_the_middle(window):
    ring = [[4, 3], [20, 3], [20, 13], [4, 13], [4, 9], [6, 9], [6, 11], [18, 11], [18, 5], [6, 5], [6, 7], [4, 7]]
    assert window.session.do("ring", [PlaceGoal(window.session.editor.new_id(), "ring", None, None, points=ring)])
    goal = goals(window)["ring"]
    assert touches("goal", goal, sign_of(goal), 0.1) and touches("goal", goal, np.array([20.0, 8.0]), 0.1)
    assert not touches("goal", goal, np.array([12.0, 8.0]), 0.1)
    assert np.array_equal(outline("goal", goal)[0], ring)
    at = sign_of(goal)
    window.key("v")
    window.drag(tuple(at), tuple(at + [1.0, 0.5]))
    assert np.allclose(goals(window)["ring"].polygon, np.array(ring) + [1.0, 0.5], atol=0.2)


def test_a_goal_that_is_dragged_is_shown_as_it_will_lie(window, monkeypatch):
    triangle = np.array([[4.0, 3.0], [9.0, 3.0], [4.0, 8.0]])
    assert window.session.do("a", [PlaceGoal(window.new_id(), "area", None, None, points=triangle.tolist())])
    assert window.session.do("b", [PlaceGoal(window.new_id(), "place", 16.0, 10.0, 2.0)])
    window.key("h")
    shown = []
    monkeypatch.setattr(window.tool, "path", lambda *how: shown.append((how[2], how[4])))
    for name in ("area", "place"):
        at, around = sign_of(goals(window)[name]), outline("goal", goals(window)[name])[0]
        window.drag(tuple(at), tuple(at + [1.0, 0.5]), tuple(at + [3.0, 1.0]))
        assert shown and all(closed for _, closed in shown)
        assert np.allclose(shown[-1][0], around + [3.0, 1.0], atol=0.2)
        assert np.allclose(outline("goal", goals(window)[name])[0], shown[-1][0], atol=0.2)
        shown.clear()


# all of them -----------------------------------------------------------------------------


@pytest.mark.parametrize("kind", TOOLS, ids=lambda kind: kind.name)
def test_a_tool_is_taken_by_key_and_by_button_and_says_what_to_do(window, kind):
    other = "b" if kind.key != "b" else "v"
    window.key(other)
    window.key(kind.key)
    assert window.tool.name == kind.name and window.hint.said
    window.key(other)
    button = next(button for button, name in window.toolbox.tools.items() if name == kind.name)
    window.push(button)
    assert window.tool.name == kind.name
    assert kind.tip in button.tool_tip_text


def test_a_tool_used_outside_the_map_does_no_harm(window):
    window.canvas.zoom(0.3)
    for kind in TOOLS:
        for far in ((-9.0, -9.0), (60.0, 8.0)):
            window.take_tool(kind.name)
            window.drag(far, (far[0] + 3, far[1]), steps=2)
            window.key("escape")
    assert window.running and len(window.agents) == 9
    assert not any("this failed" in text for text in window.said())
    window.toasts.log.clear()


def test_a_tool_that_breaks_says_so_and_the_window_goes_on(window, monkeypatch):
    for kind in TOOLS:
        monkeypatch.setattr(kind, "press", lambda *_, name=kind.name: {}[f"{name} broke"])
        window.take_tool(kind.name)
        window.click((12, 8))
        assert f"{kind.name} broke" in window.said("error")[-1]
    window.toasts.log.clear()
    window.frames(2)
    assert window.running


# clumsy hands --------------------------------------------------------------------------


def test_a_question_in_the_middle_of_a_stroke_ends_it(window):
    window.choose("brush", "graze")
    window.press((12, 3))
    window.ask("?", "Really?", [("Yes", None)])
    window.release((12, 3))
    window.key("return")
    window.move((20, 12))
    assert window.painted((12, 3)) == "graze" and window.painted((20, 12)) is None


def test_obstacles_drawn_off_the_map_are_none(window):
    before = set(obstacles(window))
    window.key("o")
    window.drag((-20, 3), (-16, 9))
    window.set_option("shape", "rectangle")
    window.drag((30, 3), (40, 9))
    assert set(obstacles(window)) == before and not window.session.dirty

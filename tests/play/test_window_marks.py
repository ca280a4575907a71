"""Zones, counting lines and measured areas in the window: drawn, moved, changed, taken away, undone and saved."""

import numpy as np
import pytest
from flockbrush.behaviours.mixture import is_step
from flockbrush.levels.reader import read_level
from flockbrush.systems.mark_commands import PlaceKey
from flockbrush.systems.palette import Palette
from small_pasture import pasture, verified
from window import Window

from flockbrush.studio.tools.world_tools import moved, things


@pytest.fixture
def window(tmp_path, in_own_folder):
    window = Window(pasture(tmp_path, script=False))
    window.set_option("shape", "rectangle")
    yield window
    window.close()


def saved(window, tmp_path):
    assert window.session.save(tmp_path / "marked.tmj")
    return read_level(tmp_path / "marked.tmj")


def test_a_zone_is_drawn_moved_changed_saved_and_taken_back(window, tmp_path):
    window.key("u")
    window.drag((1, 3), (11, 12))
    (zone,) = window.land.marks.zones
    assert (zone.brush, window.painted((6, 8))) == (window.brush, window.brush)
    window.key("v")
    window.drag((1, 5), (1.5, 5.5))  # by its edge
    (moved,) = window.land.marks.zones
    assert moved.polygon == pytest.approx(zone.polygon + 0.5, abs=0.1)
    window.click((1.5, 7))
    window.key("p")
    window.dialog.entries["max_speed"].set_text("0.5")
    window.dialog.entries["event"].set_text("in the pen")
    window.key("return")
    window.frames(2)
    assert window.cap((7, 9)) == 0.5
    (told,) = saved(window, tmp_path).zones
    assert (told.max_speed, told.event, told.brush) == (0.5, "in the pen", window.brush)
    assert told.polygon == pytest.approx(moved.polygon, abs=1e-3)
    for _ in range(3):
        window.key("ctrl+z")
    window.frames(2)
    assert window.land.marks.zones == [] and window.painted((6, 8)) is None and saved(window, tmp_path).zones == []
    assert window.said("error") == []


def test_properties_are_those_of_the_smallest_area_around_the_mouse(window):
    window.key("u")
    window.drag((11, 1), (23, 15))
    window.drag((18, 10), (22, 14))
    large, small = window.land.marks.zones
    for at, zone in (((20, 12), small), ((13, 12), large)):
        window.move(at)
        window.frames(1)
        window.key("p")
        assert window.dialog.entries["name"].get_text() == zone.name
        window.key("escape")
        window.frames(2)
    assert window.said("error") == []


def test_a_zone_mixes_live_acts_at_once_is_taken_back_and_replays(window, tmp_path):
    window.key("u")
    window.drag((1, 3), (11, 12))
    window.key("v")
    palette = window.session.simulation.world.resource(Palette)
    own = [brush.name for brush in palette.own]
    for strength in ("0.5", "0.25"):
        window.click((1, 7))
        window.key("p")
        window.dialog.entries["strength"].set_text(strength)
        window.key("return")
        window.frames(2)
        (zone,) = window.land.marks.zones
        assert (zone.bounds.strength, zone.bounds.blend) == (float(strength), "mix")
        assert zone.brush in palette.over and [brush.name for brush in palette.own] == own
        window.session.step(8)
    window.key("ctrl+z")
    window.frames(2)
    assert window.land.marks.zones[0].bounds.strength == 0.5
    window.session.step(8)
    assert saved(window, tmp_path).zones[0].bounds.strength == 0.5
    window.session.export_recording(tmp_path / "mixed.flock")
    names = [type(command).__name__ for _, command in verified(tmp_path / "mixed.flock").commands]
    assert names.count("MixBrush") == 1
    assert window.said("error") == []


def test_a_mixed_animal_is_picked_with_the_brush_of_the_zone_and_paints_what_a_file_can_say(window, tmp_path):
    window.key("u")
    window.choose("brush", "swarm")
    window.drag((1, 3), (23, 13))
    window.key("v")
    window.click((1, 7))
    window.key("p")
    window.dialog.entries["strength"].set_text("0.5")
    window.key("return")
    window.session.step(2)
    assert set(map(is_step, window.behaviour())) == {True}
    window.choose("brush", "graze")
    window.key("i")
    window.click(window.standing()[0])
    assert window.brush == "swarm"
    window.drag((20, 14), (22, 14))
    assert saved(window, tmp_path).brush_layers[-1].assets == ["swarm"]


def test_a_line_and_an_area_are_drawn_reshaped_and_deleted(window, tmp_path):
    window.key("y")
    window.drag((13, 2), (13, 14))
    window.drag((13, 2), (14, 3))  # its first point
    assert window.land.marks.lines[0].points[0] == pytest.approx((14, 3), abs=0.1)
    window.key("m")
    window.drag((18, 10), (22, 14))
    level = saved(window, tmp_path)
    assert [thing.name for thing in (*level.lines, *level.areas)] == ["line 1", "area 1"]
    window.key("v")
    window.click((18, 12))
    window.key("delete")
    window.frames(2)
    assert window.land.marks.areas == [] and saved(window, tmp_path).areas == []
    assert window.said("error") == []


def test_what_was_drawn_is_in_the_recording(window, tmp_path):
    window.key("u")
    window.session.play()
    window.frames(4)
    window.drag((2, 4), (11, 12))
    window.frames(6)
    window.session.pause()
    window.session.export_recording(tmp_path / "drawn.flock")
    names = [type(command).__name__ for _, command in verified(tmp_path / "drawn.flock").commands]
    assert names.count("DrawZone") == 1


def test_a_script_key_of_a_direction_keeps_it_in_its_form_whatever_its_place_is(window, tmp_path):
    window.key("j")
    for command, x, texts in (("Gust", 12, {"x": "12", "y": "3"}), ("SwitchBrush", 16, {"x": "0"})):
        window.click((x, 3))
        window.dialog.choose(command)
        window.frames(2)
        for name, text in ({"when": "9", "brush": "swarm"} | texts).items():
            if name in window.dialog.entries:
                window.dialog.entries[name].set_text(text)
        window.key("return")
        window.frames(2)
    gust, switch = saved(window, tmp_path).script
    assert (gust.args["x"], gust.args["y"], gust.xy.tolist()) == (12.0, 3.0, pytest.approx([12.0, 3.0], abs=0.1))
    assert (switch.args["x"], switch.args["y"]) == (0.0, pytest.approx(3.0, abs=0.1))
    assert window.said("error") == []


def test_a_key_that_is_drawn_as_an_outline_moves_what_it_gives():
    args = {"id": 9, "name": "yard", "points": [[1.0, 1.0], [4.0, 1.0], [4.0, 4.0]]}
    key = moved(PlaceKey(40, "cue", 1.0, "DrawArea", args, 3.0, 2.0), np.array([2.0, 0.5]))
    assert (key.x, key.y, key.args["points"]) == (5.0, 2.5, [[3.0, 1.5], [6.0, 1.5], [6.0, 4.5]])


def test_a_script_key_is_placed_moved_changed_and_followed(window, tmp_path):
    window.key("j")
    window.click((12, 3))
    window.dialog.choose("SwitchBrush")
    window.frames(2)
    window.dialog.entries["when"].set_text("0.25")
    window.dialog.entries["brush"].set_text("swarm")
    window.key("return")
    window.frames(2)
    window.key("v")
    window.drag((12, 3), (14, 4))
    (key,) = saved(window, tmp_path).script
    assert (key.at, key.command, key.args["brush"]) == (0.25, "SwitchBrush", "swarm")
    assert key.xy == pytest.approx((14, 4), abs=0.1) and key.args.get("x", 14) == pytest.approx(14, abs=0.1)
    window.session.step(20)
    assert set(window.behaviour()) == {"swarm"}
    window.session.restart()
    window.session.step(20)
    assert set(window.behaviour()) == {"swarm"}
    window.key("j")
    window.click((14, 4))
    window.dialog.entries["when"].set_text("soon")
    window.key("return")
    assert window.said("error") and window.dialog.alive()
    window.dialog.entries["when"].set_text("9")
    window.key("return")
    window.frames(2)
    assert [key.at for key in window.land.marks.keys] == [9.0]
    for _ in range(3):
        window.key("ctrl+z")
    window.frames(2)
    assert saved(window, tmp_path).script == window.land.marks.keys == []


@pytest.mark.parametrize("key", ["u", "m"])
def test_the_pen_changes_with_the_key(window, key):
    window.set_option("shape", "pen")
    window.key(key)
    window.key(key)
    assert window.options["shape"] == "rectangle"


def test_a_stone_is_moved_by_its_middle(window):
    before = window.land.barriers[0].polygon
    window.key("v")
    window.drag((16, 8.7), (19, 11.7))
    assert window.land.barriers[0].polygon - before == pytest.approx(np.full((len(before), 2), 3.0), abs=0.1)


@pytest.mark.parametrize(
    ("key", "start", "end", "told"),
    [("g", (3, 4), (9, 4), "guide"), ("h", (9, 4), (9, 4), "goal"), ("y", (3, 4), (9, 4), "counting line")],
    ids=["guide", "goal", "line"],
)
def test_what_vanishes_while_it_is_dragged_is_said(window, key, start, end, told):
    window.session.step(2)
    window.key(key)
    window.drag(start, end)
    kind = window.tool.name
    window.session.step(2)
    window.press(end)
    window.move((12, 5))
    window.session.step(-3)
    window.move((12, 6))
    window.release((12, 6))
    assert window.said() == [f"this {told} is no longer there"]
    assert window.session.undo_label is None
    window.key("v")
    window.session.step(3)
    window.drag(end, (14, 6))
    moved = next(thing for one, thing in things(window.session.simulation)[::-1] if one == kind)
    assert np.allclose(moved.xy if kind == "goal" else moved.points.max(0), (14, 6), atol=0.2)

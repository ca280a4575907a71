"""A recording is edited in the window: what is shown is what exports write, and the recording stays as it is."""

import csv
import time

import numpy as np
import pytest
from small_pasture import pasture, stroke
from typer.testing import CliRunner
from window import Window, pygame

from flockbrush.cli.main import app as cli
from flockbrush.runs.edit_file import beside, edits_of
from flockbrush.studio.app import App
from flockbrush.studio.panels import OF_RECORDINGS
from flockbrush.studio.recorded_session import open_recorded

TICKS = 64


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """Two seconds of the pasture."""
    return two_seconds(tmp_path_factory.mktemp("recorded"), script=False)


def two_seconds(folder, **options):
    """The bytes of a recording of a new pasture."""
    made = folder / "walk.flock"
    ran = CliRunner().invoke(cli, ["run", str(pasture(folder, **options)), "--seconds", "2", "--record", str(made)])
    assert ran.exit_code == 0, ran.output
    return made.read_bytes()


@pytest.fixture
def recording(recorded, tmp_path):
    path = tmp_path / "walk.flock"
    path.write_bytes(recorded)
    return path


def opened(recording, state):
    window = Window.__new__(Window)
    App.__init__(window, open_recorded(recording, state), (1100, 700), "light")
    window.frames(2)
    return window


@pytest.fixture
def window(recording, tmp_path, monkeypatch):
    for name in ("FLOCKBRUSH_CONFIG", "FLOCKBRUSH_CACHE", "FLOCKBRUSH_STATE"):
        monkeypatch.setenv(name, str(tmp_path / name))
    monkeypatch.chdir(tmp_path)
    window = opened(recording, tmp_path / "state")
    window.key("d")
    yield window
    assert window.said("error") == []
    window.close()


@pytest.fixture
def exported(recording, tmp_path):
    """{(frame, id): (x, y)} of what an export writes."""

    def read():
        to = tmp_path / f"walk{len(list(tmp_path.glob('*.csv')))}.csv"
        ran = CliRunner().invoke(cli, ["export", str(recording), "--to", str(to)])
        assert ran.exit_code == 0, ran.output
        with to.open() as file:
            return {(round(32 * float(row["time"])), int(row["id"])): (float(row["x"]), float(row["y"]))
                    for row in csv.DictReader(file)}  # fmt: skip

    return read


def shown(window):
    """{id: (x, y)} of the animals on the canvas."""
    window.frames(1)
    herd = window.canvas.herd
    return dict(zip(herd.ids.tolist(), herd.xy[:, :2].tolist(), strict=True))


def go_to(window, tick):
    window.session.scrub(tick)
    window.frames(1)


def same_as_exported(window, exported, *ticks):
    told = exported()
    for tick in ticks:
        go_to(window, tick)
        herd = shown(window)
        assert herd.keys() == {animal for frame, animal in told if frame == tick}
        for animal, place in herd.items():
            assert place == pytest.approx(told[tick, animal], abs=2e-6), (tick, animal)


def panel(window):
    window.column.show_titled("Edits")
    window.frames(2)
    return window.column.panels[0]


def press(window, words):
    """Press a button of the panel."""
    made = panel(window)
    window.push(next(button for button in made.does if getattr(button, "text", "") == words))
    window.frames(2)


def test_a_level_that_is_no_recording_has_neither_the_tool_nor_the_tab(tmp_path, monkeypatch):
    for name in ("FLOCKBRUSH_CONFIG", "FLOCKBRUSH_STATE"):
        monkeypatch.setenv(name, str(tmp_path / name))
    level = Window(pasture(tmp_path))
    level.key("d")
    assert level.tool.name == "brush" and not set(level.column.classes) & set(OF_RECORDINGS)
    level.close()


def test_a_drag_moves_an_animal_and_exports_write_what_is_shown(window, recording, exported):
    before, bytes_before = shown(window), recording.read_bytes()
    animal = next(iter(before))
    x, y = before[animal]
    window.drag((x, y), (x + 3, y + 2))
    after = shown(window)
    assert np.subtract(after[animal], before[animal]) == pytest.approx([3, 2], abs=0.15)
    assert {a: p for a, p in after.items() if a != animal} == {a: p for a, p in before.items() if a != animal}
    same_as_exported(window, exported, 0, 20, TICKS)
    assert recording.read_bytes() == bytes_before
    assert CliRunner().invoke(cli, ["replay", str(recording), "--verify"]).exit_code == 0


def test_a_box_selects_and_delete_deletes_until_it_is_undone(window, recording, exported):
    everybody = shown(window)
    places = np.array(list(everybody.values()))
    low, high = places.min(axis=0) - 1, np.median(places, axis=0) + 0.21
    inside = {a for a, p in everybody.items() if (low <= p).all() and (p <= high).all()}
    window.drag(low, high)
    assert set(window.session.edits.selected.tolist()) == inside and inside
    window.key("delete")
    assert shown(window).keys() == everybody.keys() - inside
    same_as_exported(window, exported, 0, 33)
    window.key("ctrl+z")
    assert shown(window).keys() == everybody.keys()
    window.key("ctrl+shift+z")
    assert shown(window).keys() == everybody.keys() - inside
    assert [edit.kind for edit in edits_of(recording).edits()] == ["delete"]


def test_shift_adds_and_takes_away_and_escape_selects_nobody(window):
    places = list(shown(window).items())[:3]
    window.click(places[0][1])
    monkey = pygame.key.get_mods
    try:
        pygame.key.get_mods = lambda: pygame.KMOD_SHIFT
        window.click(places[1][1])
        window.click(places[2][1])
        window.click(places[1][1])
    finally:
        pygame.key.get_mods = monkey
    assert window.session.edits.selected.tolist() == sorted([places[0][0], places[2][0]])
    window.key("escape")
    assert len(window.session.edits.selected) == 0


def test_times_of_the_panel_bound_an_edit(window, exported):
    animal, place = next(iter(shown(window).items()))
    window.click(place)
    made = panel(window)
    made.times["start"].set_text("0.5")
    made.times["end"].set_text("1")
    made._take_times()
    window.key("delete")
    for tick, there in ((0, True), (15, True), (16, False), (31, False), (32, True)):
        go_to(window, tick)
        assert (animal in shown(window)) == there, tick
    same_as_exported(window, exported, 10, 20, 40)


def test_a_time_that_is_typed_without_enter_bounds_the_edit_of_the_next_button(window):
    window.click(next(iter(shown(window).values())))
    made = panel(window)
    for name, text in (("start", "0.5"), ("end", "1.25")):
        write(window, made.times[name], text)
    press(window, "Delete")
    (edit,) = window.session.edits.file.layers[0].edits
    assert (edit.start, edit.end) == (0.5, 1.25)
    write(window, made.times["end"], "soon")
    press(window, "Delete")
    assert window.said("error")[-1] == "Until must be a number, got 'soon'"
    assert len(window.session.edits.file.layers[0].edits) == 1
    window.toasts.log.clear()
    write(window, made.times["end"], "1.5")
    window.manager.set_focus_set(None)
    window.frames(2)
    assert window.session.edits.end == 1.5


def write(window, entry, text):
    """Type into a field, without Enter."""
    window.manager.set_focus_set(entry)
    entry.set_text("")
    for letter in text:
        window.post(pygame.TEXTINPUT, text=letter)


def test_now_is_the_moment_that_is_shown_to_the_tick(window):
    window.session.step(395)
    go_to(window, 395)
    made = panel(window)
    made._now("start")
    assert window.session.edits.start == 12.34375 == window.session.clock.now
    window.frames(2)
    assert made.times["start"].get_text() == "12.34375"
    made._now("end")
    assert window.said("error").pop() == "the first time must be before the second one"
    window.toasts.log.clear()


def test_a_frozen_animal_stands_once_the_recording_was_passed_through(window, exported):
    go_to(window, 16)
    animal, place = next(iter(shown(window).items()))
    window.click(place)
    made = panel(window)
    made._now("start")
    press(window, "Freeze")
    end = time.monotonic() + 60
    while window.session.edits.waiting is not None and time.monotonic() < end:
        window.frames(1)
    assert window.session.edits.waiting is None
    go_to(window, 50)
    assert shown(window)[animal] == pytest.approx(place, abs=1e-9)
    same_as_exported(window, exported, 8, 30, TICKS)


def test_forms_ask_for_numbers_and_refuse_what_is_none(window, exported):
    window.click(next(iter(shown(window).values())))
    press(window, "Retime ...")
    window.dialog.entries["speed"].set_text("fast")
    window.key("return")
    assert window.dialog.alive() and window.toasts.log.pop().text == "times as fast must be a number, got 'fast'"
    window.dialog.entries["speed"].set_text("1000")
    window.key("return")
    assert window.dialog.alive() and window.toasts.log.pop().text == "speed must be from 0.01 to 100, got 1000"
    window.dialog.entries["speed"].set_text("0.5")
    window.key("return")
    assert window.dialog is None or not window.dialog.alive()
    while window.session.edits.waiting is not None:
        window.frames(1)
    same_as_exported(window, exported, 20, TICKS)


def test_a_form_that_changes_nothing_is_refused_and_tells_the_names(window, recording):
    window.click(next(iter(shown(window).values())))
    for words in ("Look ...", "Move ..."):
        press(window, words)
        if words == "Look ...":
            assert "sheep" in window.dialog.entries["species"].tool_tip_text
        window.key("return")
        assert window.dialog.alive() and "changes nothing" in window.toasts.log.pop().text
        window.key("escape")
    assert edits_of(recording).edits() == []


def test_undo_leaves_the_animals_selected(window):
    animal, place = next(iter(shown(window).items()))
    window.click(place)
    window.key("delete")
    window.key("ctrl+z")
    assert window.session.edits.selected.tolist() == [animal]


def test_all_of_a_brush_are_those_that_are_shown_with_it(tmp_path, monkeypatch):
    for name in ("FLOCKBRUSH_CONFIG", "FLOCKBRUSH_CACHE", "FLOCKBRUSH_STATE"):
        monkeypatch.setenv(name, str(tmp_path / name))
    two_seconds(tmp_path)  # all march at first, and swarm later
    window = opened(tmp_path / "walk.flock", tmp_path / "state")
    edits, everybody, made = window.session.edits, sorted(shown(window)), panel(window)
    edits.select(everybody[:3])
    assert window.edit_recorded("look", brush="swarm")
    edits.select(everybody[3:5])
    assert window.edit_recorded("delete")
    made._select("brush swarm")
    assert edits.selected.tolist() == everybody[:3]
    made._select("all animals")
    assert edits.selected.tolist() == everybody[:3] + everybody[5:]
    assert window.said("error") == []
    window.close()


def test_layers_are_switched_and_removed(window, recording):
    everybody = shown(window)
    window.click(next(iter(everybody.values())))
    made = panel(window)
    made._name_layer("slow")
    window.key("delete")
    assert len(shown(window)) == len(everybody) - 1
    window.frames(2)
    box = next(box for box, name in panel(window).boxes.items() if name == "slow")
    window.push(box)
    assert len(shown(window)) == len(everybody) and not edits_of(recording).layer("slow").on
    press(window, "×")
    assert edits_of(recording).layers == []


def test_edits_made_elsewhere_meanwhile_are_kept(window, recording):
    ran = CliRunner().invoke(cli, ["edit", str(recording), "--ids", "1", "--delete", "--layer", "theirs"])
    assert ran.exit_code == 0, ran.output
    window.click(shown(window)[3])
    window.key("delete")
    assert [layer.name for layer in edits_of(recording).layers] == ["theirs", "edits"]
    assert not {1, 3} & shown(window).keys()


def test_a_branch_shows_no_edits_and_takes_none(window):
    everybody = shown(window)
    window.click(next(iter(everybody.values())))
    window.key("delete")
    go_to(window, 32)
    window.session.do("paint", [stroke("march", 6, 8, 3)])
    assert shown(window).keys() == everybody.keys()
    window.key("delete")
    assert "go to the branch main" in window.toasts.log.pop().text
    window.session.switch("main")
    go_to(window, 10)
    assert len(shown(window)) == len(everybody) - 1


def test_a_file_that_cannot_be_written_is_said_and_nothing_is_changed(window, recording):
    everybody = shown(window)
    beside(recording).mkdir()
    window.click(next(iter(everybody.values())))
    window.key("delete")
    assert str(beside(recording)) in window.toasts.log.pop().text
    assert shown(window).keys() == everybody.keys()


def test_edits_of_another_recording_are_not_shown_and_the_session_opens(recording, tmp_path):
    CliRunner().invoke(cli, ["edit", str(recording), "--ids", "1", "--delete"])
    text = beside(recording).read_text()
    number = edits_of(recording).sha256
    beside(recording).write_text(text.replace(number, number[::-1]))
    session = open_recorded(recording, tmp_path / "state")
    assert session.edits is None
    assert any("belong to another recording" in notice.text for notice in session.notices())
    session.close()


def test_trails_of_ways_that_edits_took_away_are_not_drawn(window):
    go_to(window, 8)
    animal = next(iter(shown(window)))
    for tick in range(9, 40):
        go_to(window, tick)
    before = np.count_nonzero(window.canvas.painter.trails.alpha)
    window.session.edits.select([animal])
    window.key("delete")
    window.frames(1)
    assert np.count_nonzero(window.canvas.painter.trails.alpha) < 0.3 * before


def test_edits_made_elsewhere_are_shown_and_gone_with_their_file(window, recording):
    everybody = shown(window)
    ran = CliRunner().invoke(cli, ["edit", str(recording), "--ids", "2", "--delete", "--layer", "theirs"])
    assert ran.exit_code == 0, ran.output
    window._disk = 0
    window.frames(2)
    assert shown(window).keys() == everybody.keys() - {2}
    beside(recording).write_text("no toml = [")
    for _ in range(2):
        window._disk = 0
        window.frames(1)
    assert [str(beside(recording)) in told.text for told in window.toasts.log if told.kind == "error"] == [True]
    window.toasts.log.clear()
    beside(recording).unlink()
    window._disk = 0
    window.frames(2)
    assert shown(window).keys() == everybody.keys()


def test_undo_with_nothing_to_take_back_writes_no_file(window, recording):
    for key in ("ctrl+z", "ctrl+y"):
        window.key(key)
    window.frames(2)
    assert not beside(recording).exists()


def test_an_undo_that_could_not_be_written_is_not_said_to_be_done(window, recording):
    window.click(next(iter(shown(window).values())))
    window.key("delete")
    beside(recording).write_text("no toml = [")
    window.key("ctrl+z")
    window.frames(1)
    texts = [told.text for told in window.toasts.log]
    assert not any("undone" in text for text in texts) and str(beside(recording)) in texts[-1]
    window.toasts.log.clear()


def test_a_pass_that_failed_is_said_and_tried_again_with_the_next_edit(window, recording):
    def wait():
        while window.session.edits.waiting is not None:
            window.frames(1)
        window.frames(1)

    animal, place = next(iter(shown(window).items()))
    window.click(place)
    recording.rename(recording.with_suffix(".away"))
    press(window, "Freeze")
    wait()
    told = window.toasts.log.pop().text
    assert "edits of time are not shown" in told and "bug" not in told
    recording.with_suffix(".away").rename(recording)
    window.edit_recorded("look", size=2.0)
    wait()
    go_to(window, 50)
    assert shown(window)[animal] == pytest.approx(place, abs=1e-9)

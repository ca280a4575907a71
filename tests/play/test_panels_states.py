"""The States panel: cards of states, rows of triggers, changed while the herd runs."""

import pytest
from flockbrush.behaviours.program import load_program, shipped_programs
from flockbrush.systems.program_commands import Event
from flockbrush.systems.programs import Programs
from small_pasture import pasture
from small_window import SmallWindow

from flockbrush.runs import run as running
from flockbrush.studio.panels.program_form import KIND, cards_of, changed, sample, with_state, with_trigger, without
from flockbrush.studio.panels.program_panel import StatesPanel


@pytest.fixture(scope="module")
def program():
    return shipped_programs().get("stampede")


def row(program, card, label, nth=0):
    """A row of a card by its label."""
    found = next(c for c in cards_of(program, ("graze", "march")) if c.title == card)
    return [r for r in found.rows if r.label == label][nth]


def read(text):
    return load_program(text.encode(), "stampede.program.toml")


# the form ----------------------------------------------------------------------------------


def test_states_and_triggers_are_cards_with_rows(program):
    cards = cards_of(program, ("graze",))
    assert [card.title for card in cards] == ["graze", "stampede", "calm", "a wolf is near", "the others run"]
    assert row(program, "stampede", "for").text == "8..12 s" and row(program, "stampede", "then").text == "calm"
    words = [(r.label, r.text) for r in cards[3].rows if r.depth or r.label == KIND]
    assert words[:4] == [(KIND, "any"), (KIND, "sees"), ("sees", "wolf"), ("within", "30 m")]


def test_a_changed_row_is_a_changed_program(program):
    made = read(changed(program, row(program, "stampede", "for"), "3..4 s"))
    assert str(made.states["stampede"].lasts) == "3..4 s" and made.states["graze"] == program.states["graze"]
    made = read(changed(program, row(program, "a wolf is near", "within"), "12 m"))
    assert str(made.triggers[0].when.parts()[0].within) == "12 m"
    made = read(changed(program, row(program, "the others run", "at_least"), "0.7"))
    assert made.triggers[1].when.at_least == 0.7
    assert read(changed(program, row(program, "the others run", "delay"), "")).triggers[1].delay is None
    assert read(changed(program, row(program, "a wolf is near", "from"), '["graze"]')).triggers[0].sources == ("graze",)


def test_the_time_of_a_state_and_what_comes_after_it_go_together(program):
    made = read(changed(program, row(program, "graze", "for"), "9 s")).states["graze"]
    assert str(made.lasts) == "9 s" and made.then == (("graze", 1.0),)
    assert str(read(changed(program, row(program, "graze", "then"), "calm")).states["graze"].lasts) == "5 s"
    assert read(changed(program, row(program, "calm", "for"), "")).states["calm"].then is None


@pytest.mark.parametrize("word", ["rate", "alone_for", "all", "not", "distance_to", "slope_above", "sees_more_than"])
def test_another_kind_of_condition_begins_with_values_of_its_own(program, word):
    made = read(changed(program, row(program, "the others run", KIND), word))
    assert made.triggers[1].when.word == word


def test_every_kind_of_condition_has_values_to_begin_with(program):
    from flockbrush.behaviours.trigger import conditions, read_condition

    for word in conditions():
        assert read_condition(sample(word, tuple(program.states)))[1] == [], word


def test_states_and_triggers_are_added_and_removed(program):
    assert list(read(with_state(program, "rest")).states) == ["graze", "stampede", "calm", "rest"]
    assert len(read(with_trigger(program)).triggers) == 3
    assert len(read(without(program, ("trigger", 0))).triggers) == 1
    with pytest.raises(ValueError, match="there is no state 'calm'"):
        without(program, ("state", "calm"))
    with pytest.raises(ValueError, match="must be a time"):
        changed(program, row(program, "stampede", "for"), "soon")


# the panel ---------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def level(tmp_path_factory):
    return pasture(tmp_path_factory.mktemp("states"))


@pytest.fixture
def window(level):
    made = SmallWindow(level, StatesPanel)
    made.session.step(4)
    yield made
    made.close()


def element(window, label, card):
    """The widget of a row."""
    return next(e for e, r in window.panel.rows.items() if r.label == label and r.path[1] == card)


def test_a_program_is_given_changed_and_undone_in_the_running_world(window):
    panel, session = window.panel, window.session
    assert panel.program is None and not panel.rows
    panel.give("stampede")
    panel.refresh()
    assert panel.program.name == "stampede" and "stampede" in panel.counted
    total = len(session.simulation.agents)
    assert panel.counted["graze"].text.endswith(f"   {total}")
    panel._change(panel.rows[element(window, "for", "stampede")], "1..2 s")
    panel.refresh()
    assert str(panel.program.states["stampede"].lasts) == "1..2 s"
    session.undo()
    panel.refresh()
    assert str(panel.program.states["stampede"].lasts) == "8..12 s"
    session.do("event alarm", [Event("alarm")])
    session.step(32)
    panel.refresh()
    assert panel.counted["stampede"].text.endswith(f"   {total}")
    session.undo()
    session.undo()
    assert session.simulation.world.resource(Programs).names == []


def test_a_program_beside_the_level_is_given(window, program):
    folder = window.session.path.parent / "programs"
    folder.mkdir()
    (folder / "hasty.program.toml").write_bytes(program.source.replace(b"8..12 s", b"7..9 s"))
    window.panel.give("hasty")
    assert str(window.panel.program.states["stampede"].lasts) == "7..9 s"


def test_a_wrong_value_becomes_a_message_and_changes_nothing(window):
    panel = window.panel
    panel.give("stampede")
    panel.refresh()
    before = panel.program.source
    panel._change(panel.rows[element(window, "for", "stampede")], "soon")
    assert panel.program.source == before
    panel.give("no such")
    assert len(window.session.simulation.world.resource(Programs)) == 1


def test_texts_typed_without_enter_are_taken_before_a_button_acts_and_when_the_fields_are_left(window):
    panel = window.panel
    panel.give("stampede")
    window.wait()
    write(window, element(window, "for", "stampede"), "1..2 s")
    write(window, element(window, "emits", "graze"), "hush")
    assert str(panel.program.states["stampede"].lasts) == "8..12 s"
    add = next(button for button in panel.does if getattr(button, "text", "") == "Add trigger")
    panel.scroll.vert_scroll_bar.set_scroll_from_start_percentage(0.9)
    window.frames(2)
    window.click(add)
    assert str(panel.program.states["stampede"].lasts) == "1..2 s" and panel.program.states["graze"].emits == "hush"
    assert len(panel.program.triggers) == 3
    write(window, element(window, "for", "stampede"), "soon")
    window.manager.set_focus_set(None)
    window.wait()
    assert str(panel.program.states["stampede"].lasts) == "1..2 s" and "must be a time" in window.said[-1][1]
    assert element(window, "for", "stampede").get_text() == "1..2 s"


def write(window, entry, text):
    """Type into a field, without Enter."""
    window.manager.set_focus_set(entry)
    entry.set_text("")
    window.type(text, enter=False)


def test_a_program_is_saved_and_a_file_that_is_there_is_left_alone(window, tmp_path):
    window.panel.give("stampede")
    session = window.session
    session.save_program(window.panel.program, tmp_path / "programs")
    path = tmp_path / "programs" / "stampede.program.toml"
    assert load_program(path) == shipped_programs().get("stampede")
    path.write_text("mine")
    assert session.save_program(window.panel.program, tmp_path / "programs") is None
    assert path.read_text() == "mine" and "stampede.program.toml" in session.notices()[-1].text
    assert session.save_program(window.panel.program, tmp_path / "no" / "such") is None
    assert "such" in session.notices()[-1].text


def test_a_changed_program_is_unsaved_until_it_is_saved_or_undone(window, tmp_path):
    session, panel = window.session, window.panel
    panel.give("stampede")
    assert session.unsaved_programs() == []  # it is one of those that are shipped
    panel.refresh()
    panel._change(panel.rows[element(window, "for", "stampede")], "3..4 s")
    assert [program.name for program in session.unsaved_programs()] == ["stampede"]
    session.undo()
    assert session.unsaved_programs() == []
    session.redo()
    assert session.save_program(panel.program, tmp_path) == tmp_path / "stampede.program.toml"
    assert session.unsaved_programs() == []


def test_no_program_is_written_into_the_package(window):
    window.panel.give("stampede")
    for folder in (running.SHIPPED, running.SHIPPED / "programs"):
        assert window.session.save_program(window.panel.program, folder) is None
        assert "is part of Flockbrush" in window.session.notices()[-1].text
    assert not (running.SHIPPED / "programs/stampede.program.toml").exists()

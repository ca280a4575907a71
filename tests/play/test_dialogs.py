"""Questions: what is prefilled is replaced by typing, and what is not accepted can be mended."""


def ask_for_a_brush(window):
    window.column.show_titled("Brush")
    window.choose("brush", "march")
    window.frames(12)
    panel = next(panel for panel in window.panels if panel.title == "Brush")
    panel.ask_name()
    window.frames(2)


def test_what_is_typed_replaces_the_name_that_was_proposed(window):
    ask_for_a_brush(window)
    assert window.dialog.entry.get_text() == "march-2"
    window.type("rush")
    assert "rush" in window.brush_names() and window.brush == "rush"


def test_a_bad_name_keeps_the_dialog_and_its_typing_away_from_the_keys_of_tools(window):
    ask_for_a_brush(window)
    tool, tick = window.tool.name, window.session.tick
    window.type("no/good")
    assert window.dialog is not None and window.dialog.alive()
    (told,) = (toast for toast in window.toasts.log if toast.kind == "error")
    assert told.times == 1  # one Enter, one answer
    for letter in "xgh 3":
        window.key("space" if letter == " " else letter)
    assert window.tool.name == tool and window.session.tick == tick and not window.canvas.in_space
    window.dialog.entry.set_text("")
    window.type("good")
    assert window.dialog is None or not window.dialog.alive()
    assert window.brush == "good"


def test_a_level_without_a_name_is_asked_for_again(window):
    window.key("ctrl+shift+s")
    window.dialog.entry.set_text("")
    window.key("return")
    assert window.dialog is not None and window.dialog.alive()
    window.key("escape")
    window.frames(2)
    assert window.dialog is None or not window.dialog.alive()

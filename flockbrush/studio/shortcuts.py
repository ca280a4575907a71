"""Everything that can be done with a key or a button: one table; buttons, the help page and tests come from it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import pygame


@dataclass(frozen=True)
class Action:
    """One thing a person may do."""

    name: str  # stable; buttons and tests speak of it
    title: str  # what buttons and the help page say
    keys: tuple[str, ...]  # as `key_of` writes them, "ctrl+z"; the first is the one that is shown
    tip: str  # one sentence
    group: str  # heading on the help page
    do: Callable  # called with the App
    icon: str = ""  # of the button, if it has one


TIME, EDIT, VIEW, FILE, HAND = "Time", "Edit", "Look", "Files", "Brush"

ACTIONS = (
    Action("play", "Play or pause", ("space",), "Play or pause", TIME, lambda app: app.toggle_play(), "play"),
    Action(
        "step",
        "One step",
        (".",),
        "Advance by one tick of 1/32 s and pause",
        TIME,
        lambda app: app.step(1),
        "step",
    ),
    Action("back", "One step back", (",",), "Look at the tick before this one", TIME, lambda app: app.step(-1), "back"),
    Action(
        "restart",
        "Restart",
        ("ctrl+r",),
        "Begin the level again; what was painted stays, the old run is kept as a branch",
        TIME,
        lambda app: app.restart(),
        "restart",
    ),
    Action(
        "slower", "Slower", ("-",), "Half the speed of time, down to a quarter", TIME, lambda app: app.change_rate(0.5)
    ),
    Action(
        "faster",
        "Faster",
        ("+", "="),
        "Twice the speed of time, up to eight times",
        TIME,
        lambda app: app.change_rate(2.0),
    ),
    Action(
        "branch",
        "Branch here",
        ("ctrl+b",),
        "Keep the recorded future as a branch, and start another from here",
        TIME,
        lambda app: app.branch(),
        "branch",
    ),
    Action(
        "latest",
        "To the latest tick",
        ("end",),
        "Come back from the past",
        TIME,
        lambda app: app.scrub(app.session.last_tick),
    ),
    Action("undo", "Undo", ("ctrl+z",), "Take back the last change", EDIT, lambda app: app.undo(), "undo"),
    Action(
        "redo", "Redo", ("ctrl+shift+z", "ctrl+y"), "Do again what was taken back", EDIT, lambda app: app.redo(), "redo"
    ),
    Action(
        "delete",
        "Delete",
        ("delete", "backspace"),
        "Take away what is selected, or the point under the mouse",
        EDIT,
        lambda app: app.delete(),
    ),
    Action(
        "cancel",
        "Cancel",
        ("escape",),
        "Drop what is half drawn, the selection, or the window on top",
        EDIT,
        lambda app: app.cancel(),
    ),
    Action(
        "finish",
        "Finish the shape",
        ("return", "enter"),
        "End a polygon or a guide that is being clicked together",
        EDIT,
        lambda app: app.finish(),
    ),
    Action(
        "properties",
        "Properties ...",
        ("p",),
        "Change the numbers of the selected thing: altitude and depth of a spawn, the next goal of a goal",
        EDIT,
        lambda app: app.ask_properties(),
    ),
    Action(
        "command",
        "Command ...",
        ("k",),
        "Give one of the commands of scripts at the point under the mouse: Gust, Migrate, MoveObstacle and others",
        EDIT,
        lambda app: app.ask_command(),
    ),
    Action(
        "smaller",
        "Smaller brush",
        ("[",),
        "Make brush, eraser and other round tools smaller",
        HAND,
        lambda app: app.change_size(1 / 1.25),
    ),
    Action(
        "larger",
        "Larger brush",
        ("]",),
        "Make brush, eraser and other round tools larger",
        HAND,
        lambda app: app.change_size(1.25),
    ),
    Action(
        "softer",
        "Softer rim",
        ("}",),
        "Let the stroke thin out towards its rim",
        HAND,
        lambda app: app.change_softness(0.1),
    ),
    Action("harder", "Harder rim", ("{",), "Give the stroke a clear edge", HAND, lambda app: app.change_softness(-0.1)),
    Action(
        "next",
        "Next in the palette",
        ("tab",),
        "Take the next brush, speed or surface",
        HAND,
        lambda app: app.next_paint(1),
    ),
    Action(
        "previous",
        "Previous in the palette",
        ("shift+tab",),
        "Take the one before",
        HAND,
        lambda app: app.next_paint(-1),
    ),
    Action("fit", "Whole map", ("home",), "Show all of the level", VIEW, lambda app: app.canvas.fit(), "fit"),
    Action(
        "herd", "The herd", ("z",), "Show all animals, as large as they can be", VIEW, lambda app: app.canvas.fit_herd()
    ),
    Action(
        "space",
        "Plan or space",
        ("3",),
        "Look at the herd in space: drag with the middle button, or with Alt held, to go round it",
        VIEW,
        lambda app: app.toggle_space(),
        "cube",
    ),
    Action(
        "follow",
        "Follow",
        ("t",),
        "Let the view go with the herd, or with the selected animal",
        VIEW,
        lambda app: app.toggle_follow(),
    ),
    Action(
        "nearer", "Nearer", ("pageup",), "Zoom in; so does the mouse wheel", VIEW, lambda app: app.canvas.zoom(1.25)
    ),
    Action(
        "farther", "Farther", ("pagedown",), "Zoom out; so does the mouse wheel", VIEW, lambda app: app.canvas.zoom(0.8)
    ),
    Action(
        "left",
        "Look west",
        ("left",),
        "Move the view; dragging with the middle button or with space held does too",
        VIEW,
        lambda app: app.pan_by(1, 0),
    ),
    Action("right", "Look east", ("right",), "Move the view", VIEW, lambda app: app.pan_by(-1, 0)),
    Action("up", "Look north", ("up",), "Move the view", VIEW, lambda app: app.pan_by(0, 1)),
    Action("down", "Look south", ("down",), "Move the view", VIEW, lambda app: app.pan_by(0, -1)),
    Action(
        "theme",
        "Light or dark",
        ("f2",),
        "Change the colours of the window",
        VIEW,
        lambda app: app.toggle_theme(),
        "sun",
    ),
    Action(
        "panels",
        "Side columns",
        ("f3",),
        "Hide the columns to see more of the level, or show them again",
        VIEW,
        lambda app: app.toggle_columns(),
        "menu",
    ),
    Action(
        "text size",
        "Usual text size",
        ("f4",),
        "Give text and buttons the size that suits the window again",
        VIEW,
        lambda app: app.set_scale(None),
    ),
    Action(
        "fullscreen",
        "Full screen",
        ("f11",),
        "Fill the screen, or come back",
        VIEW,
        lambda app: app.toggle_fullscreen(),
    ),
    Action(
        "save",
        "Save",
        ("ctrl+s",),
        "Write the level file; the one before it is kept as a backup",
        FILE,
        lambda app: app.save(),
        "save",
    ),
    Action(
        "save as", "Save as ...", ("ctrl+shift+s",), "Write the level to another file", FILE, lambda app: app.save_as()
    ),
    Action(
        "reload", "Reload", ("f5",), "Read the level file again, as it is on disk now", FILE, lambda app: app.reload()
    ),
    Action(
        "export",
        "Export the recording ...",
        ("ctrl+e",),
        "Write a file that `flockbrush replay` and `export` read",
        FILE,
        lambda app: app.export_recording(),
    ),
    Action(
        "screenshot",
        "Screenshot",
        ("f12",),
        "Write a picture of the window as PNG",
        FILE,
        lambda app: app.screenshot(),
        "camera",
    ),
    Action(
        "video",
        "Record a video",
        ("f9",),
        "Begin or end a video of the canvas, as MP4",
        FILE,
        lambda app: app.toggle_video(),
        "record",
    ),
    Action(
        "controls",
        "Controls by keys",
        ("f6",),
        "Go to the controls: Tab and Shift+Tab from one to the next, arrows turn, Enter presses, Escape leaves",
        VIEW,
        lambda app: app.control_keys.step(1),
    ),
    Action("help", "Help", ("f1", "?"), "All keys and buttons", FILE, lambda app: app.toggle_help(), "help"),
    Action(
        "quit",
        "Quit",
        ("ctrl+q",),
        "Close the window; what is not saved is asked for",
        FILE,
        lambda app: app.ask_to_quit(),
    ),
)

BY_NAME = {action.name: action for action in ACTIONS}
BY_KEY = {key: action for action in ACTIONS for key in action.keys}


def key_of(event) -> str:
    """A key that was pressed, as the table writes it: "ctrl+shift+z", "f1", "[".

    Signs are taken as they are printed on this keyboard, wherever they lie on it.
    """
    mods = getattr(event, "mod", 0)
    ctrl, shift = mods & (pygame.KMOD_CTRL | pygame.KMOD_META), mods & pygame.KMOD_SHIFT
    sign = getattr(event, "unicode", "")
    name = pygame.key.name(event.key)
    if not ctrl and len(sign) == 1 and sign.isprintable() and not sign.isalnum() and sign != " ":
        return sign
    name = {"page up": "pageup", "page down": "pagedown", "[+]": "+", "[-]": "-", "keypad enter": "enter"}.get(
        name, name
    )
    return "+".join([*(["ctrl"] if ctrl else []), *(["shift"] if shift else []), name])


def shown(key: str) -> str:
    """A key as people write it: "Ctrl+Shift+Z"."""
    names = {"pageup": "Page Up", "pagedown": "Page Down", "left": "Left", "right": "Right", "up": "Up", "down": "Down"}
    if key == "+":
        return key
    return "+".join(names.get(part, part.capitalize() if len(part) > 1 else part.upper()) for part in key.split("+"))


def tip_of(action: Action) -> str:
    """What the tooltip of a button says: the title, the key, and the sentence."""
    key = f"   [{shown(action.keys[0])}]" if action.keys else ""
    return f"<b>{action.title}</b>{key}<br>{action.tip}."

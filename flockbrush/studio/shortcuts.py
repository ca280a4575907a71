"""The table of all actions with their keys and buttons, from which buttons, help page and tests are generated."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import pygame


@dataclass(frozen=True)
class Action:
    """One action, with its keys, tooltip and function."""

    name: str  # stable; buttons and tests speak of it
    title: str  # what buttons and the help page say
    keys: tuple[str, ...]  # as `key_of` writes them, "ctrl+z"; the first is the one that is shown
    tip: str  # one sentence
    group: str  # heading on the help page
    do: Callable  # called with the App
    icon: str = ""  # of the button, if it has one


TABLE = {  # by heading on the help page: name, title, keys, tip, what is done, and the icon of the button if it has one
    "Time": (
        ("play", "Play or pause", "space", "Play or pause", lambda app: app.toggle_play(), "play"),
        ("step", "One step", ".", "Advance by one tick of 1/32 s and pause", lambda app: app.step(1), "step"),
        ("back", "One step back", ",", "Go back by one tick and pause", lambda app: app.step(-1), "back"),
        ("restart", "Restart", "ctrl+r",
         "Restart the level; your changes stay, and the old run is kept as a branch",
         lambda app: app.restart(), "restart"),
        ("slower", "Slower", "-", "Halve the playback speed, down to 1/4", lambda app: app.change_rate(0.5)),
        ("faster", "Faster", "+ =", "Double the playback speed, up to 8 times", lambda app: app.change_rate(2.0)),
        ("branch", "New branch", "ctrl+b",
         "Start a new branch at this tick; the recorded future is kept as a branch",
         lambda app: app.branch(), "branch"),
        ("latest", "To the latest tick", "end",
         "Go to the end of the recorded run", lambda app: app.scrub(app.session.last_tick)),
    ),
    "Edit": (
        ("undo", "Undo", "ctrl+z", "Undo the last change", lambda app: app.undo(), "undo"),
        ("redo", "Redo", "ctrl+shift+z ctrl+y", "Redo the last undone change", lambda app: app.redo(), "redo"),
        ("delete", "Delete", "delete backspace",
         "Delete the selected object, or the point under the mouse", lambda app: app.delete()),
        ("cancel", "Cancel", "escape",
         "Cancel the shape being drawn, clear the selection, or close the top window", lambda app: app.cancel()),
        ("finish", "Finish the shape", "return enter",
         "Finish the polygon or guide being drawn", lambda app: app.tool.finish()),
        ("properties", "Properties ...", "p",
         "Edit the properties of the selected object, such as the altitude of a spawn or the next goal",
         lambda app: app.ask_properties()),
        ("command", "Command ...", "k",
         "Run a script command at the point under the mouse: Gust, Migrate, MoveObstacle and others",
         lambda app: app.ask_command()),
    ),
    "Brush": (
        ("smaller", "Smaller brush", "[",
         "Make the brush, the eraser and other round tools smaller", lambda app: app.change_size(1 / 1.25)),
        ("larger", "Larger brush", "]",
         "Make the brush, the eraser and other round tools larger", lambda app: app.change_size(1.25)),
        ("softer", "Softer edge", "}", "Fade the stroke more towards its edge", lambda app: app.change_softness(0.1)),
        ("harder", "Harder edge", "{", "Fade the stroke less", lambda app: app.change_softness(-0.1)),
        ("next", "Next in the palette", "tab",
         "Select the next brush, speed limit or surface", lambda app: app.next_paint(1)),
        ("previous", "Previous in the palette", "shift+tab",
         "Select the previous brush, speed limit or surface", lambda app: app.next_paint(-1)),
    ),
    "View": (
        ("fit", "Whole map", "home", "Show the whole level", lambda app: app.canvas.fit(), "fit"),
        ("herd", "Whole herd", "z", "Zoom to all animals", lambda app: app.canvas.fit_herd()),
        ("space", "2D or 3D", "3",
         "Switch between plan and 3D view; in 3D, drag with the middle button or with Alt to orbit",
         lambda app: app.toggle_space(), "cube"),
        ("follow", "Follow", "t", "Keep the herd, or the selected animal, in view", lambda app: app.toggle_follow()),
        ("nearer", "Zoom in", "pageup", "Zoom in; also by mouse wheel", lambda app: app.canvas.zoom(1.25)),
        ("farther", "Zoom out", "pagedown", "Zoom out; also by mouse wheel", lambda app: app.canvas.zoom(0.8)),
        ("left", "Move west", "left",
         "Move the view; also by dragging with the middle button or with Space held", lambda app: app.pan_by(1, 0)),
        ("right", "Move east", "right", "Move the view", lambda app: app.pan_by(-1, 0)),
        ("up", "Move north", "up", "Move the view", lambda app: app.pan_by(0, 1)),
        ("down", "Move south", "down", "Move the view", lambda app: app.pan_by(0, -1)),
        ("theme", "Light or dark", "f2", "Change the colours of the window", lambda app: app.toggle_theme(), "sun"),
        ("panels", "Side columns", "f3", "Hide or show the side columns", lambda app: app.toggle_columns(), "menu"),
        ("text size", "Default text size", "f4",
         "Reset text and buttons to the size that suits the window", lambda app: app.set_scale(None)),
        ("fullscreen", "Full screen", "f11", "Switch full screen on or off", lambda app: app.toggle_fullscreen()),
        ("controls", "Keyboard control", "f6",
         "Use the controls by keyboard: Tab and Shift+Tab move, arrows change values, Enter presses, Escape leaves",
         lambda app: app.control_keys.step(1)),
    ),
    "Files": (
        ("save", "Save", "ctrl+s",
         "Write the level file; the previous file is kept as a backup", lambda app: app.save(), "save"),
        ("save as", "Save as ...", "ctrl+shift+s", "Write the level to another file", lambda app: app.save_as()),
        ("reload", "Reload", "f5", "Read the level file again from disk", lambda app: app.reload()),
        ("export", "Export the recording ...", "ctrl+e",
         "Write the recording for `flockbrush replay` and `flockbrush export`", lambda app: app.export_recording()),
        ("screenshot", "Screenshot", "f12",
         "Write a picture of the window as PNG", lambda app: app.screenshot(), "camera"),
        ("video", "Record a video", "f9",
         "Start or stop a video of the canvas (MP4)", lambda app: app.toggle_video(), "record"),
        ("help", "Help", "f1 ?", "All keys and buttons", lambda app: app.toggle_help(), "help"),
        ("quit", "Quit", "ctrl+q",
         "Close the window; asks before unsaved changes are lost", lambda app: app.ask_to_quit()),
    ),
}  # fmt: skip
ACTIONS = tuple(
    Action(name, title, tuple(keys.split()), tip, group, *rest)
    for group, rows in TABLE.items()
    for name, title, keys, tip, *rest in rows
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
    """The tooltip of a button: title, key and sentence."""
    key = f"   [{shown(action.keys[0])}]" if action.keys else ""
    return f"<b>{action.title}</b>{key}<br>{action.tip}."

"""JSON messages of the live link: requests of clients and answers."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any

from flockbrush.engine.commands import from_json
from flockbrush.levels.geometry import sign_of
from flockbrush.output.live.frame import LABELLED
from flockbrush.runs.catalogue import catalogue_of
from flockbrush.systems.landscape import Landscape

PROTOCOL = 1
_ID = 64  # characters
_ASKED = ("command", "undo", "play")


class RequestError(ValueError):
    """A message is not a valid request: ``str()`` is the reason, `id` the client's name for it."""

    def __init__(self, message, id=None):
        super().__init__(message)
        self.id = id


@dataclass(frozen=True)
class Request:
    """A request of a client: a command, undo, or play and pause."""

    id: Any
    command: Any = None
    undo: bool = False
    play: bool | None = None


def read_request(message) -> Request:
    """The request in a message; RequestError.

    A command is checked as those of a recording are: `flockbrush.engine.commands.from_json`.
    """
    if not isinstance(message, str):
        raise RequestError("a request must be a text message with JSON, got bytes")
    try:
        request = json.loads(message)
    except (ValueError, RecursionError) as error:
        raise RequestError(f"this is not JSON: {error}") from None
    if not isinstance(request, dict):
        raise RequestError('a request must be an object such as {"id": 1, "command": ["NAME", {...}]}')
    number = request.pop("id", None)
    if not (number is None or type(number) in (int, str)) or len(str(number)) > _ID:
        raise RequestError(f"id must be a whole number or a string of at most {_ID} characters")
    if len(request) != 1 or next(iter(request)) not in _ASKED:
        raise RequestError(f"a request must have exactly one of {', '.join(_ASKED)}", number)
    try:
        return _request(number, *request.popitem())
    except ValueError as error:
        raise RequestError(str(error.args[0]), number) from None


def _request(number, asked, value):
    if asked == "command":
        if not isinstance(value, list):
            raise ValueError('command must be ["NAME", {...}]')
        try:
            text = json.dumps(value, allow_nan=False)
        except ValueError:
            raise ValueError("NaN and Infinity are not allowed as numbers in a command") from None
        return Request(number, from_json(text))
    if asked == "undo":
        if value is not True:
            raise ValueError('undo must be true: {"undo": true}')
        return Request(number, undo=True)
    if not isinstance(value, bool):
        raise ValueError("play must be true or false")
    return Request(number, play=value)


# what clients are told ---------------------------------------------------------------------


def hello(simulation, fps):
    """The first message."""
    level = simulation.level
    return {
        "type": "hello",
        "protocol": PROTOCOL,
        "level": level.name,
        "seed": simulation.origin["seed"],
        "width": level.width,
        "height": level.height,
        "boundary": level.boundary,
        "tick": simulation.clock.dt,
        "fps": fps,
        "axes": "x east, y north, z up, metres; angles in rad, heading counter-clockwise from east",
    }


def names(simulation):
    """The message with the names behind the indices in frames."""
    words = catalogue_of(simulation.world, LABELLED).words
    return {"type": "names", **{key: list(words[key]) for key in ("species", "brush", *LABELLED)}}


def place(simulation):
    """The message with the objects of the level: outlines in metres."""
    land = simulation.world.resource(Landscape)
    return {
        "type": "place",
        "obstacles": [
            {"name": o.name, "outline": _points(o.polygon), "solid": bool(o.solid), "z_min": o.z_min, "z_max": o.z_max}
            for o in land.obstacles
        ],
        "guides": [{"name": g.name, "points": _points(g.points), "loop": bool(g.loop)} for g in land.guides],
        "goals": [_goal(goal) for goal in land.goals],
        "exits": [{"name": e.name, "outline": _points(e.polygon)} for e in land.exits],
    }


def _goal(goal):
    how = {"radius": goal.radius} if goal.polygon is None else {"radius": 0.0, "outline": _points(goal.polygon)}
    return {"name": goal.name, "xy": [float(v) for v in sign_of(goal)], **how}


def _points(points):
    return [[round(float(x), 3), round(float(y), 3)] for x, y in points]

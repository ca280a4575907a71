"""Outlines of objects in a level's document: in pixels there, in metres here."""

from __future__ import annotations

import numpy as np
from flockbrush.levels import geometry

_SAME = 1e-6  # m


def outline_of(document, thing, dx, dy, origin):
    """("area" | "line" | "point", (k, 2) m) of an object.

    Parameters
    ----------
    origin : (float, float)
        Where on its picture the place of an object with a tile is: shares of width and height.
    """
    kind, points = _drawn(thing, origin)
    points = geometry.turn(points, thing.get("rotation", 0)) + (thing.get("x", 0) + dx, thing.get("y", 0) + dy)
    scale = document.scale
    points = np.column_stack([points[:, 0] / scale, (document.top - points[:, 1]) / scale])
    points = geometry.without_repeats(points, kind == "area")
    return kind, geometry.counter_clockwise(points) if kind == "area" else points


def reshape(document, thing, outline, shape, points, dx, dy):
    """Give an object with an outline (`outline_of`) another, (k, 2) m; what only moved keeps the form of Tiled's."""
    kind, before = outline
    points = np.asarray(points, float).reshape(-1, 2)
    if kind == shape and len(before) == len(points):
        shift = points - before
        if np.abs(shift).max() < _SAME:
            return
        if np.abs(shift - shift[0]).max() < _SAME:
            scale = document.scale
            thing["x"] = round(thing.get("x", 0) + float(shift[0, 0]) * scale, 6)
            thing["y"] = round(thing.get("y", 0) - float(shift[0, 1]) * scale, 6)
            return
    for key in ("polygon", "polyline", "point", "ellipse", "capsule", "gid"):
        thing.pop(key, None)
    thing |= {"height": 0, "rotation": 0, "width": 0}
    shape_as(document, thing, shape, points, dx, dy)


def shape_as(document, thing, shape, points, dx, dy):
    """Give an object without an outline one, (k, 2) m: a point, an "area" or a "line"."""
    px = document.pixels(points) - (dx, dy)
    thing["x"], thing["y"] = (round(float(v), 6) for v in px[0])
    if shape == "point":
        thing["point"] = True
        return
    start = thing["x"], thing["y"]
    corners = [{"x": round(float(x) - start[0], 6), "y": round(float(y) - start[1], 6)} for x, y in px]
    thing["polygon" if shape == "area" else "polyline"] = corners


def _drawn(thing, origin):
    """("area" | "line" | "point", (k, 2) px) of an object about its own origin."""
    w, h = thing.get("width", 0), thing.get("height", 0)
    if "polygon" in thing or "polyline" in thing:
        kind, key = ("area", "polygon") if "polygon" in thing else ("line", "polyline")
        return kind, np.array([(p["x"], p["y"]) for p in thing[key]], float).reshape(-1, 2)
    if thing.get("point"):
        return "point", np.zeros((1, 2))
    if thing.get("ellipse"):
        return "area", geometry.ellipse(w, h)
    if thing.get("capsule"):
        return "area", geometry.capsule(w, h)
    return "area", geometry.rectangle(w, h) - np.array(origin if "gid" in thing else (0, 0)) * (w, h)

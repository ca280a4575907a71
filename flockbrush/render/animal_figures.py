"""Animals from above without legs, each drawn from the distance of every pixel to its outline."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flockbrush.render.shapes import Pose, kernel, over, window

PLAIN, LEADER, PREDATOR, SHADOW = 0, 1, 2, 3
KINDS = 4
DART = 6.0  # pixels; a shorter animal is drawn as a dart, so that its heading can still be seen
SHORTEST = 4.0  # pixels; no dart is shorter
RINGED = 9.0  # pixels; a shorter leader is recoloured, for want of room for a ring
NO_WINGS = -9.0  # instead of a beat
WINGSPAN = 1.9  # body lengths
SHORTEST_BIRD = 5.0  # pixels of its body


class Coat(NamedTuple):
    """The colours, (3,) each, of a body with a light head end and an edge `rim` pixels wide."""

    body: np.ndarray
    head: np.ndarray
    edge: np.ndarray
    rim: float
    alpha: float


@kernel
def outline(long, thick, kite):
    """Half axis, rear radius and nose radius of an animal so long and thick, all in pixels."""
    if kite:
        long = max(long * 1.2, 10.0)
        rear = max(thick * 1.3, long * 0.27)
        nose = rear * 0.12
        return (long - rear - nose) / 2, rear, nose
    if long < DART:
        long = max(long, SHORTEST)
        rear = max(thick, long * 0.30)
        nose = rear * 0.55
        return max(long - rear - nose, 0.0) / 2, rear, nose
    rear = min(max(thick, long * 0.16), long / 2)
    nose = rear * 0.78
    return max(long - rear - nose, 0.0) / 2, rear, nose


@kernel
def _span(dy, fx, fy, long, wide, reach):
    """Between which offsets in x a row at offset dy can meet the box `long` along and `wide` across the heading."""
    low, high = -reach, reach
    if abs(fx) > 1e-3:
        middle, half = -dy * fy / fx, long / abs(fx)
        low, high = max(low, middle - half), min(high, middle + half)
    if abs(fy) > 1e-3:
        middle, half = dy * fx / fy, wide / abs(fy)
        low, high = max(low, middle - half), min(high, middle + half)
    return low, high


@kernel
def _plain(ink, alpha):
    """The coat of a mark or shadow, of one colour."""
    return Coat(ink, ink, ink, 0.0, alpha)


@kernel
def _capsule(frame, clip, pose, sides, grown, coat):
    """A capsule of an `outline`, `grown` pixels larger all around."""
    x, y, fx, fy = pose
    half, rear, nose = sides[0], sides[1] + grown, sides[2] + grown
    body, head, edge, rim, alpha = coat
    wide = max(rear, nose) + 0.5
    reach = abs(fx) * half + wide
    left, right, top, bottom = window(clip, x, y, reach, abs(fy) * half + wide)
    middle, slope = (rear + nose) / 2 + 0.5, (nose - rear) / 2 / max(half, 1e-9)
    neck, soft = 0.30 * half - 0.1 * nose + max(0.5 - 0.1 * half, 0.0), 1.0 / max(0.8, 0.22 * half)
    b0, b1, b2 = body[0], body[1], body[2]
    h0, h1, h2 = head[0] - b0, head[1] - b1, head[2] - b2
    for row in range(top, bottom):
        dy = row + 0.5 - y
        low, high = _span(dy, fx, fy, half + wide, wide, reach)
        for col in range(max(left, int(np.floor(x + low))), min(right, int(np.ceil(x + high)))):
            dx = col + 0.5 - x
            along, aside = dx * fx + dy * fy, dx * fy - dy * fx
            foot = min(max(along, -half), half)
            inside = middle + slope * foot - np.sqrt((along - foot) ** 2 + aside * aside)
            if not (fx != 0 or fy != 0):
                inside = middle - np.sqrt(dx * dx + dy * dy)
            if inside <= 0:
                continue
            light = min(max((along - neck) * soft + 0.5, 0.0), 1.0)
            red, green, blue = b0 + h0 * light, b1 + h1 * light, b2 + h2 * light
            if rim > 0:
                dark = min(max(rim + 1.0 - inside, 0.0), 1.0)
                red += (edge[0] - red) * dark
                green += (edge[1] - green) * dark
                blue += (edge[2] - blue) * dark
            over(frame, row, col, red, green, blue, min(inside, 1.0) * alpha)


@kernel
def _taper(px, py, ax, ay, bx, by, start, stop):
    """How far inside the line from a to b, tapering from radius `start` to `stop`, a point lies."""
    dx, dy = bx - ax, by - ay
    t = min(max(((px - ax) * dx + (py - ay) * dy) / max(dx * dx + dy * dy, 1e-9), 0.0), 1.0)
    return start + (stop - start) * t - np.sqrt((px - ax - t * dx) ** 2 + (py - ay - t * dy) ** 2)


@kernel
def _silhouette(frame, clip, pose, long, beat, grown, coat):
    """A bird from above, `grown` pixels larger all around; the head is light, and so is the wings' middle."""
    x, y, fx, fy = pose
    body, head, edge, rim, alpha = coat
    spread, sweep = np.cos(0.75 * beat), 0.11 * beat * long
    wing = 0.5 * WINGSPAN * long * spread
    wrist, hand = 0.12 * long - 0.3 * sweep, -0.16 * long - sweep  # how far ahead wrist and wing tip are
    more = min(max(0.6 - 0.03 * long, 0.1), 0.45)  # small ones need their room for colour
    arm, tip = 0.105 * long + more, 0.03 * long + 0.7 * more
    thick = 0.09 * long + 0.2 + more
    reach = np.sqrt(wing * wing + 0.09 * long * long) + 0.15 * long + grown + 1.5
    left, right, top, bottom = window(clip, x, y, reach, reach)
    wide = max(wing, 0.1 * long) + tip + 0.15 * long + grown + 1.0
    deep = max(abs(hand) + tip, 0.36 * long + thick) + grown + 1.0
    for row in range(top, bottom):
        dy = row + 0.5 - y
        low, high = _span(dy, fx, fy, deep, wide, reach)
        for col in range(max(left, int(np.floor(x + low))), min(right, int(np.ceil(x + high)))):
            dx = col + 0.5 - x
            along, aside = dx * fx + dy * fy, abs(dx * fy - dy * fx)
            inside = _taper(aside, along, 0.0, 0.06 * long, 0.42 * wing, wrist, 1.15 * arm, arm)
            if aside < 2 * thick + grown + 1:
                inside = max(
                    inside, _taper(aside, along, 0.0, -0.36 * long, 0.0, 0.36 * long, 0.8 * thick, 0.85 * thick),
                    _taper(aside, along, 0.0, 0.02 * long, 0.0, 0.12 * long, 1.35 * thick, thick),
                )  # fmt: skip
            if aside > 0.42 * wing - arm - grown - 1:
                inside = max(inside, _taper(aside, along, 0.42 * wing, wrist, wing, hand, arm, tip))
            inside += 0.5 + grown
            if inside <= 0:
                continue
            light = min(max((along - 0.24 * long) * 0.9 + 0.5, 0.0), 1.0) if aside < 1.5 * thick + grown else 0.0
            dark = 0.55 * min(max(aside / wing - 0.45, 0.0) * 2.2, 1.0)
            if rim > 0:
                dark = max(dark, min(max(rim + 1.0 - inside, 0.0), 1.0))
            red, green, blue = (
                body[0] + (head[0] - body[0]) * light,
                body[1] + (head[1] - body[1]) * light,
                body[2] + (head[2] - body[2]) * light,
            )
            over(
                frame, row, col, red + (edge[0] - red) * dark, green + (edge[1] - green) * dark,
                blue + (edge[2] - blue) * dark, min(inside, 1.0) * alpha,
            )  # fmt: skip


@kernel
def _bird(frame, clip, pose, long, kind, beat, colours):
    """A bird with spread wings, or its shadow; see `figure`."""
    long = max(long, SHORTEST_BIRD)
    if kind == SHADOW:
        _silhouette(frame, clip, pose, long, beat, 0.0, _plain(colours[5], 0.5 * colours[6, 0]))
        return
    if kind == LEADER:
        ring = min(max(0.07 * long, 0.9), 2.4)
        _silhouette(frame, clip, pose, long, beat, ring + 0.8, _plain(colours[4], 0.85))
        _silhouette(frame, clip, pose, long, beat, ring, _plain(colours[3], 1.0))
        if long < RINGED:
            return
    rim = min(max(0.05 * long - 0.4, 0.0), 1.0)
    _silhouette(frame, clip, pose, long, beat, 0.0, Coat(colours[0], colours[1], colours[2], rim, 1.0))


@kernel
def figure(frame, clip, pose, long, thick, kind, grounded, colours, beat):
    """Draw one animal `long` and `thick` pixels in size.

    Parameters
    ----------
    pose : Pose
        With a heading (0, 0) the animal is a dot.
    kind : int
        PLAIN, LEADER, PREDATOR or SHADOW.
    grounded : bool
        Its shadow lies right under it.
    colours : (7, 3) float64
        Body, head, edge, mark of leaders, dark, shadow; and the shadow's opacity, first in the last row.
    beat : float
        Of a bird on the wing: from -1, wings down, to 1, wings up; else NO_WINGS.
    """
    x, y, fx, fy = pose
    if beat > NO_WINGS and kind != PREDATOR and (fx != 0 or fy != 0):
        _bird(frame, clip, pose, long, kind, beat, colours)
        return
    long = max(long, SHORTEST)
    half, rear, nose = outline(long, thick, kind == PREDATOR)
    if fx == 0 and fy == 0:
        half = 0.0
    x, y = x + fx * (rear - nose) / 2, y + fy * (rear - nose) / 2  # so that both tips are as far off
    pose, sides = Pose(x, y, fx, fy), (half, rear, nose)
    body, head, edge, mark, dark, opacity = colours[0], colours[1], colours[2], colours[3], colours[4], colours[6, 0]
    if (grounded or kind == SHADOW) and opacity > 0:
        lift = 0.10 * long + 0.45 if grounded else 0.0
        wide = rear + (0.2 if kind == SHADOW else 0.3)
        below = Pose(x + 0.8 * lift, y + lift, fx, fy)
        _capsule(frame, clip, below, (half, wide, nose + 0.2), 0.0, _plain(colours[5], opacity))
    if kind == SHADOW:
        return
    rim = min(rear * 0.34, 1.1) * min(max(rear - 1.1, 0.0), 1.0)  # small ones need their room for colour
    if kind == PLAIN:
        _capsule(frame, clip, pose, sides, 0.0, Coat(body, head, edge, rim, 1.0))
    elif kind == PREDATOR:
        _capsule(frame, clip, pose, sides, 1.1, _plain(dark, 0.95))
        _capsule(frame, clip, pose, sides, 0.0, Coat(body, head, edge, 0.0, 1.0))
    elif long < RINGED:
        _capsule(frame, clip, pose, sides, 1.3, _plain(dark, 0.95))
        _capsule(frame, clip, pose, sides, 0.4, Coat(mark, head, edge, 0.0, 1.0))
    else:
        ring = min(max(rear * 0.42, 1.3), 3.0)
        _capsule(frame, clip, pose, (half, rear + ring, nose + ring), 0.9, _plain(dark, 0.85))
        _capsule(frame, clip, pose, sides, ring, _plain(mark, 1.0))
        _capsule(frame, clip, pose, sides, 0.0, Coat(body, head, edge, rim * 0.7, 1.0))

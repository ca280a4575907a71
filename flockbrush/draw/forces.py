"""Why an animal turns, as arrows with names that never lie on one another."""

from __future__ import annotations

import numpy as np

from flockbrush.draw.canvas import Canvas
from flockbrush.draw.style import Theme, mix, rgb
from flockbrush.draw.text import words

LONGEST, SHORTEST = 96.0, 20.0  # pixels of a hairline of 1; the strongest reason, the weakest that is shown
LEFT_OUT = 0.02  # of the strongest: weaker reasons have no arrow
GOING_ON = 62.0  # pixels: heading and wish, which are unit vectors

# after Okabe and Ito, for light ground and for dark
REASONS = {
    "avoidance": ("#c8502e", "#ff8a5c"),
    "cohesion": ("#0067a5", "#5ab4ff"),
    "alignment": ("#00805c", "#35d6a4"),
    "obstacles": ("#9a6a00", "#f0b030"),
    "guide": ("#7a52b3", "#c9a6ff"),
    "slope": ("#6d5f4b", "#c9b79a"),
    "wander": ("#b04f86", "#ff9fd0"),
    "back to the herd": ("#2d8fc4", "#8fdcff"),
    "fear": ("#8a1020", "#ff5468"),
    "prey": ("#8a1020", "#ff5468"),
}


def reason_colour(name: str, theme: Theme) -> tuple[int, int, int]:
    """The colour of a reason's arrow: of its own if we know it, else one that belongs to its name."""
    dark = sum(theme.paper) < 384
    if name == "heading":
        return theme.muted
    if name in REASONS:
        return rgb(REASONS[name][dark])
    known = list(REASONS.values())
    return rgb(known[sum(map(ord, name)) % len(known)][dark])


def draw_forces(frame, camera, at, forward, told, theme, unit=1.0, clear=10.0):
    """Draw the reasons of an `Explanation` around the animal at this pixel.

    Parameters
    ----------
    forward : (2,)
        Heading in the picture, y down.
    clear : float
        Pixels around the animal that are left free.
    """
    canvas = Canvas(frame, camera.view)
    arrows = arrows_of(told.terms, unit)
    heading = np.arctan2(forward[1], forward[0]) + 1e-9
    wish = np.array(told.result) * (1, -1)
    going = [("facing", np.array([np.cos(heading), np.sin(heading)]) * GOING_ON * unit, theme.muted)]
    going.append(("wish", wish / max(np.hypot(*wish), 1e-9) * (GOING_ON + 26) * unit, theme.ink))
    shown = [(name, way, reason_colour(name, theme)) for name, way in arrows]
    everything = [*going, *shown]
    at = np.array(at, float)
    for name, way, colour in everything:
        _arrow(canvas, at, way, clear, colour, theme, unit, thin=name == "facing")
    tips = [at + way * (1 + clear / max(np.hypot(*way), 1e-9)) for _, way, _ in everything]
    boxes = place_names([name for name, _, _ in everything], at, tips, camera.view, unit, clear)
    for (name, _, colour), box, tip in zip(everything, boxes, tips, strict=True):
        _name(canvas, name, box, tip, colour, theme, unit)


def arrows_of(terms, unit=1.0):
    """[(name, vector in pixels, y down)] of the reasons that turn the animal, the strongest LONGEST pixels long.

    Lengths go with the square root of the strength, so that weak reasons can be seen beside strong ones.
    """
    turning = [(name, np.array(vector, float) * (1, -1)) for name, vector in terms if name != "heading"]
    size = [float(np.hypot(*vector)) for _, vector in turning]
    most = max(size, default=0.0)
    kept = []
    for (name, vector), strong in zip(turning, size, strict=True):
        if most > 0 and strong > LEFT_OUT * most:
            long = max(LONGEST * np.sqrt(strong / most), SHORTEST) * unit
            kept.append((name, vector / strong * long))
    return kept


def _arrow(canvas, at, way, clear, colour, theme, unit, thin=False):
    """An arrow from the edge of the animal's circle along a vector."""
    long = float(np.hypot(*way))
    along = way / max(long, 1e-9)
    start, tip = at + along * clear, at + along * (clear + long)
    head, wide = (9 if thin else 12) * unit, (1.8 if thin else 3.2) * unit
    stem = tip - along * min(head * 0.8, long * 0.8)
    canvas.line([start, stem], wide + 2.6 * unit, theme.paper, 0.75)
    canvas.arrowhead(tip + along * 2 * unit, along, head + 4 * unit, theme.paper, 0.75)
    canvas.line([start, stem], wide, colour, 0.98)
    canvas.arrowhead(tip, along, head, colour)


def place_names(names, at, tips, view, unit=1.0, clear=10.0):
    """Boxes (left, top, right, bottom) for names near the tips of their arrows; none lies on another or on an arrow.

    Tried nearest first: beside the tip, then on wider and wider rings around it.
    """
    height = round(13 * unit)
    left, top, right, bottom = view
    taken: list[tuple] = []
    arrows = [(np.array(at, float), np.array(tip, float)) for tip in tips]
    boxes = []
    for name, tip in zip(names, tips, strict=True):
        tall, wide = words(name, height).shape
        wide, tall = wide + 10 * unit, tall + 5 * unit
        out = np.array(tip) - at
        angle = np.arctan2(out[1], out[0])
        best, least = None, np.inf
        for ring in range(12):
            far = 5 * unit + ring * 9 * unit
            for turn in (0, 0.35, -0.35, 0.7, -0.7, 1.1, -1.1, 1.6, -1.6, 2.2, -2.2):
                c, s = np.cos(angle + turn), np.sin(angle + turn)
                middle = np.array(tip) + (c * (far + wide / 2), s * (far + tall / 2))
                middle = np.clip(middle, (left + wide / 2, top + tall / 2), (right - wide / 2, bottom - tall / 2))
                box = (middle[0] - wide / 2, middle[1] - tall / 2, middle[0] + wide / 2, middle[1] + tall / 2)
                if any(_overlap(box, other) for other in taken):
                    continue
                cost = ring * 1.0 + abs(turn) + 6.0 * sum(_crossed(box, a, b) for a, b in arrows)
                cost += 6.0 * (np.hypot(*(np.clip(at, box[:2], box[2:]) - at)) < clear)
                if cost < least:
                    best, least = box, cost
            if least < ring:
                break
        if best is None:  # a picture smaller than its words
            best = (tip[0], tip[1], tip[0], tip[1])
        taken.append(best)
        boxes.append(best)
    return boxes


def _overlap(a, b):
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]


def _crossed(box, a, b):
    """Whether an arrow from a to b goes through a box."""
    along = np.linspace(0, 1, 24)[:, None]
    points = a + (b - a) * along
    return bool(((points > box[:2]) & (points < box[2:])).all(axis=1).any())


def _name(canvas, name, box, tip, colour, theme, unit):
    """A name on a quiet plate, tied to its arrow when it had to move away."""
    left, top, right, bottom = box
    if right - left < 2:
        return
    near = np.clip(tip, box[:2], box[2:])
    if np.hypot(*(near - tip)) > 12 * unit:
        canvas.line([tip, near], 1.0 * unit, colour, 0.8)
    plate = np.array([[left, top], [right, top], [right, bottom], [left, bottom]])
    canvas.area(plate, theme.paper, 0.86)
    canvas.line(plate, 1.0 * unit, colour, 0.55, closed=True)
    ink = mix(colour, theme.ink, 0.25)
    canvas.words(name, ((left + right) / 2, (top + bottom) / 2), round(13 * unit), ink, anchor=(0.5, 0.5))

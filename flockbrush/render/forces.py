"""Why an animal turns, as arrows with names that never lie on one another."""

from __future__ import annotations

import numpy as np

from flockbrush.render.canvas import Canvas
from flockbrush.render.shapes import ink_of, kernel
from flockbrush.render.strokes import draw_arrow, draw_lines, draw_plate
from flockbrush.render.style import Theme, mix, rgb
from flockbrush.render.text import words

LONGEST, SHORTEST = 96.0, 20.0  # pixels of a hairline of 1; the strongest reason, the weakest that is shown
LEFT_OUT = 0.02  # of the strongest: weaker reasons have no arrow
GOING_ON = 62.0  # pixels: heading and wish, which are unit vectors

# after Okabe and Ito, for light ground and for dark, moved until no two are alike to colour-blind eyes
REASONS = {
    "avoidance": ("#d96230", "#ff8a5c"),
    "cohesion": ("#0a64a1", "#418fca"),
    "alignment": ("#008062", "#35d6a4"),
    "obstacles": ("#7b4d00", "#f0b030"),
    "guide": ("#8165d2", "#c7a5ff"),
    "slope": ("#7b6f42", "#9b9697"),
    "wander": ("#b5568e", "#ffc8db"),
    "back to the herd": ("#2d8fc4", "#8fdcff"),
    "fear": ("#8a1020", "#ff5468"),
    "prey": ("#8a1020", "#ff5468"),  # nobody has both
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


def draw_forces(frame, camera, at, forward, explanation, theme, unit=1.0, clear=10.0):
    """Draw the reasons of an `Explanation` around the animal at this pixel.

    Parameters
    ----------
    forward : (2,)
        Heading in the picture, y down.
    clear : float
        Pixels around the animal that are left free.
    """
    canvas = Canvas(frame, camera.view)
    arrows = arrows_of(explanation.terms, unit)
    heading = np.arctan2(forward[1], forward[0]) + 1e-9
    wish = np.array(explanation.result) * (1, -1)
    going = [("facing", np.array([np.cos(heading), np.sin(heading)]) * GOING_ON * unit, theme.muted)]
    going.append(("wish", wish / max(np.hypot(*wish), 1e-9) * (GOING_ON + 26) * unit, theme.ink))
    shown = [(name, way, reason_colour(name, theme)) for name, way in arrows]
    everything = [*going, *shown]
    at = np.array(at, float)
    for name, way, colour in everything:
        _arrow(canvas, at, way, clear, colour, theme, unit, thin=name == "facing")
    tips = [at + way * (1 + clear / max(np.hypot(*way), 1e-9)) for _, way, _ in everything]
    tips = np.array(tips)
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
    arrows = []
    for (name, vector), strong in zip(turning, size, strict=True):
        if most > 0 and strong > LEFT_OUT * most:
            long = max(LONGEST * np.sqrt(strong / most), SHORTEST) * unit
            arrows.append((name, vector / strong * long))
    return arrows


def _arrow(canvas, at, way, clear, colour, theme, unit, thin=False):
    """An arrow from the edge of the animal's circle along a vector."""
    long = float(np.hypot(*way))
    along = way / max(long, 1e-9)
    start, tip = at + along * clear, at + along * (clear + long)
    head, wide = (9 if thin else 12) * unit, (1.8 if thin else 3.2) * unit
    clip = np.array(canvas.clip, np.int64)
    ends = (*map(float, start), *map(float, tip))
    draw_arrow(canvas.image, clip, ends, wide, head, 1.4 * unit, ink_of(theme.paper), 0.75)
    draw_arrow(canvas.image, clip, ends, wide, head, 0.0, ink_of(colour), 1.0)


def place_names(names, at, tips, view, unit=1.0, clear=10.0):
    """Boxes (n, 4), left, top, right, bottom, for names near the tips of their arrows; none lies on another.

    Those that do not cover an arrow are taken first, and the nearer ones.
    """
    sizes = np.array([words(name, round(13 * unit)).shape[::-1] for name in names], float) + (10 * unit, 5 * unit)
    return _place(sizes, np.asarray(at, float), np.asarray(tips, float), np.array(view, float), unit, clear)


@kernel
def _place(sizes, at, tips, view, unit, clear):
    """Try places beside each tip, then on wider and wider rings around it."""
    count = len(sizes)
    boxes = np.zeros((count, 4))
    for k in range(count):
        wide, tall = sizes[k, 0], sizes[k, 1]
        angle = np.arctan2(tips[k, 1] - at[1], tips[k, 0] - at[0])
        least = np.inf
        boxes[k] = np.array([tips[k, 0], tips[k, 1], tips[k, 0], tips[k, 1]])  # a picture smaller than its words
        for ring in range(40):
            if least < ring:
                break
            far = (5 + ring * 9) * unit
            for turn in range(11):
                swing = (turn + 1) // 2 * 0.45 * (1 - 2 * (turn % 2))
                x = tips[k, 0] + np.cos(angle + swing) * (far + wide / 2)
                y = tips[k, 1] + np.sin(angle + swing) * (far + tall / 2)
                x = min(max(x, view[0] + wide / 2), view[2] - wide / 2)
                y = min(max(y, view[1] + tall / 2), view[3] - tall / 2)
                box = (x - wide / 2, y - tall / 2, x + wide / 2, y + tall / 2)
                free = True
                for other in range(k):
                    b = boxes[other]
                    free &= not (box[0] < b[2] and b[0] < box[2] and box[1] < b[3] and b[1] < box[3])
                if not free:
                    continue
                cost = ring + abs(swing)
                for other in range(count):
                    cost += 6.0 * _crossed(box, at, tips[other])
                dx = min(max(at[0], box[0]), box[2]) - at[0]
                dy = min(max(at[1], box[1]), box[3]) - at[1]
                cost += 6.0 * (dx * dx + dy * dy < clear * clear)
                if cost < least:
                    least = cost
                    boxes[k] = np.array(box)
    return boxes


@kernel
def _crossed(box, a, b):
    """1 if the line from a to b goes through a box, else 0."""
    low, high = 0.0, 1.0
    for side in range(2):
        step = b[side] - a[side]
        if step == 0.0:
            if not box[side] < a[side] < box[side + 2]:
                return 0.0
            continue
        one, other = (box[side] - a[side]) / step, (box[side + 2] - a[side]) / step
        low, high = max(low, min(one, other)), min(high, max(one, other))
    return 1.0 if low < high else 0.0


def _name(canvas, name, box, tip, colour, theme, unit):
    """A name on a quiet plate, tied to its arrow when it had to move away."""
    left, top, right, bottom = box
    if right - left < 2:
        return
    near = np.clip(tip, box[:2], box[2:])
    if np.hypot(*(near - tip)) > 12 * unit:
        line = np.array([[*tip, *near]])
        draw_lines(canvas.image, np.array(canvas.clip, np.int64), line, 1.0 * unit, ink_of(colour), 0.8)
    clip, sides = np.array(canvas.clip, np.int64), (round(float(side)) for side in box)
    draw_plate(canvas.image, clip, *sides, np.array(theme.paper, float), 0.86, np.array(colour, float), 0.6)
    ink = mix(colour, theme.ink, 0.25)
    canvas.words(name, ((left + right) / 2, (top + bottom) / 2), round(13 * unit), ink, anchor=(0.5, 0.5))

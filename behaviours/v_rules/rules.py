"""Where one bird goes next: the three rules of Nathan & Barbosa 2008 [1]_, from one bird's view of the flock.

The kernels know arrays of positions in the frame that flies with the flock: ``x`` to the right, ``y`` along the way,
``z`` up.  Both the world model (`flockbrush.behaviours.models.v_rules`) and the experiments with thousands of flocks
(`flockbrush.behaviours.v_rules.flights`) call them, so the two cannot drift apart.

.. [1] Nathan, A. & Barbosa, V. C. (2008). V-like formations in flocks of artificial birds. Artificial Life 14(2),
   179-188.
"""

from __future__ import annotations

import math
from typing import Literal, NamedTuple

import numpy as np
from flockbrush.behaviours.behaviour import Parameters, quantity
from flockbrush.engine.maths import atan2_, sincos_
from numba import njit
from pydantic import Field

OVERLAP = (math.pi / 4 - 1) / 2  # wingspans: most upwash is where wings overlap by so much (λ is negative)
kernel = njit(cache=True, nogil=True, error_model="numpy")
EXACT = 1e-6  # wingspans: nearer to a place than this is at the place


def _choice(default, meaning):
    return Field(default, description=meaning, json_schema_extra={"unit": "-"})


class VRuleSettings(Parameters):
    """Table 1 of the paper in wingspans, and every detail it leaves open with the choice that was settled on."""

    angle: float = quantity(180.0, "degrees", "angle ahead in which a bird looks for the nearest bird (α)", 1, 180)
    upwash_width: float = quantity(0.6, "wingspans", "lateral width of each region of upwash (l)", 0.01, 10)
    upwash_length: float = quantity(1.0, "wingspans", "length of the wake behind a bird (d)", 0.01, 20)
    lateral_room: float = quantity(
        OVERLAP, "wingspans", "gap between wingtips at which upwash is best; negative: the wings overlap (λ)", -0.49, 2
    )
    lateral_step: float = quantity(0.06, "wingspans", "lateral displacement in a time step (Δx)", 0.001, 1)
    forward_step: float = quantity(0.06, "wingspans", "longitudinal displacement in a time step (Δy)", 0.001, 1)
    margin: float = quantity(0.18, "wingspans", "smallest distance along the flight direction between birds (ε)", 0, 5)
    update: Literal["in turn", "together"] = _choice(
        "in turn",
        "in turn: each bird sees the moves of earlier birds in the same step; together: all choose at "
        "once and give way in turn",
    )
    approach: Literal["axis", "box", "coin", "diagonal"] = _choice(
        "axis",
        "rule 1, when the next bird is near along the flight direction: sideways or forward at random "
        "in proportion to the remaining distances, sideways only, by a fair coin, or both at once",
    )
    gaps_between: Literal["ahead", "all"] = _choice(
        "ahead", "whether gaps lie between birds ahead only, or between all birds"
    )
    tips: Literal["ahead", "angle"] = _choice(
        "ahead", "rule 2: whether wingtips of all birds ahead count, or (the paper) only of birds within the angle"
    )
    station: Literal["clear", "spaced"] = _choice(
        "clear",
        "rule 3: whether a bird needs the best spacing and a clear view, or only the spacing (birds then stack)",
    )
    sight: Literal["whole", "tip", "free"] = _choice(
        "whole", "rule 2: what must be in view: the whole place beside the wingtip, only the wingtip, or nothing"
    )
    nearest: Literal["distance", "lateral"] = _choice(
        "distance", "rule 2: whether the nearest wingtip is chosen by distance or by lateral distance"
    )
    shift: Literal["clipped", "fixed"] = _choice(
        "clipped", "whether the last lateral step ends at the target place, or is a full step"
    )
    blocked: Literal["coin", "stay"] = _choice(
        "coin", "whether a blocked bird moves forward or back at random, or stays"
    )
    wake_begins: Literal["wake", "wingtip"] = _choice(
        "wake", "whether upwash begins at the edge of the downwash (½ w + λ), or at the wingtip"
    )
    layer: float = quantity(
        0.0,
        "wingspans",
        "birds whose heights differ by at most this affect and hide one another; 0: all fly at one height",
        0,
        20,
    )
    perturbation: float = quantity(
        0.0, "wingspans", "random displacement of each bird in a time step, per axis (root mean square)", 0, 1
    )
    turn: float = quantity(
        0.0,
        "rad",
        "largest turn of a bird in a time step to move sideways; 0 (the paper): it slides without turning",
        0,
        3.2,
    )
    cruise: float = quantity(
        0.25,
        "wingspans",
        "distance flown in a time step; it matters only for birds that turn, and in the world frame",
        0,
        10,
    )


class Law(NamedTuple):
    """`Rules` as the kernels want them: numbers, lengths in units of the caller."""

    cotangent: float  # of half the angle
    wing: float
    depth: float
    outer: float  # lateral edge of the wake
    best: float  # from body to body where upwash is best
    sideways: float
    forward: float
    wide: float  # birds nearer than this to the side
    long: float  # keep so far apart along the way
    exact: float
    layer: float
    perturbation: float
    turn: float
    cruise: float
    approach: int
    all_bound: bool
    tips_in_angle: bool
    needs_clear: bool
    sight: int
    lateral_nearest: bool
    clipped: bool
    coin: bool
    in_turn: bool


def law_of(rules: VRuleSettings, wingspan: float = 1.0, steps: float = 1.0) -> Law:
    """The law for a wingspan in the caller's unit and for so many of the paper's time steps at once."""
    half = math.radians(0.5 * rules.angle)
    w = wingspan
    wake = 0.5 if rules.wake_begins == "wingtip" else 0.5 + rules.lateral_room
    sideways = w * rules.lateral_step * steps
    return Law(
        cotangent=0.0 if rules.angle == 180.0 else math.cos(half) / math.sin(half),
        wing=w,
        depth=w * rules.upwash_length,
        outer=w * (wake + rules.upwash_width),
        best=w * (1.0 + rules.lateral_room),
        sideways=sideways,
        forward=w * rules.forward_step * steps,
        wide=w - w * EXACT,
        long=w * rules.margin - w * EXACT,
        exact=w * EXACT + (0.0 if rules.shift == "clipped" else 0.5 * sideways),
        layer=w * rules.layer,
        perturbation=w * rules.perturbation * math.sqrt(steps),
        turn=rules.turn * steps,
        cruise=w * rules.cruise * steps,
        approach=("axis", "box", "coin", "diagonal").index(rules.approach),
        all_bound=rules.gaps_between == "all",
        tips_in_angle=rules.tips == "angle",
        needs_clear=rules.station == "clear",
        sight=("whole", "tip", "free").index(rules.sight),
        lateral_nearest=rules.nearest == "lateral",
        clipped=rules.shift == "clipped",
        coin=rules.blocked == "coin",
        in_turn=rules.update == "in turn",
    )


@kernel
def wish(law, i, n, x, y, z, by_x, chance):
    """What bird i would do: its displacement to the side, forward and up; all 0 when it is content.

    Parameters
    ----------
    i, n : int
        The bird, and how many there are.
    x, y, z : ndarray (n,)
    by_x : ndarray (n,) of int
        Birds from left to right.
    chance : float
        Even over [0, 1).
    """
    j = nearest_ahead(law, i, n, x, y, z)
    if j < 0:
        return 0.0, 0.0, 0.0  # no bird to join: it leads
    dx, dy, dz = x[j] - x[i], y[j] - y[i], z[j] - z[i]
    if dy > law.depth or abs(dx) > law.outer or abs(dz) > law.layer:
        return _approach(law, dx, dy, dz, chance)  # rule 1
    if _stationed(law, i, n, x, y, z):
        return 0.0, 0.0, 0.0  # rule 3
    return _to_gap(law, i, n, x, y, z, by_x, chance)  # rule 2


@kernel
def nearest_ahead(law, i, n, x, y, z):
    """The nearest bird within the angle; -1 for none."""
    best, who = np.inf, -1
    for j in range(n):
        dx, dy, dz = x[j] - x[i], y[j] - y[i], z[j] - z[i]
        aside = abs(dx) if law.layer == 0.0 else np.sqrt(dx * dx + dz * dz)
        if dy >= aside * law.cotangent and j != i:
            d2 = dx * dx + dy * dy + dz * dz
            if d2 < best:
                best, who = d2, j
    return who


@kernel
def _approach(law, dx, dy, dz, chance):
    """One step towards the box behind a bird at (dx, dy, dz)."""
    side = law.sideways if dx > 0.0 else -law.sideways
    up = law.sideways if dz > 0.0 else -law.sideways
    behind, aside, off = dy > law.depth, abs(dx) > law.outer, abs(dz) > law.layer
    if law.approach == 3:
        return (side if aside else 0.0), (law.forward if behind else 0.0), (up if off else 0.0)
    if behind and not ((aside or off) and law.approach == 2 and chance < 0.5):
        return 0.0, law.forward, 0.0
    across, rise = (abs(dx) if aside else 0.0), (abs(dz) if off else 0.0)
    forward = dy if law.approach == 0 else (across + rise if law.approach == 2 and not behind else 0.0)
    at = chance if law.approach != 2 or not behind else 2.0 * chance
    at *= across + rise + forward
    if at < across:
        return side, 0.0, 0.0
    if at < across + rise:
        return 0.0, 0.0, up
    return 0.0, law.forward, 0.0


@kernel
def _stationed(law, i, n, x, y, z):
    """Whether no bird is ahead of bird i, or it has the best upwash and a clear view."""
    leads, spaced = True, False
    for j in range(n):
        dy = y[j] - y[i]
        if dy > 0.0 and j != i:
            leads = False
            aside, off = abs(x[j] - x[i]), abs(z[j] - z[i])
            if law.needs_clear and aside < law.best - law.exact and off <= law.layer:
                return False
            spaced |= dy <= law.depth and abs(aside - law.best) <= law.exact and off <= law.exact
    return leads or spaced


@kernel
def _to_gap(law, i, n, x, y, z, by_x, chance):
    """The step towards the nearest wingtip with a gap beside it."""
    nearest, place, height = np.inf, x[i], z[i]
    before = -1
    for at in range(n + 1):
        k = by_x[at] if at < n else -1
        if k == i or (k >= 0 and (abs(z[k] - z[i]) > law.layer or not (law.all_bound or y[k] > y[i]))):
            continue
        if before < 0 or k < 0 or x[k] - x[before] >= 2.0 * law.best - law.exact:
            for right in range(2):
                owner = before if right else k
                if owner < 0 or y[owner] <= y[i]:
                    continue
                side = 1.0 if right else -1.0
                tip = x[owner] + side * 0.5 * law.wing
                dx, dy, dz = tip - x[i], y[owner] - y[i], z[owner] - z[i]
                if law.tips_in_angle and dy < abs(x[owner] - x[i]) * law.cotangent:
                    continue
                far = abs(dx) if law.lateral_nearest else dx * dx + dy * dy + dz * dz
                if far < nearest and _in_view(law, i, owner, n, x, y, z, tip, side):
                    nearest, place, height = far, x[owner] + side * law.best, z[owner]
        before = k
    across, rise = place - x[i], height - z[i]
    if abs(across) <= law.exact:
        across = 0.0
    if abs(rise) <= law.exact:
        rise = 0.0
    if rise != 0.0 and chance * (abs(across) + abs(rise)) >= abs(across):
        return 0.0, 0.0, _step(law, rise)
    return _step(law, across), 0.0, 0.0


@kernel
def _step(law, d):
    if d == 0.0:
        return 0.0
    size = min(abs(d), law.sideways) if law.clipped else law.sideways
    return size if d > 0.0 else -size


@kernel
def _in_view(law, i, owner, n, x, y, z, tip, side):
    """Whether no wing crosses the triangle from bird i to the place beside a wingtip."""
    if law.sight == 2:
        return True
    end = tip if law.sight == 1 else tip + side * (2.0 * law.best - law.wing)
    for m in range(n):
        if m == owner or y[m] <= y[i] or y[m] >= y[owner] or abs(z[m] - z[i]) > law.layer:
            continue
        t = (y[m] - y[i]) / (y[owner] - y[i])
        a, b = x[i] + t * (tip - x[i]), x[i] + t * (end - x[i])
        if x[m] + 0.5 * law.wing > min(a, b) and x[m] - 0.5 * law.wing < max(a, b):
            return False
    return True


@kernel
def would_collide(law, i, n, x, y, z, mx, my, mz):
    """Whether a displacement would bring bird i too near another; birds too near already may part."""
    for k in range(n):
        dx, dy = abs(x[k] - x[i] - mx), abs(y[k] - y[i] - my)
        if dx < law.wide and dy < law.long and abs(z[k] - z[i] - mz) < law.long and k != i:
            wasx, wasy, wasz = abs(x[k] - x[i]), abs(y[k] - y[i]), abs(z[k] - z[i])
            near = wasx < law.wide and wasy < law.long and wasz < law.long
            if not (near and dx >= wasx and dy >= wasy and abs(z[k] - z[i] - mz) >= wasz):
                return True
    return False


@kernel
def dodge(law, i, n, x, y, z, mx, my, mz, coin):
    """The displacement a bird really makes: one that is blocked moves forward or back by chance, if it can."""
    if not would_collide(law, i, n, x, y, z, mx, my, mz):
        return mx, my, mz
    if law.coin:
        my = law.forward if coin < 0.5 else -law.forward
        if not would_collide(law, i, n, x, y, z, 0.0, my, 0.0):
            return 0.0, my, 0.0
    return 0.0, 0.0, 0.0


@kernel
def turned(law, angle, mx, my):
    """(angle, lateral, longitudinal) of a bird that turns to get sideways: its new angle and what becomes of a wish.

    It brakes in time: sideways no faster than it can turn back from.
    """
    brake = np.sqrt(2.0 * law.cruise * law.turn * abs(mx))
    sideways = min(abs(mx), brake) if mx > 0.0 else -min(abs(mx), brake)
    wanted = atan2_(sideways, law.cruise + my)
    angle += min(max(wanted - angle, -law.turn), law.turn)
    sine, cosine = sincos_(angle)
    return angle, (law.cruise + my) * sine / max(cosine, 1e-3), my


@kernel
def sort_by(values, order, n):
    """Put a nearly sorted order of ``values`` in order."""
    for a in range(1, n):
        item = order[a]
        b = a - 1
        while b >= 0 and values[order[b]] > values[item]:
            order[b + 1] = order[b]
            b -= 1
        order[b + 1] = item

"""What the urges of boids ask for that concern no neighbours: obstacles, the ground, fear, migration, height.

Inside the kernel of `flockbrush.behaviours.models.boids`; a request is an acceleration in shares of the most there is.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from flockbrush.engine.lane_maths import lane_function

SAFETY = 5.0  # times the acceleration that would just do, asked for to pass an obstacle.  By trial: 2 grazes corners
STANDING = 0.05  # of the maximum speed: slower birds were stopped by something, and turn away from it
BESIDE = 2.0  # body lengths: nearer than this to a surface it goes off it before it heeds others, whatever is ahead
OFF = 2.0  # how firmly, right at the surface.  By trial: with 0 a third of a flock touch the pillars that they pass


class Around(NamedTuple):
    """What is around a bird besides the flock (`flockbrush.behaviours.behaviour.Air`)."""

    hit: Any
    aim: Any
    gap: Any
    normal: Any
    height: Any
    bound: Any
    target: Any
    danger_first: Any
    danger_offset: Any


class Rule(NamedTuple):
    """The parameters as the kernel wants them."""

    dt: float
    strength: tuple
    average: bool
    field: bool
    grounded: bool
    cut2: float  # neighbour_range squared
    per_range: float  # 1 / neighbour_range
    exponent: float
    lean: float  # half the forward_weight
    apart2: float  # separation squared
    soon: float  # 1 / (matching_time * most)
    field_range: float
    flight_distance: float
    panic_pace: float
    height: float
    clearance: float
    most: float  # body lengths / s^2
    per_most: float
    top: float  # body lengths / s
    per_top: float


class Bird(NamedTuple):
    """One bird, in its own body lengths."""

    own: float  # m
    per: float  # 1 / m
    fx: float
    fy: float
    fz: float
    vx: float
    vy: float
    vz: float
    speed: float


@lane_function
def clear_of_obstacles(i, one, around, rule):
    """The request of obstacles and of the ground."""
    gap, hit = around.gap[i] * one.per, around.hit[i] * one.per
    x = y = z = 0.0
    if gap < (rule.field_range if rule.field else BESIDE) or np.isfinite(hit):
        normal = around.normal[3 * i], around.normal[3 * i + 1], around.normal[3 * i + 2]
        if rule.field:
            push = max(1.0 - max(gap, 0.0) / rule.field_range, 0.0) ** 2
            x, y, z = push * normal[0], push * normal[1], push * normal[2]
        else:
            aim = around.aim[3 * i], around.aim[3 * i + 1], around.aim[3 * i + 2]
            x, y, z = _past(one, hit, aim, gap, normal, rule)
    # the ground: as a plane below that rises as fast as the bird sinks
    low = around.height[i] * one.per - rule.clearance
    if low < 0.0 and not rule.grounded:
        z += min(-low / max(rule.clearance, 1e-9), 1.0) + max(-one.vz, 0.0) * rule.per_most
    return x, y, z


@lane_function
def _past(one, hit, aim, gap, normal, rule):
    """The request of obstacles that are steered past; lengths in body lengths.

    It is the acceleration across the heading that reaches the aim by the time of the impact, and some more, and keeps
    off what is within `BESIDE`: else the wishes of others press a bird that just passes an edge onto what lies behind.
    """
    if one.speed < STANDING * rule.top and gap < 1.0:  # in a nook both ways past are barred
        return normal[0], normal[1], normal[2]
    off = OFF * max(1.0 - gap / BESIDE, 0.0)
    bx, by, bz = off * normal[0], off * normal[1], off * normal[2]
    if not np.isfinite(hit):
        return bx, by, bz
    along = one.fx * aim[0] + one.fy * aim[1] + one.fz * aim[2]
    x, y, z = aim[0] - along * one.fx, aim[1] - along * one.fy, aim[2] - along * one.fz
    size = np.sqrt(x * x + y * y + z * z)
    if size < 1e-9:
        return bx, by, bz
    distance = max(hit, 0.5)
    aside = distance * size / max(along, 0.2)
    ask = SAFETY * 2.0 * aside * one.speed * one.speed / (distance * distance * rule.most)
    ask = min(ask, 1.0) / size
    return ask * x + bx, ask * y + by, ask * z + bz


@lane_function
def away_from_danger(i, one, around, rule):
    """The request of fear, and the pace that it sets."""
    x = y = z = worst = 0.0
    for at in range(around.danger_first[i], around.danger_first[i + 1]):
        dx, dy, dz = around.danger_offset[3 * at], around.danger_offset[3 * at + 1], around.danger_offset[3 * at + 2]
        dx, dy, dz = -dx * one.per, -dy * one.per, -dz * one.per
        d = np.sqrt(dx * dx + dy * dy + dz * dz)
        if 0.0 < d < rule.flight_distance:
            fear = 1.0 - d / rule.flight_distance
            x, y, z = x + fear * dx / d, y + fear * dy / d, z + fear * dz / d
            worst = max(worst, fear)
    return (2.0 * x, 2.0 * y, 2.0 * z), 1.0 + (rule.panic_pace - 1.0) * worst


@lane_function
def to_target(i, one, around):
    """The request of migration: turned towards the target, not hurried."""
    if not around.bound[i] > 0:
        return 0.0, 0.0, 0.0
    x, y, z = around.target[3 * i], around.target[3 * i + 1], around.target[3 * i + 2]
    size = np.sqrt(x * x + y * y + z * z)
    if not size > 1e-9:
        return 0.0, 0.0, 0.0
    x, y, z = x / size, y / size, z / size
    along = one.fx * x + one.fy * y + one.fz * z
    if along < -0.999:  # where it lies behind, to the side that is nearer
        x, y, z, along = x - one.fy, y + one.fx, z, 0.0
    return 2.0 * (x - along * one.fx), 2.0 * (y - along * one.fy), 2.0 * (z - along * one.fz)


@lane_function
def to_height(height, one, rule):
    """The request upwards of height, or of level flight; height above the ground in m."""
    if rule.grounded:
        return 0.0
    climb = 0.0
    if rule.height > 0.0:
        climb = min(max((rule.height - height) * one.per / 10.0, -0.5), 0.5) * one.speed
    return min(max((climb - one.vz) * 2.0 * rule.per_most, -1.0), 1.0)


@lane_function
def turned(one, x, y, z, dt):
    """The heading after a tick of this acceleration, m/s^2."""
    if x == 0.0 and y == 0.0 and z == 0.0:
        return one.fx, one.fy, one.fz
    speed = one.speed * one.own
    u, v, w = one.fx * speed + dt * x, one.fy * speed + dt * y, one.fz * speed + dt * z
    size = np.sqrt(u * u + v * v + w * w)
    if size < 1e-9:
        return one.fx, one.fy, one.fz
    share = 1.0 / size
    return share * u, share * v, share * w

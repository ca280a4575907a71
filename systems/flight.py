"""Geometric flight: forward along the heading, steering by pitch and yaw, rolling into the turn (Reynolds 1987 [1]_).

A bird has momentum.  In a tick its velocity changes by what its model wishes,
cut to the acceleration it can give, by damping, which brings the speed back to
the bird's own, and by as much of gravity, buoyancy and lift as its brush has;
the heading turns with the velocity, without roll.  Roll is banking: the back
turns towards the acceleration that the bird feels, lateral acceleration and
what bears its weight together.

Then it goes that far, along what it meets: nobody is inside a solid or under
the ground after a step, whatever the model wished (`flockbrush.engine.solids.slide_`).
Solids that move push whom they meet.  Nobody rises faster than its species climbs:
before ground that rises faster a bird is turned aside.

Damping towards one's own speed (`components.Speed.target`) instead of towards
rest is ours: so the house's speed process, painted caps and sprints hold in
the air as well.

.. [1] Reynolds, C. W. (1987). Flocks, herds, and schools: a distributed behavioral model. Computer Graphics 21(4),
   25-34; "Geometric Flight" and "Banking".
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from flockbrush.behaviours.behaviour import Flight
from flockbrush.components import Airborne, Body, Heading, Position, Velocity
from flockbrush.components.agent import BY_ACCELERATION, BY_VELOCITY
from flockbrush.engine.maths import atan2_, inner_kernel, kernel_function, sincos_
from flockbrush.engine.seam import on_the_map_
from flockbrush.engine.solid_queries import out_of_, slide_
from flockbrush.systems.ground_height import below, height_of_ground, round_steep_ground
from flockbrush.systems.sightline import step
from numba import njit

GRAVITY = 9.81  # m/s^2
CLEAR = 1e-5  # m kept free between bodies and solids, more than rounding ever takes in a corner
(
    MIN_SPEED, MAX_SPEED, MAX_ACCELERATION, DAMPING, WEIGHT, BUOYANCY, LIFT, BANKING, ROLL_TIME, _, GROUNDED, EXACT,
) = range(len(Flight._fields))  # fmt: skip


class Flyers(NamedTuple):
    """Bodies in the air, by row: those on the ground have rows too."""

    xyz: np.ndarray  # (n, 3) m
    velocity: np.ndarray  # (n, 3) m/s
    forward: np.ndarray  # (n, 3) unit vectors
    up: np.ndarray  # (n, 3) unit vectors out of the back
    length: np.ndarray  # (n,) m
    radius: np.ndarray  # (n,) m


def flyers_of(agents):
    """`Flyers` of the animals of a world."""
    columns = Position.xyz, Velocity.xyz, Heading.forward, Airborne.up, Body.length, Body.radius
    return Flyers(*(agents[column] for column in columns))


class FlightLimits(NamedTuple):
    """What bodies can do, (n,) each unless stated."""

    flight: np.ndarray  # (b, 12), rows of `flockbrush.behaviours.behaviour.Flight` by brush
    brush: np.ndarray
    turn: np.ndarray  # rad/s
    climb: np.ndarray  # m/s, the fastest that each rises
    target: np.ndarray  # m/s, its own speed
    cap: np.ndarray  # m/s


class WantedFlight(NamedTuple):
    """What models want of bodies in the air, by row."""

    kind: np.ndarray  # (n,) `BY_HEADING`, `BY_ACCELERATION` or `BY_VELOCITY`
    acceleration: np.ndarray  # (n, 3) m/s^2
    velocity: np.ndarray  # (n, 3) m/s
    direction: np.ndarray  # (n, 3) unit vectors
    transit: np.ndarray  # (n,) 0 for animals that neither land nor take off


@step
def _unit(x, y, z, ex, ey, ez):
    """(x, y, z) with length 1; the other vector where it has no direction."""
    size = np.sqrt(x * x + y * y + z * z)
    if size < 1e-12:
        return ex, ey, ez
    return x / size, y / size, z / size


@step
def _cut(x, y, z, most):
    """(x, y, z), no longer than ``most``."""
    size = np.sqrt(x * x + y * y + z * z)
    if size > most:
        share = most / size
        return x * share, y * share, z * share
    return x, y, z


@kernel_function
def turned_without_roll(ux, uy, uz, fx, fy, fz, gx, gy, gz):
    """A vector ``u`` at right angles to the unit vector ``f``, turned as ``f`` is turned to ``g`` the short way."""
    dot = fx * gx + fy * gy + fz * gz
    along = ux * gx + uy * gy + uz * gz
    if dot > -0.999999:
        share = along / (1.0 + dot)
        ux, uy, uz = ux - share * (fx + gx), uy - share * (fy + gy), uz - share * (fz + gz)
    # at right angles to the last bit, so that a thousand turns do not bend the frame
    along = ux * gx + uy * gy + uz * gz
    ux, uy, uz = ux - along * gx, uy - along * gy, uz - along * gz
    ex, ey, ez = (-gx * gz, -gy * gz, 1.0 - gz * gz) if abs(gz) < 0.9 else (1.0 - gx * gx, -gx * gy, -gx * gz)
    ex, ey, ez = _unit(ex, ey, ez, 1.0, 0.0, 0.0)
    return _unit(ux, uy, uz, ex, ey, ez)


@kernel_function
def rolled(ux, uy, uz, gx, gy, gz, tx, ty, tz, share):
    """``u`` turned about the heading ``g``, by a share of its angle to the part of ``t`` at right angles to ``g``."""
    along = tx * gx + ty * gy + tz * gz
    tx, ty, tz = tx - along * gx, ty - along * gy, tz - along * gz
    rx, ry, rz = gy * uz - gz * uy, gz * ux - gx * uz, gx * uy - gy * ux
    angle = atan2_(tx * rx + ty * ry + tz * rz, tx * ux + ty * uy + tz * uz)
    sine, cosine = sincos_(share * angle)
    return _unit(cosine * ux + sine * rx, cosine * uy + sine * ry, cosine * uz + sine * rz, ux, uy, uz)


@kernel_function
def limited_turn(fx, fy, fz, gx, gy, gz, limit):
    """``g``, or as far towards it as ``limit`` rad allow."""
    if limit >= np.pi:
        return gx, gy, gz
    sine, cosine = sincos_(limit)
    dot = fx * gx + fy * gy + fz * gz
    if dot >= cosine:
        return gx, gy, gz
    sx, sy, sz = gx - dot * fx, gy - dot * fy, gz - dot * fz
    sx, sy, sz = _unit(sx, sy, sz, -fy, fx, 0.0)
    return cosine * fx + sine * sx, cosine * fy + sine * sy, cosine * fz + sine * sz


@njit(cache=True, nogil=True, error_model="numpy")
def fly(lo, hi, order, dt, flyers, limits, wanted, solids, hills):
    """One tick of flight for the rows of ``order[lo:hi]``: writes position, velocity, heading and up."""
    xyz, velocity, forward, up, _, radius = flyers
    flight, brush, turn, climb, _, cap = limits
    heights = hills.heights
    for o in range(lo, hi):
        i = order[o]
        held, limit, w = flight[brush[i], GROUNDED] != 0.0, turn[i] * dt, radius[i]
        fx, fy, fz = forward[i, 0], forward[i, 1], forward[i, 2]
        vx, vy, vz = velocity[i, 0], velocity[i, 1], velocity[i, 2]
        (nx, ny, nz), (gx, gy, gz) = _steered(i, dt, flyers, limits, wanted)
        ux, uy, uz = turned_without_roll(up[i, 0], up[i, 1], up[i, 2], fx, fy, fz, gx, gy, gz)
        if held:
            ux, uy, uz = 0.0, 0.0, 1.0
        else:  # the bird feels the change of its velocity across its way, and what bears its weight
            bank, share = flight[brush[i], BANKING], min(dt / max(flight[brush[i], ROLL_TIME], dt), 1.0)
            tx, ty, tz = bank * ((nx - vx) / dt), bank * ((ny - vy) / dt), bank * ((nz - vz) / dt) + GRAVITY
            ux, uy, uz = rolled(ux, uy, uz, gx, gy, gz, tx, ty, tz, share)
        x, y, z = xyz[i, 0], xyz[i, 1], xyz[i, 2]
        touched, px, py, pz = False, x + nx * dt, y + ny * dt, z + nz * dt
        if len(solids.kind):
            _, px, py, pz = out_of_(solids, x, y, z, w + CLEAR)
            touched, px, py, pz = slide_(solids, px, py, pz, nx * dt, ny * dt, nz * dt, w + CLEAR)
            touched |= (px != x + nx * dt) | (py != y + ny * dt) | (pz != z + nz * dt)
        if held:
            px, py = _on_its_ground(hills, i, x, y, px, py, fx, fy, w, solids)
            touched |= (px != x + nx * dt) | (py != y + ny * dt)
        low = height_of_ground(heights, px, py) + w
        if held:
            touched |= pz != low - w
            pz = low - w
        elif pz < low:
            touched = True
            px, py, pz = _over_the_ground(x, y, z, px, py, pz, climb[i] * dt, w, solids, heights)
        if touched:  # it is where it came to that counts
            nx, ny, nz = (px - x) / dt, (py - y) / dt, (pz - z) / dt
            nx, ny, nz = _cut(nx, ny, nz, cap[i])  # put out of what was set down on it, it is not thrown
            if not held:
                wx, wy, wz = _unit(nx, ny, nz, gx, gy, gz)
                hx, hy, hz = limited_turn(fx, fy, fz, wx, wy, wz, limit)
                if hx != wx or hy != wy or hz != wz:
                    hx, hy, hz = _unit(hx, hy, hz, gx, gy, gz)
                ux, uy, uz = turned_without_roll(ux, uy, uz, gx, gy, gz, hx, hy, hz)
                gx, gy, gz = hx, hy, hz
        px, py = on_the_map_(px, py, heights.wrap)
        xyz[i, 0], xyz[i, 1], xyz[i, 2] = px, py, pz
        velocity[i, 0], velocity[i, 1], velocity[i, 2] = nx, ny, nz
        forward[i, 0], forward[i, 1], forward[i, 2] = gx, gy, gz
        up[i, 0], up[i, 1], up[i, 2] = ux, uy, uz


@step
def _steered(i, dt, flyers, limits, wanted):
    """((3,) m/s, (3,) unit vector): the velocity and the heading of a bird where it meets nothing."""
    # all that is read comes first: where branches read an array, its references are counted for every bird
    own, limit, target = flyers.length[i], limits.turn[i] * dt, limits.target[i]
    climb, cap, rules, b = limits.climb[i], limits.cap[i], limits.flight, limits.brush[i]
    damping, weight, lift, buoyancy = rules[b, DAMPING], rules[b, WEIGHT], rules[b, LIFT], rules[b, BUOYANCY]
    least, fastest, most = rules[b, MIN_SPEED] * own, rules[b, MAX_SPEED] * own, rules[b, MAX_ACCELERATION] * own
    held, exact, kind, settled = rules[b, GROUNDED], rules[b, EXACT], wanted.kind[i], wanted.transit[i] == 0
    fx, fy, fz = flyers.forward[i, 0], flyers.forward[i, 1], flyers.forward[i, 2]
    vx, vy, vz = flyers.velocity[i, 0], flyers.velocity[i, 1], flyers.velocity[i, 2]
    ux, uy, uz = flyers.up[i, 0], flyers.up[i, 1], flyers.up[i, 2]
    gx, gy, gz = wanted.direction[i, 0], wanted.direction[i, 1], wanted.direction[i, 2]
    nx, ny, nz = wanted.velocity[i, 0], wanted.velocity[i, 1], wanted.velocity[i, 2]
    ax, ay, az = wanted.acceleration[i, 0], wanted.acceleration[i, 1], wanted.acceleration[i, 2]
    speed = np.sqrt(vx * vx + vy * vy + vz * vz)
    if exact and kind == BY_VELOCITY:
        nx, ny, nz = _cut(nx, ny, nz, cap)
        gx, gy, gz = _unit(gx, gy, gz, fx, fy, fz)
        gx, gy, gz = limited_turn(fx, fy, fz, gx, gy, gz, limit)
    else:
        if kind == BY_ACCELERATION:
            ax, ay, az = _cut(ax, ay, az, most)
            drag = damping * (target - speed)
            ax, ay, az = ax + drag * fx, ay + drag * fy, az + drag * fz
        else:  # heads for the direction at its own speed
            gx, gy, gz = limited_turn(fx, fy, fz, gx, gy, gz, limit)
            ax, ay, az = (target * gx - vx) / dt, (target * gy - vy) / dt, (target * gz - vz) / dt
            ax, ay, az = _cut(ax, ay, az, most)
        if weight > 0.0:
            weight = GRAVITY * weight
            lift = weight * lift * speed * speed / max(target * target, 1e-12)
            ax, ay, az = ax + lift * ux, ay + lift * uy, az + (lift * uz - weight * (1.0 - buoyancy))
        nx, ny, nz = vx + dt * ax, vy + dt * ay, min(vz + dt * az, climb)
        if held:
            nz = 0.0
        gx, gy, gz = _unit(nx, ny, nz, fx, fy, fz)
        if limit < np.pi:
            hx, hy, hz = limited_turn(fx, fy, fz, gx, gy, gz, limit)
            if hx != gx or hy != gy or hz != gz:
                gx, gy, gz = _unit(hx, hy, hz, fx, fy, fz)
        if held:
            gx, gy, gz = _unit(gx, gy, 0.0, 1.0, 0.0, 0.0)
        speed = np.sqrt(nx * nx + ny * ny + nz * nz)
        speed = min(max(speed, least if settled else 0.0), fastest, cap)
        nx, ny, nz = speed * gx, speed * gy, speed * gz
    return (nx, ny, min(nz, climb)), (gx, gy, gz)


@inner_kernel
def _on_its_ground(hills, i, x, y, px, py, fx, fy, w, solids):
    """Where a step to (px, py) of a body of radius w held to the ground ends: beside what is too steep."""
    sx, sy = round_steep_ground(hills, i, x, y, px - x, py - y, fx, fy)
    if sx == px - x and sy == py - y:
        return px, py
    z = height_of_ground(hills.heights, x + sx, y + sy)
    if len(solids.kind):
        _, qx, qy, _ = out_of_(solids, x + sx, y + sy, z, w + CLEAR)
        if qx != x + sx or qy != y + sy:
            return x, y
    return x + sx, y + sy


@inner_kernel
def _over_the_ground(x, y, z, px, py, pz, rise, w, solids, heights):
    """Where a step from (x, y, z) into the ground at (px, py, pz) ends, for a body of radius w that may rise so far."""
    here = height_of_ground(heights, x, y) + w
    px, py = below(heights, x, y, px - x, py - y, max(z + rise, here) - w)
    low = height_of_ground(heights, px, py) + w
    pz = max(pz, low)
    if len(solids.kind):  # lifted by the ground into something that hangs over it
        _, qx, qy, qz = out_of_(solids, px, py, pz, w + CLEAR)
        if qx != px or qy != py or qz < low:
            px, py, pz = x, y, max(z, here)
    return px, py, pz

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

import numpy as np
from flockbrush.behaviours.behaviour import Flight
from flockbrush.components.agent import BY_ACCELERATION, BY_VELOCITY
from flockbrush.engine.maths import atan2_, kernel_function, sincos_
from flockbrush.engine.solid_queries import out_of_, slide_
from flockbrush.systems.ground_height import below, height_of_ground
from numba import njit

GRAVITY = 9.81  # m/s^2
CLEAR = 1e-5  # m kept free between bodies and solids, more than rounding ever takes in a corner
(
    MIN_SPEED, MAX_SPEED, MAX_ACCELERATION, DAMPING, WEIGHT, BUOYANCY, LIFT, BANKING, ROLL_TIME, _, GROUNDED, EXACT,
) = range(len(Flight._fields))  # fmt: skip


@kernel_function
def _unit(x, y, z, ex, ey, ez):
    """(x, y, z) with length 1; the other vector where it has no direction."""
    size = np.sqrt(x * x + y * y + z * z)
    if size < 1e-12:
        return ex, ey, ez
    return x / size, y / size, z / size


@kernel_function
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
def fly(
    lo, hi, order, dt, brush, flight, max_turn, climb, length, radius, target, cap, kind, wished, wished_velocity,
    direction, transit, solids, relief_cell, relief, width, depth, xyz, velocity, forward, up,
):  # fmt: skip
    """One tick of flight for the rows of ``order[lo:hi]``: writes position, velocity, heading and up.

    ``climb`` (n,) m/s is the fastest that each rises.
    """
    for o in range(lo, hi):
        i = order[o]
        b = brush[i]
        own = length[i]
        fx, fy, fz = forward[i, 0], forward[i, 1], forward[i, 2]
        vx, vy, vz = velocity[i, 0], velocity[i, 1], velocity[i, 2]
        speed = np.sqrt(vx * vx + vy * vy + vz * vz)
        w = radius[i]
        if flight[b, EXACT] and kind[i] == BY_VELOCITY:
            nx, ny, nz = wished_velocity[i, 0], wished_velocity[i, 1], wished_velocity[i, 2]
            nx, ny, nz = _cut(nx, ny, nz, cap[i])
            gx, gy, gz = _unit(direction[i, 0], direction[i, 1], direction[i, 2], fx, fy, fz)
            gx, gy, gz = limited_turn(fx, fy, fz, gx, gy, gz, max_turn[i] * dt)
        else:
            if kind[i] == BY_ACCELERATION:
                ax, ay, az = wished[i, 0], wished[i, 1], wished[i, 2]
                ax, ay, az = _cut(ax, ay, az, flight[b, MAX_ACCELERATION] * own)
                drag = flight[b, DAMPING] * (target[i] - speed)
                ax, ay, az = ax + drag * fx, ay + drag * fy, az + drag * fz
            else:  # heads for the direction at its own speed
                gx, gy, gz = limited_turn(
                    fx, fy, fz, direction[i, 0], direction[i, 1], direction[i, 2], max_turn[i] * dt
                )
                ax, ay, az = (target[i] * gx - vx) / dt, (target[i] * gy - vy) / dt, (target[i] * gz - vz) / dt
                ax, ay, az = _cut(ax, ay, az, flight[b, MAX_ACCELERATION] * own)
            if flight[b, WEIGHT] > 0.0:
                weight = GRAVITY * flight[b, WEIGHT]
                lift = weight * flight[b, LIFT] * speed * speed / max(target[i] * target[i], 1e-12)
                ax, ay = ax + lift * up[i, 0], ay + lift * up[i, 1]
                az += lift * up[i, 2] - weight * (1.0 - flight[b, BUOYANCY])
            nx, ny, nz = vx + dt * ax, vy + dt * ay, min(vz + dt * az, climb[i])
            if flight[b, GROUNDED]:
                nz = 0.0
            gx, gy, gz = _unit(nx, ny, nz, fx, fy, fz)
            if max_turn[i] * dt < np.pi:
                hx, hy, hz = limited_turn(fx, fy, fz, gx, gy, gz, max_turn[i] * dt)
                if hx != gx or hy != gy or hz != gz:
                    gx, gy, gz = _unit(hx, hy, hz, fx, fy, fz)
            if flight[b, GROUNDED]:
                gx, gy, gz = _unit(gx, gy, 0.0, 1.0, 0.0, 0.0)
            speed = np.sqrt(nx * nx + ny * ny + nz * nz)
            least = flight[b, MIN_SPEED] * own if transit[i] == 0 else 0.0
            speed = min(max(speed, least), flight[b, MAX_SPEED] * own, cap[i])
            nx, ny, nz = speed * gx, speed * gy, speed * gz
        nz = min(nz, climb[i])
        # what the bird feels: the change of its velocity across its way, and what bears its weight
        lx, ly, lz = (nx - vx) / dt, (ny - vy) / dt, (nz - vz) / dt
        ux, uy, uz = turned_without_roll(up[i, 0], up[i, 1], up[i, 2], fx, fy, fz, gx, gy, gz)
        bank, share = flight[b, BANKING], min(dt / max(flight[b, ROLL_TIME], dt), 1.0)
        if flight[b, GROUNDED]:
            ux, uy, uz = 0.0, 0.0, 1.0
        else:
            ux, uy, uz = rolled(ux, uy, uz, gx, gy, gz, bank * lx, bank * ly, bank * lz + GRAVITY, share)
        x, y, z = xyz[i, 0], xyz[i, 1], xyz[i, 2]
        if len(solids.kind):
            free, px, py, pz = out_of_(solids, x, y, z, w + CLEAR)
            touched, px, py, pz = slide_(solids, px, py, pz, nx * dt, ny * dt, nz * dt, w + CLEAR)
            touched |= (px != x + nx * dt) | (py != y + ny * dt) | (pz != z + nz * dt)
        else:
            touched, px, py, pz = False, x + nx * dt, y + ny * dt, z + nz * dt
        low = height_of_ground(relief, relief_cell, px, py) + w
        if flight[b, GROUNDED]:
            touched |= pz != low - w
            pz = low - w
        elif pz < low:
            touched = True
            limit = max(z + climb[i] * dt, height_of_ground(relief, relief_cell, x, y) + w)
            px, py = below(relief, relief_cell, x, y, px - x, py - y, limit - w)
            low = height_of_ground(relief, relief_cell, px, py) + w
            pz = max(pz, low)
            if len(solids.kind):  # lifted by the ground into something that hangs over it
                free, qx, qy, qz = out_of_(solids, px, py, pz, w + CLEAR)
                if qx != px or qy != py or qz < low:
                    px, py, pz = x, y, max(z, height_of_ground(relief, relief_cell, x, y) + w)
        if touched:  # it is where it came to that counts
            nx, ny, nz = (px - x) / dt, (py - y) / dt, (pz - z) / dt
            nx, ny, nz = _cut(nx, ny, nz, cap[i])  # put out of what was set down on it, it is not thrown
            if not flight[b, GROUNDED]:
                wx, wy, wz = _unit(nx, ny, nz, gx, gy, gz)
                hx, hy, hz = limited_turn(fx, fy, fz, wx, wy, wz, max_turn[i] * dt)
                if hx != wx or hy != wy or hz != wz:
                    hx, hy, hz = _unit(hx, hy, hz, gx, gy, gz)
                ux, uy, uz = turned_without_roll(ux, uy, uz, gx, gy, gz, hx, hy, hz)
                gx, gy, gz = hx, hy, hz
        if width > 0.0:
            px, py = px - width * np.floor(px / width), py - depth * np.floor(py / depth)
        xyz[i, 0], xyz[i, 1], xyz[i, 2] = px, py, pz
        velocity[i, 0], velocity[i, 1], velocity[i, 2] = nx, ny, nz
        forward[i, 0], forward[i, 1], forward[i, 2] = gx, gy, gz
        up[i, 0], up[i, 1], up[i, 2] = ux, uy, uz

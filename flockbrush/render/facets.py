"""Kernels for pictures in perspective: the ground under a sky, flat faces, soft shadows, lines in space.

Pixels are those of the rest of this folder.  A camera comes as the sixteen numbers of `OrbitCamera.numbers`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flockbrush.render.shapes import kernel, over, window
from flockbrush.render.strokes import draw_thin, slanted

NEARER = 1.002  # of the depth that hides: so much a thing may lie in what it stands on
GROWN = 0.9  # pixels by which faces are larger all around, that no ground shows between two
SLIM = 6  # pixels; in rows of triangles no wider it costs less to look at each pixel than for where they begin
CORNERS = 8  # of a face that the near plane has cut, at most


class Haze(NamedTuple):
    """What takes away colour with distance."""

    clear: float  # m; how far one sees well
    ink: np.ndarray  # (3,); the colour beyond


@kernel
def deep(cam, x, y, z):
    """Where a point (m) lies in the camera's axes: right, up, ahead."""
    dx, dy, dz = x - cam[0], y - cam[1], z - cam[2]
    return (
        cam[3] * dx + cam[4] * dy + cam[5] * dz,
        cam[6] * dx + cam[7] * dy + cam[8] * dz,
        cam[9] * dx + cam[10] * dy + cam[11] * dz,
    )


class SpacePose(NamedTuple):
    """Where a body is in space, and which way it is turned."""

    place: np.ndarray  # (3,) m; of its origin
    axes: np.ndarray  # (3, 3); unit vectors ahead, to the left and up


@kernel
def pixel_of(cam, pose, x, y, z):
    """Column, row and depth (m) of a point of a body, m in its own axes."""
    place, axes = pose
    right, up, ahead = deep(
        cam,
        place[0] + x * axes[0, 0] + y * axes[1, 0] + z * axes[2, 0],
        place[1] + x * axes[0, 1] + y * axes[1, 1] + z * axes[2, 1],
        place[2] + x * axes[0, 2] + y * axes[1, 2] + z * axes[2, 2],
    )
    return cam[13] + cam[12] * right / ahead, cam[14] - cam[12] * up / ahead, ahead


@kernel
def haze_at(depth, clear):
    """Share of the haze in what is seen from so far; `clear` (m) is how far one sees well."""
    ratio = depth / clear
    return 1.0 - 1.0 / (1.0 + ratio * ratio)


# the ground ------------------------------------------------------------------------


@kernel
def paint_sky(frame, clip, cam, floor, clear, inks):
    """Sky, and bare ground to the horizon; `inks` (3, 3): sky at the horizon and above, ground."""
    for row in range(clip[1], clip[3]):
        y = (cam[14] - row - 0.5) / cam[12]
        fall = cam[11] + y * cam[8]
        if fall > -1e-6:
            first, second, share = 0, 1, min(max(fall, 0.0) / 0.55, 1.0) ** 0.7
        else:
            first, second, share = 2, 0, haze_at((cam[2] - floor) / -fall, clear)
        red = np.uint8(inks[first, 0] + (inks[second, 0] - inks[first, 0]) * share + 0.5)
        green = np.uint8(inks[first, 1] + (inks[second, 1] - inks[first, 1]) * share + 0.5)
        blue = np.uint8(inks[first, 2] + (inks[second, 2] - inks[first, 2]) * share + 0.5)
        for col in range(clip[0], clip[2]):
            frame[row, col, 0] = red
            frame[row, col, 1] = green
            frame[row, col, 2] = blue


@kernel
def hide_in_haze(line, ink, fog):
    """Take colour away from one row (k, 3): `fog` of 256 is haze."""
    keep = np.uint16(256 - fog)
    h0, h1, h2 = np.uint16(ink[0] * fog), np.uint16(ink[1] * fog), np.uint16(ink[2] * fog)
    for k in range(len(line)):
        line[k, 0] = np.uint8((np.uint16(line[k, 0]) * keep + h0) >> 8)
        line[k, 1] = np.uint8((np.uint16(line[k, 1]) * keep + h1) >> 8)
        line[k, 2] = np.uint8((np.uint16(line[k, 2]) * keep + h2) >> 8)


@kernel
def haze_ground(frame, clip, cam, floor, haze):
    """Lay the haze over ground that is drawn without."""
    for row in range(clip[1], clip[3]):
        fall = cam[11] + (cam[14] - row - 0.5) / cam[12] * cam[8]
        if fall < -1e-6:
            fog = int(256 * haze_at((cam[2] - floor) / -fall, haze.clear) + 0.5)
            hide_in_haze(frame[row, clip[0] : clip[2]], haze.ink, fog)


@kernel
def draw_grid(frame, clip, cam, floor, x, y, spacing, reach, ink, alpha):
    """Lines on the ground, `spacing` m apart, every fifth thick; they fade towards `reach` m from the point (x, y)."""
    pieces = 32
    first = int(np.ceil(-reach / spacing))
    for way in range(2):
        middle, other = (x, y) if way == 0 else (y, x)
        start = int(np.floor(middle / spacing + 0.5))
        for k in range(first, -first + 1):
            at = (start + k) * spacing
            half = reach * reach - (at - middle) ** 2
            if half <= 0:
                continue
            half = np.sqrt(half)
            strong = 1.0 if (start + k) % 5 == 0 else 0.5
            for piece in range(pieces):
                a = other - half + 2 * half * piece / pieces
                b = a + 2 * half / pieces
                far = ((a + b) / 2 - other) ** 2 + (at - middle) ** 2
                fresh = alpha * strong * (1.0 - far / (reach * reach)) ** 1.5
                if way == 0:
                    _ground_line(frame, clip, cam, floor, at, a, at, b, ink, fresh)
                else:
                    _ground_line(frame, clip, cam, floor, a, at, b, at, ink, fresh)


@kernel
def _ground_line(frame, clip, cam, floor, ax, ay, bx, by, ink, alpha):
    """A thin line between two points of the ground, m; the part before the eye."""
    au, av, aw = deep(cam, ax, ay, floor)
    bu, bv, bw = deep(cam, bx, by, floor)
    near = cam[15]
    if aw < near and bw < near:
        return
    if aw < near:
        share = (near - aw) / (bw - aw)
        au, av, aw = au + (bu - au) * share, av + (bv - av) * share, near
    elif bw < near:
        share = (near - bw) / (aw - bw)
        bu, bv, bw = bu + (au - bu) * share, bv + (av - bv) * share, near
    focal, mx, my = cam[12], cam[13], cam[14]
    line = slanted(mx + focal * au / aw, my - focal * av / aw, mx + focal * bu / bw, my - focal * bv / bw)
    whole = (ink[0], ink[1], ink[2])
    _stroke(frame, clip, line, alpha, whole, whole, 0.0)


# faces -------------------------------------------------------------------------------


@kernel
def draw_faces(buffer, cam, faces, order, colours, alphas, haze):
    """Draw flat faces (m, 4, 3) m, a triangle with its last corner twice, in an order from far to near.

    `colours` (m, 3) are as lit, `alphas` (m,); faces that one sees through hide nothing.
    """
    near = cam[15]
    solid, cut = np.empty((4, 3)), np.empty((CORNERS, 3))
    for f in order:
        for k in range(4):
            solid[k] = deep(cam, faces[f, k, 0], faces[f, k, 1], faces[f, k, 2])
        count = _before_the_eye(solid, near, cut)
        if count > 2:
            _face(buffer, cam, cut[:count], colours[f], alphas[f], haze)


@kernel
def _before_the_eye(corners, near, cut):
    """The part of a face (k, 3) deeper than `near`, into `cut`; how many corners it has. Double corners go."""
    count = 0
    for k in range(len(corners)):
        a, b = corners[k], corners[(k + 1) % len(corners)]
        if a[0] == b[0] and a[1] == b[1] and a[2] == b[2]:
            continue
        if a[2] >= near:
            cut[count] = a
            count += 1
        if (a[2] >= near) != (b[2] >= near):
            share = (near - a[2]) / (b[2] - a[2])
            cut[count] = a + (b - a) * share
            count += 1
    return count


@kernel
def _face(buffer, cam, corners, colour, alpha, haze):
    """A convex face in the camera's axes, with soft edges, hidden by what lies nearer."""
    frame, depth, clip = buffer
    clear, beyond, count = haze.clear, haze.ink, len(corners)
    focal, mx, my = cam[12], cam[13], cam[14]
    px, py = np.empty(count), np.empty(count)
    left, right, top, bottom = 1e9, -1e9, 1e9, -1e9
    for k in range(count):
        px[k], py[k] = mx + focal * corners[k, 0] / corners[k, 2], my - focal * corners[k, 1] / corners[k, 2]
        left, right, top, bottom = min(left, px[k]), max(right, px[k]), min(top, py[k]), max(bottom, py[k])
    # n . p = d in the camera's axes makes 1 / depth flat over the picture
    nx, ny, nz, d = 0.0, 0.0, 0.0, 0.0
    for k in range(1, count - 1):
        e, g = corners[k] - corners[0], corners[k + 1] - corners[0]
        nx, ny, nz = nx + e[1] * g[2] - e[2] * g[1], ny + e[2] * g[0] - e[0] * g[2], nz + e[0] * g[1] - e[1] * g[0]
    d = nx * corners[0, 0] + ny * corners[0, 1] + nz * corners[0, 2]
    if abs(d) < 1e-12:
        return  # seen from its edge
    ix, iy, i0 = nx / (d * focal), -ny / (d * focal), nz / d
    edges = _edges(px, py)
    c0, c1, r0, r1 = window(
        clip, (left + right) / 2, (top + bottom) / 2, (right - left) / 2 + 1, (bottom - top) / 2 + 1
    )
    red, green, blue = _hazed(colour, beyond, haze_at(corners[:, 2].mean(), clear))
    deepest, nearest = 1.0 / corners[:, 2].max(), 1.0 / corners[:, 2].min()
    same = nearest - deepest < 0.05 * nearest
    i0 -= ix * mx + iy * my
    for row in range(r0, r1):
        y = row + 0.5
        low, high, inner_low, inner_high = float(c0), float(c1), float(c0), float(c1)
        for k in range(count):
            slope, over_slope = edges[k, 1], edges[k, 3]
            # inside is more than 0, here by so many pixels more
            base = edges[k, 0] * y + edges[k, 2]
            if over_slope == 0.0:  # level
                if base <= 0:
                    high = low
                if base < 1:
                    inner_high = inner_low - 1
            elif slope < 0:
                low, inner_low = max(low, base * over_slope), max(inner_low, (base - 1) * over_slope)
            else:
                high, inner_high = min(high, base * over_slope), min(inner_high, (base - 1) * over_slope)
        for col in range(max(int(low - 0.5), c0), min(int(high + 0.5), c1)):
            x = col + 0.5
            if x <= low or x >= high:
                continue
            inside = 1.0
            if x < inner_low or x > inner_high:
                for k in range(count):
                    inside = min(inside, edges[k, 0] * y + edges[k, 2] - edges[k, 1] * x)
                if inside <= 0:
                    continue
            here = min(max(i0 + ix * x + iy * y, deepest), nearest)
            if here * NEARER < depth[row, col]:
                continue
            if not same:
                red, green, blue = _hazed(colour, beyond, haze_at(1.0 / here, clear))
            over(frame, row, col, red, green, blue, inside * alpha)
            if alpha > 0.99 and inside > 0.5:
                depth[row, col] = here


@kernel
def _hazed(colour, beyond, fog):
    """A colour of which `fog` has become that of the haze."""
    return (
        colour[0] + (beyond[0] - colour[0]) * fog, colour[1] + (beyond[1] - colour[1]) * fog,
        colour[2] + (beyond[2] - colour[2]) * fog,
    )  # fmt: skip


@kernel
def _edges(px, py):
    """Edges (k, 4) of a convex polygon: a pixel (x, y) lies ``y a - x b + c`` pixels inside, with `GROWN`; and 1 / b.

    1 / b is 0 for a level edge, and an edge without length has all pixels far inside.
    """
    count, turn = len(px), 0.0
    edges = np.empty((count, 4))
    for k in range(count):
        m = (k + 1) % count
        turn += px[k] * py[m] - px[m] * py[k]
    sign = 1.0 if turn > 0 else -1.0
    for k in range(count):
        m = (k + 1) % count
        ex, ey = (px[m] - px[k]) * sign, (py[m] - py[k]) * sign
        long = np.sqrt(ex * ex + ey * ey)
        if long < 1e-9:
            edges[k] = 0.0, 0.0, 1e9, 0.0
            continue
        ex, ey = ex / long, ey / long
        edges[k] = ex, ey, ey * px[k] - ex * py[k] + GROWN, 1.0 / ey if abs(ey) > 1e-9 else 0.0
    return edges


@kernel
def pixel(places, k):
    """Column and row of a corner."""
    return places[k, 0], places[k, 1]


@kernel
def lit(inks, row, shine):
    """One of some colours (k, 3) in the light."""
    return min(inks[row, 0] * shine, 255.0), min(inks[row, 1] * shine, 255.0), min(inks[row, 2] * shine, 255.0)


@kernel
def draw_triangle(buffer, a, b, c, near, ink):
    """A triangle between pixels, half a pixel larger all around, hidden where the depth is above `near` (1 / m)."""
    frame, depth, clip = buffer
    ax, ay = a
    bx, by = b
    cx, cy = c
    red, green, blue = ink
    if (bx - ax) * (cy - ay) - (by - ay) * (cx - ax) < 0:
        bx, by, cx, cy = cx, cy, bx, by
    left, right = min(ax, bx, cx) - 0.5, max(ax, bx, cx) + 0.5
    top, bottom = min(ay, by, cy) - 0.5, max(ay, by, cy) + 0.5
    c0, c1 = max(int(np.floor(left)), clip[0]), min(int(np.ceil(right)), clip[2])
    r0, r1 = max(int(np.floor(top)), clip[1]), min(int(np.ceil(bottom)), clip[3])
    ux, uy, vx, vy, wx, wy = bx - ax, by - ay, cx - bx, cy - by, ax - cx, ay - cy
    lu = 1.0 / max(np.sqrt(ux * ux + uy * uy), 1e-9)
    lv = 1.0 / max(np.sqrt(vx * vx + vy * vy), 1e-9)
    lw = 1.0 / max(np.sqrt(wx * wx + wy * wy), 1e-9)
    ux, uy, vx, vy, wx, wy = ux * lu, uy * lu, vx * lv, vy * lv, wx * lw, wy * lw
    if c1 - c0 <= SLIM:
        for row in range(r0, r1):
            y = row + 0.5
            u, v, w = ux * (y - ay) + uy * ax + 1.0, vx * (y - by) + vy * bx + 1.0, wx * (y - cy) + wy * cx + 1.0
            for col in range(c0, c1):
                x = col + 0.5
                inside = min(min(u - uy * x, v - vy * x), w - wy * x)
                if inside > 0 and depth[row, col] <= near:
                    over(frame, row, col, red, green, blue, min(inside, 1.0))
        return
    iu, iv, iw = _over_slope(uy), _over_slope(vy), _over_slope(wy)
    solid_red, solid_green, solid_blue = np.uint8(red + 0.5), np.uint8(green + 0.5), np.uint8(blue + 0.5)
    for row in range(r0, r1):
        y = row + 0.5
        u, v, w = ux * (y - ay) + uy * ax + 1.0, vx * (y - by) + vy * bx + 1.0, wx * (y - cy) + wy * cx + 1.0
        # it is seen from `low` to `high`, and altogether from `first` to `last`
        span = _cut((c0 - 0.5, c1 + 0.5, c0 - 0.5, c1 + 0.5), u, iu)
        low, high, first, last = _cut(_cut(span, v, iv), w, iw)
        for col in range(max(int(low), c0), min(int(high) + 1, c1)):
            x = col + 0.5
            if depth[row, col] > near:
                continue
            if first < x < last:
                frame[row, col, 0], frame[row, col, 1], frame[row, col, 2] = solid_red, solid_green, solid_blue
                continue
            inside = min(min(u - uy * x, v - vy * x), w - wy * x)
            if inside > 0:
                over(frame, row, col, red, green, blue, min(inside, 1.0))


@kernel
def _over_slope(slope):
    """1 / slope of an edge; large where it is level."""
    return 1.0 / slope if abs(slope) > 1e-6 else 1e6


@kernel
def _cut(span, edge, inverse):
    """A row's span, and the span that is a pixel inside, where ``edge - x / inverse`` is more than 0, or than 1."""
    low, high, first, last = span
    at = edge * inverse
    if inverse > 0:
        return low, min(high, at), first, min(last, at - inverse)
    return max(low, at), high, max(first, at - inverse), last


# shadows and trails --------------------------------------------------------------------


@kernel
def draw_spots(buffer, cam, floor, xyz, forward, along, aside, ink, alpha):
    """Soft dark ellipses on the ground straight beneath points (n, 3), `along` and `aside` (n,) m from their middle.

    They lie along `forward` (n, 3); `alpha` (n,) is how dark they are in the middle.
    """
    frame, depth, clip = buffer
    red, green, blue = ink
    focal, mx, my = cam[12], cam[13], cam[14]
    for i in range(len(xyz)):
        rx, ry, rz = deep(cam, xyz[i, 0], xyz[i, 1], floor)
        if rz <= 2 * along[i] or alpha[i] <= 0.004:
            continue
        x, y = mx + focal * rx / rz, my - focal * ry / rz
        fx, fy = forward[i, 0], forward[i, 1]
        flat = max(np.sqrt(fx * fx + fy * fy), 1e-9)
        fx, fy = fx / flat, fy / flat
        # what a metre along and a metre aside are in pixels
        d0, e0 = cam[3] * fx + cam[4] * fy, -cam[3] * fy + cam[4] * fx
        d1, e1 = cam[6] * fx + cam[7] * fy, -cam[6] * fy + cam[7] * fx
        d2, e2 = cam[9] * fx + cam[10] * fy, -cam[9] * fy + cam[10] * fx
        a, b = focal * (d0 - rx * d2 / rz) / rz * along[i], focal * (e0 - rx * e2 / rz) / rz * aside[i]
        c, d = -focal * (d1 - ry * d2 / rz) / rz * along[i], -focal * (e1 - ry * e2 / rz) / rz * aside[i]
        turn = a * d - b * c
        reach_x, reach_y = np.sqrt(a * a + b * b), np.sqrt(c * c + d * d)
        if abs(turn) < 0.02:  # pixels: too flat or too far to be seen
            continue
        left, right, top, bottom = window(clip, x, y, reach_x + 1, reach_y + 1)
        a, b, c, d, hides = a / turn, b / turn, c / turn, d / turn, NEARER / rz
        square = c * c + d * d
        for row in range(top, bottom):
            dy = row + 0.5 - y
            # the ellipse is where square dx² - 2 cross dx + rest < 0
            cross, rest = (b * d + a * c) * dy, (a * a + b * b) * dy * dy - 1.0
            root = cross * cross - square * rest
            if root <= 0.0:
                continue
            root = np.sqrt(root)
            first, last = x - 0.5 + (cross - root) / square, x - 0.5 + (cross + root) / square
            for col in range(max(left, int(np.ceil(first))), min(right, int(np.floor(last)) + 1)):
                dx = col + 0.5 - x
                u, v = d * dx - b * dy, a * dy - c * dx
                far = u * u + v * v
                if far >= 1.0 or depth[row, col] > hides:
                    continue
                soft = 1.0 - far
                over(frame, row, col, red, green, blue, alpha[i] * min(1.6 * soft, 1.0) * np.sqrt(soft))


@kernel
def draw_ways(buffer, cam, ways, first, last, inks, strength, longest, haze):
    """Draw where each animal has been: `ways` (k, n, 3) m, a ring of moments from `first` to `last` going round.

    `inks` (n, 3); old parts are faint.  NaN and steps over `longest` m leave a gap.
    """
    frame, depth, clip = buffer
    focal, mx, my = cam[12], cam[13], cam[14]
    room = len(ways)
    count = (last - first) % room
    near, beyond = cam[15], (haze.ink[0], haze.ink[1], haze.ink[2])
    for i in range(ways.shape[1]):
        before = False
        bx, by, wx, wy, wz = 0.0, 0.0, 0.0, 0.0, 0.0
        for k in range(count + 1):
            at = first + k
            if at >= room:
                at -= room
            ox, oy, oz, wx, wy, wz = wx, wy, wz, ways[at, i, 0], ways[at, i, 1], ways[at, i, 2]
            rx, ry, rz = deep(cam, wx, wy, wz)
            if not (rz > near):
                before = False
                continue
            x, y = mx + focal * rx / rz, my - focal * ry / rz
            whole = (wx - ox) ** 2 + (wy - oy) ** 2 + (wz - oz) ** 2 <= longest * longest
            if before and k < count and (x - bx) ** 2 + (y - by) ** 2 < 9.0 and whole:
                continue  # pixels: too short a step to be drawn alone
            if before and whole:
                col, row = int((x + bx) / 2), int((y + by) / 2)
                seen = clip[0] <= col < clip[2] and clip[1] <= row < clip[3] and depth[row, col] <= NEARER / rz
                if seen:
                    fog, ink = haze_at(rz, haze.clear), (inks[i, 0], inks[i, 1], inks[i, 2])
                    fresh = strength * (k / (count + 1.0)) * (1.0 - 0.7 * fog)
                    _stroke(frame, clip, slanted(bx, by, x, y), fresh, ink, beyond, fog)
            before, bx, by = True, x, y


@kernel
def _stroke(frame, clip, line, alpha, ink, haze, fog):
    """A line one pixel wide, `fog` of it in the colour of the haze."""
    if line.long > 0.0 and not line.long > 1e4:
        red = np.int32(ink[0] + (haze[0] - ink[0]) * fog)
        green = np.int32(ink[1] + (haze[1] - ink[1]) * fog)
        blue = np.int32(ink[2] + (haze[2] - ink[2]) * fog)
        draw_thin(frame, clip, line, 256.0 * alpha, (red, green, blue))

"""Kernels for what is drawn anew in every frame: thin lines and rings by the thousand, sight, layers kept ready."""

from __future__ import annotations

import numpy as np

from flockbrush.draw.shapes import kernel, over, window

RAYS = 2048  # of the compass: as many directions as sight is looked into

# lines and rings -------------------------------------------------------------------


@kernel
def draw_lines(frame, clip, segments, width, red, green, blue, alpha):
    """Draw lines (m, 4) x0, y0, x1, y1 with soft edges; where they cross it gets darker. Widths below 1 are thinner."""
    thick = max(width, 1.0)
    alpha = alpha * min(width, 1.0)
    for k in range(len(segments)):
        ax, ay, bx, by = segments[k, 0], segments[k, 1], segments[k, 2], segments[k, 3]
        dx, dy = bx - ax, by - ay
        long = np.sqrt(dx * dx + dy * dy)
        if not long > 0.0 or long > 1e5:
            continue
        steep = abs(dy) > abs(dx)
        if steep:
            ax, ay, bx, by = ay, ax, by, bx
            dx, dy = dy, dx
        if bx < ax:
            ax, ay, bx, by = bx, by, ax, ay
            dx, dy = -dx, -dy
        slope, cosine = dy / dx, abs(dx) / long
        low, high = (clip[1], clip[3]) if steep else (clip[0], clip[2])
        left, right = (clip[0], clip[2]) if steep else (clip[1], clip[3])
        half = thick / 2 / cosine + 0.5
        for col in range(max(int(np.floor(ax)), low), min(int(np.ceil(bx)), high)):
            middle = ay + slope * (col + 0.5 - ax)
            end = min(min(col + 1.0, bx) - max(float(col), ax), 1.0)
            for row in range(max(int(np.floor(middle - half)), left), min(int(np.ceil(middle + half)), right)):
                cover = min(thick / 2 + 0.5 - abs(row + 0.5 - middle) * cosine, 1.0) * end * alpha
                if cover > 0:
                    if steep:
                        over(frame, col, row, red, green, blue, cover)
                    else:
                        over(frame, row, col, red, green, blue, cover)


@kernel
def draw_rings(frame, clip, at, radius, width, red, green, blue, alpha):
    """Draw rings `width` pixels wide, of these radii (n,), around pixel positions (n, 2)."""
    for k in range(len(at)):
        x, y, far = at[k, 0], at[k, 1], radius[k] + width / 2 + 0.5
        left, right, top, bottom = window(clip, x, y, far, far)
        for row in range(top, bottom):
            dy = row + 0.5 - y
            for col in range(left, right):
                dx = col + 0.5 - x
                cover = min(width / 2 + 0.5 - abs(np.sqrt(dx * dx + dy * dy) - radius[k]), 1.0)
                if cover > 0:
                    over(frame, row, col, red, green, blue, cover * alpha)


@kernel
def links_of(first, near, offset, at, chosen, scale, segments):
    """Lines (m, 4) in pixels from each chosen row to those it sees; the number of them."""
    count = 0
    for i in range(len(at)):
        if not chosen[i]:
            continue
        for k in range(first[i], first[i + 1]):
            if count == len(segments):
                return count
            if chosen[near[k]] and near[k] < i:  # once for both, where both are drawn
                continue
            segments[count, 0], segments[count, 1] = at[i, 0], at[i, 1]
            segments[count, 2] = at[i, 0] + offset[k, 0] * scale
            segments[count, 3] = at[i, 1] - offset[k, 1] * scale
            count += 1
    return count


# sight ---------------------------------------------------------------------------


@kernel
def _turn(x, y):
    """The direction of a vector as a number from 0 to 4, counter-clockwise in (x, y): takes one division."""
    size = abs(x) + abs(y)
    if size == 0.0:
        return 0.0
    if x >= 0:
        return y / size if y >= 0 else 4.0 + y / size
    return 2.0 - y / size


@kernel
def _ray(k):
    """The unit vector of a direction of the compass."""
    part = (k + 0.5) * 4.0 / RAYS
    quarter = int(part)
    along = part - quarter
    x, y = 1.0 - along, along
    if quarter == 1:
        x, y = -along, 1.0 - along
    elif quarter == 2:
        x, y = along - 1.0, -along
    elif quarter == 3:
        x, y = along, along - 1.0
    size = np.sqrt(x * x + y * y)
    return x / size, y / size


@kernel
def how_far(offset, forward, half, radius, edges, reach):
    """How far one sees in every direction of the compass, (RAYS,) in metres, at most `reach`.

    Bodies are capsules at `offset` (n, 2) from the observer; edges (k, 4) that block the view are from it too.
    """
    depth = np.full(RAYS, reach)
    for i in range(len(offset)):
        cx, cy = offset[i, 0], offset[i, 1]
        far = np.sqrt(cx * cx + cy * cy)
        size = half[i] + radius[i]
        if far <= size or far - size > reach:
            continue
        wide = np.arcsin(size / far)
        low, high = _between(cx, cy, wide)
        for k in range(low, high + 1):
            ux, uy = _ray(k % RAYS)
            hit = _to_capsule(ux, uy, cx, cy, forward[i, 0], forward[i, 1], half[i], radius[i])
            if hit < depth[k % RAYS]:
                depth[k % RAYS] = hit
    for e in range(len(edges)):
        ax, ay, bx, by = edges[e, 0], edges[e, 1], edges[e, 2], edges[e, 3]
        turn = np.arctan2(ax * by - ay * bx, ax * bx + ay * by)
        sine, cosine = np.sin(turn / 2), np.cos(turn / 2)
        low, high = _between(cosine * ax - sine * ay, sine * ax + cosine * ay, abs(turn) / 2)
        for k in range(low, high + 1):
            ux, uy = _ray(k % RAYS)
            dx, dy = bx - ax, by - ay
            across = ux * dy - uy * dx
            if across == 0.0:
                continue
            hit, along = (ax * dy - ay * dx) / across, (ax * uy - ay * ux) / across
            if 0.0 <= along <= 1.0 and 0.0 < hit < depth[k % RAYS]:
                depth[k % RAYS] = hit
    return depth


@kernel
def _between(x, y, wide):
    """First and last direction of the compass within an angle `wide` (rad) of a vector."""
    sine, cosine = np.sin(wide), np.cos(wide)
    low = int(np.floor(_turn(cosine * x + sine * y, cosine * y - sine * x) * RAYS / 4)) - 1
    high = int(np.ceil(_turn(cosine * x - sine * y, cosine * y + sine * x) * RAYS / 4)) + 1
    if high < low:
        high += RAYS
    return low, high


@kernel
def _to_capsule(ux, uy, cx, cy, fx, fy, half, radius):
    """How far a ray from the origin goes before it meets a capsule's axis within its radius; infinite if never."""
    best = np.inf
    for side in range(2):  # the round ends
        sign = 1.0 - 2.0 * side
        ex, ey = cx + sign * half * fx, cy + sign * half * fy
        along, aside = ux * ex + uy * ey, ux * ey - uy * ex
        if abs(aside) < radius and along > 0.0:
            best = min(best, max(along - np.sqrt(radius * radius - aside * aside), 0.0))
        gx, gy = -fy * radius * sign, fx * radius * sign  # the straight sides
        across = ux * fy - uy * fx
        if across != 0.0:
            px, py = cx + gx, cy + gy
            hit, along = (px * fy - py * fx) / across, (px * uy - py * ux) / across
            if abs(along) <= half and hit > 0.0:
                best = min(best, hit)
    return best


@kernel
def shade_sight(frame, clip, x, y, fx, fy, cosine, depth, reach, seen, hidden, alpha_seen, alpha_hidden):
    """Lay one colour over what is in the field of view, another over what is in it but hidden.

    Parameters
    ----------
    x, y, depth, reach : pixels
    fx, fy : float
        Heading, y down.
    cosine : float
        Of half the field of view.
    """
    left, right, top, bottom = window(clip, x, y, reach + 1, reach + 1)
    for row in range(top, bottom):
        dy = row + 0.5 - y
        for col in range(left, right):
            dx = col + 0.5 - x
            far = np.sqrt(dx * dx + dy * dy)
            if far > reach + 0.5:
                continue
            edge = 1.0
            if cosine > -1.0:
                edge = min(max((dx * fx + dy * fy) - cosine * far + 0.5, 0.0), 1.0)
                if edge == 0.0:
                    continue
            edge *= min(reach + 0.5 - far, 1.0)
            shade = min(max(far - depth[min(int(_turn(dx, -dy) * RAYS / 4), RAYS - 1)] + 0.5, 0.0), 1.0)
            lit = alpha_seen * edge * (1.0 - shade)
            if lit > 0:
                over(frame, row, col, seen[0], seen[1], seen[2], lit)
            dark = alpha_hidden * edge * shade
            if dark > 0:
                over(frame, row, col, hidden[0], hidden[1], hidden[2], dark)


# layers --------------------------------------------------------------------------


@kernel
def lay_over(frame, alpha, ink):
    """Lay a picture over a frame, all flat uint8: how dense it is, and its colour times that."""
    for k in range(len(frame)):
        through = np.uint16(frame[k]) * np.uint16(255 - alpha[k])
        frame[k] = np.uint8(((through + np.uint16(255)) >> 8) + ink[k])


@kernel
def count_in_cells(xy, west, north, cell, counts):
    """Add each animal (n, 2) to cells [row, column] `cell` metres wide, row 0 in the north; shared among four."""
    rows, columns = counts.shape
    for i in range(len(xy)):
        u, v = (xy[i, 0] - west) / cell - 0.5, (north - xy[i, 1]) / cell - 0.5
        column, row = int(np.floor(u)), int(np.floor(v))
        a, b = u - column, v - row
        if -1 <= column < columns and -1 <= row < rows:
            for dr in range(2):
                for dc in range(2):
                    r, c = row + dr, column + dc
                    if 0 <= r < rows and 0 <= c < columns:
                        counts[r, c] += (a if dc else 1.0 - a) * (b if dr else 1.0 - b)

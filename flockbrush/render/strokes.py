"""Kernels for what is drawn anew in every frame: thin lines and rings by the thousand, sight, layers kept ready."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flockbrush.render.shapes import kernel, over, window

RAYS = 2048  # of the compass: as many directions as sight is looked into

# lines and rings -------------------------------------------------------------------


class SlantedLine(NamedTuple):
    """A line that runs to the right and rises or falls less than it runs; of a steep one x and y are exchanged."""

    ax: float
    ay: float
    bx: float
    slope: float
    cosine: float
    long: float  # pixels
    steep: bool


@kernel
def slanted(ax, ay, bx, by):
    """The line between two pixels."""
    dx, dy = bx - ax, by - ay
    long, steep = np.sqrt(dx * dx + dy * dy), abs(dy) > abs(dx)
    if steep:
        ax, ay, bx, by, dx, dy = ay, ax, by, bx, dy, dx
    if bx < ax:
        ax, ay, bx, dx, dy = bx, by, ax, -dx, -dy
    return SlantedLine(ax, ay, bx, dy / dx, abs(dx) / long, long, steep)


@kernel
def _tint(frame, row, col, ink, alpha):
    """Lay a colour over one pixel; all whole numbers, alpha of 256."""
    row, col = np.uintp(row), np.uintp(col)  # unsigned: no index needs a test for being negative
    frame[row, col, 0] += np.uint8((ink[0] - np.int32(frame[row, col, 0])) * alpha >> 8)
    frame[row, col, 1] += np.uint8((ink[1] - np.int32(frame[row, col, 1])) * alpha >> 8)
    frame[row, col, 2] += np.uint8((ink[2] - np.int32(frame[row, col, 2])) * alpha >> 8)


@kernel
def draw_lines(frame, clip, segments, width, ink, alpha):
    """Draw lines (m, 4) x0, y0, x1, y1 with soft edges; where they cross it gets darker. Widths below 1 are fainter."""
    thick = max(width, 1.0)
    strength = 256.0 * alpha * min(width, 1.0)
    whole = np.int32(ink[0]), np.int32(ink[1]), np.int32(ink[2])
    for k in range(len(segments)):
        line = slanted(segments[k, 0], segments[k, 1], segments[k, 2], segments[k, 3])
        if not line.long > 0.0 or line.long > 1e5:
            continue
        if thick == 1.0:
            draw_thin(frame, clip, line, strength, whole)
        else:
            _thick(frame, clip, line, thick, strength, whole)


@kernel
def _bounds(clip, steep):
    """Along a line and across it, where the clip begins and ends."""
    return (clip[1], clip[3], clip[0], clip[2]) if steep else (clip[0], clip[2], clip[1], clip[3])


@kernel
def _thick(frame, clip, line, thick, strength, ink):
    """A line more than a pixel wide."""
    ax, ay, bx, slope, cosine, _, steep = line
    low, high, left, right = _bounds(clip, steep)
    half = (thick / 2 + 0.5) / cosine
    for col in range(max(int(np.floor(ax)), low), min(int(np.ceil(bx)), high)):
        middle = ay + slope * (col + 0.5 - ax) - 0.5
        end = strength * min(min(col + 1.0, bx) - max(float(col), ax), 1.0)
        for row in range(max(int(np.ceil(middle - half)), left), min(int(np.floor(middle + half)) + 1, right)):
            cover = np.int32(min(thick / 2 + 0.5 - abs(row - middle) * cosine, 1.0) * end)
            if cover > 0:
                if steep:
                    _tint(frame, col, row, ink, cover)
                else:
                    _tint(frame, row, col, ink, cover)


@kernel
def draw_thin(frame, clip, line, strength, ink):
    """A line one pixel wide: two pixels share its ink in every column; all whole numbers, `strength` of 256."""
    ax, ay, bx, slope, cosine, _, steep = line
    low, high, left, right = _bounds(clip, steep)
    for col in range(max(int(np.floor(ax)), low), min(int(np.ceil(bx)), high)):
        middle = ay + slope * (col + 0.5 - ax) - 0.5
        row = int(np.floor(middle))
        if row < left or row + 1 >= right:
            continue
        part = middle - row
        end = strength * min(min(col + 1.0, bx) - max(float(col), ax), 1.0)
        near, far = np.int32((1.0 - part * cosine) * end), np.int32((1.0 - (1.0 - part) * cosine) * end)
        if steep:
            _tint(frame, col, row, ink, near)
            _tint(frame, col, row + 1, ink, far)
        else:
            _tint(frame, row, col, ink, near)
            _tint(frame, row + 1, col, ink, far)


@kernel
def draw_arrow(frame, clip, ends, width, head, grow, ink, alpha):
    """Draw an arrow to a tip, `ends` (x, y, x, y): a stem `width` pixels wide, a head so long, `grow` pixels fatter."""
    ax, ay, bx, by = ends
    dx, dy = bx - ax, by - ay
    long = max(np.sqrt(dx * dx + dy * dy), 1e-9)
    ux, uy = dx / long, dy / long
    head = min(head, long)
    stem, reach = long - 0.8 * head, 0.56 * head + grow + 1.0
    left, right, top, bottom = window(
        clip, (ax + bx) / 2, (ay + by) / 2, abs(dx) / 2 + reach + grow, abs(dy) / 2 + reach + grow
    )
    slant = 0.56 / np.sqrt(1.0 + 0.56 * 0.56)
    for row in range(top, bottom):
        for col in range(left, right):
            px, py = col + 0.5 - ax, row + 0.5 - ay
            along, aside = px * ux + py * uy, abs(px * uy - py * ux)
            foot = min(max(along, 0.0), stem)
            inside = width / 2 - np.sqrt((along - foot) ** 2 + aside * aside)
            point = min(along - (long - head), (long - along) * slant - aside * np.sqrt(1.0 - slant * slant))
            cover = min(max(max(inside, point) + grow + 0.5, 0.0), 1.0) * alpha
            if cover > 0:
                over(frame, row, col, ink[0], ink[1], ink[2], cover)


@kernel
def draw_plate(frame, clip, left, top, right, bottom, paper, alpha, edge, edge_alpha):
    """Fill a rectangle (whole pixels), with an edge one pixel wide."""
    for row in range(max(top, clip[1]), min(bottom, clip[3])):
        for col in range(max(left, clip[0]), min(right, clip[2])):
            if row == top or row == bottom - 1 or col == left or col == right - 1:
                over(frame, row, col, edge[0], edge[1], edge[2], edge_alpha)
            else:
                over(frame, row, col, paper[0], paper[1], paper[2], alpha)


@kernel
def draw_rings(frame, clip, at, radius, width, ink, alpha):
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
                    over(frame, row, col, ink[0], ink[1], ink[2], cover * alpha)


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

    A body is seen whole, and hides what is behind it.  Bodies are capsules at `offset` (n, 2) from the
    observer; edges (k, 4) that block the view are from it too.
    """
    depth, front = np.full(RAYS, reach), np.full(RAYS, reach)
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
            near, behind = _through(ux, uy, cx, cy, forward[i, 0], forward[i, 1], half[i], radius[i])
            if near < front[k % RAYS]:
                front[k % RAYS], depth[k % RAYS] = near, min(behind, reach)
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
                front[k % RAYS], depth[k % RAYS] = min(hit, front[k % RAYS]), hit
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
def _through(ux, uy, cx, cy, fx, fy, half, radius):
    """Where a ray from the origin enters a capsule and where it leaves it; both infinite if it misses."""
    near, behind = np.inf, -np.inf
    across = ux * fy - uy * fx
    for side in range(2):
        sign = 1.0 - 2.0 * side
        ex, ey = cx + sign * half * fx, cy + sign * half * fy  # a round end
        along, aside = ux * ex + uy * ey, ux * ey - uy * ex
        if abs(aside) < radius and along > 0.0:
            deep = np.sqrt(radius * radius - aside * aside)
            near, behind = min(near, max(along - deep, 0.0)), max(behind, along + deep)
        px, py = cx - fy * radius * sign, cy + fx * radius * sign  # a straight side
        if across != 0.0:
            hit, at = (px * fy - py * fx) / across, (px * uy - py * ux) / across
            if abs(at) <= half and hit > 0.0:
                near, behind = min(near, hit), max(behind, hit)
    return (near, behind) if behind > 0.0 else (np.inf, np.inf)


@kernel
def sight_mask(size, step, eye, cosine, depth, reach, seen, hidden, alpha_seen, alpha_hidden):
    """What is in the field of view, and what is in it but hidden: (height, width, 4) uint8 of opacity and ink.

    Parameters
    ----------
    size : (width, height)
    step : float
        Pixels of the frame to one of the mask.
    eye : Pose
        From the mask's corner.
    cosine : float
        Of half the field of view.
    depth, reach : pixels of the frame
    """
    width, height = size
    x, y, fx, fy = eye
    mask = np.zeros((height, width, 4), np.uint8)
    for row in range(height):
        dy = (row + 0.5) * step - y
        for col in range(width):
            dx = (col + 0.5) * step - x
            square = dx * dx + dy * dy
            if square > (reach + 0.5) * (reach + 0.5):
                continue
            far = np.sqrt(square)
            edge = 1.0
            if cosine > -1.0:
                edge = min(max(((dx * fx + dy * fy) - cosine * far) / step + 0.5, 0.0), 1.0)
                if edge == 0.0:
                    continue
            edge *= min(reach + 0.5 - far, 1.0)
            at, wide = _turn(dx, -dy) * RAYS / 4, 0.4 * max(1.0, step * RAYS / (2 * np.pi * max(far, 1.0)))
            shade = 0.0
            for side in range(-1, 2):  # a little to both sides, so that shadows have soft edges
                behind = far - depth[int(at + side * wide + RAYS) % RAYS]
                shade += min(max(behind / step + 0.5, 0.0), 1.0) / 3
            lit, dark = alpha_seen * edge * (1.0 - shade), alpha_hidden * edge * shade
            mask[row, col, 0] = np.uint8(255 * (lit + dark))
            for c in range(3):
                mask[row, col, 1 + c] = np.uint8(lit * seen[c] + dark * hidden[c])
    return mask


@kernel
def lay_mask(frame, clip, left, top, mask):
    """Lay a picture (h, w, 4) of opacity and ink over the frame, its corner at this pixel."""
    for row in range(max(top, clip[1]), min(top + mask.shape[0], clip[3])):
        for col in range(max(left, clip[0]), min(left + mask.shape[1], clip[2])):
            alpha = np.uint32(mask[row - top, col - left, 0])
            if alpha:
                for c in range(3):
                    kept = (np.uint32(frame[row, col, c]) * (255 - alpha) + 255) >> 8
                    frame[row, col, c] = np.uint8(kept + mask[row - top, col - left, 1 + c])


# layers --------------------------------------------------------------------------


@kernel
def lay_over(frame, alpha, ink):
    """Lay a picture over a frame, all flat uint8: how dense it is, and its colour times that."""
    for k in range(len(frame)):
        through = np.uint16(frame[k]) * np.uint16(255 - alpha[k])
        frame[k] = np.uint8(((through + np.uint16(255)) >> 8) + ink[k])


@kernel
def part_colours(black, white, rows):
    """Of a picture drawn over black and over white, make ink and opacity in place; `rows` says where there is any."""
    for row in range(len(black)):
        some = 0
        dark, light = black[row].reshape(-1), white[row].reshape(-1)
        for k in range(len(dark)):
            alpha = np.uint8(255) - (max(light[k], dark[k]) - dark[k])
            light[k], dark[k] = alpha, min(dark[k], alpha)
            some |= alpha
        rows[row] = some > 0


@kernel
def part_mask(mask, left, alpha, ink):
    """Spread a picture (h, w, 4) of opacity and ink into two of three colours, from column `left` on."""
    for row in range(mask.shape[0]):
        for col in range(mask.shape[1]):
            dense = mask[row, col, 0]
            for c in range(3):
                alpha[row, left + col, c] = dense
                ink[row, left + col, c] = min(mask[row, col, 1 + c], dense)


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

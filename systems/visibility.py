"""Who sees whom: field of view, range and exact line of sight, on a plane.

*j* is visible to *i* when it is in range and in the field of view, and the
segment from centre to centre meets no body of an animal nearer than *j* and no
edge that blocks the view (Gong et al. 2025 [1]_, section 5.3).  A body that
contains the observer's own centre blocks nothing.

The kernel looks outwards in rings, about one per unit of optical depth.  Seen
from the observer a body is a wedge between two tangents, and beyond its far
side everything in the wedge is hidden.  Wedges are compared in float32, which
is fast; whatever comes within rounding of an edge, or between the near and the
far side of a capsule, is decided by the exact test in float64.  Once every
sector of the circle is covered by a body, nobody farther out can be seen and
the animal looks no further: in a dense herd the cost follows the number of
visible neighbours, not of those in range.

.. [1] Gong, X. et al. (2025). Herds from video: learning a microscopic herd model from macroscopic motion data.
   Computer Graphics Forum 44(6), e70225.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from engine.parallel import over_rows

SECTORS = 64  # one bit each
DOUBT = np.float32(4e-6)  # float32 differences smaller than this are decided in float64


class Lists(NamedTuple):
    """Compressed lists: the neighbours of row i are ``near[first[i]:first[i + 1]]``, at ``offset`` from it."""

    first: np.ndarray  # (n + 1,) int64
    near: np.ndarray  # (m,) int32 rows
    offset: np.ndarray  # (m, 2) m, from the observer to the neighbour, across the seam where that is shorter

    def of(self, row):
        """Rows of the neighbours of one row."""
        return self.near[self.first[row] : self.first[row + 1]]


class Edges(NamedTuple):
    """Line segments that block the view, by coarse cell."""

    ends: np.ndarray  # (k, 4) x0, y0, x1, y1 in m
    start: np.ndarray  # (cells + 1,) int32
    item: np.ndarray  # edges whose box is within reach of the cell
    nx: int
    ny: int
    cell: float
    west: float
    south: float


def no_edges():
    """A landscape that hides nothing."""
    return Edges(np.zeros((0, 4)), np.zeros(2, np.int32), np.zeros(0, np.int32), 1, 1, 1.0, 0.0, 0.0)


def edges_by_cell(ends, reach):
    """Sort edges by coarse cell, so that an animal meets only those within its reach.

    Parameters
    ----------
    ends : array_like (k, 4)
        ``x0, y0, x1, y1`` of each edge, metres.
    reach : float
        Metres.
    """
    ends = np.asarray(ends, float).reshape(-1, 4)
    if not len(ends):
        return no_edges()
    low, high = np.minimum(ends[:, :2], ends[:, 2:]) - reach, np.maximum(ends[:, :2], ends[:, 2:]) + reach
    west, south = low.min(0)
    extent = high.max(0) - (west, south)
    cell = float(max(reach / 2, *(extent / 256)))
    nx, ny = (int(e // cell) + 1 for e in extent)
    lists = [[] for _ in range(nx * ny)]
    for k, (a, b) in enumerate(zip(low - (west, south), high - (west, south), strict=True)):
        for iy in range(int(a[1] // cell), int(b[1] // cell) + 1):
            for ix in range(int(a[0] // cell), int(b[0] // cell) + 1):
                lists[iy * nx + ix].append(k)
    start = np.zeros(nx * ny + 1, np.int32)
    np.cumsum([len(cell_list) for cell_list in lists], out=start[1:])
    item = np.array([k for cell_list in lists for k in cell_list], np.int32)
    return Edges(ends, start, item, nx, ny, cell, float(west), float(south))


def visible_neighbours(cells, view_range, cos_half_view, edges=None, occlusion=True, width=64):
    """Compressed lists of the visible neighbours of every animal.

    Parameters
    ----------
    cells : Cells
        From `sort_into_cells`, with a reach of at least the largest range.
    view_range : ndarray (n,)
        Metres, by row.
    cos_half_view : ndarray (n,)
        Cosine of half the field of view; -1 sees all round.
    edges : Edges, optional
        What blocks the view besides bodies.
    occlusion : bool
        False: everybody in range and in the field of view is seen.
    width : int
        First guess of the longest list.

    Returns
    -------
    Lists
    """
    n, m = len(view_range), len(cells.x)
    edges = no_edges() if edges is None else edges
    count = np.zeros(n, np.int64)
    while True:
        seen = np.empty((m, width), np.int32)
        over_rows(_look, m, *cells[:15], view_range, cos_half_view, *edges, occlusion, seen, count)
        longest = int(count.max()) if n else 0
        if longest <= width:
            break
        width = 1 << longest.bit_length()
    first = np.zeros(n + 1, np.int64)
    np.cumsum(count, out=first[1:])
    near, offset = np.empty(first[-1], np.int32), np.empty((first[-1], 2))
    over_rows(_compress, m, cells.x, cells.y, cells.row, cells.ghost, seen, first, near, offset)
    return Lists(first, near, offset)


@njit(cache=True, nogil=True, error_model="numpy")
def _compress(lo, hi, x, y, row, ghost, seen, first, near, offset):
    for i in range(lo, hi):
        if ghost[i]:
            continue
        at = first[row[i]]
        for k in range(first[row[i] + 1] - at):
            j = seen[i, k]
            near[at + k] = row[j]
            offset[at + k, 0] = x[j] - x[i]
            offset[at + k, 1] = y[j] - y[i]


@njit(inline="always")
def _diamond(x, y):
    """An angle in [0, 4), counter-clockwise from east, that needs one division and no arc tangent."""
    t = x / (abs(x) + abs(y))
    return np.float32(1.0) - t if y >= np.float32(0.0) else np.float32(3.0) + t


@njit(inline="always")
def _point_to_segment2(px, py, ax, ay, bx, by):
    """Squared distance from a point to a segment."""
    ux, uy = bx - ax, by - ay
    t = (px - ax) * ux + (py - ay) * uy
    uu = ux * ux + uy * uy
    t = 0.0 if t <= 0.0 or uu == 0.0 else min(t / uu, 1.0)
    ex, ey = ax + t * ux - px, ay + t * uy - py
    return ex * ex + ey * ey


@njit(inline="always")
def _crosses(px, py, qx, qy, ax, ay, bx, by):
    """Whether segments pq and ab meet, end points included; segments in one line do not count."""
    d1 = (bx - ax) * (py - ay) - (by - ay) * (px - ax)
    d2 = (bx - ax) * (qy - ay) - (by - ay) * (qx - ax)
    d3 = (qx - px) * (ay - py) - (qy - py) * (ax - px)
    d4 = (qx - px) * (by - py) - (qy - py) * (bx - px)
    return d1 * d2 <= 0.0 and d3 * d4 <= 0.0 and not (d1 == 0.0 and d2 == 0.0)


@njit(cache=True, nogil=True, error_model="numpy")
def meets_capsule(jx, jy, cx, cy, fx, fy, half, radius):
    """Whether the segment from the origin to (jx, jy) passes within ``radius`` of a capsule's axis.

    The axis goes ``half`` to both sides of (cx, cy) along the unit vector (fx, fy).
    """
    ax, ay, bx, by = cx - half * fx, cy - half * fy, cx + half * fx, cy + half * fy
    r2 = radius * radius
    if (
        _point_to_segment2(ax, ay, 0.0, 0.0, jx, jy) < r2
        or _point_to_segment2(bx, by, 0.0, 0.0, jx, jy) < r2
        or _point_to_segment2(jx, jy, ax, ay, bx, by) < r2
    ):
        return True
    return _crosses(0.0, 0.0, jx, jy, ax, ay, bx, by)


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"nnan", "nsz"})
def _deepest(jx, jy, jd, wedge, count):
    """How deep a direction lies in the shadow of any body: the largest margin, negative when in none.

    ``nnan`` and ``nsz`` let the maximum be taken in any order, which changes no bit of it.
    """
    lx, ly, ux, uy, far = wedge[0], wedge[1], wedge[2], wedge[3], wedge[4]
    most = np.float32(-1.0)
    for k in range(count):
        c1 = lx[k] * jy - ly[k] * jx
        c2 = jx * uy[k] - jy * ux[k]
        c = c1 if c1 < c2 else c2
        d = jd - far[k]
        c = c if c < d else d
        most = c if c > most else most
    return most


@njit(cache=True, nogil=True, error_model="numpy")
def _wedges(ring, n, slot, cx, cy, cd, fx, fy, half, radius, scale, wedge, at):
    """Tangents and far sides of the bodies ring to n, appended at ``at``; directions go to rows 6 to 8."""
    one = np.float32(1.0)
    for q in range(n - ring):
        k = ring + q
        j = slot[k]
        b, h = radius[j], half[j]
        x, y, d2 = cx[k], cy[k], cd[k]
        ox, oy = h * fx[j], h * fy[j]
        ax, ay, bx, by = x - ox, y - oy, x + ox, y + oy
        flip = ax * by - ay * bx < 0.0
        ax, bx = (bx, ax) if flip else (ax, bx)
        ay, by = (by, ay) if flip else (ay, by)
        qa, qb = ax * ax + ay * ay, bx * bx + by * by
        ta, tb = max(qa - b * b, 0.0), max(qb - b * b, 0.0)
        ia, ib = one / np.sqrt(np.float32(qa)), one / np.sqrt(np.float32(qb))
        b32 = np.float32(b)
        sa, sb = b32 * ia, b32 * ib
        ca, cb = np.sqrt(np.float32(ta)) * ia, np.sqrt(np.float32(tb)) * ib
        ax32, ay32, bx32, by32 = np.float32(ax) * ia, np.float32(ay) * ia, np.float32(bx) * ib, np.float32(by) * ib
        # the outermost of the four tangents to the two ends
        lx, ly = ax32 * ca + ay32 * sa, ay32 * ca - ax32 * sa
        mx, my = bx32 * cb + by32 * sb, by32 * cb - bx32 * sb
        keep = lx * my - ly * mx >= np.float32(0.0)
        wedge[0, at + q] = lx if keep else mx
        wedge[1, at + q] = ly if keep else my
        gx, gy = bx32 * cb - by32 * sb, by32 * cb + bx32 * sb
        mx, my = ax32 * ca - ay32 * sa, ay32 * ca + ax32 * sa
        keep = gx * my - gy * mx <= np.float32(0.0)
        wedge[2, at + q] = gx if keep else mx
        wedge[3, at + q] = gy if keep else my
        root = np.sqrt(d2)
        far = root + (h + b if h > 0.0 else 0.0)
        wedge[4, at + q] = np.float32(far * far * scale)
        wedge[5, at + q] = np.float32(d2 * scale)
        inverse = one / np.float32(root)
        wedge[6, q] = np.float32(x) * inverse
        wedge[7, q] = np.float32(y) * inverse


@njit(cache=True, nogil=True, error_model="numpy")
def _hidden_exactly(jx, jy, d2, count, body, slot, cx, cy, cd, fx, fy, half, radius):
    """The definition itself, in float64."""
    for q in range(count):
        k = body[q]
        if cd[k] < d2:
            j = slot[k]
            if meets_capsule(jx, jy, cx[k], cy[k], fx[j], fy[j], half[j], radius[j]):
                return True
    return False


@njit(inline="always")
def _bits(p0, p1, margin):
    """The sectors wholly between two diamond angles (in sectors), as bits; margin < 0 takes those touched."""
    if p1 < p0:
        p1 += np.float32(SECTORS)
    f0, f1 = int(np.ceil(p0 + margin)), int(np.floor(p1 - margin))
    if margin < 0:
        f0, f1 = int(np.floor(p0 + margin)), int(np.floor(p1 - margin)) + 1
    if f1 <= f0:
        return np.uint64(0)
    if f1 - f0 >= SECTORS:
        return ~np.uint64(0)
    run = (np.uint64(1) << np.uint64(f1 - f0)) - np.uint64(1)
    f0 &= SECTORS - 1
    if f0 == 0:
        return run
    return (run << np.uint64(f0)) | (run >> np.uint64(SECTORS - f0))


@njit(cache=True, nogil=True, error_model="numpy")
def _look(
    lo, hi,
    x, y, fx, fy, half, radius, row, ghost, start, nx, ny, cell, west, south, density,
    view_range, cos_half_view,
    ends, estart, eitem, enx, eny, ecell, ewest, esouth,
    occlusion, seen, count,
):  # fmt: skip
    m, width = len(x), seen.shape[1]
    slot, cx, cy, cd = np.empty(m + 1, np.int32), np.empty(m + 1), np.empty(m + 1), np.empty(m + 1)
    wedge = np.empty((8, m + 1), np.float32)
    body = np.empty(m + 1, np.int32)
    sectors = np.float32(SECTORS / 4.0)
    widest = 0.0
    for j in range(m):
        widest = max(widest, half[j] + radius[j])
    capsules = half.max() > 0.0 if m else False
    for i in range(lo, hi):
        if ghost[i]:
            continue
        me = row[i]
        reach, cosine = view_range[me], cos_half_view[me]
        found = 0
        xi, yi = x[i], y[i]
        e0 = e1 = 0
        if len(ends):
            ex, ey = (xi - ewest) / ecell, (yi - esouth) / ecell
            if ex >= 0.0 and ey >= 0.0 and ex < enx and ey < eny:
                c = int(ey) * enx + int(ex)
                e0, e1 = estart[c], estart[c + 1]
        step, dense = reach, False
        if occlusion:
            depth = 1.0 / (2.0 * max(radius[i], 1e-3) * density)  # m per unit of optical depth
            dense = reach > 4.0 * depth
            step = min(reach, max(1.5 * depth, widest, 0.05 * reach))
            step = reach / np.ceil(reach / step)
        scale = 1.0 / (reach * reach)
        inner, inner2 = 0.0, -1.0
        n, bodies, counted = 0, 0, 0
        closed = np.uint64(0)
        while inner < reach:
            outer = min(inner + step, reach)
            if outer > 0.999 * reach:
                outer = reach
            outer2 = outer * outer
            ring = n
            r0, r1 = max(0, int((yi - outer - south) / cell)), min(ny - 1, int((yi + outer - south) / cell))
            for r in range(r0, r1 + 1):
                low = south + r * cell
                dy0 = max(0.0, max(low - yi, yi - low - cell))
                w = np.sqrt(max(outer2 - dy0 * dy0, 0.0)) + 1e-9 * reach
                c0, c1 = max(0, int((xi - w - west) / cell)), min(nx - 1, int((xi + w - west) / cell))
                # the part of the row wholly inside the rings already looked at is left out
                dy1 = max(abs(low - yi), abs(low + cell - yi))
                gap0, gap1 = c1 + 1, c1 + 1
                if inner2 > dy1 * dy1:
                    v = np.sqrt(inner2 - dy1 * dy1) * (1.0 - 1e-9)
                    gap0 = max(int(np.ceil((xi - v - west) / cell)), c0)
                    gap1 = min(int((xi + v - west) / cell), c1 + 1)
                    if gap1 <= gap0:
                        gap0 = gap1 = c1 + 1
                for side in range(2):
                    a, b = start[r * nx + c0], start[r * nx + gap0]
                    if side:
                        a, b = start[r * nx + gap1], start[r * nx + c1 + 1]
                    for j in range(a, b):
                        dx, dy = x[j] - xi, y[j] - yi
                        d2 = dx * dx + dy * dy
                        slot[n], cx[n], cy[n], cd[n] = j, dx, dy, d2
                        n += (d2 >= inner2) & (d2 < outer2) & (j != i)
            if occlusion:
                _wedges(ring, n, slot, cx, cy, cd, fx, fy, half, radius, scale, wedge, bodies)
                at = bodies
                for k in range(ring, n):
                    # whom the observer stands in hides nobody; nor does whoever is wholly in the shadow
                    j, src = slot[k], at + k - ring
                    h, b = half[j], radius[j]
                    if cd[k] <= (h + b) * (h + b) and _point_to_segment2(
                        0.0, 0.0, cx[k] - h * fx[j], cy[k] - h * fy[j], cx[k] + h * fx[j], cy[k] + h * fy[j]
                    ) <= b * b:
                        continue
                    if closed != 0:
                        p0 = _diamond(wedge[0, src], wedge[1, src]) * sectors
                        p1 = _diamond(wedge[2, src], wedge[3, src]) * sectors
                        if _bits(p0, p1, np.float32(-1e-4)) & ~closed == 0:
                            continue
                    for c in range(6):
                        wedge[c, bodies] = wedge[c, src]
                    body[bodies] = k
                    bodies += 1
            for k in range(ring, n):
                d2 = cd[k]
                kx, ky = cx[k], cy[k]
                if d2 > 0.0:
                    dot = fx[i] * kx + fy[i] * ky
                    if cosine >= 0.0:
                        if dot < 0.0 or dot * dot < cosine * cosine * d2:
                            continue
                    elif cosine > -1.0 and dot < 0.0 and dot * dot > cosine * cosine * d2:
                        continue
                    if occlusion:
                        jx, jy = wedge[6, k - ring], wedge[7, k - ring]
                        if closed != 0 and (closed >> np.uint64(int(_diamond(jx, jy) * sectors) & (SECTORS - 1))) & np.uint64(1):
                            continue
                        deep = _deepest(jx, jy, np.float32(d2 * scale), wedge, bodies)
                        if deep > DOUBT:
                            continue
                        if (capsules or deep > -DOUBT) and _hidden_exactly(
                            kx, ky, d2, bodies, body, slot, cx, cy, cd, fx, fy, half, radius
                        ):
                            continue
                    hidden = False
                    for e in range(e0, e1):
                        g = eitem[e]
                        if _crosses(0.0, 0.0, kx, ky, ends[g, 0] - xi, ends[g, 1] - yi, ends[g, 2] - xi, ends[g, 3] - yi):
                            hidden = True
                            break
                    if hidden:
                        continue
                if found < width:
                    seen[i, found] = slot[k]
                found += 1
            if dense:
                # a body closes the sectors it spans for all beyond its far side
                while counted < bodies and cd[body[counted]] * scale <= outer2 * scale and wedge[4, counted] <= np.float32(outer2 * scale):
                    p0 = _diamond(wedge[0, counted], wedge[1, counted]) * sectors
                    p1 = _diamond(wedge[2, counted], wedge[3, counted]) * sectors
                    closed |= _bits(p0, p1, np.float32(1e-4))
                    counted += 1
                if closed == ~np.uint64(0):
                    break
            inner, inner2 = outer, outer2
        count[me] = found

"""Coverage: how much of each pixel a polygon, a line or a capsule covers, and colours laid over a frame by it.

Everything here takes pixel coordinates (x right, y down, pixel centres at half numbers).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

kernel = njit(nogil=True, cache=True, no_cfunc_wrapper=True, error_model="numpy")


class FrameBuffer(NamedTuple):
    """A picture that kernels draw on, with the depth of what it shows."""

    frame: np.ndarray  # (h, w, 3) uint8
    depth: np.ndarray  # (h, w) float32; 1 / m: what lies nearer is larger, and 0 is endlessly far
    clip: np.ndarray  # (4,) int64; left, top, right and bottom of the part that is drawn on


class Pose(NamedTuple):
    """Where something is drawn, pixels, and its heading, a unit vector with y down; (0, 0) for none."""

    x: float
    y: float
    fx: float
    fy: float


def ink_of(colour) -> tuple[float, float, float]:
    """A colour as kernels take it: red, green and blue."""
    red, green, blue = colour
    return float(red), float(green), float(blue)


@kernel
def over(frame, y, x, red, green, blue, alpha):
    """Lay a colour over one pixel."""
    y, x = np.uintp(y), np.uintp(x)  # unsigned: no index needs a test for being negative
    old = float(frame[y, x, 0])
    frame[y, x, 0] = np.uint8(old + (red - old) * alpha + 0.5)
    old = float(frame[y, x, 1])
    frame[y, x, 1] = np.uint8(old + (green - old) * alpha + 0.5)
    old = float(frame[y, x, 2])
    frame[y, x, 2] = np.uint8(old + (blue - old) * alpha + 0.5)


@kernel
def window(clip, x, y, reach_x, reach_y):
    """Columns and rows of the clip that a shape of this reach around (x, y) can touch; empty when far away."""
    if x + reach_x < clip[0] or x - reach_x > clip[2] or y + reach_y < clip[1] or y - reach_y > clip[3]:
        return 0, 0, 0, 0
    left = max(clip[0], int(np.floor(max(x - reach_x, -1e6))))
    right = min(clip[2], int(np.ceil(min(x + reach_x, 1e6))))
    top = max(clip[1], int(np.floor(max(y - reach_y, -1e6))))
    bottom = min(clip[3], int(np.ceil(min(y + reach_y, 1e6))))
    return left, right, top, bottom


@kernel
def cover_polygon(points, left, top, width, height):
    """How much of each pixel the polygon covers: (height, width) float32; holes by the even-odd rule."""
    mask = np.zeros((height, width), np.float32)
    count = len(points)
    crossings = np.empty(count)
    lines = 4
    for row in range(height):
        for line in range(lines):
            y = top + row + (line + 0.5) / lines
            found = 0
            for k in range(count):
                ax, ay = points[k, 0], points[k, 1]
                bx, by = points[(k + 1) % count, 0], points[(k + 1) % count, 1]
                if (ay <= y) != (by <= y):
                    crossing, at = ax + (y - ay) / (by - ay) * (bx - ax), found
                    while at > 0 and crossings[at - 1] > crossing:  # from left to right
                        crossings[at] = crossings[at - 1]
                        at -= 1
                    crossings[at] = crossing
                    found += 1
            for pair in range(found // 2):
                start, stop = max(crossings[2 * pair], float(left)), min(crossings[2 * pair + 1], float(left + width))
                if stop <= start:
                    continue
                for col in range(int(np.floor(start)), min(int(np.floor(stop)) + 1, left + width)):
                    share = min(stop, col + 1.0) - max(start, float(col))
                    mask[row, col - left] += share / lines  # the same in whichever box
    return mask


@kernel
def cover_segments(segments, half_width, left, top, width, height):
    """How much of each pixel lines of this half width cover; segments (m, 4) x0, y0, x1, y1; round ends."""
    mask = np.zeros((height, width), np.float32)
    clip = np.array([left, top, left + width, top + height])
    for k in range(len(segments)):
        ax, ay = segments[k, 0], segments[k, 1]
        dx, dy = segments[k, 2] - ax, segments[k, 3] - ay
        square = dx * dx + dy * dy
        reach = half_width + 0.5
        x0, x1, y0, y1 = window(clip, ax + dx / 2, ay + dy / 2, abs(dx) / 2 + reach, abs(dy) / 2 + reach)
        for row in range(y0, y1):
            py = row + 0.5 - ay
            for col in range(x0, x1):
                px = col + 0.5 - ax
                t = min(max((px * dx + py * dy) / square, 0.0), 1.0) if square > 0 else 0.0
                cover = reach - np.sqrt((px - t * dx) ** 2 + (py - t * dy) ** 2)
                if cover > mask[row - top, col - left]:
                    mask[row - top, col - left] = min(cover, min(1.0, 2 * half_width))
    return mask


@kernel
def blend(image, mask, left, top, ink, alpha):
    """Lay a colour over the image where the mask (h, w) float32 covers it; the mask must lie inside the image."""
    height, width = mask.shape
    for row in range(height):
        for col in range(width):
            cover = mask[row, col] * alpha
            if cover > 0:
                over(image, top + row, left + col, ink[0], ink[1], ink[2], min(cover, 1.0))


@kernel
def _speck(ix, iy, salt):
    """A number in [0, 1) that belongs to one place of the ground."""
    h = np.uint64(ix) * np.uint64(0x9E3779B97F4A7C15) ^ np.uint64(iy) * np.uint64(0xC2B2AE3D27D4EB4F)
    h ^= np.uint64(salt) * np.uint64(0x165667B19E3779F9)
    h = (h ^ (h >> np.uint64(29))) * np.uint64(0xBF58476D1CE4E5B9)
    h = (h ^ (h >> np.uint64(32))) * np.uint64(0x94D049BB133111EB)
    return np.float64((h ^ (h >> np.uint64(31))) >> np.uint64(40)) / 16777216.0


@kernel
def grain(xs, ys, wavelength, salt):
    """Smooth noise in [-1, 1] over the ground: (len(ys), len(xs)) float32, blotches `wavelength` metres across."""
    out = np.empty((len(ys), len(xs)), np.float32)
    ix, fx = np.empty(len(xs), np.int64), np.empty(len(xs))
    for col in range(len(xs)):
        u = xs[col] / wavelength
        ix[col] = int(np.floor(u))
        f = u - ix[col]
        fx[col] = f * f * (3 - 2 * f)
    if len(xs) == 0:
        return out
    first = ix.min()
    here, above, drawn = np.empty(ix.max() - first + 2), np.empty(ix.max() - first + 2), False
    row_of_specks = 0
    for row in range(len(ys)):
        v = ys[row] / wavelength
        iy = int(np.floor(v))
        fy = v - iy
        fy = fy * fy * (3 - 2 * fy)
        if not drawn or iy != row_of_specks:
            for k in range(len(here)):
                here[k], above[k] = _speck(first + k, iy, salt), _speck(first + k, iy + 1, salt)
            drawn, row_of_specks = True, iy
        for col in range(len(xs)):
            k, f = ix[col] - first, fx[col]
            low = here[k] * (1 - f) + here[k + 1] * f
            high = above[k] * (1 - f) + above[k + 1] * f
            out[row, col] = 2 * (low * (1 - fy) + high * fy) - 1
    return out


@kernel
def lighten(image, light, left, top):
    """Make the pixels of an image lighter by a share `light` (h, w) float32 of what they are."""
    for row in range(light.shape[0]):
        for col in range(light.shape[1]):
            times = np.float32(1) + light[row, col]
            for c in range(3):
                value = np.float32(image[top + row, left + col, c]) * times
                image[top + row, left + col, c] = np.uint8(min(max(value, np.float32(0)), np.float32(255)))


@kernel
def bilinear(values, row0, col0, xs, ys):
    """Values at columns `xs` (m,) and rows `ys` (k,), straight between two: (k, m) float32.

    `values` [iy, ix] are a part of a raster that begins at (row0, col0); positions count in the whole raster, so that
    they come out the same whichever part is given.
    """
    ny, nx = values.shape
    out = np.empty((len(ys), len(xs)), np.float32)
    low, share = np.empty(len(xs), np.int64), np.empty(len(xs), np.float32)
    for col in range(len(xs)):
        low[col], share[col] = _step(xs[col], col0, nx)
    right = min(1, nx - 1)
    for row in range(len(ys)):
        iy, part = _step(ys[row], row0, ny)
        up, v = min(iy + 1, ny - 1), np.float32(part)
        for col in range(len(xs)):
            ix, u = low[col], share[col]
            south = values[iy, ix] + (values[iy, ix + right] - values[iy, ix]) * u
            north = values[up, ix] + (values[up, ix + right] - values[up, ix]) * u
            out[row, col] = south + (north - south) * v
    return out


@kernel
def _step(at, first, count):
    """Between which value and the next a position lies, and how far along."""
    whole = np.floor(at)
    low, share = int(whole) - first, at - whole
    if low < 0:
        return 0, 0.0
    if low > count - 2:
        return max(count - 2, 0), 1.0 if count > 1 else 0.0
    return low, share


@kernel
def smear(values, weights):
    """Values (h, w) float32 blurred by weights of an odd count, the edge going on outside; sums in a fixed order."""
    height, width = values.shape
    reach = len(weights) // 2
    across, out = np.empty((height, width), np.float32), np.empty((height, width), np.float32)
    for row in range(height):
        for col in range(width):
            total = 0.0
            for k in range(len(weights)):
                total += weights[k] * values[row, min(max(col + k - reach, 0), width - 1)]
            across[row, col] = total
    for row in range(height):
        for col in range(width):
            total = 0.0
            for k in range(len(weights)):
                total += weights[k] * across[min(max(row + k - reach, 0), height - 1), col]
            out[row, col] = total
    return out


@kernel
def shrink(values, step):
    """Means of blocks of step x step values; the last ones take their edge as often as needed."""
    height, width = values.shape
    ny, nx = -(-height // step), -(-width // step)
    out = np.empty((ny, nx), np.float32)
    for row in range(ny):
        for col in range(nx):
            total = 0.0
            for r in range(row * step, (row + 1) * step):
                for c in range(col * step, (col + 1) * step):
                    total += values[min(r, height - 1), min(c, width - 1)]
            out[row, col] = total / (step * step)
    return out


@kernel
def steepness(level):
    """How fast a level (h, w) float32 changes per pixel (Sobel); 0 along the edge."""
    height, width = level.shape
    out = np.zeros((height, width), np.float32)
    for r in range(1, height - 1):
        for c in range(1, width - 1):
            east = level[r - 1, c + 1] + 2 * level[r, c + 1] + level[r + 1, c + 1]
            west = level[r - 1, c - 1] + 2 * level[r, c - 1] + level[r + 1, c - 1]
            south = level[r + 1, c - 1] + 2 * level[r + 1, c] + level[r + 1, c + 1]
            north = level[r - 1, c - 1] + 2 * level[r - 1, c] + level[r - 1, c + 1]
            out[r, c] = 0.125 * np.sqrt((east - west) ** 2 + (south - north) ** 2)
    return out


@kernel
def patch(image, shares, inks, outline, sharp, unit):
    """Give each pixel of an image (h, w, 3) the ink of the kind of ground with the largest share there.

    `shares` (kinds, h, w) float32, `inks` (kinds, 3); borders are `sharp` (pixels for a lead of 1), with a faint
    `outline` some `unit` wide.
    """
    for row in range(image.shape[0]):
        for col in range(image.shape[1]):
            most, second, first, other = np.float32(0), np.float32(0), 0, -1
            for k in range(len(shares)):
                share = shares[k, row, col]
                if share > most:
                    most, second, first, other = share, most, k, first
                elif share > second:
                    second, other = share, k
            other = first if other < 0 or second <= 0 else other  # who is not near has no say
            lead = min(most - second, np.float32(1))
            edge = lead * sharp
            rim = 0.13 * np.exp(-edge / (2.5 * unit)) * (1.0 - lead) if edge < 30 * unit else 0.0
            mine = min(edge + 0.5, 1.0)
            for c in range(3):
                ink = inks[other, c] + (inks[first, c] - inks[other, c]) * mine
                image[row, col, c] = np.uint8(ink * (1 - rim) + outline[c] * rim + 0.5)

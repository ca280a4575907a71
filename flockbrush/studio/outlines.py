"""Geometry of mouse strokes: simplified lines, and the polygons that a round pen covers."""

from __future__ import annotations

import math

import cv2
import numpy as np

MOST_CELLS = 1500  # of the raster on which a stroke becomes an outline, along its longer side
CORNERS = 60  # of one outline at most


def thinned(points, tolerance) -> np.ndarray:
    """The points of a line that matter, (k, 2): none that is left out lies farther from it than the tolerance (m)."""
    points = np.asarray(points, float)
    if len(points) < 3:
        return points
    origin = points.mean(axis=0)
    corners = cv2.approxPolyDP((points - origin).astype(np.float32)[:, None], float(tolerance), False)
    return corners[:, 0].astype(float) + origin


def swath(points, radius) -> list[np.ndarray]:
    """Polygons (k, 2) m that together cover what a round pen of this radius (m) covers along some points.

    A stroke that closes a ring is cut, so that what it surrounds stays free.
    """
    points = thinned(points, radius / 8)
    outlines, holes = _outlines(points, radius)
    if not holes or len(points) < 3:
        return outlines
    middle = len(points) // 2
    return [part for piece in (points[: middle + 1], points[middle:]) for part in swath(piece, radius)]


def _outlines(points, radius):
    """(outer polygons, whether there are holes)."""
    low, high = points.min(axis=0) - 1.2 * radius, points.max(axis=0) + 1.2 * radius
    cell = max(radius / 12, float((high - low).max()) / MOST_CELLS)
    width, height = (math.ceil(side / cell) + 1 for side in high - low)
    mask = np.zeros((height, width), np.uint8)
    fine = np.round((points - low) / cell * 16).astype(np.int32)
    for start, stop in zip(fine, [*fine[1:], fine[-1]], strict=True):
        cv2.line(mask, start.tolist(), stop.tolist(), 255, max(1, round(2 * radius / cell)), shift=4)
    for x, y in fine:
        cv2.circle(mask, (int(x), int(y)), max(1, round(16 * radius / cell)), 255, -1, shift=4)
    contours, family = cv2.findContours(mask, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    outer = [contour for contour, (_, _, _, parent) in zip(contours, family[0], strict=True) if parent < 0]
    holes = any(
        parent >= 0 and cv2.contourArea(contour) * cell * cell > radius * radius / 4
        for contour, (_, _, _, parent) in zip(contours, family[0], strict=True)
    )
    return [_few_corners(contour) * cell + low for contour in outer if len(contour) > 2], holes


def _few_corners(contour):
    tolerance = 1.5  # cells: the steps of the raster go, round ends stay round
    while True:
        polygon = cv2.approxPolyDP(contour, tolerance, True)[:, 0].astype(float)
        if len(polygon) <= CORNERS:
            return polygon
        tolerance *= 1.3


def box(a, b) -> np.ndarray:
    """The rectangle with two opposite corners, (4, 2) m, counter-clockwise."""
    (west, east), (south, north) = sorted((a[0], b[0])), sorted((a[1], b[1]))
    return np.array([[west, south], [east, south], [east, north], [west, north]])


def rows(points) -> list:
    """Points as commands want them: [[x, y], ...], to the millimetre."""
    return [[round(float(x), 3), round(float(y), 3)] for x, y in np.asarray(points, float)]

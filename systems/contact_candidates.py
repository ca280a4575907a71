"""Whose bodies could be met in a tick: those nearer than a reach, found in the cells sixteen at a time."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from flockbrush.engine.lanes import LANES, lane_numbers, load, load_where, pack, pointer, store
from flockbrush.engine.lanes import count as lanes_set
from flockbrush.engine.parallel import over_rows
from numba import njit


class Contacts(NamedTuple):
    """Whom everybody could meet in a tick, by slot."""

    x: np.ndarray  # (slots,) m
    y: np.ndarray
    fx: np.ndarray  # heading
    fy: np.ndarray
    half: np.ndarray  # m, half the length of the axis
    radius: np.ndarray  # m
    row: np.ndarray  # (slots,) int32
    order: np.ndarray  # (k,) int32: slots of animals that move
    itself: np.ndarray  # (slots,) int32: of a ghost the slot of the animal that it copies
    near: np.ndarray  # (slots, width) int32: slots of animals that could be met
    count: np.ndarray  # type: ignore[assignment]  # (slots,) int32: how many they are


def contacts_within(reach, cells) -> Contacts:
    """The bodies whose centres are nearer than ``reach``, m."""
    m, width = len(cells.row), LANES  # width: a guess of how many at most
    order = itself = np.arange(m, dtype=np.int32)
    if cells.ghost.any():
        order, itself = order[~cells.ghost], cells.slot[cells.row]
    count = np.zeros(m, np.int32)
    while True:
        near = np.empty((m, width), np.int32)
        over_rows(_find_contacts, len(order), cells, order, reach, near, count)
        most = int(count.max()) if m else 0
        if most <= width:
            herd = cells.x, cells.y, cells.fx, cells.fy, cells.half, cells.radius, cells.row
            return Contacts(*herd, order, itself, near, count)
        width = 1 << most.bit_length()


@njit(cache=True, nogil=True, error_model="numpy")
def _find_contacts(lo, hi, cells, order, reach, near, count):
    _contacts_of(lo, hi, cells, order, reach, near, count, np.empty(near.shape[1] + LANES, np.int32))


@njit(cache=True, nogil=True, error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True)
def _contacts_of(lo, hi, cells, order, reach, near, count, found):
    x, y, start, nx, ny = pointer(cells.x), pointer(cells.y), pointer(cells.start), cells.nx, cells.ny
    cell, width, reach2, here, out = cells.cell, near.shape[1], reach * reach, pointer(found), pointer(near)
    for o in range(lo, hi):
        s = order[o]
        xi, yi = x[s], y[s]
        west, south = cells.west[s], cells.south[s]
        r0, r1 = max(0, int((yi - reach - south) / cell)), min(ny - 1, int((yi + reach - south) / cell))
        c0, c1 = max(0, int((xi - reach - west) / cell)), min(nx - 1, int((xi + reach - west) / cell))
        n = np.int64(0)
        for r in range(r0, r1 + 1):
            end = start[r * nx + c1 + 1]
            for k in range(start[r * nx + c0], end, LANES):
                there, slot = lane_numbers() < np.int32(end - k), lane_numbers() + np.int32(k)
                dx, dy = load_where(x, k, there) - xi, load_where(y, k, there) - yi
                ok = there & (dx * dx + dy * dy < reach2) & (slot != s)
                pack(here, min(n, width), slot, ok)
                n += lanes_set(ok)
        count[s] = n
        for k in range(0, width if n <= width else 0, LANES):
            store(out, s * width + k, load(here, k))

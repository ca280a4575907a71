"""What blocks is drawn: the picture of the ground lets through, and stops, what the simulation does."""

from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from flockbrush.render.drawn_terrain import any_of, joined
from flockbrush.render.overlays import Overlays
from flockbrush.render.painter import Painter
from flockbrush.render.scenery import Scenery
from flockbrush.runs.run import start


def level(blocked, index=None):
    """A level of cells of 1 m, deep water where it is blocked."""
    flat = np.ones(blocked.shape)
    terrain = SimpleNamespace(
        walkable=~blocked, speed_factor=flat, cost=flat, blocks_view=np.zeros(blocked.shape, bool),
        **({} if index is None else {"index": index, "names": ["grass", "water"], "colours": ["#9cb86a", "#3060c0"]}),
    )  # fmt: skip
    height, width = blocked.shape
    return SimpleNamespace(name="ditch", width=float(width), height=float(height), cell=1.0, terrain=terrain)


def water_of(blocked, size, index=None):
    """(painter, which pixels of its picture are nearer to the colour of the water)."""
    painter = Painter(level(blocked, index), size, words=False)
    everything = Painter(level(np.ones_like(blocked), None if index is None else index * 0 + 1), size, words=False)
    nothing = Painter(level(np.zeros_like(blocked), None if index is None else index * 0), size, words=False)
    ground, wet, dry = (p.ground.astype(int) for p in (painter, everything, nothing))
    return painter, np.abs(ground - wet).sum(axis=2) < np.abs(ground - dry).sum(axis=2)


@pytest.mark.parametrize("size", [(1280, 720), (400, 300), (160, 120)])
def test_a_diagonal_ditch_of_single_tiles_is_drawn_without_fords(size):
    blocked = np.eye(30, 40, dtype=bool)
    blocked[np.arange(20), np.arange(39, 19, -1)] = True
    blocked[24, 24] = False  # the one ford
    painter, water = water_of(blocked, size)
    (left, top), (right, bottom) = (painter.camera.pixels(at).astype(int) for at in ((0, 30), (40, 0)))
    drawn = connected(~water[top:bottom, left:right])
    simulated = connected(~blocked)
    for a, b in (((25, 5), (4, 34)), ((2, 20), (4, 37)), ((25, 5), (25, 35)), ((2, 20), (25, 35))):
        apart = simulated[a] != simulated[b]
        ends = [painter.camera.pixels((ix + 0.5, iy + 0.5)).astype(int) - (left, top) for iy, ix in (a, b)]
        assert (drawn[ends[0][1], ends[0][0]] != drawn[ends[1][1], ends[1][0]]) == apart


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("named", [False, True])
def test_the_middle_of_every_cell_is_water_where_it_blocks_and_nowhere_else(seed, named):
    blocked = np.random.default_rng(seed).random((30, 40)) < (0.15, 0.5, 0.85, 0.3)[seed]
    painter, water = water_of(blocked, (800, 600), blocked.astype(int) if named else None)
    iy, ix = np.indices(blocked.shape)
    at = painter.camera.pixels(np.stack([ix + 0.5, iy + 0.5], axis=-1).reshape(-1, 2)).astype(int)
    assert np.array_equal(water[at[:, 1], at[:, 0]], blocked.reshape(-1))


def test_a_ditch_narrower_than_a_pixel_is_still_one_piece():
    blocked = np.zeros((900, 1200), bool)
    blocked[:, 600] = True
    painter, water = water_of(blocked, (320, 240))
    x = int(painter.camera.pixels((600.5, 0))[0])
    low, high = painter.camera.pixels((0, 900))[1], painter.camera.pixels((0, 0))[1]
    inner = slice(int(low) + 2, int(high) - 2)
    assert water[inner, x - 2 : x + 3].any(axis=1).all()


def test_cells_that_touch_at_a_corner_are_joined_and_others_keep_their_size():
    one = joined(np.array([[True, False], [False, True]]), 4)
    assert one.sum() == 2 * 16 + 2 and one[4, 3] and one[3, 4]
    other = joined(np.array([[False, True], [True, False]]), 2)
    assert other.sum() == 2 * 4 + 2
    full = np.array([[True, True], [False, True]])
    assert np.array_equal(joined(full, 3), np.kron(full, np.ones((3, 3), bool)))


def test_a_block_of_cells_is_blocked_when_one_of_them_is():
    cells = np.zeros((5, 7), bool)
    cells[4, 6] = cells[0, 2] = True
    assert np.array_equal(any_of(cells, 3), [[True, False, False], [False, False, True]])


def test_the_overlay_walkable_hatches_what_stops_animals_and_nothing_else():
    simulation = start("pillars")
    scenery = Scenery(simulation)
    painter, overlays = Painter(scenery, (640, 480), words=False), Overlays(scenery)
    plain = painter.frame()
    shown = painter.frame(under=lambda frame: overlays.under(frame, painter.camera, {"walkable"}))
    changed = (plain != shown).any(axis=2)
    blocked, cell = scenery.land.blocked, scenery.land.cell
    inner = ~cv2.dilate((~blocked).astype(np.uint8), np.ones((3, 3))).astype(bool)
    far = ~cv2.dilate(blocked.astype(np.uint8), np.ones((5, 5))).astype(bool)
    for cells, all_of in ((inner, True), (far, False)):
        iy, ix = np.nonzero(cells)
        at = painter.camera.pixels(np.stack([(ix + 0.5) * cell, (iy + 0.5) * cell], axis=1)).astype(int)
        assert len(at) and (changed[at[:, 1], at[:, 0]] == all_of).all()


def connected(free):
    """Pieces of free cells that share a side."""
    return cv2.connectedComponents(free.astype(np.uint8), connectivity=4)[1]

"""Animals sorted into cells: nobody is lost, nobody is far from his cell."""

import numpy as np
import pytest
from flockbrush.systems.grid import sort_into_cells
from flockbrush.systems.visibility import visible_neighbours


def herd(n, side, seed=0):
    rng = np.random.default_rng(seed)
    angle = rng.uniform(0, 2 * np.pi, n)
    xyz = np.c_[rng.uniform(0, side, (n, 2)), np.zeros(n)]
    return xyz, np.c_[np.cos(angle), np.sin(angle), 0 * angle], rng.uniform(0.4, 1.5, n), rng.uniform(0.1, 0.3, n)


def cell_of(cells, x, y):
    column = np.minimum(((x - cells.west) / cells.cell).astype(int), cells.nx - 1)
    return np.minimum(((y - cells.south) / cells.cell).astype(int), cells.ny - 1) * cells.nx + column


def test_every_animal_has_one_slot_and_takes_its_heading_and_body_there():
    xyz, forward, length, radius = herd(300, 40)
    cells = sort_into_cells(xyz, forward, length, radius, 10.0)
    assert sorted(cells.row) == list(range(300))
    assert np.array_equal(cells.row[cells.slot], np.arange(300))
    assert np.array_equal(np.c_[cells.x, cells.y], xyz[cells.row, :2])
    assert np.array_equal(np.c_[cells.fx, cells.fy], forward[cells.row, :2])
    assert np.array_equal(cells.radius, radius[cells.row])
    assert np.array_equal(cells.half, np.maximum(length / 2 - radius, 0)[cells.row])
    assert not cells.ghost.any()


def test_an_animal_is_in_the_cell_where_it_stands_and_cells_go_east_then_north():
    cells = sort_into_cells(*herd(500, 60), 8.0)
    assert cells.start[0] == 0 and cells.start[-1] == 500 and len(cells.start) == cells.nx * cells.ny + 1
    cell = np.repeat(np.arange(cells.nx * cells.ny), np.diff(cells.start))
    assert np.array_equal(cell, cell_of(cells, cells.x, cells.y))


def test_animals_of_one_cell_keep_the_order_of_their_rows():
    cells = sort_into_cells(*herd(500, 30), 10.0)
    for a, b in zip(cells.start, cells.start[1:], strict=False):
        assert np.all(np.diff(cells.row[a:b]) > 0)


def test_a_denser_herd_gets_smaller_cells_within_bounds_set_by_the_reach():
    sparse, dense, packed = (sort_into_cells(*herd(400, side), 10.0).cell for side in (100, 25, 1))
    assert sparse == 5.0 and dense < sparse and packed == pytest.approx(10 / 12)


def test_the_density_is_what_an_animal_meets_not_what_the_map_holds():
    clump, stray = herd(400, 10), herd(1, 1)
    xyz = np.r_[clump[0], stray[0] + 1000]
    rest = [np.r_[a, b] for a, b in zip(clump[1:], stray[1:], strict=True)]
    cells = sort_into_cells(xyz, *rest, 5.0)
    assert 2 < cells.density < 8


def test_a_stray_far_away_costs_no_map_of_empty_cells():
    clump, stray = herd(400, 10), herd(1, 1)
    rest = [np.r_[a, b] for a, b in zip(clump[1:], stray[1:], strict=True)]
    cells = sort_into_cells(np.r_[clump[0], stray[0] + 1e6], *rest, 5.0)
    assert len(cells.start) < 100_000
    assert sorted(cells.row) == list(range(401))


def strewn(n=600, seed=7):
    """A dense herd about the middle, a thinner one 3 km off, and strays that see none of them or just not quite."""
    rng = np.random.default_rng(seed)
    xy = np.r_[
        rng.uniform(-4, 4, (n // 2, 2)), rng.uniform(-30, 30, (n // 2, 2)) + (3000, -2000),
        rng.uniform(-9e3, 9e3, (20, 2)), [[12.9, 0], [-13.5, 2], [1, 13.8], [1e6, 3]],
    ]  # fmt: skip
    return np.c_[rng.permutation(xy), np.zeros(len(xy))], rng.uniform(0, 2 * np.pi, len(xy))


@pytest.mark.parametrize("occlusion", [False, True])
def test_strays_take_nobody_out_of_sight_and_bring_nobody_in(occlusion):
    xyz, angle = strewn()
    n = len(xyz)
    forward, length, radius = np.c_[np.cos(angle), np.sin(angle), 0 * angle], np.full(n, 0.5), np.full(n, 0.25)
    lists = visible_neighbours(
        sort_into_cells(xyz, forward, length, radius, 10.0), np.full(n, 10.0), np.full(n, -1.0), None, occlusion
    )
    apart = np.linalg.norm(xyz[:, None] - xyz, axis=2)
    for i in range(n):
        (others,) = np.nonzero((apart[i] < 10.0) & (np.arange(n) != i))
        if occlusion:
            others = [j for j in others if not hidden(xyz, i, j, others, apart[i], 0.25)]
        assert sorted(lists.of(i)) == list(others)
    assert (np.diff(lists.first) > 1).sum() > 500


def hidden(xyz, i, j, others, apart, radius):
    """Whether the segment from i to j meets the disc of somebody nearer."""
    if apart[j] == 0:
        return False
    way, nearer = (xyz[j] - xyz[i])[:2] / apart[j], others[(apart[others] < apart[j]) & (apart[others] > radius)]
    to = (xyz[nearer] - xyz[i])[:, :2]
    along = to @ way
    aside = np.abs(to[:, 0] * way[1] - to[:, 1] * way[0])
    end = np.linalg.norm(to - apart[j] * way, axis=1)
    return bool((((along > 0) & (along < apart[j]) & (aside <= radius)) | (end <= radius)).any())


@pytest.mark.parametrize("away", [400.0, 5e3, 1e6])
def test_a_herd_has_the_same_cells_with_a_stray_as_without(away):
    herds = herd(400, 20)
    rest = [np.r_[a, b] for a, b in zip(herds[1:], herd(1, 1)[1:], strict=True)]
    alone = sort_into_cells(*herds, 5.0)
    cells = sort_into_cells(np.r_[herds[0], [[20 + away, 20 + away, 0]]], *rest, 5.0)
    assert cells.cell == pytest.approx(alone.cell, rel=0.01) and cells.density == pytest.approx(alone.density, rel=0.01)
    assert np.array_equal(cells.west[:400], alone.west) and np.array_equal(cells.south[:400], alone.south)
    assert len(cells.start) < 3 * len(alone.start) + 200 or away < 1000


def test_across_a_wrapped_seam_stand_ghosts_of_the_animals_of_the_other_side():
    xyz = np.array([[1.0, 1.0, 0], [29.0, 15.0, 0], [15.0, 15.0, 0]])
    forward = np.tile([1.0, 0, 0], (3, 1))
    cells = sort_into_cells(xyz, forward, np.ones(3), np.full(3, 0.2), 5.0, wrap=(30.0, 30.0))
    ghosts = sorted(zip(cells.row[cells.ghost], cells.x[cells.ghost], cells.y[cells.ghost], strict=True))
    assert ghosts == [(0, 1.0, 31.0), (0, 31.0, 1.0), (0, 31.0, 31.0), (1, -1.0, 15.0)]
    assert not cells.ghost[cells.slot].any()
    assert np.array_equal(cells.row[cells.slot], [0, 1, 2])


def test_no_animals_make_an_empty_grid():
    cells = sort_into_cells(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0), np.zeros(0), 5.0)
    assert len(cells.x) == 0 and cells.start[-1] == 0


def test_a_herd_in_one_point_fits_in_one_cell():
    forward = np.tile([1.0, 0, 0], (5, 1))
    cells = sort_into_cells(np.full((5, 3), 7.0), forward, np.ones(5), np.full(5, 0.2), 5.0)
    assert cells.nx == cells.ny == 1 and list(cells.row) == [0, 1, 2, 3, 4]


def test_a_position_that_is_not_a_number_is_named():
    xyz, forward, length, radius = herd(5, 10)
    xyz[3, 1] = np.nan
    with pytest.raises(ValueError, match="the position of row 3 is not a number"):
        sort_into_cells(xyz, forward, length, radius, 5.0)

"""Fields on a grid of cells over the stabilised ground, from pixels of bodies and how they move (paper section 4).

A cell's density is its body pixels over the pixels of one animal and its area in the picture.  Mean velocity, and the
variances of speed and of the unsigned angle to the mean, are over its body pixels, whose flow has been averaged over
half a body.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import cv2
import numpy as np
from numba import njit

from flockbrush.film.camera_maps import back, moved_by
from flockbrush.film.observations import Fields
from flockbrush.film.pair_density import pairs_of_mask

MOST_CELLS = 160_000
SUB = 4  # points across a cell by which it is told how much of it is in the picture
SEEN = 0.5  # of a cell in the picture: it is seen


@dataclass(frozen=True)
class ClipGrid:
    """Square cells over everything that the clip shows."""

    cell: float  # side, BL
    origin: np.ndarray  # (2,); lower left corner, BL
    shape: tuple[int, int]  # rows and columns
    to_bl: np.ndarray  # (2, 3); from pixels of the reference picture to BL, y up

    @property
    def to_pixels(self) -> np.ndarray:
        """(2, 3) from BL to pixels of the reference picture."""
        return back(self.to_bl)

    def cells_of(self, xy):
        """(n,) numbers of the cells that points (n, 2) BL are in, -1 outside."""
        column, row = np.floor((xy - self.origin) / self.cell).astype(np.int64).T
        inside = (row >= 0) & (column >= 0) & (row < self.shape[0]) & (column < self.shape[1])
        return np.where(inside, row * self.shape[1] + column, -1)

    def points(self):
        """(ny * SUB, nx * SUB, 2) BL evenly over all cells."""
        ny, nx = self.shape
        x, y = np.meshgrid((np.arange(nx * SUB) + 0.5) / SUB, (np.arange(ny * SUB) + 0.5) / SUB)
        return self.origin + self.cell * np.stack([x, y], axis=-1)


def grid_over(size, maps, body_px, across) -> ClipGrid:
    """The grid of a clip: ``across`` cells over the longer side of the first picture, and on over all that is seen.

    Parameters
    ----------
    size : (int, int)
        Of the pictures, px.
    maps : (n, 2, 3) ndarray
        To the first picture.
    body_px : float
        Pixels of the first picture in a BL.
    across : int
    """
    to_bl = np.array([[1.0, 0, 0], [0, -1.0, size[1]]]) / body_px  # the first picture's lower left corner is (0, 0)
    corners = np.array([(0, 0), (size[0], 0), (0, size[1]), size], float)
    at = moved_by(to_bl, np.concatenate([moved_by(m, corners) for m in maps]))
    cell = max(size) / across / body_px
    low, high = at.min(0), at.max(0)
    low = np.where(low > -0.02 * cell, np.maximum(low, 0), low)  # a still camera's grid begins in its corner
    low = cell * np.floor(low / cell + 1e-6)
    nx, ny = np.maximum(1, np.ceil((high - low) / cell - 0.05)).astype(int)
    if nx * ny > MOST_CELLS:
        grow = float(np.sqrt(nx * ny / MOST_CELLS))
        cell, nx, ny = cell * grow, int(np.ceil(nx / grow)), int(np.ceil(ny / grow))
    return ClipGrid(float(cell), low, (int(ny), int(nx)), to_bl)


@dataclass
class Collector:
    """Takes frames one after the other and becomes `Fields`."""

    grid: ClipGrid
    size: tuple[int, int]  # of the pictures, px
    body_pixels: float  # of one animal in the reference picture
    paired: bool = False  # measure the distances between bodies: where animals are too small to be separated
    rows: dict[str, list] = field(default_factory=dict)

    def add(self, number, mask, to_first, seconds, flow=None, slow=0.0):
        """Take a frame.

        Parameters
        ----------
        number : int
            In the clip.
        mask : (h, w) uint8 ndarray
        to_first : (2, 3) ndarray
        seconds : float
            That the flow bridges; negative when it goes to an earlier picture.
        flow : (at, move), optional
            (n, 2) px each; None of a still picture.
        slow : float
            BL/s: slower pixels have no direction.
        """
        density, count = self._density(mask, to_first)
        share = self._share(to_first)
        with np.errstate(invalid="ignore", divide="ignore"):
            density = np.where(share > 0, density / np.maximum(share, 1.0 / SUB**2), np.nan)
        moved = self._moved(to_first, seconds, slow, *(flow or (np.empty((0, 2)), np.empty((0, 2)))))
        edge = self._at_edge(mask, to_first)
        row = {"density": density, "seen": share >= SEEN, "count": count, "frames": number, "at_edge": edge, **moved}
        if self.paired:
            px = 1.0 / np.sqrt(abs(np.linalg.det(self.grid.to_bl[:, :2] @ to_first[:, :2])))
            row["pairs"] = pairs_of_mask(mask, px, self.body_pixels / abs(np.linalg.det(to_first[:, :2])))
        for name, value in row.items():
            self.rows.setdefault(name, []).append(value)

    def _density(self, mask, to_first):
        """(animals a BL² (ny, nx), animals in all)."""
        y, x = np.nonzero(mask)
        to_cell = np.vstack([to_first, (0, 0, 1)])
        at = moved_by((self.grid.to_bl @ to_cell), np.column_stack([x, y]))
        cells = self.grid.cells_of(at)
        ny, nx = self.grid.shape
        zoom = abs(np.linalg.det(to_first[:, :2]))
        animals = np.bincount(cells[cells >= 0], minlength=ny * nx).reshape(ny, nx) * zoom / self.body_pixels
        return animals / self.grid.cell**2, float(len(x) * zoom / self.body_pixels)

    def _at_edge(self, mask, to_first):
        """Share of a mask that is within half a body length of the picture's edge."""
        to_bl = self.grid.to_bl[:, :2] @ to_first[:, :2]
        rim = max(1, round(0.5 / np.sqrt(abs(np.linalg.det(to_bl)))))
        whole = cv2.countNonZero(mask)
        return 1.0 - cv2.countNonZero(np.ascontiguousarray(mask[rim:-rim, rim:-rim])) / whole if whole else 0.0

    def _share(self, to_first):
        """How much of each cell is in the picture, (ny, nx)."""
        at = moved_by(back(to_first), moved_by(self.grid.to_pixels, self.grid.points()))
        inside = (at[..., 0] >= 0) & (at[..., 1] >= 0) & (at[..., 0] < self.size[0]) & (at[..., 1] < self.size[1])
        ny, nx = self.grid.shape
        return inside.reshape(ny, SUB, nx, SUB).mean((1, 3))

    def _moved(self, to_first, seconds, slow, at, move):
        ny, nx = self.grid.shape
        to_bl = self.grid.to_bl @ np.vstack([to_first, (0, 0, 1)])
        cells = self.grid.cells_of(moved_by(to_bl, at)) if len(at) else np.empty(0, np.int64)
        v = (move @ to_bl[:, :2].T) / (seconds or 1.0)
        mean, speed, spread, angle = moments(cells, np.ascontiguousarray(v, float), ny * nx, float(slow))
        return {
            "velocity": mean.reshape(ny, nx, 2), "speed": speed.reshape(ny, nx),
            "speed_variance": spread.reshape(ny, nx), "angular_variance": angle.reshape(ny, nx),
        }  # fmt: skip

    def last(self) -> dict:
        """The fields of the frame that was taken last, by name."""
        return {name: values[-1] for name, values in self.rows.items()}

    def fields(self, fps, obstacle=None, region=None, outline=None) -> Fields:
        """All frames taken so far."""
        arrays = {name: np.array(values) for name, values in self.rows.items()}
        return Fields(
            fps=float(fps), cell=self.grid.cell, origin=np.asarray(self.grid.origin, float),
            obstacle=np.zeros(self.grid.shape, bool) if obstacle is None else obstacle,
            region=np.zeros(self.grid.shape, np.uint8) if region is None else region, outline=outline, **arrays,
        )  # fmt: skip


@njit(cache=True)
def moments(cells, v, count, slow):
    """Of the velocities in each cell: mean, mean speed, variance of speed, variance of the angle to the mean.

    Parameters
    ----------
    cells : (n,) int ndarray
        -1: nowhere.
    v : (n, 2) ndarray
    count : int
    slow : float
        Slower ones have no direction.

    Returns
    -------
    mean : (count, 2)
    speed, speed_variance : (count,)
    angular_variance : (count,)
        degrees² of the unsigned angle; NaN where nobody has a direction.
    """
    n = np.zeros(count)
    mean, total, squares = np.zeros((count, 2)), np.zeros(count), np.zeros(count)
    for i in range(len(cells)):
        c = cells[i]
        if c < 0:
            continue
        s = np.hypot(v[i, 0], v[i, 1])
        n[c] += 1
        mean[c] += v[i]
        total[c] += s
        squares[c] += s * s
    speed, spread = np.full(count, np.nan), np.full(count, np.nan)
    for c in range(count):
        if n[c] == 0:
            mean[c] = np.nan
            continue
        mean[c] /= n[c]
        speed[c] = total[c] / n[c]
        spread[c] = max(squares[c] / n[c] - speed[c] ** 2, 0.0)
    k, first, second = np.zeros(count), np.zeros(count), np.zeros(count)
    for i in range(len(cells)):
        c = cells[i]
        if c < 0:
            continue
        s = np.hypot(v[i, 0], v[i, 1])
        m = np.hypot(mean[c, 0], mean[c, 1])
        if s <= slow or m == 0:
            continue
        cosine = (v[i, 0] * mean[c, 0] + v[i, 1] * mean[c, 1]) / (s * m)
        angle = np.degrees(np.arccos(min(1.0, max(-1.0, cosine))))
        k[c] += 1
        first[c] += angle
        second[c] += angle * angle
    turned = np.full(count, np.nan)
    for c in range(count):
        if k[c] > 0:
            turned[c] = max(second[c] / k[c] - (first[c] / k[c]) ** 2, 0.0)
    return mean, speed, spread, turned


def outlined(mask, grid: ClipGrid, scale, within=0.05) -> np.ndarray:
    """(k, 5) edges of the patches of a mask, and of holes in them: x0, y0, x1, y1 in BL, and the patch.

    Parameters
    ----------
    mask, grid, scale
        As for `painted`.
    within : float
        BL by which an edge may run beside the mask's own.
    """
    many, patches = cv2.connectedComponents(mask, connectivity=4)
    px = within / max(abs(grid.to_bl[0, 0]) * scale, 1e-12)
    edges = [np.zeros((0, 5))]
    for k in range(1, many):
        # pixels are squares: a mask of twice the size has its border between them
        large = cv2.resize((patches == k).astype(np.uint8), None, fx=2, fy=2, interpolation=cv2.INTER_NEAREST)
        for line in cv2.findContours(large, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_SIMPLE)[0]:
            corners = cv2.approxPolyDP(line, 2 * px, True)[:, 0]
            if len(corners) > 2:
                at = moved_by(grid.to_bl, (corners + 0.5) * 0.5 * scale)
                edges.append(np.column_stack([at, np.roll(at, -1, 0), np.full(len(at), k - 1.0)]))
    return np.concatenate(edges)


def painted(mask, grid: ClipGrid, scale) -> np.ndarray:
    """(ny, nx) how many of the SUB x SUB points of each cell lie on each value of a mask: the commonest value.

    Parameters
    ----------
    mask : (h, w) uint8 ndarray
        In pixels of the clip's first picture, full size; 0 beyond it.
    scale : float
        Pixels of the reference picture for one of the mask's.
    """
    at = np.floor(moved_by(grid.to_pixels, grid.points()) / scale).astype(int)
    inside = (at[..., 0] >= 0) & (at[..., 1] >= 0) & (at[..., 0] < mask.shape[1]) & (at[..., 1] < mask.shape[0])
    values = np.zeros(at.shape[:2], np.uint8)
    values[inside] = mask[at[inside][:, 1], at[inside][:, 0]]
    ny, nx = grid.shape
    values = values.reshape(ny, SUB, nx, SUB).transpose(0, 2, 1, 3).reshape(ny, nx, -1)
    kinds = np.unique(values)
    counts = np.stack([(values == kind).sum(-1) for kind in kinds], axis=-1)
    return kinds[counts.argmax(-1)]


def read_colours(picture) -> tuple[np.ndarray, np.ndarray]:
    """((h, w) uint8 numbers of the regions, (k, 3) their red, green, blue) of a painted mask; black is 0."""
    rgb = cv2.cvtColor(picture, cv2.COLOR_BGR2RGB)
    flat = rgb.reshape(-1, 3).astype(np.int64) @ (65536, 256, 1)
    colours, numbers = np.unique(flat, return_inverse=True)
    order = np.cumsum(colours > 0)
    numbers = np.where(colours > 0, order, 0)[numbers].astype(np.int64)
    kinds = colours[colours > 0]
    return numbers.reshape(rgb.shape[:2]), np.column_stack([kinds >> 16, (kinds >> 8) & 255, kinds & 255])

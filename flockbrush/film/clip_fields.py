"""Fields of density and motion on a grid over the stabilised ground, from body pixels and their optical flow.

The density of a cell is its number of body pixels, divided by the pixels of one animal and by the area of the cell in
the picture. Mean velocity, and the variances of speed and of the unsigned angle to the mean velocity, are taken over
its body pixels, whose flow was averaged over half a body (section 4 of Gong et al. 2025).
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
SIMPLE = 0.05  # BL by which a simplified outline may be off


@dataclass(frozen=True)
class ClipGrid:
    """Square cells over the ground that the clip shows."""

    cell: float  # side, BL
    origin: np.ndarray  # (2,); lower left corner, BL
    shape: tuple[int, int]  # rows and columns
    to_bl: np.ndarray  # (2, 3); from pixels of the reference picture to BL, y up

    @property
    def to_pixels(self) -> np.ndarray:
        """(2, 3) from BL to pixels of the reference picture."""
        return back(self.to_bl)

    def cells_of(self, xy):
        """Numbers (n,) of the cells that contain points (n, 2) in BL, row by row; -1 outside the grid."""
        column, row = np.floor((xy - self.origin) / self.cell).astype(np.int64).T
        inside = (row >= 0) & (column >= 0) & (row < self.shape[0]) & (column < self.shape[1])
        return np.where(inside, row * self.shape[1] + column, -1)

    def points(self):
        """Points evenly spaced over all cells, `SUB` x `SUB` in each, (ny * SUB, nx * SUB, 2) BL."""
        ny, nx = self.shape
        x, y = np.meshgrid((np.arange(nx * SUB) + 0.5) / SUB, (np.arange(ny * SUB) + 0.5) / SUB)
        return self.origin + self.cell * np.stack([x, y], axis=-1)


def grid_over(size, maps, body_px, across) -> ClipGrid:
    """The grid of a clip: `across` cells along the longer side of the first picture, extended to all ground seen.

    Parameters
    ----------
    size : (int, int)
        Width and height of the pictures, px.
    maps : (n, 2, 3) ndarray
        Map of each picture to the first.
    body_px : float
        Pixels of the first picture per BL.
    across : int

    Returns
    -------
    ClipGrid
        Of at most `MOST_CELLS` cells; larger ground gets larger cells.
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
    """Collects frames one by one and returns their `Fields`."""

    grid: ClipGrid
    size: tuple[int, int]  # of the pictures, px
    body_pixels: float  # of one animal in the reference picture
    paired: bool = False  # measure the distances between bodies: where animals are too small to be separated
    rows: dict[str, list] = field(default_factory=dict)

    def add(self, number, mask, to_first, seconds, flow=None, slow=0.0):
        """Add a frame.

        Parameters
        ----------
        number : int
            Number of the frame in the clip.
        mask : (h, w) uint8 ndarray
            Nonzero on animals.
        to_first : (2, 3) ndarray
            Map from pixels of this picture to those of the first.
        seconds : float
            Time between the two pictures of the flow; negative if the second is the earlier one.
        flow : (at, move), optional
            Positions and motion of body pixels, (n, 2) px each; None for a single picture.
        slow : float
            Pixels slower than this (BL/s) have no direction.
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
        """Animals per BL² in each cell, (ny, nx), and the number of animals in the picture."""
        bodies = cv2.findNonZero(mask)
        bodies = np.empty((0, 2)) if bodies is None else bodies.reshape(-1, 2)
        to_cell = np.vstack([to_first, (0, 0, 1)])
        at = moved_by((self.grid.to_bl @ to_cell), bodies)
        cells = self.grid.cells_of(at)
        ny, nx = self.grid.shape
        zoom = abs(np.linalg.det(to_first[:, :2]))
        animals = np.bincount(cells[cells >= 0], minlength=ny * nx).reshape(ny, nx) * zoom / self.body_pixels
        return animals / self.grid.cell**2, float(len(bodies) * zoom / self.body_pixels)

    def _at_edge(self, mask, to_first):
        """Share of the body pixels that are within half a body length of the edge of the picture, 0 to 1."""
        to_bl = self.grid.to_bl[:, :2] @ to_first[:, :2]
        rim = max(1, round(0.5 / np.sqrt(abs(np.linalg.det(to_bl)))))
        whole = cv2.countNonZero(mask)
        return 1.0 - cv2.countNonZero(np.ascontiguousarray(mask[rim:-rim, rim:-rim])) / whole if whole else 0.0

    def _share(self, to_first):
        """Share of each cell that is inside the picture, (ny, nx), 0 to 1."""
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
        """The fields of the frame added last, by name."""
        return {name: values[-1] for name, values in self.rows.items()}

    def fields(self, fps, obstacle=None, region=None, outline=None) -> Fields:
        """The fields of all frames added so far.

        Parameters
        ----------
        fps : float
        obstacle : (ny, nx) bool ndarray, optional
        region : (ny, nx) uint8 ndarray, optional
        outline : (k, 5) ndarray, optional
            Edges of obstacles, as from `outlined`.
        """
        arrays = {name: np.array(values) for name, values in self.rows.items()}
        return Fields(
            fps=float(fps), cell=self.grid.cell, origin=np.asarray(self.grid.origin, float),
            obstacle=np.zeros(self.grid.shape, bool) if obstacle is None else obstacle,
            region=np.zeros(self.grid.shape, np.uint8) if region is None else region, outline=outline, **arrays,
        )  # fmt: skip


@njit(cache=True)
def moments(cells, v, count, slow):
    """Moments of the velocities in each cell.

    Parameters
    ----------
    cells : (n,) int ndarray
        Cell of each velocity; -1 outside the grid.
    v : (n, 2) ndarray
        Velocities, BL/s.
    count : int
        Number of cells.
    slow : float
        Velocities below this (BL/s) have no direction.

    Returns
    -------
    mean : (count, 2) ndarray
        BL/s.
    speed, speed_variance : (count,) ndarray
        BL/s and BL²/s².
    angular_variance : (count,) ndarray
        Variance of the unsigned angle to the mean, degrees². All are NaN in cells without velocities.
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


def outlined(mask, grid: ClipGrid, scale) -> np.ndarray:
    """Edges of the connected patches of a mask, and of the holes in them.

    Parameters
    ----------
    mask : (h, w) uint8 ndarray
        In pixels of the first picture at full size.
    grid : ClipGrid
    scale : float
        Pixels of the reference picture per pixel of the mask.

    Returns
    -------
    (k, 5) ndarray
        x0, y0, x1, y1 (BL) and the number of the patch.
    """
    many, patches = cv2.connectedComponents(mask, connectivity=4)
    px = SIMPLE / max(abs(grid.to_bl[0, 0]) * scale, 1e-12)
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
    """The most frequent value of a mask in each cell, sampled at `SUB` x `SUB` points.

    Parameters
    ----------
    mask : (h, w) uint8 ndarray
        In pixels of the first picture at full size; 0 outside.
    grid : ClipGrid
    scale : float
        Pixels of the reference picture per pixel of the mask.

    Returns
    -------
    (ny, nx) uint8 ndarray
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
    """The regions of a painted picture, by colour.

    Parameters
    ----------
    picture : (h, w, 3) uint8 ndarray
        Blue, green, red.

    Returns
    -------
    (h, w) int64 ndarray
        Number of the region of each pixel, from 1; 0 for black.
    (k, 3) ndarray
        Red, green and blue of each region.
    """
    rgb = cv2.cvtColor(picture, cv2.COLOR_BGR2RGB)
    flat = rgb.reshape(-1, 3).astype(np.int64) @ (65536, 256, 1)
    colours, numbers = np.unique(flat, return_inverse=True)
    order = np.cumsum(colours > 0)
    numbers = np.where(colours > 0, order, 0)[numbers].astype(np.int64)
    kinds = colours[colours > 0]
    return numbers.reshape(rgb.shape[:2]), np.column_stack([kinds >> 16, (kinds >> 8) & 255, kinds & 255])

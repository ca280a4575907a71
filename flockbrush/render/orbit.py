"""A camera that circles about a point in space, and where its picture shows what."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from flockbrush.render.view_camera import checked_size

FIELD_OF_VIEW = np.radians(38.0)  # from the lowest row to the highest: a normal lens
ELEVATION = np.radians(28.0)  # of a first look: over the ground, and across it
NEAR = 0.01  # of the distance: nothing nearer to the eye is drawn
LOWEST = 0.02  # of the distance: so high above the ground the eye stays
FAR = 60.0  # distances: ground beyond is taken to lie there
CLOSEST, FARTHEST = 0.5, 50_000.0  # m from eye to target
OUTSIDE = 1e5  # pixels; nothing is said to lie farther from the picture


@dataclass(frozen=True)
class OrbitCamera:
    """A view in perspective, of a target from a distance.

    Pixels are counted as those of `Camera`: from the top-left corner, y down.  The camera never rolls: what is
    upright stays upright, and every row of the picture shows ground of one depth.
    """

    target: tuple[float, float, float]  # the point (m) in the middle of the view
    distance: float  # from eye to target, m
    azimuth: float  # where the camera looks, rad counter-clockwise from east; pi / 2 looks north, as the plan does
    elevation: float  # how high above the target the eye is, rad; pi / 2 looks straight down
    size: tuple[int, int]  # width and height of the picture, pixels
    view: tuple[int, int, int, int]  # left, top, right and bottom of the part of the picture that shows the scene
    fov: float = FIELD_OF_VIEW  # field of view from the lowest to the highest row of the view, rad
    floor: float = 0.0  # height of the ground, m; the eye stays above it

    @classmethod
    def of(cls, points, size, view=None, azimuth=np.pi / 2, elevation=ELEVATION, floor=0.0, **more):
        """The camera in this direction that shows all points (n, 3) m, as large as can be."""
        size = checked_size(size)
        view = tuple(view or (0, 0, *size))
        return cls((0.0, 0.0, 0.0), 1.0, azimuth, elevation, size, view, floor=floor).fitted(points, **more)

    # where it stands ---------------------------------------------------------------

    @property
    def middle(self) -> tuple[float, float]:
        """The pixel position that shows `target`."""
        return (self.view[0] + self.view[2]) / 2, (self.view[1] + self.view[3]) / 2

    @property
    def focal(self) -> float:
        """Pixels between two points a metre apart, a metre before the eye."""
        return max(self.view[3] - self.view[1], 2) / (2 * np.tan(self.fov / 2))

    @property
    def axes(self) -> np.ndarray:
        """Unit vectors to the right, up, and ahead in the picture, (3, 3)."""
        ca, sa, ce, se = np.cos(self.azimuth), np.sin(self.azimuth), np.cos(self.elevation), np.sin(self.elevation)
        return np.array([[sa, -ca, 0.0], [se * ca, se * sa, ce], [ce * ca, ce * sa, -se]])

    @property
    def eye(self) -> np.ndarray:
        """Where the camera is, (3,) m."""
        return np.asarray(self.target, float) - self.distance * self.axes[2]

    @property
    def scale(self) -> float:
        """Pixels per metre at the target, across the line of sight."""
        return self.focal / self.distance

    @property
    def nearest(self) -> float:
        """The depth up to which nothing is shown, m."""
        return NEAR * self.distance

    def numbers(self) -> np.ndarray:
        """Eye, right, up, ahead, focal length, middle and nearest depth, as kernels want them: (16,)."""
        return np.concatenate([self.eye, self.axes.ravel(), [self.focal], self.middle, [self.nearest]])

    # between metres and pixels -------------------------------------------------------

    def project(self, xyz) -> tuple[np.ndarray, np.ndarray]:
        """Pixel positions (n, 2) and depths (n,) m of points (n, 3); points behind the eye have a depth below 0."""
        across, high, depth = self.axes @ (np.asarray(xyz, float) - self.eye).T
        share = self.focal / np.where(np.abs(depth) < self.nearest, self.nearest, depth)
        x, y = self.middle
        return np.stack([x + across * share, y - high * share], axis=1), depth

    def pixels(self, xyz) -> np.ndarray:
        """Pixel positions (..., 2) of points (..., 3) m, or of points on the ground (..., 2).

        Points behind the eye are shown where the line to them leaves the picture, far outside.
        """
        xyz = np.asarray(xyz, float)
        if xyz.shape[-1] == 2:
            xyz = np.concatenate([xyz, np.full((*xyz.shape[:-1], 1), self.floor)], axis=-1)
        across, high, depth = np.moveaxis((xyz - self.eye) @ self.axes.T, -1, 0)
        share = self.focal / np.maximum(depth, self.nearest)
        x, y = self.middle
        pixels = np.stack([x + across * share, y - high * share], axis=-1)
        return np.clip(pixels, -OUTSIDE, OUTSIDE)

    def lines(self, begin, end) -> np.ndarray:
        """Lines between points (..., 3) m as pixels (m, 4): those before the eye, cut off there."""
        begin, end = (np.asarray(points, float).reshape(-1, 3) for points in (begin, end))
        good = np.isfinite(begin).all(-1) & np.isfinite(end).all(-1)
        begin, end = begin[good], end[good]
        if not len(begin):
            return np.zeros((0, 4))
        near = 1.01 * self.nearest
        one, two = ((points - self.eye) @ self.axes[2] for points in (begin, end))
        in_front = (one > near) | (two > near)
        begin, end, one, two = begin[in_front], end[in_front], one[in_front], two[in_front]
        with np.errstate(divide="ignore", invalid="ignore"):
            share = np.clip((near - one) / (two - one), 0.0, 1.0)[:, None]
        cut = begin + share * (end - begin)
        begin, end = np.where((one < near)[:, None], cut, begin), np.where((two < near)[:, None], cut, end)
        lines = np.hstack([self.project(begin)[0], self.project(end)[0]])
        return lines[(np.abs(lines) < 2e4).all(1)]

    def scale_at(self, xyz) -> float:
        """Pixels per metre, across the line of sight, at a point (3,) m, or on the ground (2,)."""
        xyz = np.asarray(xyz, float)
        xyz = np.append(xyz, self.floor) if len(xyz) == 2 else xyz
        return float(self.focal / max((xyz - self.eye) @ self.axes[2], self.nearest))

    def rays(self, pixels) -> np.ndarray:
        """Directions (..., 3) from the eye through pixels (..., 2), one metre deep each."""
        pixels = np.asarray(pixels, float)
        right, up, ahead = self.axes
        x, y = self.middle
        return ahead + (pixels[..., :1] - x) / self.focal * right - (pixels[..., 1:] - y) / self.focal * up

    def metres(self, pixels) -> np.ndarray:
        """Points of the ground (..., 2) m under pixels (..., 2); above the horizon, ground very far away."""
        ray, eye = self.rays(pixels), self.eye
        flat = np.maximum(np.hypot(ray[..., 0], ray[..., 1]), 1e-12)
        high = max(eye[2] - self.floor, 1e-9)
        farthest = FAR * max(self.distance, high) / flat
        depth = np.where(ray[..., 2] < 0, high / np.maximum(-ray[..., 2], 1e-12), farthest)
        return eye[:2] + np.minimum(depth, farthest)[..., None] * ray[..., :2]

    # moving ----------------------------------------------------------------------------

    def fitted(self, points, margin: float = 0.06) -> OrbitCamera:
        """The camera in the same direction that shows all points (n, 3) m, as near as can be.

        `margin` is the share of the view left free on every side.  A point at (x, y, z) in the camera's axes is shown
        by an eye at (X, Y, Z) when |x - X| <= (z - Z) tan(fov / 2), and so for y; those are met with equality.
        """
        x, y, z = self.axes @ np.asarray(points, float).reshape(-1, 3).T
        wide = (self.view[2] - self.view[0]) / (2 * self.focal) * (1 - 2 * margin)
        tall = (self.view[3] - self.view[1]) / (2 * self.focal) * (1 - 2 * margin)
        right, left = (x - z * wide).max(), (-x - z * wide).max()
        above, below = (y - z * tall).max(), (-y - z * tall).max()
        back = max((right + left) / (2 * wide), (above + below) / (2 * tall))
        middle = 0.5 * (z.min() + z.max())
        distance = float(np.clip(back + middle, CLOSEST, FARTHEST))
        target = np.array([(right - left) / 2, (above - below) / 2, middle]) @ self.axes
        return replace(self, target=_three(target), distance=distance)._kept()

    def turned(self, left: float, over: float) -> OrbitCamera:
        """The camera after it went round the target, by `left` and `over` it, rad."""
        return replace(self, azimuth=self.azimuth - left, elevation=self.elevation + over)._kept()

    def zoomed(self, factor: float, about=None) -> OrbitCamera:
        """The camera nearer by this factor; the ground under the pixel `about`, if given, stays there."""
        distance = float(np.clip(self.distance / factor, CLOSEST, FARTHEST))
        nearer = replace(self, distance=distance)._kept()
        if about is None:
            return nearer
        still, now = self.metres(about), nearer.metres(about)
        if np.hypot(*(still - self.target[:2])) > 4 * self.distance:
            return nearer  # it points at the sky
        return nearer.at(*(np.asarray(nearer.target[:2]) + still - now))

    def moved(self, right: float, down: float) -> OrbitCamera:
        """The camera after the ground has been dragged by so many pixels, in the plane of the ground."""
        across, _, ahead = self.axes
        flat = np.array([np.cos(self.azimuth), np.sin(self.azimuth)])
        steep = max(float(-ahead[2]), 0.25)  # seen flat, the ground goes by quickly
        x, y = np.asarray(self.target[:2]) - right / self.scale * across[:2] + down / self.scale / steep * flat
        return self.at(x, y)

    def at(self, x, y, z=None) -> OrbitCamera:
        """The camera, as it is turned, looking at this point (m); as high as before by default."""
        return replace(self, target=_three((x, y, self.target[2] if z is None else z)))._kept()

    def _kept(self) -> OrbitCamera:
        """The same camera with its eye above the ground, and not beyond the zenith."""
        low = np.clip((self.floor + LOWEST * self.distance - self.target[2]) / self.distance, -1.0, 1.0)
        elevation = float(np.clip(self.elevation, max(np.arcsin(low), -np.radians(80)), np.pi / 2))
        return replace(self, azimuth=float(self.azimuth % (2 * np.pi)), elevation=elevation)


def box_corners(low, high) -> np.ndarray:
    """The eight corners (8, 3) of an upright box between two corners (3,), m."""
    return np.array([[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])])


def _three(point) -> tuple[float, float, float]:
    x, y, z = (float(v) for v in point)
    return x, y, z

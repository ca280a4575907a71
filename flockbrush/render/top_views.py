"""Animals with legs and wings from straight above, as the plan shows them.

From above a pose looks the same whichever way an animal goes, but for its place, size, heading and light.  So each
pose is drawn once as a map that says which triangle of the mesh is on top where, and an animal is drawn by looking up
four places of the map for each of its pixels: a few microseconds instead of the fifty that its triangles take.  Maps
are made when first needed.  Animals too large for the maps are drawn by `draw_mesh`.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np

from flockbrush.render.animal_figures import KINDS, PLAIN, figure
from flockbrush.render.animal_looks import CLIPS, WIDE, poses_of
from flockbrush.render.facets import SpacePose, lit
from flockbrush.render.mesh_bodies import LOOK_NAMES, MOST_POINTS, Postures, draw_mesh, mesh_inks, pose
from flockbrush.render.shapes import Pose, kernel, window
from flockbrush.render.sprites import Sprites

TEXELS = 160  # of a map for each body length
LARGEST = 100.0  # pixels of a body length; larger animals would show the texels
MARGIN = 32  # texels free around a body, for pixels that it only touches
GROWN = 1.5  # texels by which triangles are larger all around
NEAR = 6  # texels around a body where pixels may touch it
ONE = 65536.0  # of fixed-point texels
PHASES = 32  # maps of a cycle
SHOWN, CLOSE = 128, 129  # triangles of a pose that are seen from above, at most; the texels around them
MOST_ABOVE = 1000  # animals in view that a window has time for; of more, nobody has legs
ABOVE = 1e6  # m: so high is the eye that sees the plan


class TopViews(NamedTuple):
    """The maps of all looks, one after another."""

    # (t,) uint8; which of the triangles in `shown` is on top, from 1; `CLOSE` around the body, and else 0
    texels: np.ndarray
    # (looks, 5) int64; first texel of a look's maps, texels aside and ahead, and the map's corner: right of the body
    # and behind it
    places: np.ndarray
    # first, phases: (looks, clips) int64; first map of a clip, that of rest where the look has no such clip; how many
    # there are
    first: np.ndarray
    phases: np.ndarray
    ready: np.ndarray  # (maps,) bool; which have been made
    bounds: np.ndarray  # (maps, 4) float64; what there is of the body: behind, ahead, right and left end, body lengths
    shown: np.ndarray  # (maps, SHOWN) int64; triangles
    normals: np.ndarray  # (maps, SHOWN, 3) float64; unit vectors out of them


class TopView(NamedTuple):
    """One of the maps: of which look, its number, and its first texel."""

    look: int
    number: int
    first: int


@cache
def top_views() -> TopViews:
    """Room for the maps of all looks; the system gives memory for it page by page, as they are made."""
    places, count = np.zeros((len(LOOK_NAMES), 5), np.int64), np.zeros((len(LOOK_NAMES), len(CLIPS)), np.int64)
    first, maps, texels = np.zeros_like(count), 0, 0
    for k, name in enumerate(LOOK_NAMES):
        poses = poses_of(name)
        points = np.concatenate([shown.reshape(-1, 3)[:, :2] for shown in poses.values()])
        low, high = np.floor(points.min(0) * TEXELS) - MARGIN, np.ceil(points.max(0) * TEXELS) + MARGIN
        ahead, aside = (high - low).astype(np.int64)
        places[k] = texels, aside, ahead, low[1], low[0]
        for clip, shown in poses.items():
            number = CLIPS.index(clip)
            first[k, number], count[k, number] = maps, PHASES if len(shown) > 1 else 1
            maps += count[k, number]
            texels += count[k, number] * aside * ahead
        rest = CLIPS.index("rest")
        missing = count[k] == 0
        first[k, missing], count[k, missing] = first[k, rest], 1
    return TopViews(
        np.zeros(texels, np.uint8), places, first, count, np.zeros(maps, np.bool_), np.zeros((maps, 4)),
        np.zeros((maps, SHOWN), np.int64), np.zeros((maps, SHOWN, 3)),
    )  # fmt: skip


def from_above(camera) -> np.ndarray:
    """The numbers of a camera in space (`OrbitCamera.numbers`) that shows what a plan's `ViewCamera` shows."""
    return np.array(
        [*camera.centre, ABOVE, 1, 0, 0, 0, 1, 0, 0, 0, -1, camera.scale * ABOVE, *camera.middle, 1.0], float
    )


# maps ----------------------------------------------------------------------------------


@kernel
def _map_of(views, meshes, posture):
    """The `TopView` that shows a posture best; it is made if it has not been yet."""
    look, clip, phase = posture
    count = views.phases[look, clip]
    k = int(np.floor((phase % 1.0) * count + 0.5)) % count
    number = views.first[look, clip] + k
    at = views.places[look, 0] + (number - views.first[look].min()) * views.places[look, 1] * views.places[look, 2]
    if not views.ready[number]:
        _make(views, meshes, number, at, (look, clip, k / count))
        views.ready[number] = True
    return TopView(look, number, at)


@kernel
def _make(views, meshes, number, at, posture):
    """Draw the map of a posture: of the triangles that face upwards, the highest at each texel."""
    look = posture[0]
    wide, long = views.places[look, 1], views.places[look, 2]
    right, behind = views.places[look, 3], views.places[look, 4]
    body, high = np.empty((MOST_POINTS, 3)), np.full((wide, long), -np.inf)
    count = pose(body, meshes, posture, float(TEXELS), 1.0)
    ends = views.bounds[number]
    ends[0], ends[1] = body[:count, 0].min() / TEXELS, body[:count, 0].max() / TEXELS
    ends[2], ends[3] = body[:count, 1].min() / TEXELS, body[:count, 1].max() / TEXELS
    texels, found = views.texels[at : at + wide * long].reshape(wide, long), 0
    for t in range(meshes.faces[look], meshes.faces[look + 1]):
        a, b, c = body[meshes.triangles[t, 0]], body[meshes.triangles[t, 1]], body[meshes.triangles[t, 2]]
        normal = np.cross(b - a, c - a)
        if normal[2] <= 1e-9:
            continue
        views.shown[number, found] = t
        views.normals[number, found] = normal / np.sqrt((normal**2).sum())
        found += 1
        _raise(high, texels, a, b, c, normal, behind, right, found)
    _surround(texels)


@kernel
def _raise(high, texels, a, b, c, normal, behind, right, number):
    """Write a triangle's number where nothing is above it; it is drawn GROWN larger, that thin ears are seen."""
    u, v, w = _edge(a, b), _edge(b, c), _edge(c, a)
    left, low = min(a[0], b[0], c[0]) - GROWN - behind, min(a[1], b[1], c[1]) - GROWN - right
    far, top = max(a[0], b[0], c[0]) + GROWN - behind, max(a[1], b[1], c[1]) + GROWN - right
    for row in range(max(int(low), 0), min(int(top) + 1, len(texels))):
        y = row + right + 0.5
        for col in range(max(int(left), 0), min(int(far) + 1, texels.shape[1])):
            x = col + behind + 0.5
            inside = min(u[0] * x + u[1] * y + u[2], v[0] * x + v[1] * y + v[2], w[0] * x + w[1] * y + w[2])
            z = a[2] - (normal[0] * (x - a[0]) + normal[1] * (y - a[1])) / normal[2]
            if inside >= -GROWN and z > high[row, col]:
                high[row, col] = z
                texels[row, col] = number


@kernel
def _edge(a, b):
    """(p, q, r) of an edge: p * x + q * y + r is how far a point is to its left."""
    x, y = b[0] - a[0], b[1] - a[1]
    size = max(np.hypot(x, y), 1e-9)
    return -y / size, x / size, (a[0] * y - a[1] * x) / size


@kernel
def _surround(texels):
    """Mark the empty texels of a map that are at most NEAR to the side of a body, ahead or behind."""
    rows, cols = texels.shape
    for row in range(rows):
        last = -NEAR - 1
        for col in range(cols):
            if 0 < texels[row, col] < CLOSE:
                for k in range(max(col - NEAR, last + 1, 0), col):
                    texels[row, k] = CLOSE
                last = col
            elif col - last <= NEAR:
                texels[row, col] = CLOSE
    for col in range(cols):
        last = -NEAR - 1
        for row in range(rows):
            if 0 < texels[row, col] < CLOSE:
                for k in range(max(row - NEAR, last + 1, 0), row):
                    texels[k, col] = CLOSE
                last = row
            elif row - last <= NEAR and texels[row, col] == 0:
                texels[row, col] = CLOSE


# animals -------------------------------------------------------------------------------


@kernel
def _light(table, views, meshes, number, ink, at, wide, sun):
    """Packed colours (CLOSE + 1,) of the triangles of a map in the light, as `draw_mesh` has them."""
    ahead, left = sun[0] * at.fx - sun[1] * at.fy, sun[1] * at.fx + sun[0] * at.fy
    for k in range(SHOWN):
        nx, ny, nz = views.normals[number, k]
        if nz <= 0:
            break
        nx, nz = nx * wide, nz * wide  # out of triangles that are wider
        size = np.sqrt(nx * nx + ny * ny + nz * nz)
        facing = (nx * ahead + ny * left + nz * sun[2]) / size
        shine = 0.64 + 0.10 * nz / size + (0.40 * facing if facing > 0 else 0.10 * facing)
        table[k + 1] = _packed(lit(ink, meshes.inks[views.shown[number, k]], shine))


@kernel
def _between(first, slope, low, high, start, stop):
    """The part of a row of pixels, from `start` to `stop`, where `first + slope * dx` is from `low` to `high`."""
    if abs(slope) < 1e-9:
        return (start, stop) if low <= first <= high else (start, start - 1)
    one, other = (low - first) / slope, (high - first) / slope
    return max(start, min(one, other)), min(stop, max(one, other))


@kernel
def _lay(frame, clip, views, view, pose, long, wide, table, alpha):
    """Lay a `TopView` over the frame, its body `long` pixels, in the packed colours of a table, `alpha` of 256."""
    x, y, fx, fy = pose
    look, number, at = view
    aside, ahead = views.places[look, 1], views.places[look, 2]
    right, behind = views.places[look, 3], views.places[look, 4]
    ends, share = views.bounds[number], TEXELS / long
    across = share / wide
    reach = np.hypot(max(-ends[0], ends[1]), wide * max(-ends[2], ends[3])) * long + 1.0
    ux, uy, vx, vy = fx * share, fy * share, fy * across, -fx * across
    # half a pixel around the body, and a pixel and a half within the map, so that no place is outside
    low_u = max(ends[0] * TEXELS - 0.5 * share, behind + 1.5 * share)
    high_u = min(ends[1] * TEXELS + 0.5 * share, behind + ahead - 1.5 * share)
    low_v = max(ends[2] * TEXELS - 0.5 * across, right + 1.5 * across)
    high_v = min(ends[3] * TEXELS + 0.5 * across, right + aside - 1.5 * across)
    first, last, top, bottom = window(clip, x, y, reach, reach)
    grid = np.empty((4, 2), np.int64)  # turned, so that no edge of a pixel has two of its places at once
    for k in range(4):
        ox, oy = (-0.125, 0.375, 0.125, -0.375)[k], (-0.375, -0.125, 0.375, 0.125)[k]
        grid[k, 0], grid[k, 1] = int((ux * ox + uy * oy) * ONE), int((vx * ox + vy * oy) * ONE)
    u0, v0, u1, v1 = grid[0, 0], grid[0, 1], grid[1, 0], grid[1, 1]
    u2, v2, u3, v3 = grid[2, 0], grid[2, 1], grid[3, 0], grid[3, 1]
    du, dv = int(ux * ONE), int(vx * ONE)
    for row in range(top, bottom):
        dy = row + 0.5 - y
        start, stop = _between(uy * dy, ux, low_u, high_u, first - x, last - x)
        start, stop = _between(vy * dy, vx, low_v, high_v, start, stop)
        begin = max(first, int(np.floor(x + start)))
        dx = begin + 0.5 - x
        u, v = int((ux * dx + uy * dy - behind) * ONE), int((vx * dx + vy * dy - right) * ONE)
        for col in range(begin, min(last, int(np.ceil(x + stop)))):
            if views.texels[np.uint64(at + (v >> 16) * ahead + (u >> 16))] == 0:
                u, v = u + du, v + dv
                continue
            found = table[views.texels[np.uint64(at + ((v + v0) >> 16) * ahead + ((u + u0) >> 16))]]
            found += table[views.texels[np.uint64(at + ((v + v1) >> 16) * ahead + ((u + u1) >> 16))]]
            found += table[views.texels[np.uint64(at + ((v + v2) >> 16) * ahead + ((u + u2) >> 16))]]
            found += table[views.texels[np.uint64(at + ((v + v3) >> 16) * ahead + ((u + u3) >> 16))]]
            u, v = u + du, v + dv
            if found > 0:
                _blend(frame, row, col, found, alpha)


@kernel
def _blend(frame, row, col, found, alpha):
    """Lay the sum of four packed colours over a pixel."""
    keep = 1024 - (found >> 60) * alpha
    red, green, blue = found & 0xFFFFF, (found >> 20) & 0xFFFFF, (found >> 40) & 0xFFFFF
    frame[row, col, 0] = np.uint8((np.int64(frame[row, col, 0]) * keep + red * alpha + 512) >> 10)
    frame[row, col, 1] = np.uint8((np.int64(frame[row, col, 1]) * keep + green * alpha + 512) >> 10)
    frame[row, col, 2] = np.uint8((np.int64(frame[row, col, 2]) * keep + blue * alpha + 512) >> 10)


@kernel
def _packed(ink):
    """A colour and a 1, so that a sum of four holds the sums of all channels and the count."""
    red, green, blue = ink
    return np.int64(red + 0.5) | np.int64(green + 0.5) << 20 | np.int64(blue + 0.5) << 40 | np.int64(1) << 60


class DrawnBodies(NamedTuple):
    """The animals of a plan that have legs and wings there, one row each."""

    # leaders and predators lie on a `figure` in the halos of `Stamps`
    animals: Sprites
    xy: np.ndarray  # (n, 2); m
    lift: np.ndarray  # (n, 2); pixels from the animal to its shadow
    shade: np.ndarray  # (n,); opacity of its shadow
    postures: Postures


@kernel
def _posture(postures, i):
    """(look, clip, phase) of an animal."""
    return postures.look[i], postures.clip[i], postures.phase[i]


@kernel
def _size(animals, i, scale):
    """How long (pixels) an animal is, and by how much more its width is stretched."""
    return animals.length[i] * scale, 2 * animals.radius[i] / (WIDE * animals.length[i])


@kernel
def draw_shadows(frame, clip, scale, rows, bodies, views, meshes, colours):
    """Draw the shadows of the animals of these rows on flat ground."""
    table, animals = np.zeros(CLOSE + 1, np.int64), bodies.animals
    for i in rows:
        view = _map_of(views, meshes, _posture(bodies.postures, i))
        shade = colours[animals.look[i], 5]
        table[1:CLOSE] = _packed((shade[0], shade[1], shade[2]))
        x, y = animals.at[i, 0] + bodies.lift[i, 0], animals.at[i, 1] + bodies.lift[i, 1]
        long, wide = _size(animals, i, scale)
        pose, alpha = _pose(x, y, animals.forward[i]), int(256 * bodies.shade[i] + 0.5)
        _lay(frame, clip, views, view, pose, long, wide, table, alpha)


@kernel
def draw_plan(buffer, cam, rows, bodies, views, meshes, colours, halos, sun):
    """Draw the animals of these rows from straight above, in this order; `cam` is that of `from_above`."""
    axes, place, ink = np.zeros((3, 3)), np.zeros(3), np.empty((4, 3))
    axes[2, 2] = 1.0
    table, animals = np.zeros(CLOSE + 1, np.int64), bodies.animals
    scale = cam[12] / cam[2]
    for i in rows:
        at = _pose(animals.at[i, 0], animals.at[i, 1], animals.forward[i])
        look, (long, wide) = animals.look[i], _size(animals, i, scale)
        if look % KINDS != PLAIN:
            thick = animals.radius[i] * scale
            figure(buffer.frame, buffer.clip, at, long, thick, look % KINDS, False, halos[look], animals.beats[i])
        posture = _posture(bodies.postures, i)
        mesh_inks(ink, colours[look], False)
        if long <= LARGEST:
            view = _map_of(views, meshes, posture)
            _light(table, views, meshes, view.number, ink, at, wide, sun)
            _lay(buffer.frame, buffer.clip, views, view, at, long, wide, table, 256)
            continue
        axes[0, 0], axes[0, 1], axes[1, 0], axes[1, 1] = at.fx, -at.fy, at.fy, at.fx
        place[0], place[1] = bodies.xy[i, 0], bodies.xy[i, 1]
        draw_mesh(buffer, cam, meshes, posture, SpacePose(place, axes), animals.length[i], wide, ink, 1.0, sun)


@kernel
def _pose(x, y, forward):
    """The pose of an animal whose heading need not have length 1; east if it has none."""
    size = np.hypot(forward[0], forward[1])
    fx, fy = (forward[0] / size, forward[1] / size) if size > 1e-9 else (1.0, 0.0)
    return Pose(x, y, fx, fy)

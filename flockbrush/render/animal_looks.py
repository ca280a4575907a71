"""Built-in low-polygon animals: a mesh for each look of a species, and its poses through the cycle of each gait.

A mesh has its own axes: x ahead, y left, z up; the body is 1 long, 0.4 wide, and its feet (of a bird, fish: its middle)
stand at the origin.  A pose is the same mesh with other points, so exporters that know no bones can switch poses.
Feet of walkers are at rest on the ground while they stand: a standing foot goes back by the very way that the body
goes on, `Stride.length` body lengths in a cycle.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np

CLIPS = ("rest", "walk", "run", "fly", "glide", "swim")
POSES = 16  # of a cycle
WIDE = 0.4  # body lengths: width of a mesh; scale y by 2 * radius / (WIDE * length) more than x
LIGHT, PLAIN, DARK = 1.25, 1.0, 0.45  # brightness of parts: heads, bodies, legs and wing tips


class Stride(NamedTuple):
    """How legs go in one clip."""

    length: float  # body lengths of way in one cycle
    duty: float  # share of the cycle that a foot stands
    offsets: tuple[float, ...]  # when in the cycle each leg begins to stand
    lift: float = 0.25  # how high a foot is lifted, shares of the leg
    bob: float = 0.0  # how far the body goes up and down, body lengths


class Part(NamedTuple):
    """A part that moves against the body."""

    name: str
    kind: str  # leg, arm, wing, hand (of a wing) or tail
    pivot: tuple[float, float, float]  # (x, y, z); where it turns, body lengths
    number: int = 0  # which of its kind
    parent: str = ""  # name of the part that carries it, empty for the body


class AnimalMesh(NamedTuple):
    """A body at rest, and how it moves."""

    points: np.ndarray  # (v, 3); body lengths
    triangles: np.ndarray  # (t, 3) int; counter-clockwise seen from outside
    part: np.ndarray  # (v,) int; index into `parts`, -1 for the body
    shade: np.ndarray  # (v,); brightness: times the animal's colour
    parts: tuple[Part, ...]
    strides: dict[str, Stride]  # by clip, of those with legs
    clips: tuple[str, ...]  # what it can do


FOUR_LEGS = {
    "walk": Stride(0.95, 0.62, (0.25, 0.75, 0.0, 0.5)),  # left fore, right fore, left hind, right hind: in turn
    "run": Stride(2.1, 0.24, (0.5, 0.6, 0.0, 0.1), 0.45, 0.04),  # a gallop
}
TWO_LEGS = {"walk": Stride(2.7, 0.6, (0.0, 0.5), 0.2, 0.05), "run": Stride(4.4, 0.34, (0.0, 0.5), 0.35, 0.12)}
BIRD_LEGS = {"walk": Stride(0.5, 0.6, (0.0, 0.5), 0.3)}
SIX_LEGS = {
    "walk": Stride(0.7, 0.55, (0.0, 0.5, 0.5, 0.0, 0.0, 0.5), 0.3),
    "run": Stride(0.9, 0.5, (0.0, 0.5, 0.5, 0.0, 0.0, 0.5), 0.3),
}
BEAT_ANGLE, HAND_ANGLE = 0.75, 0.45  # rad at the shoulder and, later by `HAND_LATE` of a cycle, at the wrist
HAND_LATE = 0.12
GLIDING = 0.12  # rad that wings are held up
FOLDED = 1.45  # rad that wings lie back on the ground
SWIMMING = 0.45  # rad of a tail
SHOULDERS = 0.45  # of a width of 0.4: people, 0.5 m long and 0.44 m wide, are stretched by more than twice


# meshes --------------------------------------------------------------------------------


class _Sculpture:
    """Points and triangles as they are added."""

    def __init__(self):
        self.points, self.triangles, self.part, self.shade, self.parts = [], [], [], [], []

    def moving(self, part: Part):
        """A new moving part; its index."""
        self.parts.append(part)
        return len(self.parts) - 1

    def loft(self, rings, part=-1, shade=PLAIN, sides=8):
        """A skin over rings, each (x, y, z, half width, half height), closed at both ends."""
        turn = 2 * np.pi * (np.arange(sides) + 0.5) / sides
        first = len(self.points)
        for x, y, z, wide, high in rings:
            for a in turn:
                self._point((x, y + wide * np.cos(a), z + high * np.sin(a)), part, shade)
        for k in range(len(rings) - 1):
            for a in range(sides):
                b = (a + 1) % sides
                i, j = first + k * sides, first + (k + 1) * sides
                self.triangles += [(i + a, j + b, j + a), (i + a, i + b, j + b)]
        last = first + (len(rings) - 1) * sides
        for a in range(1, sides - 1):
            self.triangles += [(first, first + a + 1, first + a), (last, last + a, last + a + 1)]

    def limb(self, top, foot, thick, part, shade=DARK):
        """A four-sided limb from a joint to its end."""
        first = len(self.points)
        for (x, y, z), size in ((top, thick), (foot, 0.75 * thick)):
            for dx, dy in ((1, 1), (-1, 1), (-1, -1), (1, -1)):
                self._point((x + size * dx, y + size * dy, z), part, shade)
        for a in range(4):
            b = (a + 1) % 4
            self.triangles += [(first + a, first + 4 + b, first + b), (first + a, first + 4 + a, first + 4 + b)]
        self.triangles += [(first + 4, first + 6, first + 5), (first + 4, first + 7, first + 6)]
        self.triangles += [(first, first + 1, first + 2), (first, first + 2, first + 3)]

    def sheet(self, corners, part, shade, thick=0.012):
        """A thin plate over corners that go round counter-clockwise seen from above."""
        first, n = len(self.points), len(corners)
        for high in (thick, -thick):
            for x, y, z in corners:
                self._point((x, y, z + high), part, shade)
        for a in range(1, n - 1):
            self.triangles += [(first, first + a, first + a + 1), (first + n, first + n + a + 1, first + n + a)]
        for a in range(n):
            b = (a + 1) % n
            i, j = first + a, first + b
            self.triangles += [(i, i + n, j + n), (i, j + n, j)]

    def _point(self, at, part, shade):
        self.points.append(at)
        self.part.append(part)
        self.shade.append(shade)

    def mesh(self, strides, clips):
        """All of it."""
        return AnimalMesh(
            np.array(self.points, float), np.array(self.triangles, int), np.array(self.part, int),
            np.array(self.shade, float), tuple(self.parts), strides, clips,
        )  # fmt: skip


def _beast():
    made = _Sculpture()
    for k, (name, x, y) in enumerate(
        (("fore_left", 0.20, 0.1), ("fore_right", 0.20, -0.1), ("hind_left", -0.33, 0.1), ("hind_right", -0.33, -0.1))
    ):
        leg = made.moving(Part(name, "leg", (x, y, 0.36), k))
        made.limb((x, y, 0.36), (x, y, 0.0), 0.042, leg)
    made.loft(
        [(-0.47, 0, 0.50, 0.07, 0.08), (-0.40, 0, 0.48, 0.16, 0.15), (-0.14, 0, 0.45, 0.2, 0.19),
         (0.14, 0, 0.46, 0.185, 0.18), (0.28, 0, 0.51, 0.12, 0.14), (0.33, 0, 0.54, 0.06, 0.08)]
    )  # fmt: skip
    made.loft([(0.24, 0, 0.55, 0.09, 0.10), (0.34, 0, 0.67, 0.075, 0.08)], shade=PLAIN, sides=6)
    made.loft(
        [(0.30, 0, 0.68, 0.07, 0.075), (0.38, 0, 0.69, 0.085, 0.085), (0.50, 0, 0.62, 0.05, 0.05),
         (0.54, 0, 0.60, 0.03, 0.03)], shade=LIGHT, sides=6,
    )  # fmt: skip
    for side in (1, -1):
        ear = [(0.33, 0.06 * side, 0.74), (0.30, 0.15 * side, 0.75), (0.36, 0.08 * side, 0.74)]
        made.sheet(ear if side < 0 else ear[::-1], -1, DARK)
    made.loft([(-0.46, 0, 0.52, 0.025, 0.03), (-0.53, 0, 0.38, 0.015, 0.02)], shade=DARK, sides=4)
    return made.mesh(FOUR_LEGS, ("rest", "walk", "run"))


def _bird():
    made = _Sculpture()
    for k, side in enumerate((1, -1)):
        leg = made.moving(Part(("leg_left", "leg_right")[k], "leg", (-0.05, 0.05 * side, -0.05), k))
        made.limb((-0.05, 0.05 * side, -0.05), (-0.04, 0.05 * side, -0.26), 0.014, leg)
    for k, (name, side) in enumerate((("left", 1), ("right", -1))):
        root = (0.03, 0.06 * side, 0.04)
        arm = made.moving(Part(f"wing_{name}", "wing", root, k))
        wrist = (0.03, 0.36 * side, 0.04)
        hand = made.moving(Part(f"hand_{name}", "hand", wrist, k, f"wing_{name}"))
        inner = [(0.16, 0.06 * side, 0.04), (0.19, 0.36 * side, 0.04), (-0.12, 0.36 * side, 0.04),
                 (-0.15, 0.06 * side, 0.04)]  # fmt: skip
        outer = [(0.19, 0.36 * side, 0.04), (0.02, 0.80 * side, 0.04), (-0.08, 0.80 * side, 0.04),
                 (-0.13, 0.60 * side, 0.04), (-0.12, 0.36 * side, 0.04)]  # fmt: skip
        made.sheet(inner[::-1] if side > 0 else inner, arm, 0.9)
        made.sheet(outer[::-1] if side > 0 else outer, hand, DARK)
    made.loft(
        [(-0.36, 0, 0.01, 0.04, 0.035), (-0.18, 0, 0.0, 0.095, 0.09), (0.06, 0, 0.0, 0.12, 0.115),
         (0.22, 0, 0.02, 0.08, 0.085), (0.28, 0, 0.05, 0.06, 0.06)]
    )  # fmt: skip
    made.loft([(0.25, 0, 0.07, 0.055, 0.055), (0.32, 0, 0.09, 0.065, 0.065), (0.39, 0, 0.08, 0.035, 0.035)],
              shade=LIGHT, sides=6)  # fmt: skip
    made.loft([(0.38, 0, 0.08, 0.025, 0.022), (0.48, 0, 0.065, 0.004, 0.004)], shade=DARK, sides=4)
    tail = [(-0.32, 0.05, 0.02), (-0.56, 0.13, 0.02), (-0.56, -0.13, 0.02), (-0.32, -0.05, 0.02)]
    made.sheet(tail, -1, DARK)
    return made.mesh(BIRD_LEGS, ("rest", "walk", "fly", "glide"))


def _fish():
    made = _Sculpture()
    tail = made.moving(Part("tail", "tail", (-0.12, 0, 0)))
    end = made.moving(Part("fin", "tail", (-0.33, 0, 0), 1, "tail"))
    made.loft(
        [(0.5, 0, 0, 0.01, 0.01), (0.38, 0, 0, 0.07, 0.09), (0.15, 0, 0, 0.1, 0.15), (-0.12, 0, 0, 0.08, 0.12)][::-1]
    )
    made.loft([(-0.33, 0, 0, 0.02, 0.04), (-0.12, 0, 0, 0.08, 0.12)], tail)
    made.loft([(-0.5, 0, 0, 0.006, 0.16), (-0.33, 0, 0, 0.015, 0.04)], end, DARK, 6)
    for side in (1, -1):
        fin = [(0.18, 0.08 * side, -0.04), (0.02, 0.2 * side, -0.07), (0.06, 0.08 * side, -0.05)]
        made.sheet(fin[::-1] if side < 0 else fin, -1, DARK)
    return made.mesh({}, ("rest", "swim"))


def _insect():
    made = _Sculpture()
    for k, x in enumerate((0.16, 0.06, -0.04)):
        for j, side in enumerate((1, -1)):
            name = f"{('fore', 'mid', 'hind')[k]}_{('left', 'right')[j]}"
            leg = made.moving(Part(name, "leg", (x, 0.05 * side, 0.16), 2 * k + j))
            spread = 0.12 * (1 - k)
            made.limb((x, 0.05 * side, 0.16), (x + spread, 0.26 * side, 0.0), 0.012, leg)
    made.loft([(-0.5, 0, 0.16, 0.03, 0.03), (-0.36, 0, 0.18, 0.13, 0.12), (-0.16, 0, 0.18, 0.05, 0.05)])
    made.loft([(-0.16, 0, 0.18, 0.04, 0.04), (0.05, 0, 0.19, 0.075, 0.07), (0.22, 0, 0.18, 0.04, 0.04)])
    made.loft([(0.22, 0, 0.18, 0.04, 0.04), (0.32, 0, 0.19, 0.085, 0.07), (0.42, 0, 0.16, 0.04, 0.03)], shade=LIGHT)
    for side in (1, -1):
        feeler = [(0.38, 0.03 * side, 0.2), (0.5, 0.1 * side, 0.26), (0.37, 0.05 * side, 0.2)]
        made.sheet(feeler[::-1] if side < 0 else feeler, -1, DARK)
    return made.mesh(SIX_LEGS, ("rest", "walk", "run"))


def _person():
    made = _Sculpture()  # a body length of a person is from breast to back: 3.4 of them from head to foot
    for k, side in enumerate((1, -1)):
        leg = made.moving(Part(("leg_left", "leg_right")[k], "leg", (0, 0.2 * SHOULDERS * side, 1.65), k))
        made.limb((0, 0.2 * side, 1.65), (0, 0.2 * side, 0.0), 0.15, leg)
        arm = made.moving(Part(("arm_left", "arm_right")[k], "arm", (0, 0.46 * SHOULDERS * side, 2.75), k))
        made.limb((0, 0.46 * side, 2.75), (0.05, 0.5 * side, 1.6), 0.1, arm, PLAIN)
    first = len(made.points)
    made.loft([(1.5, 0, 0, 0.3, 0.2), (2.0, 0, 0, 0.27, 0.17), (2.75, 0, 0, 0.42, 0.2), (2.9, 0, 0, 0.15, 0.12)])
    made.loft([(2.85, 0, 0, 0.1, 0.1), (3.0, 0, 0, 0.17, 0.19), (3.25, 0, 0, 0.18, 0.2), (3.4, 0, 0, 0.1, 0.12)],
              shade=LIGHT)  # fmt: skip
    for k in range(first, len(made.points)):  # lofts run along x: stand them up
        x, y, z = made.points[k]
        made.points[k] = (-z, y, x)
    made.points = [(x, SHOULDERS * y, z) for x, y, z in made.points]
    return made.mesh(TWO_LEGS, ("rest", "walk", "run"))


LOOKS = {"beast": _beast, "bird": _bird, "fish": _fish, "insect": _insect, "person": _person}


@cache
def mesh_of(look: str) -> AnimalMesh:
    """The mesh of a look (`LOOKS`)."""
    return LOOKS[look]()


# poses ---------------------------------------------------------------------------------


def foot(stride: Stride, phase, leg):
    """(ahead, up): where the foot of a leg is against its place at rest; body lengths, and shares of the leg.

    A standing foot goes back evenly, as the body goes on; a lifted one swings forward.
    """
    way = stride.length * stride.duty
    turn = (np.asarray(phase, float) - stride.offsets[leg]) % 1.0
    stands = turn < stride.duty
    swing = (turn - stride.duty) / (1 - stride.duty)
    ahead = np.where(stands, way * (0.5 - turn / stride.duty), way * (swing * swing * (3 - 2 * swing) - 0.5))
    return ahead, np.where(stands, 0.0, stride.lift * np.sin(np.pi * np.clip(swing, 0, 1)))


def motion(mesh: AnimalMesh, part: Part, clip: str, phase: float):
    """A (3, 3) matrix that moves a part about its pivot, in the axes of its parent."""
    if part.kind == "leg":
        return _leg(mesh, part, clip, phase)
    if part.kind == "arm" and clip in mesh.strides:
        ahead, _ = foot(mesh.strides[clip], phase, 1 - part.number)  # the arm goes with the other leg
        return _turn(1, -0.45 * np.arctan2(ahead, 1.6))
    if part.kind in ("wing", "hand"):
        return _wing(part, clip, phase)
    if part.kind == "tail" and clip == "swim":
        return _turn(2, SWIMMING * np.sin(2 * np.pi * (phase - 0.18 * part.number)))
    return np.eye(3)


def _leg(mesh, part, clip, phase):
    """Legs lean and stretch so that the foot is at `foot`."""
    if clip in ("fly", "glide"):
        return _turn(1, 1.35)
    if clip not in mesh.strides:
        return np.eye(3)
    ahead, up = foot(mesh.strides[clip], phase, part.number)
    rows = np.flatnonzero(mesh.part == mesh.parts.index(part))
    long = part.pivot[2] - mesh.points[rows, 2].min()
    lean = np.eye(3)
    lean[0, 2], lean[2, 2] = -ahead / long, 1.0 - up
    return lean


def _wing(part, clip, phase):
    side = 1.0 if part.number == 0 else -1.0
    if clip == "fly":
        late = HAND_LATE if part.kind == "hand" else 0.0
        size = HAND_ANGLE if part.kind == "hand" else BEAT_ANGLE
        return _turn(0, side * size * np.sin(2 * np.pi * (phase - late)))
    if clip == "glide":
        return _turn(0, side * (GLIDING if part.kind == "wing" else -0.5 * GLIDING))
    back = _turn(2, side * FOLDED) if part.kind == "wing" else _turn(2, side * 0.12)
    return back


def _turn(axis, angle):
    """Rotation about x, y or z, right-handed, (3, 3)."""
    c, s = np.cos(angle), np.sin(angle)
    i, j = (axis + 1) % 3, (axis + 2) % 3
    matrix = np.eye(3)
    matrix[i, i] = matrix[j, j] = c
    matrix[i, j], matrix[j, i] = -s, s
    return matrix


def bob(mesh: AnimalMesh, clip: str, phase: float) -> float:
    """How high the body is above where it stands, body lengths."""
    stride = mesh.strides.get(clip)
    return 0.0 if stride is None else stride.bob * float(np.sin(2 * np.pi * (phase + 0.1)))


def posed(mesh: AnimalMesh, clip: str, phase: float) -> np.ndarray:
    """The points (v, 3) of a mesh in one moment of a clip."""
    points = mesh.points.copy()
    part_index = {part.name: k for k, part in enumerate(mesh.parts)}
    for k in reversed(range(len(mesh.parts))):  # who is carried comes after who carries
        part, rows = mesh.parts[k], _carried(mesh, part_index, k)
        pivot = np.asarray(part.pivot)
        points[rows] = (points[rows] - pivot) @ motion(mesh, part, clip, phase).T + pivot
    rise = bob(mesh, clip, phase)
    if rise:
        legs = np.array([part.kind == "leg" for part in mesh.parts] + [False])
        points[~legs[mesh.part], 2] += rise
    if mesh.strides and clip in ("rest", "walk", "run"):
        points[:, 2] -= mesh.points[:, 2].min()  # a bird's origin is its middle: on the ground it stands on its feet
    return points


def _carried(mesh, part_index, k):
    """Which points move with a part: its own, and those of parts that it carries."""
    carried = {k} | {j for j, part in enumerate(mesh.parts) if part_index.get(part.parent) == k}
    return np.isin(mesh.part, list(carried))


@cache
def poses_of(look: str) -> dict[str, np.ndarray]:
    """{clip: points (k, v, 3)} of a look: `POSES` through the cycle, one of clips that do not move."""
    mesh = mesh_of(look)
    still = ("rest", "glide")
    return {
        clip: np.stack([posed(mesh, clip, k / POSES) for k in range(1 if clip in still else POSES)])
        for clip in mesh.clips
    }


def joint(mesh: AnimalMesh, part: Part, clip: str, phase: float):
    """(quaternion (4,) w first, scale (3,)) that moves a part as `motion` does, for tools whose joints cannot lean.

    A leg turns and stretches instead, so that its foot is at the same place.
    """
    matrix, scale = motion(mesh, part, clip, phase), np.ones(3)
    if part.kind == "leg" and clip in mesh.strides:
        down = matrix @ (0.0, 0.0, -1.0)
        scale[2] = np.linalg.norm(down)
        matrix = _turn(1, -np.arctan2(down[0], -down[2]))
    half = 0.5 * np.sqrt(np.maximum(0.0, 1 + np.trace(matrix)))
    axis = np.array([matrix[2, 1] - matrix[1, 2], matrix[0, 2] - matrix[2, 0], matrix[1, 0] - matrix[0, 1]])
    return np.array([half, *(axis / (4 * half))]), scale


def phased(look: str, clip: str, phase) -> np.ndarray:
    """Which pose of `poses_of` shows a clip at these phases best, (n,) int."""
    count = len(poses_of(look)[clip])
    return np.round(np.asarray(phase, float) * count).astype(int) % count

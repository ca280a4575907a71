"""What animals of a clip perceive: learning sees by the kernels of a run, so it sees what a run sees.

Visibility does not depend on what is learned, and inside a gradient it is constant (`shared/models/herd.md`): so it is
looked up once for every frame.  Lengths are in body lengths (BL), as in `flockbrush.learning.rollout`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flockbrush.behaviours.brush import BodySpec, VisionSpec
from flockbrush.behaviours.models.herd import Params
from flockbrush.engine.maths import sincos_
from flockbrush.systems.decide import LeaderRules, Members, RoleState, roles_kernel
from flockbrush.systems.grid import sort_into_cells
from flockbrush.systems.perception import filtered_of_one_kind
from flockbrush.systems.senses import cosine_of_half_kernel, nearest_points_kernel
from flockbrush.systems.visibility import edges_by_cell, no_edges, visible_neighbours

NO_OWNER = np.zeros(0, np.int32)  # of edges, where there are no walls
BODILESS = "metric", "hidden_points"  # perceptions without occlusion


class Percept(NamedTuple):
    """What every animal of one moment perceives: all that the forces are made of, but the parameters.

    The visible neighbours of row i are ``near[first[i]:first[i + 1]]``; the nearest points of the walls it sees are
    ``walls_offset[walls_first[i]:walls_first[i + 1]]``.
    """

    forward: np.ndarray  # (n, 2) unit headings
    leader: np.ndarray  # (n,) uint8
    first: np.ndarray  # (n + 1,) int64
    near: np.ndarray  # (m,) int32 rows
    offset: np.ndarray  # (m, 2) BL, from the observer to the neighbour
    walls_first: np.ndarray  # (n + 1,) int64
    walls_offset: np.ndarray  # (k, 2) BL
    memory: np.ndarray  # (n, 2) BL, from the observer to where it last saw others
    known: np.ndarray  # (n,) uint8, whether there is such a memory

    @property
    def animals(self):
        """How many."""
        return len(self.forward)

    @property
    def observer(self):
        """(m,) the row that each neighbour is one of."""
        return np.repeat(np.arange(self.animals), np.diff(self.first))

    @property
    def walls_observer(self):
        """(k,) the row that sees each wall."""
        return np.repeat(np.arange(self.animals), np.diff(self.walls_first))


def perceive(xy, forward, body=None, vision=None, params=None, *, walls=None) -> Percept:
    """What each animal of one frame perceives; all are of one kind.

    Parameters
    ----------
    xy, forward : (n, 2) ndarray
        Positions, BL, and unit headings.
    body, vision : BodySpec, VisionSpec, optional
        The body's radius counts as a share of its length.
    params : Params, optional
        Of the herd model: the rule of leaders.
    walls : Walls, optional
        `flockbrush.learning.rollout.Walls`: solid, and they block the view.
    """
    body, vision, params = body or BodySpec(), vision or VisionSpec(), params or Params()
    n, reach = len(xy), float(vision.range)
    xyz, facing = np.zeros((n, 3)), np.zeros((n, 3))
    xyz[:, :2], facing[:, :2] = xy, forward
    half, radius = half_and_radius(body)
    solid = no_edges() if walls is None else edges_by_cell(walls.ends, reach)
    cells = sort_into_cells(xyz, facing, np.full(n, 2 * (half + radius)), np.full(n, radius), reach)
    hides = vision.occlusion and vision.sight not in BODILESS
    lists = visible_neighbours(cells, np.full(n, reach), np.full(n, cosine_of(vision)), solid, hides)
    lists = filtered_of_one_kind(lists, vision.sight, vision.neighbours)
    leader, memory, known = _leaders(xyz, facing, lists, params)
    first, near, offset = lists
    owner = NO_OWNER if walls is None else walls.owner
    walls_first, walls_offset = walls_in_sight(xyz, np.full(n, reach), solid, owner)
    own, back = facing[:, :2].copy(), memory - xyz[:, :2]
    return Percept(own, leader, first, near, offset, walls_first, walls_offset, back, known)


def half_and_radius(body):
    """Half the length of the capsule's axis and half its width, BL."""
    radius = body.radius / body.length
    return 0.0 if body.contact == "disc" else max(0.5 - radius, 0.0), radius


def cosine_of(vision) -> float:
    """Of half the field of view, as a run has it."""
    cosine = np.empty(1)
    cosine_of_half_kernel(0, 1, np.radians([float(vision.field_of_view)]), cosine)
    return float(cosine[0])


def _leaders(xyz, forward, lists, params):
    """Leaders by the rule of a run (paper, section 5.1), and where each animal last saw others."""
    n = len(xyz)
    leader, memory, known = np.zeros(n, np.uint8), xyz[:, :2].copy(), np.zeros(n, np.uint8)
    members = Members(np.arange(n), xyz, np.ones(n), *np.zeros((2, n), np.int32))
    roles_kernel(0, n, forward, *lists, members, leader_rule(params), RoleState(leader, memory, known))
    return leader, memory, known


def leader_rule(params):
    """The `LeaderRules` of animals of one brush; models without such rules have no leaders."""
    cone = getattr(params, "leader_cone", 360.0)
    half = -1.0 if cone >= 360.0 else sincos_(np.radians(0.5 * cone))[1]
    rule = float(getattr(params, "neighbour_range", np.inf)), getattr(params, "leader_neighbours", -1), half
    return LeaderRules(*(np.array([value]) for value in rule))


def walls_in_sight(xyz, reach, solid, owner):
    """The nearest point of each wall within sight, as lists: first (n + 1,) and offset (k, 2); `reach` is (n,)."""
    n = len(xyz)
    if not len(owner):
        return np.zeros(n + 1, np.int64), np.zeros((0, 2))
    most, count = int(owner.max()) + 1, np.zeros(n, np.int64)
    found = np.empty((n, most, 2))
    nearest_points_kernel(0, n, xyz, reach, solid, owner, found, count)
    return np.concatenate([[0], np.cumsum(count)]), found[np.arange(most) < count[:, None]]


def together(percepts) -> Percept:
    """Several moments as one batch: a herd whose parts do not see one another."""
    rows = np.cumsum([0] + [p.animals for p in percepts])
    sights = np.cumsum([0] + [len(p.near) for p in percepts])
    points = np.cumsum([0] + [len(p.walls_offset) for p in percepts])
    joined = {name: np.concatenate([getattr(p, name) for p in percepts]) for name in _COLUMNS}
    near = [p.near + np.int32(shift) for p, shift in zip(percepts, rows[:-1], strict=True)]
    return Percept(
        first=_chained([p.first for p in percepts], sights),
        near=np.concatenate(near).astype(np.int32),
        walls_first=_chained([p.walls_first for p in percepts], points),
        **joined,
    )


_COLUMNS = "forward", "leader", "offset", "walls_offset", "memory", "known"


def _chained(firsts, shifts):
    """Starts of lists that follow one another."""
    return np.concatenate([f[:-1] + shift for f, shift in zip(firsts, shifts, strict=False)] + [shifts[-1:]])

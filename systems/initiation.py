"""Initiation: how scattered birds find their places in a line formation (Klotsman & Tal [1]_, section 6).

Every bird looks at the others (visual volume, hidden-point removal), takes one of them as its reference, learns from it
the side and the place, and flies to the place that is so far from the reference as in the target shape.  Two with one
reference on one side part: the rear one takes another, farther down the arm.

The paper's rules alone do not converge; the additions have a switch each in
`flockbrush.behaviours.formation.reaching.FormingRules`.
Arrays are of one flock, in wingspans and frames, x to the right of the track and y along it.

.. [1] Klotsman, M. & Tal, A. (2012). Animation of flocks flying in line formations. Artificial Life 18(1), 91-105.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from flockbrush.behaviours.formation.reaching import FormingRules, home_, part_in_height, reach_, wrap_
from flockbrush.engine.arrays import write_
from flockbrush.engine.maths import atan2_, inner_kernel, sincos_
from flockbrush.engine.noise import Noise
from flockbrush.systems.hidden_points import hull_corners
from numba import njit

TOLERANCE = 0.5  # wingspans from its place at which a bird is in place
FLIP = 10.0**0.5  # radius of the flipping sphere, in distances of the farthest bird


class Target(NamedTuple):
    """A shape to fly to: what lies between each place and the one before it on its arm.

    Arm 0 is to the left of the leader, arm 1 to the right; place 0 is the leader's own.
    """

    length: np.ndarray  # (2,) places on each arm
    dx: np.ndarray  # (2, most + 1) wingspans away from the leader
    dy: np.ndarray  # (2, most + 1) wingspans back; negative: ahead of the one before


class Flying(NamedTuple):
    """Where birds are and which way they fly, (n,) each."""

    x: np.ndarray  # wingspans to the right of the track
    y: np.ndarray  # wingspans along it
    heading: np.ndarray  # rad, clockwise from the track


class Following(NamedTuple):
    """Whom birds follow, and where in the formation, (n,) each."""

    reference: np.ndarray  # the bird that each follows; -1: none
    side: np.ndarray  # -1 left, 1 right, 0 open
    place: np.ndarray  # as which of its arm; 0 leads, -1 open


def target_of(x, y) -> Target:
    """The target of a key shape: birds from left to right, the leader at the origin."""
    x, y = np.asarray(x, float), np.asarray(y, float)
    leader = int(np.argmin(x * x + y * y))
    arms = [np.arange(leader, -1, -1), np.arange(leader, len(x))]
    most = max(len(arm) for arm in arms)
    dx, dy = np.zeros((2, most)), np.zeros((2, most))
    for side, arm in enumerate(arms):
        dx[side, 1 : len(arm)], dy[side, 1 : len(arm)] = np.abs(np.diff(x[arm])), -np.diff(y[arm])
    return Target(np.array([len(arm) - 1 for arm in arms]), dx, dy)


@inner_kernel
def _look(i, birds, rules, perceived, angle, seen):
    """Mark whom bird i sees: perceived, within the visual volume, and not hidden.  ``angle`` becomes the bearings."""
    x, y, heading = birds
    n = len(x)
    px, py = np.empty(n), np.empty(n)
    far = 0.0
    for j in range(n):
        px[j], py[j] = x[j] - x[i], y[j] - y[i]
        far = max(far, px[j] * px[j] + py[j] * py[j])
        angle[j] = abs(wrap_(atan2_(px[j], py[j]) - heading[i]))
        seen[j] = j != i
    if rules.hidden_points and far > 0.0:
        far = np.sqrt(far)
        for j in range(n):
            d = np.sqrt(px[j] * px[j] + py[j] * py[j])
            stretch = 2.0 * FLIP * far / d - 1.0 if d > 0.0 else 0.0
            px[j], py[j] = px[j] * stretch, py[j] * stretch
            seen[j] = False
        for j in hull_corners(px, py):
            seen[j] = j != i
    for j in range(n):
        seen[j] &= angle[j] <= rules.volume and perceived[i, j]


@inner_kernel
def _follows(j, i, reference):
    """Whether bird j follows bird i, through however many others."""
    for _ in range(len(reference)):
        if j == i:
            return True
        j = reference[j]
        if j < 0:
            return False
    return True  # a ring


@inner_kernel
def _nearest(i, birds, now, seen, angle, rules, arm, beyond):
    """The nearest bird that i sees and may follow, first within the narrow volume; -1 for none.

    ``arm`` 0 takes any side, otherwise that side (and the leader); ``beyond`` asks for places behind that one.
    """
    x, y, _ = birds
    reference, side, slot = now
    best, chosen, wide_best, wide = np.inf, -1, np.inf, -1
    for j in range(len(x)):
        if not seen[j] or (rules.ahead_only and y[j] <= y[i]) or slot[j] < beyond:
            continue
        if arm != 0 and side[j] != arm and slot[j] != 0:
            continue
        if _follows(j, i, reference):
            continue
        d2 = (x[j] - x[i]) ** 2 + (y[j] - y[i]) ** 2
        if d2 < wide_best:
            wide_best, wide = d2, j
        if angle[j] <= rules.narrow and d2 < best:
            best, chosen = d2, j
    return chosen if chosen >= 0 else wide


@njit(cache=True, nogil=True, error_model="numpy")
def decide(birds, leader, now, count, rules, perceived, new):
    """Write whom each bird follows next, on which side and as which of the arm.

    Parameters
    ----------
    birds : Flying
    leader : int
    now, new : Following
    count : (2,) int
        Places on each arm.
    rules : FormingRules
    perceived : (n, n) bool
    """
    x = birds.x
    reference, side, slot = now
    new_reference, new_side, new_slot = new
    n = len(x)
    angle, seen = np.empty(n), np.empty(n, np.bool_)
    either, anywhere, behind = np.int64(0), np.int64(-1), np.int64(0)  # not three types of literals to compile for
    for i in range(n):
        if i == leader:
            new_reference[i], new_side[i], new_slot[i] = -1, 0, 0
            continue
        j, s, looked = reference[i], side[i], False
        if (
            j >= 0 and reference[j] >= 0 and _follows(reference[j], j, reference)
        ):  # a ring of birds that follow one another
            j = -1
        if j >= 0 and not perceived[i, j]:  # lost
            j = -1
        if j < 0 or not rules.loyal:
            _look(i, birds, rules, perceived, angle, seen)
            looked = True
            j = _nearest(i, birds, now, seen, angle, rules, either, anywhere)
            if j != reference[i]:
                s = 0
        if j < 0:
            new_reference[i], new_side[i], new_slot[i] = -1, 0, -1
            continue
        if j != leader and side[j] != 0:
            s = side[j]
        elif s == 0:
            s = 1 if x[i] > x[j] else -1
        place = slot[j] + 1 if slot[j] >= 0 else -1
        if rules.capacity and place > count[(s + 1) // 2]:
            s = -s
            if not looked:
                _look(i, birds, rules, perceived, angle, seen)
                looked = True
            j = _nearest(i, birds, now, seen, angle, rules, s, behind)
            if j < 0 or slot[j] >= count[(s + 1) // 2]:
                j = leader
            place = slot[j] + 1
        if rules.separation:
            rival = _rival(i, j, s, leader, birds, now, rules)
            if rival >= 0 and perceived[i, rival]:
                if not looked:
                    _look(i, birds, rules, perceived, angle, seen)
                other = _nearest(i, birds, now, seen, angle, rules, s, place) if place >= 0 else -1
                if other < 0 or slot[other] == 0:
                    other = rival
                if not _follows(other, i, reference):
                    j = other
                    place = slot[j] + 1 if slot[j] >= 0 else -1
        new_reference[i], new_side[i], new_slot[i] = j, s, place


@inner_kernel
def _rival(i, j, s, leader, birds, now, rules):
    """The front-most bird that follows j on side s, near and in front of i; -1 for none."""
    x, y, _ = birds
    reference, side, _ = now
    rival, front = -1, 0.0
    for b in range(len(x)):
        if b == i or reference[b] != j or (j == leader and side[b] != s):
            continue
        if y[b] < y[i] or (y[b] == y[i] and b > i):
            continue
        d2 = (x[b] - x[i]) ** 2 + (y[b] - y[i]) ** 2
        if d2 < rules.separation_distance**2 and (rival < 0 or y[b] > front):
            rival, front = b, y[b]
    return rival


@inner_kernel
def move(birds, speed, leader, now, target, usual, rules, new_heading, new_speed):
    """Speed and heading of every bird in the next frame (eqs. 5 and 6)."""
    x, y, heading = birds
    reference, side, slot = now
    dx, dy = target.dx, target.dy
    for i in range(len(x)):
        j = reference[i]
        if j < 0:
            new_speed[i], new_heading[i] = speed[i], heading[i]
            if rules.homing or i == leader:
                waits = i != leader and y[i] > y[leader]
                new_speed[i], new_heading[i] = home_(heading[i], speed[i], waits, rules)
            continue
        s, k = side[i], slot[i]
        arm = (s + 1) // 2
        ox, oy = (dx[arm, k], dy[arm, k]) if 0 < k < dx.shape[1] else usual
        sine, cosine = sincos_(heading[j])
        tx, ty = x[j] + speed[j] * sine + s * ox, y[j] + speed[j] * cosine - oy
        new_speed[i], new_heading[i] = reach_(x[i], y[i], heading[i], speed[i], tx, ty, speed[j], heading[j], rules)


@njit(cache=True, nogil=True, error_model="numpy")
def _fly(birds, leader, target, usual, rules, trial, track, said):
    """Fly until everybody has kept its place: (frames or -1, least distance, length of flock)."""
    x, y, heading = birds
    count, dx, dy = target
    most, hold, step, reach = trial
    n = len(x)
    z, climb = np.zeros(n), np.zeros(n)
    reference, side, slot = np.full(n, -1), np.zeros(n, np.int64), np.full(n, -1)
    slot[leader] = 0
    now, new = Following(reference, side, slot), Following(reference.copy(), side.copy(), slot.copy())
    speed = np.full(n, rules.cruise)
    heading2, speed2 = heading.copy(), speed.copy()
    place_x, place_y = np.zeros(dx.shape), np.zeros(dx.shape)
    for arm in range(2):
        for k in range(1, dx.shape[1]):
            place_x[arm, k] = place_x[arm, k - 1] + (2 * arm - 1) * dx[arm, k]
            place_y[arm, k] = place_y[arm, k - 1] - dy[arm, k]
    taken = np.zeros((2, dx.shape[1]), np.int64)
    least, longest, since = np.inf, 0.0, -1
    perceived = np.ones((n, n), np.bool_)
    for frame in range(most):
        if reach < np.inf:
            for i in range(n):
                for j in range(n):
                    perceived[i, j] = (x[i] - x[j]) ** 2 + (y[i] - y[j]) ** 2 <= reach * reach
        decide(birds, leader, now, count, rules, perceived, new)
        write_(reference, new.reference)
        write_(side, new.side)
        write_(slot, new.place)
        move(birds, speed, leader, now, target, usual, rules, heading2, speed2)
        if rules.apart:
            part_in_height(x, y, z, heading, speed, rules, climb)
        write_(heading, heading2)
        write_(speed, speed2)
        for i in range(n):
            sine, cosine = sincos_(heading[i])
            x[i] += speed[i] * sine
            y[i] += speed[i] * cosine
            z[i] += climb[i]
        if step > 0 and frame % step == 0 and frame // step < len(track):
            for i in range(n):
                track[frame // step, i, 0], track[frame // step, i, 1], track[frame // step, i, 2] = x[i], y[i], z[i]
            said[0] = frame // step + 1
        taken[:] = 0
        right, low, high = True, np.inf, -np.inf
        for i in range(n):
            low, high = min(low, y[i]), max(high, y[i])
            for j in range(i):
                least = min(least, (x[i] - x[j]) ** 2 + (y[i] - y[j]) ** 2 + (z[i] - z[j]) ** 2)
            if i == leader:
                continue
            k, arm = slot[i], (side[i] + 1) // 2
            if k < 1 or side[i] == 0 or k > count[arm] or taken[arm, k]:
                right = False
                continue
            taken[arm, k] = 1
            ex, ey = x[i] - x[leader] - place_x[arm, k], y[i] - y[leader] - place_y[arm, k]
            right &= ex * ex + ey * ey + (z[i] - z[leader]) ** 2 <= TOLERANCE * TOLERANCE
        longest = max(longest, high - low)
        since = (frame if since < 0 else since) if right else -1
        if since >= 0 and frame - since >= hold:
            return since, np.sqrt(least), longest
    return -1, np.sqrt(least), longest


class Initiation(NamedTuple):
    """How an initiation went."""

    frames: int  # until everybody was in its place to stay; -1: not within the time
    least: float  # wingspans, the least distance of two birds on the way
    longest: float  # wingspans, the longest the flock was on the way
    track: np.ndarray  # (k, n, 3) positions, every ``step`` frames


class FlightTrial(NamedTuple):
    """How long an initiation is flown, and what is kept of it."""

    most: int  # frames
    hold: int  # frames for which everybody keeps its place in the end
    step: int  # frames between positions that are kept; 0: none
    reach: float  # wingspans: the range of perception


def initiate(x, y, heading, target, rules=None, most=6000, hold=60, step=0, reach=np.inf) -> Initiation:
    """Let birds that cruise find into a formation.

    Parameters
    ----------
    x, y : array_like (n,)
        Wingspans; +y is the track.  The front-most bird leads.
    heading : array_like (n,)
        Radians, clockwise from the track.
    most : int
        Frames at most.
    hold : int
        Everybody is in place when nobody is farther than `TOLERANCE` from its place for so many frames.
    step : int
        Keep positions every so many frames; 0 keeps none.
    reach : float
        Wingspans: nobody perceives anybody farther away.

    References
    ----------
    .. [1] Klotsman, M. & Tal, A. (2012). Animation of flocks flying in line formations. Artificial Life 18(1), 91-105.
    """
    rules = rules_with_margin(rules or FormingRules(), target)
    birds, trial = Flying(*(np.array(a, float) for a in (x, y, heading))), FlightTrial(most, hold, step, float(reach))
    track, said = np.zeros((most // step + 1 if step else 0, len(birds.x), 3)), np.zeros(1, np.int64)
    frames, least, longest = _fly(birds, int(np.argmax(birds.y)), target, usual(target), rules, trial, track, said)
    return Initiation(int(frames), float(least), float(longest), track[: said[0]])


def rules_with_margin(rules, target):
    """The rules with a margin that neighbours in the target keep."""
    places = np.array(
        [
            (side * target.dx[arm, : k + 1].sum(), -target.dy[arm, : k + 1].sum())
            for arm, side in ((0, -1), (1, 1))
            for k in range(arm, target.length[arm] + 1)
        ]
    )
    apart = np.linalg.norm(places[:, None] - places, axis=2) + np.diag(np.full(len(places), np.inf))
    return rules._replace(margin=min(rules.margin, 0.95 * float(apart.min())))


def usual(target):
    """The mean step from place to place, for birds that do not know theirs yet."""
    inner = np.arange(target.dx.shape[1]) <= target.length[:, None]
    inner[:, 0] = False
    return float(target.dx[inner].mean()), max(float(target.dy[inner].mean()), 0.3)


def random_flock(birds, seed, density=9.0, turned=0.5, gap=1.0):
    """Birds at random places, (x, y, heading): ``density`` square wingspans each, none nearer than ``gap``."""
    noise, side = Noise(seed), np.sqrt(birds * density)
    x, y = np.empty(birds), np.empty(birds)
    for i in range(birds):
        for k in range(1000):
            px, py = (noise.uniform("scatter", k, [i], 2)[0] - 0.5) * side
            if not i or np.hypot(x[:i] - px, y[:i] - py).min() >= gap:
                break
        x[i], y[i] = px, py
    return x, y, turned * noise.normal("scatter heading", 0, np.arange(birds))[:, 0]

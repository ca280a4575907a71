"""Line formations: birds that fly as a V, a U, a J or a line, from wherever they start.

Klotsman and Tal 2012 [1]_.  Each bird keeps its place from a reference bird (section 6: perception, side, separation
are in `flockbrush.systems.formations` and `flockbrush.systems.initiation`); its speed and direction are eqs. 5 and 6.
 The place comes from
the flock's steady flight (section 5): key shapes in which every bird saves as large a share of power as in the
example, drawn as the flight goes on.

The paper counts in wingspans and frames and flies a third of a wingspan a frame; here a frame lasts as long as the
bird's own speed takes for that, and a tick goes its part of a frame.  What is added to the paper's rules stands in
`flockbrush.behaviours.formation.reaching`.  Ours are, too: flocks that turn (their frame is the leader's heading),
leaders that
take turns, inverted shapes (one tip leads, the other flies level with it), heights, and gusts.

.. [1] Klotsman, M. & Tal, A. (2012). Animation of flocks flying in line formations. Artificial Life 18(1), 91-105.
"""

from __future__ import annotations

from functools import lru_cache
from typing import ClassVar, Literal, NamedTuple

import numpy as np
from flockbrush.behaviours.behaviour import Flight, Parameters, Wishes, air_of, behaviour, frozen, quantity
from flockbrush.behaviours.formation.formation_shapes import Curve, Formation, FrameShape
from flockbrush.behaviours.formation.reaching import FormingRules, limited_speed_, limited_turn_, reach_, wrap_
from flockbrush.behaviours.formation.steady_flight import Drawing, SteadyFlight
from flockbrush.behaviours.sliders import DesignerSlider, moves, pace
from flockbrush.engine.maths import atan2_, sincos_
from flockbrush.engine.parallel import over_rows
from flockbrush.engine.seam import short_way_
from numba import njit
from pydantic import Field

AFTER = 4.0  # s in which a leader means to be with the flock that it lost
STRAY_TURN, STRAY_PACE = 4.0, 1.5  # times as fast as with its flock it turns and flies after that one.  By eye
EXAMPLE_FRAMES = 6  # of the movie that a brush stands for
Shape = Literal["V", "U", "J", "line", "inverted V", "inverted U"]


class Params(Parameters):
    """The shape, how alive it is, and how birds reach their places in it."""

    wingspan: float = quantity(
        1.7, "body lengths", "distance between the wingtips; unit of all distances of the model", 0.1, 20
    )
    shape: Shape = Field("V", description="shape of the formation", json_schema_extra={"unit": "-"})
    spacing: float = quantity(1.25, "wingspans", "lateral distance from bird to bird", 0.9, 10)
    slope: float = quantity(0.8, "1", "V and line: how far back the next bird flies per wingspan to the side", 0.1, 5)
    slope_right: float = quantity(0.0, "1", "V: slope of the right arm, if it differs from the left; 0: the same", 0, 5)
    curvature: float = quantity(
        0.05, "1/wingspans", "U and J: curvature of the arms; larger: they bend back sooner", 0.001, 1
    )
    left: float = quantity(
        0.5, "1", "share of the birds on the left of the leader; V and U: 0.5, J: 0.2, line: 0 or 1", 0, 1
    )
    deviation: float = quantity(0.15, "wingspans", "deviation of birds from the shape in the example; 0: rigid", 0, 2)
    lateral: float = quantity(
        0.0,
        "wingspans",
        "standard deviation of lateral distances in the example, and so their variation in flight; 0: constant",
        0,
        2,
    )
    switching: float = quantity(
        0.0, "1", "share of the example's frames (each a minute or more) in which a bird flies on the other side", 0, 1
    )
    drift: float = quantity(0.4, "wingspans/s", "fastest movement of a bird within a settled formation", 0.01, 5)
    turns: float = quantity(
        0.0, "s", "how long a bird leads before the next takes over; 0: the leader never changes", 0, 3600
    )
    leader_turn: float = quantity(0.1, "rad/s", "fastest turn of the leader, and so of the flock", 0.01, 2)
    leader_climb: float = quantity(0.12, "1", "steepest climb of the leader, as a share of its speed", 0, 1)
    gain: float = quantity(0.06, "1/√wingspans", "K of eq. 5; larger: birds catch up faster", 0, 0.5)
    turning: float = quantity(0.2, "1", "α of eq. 6; larger: birds turn to their place faster", 0.01, 1)
    slowest: float = quantity(0.6, "1", "lowest speed, as a multiple of the bird's own speed", 0.1, 1)
    fastest: float = quantity(1.6, "1", "highest speed, as a multiple of the bird's own speed", 1, 4)
    separation_distance: float = quantity(
        10.0, "wingspans", "birds that compete for a place separate when nearer than this", 0.5, 1000
    )
    margin: float = quantity(1.1, "wingspans", "birds that would pass nearer than this separate in height", 0, 5)
    foresight: float = quantity(2.0, "s", "how far ahead a bird looks for obstacles, as time of flight", 0, 60)
    meets: Literal["join", "pass"] = Field(
        "join", description="what two formations that see each other do; they always pass if their headings differ",
        json_schema_extra={"unit": "-"},
    )  # fmt: skip

    sliders: ClassVar = {
        "tightness": DesignerSlider("Wide to narrow lateral spacing", (moves("spacing", 3.0, 0.95, True),)),
        "regularity": DesignerSlider("Irregular to exact formation", (moves("deviation", 1.0, 0.0),)),
        "sweep": DesignerSlider(
            "Flat to deep formation", (moves("slope", 0.2, 3.0, True), moves("curvature", 0.01, 0.3, True))
        ),
        "nerve": DesignerSlider(
            "Slow to quick changes of place",
            (moves("drift", 0.05, 2.0, True), moves("gain", 0.01, 0.2, True), moves("turning", 0.05, 0.8, True)),
        ),
        "pace": pace(1.0, 60.0),
    }


def flight_of(p):
    """Its velocity is its own; it banks into turns."""
    return Flight(exact=True, banking=1.0, roll_time=0.8, foresight=p.foresight)


class InFormation(NamedTuple):
    """What birds in formation know, by row (`flockbrush.components.formation.FormationPlace`)."""

    reference: np.ndarray  # (n,) row of the reference bird, -1 for none
    place: np.ndarray  # (n,) 0 leads, -1 open
    offset: np.ndarray  # (n, 2) m, right of and ahead of the reference bird; of leaders: east, north to lost birds
    track: np.ndarray  # (n, 2) unit vectors; (0, 0): in no flock
    climb: np.ndarray  # (n,) m/s
    wind: np.ndarray  # (n, 3) m/s that blows at the bird
    felt: np.ndarray  # (n, 3) m/s of its velocity that was wind


class Wings(NamedTuple):
    """What a brush says of wings, and of how leaders fly."""

    span: float  # body lengths
    leader_turn: float  # rad/s
    leader_climb: float  # share of the speed


def explain(scene, row, p):
    """Why a bird in formation flies as it does: its velocity, its place, its height, the wind.

    {reason: (3,)} in m/s; they add up to the velocity it wishes.
    """
    wish = steer(scene, np.array([row], np.int32), p).velocity[0]
    known = scene.formation
    wind = known.wind[row] if known is not None else np.zeros(3)
    felt = known.felt[row] if known is not None else np.zeros(3)
    now = scene.velocity[row]
    leads = known is None or known.place[row] == 0 or not known.track[row].any()
    change = wish - wind - (now - felt)
    reasons = {
        "heading": now.copy(),
        "way" if leads else "place": change * (1.0, 1.0, 0.0),
        "height": change * (0.0, 0.0, 1.0),
        "wind": wind - felt,
    }
    return {name: vector for name, vector in reasons.items() if name == "heading" or np.abs(vector).max() > 1e-12}


@behaviour("line_formation", Params, flight=flight_of, formation=True, explain=explain, needs=("avoid_obstacles",))
def steer(scene, rows, p):
    """Reach one's place by eqs. 5 and 6; who leads flies where the flock is bound."""
    k, n = len(rows), len(scene.ids)
    direction, velocity = np.zeros((k, 3)), np.zeros((k, 3))
    air, known = air_of(scene), scene.formation
    if known is None:  # not looked up yet
        known = frozen(
            InFormation(
                np.full(n, -1),
                np.full(n, -1, np.int32),
                np.zeros((n, 2)),
                np.zeros((n, 2)),
                np.zeros(n),
                np.zeros((n, 3)),
                np.zeros((n, 3)),
            )
        )
    wishes, wings = Wishes(direction, np.ones(k), velocity=velocity), Wings(p.wingspan, p.leader_turn, p.leader_climb)
    over_rows(_steer, k, rows, scene.dt, scene.animals, known, air, rules_of(p), wings, wishes)
    return wishes


def rules_of(p) -> FormingRules:
    """The rules of initiation with a brush's numbers."""
    return FormingRules(
        gain=p.gain, turning=p.turning, slowest=p.slowest, fastest=p.fastest,
        separation_distance=p.separation_distance, margin=p.margin,
    )  # fmt: skip


def frame_of(wing, speed):
    """How long a frame of the paper lasts, s, for a wingspan in m and a speed in m/s."""
    return wing / (3.0 * max(float(speed), 1e-3))


@njit(cache=True, nogil=True, error_model="numpy")
def _steer(lo, hi, rows, dt, birds, known, air, rules, wings, wishes):
    """Write the direction and the velocity of each bird."""
    xyz, velocity, forward, own, length = birds.xyz, birds.velocity, birds.forward, birds.speed, birds.length
    guidance, bound, target = birds.guidance, air.bound, air.target
    reference, place, offset, track, climb, wind, felt = known
    wingspan, leader_turn, leader_climb = wings
    direction, wish = wishes.direction, wishes.velocity
    for k in range(lo, hi):
        i = rows[k]
        fx, fy = forward[i, 0], forward[i, 1]
        size = np.sqrt(fx * fx + fy * fy)
        if size > 1e-9:
            fx, fy = fx / size, fy / size
        else:
            fx, fy = 1.0, 0.0
        wing = wingspan * length[i]
        frame = wing / (3.0 * max(own[i], 1e-3))
        part = min(dt / frame, 1.0)  # of a frame of the paper in this tick
        ox, oy, oz = velocity[i, 0] - felt[i, 0], velocity[i, 1] - felt[i, 1], velocity[i, 2] - felt[i, 2]
        speed = np.sqrt(ox * ox + oy * oy) * frame / wing
        ux, uy = track[i, 0], track[i, 1]
        rise, turn = climb[i], 0.0
        j = reference[i]
        if place[i] == 0 or (ux == 0.0 and uy == 0.0):  # leaders, and birds in no flock yet
            gx, gy, gz = fx, fy, 0.0
            wanted = rules.cruise
            if bound[i] > 0:
                gx, gy, gz = target[i, 0], target[i, 1], target[i, 2]
            elif guidance[i, 0] != 0.0 or guidance[i, 1] != 0.0:
                gx, gy = guidance[i, 0], guidance[i, 1]
            far, most = np.sqrt(gx * gx + gy * gy), leader_turn * dt
            ax, ay = offset[i, 0], offset[i, 1]
            if ax != 0.0 or ay != 0.0:  # after the flock that it lost
                gx, gy, far = ax, ay, np.sqrt(ax * ax + ay * ay + gz * gz)
                wanted = min(max(np.sqrt(ax * ax + ay * ay) / AFTER * frame / wing, 0.8 * wanted), STRAY_PACE * wanted)
                most *= STRAY_TURN
            if far > 1e-9:
                turn = atan2_(gx * fy - gy * fx, gx * fx + gy * fy)
            turn = min(max(turn, -most), most)
            now = limited_speed_(speed, wanted, rules)
            speed += part * (now - speed)
            steepest = leader_climb * own[i]
            if bound[i] == 1 and far > 1e-9:
                rise = gz / far * own[i]
            elif bound[i] == 2:
                rise = 0.3 * gz  # 1/s
            else:
                rise = 0.0
            before = oz
            rise = before + min(
                max(min(max(rise, -steepest), steepest) - before, -2.0 * steepest * dt), 2.0 * steepest * dt
            )
        else:
            heading = atan2_(fx * uy - fy * ux, fx * ux + fy * uy)  # clockwise from the track
            if j >= 0:
                ax, ay = short_way_(xyz[j, 0] - xyz[i, 0], xyz[j, 1] - xyz[i, 1], birds.wrap)
                tx = (ax * uy - ay * ux + offset[i, 0]) / wing
                ty = (ax * ux + ay * uy + offset[i, 1]) / wing
                vx, vy = (velocity[j, 0] - felt[j, 0]) * frame / wing, (velocity[j, 1] - felt[j, 1]) * frame / wing
                lx, ly = vx * uy - vy * ux, vx * ux + vy * uy
                lead = np.sqrt(lx * lx + ly * ly)
                lead_heading = atan2_(lx, ly) if lead > 1e-9 else 0.0
                now, aimed = reach_(0.0, 0.0, heading, speed, tx + lx, ty + ly, max(lead, 1e-3), lead_heading, rules)
            else:
                now = limited_speed_(speed, 0.75 * rules.cruise, rules)
                aimed = limited_turn_(heading, -rules.turning * wrap_(heading), rules)
            speed += part * (now - speed)
            turn = part * wrap_(aimed - heading)
        sine, cosine = sincos_(turn)  # clockwise
        gx, gy = cosine * fx + sine * fy, cosine * fy - sine * fx
        v = speed * wing / frame
        wish[k, 0], wish[k, 1], wish[k, 2] = v * gx + wind[i, 0], v * gy + wind[i, 1], rise + wind[i, 2]
        size = np.sqrt(v * v + rise * rise)
        if size > 1e-9 and v > 1e-9:
            direction[k, 0], direction[k, 1], direction[k, 2] = v * gx / size, v * gy / size, rise / size
        else:
            direction[k, 0], direction[k, 1], direction[k, 2] = gx, gy, 0.0


# the flock's own flight ---------------------------------------------------------------


class _Stiff:
    """A shape that does not change."""

    def __init__(self, x, y):
        self.x, self.y = x, y

    def at(self, time):
        return self.x, self.y


class _Alive:
    """A shape that changes as in steady flight."""

    def __init__(self, flight):
        self.flight = flight

    def at(self, time):
        return self.flight.places(time).T


@lru_cache(maxsize=64)
def places(p, birds, seed):
    """Where the birds of a flock have their places: ``.at(seconds)`` gives (x, y) in wingspans, from left to right."""
    if p.shape.startswith("inverted"):
        return _Stiff(*_inverted(p, birds))
    left = min(int(p.left * (birds - 1) + 0.5), birds - 1)
    x = p.spacing * (np.arange(birds) - left)
    curve = _curve(p)
    if p.deviation == 0.0:
        return _Stiff(x, np.where(x == 0.0, 0.0, np.minimum(curve.y(x), -0.01)))
    frames = tuple(_frame(p, f, birds, left, curve) for f in range(EXAMPLE_FRAMES))
    drawing = Drawing(drift=p.drift, lateral=p.lateral > 0.0)
    return _Alive(SteadyFlight(Formation("brush", frames), birds, seed, left, drawing))


def _frame(p, f, birds, left, curve):
    """A frame of the movie that a brush stands for; in some the last bird of the longer arm flies on the other side."""
    names = tuple(str(k) for k in range(birds))
    zero = tuple(0.0 for _ in names)
    if birds > 2 and int((f + 1) * p.switching) > int(f * p.switching):
        if left > birds - 1 - left:
            names, left = (*names[1:], names[0]), left - 1
        else:
            names, left = (names[-1], *names[:-1]), left + 1
    return FrameShape(
        str(f), names, zero, zero, left, p.shape, "of a brush", curve, (), (p.spacing, p.lateral), (0.0, p.deviation)
    )


def _curve(p):
    if p.shape in ("V", "line"):
        return Curve("v", (0.0, p.slope, p.slope_right or p.slope))
    return Curve("parabola", (0.0, 0.0, -p.curvature))


def _inverted(p, birds):
    """The left tip leads; the middle flies behind, the right tip level with the leader."""
    x = p.spacing * np.arange(birds)
    middle = 0.5 * x[-1]
    if p.shape == "inverted V":
        return x, p.slope * (np.abs(x - middle) - middle)
    return x, p.curvature * ((x - middle) ** 2 - middle**2)

"""The formulas of the herd model, and what two animals do by them."""

import numpy as np
import pytest
from flockbrush.behaviours.models.herd import Params
from hypothesis import given
from hypothesis import strategies as st
from small_herd import NO_FORCES, NOBODY_LEADS, brush, forward_of, meadow, put, xy_of
from small_scenes import HERD, rows_, scene


def transcription(s, p):
    """Equations 2 to 5 in plain numpy for followers, one pair after the other."""
    out = np.zeros((len(s.ids), 2))
    for i in range(len(s.ids)):
        f = s.forward[i, :2]

        def weight(d, u, name, f=f):
            bearing = np.arccos(np.clip(f @ u, -1, 1)) if d else 0.0
            radial, angular = 4 * getattr(p, f"{name}_radial"), np.pi * getattr(p, f"{name}_angular")
            return np.exp(-0.5 * d**2 / radial**2) * np.exp(-0.5 * bearing**2 / angular**2)  # eq. 4

        force = np.zeros(2)
        for k in range(s.first[i], s.first[i + 1]):
            away = s.offset[k] / s.length[i]
            d = np.hypot(*away)
            if d > p.neighbour_range:
                continue
            u = away / d if d else np.zeros(2)
            kin = s.species[s.near[k]] == s.species[i]
            force -= p.avoidance_weight * weight(d, u, "avoidance") * d * u  # eq. 5
            if kin:
                force += p.cohesion_weight * weight(d, u, "cohesion") * d * u
                force += p.alignment_weight * weight(d, u, "alignment") * s.forward[s.near[k], :2]
        for k in range(s.obstacle_first[i], s.obstacle_first[i + 1]):
            away = s.obstacle_offset[k] / s.length[i]
            d = np.hypot(*away)
            u = away / d if d else np.zeros(2)
            force -= p.obstacle_weight * weight(d, u, "obstacle") * d * u
        left = np.array([-f[1], f[0]])
        h = f + s.dt * (p.sensitivity * force - p.slope_aversion * s.slope[i] + p.turn_bias * left)  # eqs. 3 and 2
        out[i] = h / np.hypot(*h)
    return out


unit = st.floats(0.001, 1)
weights = st.floats(0, 1)


@given(
    seed=st.integers(0, 10_000), n=st.integers(1, 9),
    w=st.tuples(weights, weights, weights, weights), r=st.tuples(unit, unit, unit, unit),
    a=st.tuples(unit, unit, unit, unit), sensitivity=st.floats(0, 50), neighbour_range=st.floats(0.5, 8),
    turn_bias=st.floats(-10, 10),
)  # fmt: skip
def test_the_herd_kernel_is_equations_2_to_5(seed, n, w, r, a, sensitivity, neighbour_range, turn_bias):
    names = "avoidance", "cohesion", "alignment", "obstacle"
    p = Params(
        sensitivity=sensitivity,
        neighbour_range=neighbour_range,
        turn_bias=turn_bias,
        **{f"{name}_weight": v for name, v in zip(names, w, strict=True)},
        **{f"{name}_radial": v for name, v in zip(names, r, strict=True)},
        **{f"{name}_angular": v for name, v in zip(names, a, strict=True)},
    )
    rng = np.random.default_rng(seed)
    s = scene(
        rng.uniform(0, 5, (n, 2)), rng.uniform(0, 6.28, n), rng.choice([0.7, 1.0, 1.3], n),
        obstacles=rng.uniform(-1, 6, (2, 2)), slope=(0.2, -0.1), species=rng.integers(0, 2, n).astype(np.int32),
    )  # fmt: skip
    # the kernel's exponentials are good to a few 1e-16, and arccos near 0 and pi to the root of that
    assert HERD.steer(s, rows_(range(n)), p).direction[:, :2] == pytest.approx(transcription(s, p), abs=2e-7)


def test_to_twelve_digits_where_the_oracle_has_them():
    # bearings away from 0 and 180 degrees, where arccos loses nothing
    s = scene([(0, 0), (0.3, 2.0), (0.5, -1.5), (-0.4, 1.0)], 0.05, obstacles=[(0.2, 3.0)])
    p = Params(cohesion_weight=0.6, alignment_angular=0.3, obstacle_weight=0.4)
    fine = [0]
    assert HERD.steer(s, rows_(fine), p).direction[:, :2] == pytest.approx(transcription(s, p)[fine], abs=1e-13)


def force_on_first(xy, heading=0.0, obstacles=(), **parameters):
    """What the first animal feels, in body lengths: read back from the next heading of a herd that answers slowly."""
    quiet = {**NO_FORCES, "sensitivity": 1.0, "slope_aversion": 0.0, **parameters}
    s = scene(xy, heading, obstacles=obstacles, dt=1e-6)
    h = HERD.steer(s, rows_([0]), Params(**quiet)).direction[0, :2]
    f = s.forward[0, :2]
    across = np.array([-f[1], f[0]])
    return (h @ across) / (h @ f) / 1e-6  # the part of the force that turns, to its left


def test_cohesion_turns_towards_and_avoidance_away_from_a_neighbour_to_the_left():
    assert force_on_first([(0, 0), (0, 2)], cohesion_weight=1.0) > 0.5
    assert force_on_first([(0, 0), (0, 2)], avoidance_weight=1.0) < -0.5


def test_alignment_turns_the_way_the_neighbour_faces():
    assert force_on_first([(0, 0), (2, 0)], (0.0, np.pi / 2), alignment_weight=1.0) > 0.5
    assert force_on_first([(0, 0), (2, 0)], (0.0, -np.pi / 2), alignment_weight=1.0) < -0.5
    assert force_on_first([(0, 0), (0, 2)], (0.0, 0.0), alignment_weight=1.0) == pytest.approx(0.0, abs=1e-9)


def test_an_obstacle_pushes_away_most_at_one_sigma():
    def push(d, radial):
        return -force_on_first(
            [(0, 0)], obstacles=[(0, d)], obstacle_weight=1.0, obstacle_radial=radial, obstacle_angular=1.0
        )

    for radial in (0.25, 0.5):
        distances = np.linspace(0.1, 6, 119)
        pushes = [push(d, radial) for d in distances]
        assert min(pushes) >= 0
        assert distances[np.argmax(pushes)] == pytest.approx(4 * radial, abs=0.06)
        # d exp(-d^2 / 2R^2), times the fall-off at 90 degrees
        d = 4 * radial
        assert push(d, radial) == pytest.approx(d * np.exp(-0.5) * np.exp(-0.5 / 4), rel=1e-5)


def test_sensitivity_scales_the_turn():
    s = scene([(0, 0), (1, 1.5), (-1, 0.5)], 0.0)

    def turn(sensitivity):
        return HERD.steer(s, rows_([0]), Params(sensitivity=sensitivity, slope_aversion=0.0)).direction[0]

    tangent = [turn(o)[1] / turn(o)[0] for o in (0.001, 0.002, 0.004)]
    assert turn(0.0).tolist() == [1.0, 0.0, 0.0]
    assert tangent[1] / tangent[0] == pytest.approx(2.0, rel=1e-3)
    assert tangent[2] / tangent[0] == pytest.approx(4.0, rel=1e-3)


def test_who_is_beyond_the_neighbour_range_is_ignored():
    s = scene([(0, 0), (0, 4.1)], 0.0)
    p = Params(cohesion_weight=1.0)
    assert HERD.steer(s, rows_([0]), p).direction[0, 1] == 0.0
    assert HERD.steer(s, rows_([0]), Params(cohesion_weight=1.0, neighbour_range=4.2)).direction[0, 1] > 0.01


def test_animals_of_another_kind_are_given_way_to_and_otherwise_ignored():
    other = {"species": np.array([0, 1], np.int32)}
    p = Params(cohesion_weight=1.0, alignment_weight=1.0, avoidance_weight=0.0)
    s = scene([(0, 0), (0, 2)], (0.0, np.pi / 2), **other)
    assert HERD.steer(s, rows_([0]), p).direction[0].tolist() == [1.0, 0.0, 0.0]
    p = Params(cohesion_weight=0.0, alignment_weight=0.0, avoidance_weight=1.0)
    assert HERD.steer(s, rows_([0]), p).direction[0, 1] < -0.05


def test_steep_ground_turns_an_animal_downhill():
    s = scene([(0, 0)], 0.0, slope=(0.0, 0.5))
    assert HERD.steer(s, rows_([0]), Params(slope_aversion=2.0)).direction[0, 1] == pytest.approx(-1 / 32, rel=1e-2)
    assert HERD.steer(s, rows_([0]), Params(slope_aversion=0.0)).direction[0, 1] == 0.0


def test_a_lone_animal_with_a_turn_bias_circles():
    """A circle of radius v / bias, to the left."""
    walker = brush(mean=2.0, **{**NO_FORCES, "unled": "keep", "turn_bias": 0.5, **NOBODY_LEADS})
    simulation = meadow(walker)
    put(simulation, [(20.0, 20.0)], 0.0)
    track = np.array([(simulation.tick(), xy_of(simulation)[0])[1] for _ in range(403)])  # once round: 4 pi s
    assert np.hypot(*(track - (20.0, 24.0)).T) == pytest.approx(4.0, rel=1e-2)
    assert track[200] == pytest.approx((20.0, 28.0), abs=0.1)


# two animals ------------------------------------------------------------------------


def settled_distance(avoidance, cohesion, length=1.0, seconds=40):
    """Body lengths between two side by side in the end.  Alignment only damps them: it has no part across the way."""
    (w_v, r_v), (w_c, r_c) = avoidance, cohesion
    pair = brush(
        mean=1.0, body={"length": length, "radius": 0.05 * length}, vision={"range": 20.0},
        avoidance_weight=w_v, avoidance_radial=r_v / 4, cohesion_weight=w_c, cohesion_radial=r_c / 4,
        avoidance_angular=1.0, cohesion_angular=1.0, alignment_weight=0.5, neighbour_range=20.0, **NOBODY_LEADS,
    )  # fmt: skip
    simulation = meadow(pair, width=400 * length, height=400 * length)
    put(simulation, np.array([(200, 200), (200, 203)]) * length, 0.0)
    simulation.run(32 * seconds)
    xy = xy_of(simulation)
    assert np.abs(forward_of(simulation)[:, 1]).max() < 1e-3  # they have settled
    return np.hypot(*(xy[1] - xy[0])) / length


@pytest.mark.parametrize(("avoidance", "cohesion"), [((0.8, 1.2), (0.3, 3.0)), ((0.9, 1.0), (0.2, 2.0))])
def test_two_settle_where_cohesion_and_avoidance_balance(avoidance, cohesion):
    (w_v, r_v), (w_c, r_c) = avoidance, cohesion
    expected = np.sqrt(2 * np.log(w_v / w_c) / (r_v**-2 - r_c**-2))  # body lengths
    # at this distance the force is nothing, whatever the bearing, for both sigmas of the angle are the same
    balanced = {
        "avoidance_weight": w_v,
        "avoidance_radial": r_v / 4,
        "cohesion_weight": w_c,
        "cohesion_radial": r_c / 4,
    }
    for bearing in (0.4, 1.5, 2.8):
        u = np.array([np.cos(bearing), np.sin(bearing)])
        pull = [
            force_on_first(
                [(0, 0), d * expected * u],
                avoidance_angular=1.0,
                cohesion_angular=1.0,
                neighbour_range=20.0,
                **balanced,
            )
            for d in (0.9, 1.0, 1.1)
        ]
        assert pull[0] < 0 < pull[2]
        assert pull[1] == pytest.approx(0.0, abs=1e-9)
    assert settled_distance(avoidance, cohesion) == pytest.approx(expected, rel=1e-3)
    assert settled_distance(avoidance, cohesion, length=0.25) == pytest.approx(expected, rel=1e-3)


def test_one_brush_moves_mice_and_cattle_alike_in_body_lengths():
    def trajectory(length):
        b = brush(mean=2.0, body={"length": length, "radius": 0.2 * length}, slope_aversion=0.0)
        simulation = meadow(b, width=60 * length, height=60 * length, cell=length)
        put(simulation, np.random.default_rng(5).uniform(26, 34, (12, 2)) * length, np.arange(12.0))
        return np.array([(simulation.tick(), xy_of(simulation) / length)[1] for _ in range(60)])

    mouse, cow = trajectory(0.125), trajectory(2.0)  # powers of two: the same bits in body lengths
    assert mouse == pytest.approx(cow, abs=1e-9)

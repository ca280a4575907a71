"""What every model promises, and what the herd's and the hunters' formulas say."""

import json

import numpy as np
import pytest
from flockbrush.behaviours.behaviour import Scene, behaviours
from flockbrush.behaviours.models.herd import Params
from flockbrush.engine.noise import Noise
from flockbrush.systems.senses import FindNeighbours, See
from flockbrush.systems.steer import scene_of
from hypothesis import given
from hypothesis import strategies as st
from small_herd import NO_FORCES, NOBODY_LEADS, brush, forward_of, meadow, put, xy_of

MODELS = sorted(behaviours().values(), key=lambda model: model.name)


def all_models(test):
    return pytest.mark.parametrize("model", MODELS, ids=lambda model: model.name)(test)


# scenes ------------------------------------------------------------------------


def scene(xy, heading, length=1.0, seed=0, leader=None, obstacles=(), guidance=(0.0, 0.0), slope=(0.0, 0.0), **more):
    """What animals see who all see one another."""
    xy, n = np.asarray(xy, float), len(xy)
    heading = np.broadcast_to(np.asarray(heading, float), n)
    forward = np.column_stack([np.cos(heading), np.sin(heading), np.zeros(n)])
    near = np.array([j for i in range(n) for j in range(n) if j != i], np.int32)
    offset = np.array([xy[j] - xy[i] for i in range(n) for j in range(n) if j != i]).reshape(-1, 2)
    seen = np.array([np.asarray(o, float) - xy[i] for i in range(n) for o in obstacles]).reshape(-1, 2)
    values = {
        "dt": 1 / 32,
        "tick": 7,
        "key": lambda stream: Noise(seed).key(stream, 7),
        "ids": np.arange(10, 10 + n),
        "xyz": np.column_stack([xy, np.zeros(n)]),
        "velocity": 1.2 * forward,
        "forward": forward,
        "speed": np.full(n, 1.2),
        "length": np.broadcast_to(np.asarray(length, float), n).copy(),
        "leader": np.zeros(n, np.uint8) if leader is None else np.asarray(leader, np.uint8),
        "species": np.zeros(n, np.int32),
        "danger": np.zeros(n, np.uint8),
        "first": np.arange(n + 1, dtype=np.int64) * max(n - 1, 0),
        "near": near,
        "offset": offset,
        "obstacle_first": np.arange(n + 1, dtype=np.int64) * len(obstacles),
        "obstacle_offset": seen,
        "guidance": np.broadcast_to(np.asarray(guidance, float), (n, 2)).copy(),
        "slope": np.broadcast_to(np.asarray(slope, float), (n, 2)).copy(),
        "memory": np.zeros((n, 2)),
        "known": np.zeros(n, np.uint8),
        "order": np.arange(n, dtype=np.int32),
    }
    return frozen(Scene(**(values | more)))


def frozen(scene, **changes):
    """The scene with some columns changed, none of which can be written."""
    scene = scene._replace(**changes)
    for column in scene:
        if isinstance(column, np.ndarray):
            column.flags.writeable = False
    return scene


def lively(seed=3, n=14, turn=0.0, shift=(0.0, 0.0)):
    """A scene with everything in it: two kinds, dangerous ones, leaders, obstacles, guides, slopes, memories."""
    rng = np.random.default_rng(seed)
    c, s = np.cos(turn), np.sin(turn)
    turned = np.array([(c, s), (-s, c)])  # rows are turned from the right
    xy, heading = rng.uniform(0, 5, (n, 2)), rng.uniform(0, 6.28, n)
    return scene(
        xy @ turned + shift,
        heading + turn,
        length=rng.choice([0.8, 1.0, 1.6], n),
        leader=rng.integers(0, 2, n),
        obstacles=np.array([(6.0, 1.0), (-1.0, 4.0)]) @ turned + shift,
        guidance=rng.uniform(-0.6, 0.6, (n, 2)) * rng.integers(0, 2, (n, 1)) @ turned,
        slope=rng.uniform(-0.5, 0.5, (n, 2)) @ turned,
        species=(np.arange(n) % 2).astype(np.int32),
        danger=(np.arange(n) % 5 == 1).astype(np.uint8),
        memory=rng.uniform(-9, 9, (n, 2)) @ turned,
        known=rng.integers(0, 2, n).astype(np.uint8),
    )


def steer(model, scene, rows=None, **parameters):
    return model.steer(scene, rows_(range(len(scene.ids)) if rows is None else rows), model.Params(**parameters))


def quiet(model):
    """Parameters without chance."""
    fields = model.Params.model_fields.items()
    return {name: 0.0 for name, field in fields if (field.json_schema_extra or {}).get("chance")}


NOISE = "noise breaks the symmetry? declare its strength with quantity(..., chance=True), and let 0 be none"
ROWS = "answer for `rows` only, from what each of them perceives: index columns with rows, and use scene.first[i]"


def rows_(numbers):
    """Rows as the systems give them to a model."""
    return np.array(numbers, np.int32)


# what every model promises --------------------------------------------------------


@all_models
class TestEveryModel:
    def test_gives_one_unit_direction_and_one_pace_for_each_animal_asked(self, model):
        wishes = steer(model, lively())
        assert wishes.direction.shape == (14, 3), "direction has a row of three for each of `rows`"
        assert wishes.pace.shape == (14,), "pace has a number for each of `rows`; np.ones(len(rows)) leaves speed alone"
        assert np.linalg.norm(wishes.direction, axis=1) == pytest.approx(1.0, abs=1e-12), "divide it by its length"
        assert (wishes.pace >= 0).all(), "pace multiplies the speed; nobody walks backwards"

    @pytest.mark.parametrize("turn", [0.4, np.pi / 2, 2.5, -3.0])
    def test_turns_with_the_scene(self, model, turn):
        """Headings and offsets must be used as vectors: no direction of the map is special."""
        straight, turned = (steer(model, lively(turn=angle), **quiet(model)) for angle in (0.0, turn))
        c, s = np.cos(turn), np.sin(turn)
        assert turned.direction[:, :2] == pytest.approx(straight.direction[:, :2] @ [(c, s), (-s, c)], abs=1e-10)
        assert turned.pace == pytest.approx(straight.pace, abs=1e-10)

    def test_forgets_the_origin(self, model):
        """Use scene.offset, not scene.xyz, for neighbours: where the origin is means nothing to an animal."""
        here, there = steer(model, lively()), steer(model, lively(shift=(300.0, -200.0)))
        assert there.direction == pytest.approx(here.direction, abs=1e-9)
        assert there.pace == pytest.approx(here.pace, abs=1e-9)

    def test_does_not_tell_left_from_right(self, model):
        mirror = np.array([1.0, -1.0])
        s = lively()
        flipped = frozen(
            s, xyz=s.xyz * (1, -1, 1), forward=s.forward * (1, -1, 1), velocity=s.velocity * (1, -1, 1),
            offset=s.offset * mirror, obstacle_offset=s.obstacle_offset * mirror, guidance=s.guidance * mirror,
            slope=s.slope * mirror, memory=s.memory * mirror,
        )  # fmt: skip
        flat, mirrored = (steer(model, seen, **quiet(model)).direction for seen in (s, flipped))
        assert mirrored == pytest.approx(flat * (1, -1, 1), abs=1e-12), NOISE

    def test_answers_only_for_the_rows_asked_and_the_same_as_for_all(self, model):
        whole = steer(model, lively())
        rows = np.array([9, 2, 5])
        some = steer(model, lively(), rows)
        assert some.direction.tolist() == whole.direction[rows].tolist(), ROWS
        assert some.pace.tolist() == whole.pace[rows].tolist()
        none = steer(model, lively(), [])
        assert none.direction.shape == (0, 3)

    def test_leaves_the_scene_untouched_and_repeats_itself(self, model):
        s = lively()  # its arrays cannot be written
        before = [np.array(column) for column in s if isinstance(column, np.ndarray)]
        once, again = steer(model, s), steer(model, s)
        after = [column for column in s if isinstance(column, np.ndarray)]
        assert all(np.array_equal(a, b) for a, b in zip(before, after, strict=True))
        assert once.direction.tobytes() == again.direction.tobytes()
        assert once.pace.tobytes() == again.pace.tobytes()

    def test_gives_every_call_arrays_of_its_own(self, model):
        s = lively()
        once = steer(model, s)
        copy = once.direction.copy()
        steer(model, lively(seed=4))
        assert np.array_equal(once.direction, copy)

    @pytest.mark.parametrize("n", [1, 2, 7])
    def test_is_finite_for_one_alone_and_for_many_on_one_spot(self, model, n):
        everything = {"danger": np.ones(n, np.uint8), "species": np.arange(n, dtype=np.int32)}
        for more in ({}, everything, {"speed": np.zeros(n), "velocity": np.zeros((n, 3))}):
            wishes = steer(model, scene(np.ones((n, 2)), 0.3, obstacles=[(1.0, 1.0)], **more))
            assert np.isfinite(wishes.direction).all()
            assert np.isfinite(wishes.pace).all()
            assert np.linalg.norm(wishes.direction, axis=1) == pytest.approx(1.0, abs=1e-12)

    def test_alone_on_a_plain_it_goes_on_as_it_was(self, model):
        wishes = steer(model, scene([(3.0, 3.0)], 1.1), **quiet(model))
        assert wishes.direction[0] == pytest.approx((np.cos(1.1), np.sin(1.1), 0), abs=1e-12), NOISE
        assert wishes.pace[0] == 1.0

    def test_the_smallest_and_the_largest_parameters_work(self, model):
        schema = model.Params.model_json_schema()["properties"]
        for end in ("minimum", "maximum"):
            numbers = {name: p[end] for name, p in schema.items() if end in p}
            wishes = steer(model, lively(), **numbers)
            assert np.isfinite(wishes.direction).all()
            assert np.isfinite(wishes.pace).all()

    def test_every_parameter_has_a_unit_bounds_and_a_meaning(self, model):
        for name, p in model.Params.model_json_schema()["properties"].items():
            assert p.get("unit"), f"{name}: use quantity(default, unit, meaning, low, high); '1' for pure numbers"
            assert len(p.get("description", "")) > 10, f"{name}: say what a larger value does"
            assert "enum" in p or {"minimum", "maximum"} <= set(p), f"{name}: give low and high"
            assert "default" in p, name

    def test_refuses_what_is_out_of_bounds_not_finite_unknown_or_changed_later(self, model):
        for wrong in ({"no_such_thing": 1.0}, {"sensitivity": float("nan")}, {"sensitivity": -1.0}):
            with pytest.raises(ValueError):
                model.Params(**wrong)
        with pytest.raises(ValueError):
            model.Params().sensitivity = 3.0

    def test_parameters_survive_json(self, model):
        params = model.Params()
        assert model.Params(**json.loads(params.model_dump_json())) == params

    def test_cites_its_source(self, model):
        assert ".. [1]" in model.doc, "the module's docstring ends with References and `.. [1] Author Year, Title.`"
        assert any(year in model.doc for year in map(str, range(1980, 2031)))

    def test_a_whole_herd_of_it_runs(self, model):
        simulation = meadow(brush(model=model.name), boundary="wall", width=20, height=20)
        put(simulation, np.random.default_rng(1).uniform(3, 17, (30, 2)), np.arange(30.0))
        simulation.run(40)
        assert ((xy_of(simulation) > 0) & (xy_of(simulation) < 20)).all()


def test_there_are_the_models_of_the_paper():
    assert {"herd", "flee", "hunt"} <= set(behaviours())
    assert [name for name, model in behaviours().items() if model.danger] == ["hunt", "raptor"]


# the herd's formulas ----------------------------------------------------------------

HERD = behaviours()["herd"]


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
        h = f + s.dt * p.sensitivity * force - s.dt * p.slope_aversion * s.slope[i]  # eqs. 3 and 2
        out[i] = h / np.hypot(*h)
    return out


unit = st.floats(0.001, 1)
weights = st.floats(0, 1)


@given(
    seed=st.integers(0, 10_000), n=st.integers(1, 9),
    w=st.tuples(weights, weights, weights, weights), r=st.tuples(unit, unit, unit, unit),
    a=st.tuples(unit, unit, unit, unit), sensitivity=st.floats(0, 50), neighbour_range=st.floats(0.5, 8),
)  # fmt: skip
def test_the_herd_kernel_is_equations_2_to_5(seed, n, w, r, a, sensitivity, neighbour_range):
    names = "avoidance", "cohesion", "alignment", "obstacle"
    p = Params(
        sensitivity=sensitivity,
        neighbour_range=neighbour_range,
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


# leaders ------------------------------------------------------------------------------


def test_leaders_follow_the_guidance_and_followers_do_not():
    s = scene([(0, 0), (2, 0), (0, 2)], 0.0, leader=[1, 0, 0], guidance=(0.0, 1.0))
    wishes = HERD.steer(s, rows_(range(3)), Params())
    assert wishes.direction[0].tolist() == [0.0, 1.0, 0.0]
    assert wishes.direction[1, 0] > 0.9
    assert HERD.steer(frozen(s, guidance=s.guidance * 0), rows_(range(3)), Params()).direction[1].tolist() == (
        wishes.direction[1].tolist()
    )


def test_a_leader_may_listen_to_its_neighbours_as_well():
    s = scene([(0, 0), (1, -2), (-1, -2)], 0.0, leader=[1, 0, 0], guidance=(0.0, 1.0))
    angle = [
        np.arctan2(*HERD.steer(s, rows_([0]), Params(leader_blend=b)).direction[0, 1::-1]) for b in (0.0, 0.5, 1.0)
    ]
    assert angle[0] == pytest.approx(np.pi / 2)
    assert angle[0] > angle[1] > angle[2]
    unled = HERD.steer(frozen(s, leader=np.zeros(3, np.uint8)), rows_([0]), Params()).direction[0]
    assert np.arctan2(unled[1], unled[0]) == pytest.approx(angle[2], abs=1e-12)


def test_where_no_guide_reaches_a_stray_returns_or_keeps_its_way():
    memory = np.array([(0.0, 12.0)])
    s = scene([(0, 0)], 0.0, leader=[1], memory=memory, known=np.ones(1, np.uint8))
    assert HERD.steer(s, rows_([0]), Params(unled="return")).direction[0, 1] > 0.05
    assert HERD.steer(s, rows_([0]), Params(unled="keep")).direction[0].tolist() == [1.0, 0.0, 0.0]
    never = frozen(s, known=np.zeros(1, np.uint8))
    assert HERD.steer(never, rows_([0]), Params(unled="return")).direction[0].tolist() == [1.0, 0.0, 0.0]


def test_a_stray_really_comes_home():
    grazing, straying = brush("grazing", mean=0.0), brush("straying", mean=1.0)
    simulation = meadow(grazing, straying, width=80, height=80)
    put(simulation, [(30 + i, 40 + j) for i in range(3) for j in range(3)], np.pi, brush="grazing")
    (stray,) = put(simulation, [(34.5, 41)], 0.5, brush="straying")  # sees the herd, and walks away from it

    def away():
        xy = xy_of(simulation)
        return np.hypot(*(xy[:9].mean(0) - xy[simulation.agents.row(stray)]))

    distances = [(simulation.run(32), away())[1] for _ in range(30)]
    farthest = int(np.argmax(distances))
    assert 5.5 < distances[farthest] < 9  # out of sight of those at the edge, who are 1.4 m from the middle
    assert min(distances[farthest:]) < 4.0  # and back among them


# hunters and prey ------------------------------------------------------------------------

FLEE, HUNT = behaviours()["flee"], behaviours()["hunt"]


def wolf_and_deer(distance, wolf_first=False, **more):
    rows = np.array([1, 0] if wolf_first else [0, 1])
    return scene(
        [(0, 0), (0, distance)], 0.0, species=rows.astype(np.int32), danger=(rows == 1).astype(np.uint8), **more
    )


def test_prey_turns_away_from_a_wolf_the_sooner_the_nearer_it_is_and_runs():
    calm = HERD.steer(wolf_and_deer(11.0), rows_([0]), Params()).direction[0]
    turned, paces = [], []
    for distance in (13.0, 11.0, 6.0, 2.0):
        wish = steer(FLEE, wolf_and_deer(distance), [0], flight_distance=12.0, panic_pace=3.0)
        turned.append(wish.direction[0, 1])
        paces.append(wish.pace[0])
    assert turned[0] == pytest.approx(calm[1])
    assert paces[0] == 1.0
    assert turned == sorted(turned, reverse=True)
    assert turned[-1] < -0.3
    assert paces == pytest.approx([1.0, 1 + 2 * (1 / 12), 2.0, 1 + 2 * (10 / 12)])


def test_haste_is_caught_from_ones_kind():
    still, running = np.zeros((3, 3)), np.array([(0, 0, 0), (3.6, 0, 0), (3.6, 0, 0)], float)
    xy = [(0, 0), (2, 0), (0, 2)]
    assert steer(FLEE, scene(xy, 0.0, velocity=still), [0]).pace[0] == 1.0
    caught = steer(FLEE, scene(xy, 0.0, velocity=running), [0], contagion=0.5).pace[0]
    assert caught == pytest.approx(1 + 0.5 * (3.0 - 1.0))  # they run three times as fast as they would
    assert steer(FLEE, scene(xy, 0.0, velocity=running), [0], contagion=0.0).pace[0] == 1.0


def test_wolves_do_not_flee_from_their_own_kind():
    pack = {"danger": np.ones(2, np.uint8)}
    assert steer(FLEE, scene([(0, 0), (0, 2)], 0.0, **pack), [0]).pace[0] == 1.0


def test_a_wolf_heads_for_prey_in_sight_and_faster_in_the_last_rush():
    def chase(distance):
        return steer(HUNT, wolf_and_deer(distance, True), [0], chase_distance=30.0, charge_distance=8.0)

    nobody = steer(HUNT, scene([(0, 0)], 0.0, danger=np.ones(1, np.uint8)), [0])
    assert nobody.direction[0].tolist() == [1.0, 0.0, 0.0]
    assert nobody.pace[0] == 1.0
    assert chase(31.0).pace[0] == 1.0
    assert chase(20.0).pace[0] == 1.5
    assert 0.1 < chase(20.0).direction[0, 1] < 0.9
    rush = chase(5.0)
    assert rush.pace[0] == 2.5
    # where the prey will be: it walks east at 1.2 m/s while the wolf covers 5 m at 3 m/s
    soon = np.array([1.2 * 5 / 3, 5.0])
    assert rush.direction[0, :2] == pytest.approx(soon / np.hypot(*soon))


def test_a_wolf_singles_out_the_stray():
    # a deer alone at 6 m to the left, three together at 5 m to the right
    xy = [(0, 0), (0, 6), (0, -5), (1, -5.5), (-1, -5.5)]
    s = scene(xy, 0.0, danger=np.array([1, 0, 0, 0, 0], np.uint8), velocity=np.zeros((5, 3)))
    near = [[1, 2, 3, 4], [0], [0, 3, 4], [0, 2, 4], [0, 2, 3]]
    xy = np.array(xy, float)
    seen = {
        "first": np.cumsum([0] + [len(row) for row in near]),
        "near": np.array([j for row in near for j in row], np.int32),
        "offset": np.array([xy[j] - xy[i] for i, row in enumerate(near) for j in row]),
    }
    s = frozen(s, **seen)
    assert steer(HUNT, s, [0], crowd_penalty=1.0).direction[0, 1] > 0.9
    assert steer(HUNT, s, [0], crowd_penalty=0.0).direction[0, 1] < -0.9


def test_deer_run_from_a_wolf_and_calm_down_when_it_is_gone():
    deer = brush("deer", "flee", mean=1.0, vision={"range": 12.0}, flight_distance=10.0)
    wolf = brush("wolf", "hunt", mean=1.0, vision={"range": 30.0})
    simulation = meadow(deer, wolf, width=400, height=400)
    grass = np.array([(200 + 2 * i, 200 + 2 * j) for i in range(5) for j in range(4)], float)
    herd = put(simulation, grass, np.pi, brush="deer", species="deer")
    simulation.run(64)
    quiet = speed_of(simulation, herd)
    (beast,) = put(simulation, xy_of(simulation).max(0) + (4, 0), np.pi, brush="wolf", species="wolf")
    before = distance_to_herd(simulation, beast, herd)
    simulation.run(96)
    assert speed_of(simulation, herd) > 1.3 * quiet
    assert forward_of(simulation)[:20, 0].mean() < -0.5  # away to the west
    simulation.world.delete_entity(beast)
    simulation.run(32 * 12)
    assert speed_of(simulation, herd) < 1.15 * quiet
    assert before > 2


def test_wolves_catch_up_with_a_stray():
    deer = brush("deer", "flee", mean=1.0, vision={"range": 8.0}, flight_distance=6.0, panic_pace=1.5)
    wolf = brush("wolf", "hunt", mean=1.2, vision={"range": 40.0})
    simulation = meadow(deer, wolf, width=600, height=600)
    prey = put(simulation, [(300, 300)], 0.3, brush="deer", species="deer")
    pack = put(simulation, [(280, 300), (280, 303), (280, 297)], 0.0, brush="wolf", species="wolf")
    distances = []
    for _ in range(20):
        simulation.run(32)
        distances.append(min(distance_to_herd(simulation, w, prey) for w in pack))
    assert distances[-1] < 1.2  # body to body
    assert distances[0] > 10
    assert np.mean(distances[10:]) < np.mean(distances[:5])


def rows_of(simulation, entities):
    return [simulation.agents.row(e) for e in entities]


def speed_of(simulation, entities):
    from flockbrush.components import Velocity

    return np.linalg.norm(simulation.agents[Velocity.xyz][rows_of(simulation, entities)], axis=1).mean()


def distance_to_herd(simulation, entity, herd):
    xy = xy_of(simulation)
    return np.hypot(*(xy[rows_of(simulation, herd)] - xy[simulation.agents.row(entity)]).T).min()


# the scene ------------------------------------------------------------------------------


def test_a_herd_that_takes_its_neighbours_by_slot_turns_to_the_bit_as_one_that_takes_them_by_row():
    rng = np.random.default_rng(5)
    simulation = meadow(brush(), width=30.0, height=30.0, boundary="wrap")
    put(simulation, rng.uniform(0, 30, (150, 2)))
    simulation.run(3)
    for system in (FindNeighbours(), See()):
        system.process(simulation.world)
    whole = scene_of(simulation.world)
    lean = scene_of(simulation.world, lists=False)
    rows, p = rows_(range(150)), Params(wander=0.1)
    by_row = HERD.steer(whole._replace(by_slot=None), rows, p).direction
    assert lean.near is None and whole.by_slot is not None and np.abs(by_row[:, :2]).max() > 0.1
    assert HERD.steer(lean, rows, p).direction.tobytes() == by_row.tobytes()
    assert len(whole.near) > 500


def test_models_get_views_that_cannot_be_written():
    simulation = meadow(brush())
    put(simulation, [(20, 20), (22, 20)])
    simulation.tick()
    for name, column in scene_of(simulation.world)._asdict().items():
        if isinstance(column, np.ndarray):
            assert not column.flags.writeable, name

"""What every model promises, and what the herd's and the hunters' formulas say."""

import json
import re

import numpy as np
import pytest
from flockbrush.behaviours.behaviour import behaviours
from flockbrush.behaviours.models.herd import Params
from flockbrush.systems.senses import FindNeighbours, See
from flockbrush.systems.steer import scene_of
from small_herd import brush, meadow, put, xy_of
from small_scenes import HERD, frozen, quiet, rows_, scene, steer

MODELS = sorted(behaviours().values(), key=lambda model: model.name)


def all_models(test):
    return pytest.mark.parametrize("model", MODELS, ids=lambda model: model.name)(test)


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


NOISE = "noise breaks the symmetry? declare its strength with quantity(..., chance=True), and let 0 be none"
ROWS = "answer for `rows` only, from what each of them perceives: index columns with rows, and use scene.first[i]"


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
        assert re.search(r"\b(1[6-9]|20)\d\d\b", model.doc), "the reference names the year, as `Author 1954, Title.`"

    def test_a_whole_herd_of_it_runs(self, model):
        simulation = meadow(brush(model=model.name), boundary="wall", width=20, height=20)
        put(simulation, np.random.default_rng(1).uniform(3, 17, (30, 2)), np.arange(30.0))
        simulation.run(40)
        assert ((xy_of(simulation) > 0) & (xy_of(simulation) < 20)).all()


@pytest.mark.parametrize("model", [model for model in MODELS if model.summary], ids=lambda model: model.name)
def test_what_a_model_sums_up_hangs_neither_on_parameters_nor_on_headings_of_the_rows(model):
    """Learning sums a scene up once and steers by that with many parameters, as the animals turn."""
    row, before = rows_([4]), lively()
    forward = np.array(before.forward)
    forward[4] = np.cos(2.0), np.sin(2.0), 0.0
    after = frozen(before, forward=forward)
    told = model.Params.model_json_schema()["properties"].items()
    most = {name: field["maximum"] for name, field in told if "maximum" in field}
    for params in (model.Params(), model.Params(**most)):
        said, afresh = model.steer(after, row, params, model.summary(before, row)), model.steer(after, row, params)
        assert said.direction.tobytes() == afresh.direction.tobytes()
    assert afresh.direction.tolist() != steer(model, after, row).direction.tolist()  # the parameters count


def test_there_are_the_models_of_the_paper():
    assert {"herd", "flee", "hunt"} <= set(behaviours())
    assert [name for name, model in behaviours().items() if model.danger] == ["hunt", "raptor"]


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

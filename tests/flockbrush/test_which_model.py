"""Which model moves like animals: herds of each, of which only tracks are known, and what is said of them."""

import functools
import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from flockbrush.behaviours import behaviour as behaviour_module
from flockbrush.behaviours.behaviour import behaviours
from flockbrush.behaviours.brush import SpeedSpec, VisionSpec
from flockbrush.components import Position
from flockbrush.engine.problems import ProblemsError

import flockbrush
from benchmarks.learning_models import evidence_of, tracks_of, truths
from benchmarks.learning_models import table_of as confusion_of
from flockbrush.learning import model_fit, model_search, trials, which_model
from flockbrush.learning.confounding import estimates_of
from flockbrush.learning.html_page import ReportPage
from flockbrush.learning.initial_conditions import speed_of
from flockbrush.learning.learned_brush import brush_of
from flockbrush.learning.learned_parameters import Attempt
from flockbrush.learning.likelihood import likelihoods, place, read, searched, tension
from flockbrush.learning.likelihoods import force_map
from flockbrush.learning.model_choice import add_models, as_json, check_kind, hopeless, kind_of, nearest, table_of
from flockbrush.learning.model_fit import answering, kinds_of_models, learned_model
from flockbrush.learning.model_search import ModelSetting, first_shape, speed_by
from flockbrush.learning.next_step import NextSteps
from flockbrush.learning.perceive import perceive
from flockbrush.learning.rollout import HerdStart, Surroundings, Walls, rollout, theta_of
from flockbrush.learning.turns import Turns, predicted, thinned, turns_of
from flockbrush.learning.which_model import (
    ModelComparison,
    ModelRow,
    TurnBlocks,
    compare_models,
    likeliest,
    problem_of,
)
from flockbrush.learning.world_rollout import model_of

TRUTHS = {kind: brush for name, (kind, brush) in truths().items() if name != "zones, seen"}

X = np.zeros(2)


@functools.cache
def tracks(name):
    """(T, N, 2) BL, of two dozen animals that begin each its own way."""
    return tracks_of(TRUTHS[name], 24)


@pytest.mark.parametrize("name", [pytest.param(n, marks=[pytest.mark.slow] * (n in ("herd", "boids"))) for n in TRUTHS])
def test_a_herd_is_told_to_be_what_it_is_or_not_told_apart(name):
    found = compare_models([evidence_of(tracks(name))])
    assert name in found.equal, found.sentence
    assert len(found.rows) == 6 and found.blocks >= 6
    assert all(row.behind >= 0 for row in found.rows) and not found.rows[0].told_apart
    assert set(found.likelier) <= set(found.equal) - {"herd", "force_map"}
    assert (name in found.contenders) == (name in ("zones", "boids", "morse", "force_map"))
    assert name != "herd" or not found.likelier
    if name == "zones":
        assert found.equal == ["zones"] and "is zones (all animals" in found.sentence
        assert found.rows[0].params.repulsion == pytest.approx(1.0, abs=0.1)


def test_models_that_set_speeds_themselves_must_make_turns_much_likelier_to_be_tried():
    vision, base = VisionSpec(range=8.0), np.full(8, 1.0)
    rows = [
        ModelRow(name, name, vision, None, gain, 0.1, blocks=base + gain + 0.001 * np.arange(8))
        for name, gain in (("morse", 0.1), ("boids", 0.1), ("herd", 0.0))
    ]
    assert ModelComparison(rows, 0.5, 8).contenders == ["morse"]
    for row in rows[:2]:
        row.blocks = row.blocks + 0.1
    assert ModelComparison(rows, 0.5, 8).contenders == ["morse", "boids"]
    for row in rows[:2]:
        row.blocks = row.blocks - 0.17
    assert ModelComparison(rows, 0.5, 8).contenders == []


def test_nothing_is_told_of_too_little_or_of_noise():
    short = compare_models([evidence_of(tracks("zones")[:40])], ["herd", "zones"])
    assert "blocks" in short.reason and short.equal == [row.name for row in short.rows]
    noisy = compare_models([evidence_of(tracks("zones")[:110, :20], noise=0.4)], ["herd", "zones"])
    assert noisy.reason and noisy.sentence.startswith("The models cannot be distinguished on this clip")
    assert noisy.contenders == []


def test_animals_that_press_past_each_other_are_seen_not_to_turn_aside():
    """Animals with random headings that go straight on, and the same animals with the contacts of the herd model."""
    rng, steps = np.random.default_rng(3), np.arange(48) / 16.0
    xy, heading = rng.uniform(0, 7, (40, 2)), rng.uniform(-np.pi, np.pi, 40)
    straight = xy + steps[:, None, None] * np.stack([np.cos(heading), np.sin(heading)], -1)
    assert all(turns.radius == 0.0 for turns in TurnBlocks([evidence_of(straight)]).reference)
    start = HerdStart(xy, np.stack([np.cos(heading), np.sin(heading)], -1), np.ones(40))
    alone = TRUTHS["herd"].params.model_copy(update={"neighbour_range": 0.5, "wander": 0.0})
    run = rollout(start, alone, SpeedSpec(mean=1.0, deviation=0.0), seconds=3.0, fps=16, seed=1)
    turned = run.xy.reshape(-1, 40, 2)
    assert all(turns.radius > 0.0 for turns in TurnBlocks([evidence_of(turned)]).reference)


def test_one_tick_on_the_herd_turns_as_its_own_kernel_says():
    """Against the formulas that fits of the herd go by, bodies that touch included."""
    clip, params = (evidence_of(tracks("herd")), TRUTHS["herd"].params.model_copy(update={"neighbour_range": 20.0}))
    vision = VisionSpec(range=8.0)
    turns = thinned(turns_of(clip, vision=vision, params=params, frames=range(0, 150, 10)), 300)
    turns = turns._replace(spin=np.zeros_like(turns.spin))  # whom it touches is not turned on there
    quiet = params.model_copy(update={"wander": 0.0})
    own = predicted(turns, theta_of(params), quiet)[0]
    found = NextSteps(turns).predicted(behaviours()["herd"], params)
    assert np.abs(own).std() > 0.01
    np.testing.assert_allclose(found, own, atol=1e-6)


def test_the_nearest_few_are_those_that_the_sight_keeps():
    rng = np.random.default_rng(2)
    xy, forward = rng.uniform(0, 9, (30, 2)), np.tile([1.0, 0.0], (30, 1))
    seen = perceive(xy, forward, vision=VisionSpec(range=20.0, occlusion=False, sight="topological", neighbours=5))
    far = np.hypot(*(xy[:, None] - xy[None]).transpose(2, 0, 1))
    for row in range(30):
        assert set(seen.near[seen.first[row] : seen.first[row + 1]]) == set(np.argsort(far[row])[1:6])


POND = Walls(
    np.array([(9, 3, 8, 5), (8, 5, 7, 3), (7, 3, 9, 3), (9, 0, 12, 0), (12, 0, 9, 0)], float),
    np.array([0, 0, 0, 1, 1], np.int32),
)


def test_walls_turn_animals_as_the_herds_own_kernel_says():
    """Against the formulas that fits of the herd go by, for animals that see others and two walls, and one or none."""
    rng = np.random.default_rng(8)
    params = TRUTHS["herd"].params.model_copy(update={"neighbour_range": 20.0, "wander": 0.0})
    angle = rng.uniform(-3, 3, 20)
    xy, forward = rng.uniform(0, 7, (20, 2)), np.column_stack([np.cos(angle), np.sin(angle)])
    percept = perceive(xy, forward, vision=VisionSpec(range=6.0), params=params, walls=POND)
    assert set(np.diff(percept.walls_first)) == {0, 1, 2}
    rows = np.arange(20)
    turns = Turns(percept, 2.0 * forward, np.zeros(20), rows, np.full(20, 4.5), np.zeros(20), np.ones(20), 0.3, 0.0)
    own, alone = predicted(turns, theta_of(params), params)[0], NextSteps(turns)
    np.testing.assert_allclose(alone.predicted(behaviours()["herd"], params), own, atol=1e-9)
    nobody = percept._replace(first=0 * percept.first, near=percept.near[:0], offset=percept.offset[:0])
    by_walls = predicted(turns._replace(percept=nobody), theta_of(params), params)[0]
    np.testing.assert_allclose(alone.alone(behaviours()["herd"], params), by_walls, atol=1e-9)
    assert np.abs(own - by_walls).max() > 0.01 and np.abs(by_walls).max() > 0.01


def test_what_flies_is_simulated_on_open_ground_only():
    start, brush = HerdStart(np.zeros((1, 2)), np.array([[1.0, 0.0]]), np.ones(1)), TRUTHS["boids"]
    for around in (Surroundings(POND), Surroundings(gates=object())):
        with pytest.raises(ValueError, match="model boids cannot be simulated among walls or in part"):
            rollout(start, brush.params, brush.speed, seconds=1.0, around=around)
    run = rollout(start, brush.params, brush.speed, seconds=1.0)
    assert run.xy[-1, 0] > 1.0


@pytest.mark.parametrize("name", ["morse", "zones"])
def test_a_model_that_multiplies_speeds_does_so_from_the_animals_own(name):
    brush, clip = TRUTHS[name], evidence_of(tracks(name))
    steps, seen = NextSteps(TurnBlocks([clip]).train(brush.vision)), speed_of([clip])
    own = speed_by(steps, brush.params, seen)
    assert own.mean == pytest.approx(brush.speed.mean, rel=0.03)
    assert own is seen if name == "zones" else seen.mean < 0.8 * brush.speed.mean and own.by_density == ()


def test_positions_and_parameters_are_inverse():
    for kind in likelihoods().values():
        x = np.linspace(0.1, 0.9, len(kind.numbers))
        params = kind.behaviour.Params().model_copy(update=read(kind.numbers, x))
        np.testing.assert_allclose(place(kind.numbers, params), x, atol=1e-12)


def test_numbers_of_zones_come_with_their_errors_and_make_a_brush(tmp_path):
    clip = evidence_of(tracks("zones")[:80, :20])
    learned = learned_model([clip], "zones", quick=True)
    told = {one.name: one for one in estimates_of(learned)}
    repulsion = told["repulsion"]
    assert repulsion.identifiable and repulsion.value == pytest.approx(1.0, abs=0.2) and 0 < repulsion.error < 0.2
    assert learned.params.wander > 0 and learned.theta.max() <= 1.0
    path = flockbrush.save_brush(brush_of("shoal", learned, [clip], seed=0), tmp_path)
    brush = flockbrush.load_brush(path)
    assert brush.model == "zones" and brush.params == learned.params and "repulsion" in brush.provenance.notes
    herd = flockbrush.plane(brush, 12, 0.5)
    herd.run(32)
    assert np.isfinite(herd.agents[Position.xyz]).all()


def test_what_cannot_be_learned_is_refused_in_a_sentence(tmp_path):
    assert {"boids", "force_map", "herd", "morse", "topological", "zones"} <= set(kinds_of_models())
    with pytest.raises(ProblemsError, match="no model 'zone' can be learned; did you mean 'zones'"):
        check_kind("zone")
    with pytest.raises(ProblemsError, match="no model 'v_rules' can be learned"):
        flockbrush.learn(np.zeros((10, 3, 2)), unit="m", fps=10, model="v_rules")
    clip = evidence_of(tracks("zones"))
    assert problem_of([clip]) == ""
    part = replace(clip, fields=replace(clip.fields, at_edge=np.full(len(clip.fields), 0.5)))
    assert problem_of([part]) == "" and kind_of("auto", [part]) == "auto" and kind_of("zones", [part]) == "zones"
    with pytest.raises(ProblemsError, match="animals of the model boids are simulated in whole herds only"):
        kind_of("boids", [part])
    clip.fields.obstacle[2, 3] = True
    assert problem_of([clip]) == "" and kind_of("auto", [clip]) == "auto" and kind_of("zones", [clip]) == "zones"
    with pytest.raises(ProblemsError, match="animals of the model boids are simulated on open ground only"):
        kind_of("boids", [clip])


def _search_little(monkeypatch, generations):
    monkeypatch.setattr(model_search, "GENERATIONS", (generations, generations))
    monkeypatch.setattr(model_fit, "CORRECTIONS", 1)
    monkeypatch.setattr(model_search, "SIZE", 4)
    monkeypatch.setattr(model_search, "SEEDS", 1)
    monkeypatch.setattr(model_search, "LAST_SEEDS", 1)
    monkeypatch.setattr(trials, "STAY", 3.0)
    monkeypatch.setattr(trials, "BEYOND", (2.0, 2.0))


def test_a_model_without_a_likelihood_is_fitted_by_simulation(monkeypatch):
    plain = behaviours()["zones"]
    monkeypatch.setitem(behaviour_module._registry, "plain", plain.__class__(**{**vars(plain), "name": "plain"}))
    _search_little(monkeypatch, 1)
    assert "plain" in kinds_of_models() and model_of(plain.Params()).name == "plain"
    found = learned_model([evidence_of(tracks("zones")[:48, :10])], "plain", seed=1)
    assert found.model == "plain" and set(found.names) >= {"repulsion", "orientation", "attraction"}
    assert not found.identifiable.any() and found.loss[-1] <= found.loss[0]


def test_a_model_that_comes_or_goes_is_known_at_once(monkeypatch):
    """As in a notebook, where the cell of a model is run again."""
    zones = behaviours()["zones"]
    assert model_of(zones.Params()) is zones
    again = type("Params", (zones.Params,), {})
    with monkeypatch.context() as patch:
        patch.setitem(behaviour_module._registry, "mine", replace(zones, name="mine", Params=again))
        assert model_of(again()).name == "mine"
    assert model_of(zones.Params()) is zones


def test_the_sentence_names_what_is_told_apart_and_what_is_not():
    params, vision = TRUTHS["zones"].params, VisionSpec(range=8.0)
    rows = [
        ModelRow("zones", "zones", vision, params, 1.5, 0.1),
        ModelRow("herd", "herd", vision, params, 1.49, 0.1, 0.01, 0.02, False),
        ModelRow("boids", "boids", vision, params, 1.2, 0.1, 0.3, 0.02, True),
    ]
    both = ModelComparison(rows, 1.0, 10)
    assert both.sentence == "Not distinguishable: zones and herd; behind them: boids by 0.30 ± 0.02 (nats)."
    alone = ModelComparison([rows[0], rows[2]], 1.0, 10)
    assert alone.sentence == (
        "The best model is zones (visible animals within 8 BL): log score of the next step above boids by 0.30 ± 0.02 "
        "(nats)."
    )
    assert len(table_of(alone).rows) == 2
    told = json.loads(json.dumps(as_json(both)))
    assert (told["chosen"], told["contenders"]) == ("herd", [])
    assert told["equal"] == ["zones", "herd"] and told["rows"][2]["told_apart"]
    page = ReportPage("a page")
    add_models(page, both)
    assert both.sentence in page.text() and "visible animals within 8 BL" in page.text()


def test_simulations_refine_a_fit_to_next_steps(monkeypatch):
    """Animals whose tracks are smoothed seem to turn more slowly than they may."""
    clip, found = evidence_of(tracks("zones")[:64, :16]), []
    vision, params = likeliest(likelihoods()["zones"], TurnBlocks([clip]), 0)
    slow = params.model_copy(update={"max_turn": 0.5 * params.max_turn})
    monkeypatch.setattr(model_fit, "likeliest", lambda *_: (vision, slow))
    for generations in (0, 3):
        _search_little(monkeypatch, generations)
        found.append(learned_model([clip], "zones"))
    fit, found = found
    assert found.starts[0].merit < fit.starts[0].merit
    assert len(found.loss) == 3 and "refined by simulated herds" in found.notes[0]
    assert found.params.repulsion == pytest.approx(fit.params.repulsion, abs=0.1)  # the turns say what it is


def test_how_much_animals_wander_is_found_by_herds_observed_as_their_tracks_are():
    """Noise hides it in a fit: herds of which it is known are smoothed alike."""
    brush = TRUTHS["morse"]
    brush = brush.model_copy(update={"params": brush.params.model_copy(update={"wander": 0.4})})
    clip = evidence_of(tracks_of(brush, 24)[:96], noise=0.03)
    kind, blocks = likelihoods()["morse"], TurnBlocks([clip])
    vision, fit = likeliest(kind, blocks, 0)
    given = ModelSetting.of_model([clip], fit, vision, {**kind.numbers, **kind.untold})
    trials.forget()
    found = answering(given, kind, fit.model_copy(update={"wander": 0.0}), 0)
    assert [one.wander for one in found] == pytest.approx([0.4] * len(found), abs=0.15)


def test_a_search_begins_with_the_best_of_its_beginnings(monkeypatch):
    clip, truth = evidence_of(tracks("morse")[:64]), TRUTHS["morse"].params
    _search_little(monkeypatch, 0)
    far = [truth.model_copy(update={"attraction": attraction, "wander": 2.0}) for attraction in (900.0, 1.0)]
    for given in ([truth, *far], [*far, truth]):
        monkeypatch.setattr(model_fit, "answering", lambda *_, given=given: given)
        found = learned_model([clip], "morse").params
        assert (found.attraction, found.wander) == pytest.approx((truth.attraction, truth.wander), rel=0.01)


def test_of_all_frames_the_best_of_what_came_of_parts_is_kept(monkeypatch):
    clip, truth = evidence_of(tracks("morse")[:48, :10]), TRUTHS["morse"].params
    _search_little(monkeypatch, 1)
    fit = likeliest(likelihoods()["morse"], TurnBlocks([clip]), 0)
    monkeypatch.setattr(model_fit, "likeliest", lambda *_: fit)  # the same each time
    monkeypatch.setattr(model_fit, "answering", lambda given, kind, params, seed: [params])
    monkeypatch.setattr(model_search, "_evolved", lambda *_: pytest.fail("a new search"))
    false = truth.model_copy(update={"attraction": 900.0, "repulsion": 0.1, "wander": 2.0})
    for parts in ([truth, false], [false, truth]):
        found = learned_model([clip], "morse", parts=parts)
        assert found.params.wander < 0.5 * false.wander and "refined by simulated herds" in found.notes[0]
    assert learned_model([clip], "morse", parts=[truth]).starts[0].merit >= found.starts[0].merit


def test_what_turns_do_not_tell_is_found_by_simulated_herds(monkeypatch):
    truth = TRUTHS["morse"].params.model_copy(update={"propulsion": 0.1})  # a fifth of what a search begins with
    clip = evidence_of(tracks_of(TRUTHS["morse"].model_copy(update={"params": truth}), 24)[:64, :16])
    _search_little(monkeypatch, 2)
    found = learned_model([clip], "morse")
    assert found.params.propulsion < 0.3 and "propulsion" not in found.names
    brush = brush_of("ring", found, [clip], seed=0)
    assert brush.model == "morse" and brush.params == found.params


def test_a_first_generation_leaves_the_next_steps_as_likely():
    numbers, step = ["repulsion", "max_turn", "wander"], 0.1
    shape = first_shape(numbers, np.diag([1e6, 1e6]), np.zeros((2, 2)), step) * step**2
    width = np.sqrt(np.diag(shape))
    assert width[0] < 1e-3 and width[1] == pytest.approx(0.04) and width[2] == pytest.approx(0.04)


def test_a_map_is_smooth_where_turns_tell_little():
    clip, truth = evidence_of(tracks("force_map")[:40, :12]), TRUTHS["force_map"].params
    turns = TurnBlocks([clip]).train(VisionSpec(range=16.0, occlusion=False, sight="metric"))
    found = [
        searched(turns, behaviours()["force_map"], force_map.NUMBERS, force_map.Params(), 0, None, prior)
        for prior in (None, force_map.unevenness)
    ]
    plain, smooth = (np.abs(place(force_map.NUMBERS, one) - place(force_map.NUMBERS, truth)).mean() for one in found)
    assert smooth < 0.75 * plain
    values, d = dict.fromkeys(force_map.NUMBERS, 1.0) | {"front_attraction": 0.0, "front_alignment": 0.0}, 12
    assert not force_map.unevenness(values).any()  # of level maps nothing is said
    pull, precision = tension(force_map.unevenness, force_map.NUMBERS, np.full(d, 0.3))
    bump = np.eye(d)[2] * 0.01
    there = tension(force_map.unevenness, force_map.NUMBERS, np.full(d, 0.3) + bump)[0]
    np.testing.assert_allclose(there - pull, -precision @ bump, atol=1e-6)


def test_nothing_is_compared_where_no_kind_can_be_learned(monkeypatch):
    monkeypatch.setattr(which_model, "problem_of", lambda *_: "it shows a part of a herd")
    found = compare_models([evidence_of(tracks("zones")[:48, :10])])
    assert found.rows == [] and found.contenders == [] and found.reason == "it shows a part of a herd"
    assert found.sentence == "The models cannot be distinguished on this clip: it shows a part of a herd."


def test_general_models_contend_where_they_may_be_the_best():
    vision, base = VisionSpec(range=8.0), 0.001 * np.arange(8)
    rows = [ModelRow(name, name, vision, None, 0.0, 0.1, blocks=base) for name in ("herd", "force_map")]
    found = ModelComparison(rows, 0.5, 8)
    assert found.contenders == ["force_map"] and not found.likelier and found.learned == "herd"
    assert "force_map are farther" in found.decision
    found.learned = "force_map"
    assert found.decision == "Learned: force_map, whose simulated herds are nearer to the clip."
    rows[1].told_apart, rows[1].behind = True, 0.1
    assert found.contenders == ["force_map"]
    rows[1].behind = 0.2
    assert not found.contenders and "no other model" in ModelComparison(rows, 0.5, 8).decision
    rows[1].behind, found.reason = 0.0, "the headings of the animals are too noisy"
    assert not found.contenders


def test_of_several_kinds_the_nearest_is_kept():
    def learned(kind, score, staying=0.0):
        return SimpleNamespace(kind=kind, chosen=0, starts=[Attempt(kind, 0, X, X, score=score, staying=staying)])

    herd = learned("herd", 1.0)
    assert nearest([herd]) is herd and hopeless(herd) == 1.3
    assert nearest([herd, learned("boids", 0.95), learned("zones", 0.9)]).kind == "zones"
    assert nearest([herd, learned("zones", 1.05)], ["zones"]).kind == "zones"  # its turns are likelier
    assert nearest([herd, learned("zones", 1.05)]) is herd
    assert nearest([herd, learned("zones", 1.15)], ["zones"]) is herd
    assert nearest([herd, learned("zones", np.inf, np.nan)], ["zones"]) is herd  # it was stopped, or not refined


def test_a_hopeless_search_ends(monkeypatch):
    _search_little(monkeypatch, 3)
    monkeypatch.setattr(model_search, "PATIENCE", 1)
    clip = evidence_of(tracks("zones")[:48, :10])
    assert not len(learned_model([clip], "zones", hopeless=1e-3).loss)


def test_auto_learns_the_herd_where_others_cannot_be_learned():
    clip = evidence_of(tracks("zones")[:48, :10])
    assert kind_of("auto", [clip], photo=True) == "herd"
    with pytest.raises(ProblemsError, match="it is one picture, .*: leave out --model zones"):
        kind_of("zones", [clip], photo=True)
    assert [kind_of(name, [clip]) for name in ("auto", "herd", "zones")] == ["auto", "herd", "zones"]


def test_the_confusion_table_counts_what_was_said():
    rows = [
        {"truth": "zones", "kind": "zones", "equal": ["zones"], "best": "zones"},
        {"truth": "zones", "kind": "zones", "equal": ["herd", "zones"], "best": "herd"},
        {"truth": "zones", "kind": "zones", "equal": ["boids"], "best": "boids"},
    ]
    assert confusion_of(rows).splitlines()[-1] == "| zones | 1 of 3 | 1 | 1 | zones 1, herd 1 |"

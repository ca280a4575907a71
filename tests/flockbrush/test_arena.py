"""The wall of a tank around tracked animals: found or given, solid, and turned away from as its animals do."""

import dataclasses
import functools
import itertools

import numpy as np
import pytest
from flockbrush.behaviours.brush import SpeedSpec, shipped
from flockbrush.behaviours.models.herd import Params
from flockbrush.behaviours.models.zones import Params as ZonesParams
from flockbrush.engine.problems import ProblemsError

import flockbrush
from flockbrush.cli.main import called
from flockbrush.film.arena import Arena, ring
from flockbrush.film.looking import Looking
from flockbrush.film.open_clip import look_at, looked_apart
from flockbrush.film.track_files import read_trajectories
from flockbrush.learning import trials
from flockbrush.learning.group_size_test import with_other_numbers
from flockbrush.learning.initial_conditions import body_of, resized_among, start_of
from flockbrush.learning.recipe import _signature, learn
from flockbrush.learning.rollout import VISION, HerdStart, Surroundings, Walls, rollout, theta_of
from flockbrush.learning.side_by_side import ComparisonGround
from flockbrush.learning.trials import SearchSettings, Setting, simulate
from flockbrush.learning.turns import fit_turns, likelihood, predicted, turns_of
from flockbrush.learning.verdict import alone
from flockbrush.learning.which_model import compare_models

RADIUS, FPS = 8.0, 16.0
PARAMS = Params(alignment_weight=0.05, obstacle_weight=0.4, wander=0.3, neighbour_range=4.0, leader_neighbours=-1)
SPEED = SpeedSpec(mean=3.0, deviation=0.3, reversion=1.0)
TANK = Arena("circle", (20.0, 10.0, RADIUS))


@functools.cache
def swimming():
    """(T, N, 2) m of two dozen animals, 1 m long, in a round tank."""
    rng = np.random.default_rng(4)
    place = (20.0, 10.0) + rng.uniform(-4, 4, (24, 2))
    angle = rng.uniform(-np.pi, np.pi, 24)
    start = HerdStart(place, np.column_stack([np.cos(angle), np.sin(angle)]), np.full(24, 3.0))
    edges = ring(TANK.corners, (5.0, -5.0), (35.0, 25.0))
    around = Surroundings(Walls(edges[:, :4].copy(), edges[:, 4].astype(np.int32)))
    run = rollout(start, PARAMS, SPEED, seconds=12.0, fps=FPS, seed=2, around=around)
    return run.xy.reshape(len(run), 24, 2)


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    path = tmp_path_factory.mktemp("tank") / "fish.npy"
    np.save(path, swimming())
    return path


def seen_in(path, arena=None, **how):
    arena = Arena.read(arena) if isinstance(arena, str) else arena
    return look_at(path, Looking(unit="m", fps=FPS, body_length_m=1.0, arena=arena, **how), quiet=True)


@pytest.mark.parametrize(
    "text",
    ["", "square", "circle:", "circle:1,2", "circle:1,2,0", "circle:1,2,nan", "circle:0,0,1e13", "circle:a,b,c",
     "rectangle:1,2,3", "rectangle:1,2,1,5", "rectangle:1,2,inf,5"],
)  # fmt: skip
def test_what_is_no_arena_is_refused_and_what_would_be_right_is_said(text, file, tmp_path, capsys):
    with pytest.raises(ValueError, match=r"must be circle, rectangle, circle:X,Y,R or|has no inside"):
        Arena.read(text)
    out = tmp_path / "x.brush.toml"
    assert called(["learn", str(file), "--unit", "m", "--fps", "16", "--arena", text, "--out", str(out)]) == 2
    assert "--arena" in capsys.readouterr().err and not out.exists()


def test_only_tracks_have_one(tmp_path):
    (tmp_path / "clip.mp4").write_bytes(b"")
    with pytest.raises(ProblemsError, match="--arena can only be used with tracks"):
        look_at(tmp_path / "clip.mp4", Looking(arena=TANK))


def test_a_video_has_no_body_length_in_metres_that_would_do_nothing(tmp_path, capsys):
    (tmp_path / "clip.mp4").write_bytes(b"")
    for command in (["fields"], ["reenact", "--brush", "march"]):
        out = ["--out", str(tmp_path / "f.npz")] if command == ["fields"] else []
        assert called([*command, str(tmp_path / "clip.mp4"), "--body-length-m", "1", *out]) == 1
        told = "is a video or picture: --unit, --fps, --body-length-m and --arena can only be used with tracks"
        assert told in " ".join(capsys.readouterr().err.split())


def test_an_arena_that_is_found_is_the_smallest_that_holds_all(file):
    everyone = swimming().reshape(-1, 2)
    x, y, radius = Arena("circle").around(_tracks(file), 0.2).numbers
    far = np.hypot(*(everyone - (x, y)).T)
    assert far.max() == pytest.approx(radius - 0.2)
    assert sum(far > far.max() - 1e-4) >= 2  # it leans on some
    for angle in np.linspace(0, 2 * np.pi, 24):  # and is not smaller about another middle
        near = (x, y) + 0.05 * np.array([np.cos(angle), np.sin(angle)])
        assert np.hypot(*(everyone - near).T).max() > far.max() - 1e-6
    box = np.reshape(Arena("rectangle").around(_tracks(file), 0.2).numbers, (2, 2))
    np.testing.assert_allclose(box, [everyone.min(0) - 0.2, everyone.max(0) + 0.2])


def _tracks(path):
    return read_trajectories(path, "m", FPS)


def test_a_wall_stays_where_it_is_in_all_parts_of_a_file(file):
    whole, part = seen_in(file, "circle"), seen_in(file, "circle", frames=(0, 40))
    told = [note for note in whole.notes if note.startswith("the arena is a circle of radius")]
    assert told and told[0] in part.notes
    how = Looking(unit="m", fps=FPS, body_length_m=1.0, arena=Arena("circle"))
    for training, held in looked_apart(file, how, whole, 0.5, rotate=True):
        assert told[0] in training.notes and told[0] in held.notes


@pytest.mark.parametrize("text", ["circle", "rectangle", "circle:20,10,8.3", "rectangle:11,1.5,29,18.5"])
def test_pixels_that_point_down_make_no_difference(text, file, tmp_path):
    np.save(tmp_path / "px.npy", swimming() * (50.0, 50.0))
    np.save(tmp_path / "up.npy", swimming() * (1.0, -1.0))
    shape, colon, rest = text.partition(":")
    numbers = [float(word) for word in rest.split(",")] if colon else []
    flipped = [n * (-1 if k in ((1,) if shape == "circle" else (1, 3)) else 1) for k, n in enumerate(numbers)]
    in_pixels = Looking(unit="px", fps=FPS, body_length_px=50.0, arena=Arena(shape, tuple(50.0 * n for n in numbers)))
    one = look_at(tmp_path / "px.npy", in_pixels)
    other = seen_in(tmp_path / "up.npy", Arena(shape, tuple(flipped)))
    np.testing.assert_allclose(one.fields.outline, other.fields.outline, atol=1e-3)
    assert np.array_equal(one.fields.obstacle, other.fields.obstacle)


@pytest.fixture
def trex(tmp_path):
    """The same in a folder of TRex: cm, y down."""
    for n, xy in enumerate(swimming().swapaxes(0, 1)):
        columns = {"X#wcentroid": 100 * xy[:, 0], "Y#wcentroid": 100 * xy[:, 1]}
        np.savez(tmp_path / f"fish{n}.npz", **columns, frame=np.arange(len(xy)), frame_rate=np.array([FPS]))
    return tmp_path


def test_numbers_are_in_the_unit_and_with_the_axes_of_the_file(file, trex):
    how = Looking(body_length_m=1.0)
    found = look_at(trex, dataclasses.replace(how, arena=Arena("circle")))
    up = Arena("circle").around(_tracks(file), 0.2).numbers
    x, y, radius = Arena("circle").around(read_trajectories(trex), 0.2).numbers
    assert (x, y, radius) == pytest.approx([100 * n for n in up], rel=1e-6)
    assert f"the arena is a circle of radius {radius:.4g} cm about ({x:.4g}, {y:.4g})" in found.notes
    given = look_at(trex, dataclasses.replace(how, arena=Arena("circle", (x, y, radius))))
    np.testing.assert_allclose(given.fields.outline, found.fields.outline)
    with pytest.raises(ProblemsError, match=r"is \d+ cm outside the arena in frame \d+: .* 400 cm about \(2000,"):
        look_at(trex, dataclasses.replace(how, arena=Arena("circle", (2000.0, 1000.0, 400.0))))


def test_simulations_are_written_in_the_unit_and_with_the_axes_of_the_file(trex, tmp_path):
    out = tmp_path / "again.csv"
    command = ["reenact", str(trex), "--brush", "swarm", "--runs", "1", "--frames", "0:16"]
    assert called([*command, "--export", str(out)]) == 0
    rows = np.genfromtxt(out, delimiter=",", names=True)
    begin = np.column_stack([rows["x_cm"], rows["y_cm"]])[rows["frame"] == 0]
    np.testing.assert_allclose(np.sort(begin, 0), np.sort(100 * swimming()[0], 0), atol=5.0)


def test_an_animal_outside_is_named(file, tmp_path):
    xy = swimming().copy()
    xy[30:60, 5] += (30.0, 0.0)
    np.save(tmp_path / "out.npy", xy)
    with pytest.raises(ProblemsError, match=r"animal 5 is .* m outside the arena in frame \d\d: the arena is a circle"):
        seen_in(tmp_path / "out.npy", TANK)


def test_animals_are_kept_in_it_and_seen_to_be_where_they_are(file):
    evidence = seen_in(file, TANK)
    fields = evidence.fields
    assert fields.enclosed and not seen_in(file).fields.enclosed
    assert fields.holds_all and 0.2 < fields.obstacle.mean() < 0.8
    assert np.nan_to_num(fields.density)[:, fields.obstacle].sum() < 0.02 * np.nan_to_num(fields.density).sum()
    for clip, held in ((evidence, True), (seen_in(file), False)):
        run = simulate(clip, PARAMS, SPEED, body_of([evidence]), VISION, 3, seconds=15.0)
        far = np.hypot(*(run.xy - (20.0, 10.0)).T)
        assert (far.max() < RADIUS) == held, far.max()
        assert held or far.max() > 2 * RADIUS


def test_pictures_show_all_of_it_wherever_its_animals_are(tmp_path):
    np.save(tmp_path / "few.npy", swimming()[:20, :3] * 0.2 + (20.0, 10.0))
    ground = ComparisonGround(seen_in(tmp_path / "few.npy", "circle:24,12,20"), shipped().get("march"))
    assert (ground.low <= (4.0, -8.0)).all() and (ground.high >= (44.0, 32.0)).all()


def test_turns_from_the_wall_are_told_from_turns_with_neighbours(file):
    """With the wall the true numbers foretell turns better than without it, and the wall's own are learned."""
    theta, told = theta_of(PARAMS), {}
    for arena in (None, TANK):
        turns = turns_of(seen_in(file, arena), params=PARAMS)
        told[arena] = likelihood(turns, predicted(turns, theta, PARAMS))
    assert told[TANK] > told[None] + 0.2
    turns = turns_of(seen_in(file, TANK), params=PARAMS)
    begin = theta.copy()
    begin[9:12] = 0.1, 0.5, 0.9
    fit = fit_turns(turns, begin, PARAMS)
    assert fit.theta[9] == pytest.approx(PARAMS.obstacle_weight, rel=0.35) and np.isfinite(fit.deviation[9])


def test_how_strongly_animals_turn_from_the_wall_is_learned(file, monkeypatch):
    monkeypatch.setattr(trials, "BEYOND", (2.0, 2.0))  # in this test alone: others leave herds alone for long
    few = SearchSettings(starts=3, quick=True, budget_s=2.0, brushes=False)
    found = learn(seen_in(file, TANK), few)
    strength = found.params.obstacle_weight * found.params.sensitivity
    assert found.identifiable[9] and 0.5 < strength / (PARAMS.obstacle_weight * PARAMS.sensitivity) < 3.0


def test_work_that_was_kept_is_not_taken_up_in_another_arena(file):
    """A circle and the square about it have the same fields."""
    circle, square = seen_in(file, TANK), seen_in(file, Arena("rectangle", (12.0, 2.0, 28.0, 18.0)))
    np.testing.assert_allclose(circle.fields.density, square.fields.density)
    settings = SearchSettings()
    kept = {_signature((clip,), Setting.of((clip,), settings), settings) for clip in (circle, square)}
    assert len(kept) == 2


def test_a_ring_has_two_closed_lines():
    edges = ring(Arena("rectangle", (1.0, 1.0, 0.0, 0.0)).corners, (-1.0, -1.0), (2.0, 2.0))
    for line in (edges[:4], edges[4:]):
        for one, other in itertools.pairwise([*line, line[0]]):
            np.testing.assert_array_equal(one[2:4], other[:2])
    area = [0.5 * np.sum(line[:, 0] * line[:, 3] - line[:, 2] * line[:, 1]) for line in (edges[:4], edges[4:])]
    assert area == pytest.approx([9.0, -1.0])  # the hole runs the other way round


def test_a_herd_that_is_left_alone_stays_in_its_arena(file):
    for clip, held in ((seen_in(file, TANK), True), (seen_in(file), False)):
        run = alone(clip, brush_in(), seed=2)
        assert (np.hypot(*(run.xy - (20.0, 10.0)).T).max() < RADIUS) == held


@pytest.mark.parametrize("factor", [0.25, 4.0])
def test_an_arena_grows_with_the_herd_and_holds_it(factor, file):
    evidence = seen_in(file, TANK)
    start = start_of(evidence)
    herd, around = resized_among(start, Walls.of(evidence.fields), factor, 1)
    assert len(herd) == round(24 * factor) and around.walls is not None
    inner = around.walls.ends[4:, :2]
    middle = start.xy.mean(0) + np.sqrt(factor) * ((20.0, 10.0) - start.xy.mean(0))
    np.testing.assert_allclose(np.hypot(*(inner - middle).T).min(), np.sqrt(factor) * RADIUS, rtol=0.01)
    run = rollout(herd, PARAMS, SPEED, seconds=10.0, fps=2.0, seed=1, around=around)
    assert np.hypot(*(run.xy - middle).T).max() < np.sqrt(factor) * RADIUS
    row = with_other_numbers(brush_in(), start, 0, evidence.fields, [factor], 10.0)[0]
    free = with_other_numbers(brush_in(), start, 0, None, [factor], 10.0)[0]
    assert row["spacing"] < 0.7 * free["spacing"]  # in the open they part


ZONES = ZonesParams(repulsion=1.0, orientation=4.0, attraction=6.0, blind_angle=60.0, max_turn=3.0, wander=0.0)


def test_zones_are_told_from_other_models_in_an_arena(tmp_path):
    """Tracks of a herd in zones, whose radius of repulsion is how far it keeps from the wall, too."""
    rng = np.random.default_rng(3)
    angle = rng.uniform(-np.pi, np.pi, 24)
    start = HerdStart(rng.uniform(-4, 4, (24, 2)), np.column_stack([np.cos(angle), np.sin(angle)]), np.full(24, 2.0))
    edges = ring(Arena("circle", (0.0, 0.0, RADIUS)).corners, (-15.0, -15.0), (15.0, 15.0))
    around = Surroundings(Walls(edges[:, :4].copy(), edges[:, 4].astype(np.int32)))
    speed = SpeedSpec(mean=2.0, deviation=0.2, reversion=1.0)
    run = rollout(start, ZONES, speed, vision=VISION, seconds=10.0, fps=FPS, seed=2, around=around)
    xy = run.xy.reshape(len(run), 24, 2)
    far = np.hypot(*xy.transpose(2, 0, 1))
    assert far.max() < RADIUS and (far > RADIUS - 1.0).any(1).mean() > 0.5  # often at the wall, never beyond
    np.save(tmp_path / "fish.npy", xy)
    seen = seen_in(tmp_path / "fish.npy", Arena("circle", (0.0, 0.0, RADIUS)))
    found = compare_models([seen])
    assert {row.name for row in found.rows} == {"zones", "herd", "topological", "morse", "force_map"}
    assert found.rows[0].name == "zones" and set(found.equal) <= {"zones", "force_map"}
    assert found.rows[0].params.repulsion == pytest.approx(1.0, abs=0.15)
    fits = {row.name: row.params for row in found.rows}
    assert not np.allclose(theta_of(fits["topological"])[9:], theta_of(Params())[9:])  # what turns from the wall tell
    assert fits["force_map"].obstacle_repulsion != type(fits["force_map"])().obstacle_repulsion
    brush = flockbrush.shipped().get("march").model_copy(update={"model": "zones", "params": ZONES, "speed": speed})
    assert np.hypot(*alone(seen, brush, seed=2).xy.T).max() < RADIUS


def brush_in():
    return flockbrush.shipped().get("march").model_copy(update={"params": PARAMS, "speed": SPEED})

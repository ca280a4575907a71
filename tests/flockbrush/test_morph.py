"""Paths between brushes: even steps, sweeps both ways, files that paint follows."""

import re

import numpy as np
import pytest
from flockbrush.behaviours.brush import BrushLibrary, shipped
from flockbrush.behaviours.mixture import STEPS, BrushPath, load_path, mixed, path_between, path_to_toml
from flockbrush.engine.problems import ProblemsError

from benchmarks.morphs import brushes_of, errors_from_monotonic, judged, shipped_paths
from flockbrush.studies import morph as morph_study
from flockbrush.studies.morph import (
    BEGINNINGS,
    MOST_STEP,
    RESOLUTION,
    Branches,
    Measured,
    Response,
    Route,
    Trial,
    brush_at,
    detours,
    faults,
    measured,
    response,
    sweep,
    trials_of,
    verdict,
)


def ways(polarization, milling=None, deviation=0.01):
    mean = np.column_stack([polarization, np.zeros(len(polarization)) if milling is None else milling])
    return Measured(mean, np.full(mean.shape, deviation), 3)


def step_like(points, at=0.1, width=0.01):
    """Means that go from 0 to 1 at a place, and none of milling."""
    points = np.asarray(points)
    return np.column_stack([1 / (1 + np.exp(np.clip(-(points - at) / width, -500, 500))), 0 * points])


def test_errors_from_monotonic_are_those_of_the_best_monotonic_curve():
    """The least number of errors for which the highest of the lower ends so far is never above an upper end."""
    rng, steps = np.random.default_rng(4), np.linspace(0.0, 9.0, 9001)
    for _ in range(20):
        found = Measured(np.cumsum(rng.normal(0.1, 0.3, (8, 2)), axis=0), rng.uniform(0.2, 1.0, (8, 2)), 9)
        for column, told in enumerate(errors_from_monotonic(found)):
            mean, error = found.mean[:, column], found.deviation[:, column] / 3.0
            mean = mean if mean[-1] >= mean[0] else -mean
            low, high = mean[:, None] - steps * error[:, None], mean[:, None] + steps * error[:, None]
            fits = (np.maximum.accumulate(low, axis=0) <= high).all(0)
            assert told == pytest.approx(steps[fits.argmax()], abs=0.0011)
    assert errors_from_monotonic(ways([0.0, 0.5, 1.0])).tolist() == [0.0, 0.0]
    assert errors_from_monotonic(ways([0.0, 0.5, 0.4, 1.0], deviation=0.0))[0] == np.inf


def test_where_behaviour_jumps_steps_are_short():
    points = np.linspace(0, 1, 101)
    seen = Response(points, step_like(points))
    along = seen.evenly(8)
    reached = np.interp(along, points, step_like(points)[:, 0])
    assert np.abs(np.diff(reached)).max() < 0.16 and along[0] == 0.0 and along[-1] == 1.0
    assert (np.diff(along) > 0).all() and seen.jumps() == ()


def test_where_nothing_changes_steps_are_even():
    points = np.linspace(0, 1, 5)
    np.testing.assert_allclose(Response(points, np.zeros((5, 2))).evenly(4), points)


def test_herds_are_measured_between_points_that_differ_until_none_does(monkeypatch):
    """However narrow the change is, at a place where no point of the first round lies."""
    asked = []

    def told(at, points, trial, seed):
        asked.extend(points)
        return ways(step_like(points, 0.0437, 0.001)[:, 0])

    monkeypatch.setattr(morph_study, "measured", told)
    seen = response(None, [Trial()])
    assert seen.jumps() == () and len(asked) < 40
    along = seen.evenly(8)
    assert np.abs(np.diff(step_like(along, 0.0437, 0.001)[:, 0])).max() < MOST_STEP


def test_what_changes_within_the_resolution_is_a_jump(monkeypatch):
    monkeypatch.setattr(morph_study, "measured", lambda at, points, trial, seed: ways(np.asarray(points) > 0.3))
    ((where, size),) = response(None, [Trial()]).jumps()
    assert where == pytest.approx(0.3, abs=RESOLUTION) and size == 1.0


def test_steps_are_short_where_herds_of_either_size_change(monkeypatch):
    """Small herds change at .3 of the way, large ones at .6: no step is large for either."""
    at = {100: 0.3, 400: 0.6}

    def told(brush_at, points, trial, seed):
        return ways(step_like(points, at[trial.animals], 0.02)[:, 0])

    monkeypatch.setattr(morph_study, "measured", told)
    along = response(None, trials_of([400, 100], 4)).evenly(16)
    for place in at.values():
        assert np.abs(np.diff(step_like(along, place, 0.02)[:, 0])).max() < MOST_STEP


def test_of_larger_herds_fewer_are_measured_but_two():
    found = trials_of([1600, 100, 400, 100], 12, steps=5)
    assert [(trial.animals, trial.seeds, trial.steps) for trial in found] == [(100, 12, 5), (400, 3, 5), (1600, 2, 5)]


def test_steps_leave_out_what_lies_below_both_ends_next_to_one():
    """Noise first takes from a herd the order it had: no step lies where it has less than at the start."""
    points = np.linspace(0, 1, 21)
    order = np.interp(points, [0, 0.05, 0.4, 0.6, 1], [0.3, 0.1, 0.1, 0.9, 1.0])
    seen = Response(points, np.column_stack([order, 0 * order]))
    for way in (seen.evenly(8), 1.0 - Response(points, seen.means[::-1]).evenly(8)[::-1]):
        reached = np.interp(way[1:], points, order)
        assert way[0] == 0.0 and (np.diff(reached) >= 0).all() and 0.25 < reached[0] < 0.45


def test_points_measured_twice_count_twice_and_what_goes_back_is_levelled():
    seen = Response([0, 0.5, 1], [[0, 0], [0.4, 0], [1, 0]])
    seen.add([0.5, 0.75], [[0.6, 0], [0.2, 0]])
    points, means = seen.one_way()
    np.testing.assert_allclose(points, [0, 0.5, 0.75, 1])
    np.testing.assert_allclose(means[:, 0], [0, 0.4, 0.4, 1])  # (0.4 + 0.6 + 0.2) / 3


@pytest.mark.parametrize(
    ("found", "said"),
    [
        (ways(np.linspace(0.1, 0.9, 9)), []),
        (ways(np.linspace(0.9, 0.1, 9)), []),
        (ways([0.1, 0.2, 0.9]), ["polarization changes by 0.70 in one step"]),
        (ways([0.1, 0.24, 0.1, 0.23, 0.3]), ["polarization goes back by 0.14"]),
        (ways([0.1, 0.24, 0.18, 0.12, 0.2]), ["polarization goes back by 0.12"]),  # in two steps
        (ways([0.1, 0.24, 0.18, 0.2]), []),  # within two standard errors of .03
        (
            ways([0.1, 0.1], deviation=0.3),
            ["polarization deviates by 0.30 between seeds", "milling deviates by 0.30 between seeds"],
        ),
    ],
)
def test_what_keeps_a_way_from_being_even_is_named(found, said):
    assert faults(found) == said


def test_added_noise_is_nothing_at_the_ends_and_whole_from_the_first_eighth_to_the_last():
    graze, march, noisy = shipped().get("graze"), shipped().get("march"), Route(0.8)
    wander = [brush_at(graze, march, way, noisy).params.wander for way in (0.0, 1 / 16, 1 / 8, 0.5, 7 / 8, 1.0)]
    assert wander == pytest.approx([0.0, 0.4, 0.8, 0.8, 0.8, 0.0])  # both brushes have none


def test_added_noise_stays_within_its_bounds():
    ends = shipped().get("mill-filled"), shipped().get("swarm")
    assert max(brush.params.wander for brush in ends) > 0.5
    assert brush_at(*ends, 0.5, Route(9.9)).params.wander == 10.0


def test_what_differs_more_than_tenfold_goes_by_ratio_and_the_rest_straight():
    graze, march = shipped().get("graze"), shipped().get("march")  # alignment .015 and .499, cohesion .08 and .505
    third, straight = brush_at(graze, march, 1 / 3).params, mixed(graze, march, 1 / 3).params
    assert third.alignment_weight**3 == pytest.approx(0.015**2 * 0.499)
    assert third.cohesion_weight == straight.cohesion_weight == pytest.approx(0.08 + 0.425 / 3)
    for end, way in ((graze, 0.0), (march, 1.0)):
        assert brush_at(graze, march, way, Route(2.0, ("alignment",))).params == end.params
    assert set(detours(graze, march, [0.0, 0.5, 1.0])) == {"alignment_weight"}


def test_what_changes_first_is_done_half_way_where_the_rest_begins():
    swarm, march, route = shipped().get("swarm"), shipped().get("march"), Route(0.0, ("alignment", "cohesion_w"))
    middle = brush_at(swarm, march, 0.5, route)
    for name in ("alignment_weight", "alignment_radial", "alignment_angular", "cohesion_weight"):
        assert getattr(middle.params, name) == pytest.approx(getattr(march.params, name))
    for name in ("avoidance_weight", "cohesion_angular", "neighbour_range"):
        assert getattr(middle.params, name) == getattr(swarm.params, name)
    assert middle.speed == swarm.speed
    quarter, later = (brush_at(swarm, march, way, route) for way in (0.25, 0.75))
    assert quarter.params.alignment_weight == pytest.approx(np.sqrt(0.001 * 0.499))  # by ratio
    assert quarter.params.alignment_radial == pytest.approx(0.5 * (0.313 + 1.0))
    assert later.speed.mean == pytest.approx(0.5 * (1.28 + 4.0))


def test_herds_begin_as_the_trial_says():
    swarm = shipped().get("swarm")
    heedless = swarm.model_copy(update={"params": swarm.params.model_copy(update={"sensitivity": 0.0})})
    found = {
        begin: measured(lambda along: heedless, [0.0, 1.0], Trial(100, 1, seconds=0.1, begin=begin)).mean[0]
        for begin in BEGINNINGS
    }
    assert found["aligned"][0] > 0.9 > 0.4 > max(found["random"][0], found["mill"][0])
    assert found["mill"][1] > 0.9 > 0.4 > max(found["random"][1], found["aligned"][1])


def branches(there, back, deviation=0.02):
    return Branches(ways(there, deviation=deviation), ways(back, deviation=deviation))


def test_branches_that_differ_at_one_step_are_hysteresis_and_are_named():
    swept = branches([1.0, 0.99, 0.9, 0.1], [1.0, 0.7, 0.1, 0.1])
    assert swept.hysteresis and swept.widest() == pytest.approx((2, 0, 0.8, 0.02 * np.sqrt(2 / 3)))
    assert verdict(swept) == (
        "bistable: at 2/3 polarization is 0.90 there and 0.10 back (standard error 0.02); "
        "largest step there 0.80 between 2/3 and 3/3, back 0.60 between 1/3 and 2/3"
    )


@pytest.mark.parametrize("swept", [
    branches([1.0, 0.5, 0.1], [1.0, 0.4, 0.1]),  # too little apart
    branches([1.0, 0.8, 0.1], [1.0, 0.4, 0.1], deviation=0.4),  # within two standard errors
    branches([1.0, 0.4, 0.1], [0.2, 0.4, 0.9]),  # the ends are no steps of the way
])  # fmt: skip
def test_without_two_branches_there_is_no_hysteresis(swept):
    assert not swept.hysteresis and verdict(swept).startswith("no hysteresis: at 1/2 polarization is")


def test_herds_are_measured_and_swept_the_same_again():
    swarm, march = shipped().get("swarm"), shipped().get("march")
    trial = Trial(animals=20, seeds=2, seconds=3.0)

    def at(along):
        return brush_at(swarm, march, along)

    one, two = (measured(at, [0.0, 1.0], trial) for _ in "ab")
    np.testing.assert_array_equal(one.mean, two.mean)
    assert one.mean[1, 0] > one.mean[0, 0] + 0.2  # a march is more polarized than a swarm
    there, back = sweep(at, [0.0, 1.0], Trial(animals=20, seeds=2, seconds=10.0), 1)
    assert there.mean.shape == back.deviation.shape == (2, 2) and there.seeds == 2
    assert there.mean[1, 0] > there.mean[0, 0]


def test_swept_herds_stay_at_each_step_as_long_as_new_herds_run(monkeypatch):
    made, ticks = morph_study.herds_apart, []

    def counted(*arguments, **named):
        simulation = made(*arguments, **named)
        run = simulation.run
        monkeypatch.setattr(simulation, "run", lambda count: (ticks.append(count), run(count)))
        return simulation

    monkeypatch.setattr(morph_study, "herds_apart", counted)
    swarm, march = shipped().get("swarm"), shipped().get("march")
    trial = Trial(animals=5, seeds=1, seconds=3.0)
    measured(lambda along: brush_at(swarm, march, along), [0.0, 1.0], trial)
    fresh = list(ticks)
    ticks.clear()
    sweep(lambda along: brush_at(swarm, march, along), [0.0, 1.0], trial, 1)
    assert sum(fresh) == 3 * 32 and ticks == 4 * fresh


def test_the_command_writes_a_path_that_a_library_finds(cli, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    options = "--animals 6 --animals 12 --seeds 2 --steps 2 --seconds 1 --begin aligned --wander 0.5 --first alignment"
    done = cli("brush", "morph", "swarm", "march", *options.split())
    assert done.code == 0, done.err
    assert "6 animals, 2 seeds" in done.out and "12 animals, 2 seeds" in done.out
    assert "wrote swarm--march.path.toml" in done.out
    file = tmp_path / "swarm--march.path.toml"
    path = load_path(file.read_bytes(), file.name)
    assert path.start == "swarm" and len(path.along) == 3 and f"brush morph swarm march {options}" in path.measured
    assert (path.begin, path.seconds) == ("aligned", 1.0) and not (path.even and path.bistable)
    assert not path.replaced(map(shipped().get, ("swarm", "march"))) and path.start_sha256 and path.end_sha256
    assert path.even == ("no hysteresis" not in done.out and "bistable" not in done.out)  # uneven ones are swept
    library = BrushLibrary([tmp_path, *shipped().folders])
    there, back = path_between(library, "swarm", "march"), path_between(library, "march", "swarm")
    assert there == path and back.along[1] == pytest.approx(1.0 - path.along[1])
    assert path_between(library, "graze", "lanes") is None


def test_of_paths_in_several_folders_that_of_the_first_is_taken_whichever_way_it_is_named(tmp_path):
    library = BrushLibrary([tmp_path, *shipped().folders])
    own = BrushPath(start="march", end="graze", along=(0, 0.9, 1))
    (tmp_path / "march--graze.path.toml").write_text(path_to_toml(own))
    assert path_between(library, "march", "graze") == own
    assert path_between(library, "graze", "march") == own.reversed()


@pytest.mark.parametrize(
    ("start", "end", "said"),
    [
        ("graze", "swarm", "3: end: the file of a path from 'graze' to 'swarm' must be graze--swarm.path.toml or"),
        ("swarm", "march", "2: start: the file of a path from 'swarm' to 'march' must be swarm--march.path.toml or"),
    ],
)
def test_a_path_whose_file_names_other_brushes_is_refused(tmp_path, start, end, said):
    file = tmp_path / "graze--march.path.toml"
    file.write_text(path_to_toml(BrushPath(start=start, end=end, along=(0, 0.9, 1))))
    library = BrushLibrary([tmp_path, *shipped().folders])
    for pair in (("graze", "march"), ("march", "graze")):
        with pytest.raises(ProblemsError, match=re.escape(f"{file}:{said}")):
            path_between(library, *pair)


def test_pairs_with_nothing_between_are_refused(cli, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for pair, why in (
        (("graze", "starlings"), "their models are herd and boids"),
        (("graze", "graze"), "both brushes are the same"),
    ):
        done = cli("brush", "morph", *pair)
        assert done.code != 0 and why in done.err + done.out
    done = cli("brush", "morph", "swarm", "march", "-o", "sm.path.toml")
    assert done.code == 1 and "sm.path.toml: levels find a path by its name: this one must be swarm--march" in done.err
    done = cli("brush", "morph", "swarm", "march", "--first", "mood")
    assert done.code != 0 and "model 'herd' has no parameter mood (--first)" in done.err + done.out
    assert not list(tmp_path.iterdir())


def test_shipped_paths_lead_from_brush_to_brush():
    library = shipped()
    for folder in library.folders:
        for file in sorted(folder.glob("*.path.toml")):
            path = load_path(file.read_bytes(), file.name)
            start, end = library.get(path.start), library.get(path.end)
            assert path_between(library, path.start, path.end) == path and path.measured
            assert not path.replaced((start, end)) and path.start_sha256 and path.end_sha256
            for share, brush in ((0.0, start), (1.0, end)):
                assert mixed(start, end, share, path).params.model_dump() == pytest.approx(brush.params.model_dump())
            for k in range(STEPS + 1):
                assert mixed(start, end, k / STEPS, path).model == start.model


def test_shipped_paths_are_judged_beside_the_straight_line():
    path = shipped_paths()["swarm--march"]
    ways = judged(*brushes_of("swarm--march"), path, Trial(animals=6, seeds=2, seconds=1.0), 2)
    on_path, straight = ways["path"][0], ways["straight line"][0]
    assert on_path.mean.shape == straight.mean.shape == (STEPS + 1, 2)
    ends = on_path.mean[[0, -1]], straight.mean[[0, -1]]
    np.testing.assert_allclose(*ends, atol=1e-9)  # the same brushes beside other herds
    assert not np.array_equal(on_path.mean[1:-1], straight.mean[1:-1])
    alone = judged(*brushes_of("swarm--march"), path, Trial(animals=6, seeds=2, seconds=1.0), 2, ["path"])
    assert list(alone) == ["path"] and np.array_equal(alone["path"][0].mean, on_path.mean)
    for seen, words in ways.values():
        assert words.split(":")[0] in (("uneven", "bistable") if faults(seen) else ("even",))


def test_a_pair_without_a_path_is_judged_along_the_straight_line():
    ways = judged(*brushes_of("lanes--front"), None, Trial(animals=6, seeds=1, seconds=1.0), 2)
    assert list(ways) == ["straight line"] and ways["straight line"][0].mean.shape == (STEPS + 1, 2)


@pytest.mark.parametrize("pair", ["lanes", "lanes--unicorn"])
def test_what_is_no_pair_is_said(pair):
    with pytest.raises(ValueError, match=f"'{pair}': invalid pair A--B of shipped brushes.*lanes"):
        brushes_of(pair)


def test_brushes_of_unlike_models_are_no_pair():
    with pytest.raises(ValueError, match="cannot be mixed"):
        brushes_of("lanes--starlings")

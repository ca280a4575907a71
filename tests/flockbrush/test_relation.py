"""The relation to a danger, from tracks of herds whose relation is known."""

import json
from dataclasses import replace

import numpy as np
import pytest
from flockbrush.behaviours.species import load_species

from flockbrush.cli.main import called
from flockbrush.film.track_files import Trajectories
from flockbrush.learning.relation import LearnedRelation, _fear, learn_relation


def herd(strength, notice, seed, frames=200, n=12, fps=10.0):
    """Animals that turn to their neighbours and, with a share of their steering, away from a dog around them."""
    rng = np.random.default_rng(seed)
    xy, angle, dog, out = rng.normal(0, 2, (n, 2)), rng.uniform(-0.5, 0.5, n), np.array([-9.0, 0.0]), []
    for t in range(frames):
        forward = np.column_stack([np.cos(angle), np.sin(angle)])
        fear = strength * _fear(np.hypot(*(xy - dog).T), notice)

        def sine(way, forward=forward):
            return (forward[:, 0] * way[:, 1] - forward[:, 1] * way[:, 0]) / np.maximum(np.hypot(*way.T), 1e-9)

        social = 0.6 * sine(np.tile(forward.mean(0), (n, 1))) + 0.4 * sine(xy.mean(0) - xy)
        angle += 3.0 * ((1 - strength) * social + fear * sine(xy - dog)) / fps + rng.normal(0, 0.08, n)
        xy = xy + 1.5 * forward / fps
        goal = xy.mean(0) + np.array([-np.cos(t / 60), np.sin(t / 35)]) * (4 + 3 * np.sin(t / 25))
        dog = dog + 0.1 * (goal - dog)
        out.append(np.vstack([xy, dog]))
    return Trajectories(np.array(out), (*map(str, range(n)), "dog"), fps, "m")


def test_notice_distance_and_strength_are_found():
    found = learn_relation([herd(0.5, 6.0, k) for k in range(3)], "dog", 1.0)
    assert found.told and found.notice == pytest.approx(6.0, rel=0.15)
    assert found.strength == pytest.approx(0.5, abs=0.1)
    assert found.line.startswith("dog = { fear = 0.")


def test_a_herd_that_does_not_care_is_not_said_to_flee():
    found = learn_relation([herd(0.0, 6.0, k) for k in range(3)], "dog", 1.0)
    assert not found.told and "no reaction" in found.sentence


def test_animals_that_care_for_nobody_are_not_said_to_flee_from_one_that_follows_them():
    told = []
    for seed in range(4):
        rng, recording = np.random.default_rng(seed), herd(0.0, 6.0, seed)
        angle = np.cumsum(rng.normal(0, 0.16, recording.xy.shape[:2]), axis=0)
        xy = np.cumsum(0.1 * np.stack([np.cos(angle), np.sin(angle)], -1), axis=0)
        for t in range(1, len(xy)):
            xy[t, -1] = xy[t - 1, -1] + 0.05 * (xy[t, :-1].mean(0) - xy[t - 1, -1])
        told.append(learn_relation([Trajectories(xy, recording.ids, 10.0, "m")], "dog", 1.0).told)
    assert not any(told)


def test_the_command_prints_a_line_for_a_species(tmp_path, capsys):
    paths = []
    for k in range(2):
        one = herd(0.5, 6.0, k, 240)
        rows = [
            f"{t / 10},{who},{x:.4f},{y:.4f}"
            for t in range(len(one)) for who, (x, y) in zip(one.ids, one.xy[t], strict=True)
        ]  # fmt: skip
        paths.append(tmp_path / f"{k}.csv")
        paths[-1].write_text("time,id,x_m,y_m\n" + "\n".join(rows) + "\n")
    assert called(["relation", *map(str, paths), "--danger", "dog", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["told"] and told["line"].startswith("dog = {")
    assert called(["relation", str(paths[0]), "--danger", "wolf"]) == 1
    assert "no file has tracks of animal 'wolf'" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("notice", "danger", "line"),
    [
        (12.34, "dog", 'dog = { fear = 0.50, notice = "12 m" }'),
        (0.1534, "dog 1", 'dog-1 = { fear = 0.50, notice = "0.15 m" }'),
        (234.5, "wolf", 'wolf = { fear = 0.50, notice = "234 m" }'),
        (0.000034, "ant", 'ant = { fear = 0.50, notice = "0.000034 m" }'),
    ],
)
def test_the_line_is_one_that_a_species_takes(tmp_path, notice, danger, line):
    found = LearnedRelation(danger, notice, (0.9 * notice, 1.1 * notice), 0.5, 0.01, True, False, "m", 1000)
    assert found.line == line
    sheep = tmp_path / "sheep.species.toml"
    sheep.write_text(f'schema = "flockbrush.species/1"\ntitle = "x"\nmedia = ["walk"]\n[body]\n[relations]\n{line}\n')
    (relation,) = load_species(sheep).relations.values()
    assert relation.notice == pytest.approx(notice, rel=0.05)


def test_distances_of_small_animals_are_told_and_no_line_is_made_of_pixels():
    found = LearnedRelation("dog", 0.1534, (0.1212, 0.1787), 0.5, 0.01, True, False, "m", 1000)
    assert "at 0.15 m (0.12 to 0.18)" in found.sentence
    assert "at 12.3 m (11.0 to 13.0)" in replace(found, notice=12.34, notice_range=(11.04, 12.96)).sentence
    assert replace(found, unit="px").line is None and replace(found, told=False).line is None


def test_animals_that_are_not_there_and_too_few_are_told():
    one = herd(0.5, 6.0, 0, frames=20)
    with pytest.raises(ValueError, match="no file has tracks of animal 'dogs'; did you mean 'dog'"):
        learn_relation([one], "dogs", 1.0)
    with pytest.raises(ValueError, match="no file has tracks of animal 'shepherd', which is to be left out"):
        learn_relation([one], "dog", 1.0, ["shepherd"])
    with pytest.raises(ValueError, match="at least 3 animals besides 'dog' and those left out are needed"):
        learn_relation([one], "dog", 1.0, iter(map(str, range(10))))

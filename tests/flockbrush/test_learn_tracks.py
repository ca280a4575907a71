"""Learning from tracks: the command, the Python function, and how sure and how separate the numbers are."""

import json
import re

import numpy as np
import pytest
from flockbrush.engine.problems import ProblemsError

import flockbrush
from flockbrush.cli.main import called
from flockbrush.learning.api import _in_python
from flockbrush.learning.confounding import correlation_of, estimates_of
from flockbrush.learning.learned_parameters import Learned
from flockbrush.runs.terminal import Stopped, say


def herd_tracks(count=12, seconds=3.0, fps=16, brush="march", seed=3):
    """(T, N, 2) m of a simulated herd, from 5 s after its beginning."""
    from flockbrush.components import Position

    simulation = flockbrush.plane(flockbrush.shipped().get(brush), count, 0.6, "scatter", seed, 0.3)
    simulation.run(160)
    xy = []
    for _ in range(round(seconds * fps)):
        xy.append(simulation.agents[Position.xyz][:, :2].copy())
        simulation.run(32 // fps)
    return np.array(xy)


@pytest.fixture(scope="module")
def tracks():
    xy = herd_tracks() + np.random.default_rng(1).normal(0, 0.005, (48, 12, 2))
    xy[20:23, 4] = np.nan
    xy[:14, 5] = np.nan
    return xy


@pytest.fixture(scope="module")
def learned(tracks, hasty_learning, short_trials):
    length = flockbrush.shipped().get("march").body.length
    return flockbrush.learn(tracks, unit="m", fps=16, body_length=length, quick=True, starts=1, name="marchers")


def test_python_learns_a_brush_from_an_array(learned, tmp_path):
    path = flockbrush.save_brush(learned.brush, tmp_path)
    assert flockbrush.load_brush(path).params == learned.brush.params
    assert learned.brush.name == "marchers" and learned.brush.provenance.kind == "learned"
    assert learned.brush.body.length == flockbrush.shipped().get("march").body.length
    assert all(getattr(learned.brush.params, one.name) == pytest.approx(one.value) for one in learned.parameters)
    assert "tracks" in learned.verdict and learned.kind in ("like", "partly", "rival", "untold")
    told = {row["name"]: row for row in learned.measures}
    assert told["polarization"]["clip"] > 0.9 and told["polarization"]["met"]
    assert len(json.loads(json.dumps(learned.measures))) == len(told)  # plain values, which programs can keep


def test_each_number_has_an_error_and_what_stands_in_for_it(learned):
    assert [one.name for one in learned.parameters][:3] == ["avoidance_weight", "avoidance_radial", "avoidance_angular"]
    for one in learned.parameters:
        assert one.told == ("not identifiable" if not one.identifiable else f"{one.value:.3f} ± {one.error:.3f}")
        assert len(one.confounded_with) == len(one.correlation)
        assert all(0.7 <= abs(r) <= 1 for r in one.correlation)
    with pytest.raises(KeyError, match="alignment_weight"):
        learned.parameter("aligment")


def test_no_obstacle_is_identifiable_without_any(learned):
    assert not any(one.identifiable for one in learned.parameters if one.name.startswith("obstacle"))


def test_correlations_of_errors_are_those_of_the_inverse_information():
    """Against a covariance that is known: errors of 1 and 2 go together, 3 is alone, 4 is not seen."""
    covariance = np.array([[1.0, 0.9, 0.0], [0.9, 1.0, 0.0], [0.0, 0.0, 4.0]])
    information = np.zeros((4, 4))
    information[:3, :3] = np.linalg.inv(covariance)
    found = correlation_of(information)
    np.testing.assert_allclose(found[:3, :3], [[1, 0.9, 0], [0.9, 1, 0], [0, 0, 1]], atol=1e-9)
    assert np.isnan(found[3]).all() and np.isnan(found[:, 3]).all()


def test_numbers_whose_errors_go_together_are_named():
    correlation = np.eye(12)
    correlation[0, 3] = correlation[3, 0] = -0.95
    correlation[0, 6] = correlation[6, 0] = 0.8
    correlation[1, 2] = correlation[2, 1] = 0.5
    blank = Learned(None, None, None, None, np.full(12, 0.5), deviation=np.full(12, 0.02), correlation=correlation)
    found = estimates_of(blank)
    assert found[0].confounded_with == ("cohesion_weight", "alignment_weight") and found[0].correlation == (-0.95, 0.8)
    assert found[1].confounded_with == () and found[1].told == "0.500 ± 0.020"


@pytest.mark.slow
def test_masked_numbers_are_not_seen_and_complex_ones_are_refused(tmp_path):
    from flockbrush.learning.api import _file

    xy = np.arange(24.0).reshape(2, 6, 2)
    again = np.load(_file(np.ma.masked_less(xy, 4.0), 0, tmp_path))
    assert np.isnan(again[0, :2]).all() and np.array_equal(again[0, 2:], xy[0, 2:])
    with pytest.raises(ValueError, match="real numbers"):
        _file(xy + 1j, 0, tmp_path)


@pytest.mark.parametrize("wrong", [{"starts": 0}, {"jobs": -1}])
def test_options_that_ask_for_nothing_are_refused(tracks, wrong):
    with pytest.raises(ValueError, match="must be at least 1"):
        flockbrush.learn(tracks, unit="m", fps=16, **wrong)
    with pytest.raises(ValueError, match="no tracks"):
        flockbrush.learn([])


@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        ({"share": 2}, "share must be .1 to 1, got 2"), ({"fps": 0}, "fps must be above 0, got 0"),
        ({"name": "a/b"}, "name must be a name and not a path"),
        ({"quik": True}, "learn has no argument 'quik'; did you mean 'quick'?"),
        ({"model": "hrd"}, "model: no model 'hrd' can be learned"),
        ({"quick": True, "thorough": True}, "thorough: it searches longer and quick shorter; use one of them"),
        ({"frames": (900, 999)}, "tracks1.npy: has no frames 900 to 999"),
        ({"unit": None}, 'tracks1.npy: has no unit for x and y: give it with unit="m", "px" or "bl"'),
    ],
)  # fmt: skip
def test_what_is_wrong_is_said_in_words_of_python(tracks, wrong, told):
    with pytest.raises((ValueError, TypeError, ProblemsError)) as error:
        flockbrush.learn(tracks, **{"unit": "m", "fps": 16} | wrong)
    assert str(error.value).startswith(told)


def test_what_is_said_meanwhile_is_in_words_of_python(tracks, monkeypatch, capsys):
    from flockbrush.learning import learn

    def told(wishes):
        say(f"{wishes.clips[0]}: --speed was ignored; --body-length-m is 1 m")
        raise Stopped

    monkeypatch.setattr(learn, "learn_brushes", told)
    with pytest.raises(KeyboardInterrupt):
        flockbrush.learn(tracks, unit="m", fps=16, body_length=1.0)
    say("--speed")
    assert capsys.readouterr().err == "tracks1.npy: speed was ignored; body_length is 1 m\n--speed\n"


def test_notes_are_in_words_of_python(learned):
    note = "Learned from the first part of the tracks and tested on the rest: quick fits no brush to all."
    assert note in learned.notes
    assert not [note for note in learned.notes if "--" in note]
    text = "x--y.npy: use --frames 0:8 or --body-length-m, and --body-colour R,G,B"
    assert _in_python(text) == "x--y.npy: use frames=(0, 8) or body_length, and --body-colour R,G,B"


def test_what_was_learned_is_shown_in_a_line(learned, capsys):
    assert repr(learned) == f"<LearnedBrush marchers: {learned.verdict}>" and str(learned.brush) == repr(learned.brush)
    assert {type(value) for row in learned.measures for value in row.values()} == {str, float, bool}


def test_the_command_learns_from_a_table_with_gaps(tracks, hasty_learning, short_trials, tmp_path, capsys):
    path = tmp_path / "march.csv"
    rows = [
        f"{t},{t / 16},{n},{tracks[t, n, 0]:.4f},{tracks[t, n, 1]:.4f}"
        for t in range(40) for n in range(12) if np.isfinite(tracks[t, n, 0])
    ]  # fmt: skip
    path.write_text("frame,time,id,x_m,y_m\n" + "\n".join(rows) + "\n")
    out, report = tmp_path / "m.brush.toml", tmp_path / "r"
    command = ["learn", str(path), "-o", str(out), "--report", str(report), "--quick", "--starts", "1", "--json"]
    assert called([*command, "--body-length-m", "1.1", "--licence", "made up"]) == 0
    shown = capsys.readouterr()
    told = json.loads(shown.out)["brushes"][0]
    assert told["estimates"][0]["name"] == "avoidance_weight"
    brush = flockbrush.load_brush(out)
    assert brush.body.length == 1.1 and brush.provenance.licence == "made up" and brush.provenance.clip == "march.csv"
    page = (report / "report.html").read_text()
    assert "1.1 m (given)" in page and "confounded with" in page and "smoothed over" in page
    words = re.sub(r"<style>.*?</style>|data:image[^\"]*|<pre.*?</pre>", "", page, flags=re.DOTALL)
    assert not re.findall(r".{0,40}\bclips?\b.{0,40}", words + shown.err + brush.provenance.notes, re.IGNORECASE)
    assert "The tracks constrain" in words and "Tracks and simulation" in words
    assert (report / "moment-1.png").stat().st_size > 0


def test_the_page_of_tracks_is_what_its_command_writes_of_the_figures_kept():
    from benchmarks.learning_tracks import PAGE, RESULTS, page

    text = page(json.loads(RESULTS.read_text(encoding="utf-8")))
    assert PAGE.read_text(encoding="utf-8") == text
    constant = [
        line.split("|")[3].strip() for line in text.splitlines() if line.startswith(("| sheep-gps |", "| zebra"))
    ]
    assert len(constant) == 2 and all(float(value) > 1 for value in constant)


def test_ctrl_c_is_what_it_is_in_python(monkeypatch):
    from flockbrush.learning import learn

    def stopped(wishes):
        raise Stopped

    monkeypatch.setattr(learn, "learn_brushes", stopped)
    with pytest.raises(KeyboardInterrupt):
        flockbrush.learn(np.zeros((20, 6, 2)), unit="m", fps=10)


@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("herd.csv", ["in tracks, speed is measured", "--beta was ignored", "--device was ignored"]),
        ("herd.mp4", ["in a clip, speed is measured"]),
    ],
)
def test_what_does_nothing_for_tracks_or_films_is_told_before_they_are_looked_at(cli, tmp_path, name, told):
    (tmp_path / name).write_text("no herd")
    ignored = "--speed", "2", "--beta", "0.5", "--device", "cpu"
    done = cli("learn", tmp_path / name, "--out", tmp_path / "x.brush.toml", *ignored)
    said = " ".join(done.err.split())
    assert done.code == 1 and said.count("was ignored") == len(told)
    assert all(one in said for one in told), said

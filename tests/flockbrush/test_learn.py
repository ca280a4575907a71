"""`flockbrush learn` and `flockbrush reenact`: what a designer types, and what comes of it."""

import csv
import errno
import importlib.util
import json
import os
from dataclasses import replace

import cv2
import filmed
import numpy as np
import pytest
from filmed import film_of
from flockbrush.behaviours.brush import load_brush

from benchmarks.foreign_herds import herd
from benchmarks.herd_film import CameraDrift, shoot
from flockbrush.film.observations import CannotObserve
from flockbrush.learning.model_choice import comparison_of


@pytest.fixture(scope="module")
def films(tmp_path_factory):
    """A folder with two films of herds that march."""
    folder = tmp_path_factory.mktemp("films")
    film_of(folder / "one.mp4")
    film_of(folder / "two.mp4", count=20)
    return folder


@pytest.fixture(scope="module")
def picture(tmp_path_factory):
    """A photograph of a herd."""
    path = tmp_path_factory.mktemp("picture") / "herd.png"
    cv2.imwrite(
        str(path), shoot(herd("swarm", 30, 0.2, 25.0, 5), None, (640, 480), 20.0, CameraDrift(), seed=6).frames[0]
    )
    return path


@pytest.fixture
def quick(monkeypatch):
    """A perfect observer and a learner who knows: the rest is as it is."""
    import flockbrush.film.open_clip
    import flockbrush.learning.helpers
    import flockbrush.learning.learn
    import flockbrush.learning.verdict

    monkeypatch.setattr(flockbrush.film.open_clip, "observe", filmed.observe)
    monkeypatch.setattr(flockbrush.learning.learn, "learn", filmed.learn)
    monkeypatch.setattr(flockbrush.learning.learn, "comparison_of", filmed.comparison_of)
    monkeypatch.setattr(flockbrush.learning.helpers, "MOST", 1)  # to pickle nothing
    monkeypatch.setattr(flockbrush.learning.learn, "with_other_numbers", lambda *_: [])
    monkeypatch.setattr(flockbrush.learning.learn, "with_other_starts", lambda *_: [])
    monkeypatch.setattr(flockbrush.learning.learn, "shipped", _Few)
    monkeypatch.setattr(flockbrush.learning.learn, "JUDGED_RUNS", 2)
    for name, value in {"LONG_RUNS": 1, "RIVAL_RUNS": 1, "ALONE": 4.0, "MEASURED": 2.0}.items():
        monkeypatch.setattr(flockbrush.learning.verdict, name, value)


class _Few:
    """Fewer brushes to try than are shipped."""

    def names(self):
        return ["graze"]

    def get(self, name):
        from flockbrush.behaviours.brush import shipped

        return shipped().get(name)


def nothing_in(folder):
    return sorted(path.name for path in folder.iterdir()) == []


# learning -----------------------------------------------------------------------------------


def test_a_clip_becomes_a_brush_with_figures_of_what_was_held_out(cli, films, quick, tmp_path, monkeypatch):
    import flockbrush.learning.learn as learning
    from flockbrush.learning import model_search

    monkeypatch.setattr(learning, "comparison_of", comparison_of)  # with all kinds of models
    for name, value in {"GENERATIONS": (1, 1), "SIZE": 4, "SEEDS": 1, "LAST_SEEDS": 1}.items():
        monkeypatch.setattr(model_search, name, value)
    done = cli("learn", films / "one.mp4", "--out", tmp_path / "lambs.brush.toml", "--seed", 3, "--licence", "mine")
    assert done.code == 0, done.err
    assert "held-out frames" in done.out and "wrote" in done.err
    brush = load_brush(tmp_path / "lambs.brush.toml")
    told = brush.provenance
    assert (told.kind, told.seed, told.frames, told.licence) == ("learned", 3, (0, 19), "mine")
    assert told.report["held-out polarization, simulated"] > 0.9
    assert "parts of the clip, held out in turn" in told.notes and "moves like the film" in done.err
    assert "Learned: force_map, whose simulated herds are nearer to the clip." in told.notes
    assert cli("brush", "check", tmp_path / "lambs.brush.toml").code == 0
    assert [path.name for path in tmp_path.iterdir()] == ["lambs.brush.toml"]


def test_the_report_tells_how_to_do_it_again(cli, films, quick, tmp_path):
    out, report = tmp_path / "lambs.brush.toml", tmp_path / "report"
    done = cli("learn", films / "one.mp4", "-o", out, "--report", report, "--ablate", "occlusion,density", "--json")
    assert done.code == 0, done.err
    told = json.loads(done.out)["brushes"][0]
    assert [row["method"] for row in told["ablations"]] == ["full method", "without occlusion", "without density"]
    names = {row["name"] for row in told["judgement"]["rivals"]}
    assert names == {"graze", "random numbers", "nobody moves", "all animals keep their velocity"}
    assert told["command"].startswith("flockbrush learn") and "--seed 0" in told["command"]
    assert told["file"] == str(out)
    assert {"report.html", "moment-1.png", "order.png", "parameters.png"} <= {p.name for p in report.iterdir()}
    picture = cv2.imread(str(report / "moment-1.png"))
    assert picture.shape[1] > 300


def test_several_clips_of_one_species_are_learned_together(cli, films, quick, tmp_path):
    out = tmp_path / "both.brush.toml"
    assert cli("learn", films / "one.mp4", films / "two.mp4", "--out", out).code == 0
    told = load_brush(out).provenance
    assert "one.mp4, two.mp4" in told.source and "Also from two.mp4" in told.notes


def test_a_mask_with_two_colours_makes_two_brushes(cli, films, quick, tmp_path):
    mask = np.zeros((240, 320, 3), np.uint8)
    for k in range(12):
        mask[:, 320 * k // 12 : 320 * (k + 1) // 12] = [(0, 0, 255), (255, 0, 0)][k % 2]  # BGR
    cv2.imwrite(str(tmp_path / "mask.png"), mask)
    done = cli("learn", films / "one.mp4", "--out", tmp_path / "x.brush.toml", "--regions", tmp_path / "mask.png")
    assert done.code == 0, done.err
    red, blue = (load_brush(tmp_path / f"x-{word}.brush.toml") for word in ("red", "blue"))
    assert (red.colour, blue.colour) == ("#ff0000", "#0000ff")
    assert "painted #ff0000" in red.provenance.notes
    assert not (tmp_path / "x.brush.toml").exists()


def test_ctrl_c_keeps_the_best_so_far_and_how_to_go_on(cli, films, quick, tmp_path, monkeypatch):
    import flockbrush.learning.learn as learning

    def stopped(clips, settings, *, stop, **rest):
        os.kill(os.getpid(), 2)
        return filmed.learn(clips, settings, stop=stop, **rest)

    monkeypatch.setattr(learning, "learn", stopped)
    out = tmp_path / "lambs.brush.toml"
    done = cli("learn", films / "one.mp4", "--out", out, "--report", tmp_path / "r")
    assert done.code == 130
    assert "--resume" in done.err
    assert load_brush(out).provenance.notes.startswith("Learning was interrupted")
    assert "interrupted" in (tmp_path / "r" / "report.html").read_text()
    assert (tmp_path / "lambs.learning").exists()
    monkeypatch.setattr(learning, "learn", filmed.learn)
    assert cli("learn", films / "one.mp4", "--out", out, "--resume").code == 0
    assert not load_brush(out).provenance.notes.startswith("Learning was interrupted")
    assert not (tmp_path / "lambs.learning").exists()


@pytest.mark.parametrize("part", [2, 3])
def test_ctrl_c_in_a_later_part_is_told_too(cli, films, quick, tmp_path, monkeypatch, part):
    import flockbrush.learning.learn as learning

    parts = []

    def stopped(clips, settings, *, stop, **rest):
        parts.append(1)
        if len(parts) == part:
            os.kill(os.getpid(), 2)
        return filmed.learn(clips, settings, stop=stop, **rest)

    monkeypatch.setattr(learning, "learn", stopped)
    out = tmp_path / "lambs.brush.toml"
    done = cli("learn", films / "one.mp4", "--out", out)
    assert done.code == 130 and f"--resume ({tmp_path / 'lambs.learning'})" in done.err
    assert "Learning was interrupted; this is the best brush so far. It moves like the film" in done.err
    assert load_brush(out).provenance.notes.startswith("Learning was interrupted")
    monkeypatch.setattr(learning, "learn", filmed.learn)
    assert cli("learn", films / "one.mp4", "--out", out, "--resume").code == 0
    assert not load_brush(out).provenance.notes.startswith("Learning was interrupted")
    assert [path.name for path in tmp_path.iterdir()] == ["lambs.brush.toml"]


def test_ctrl_c_while_a_brush_is_tested_is_told_too(cli, films, quick, tmp_path, monkeypatch):
    import flockbrush.learning.learn as learning

    whole = learning.judge

    def stopped(*parts, **how):
        os.kill(os.getpid(), 2)
        return whole(*parts, **how)

    monkeypatch.setattr(learning, "judge", stopped)
    out = tmp_path / "lambs.brush.toml"
    done = cli("learn", films / "one.mp4", "--out", out)
    assert done.code == 130 and f"--resume ({tmp_path / 'lambs.learning'})" in done.err
    assert "Learning was interrupted; this is the best brush so far. It was not tested." in done.err
    assert load_brush(out).provenance.notes.startswith("Learning was interrupted")


def test_only_what_was_kept_can_be_continued(cli, films, quick, tmp_path, monkeypatch):
    import flockbrush.learning.learn as learning

    whole = learning.learned_model

    def stopped(clips, kind, seed=0, **how):
        os.kill(os.getpid(), 2)
        return whole(clips, kind, seed, **how)

    monkeypatch.setattr(learning, "learned_model", stopped)
    zones = "learn", films / "one.mp4", "--out", tmp_path / "lambs.brush.toml", "--model", "zones"
    done = cli(*zones)
    assert done.code == 130 and "Learning was interrupted" in done.err and "--resume" not in done.err
    assert [path.name for path in tmp_path.iterdir()] == ["lambs.brush.toml"]
    done = cli(*zones, "--resume")
    assert done.code == 1 and "only the search of the herd model is kept, and the model is zones" in done.err


def test_what_an_interrupted_learning_left_is_not_lost_without_a_word(cli, films, quick, tmp_path):
    out, kept = tmp_path / "x.brush.toml", tmp_path / "x.learning"
    kept.write_text("what was done")
    done = cli("learn", films / "one.mp4", "--out", out)
    assert done.code == 0 and f"starting again: the state of an interrupted learning in {kept} is discarded" in done.err
    again = cli("learn", films / "one.mp4", "--out", out)  # takes the place of the brush, as a run's recording does
    assert again.code == 0 and "starting again" not in again.err


def test_a_brush_that_another_program_is_learning_is_left_to_it(cli, films, quick, tmp_path, monkeypatch):
    from flockbrush.engine.files import held, holder

    import flockbrush.learning.learn as learning

    monkeypatch.setattr(learning, "write_report", lambda *_: None)  # its charts take seconds
    out, report = tmp_path / "lambs.brush.toml", tmp_path / "report"
    meanwhile = []

    def watched(clips, settings, **rest):
        meanwhile.append((holder(out), holder(report)))
        return filmed.learn(clips, settings, **rest)

    monkeypatch.setattr(learning, "learn", watched)
    for path in (out, report):
        with held(path):
            done = cli("learn", films / "one.mp4", "--out", out, "--report", report)
        assert done.code == 1 and f"{path}: this program is already writing it" in done.err
        assert nothing_in(tmp_path) and not meanwhile
    assert cli("learn", films / "one.mp4", "--out", out, "--report", report).code == 0
    assert meanwhile == [("this program is already writing it",) * 2] * 3  # each half, and all frames
    assert sorted(path.name for path in tmp_path.iterdir()) == ["lambs.brush.toml", "report"]


def test_what_is_said_of_the_clip_and_what_is_left_out_is_told(cli, films, quick, tmp_path, monkeypatch):
    import flockbrush.film.open_clip

    def noted(path, **looking):
        return replace(filmed.observe(path, **looking), notes=["the herd jumps between frames 3 and 4"])

    monkeypatch.setattr(flockbrush.film.open_clip, "observe", noted)
    clip = films / "one.mp4"
    done = cli("learn", clip, "--out", tmp_path / "x.brush.toml", "--speed", "2")
    assert f"{clip}: the herd jumps between frames 3 and 4" in done.err
    assert f"{clip}: --speed was ignored: it is for photographs" in done.err
    assert f"{clip}: the herd jumps" in cli("reenact", clip, "--brush", "march", "--runs", "1").err


# mistakes -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--frames", "9:3"), "--frames"),
        (("--frames", "all"), "0:99"),
        (("--landmark", "0:1,2,3"), "FRAME:x,y,w,h"),
        (("--landmark", "0:1,2,3,4"), "at least two landmarks"),
        (("--body-colour", "white"), "240,240,235"),
        (("--body-colour", "1,2,300"), "255"),
        (("--ablate", "oclusion"), "did you mean"),
        (("--beta", "2"), "--beta"),
        (("--device", "gpu"), "cuda:0"),
        (("--colour", "1"), "--colour"),
    ],
)
def test_a_wrong_option_is_told_before_anything_is_done(cli, films, tmp_path, arguments, words):
    done = cli("learn", films / "one.mp4", "--out", tmp_path / "x.brush.toml", *arguments)
    assert done.code == 2
    assert words in done.err
    assert nothing_in(tmp_path)


def test_places_where_nothing_can_be_written_are_told_before_anything_is_done(cli, films, quick, tmp_path):
    clip = films / "one.mp4"
    for out, words in (
        ("x.toml", ".brush.toml"),
        ("none/x.brush.toml", "no folder"),
        ("a ü.brush.toml", "invalid brush name"),
    ):
        done = cli("learn", clip, "--out", tmp_path / out)
        assert done.code == 1 and words in done.err, done.err
    assert "try a-u.brush.toml" in done.err
    (tmp_path / "file").write_text("")
    for report, words in (("file", "needs a folder"), ("none/report", "to create it in")):
        done = cli("learn", clip, "--out", tmp_path / "x.brush.toml", "--report", tmp_path / report)
        assert done.code == 1 and words in done.err, done.err
    done = cli("learn", clip, "--out", tmp_path / "x.brush.toml", "--resume")
    assert done.code == 1 and "no interrupted learning" in done.err
    assert not (tmp_path / "x.brush.toml").exists()


@pytest.mark.parametrize(
    ("options", "why"),
    [
        (("--share", "0.8"), "no frames can be held out: leave out --share"),
        (("--share", "0.5"), "no frames can be held out: leave out --share"),
        (("--beta", "0.5"), "leave out --beta"),
        (("--ablate", "angular"), "leave out --ablate"),
        (("--beta", "0.2"), "its density alone is learned from: leave out --beta"),
        (("--landmark", "0:9,9,40,40", "--landmark", "0:60,9,40,40"), "leave out --landmark"),
        (("--model", "zones"), "leave out --model zones"),
    ],
)
def test_options_that_do_nothing_for_a_photograph_are_refused(cli, picture, tmp_path, options, why):
    done = cli("learn", picture, "--out", tmp_path / "x.brush.toml", *options)
    assert done.code == 1 and why in done.err and "is one picture" in done.err
    assert nothing_in(tmp_path)


def test_parts_are_left_out_of_the_herd_model_only(cli, films, tmp_path):
    done = cli(
        "learn", films / "one.mp4", "--out", tmp_path / "x.brush.toml", "--model", "zones", "--ablate", "angular"
    )
    assert done.code == 1 and "--ablate: it leaves out parts of the herd model, and the model is zones" in done.err


def test_a_thorough_search_takes_four_times_the_work_and_is_of_the_herd_model(cli, films, quick, tmp_path, monkeypatch):
    import flockbrush.learning.learn

    budgets = []

    def noted(clips, settings, **how):
        budgets.append(settings.budget_s)
        return filmed.learn(clips, settings, **how)

    monkeypatch.setattr(flockbrush.learning.learn, "learn", noted)
    clip, out = films / "one.mp4", tmp_path / "x.brush.toml"
    assert cli("learn", clip, "--out", out).code == 0
    usual = list(budgets)
    assert cli("learn", clip, "--out", out, "--thorough").code == 0
    assert usual and budgets == [*usual, *(4 * budget for budget in usual)]
    for other, words in ((["--quick"], "use one of them"), (["--model", "zones"], "search of the herd model")):
        done = cli("learn", clip, "--out", out, "--thorough", *other)
        assert done.code == 1 and "--thorough" in done.err and words in done.err


def test_parts_are_left_out_of_the_fit_that_is_compared(cli, films, quick, tmp_path, monkeypatch):
    """From the same frames, none of which is held out, with as much work."""
    import flockbrush.learning.learn

    done = []

    def noted(clips, settings, **how):
        done.append(([clip.fields.frames.tolist() for clip in clips], settings.budget_s, sorted(settings.use)))
        return filmed.learn(clips, settings, **how)

    monkeypatch.setattr(flockbrush.learning.learn, "learn", noted)
    assert cli("learn", films / "one.mp4", "-o", tmp_path / "x.brush.toml", "--ablate", "angular").code == 0
    first, *_, without = done
    assert first[2] != without[2] and "angular" not in without[2]
    assert first[:2] == without[:2] and max(without[0][0]) == 9


def test_options_that_change_nothing_are_refused_or_told(cli, films, quick, tmp_path):
    one, two, out = films / "one.mp4", films / "two.mp4", tmp_path / "x.brush.toml"
    for arguments, told in (
        ((one, two, "--share", 0.3), "--share: of 2 files each is held out in turn"),
        ((one, "--model", "zones", "--starts", 3), "--starts: it is for the search of the herd model"),
        ((one, "--model", "zones", "--device", "cpu"), "--device: it is for the search of the herd model"),
        ((one, one), f"{one}: has the same content as {one.name}"),
    ):
        done = cli("learn", *arguments, "--out", out)
        assert done.code == 1 and told in done.err, done.err
    assert nothing_in(tmp_path)
    done = cli("learn", one, "--out", out, "--quick", "--starts", 40, "--beta", 0.9, "--device", "cpu")
    assert done.code == 0 and "--starts 40 is cut to 2" in done.err
    assert "--beta was ignored" in done.err and "--device was ignored" in done.err


def test_clips_that_do_not_fit_together_leave_no_kept_work(cli, films, quick, tmp_path, monkeypatch):
    import flockbrush.learning.learn as learning

    def strangers(wholes, checks):
        raise learning.refused(wholes[0].name, "no single brush fits these clips")

    monkeypatch.setattr(learning, "_refuse_strangers", strangers)
    done = cli("learn", films / "one.mp4", films / "two.mp4", "--out", tmp_path / "x.brush.toml")
    assert done.code == 1 and "no single brush" in done.err and nothing_in(tmp_path)


def test_torch_is_needed_only_where_animals_cannot_be_told_apart(cli, films, quick, tmp_path, monkeypatch):
    import flockbrush.film.open_clip

    found = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name, *a: None if name == "torch" else found(name, *a))
    assert cli("learn", films / "one.mp4", "--out", tmp_path / "x.brush.toml", "--quick").code == 0
    monkeypatch.setattr(
        flockbrush.film.open_clip, "observe", lambda path, **how: replace(filmed.observe(path, **how), sightings=None)
    )
    done = cli("learn", films / "one.mp4", "--out", tmp_path / "y.brush.toml")
    assert done.code == 1 and not (tmp_path / "y.brush.toml").exists()
    assert 'pip install "flockbrush[learn]"' in done.err
    monkeypatch.setattr(importlib.util, "find_spec", found)
    done = cli("learn", films / "one.mp4", "--out", tmp_path / "y.brush.toml", "--device", "cuda:7")
    assert done.code == 1 and "use --device auto or cpu" in done.err


def test_a_clip_that_tells_nothing_leaves_a_page_of_what_was_seen(cli, films, quick, tmp_path, monkeypatch):
    import flockbrush.film.open_clip

    def nobody(path, **looking):
        error = CannotObserve(path, "no animals are to be seen; give their colour with --body-colour")
        error.seen = {"first frame": 0, "pictures": {"first frame": np.zeros((20, 30, 3), np.uint8)}}
        raise error

    monkeypatch.setattr(flockbrush.film.open_clip, "observe", nobody)
    done = cli("learn", films / "one.mp4", "--out", tmp_path / "x.brush.toml", "--report", tmp_path / "r")
    assert done.code == 1
    assert "no animals are to be seen" in done.err and "report.html" in done.err
    assert "no animals are to be seen" in (tmp_path / "r" / "report.html").read_text()
    assert not (tmp_path / "x.brush.toml").exists()


def test_a_full_disk_is_told_and_what_was_learned_can_be_taken_up(cli, films, quick, tmp_path, monkeypatch):
    import flockbrush.learning.learn

    def full(path, text):
        raise OSError(errno.ENOSPC, "No space left on device", str(path))

    monkeypatch.setattr(flockbrush.learning.learn, "write_text", full)
    done = cli("learn", films / "one.mp4", "--out", tmp_path / "x.brush.toml")
    assert done.code == 1
    assert "No space left on device" in done.err
    assert (tmp_path / "x.learning").exists()


# done again --------------------------------------------------------------------------------------


def test_a_clip_is_done_again_frame_by_frame(cli, films, quick, tmp_path):
    table, video = tmp_path / "again.csv", tmp_path / "again.mp4"
    done = cli(
        "reenact", films / "one.mp4", "--brush", "march", "--frames", "4:15", "--export", table, "--video", video
    )
    assert done.code == 0, done.err
    assert "march against the clip" in done.out and "polarization" in done.err
    with open(table) as file:
        rows = list(csv.DictReader(file))
    assert {row["frame"] for row in rows} == {str(frame) for frame in range(4, 16)}
    assert len(rows) == 12 * 30
    film = cv2.VideoCapture(str(video))
    assert film.get(cv2.CAP_PROP_FRAME_COUNT) == 12
    assert film.get(cv2.CAP_PROP_FPS) == pytest.approx(12.5)


def test_the_comparison_is_told_where_somebody_stops_its_video(cli, films, quick, tmp_path, monkeypatch):
    def stopped(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("flockbrush.learning.reenact._picture", stopped)
    video, command = tmp_path / "v.mp4", ("reenact", films / "one.mp4", "--brush", "march", "--frames", "4:15")
    done = cli(*command, "--runs", 1, "--video", video)
    assert done.code == 130 and "march against the clip" in done.out
    assert f"stopped; {video} was not written" in done.err and not list(tmp_path.iterdir())
    video.write_text("earlier")
    done = cli(*command, "--runs", 1, "--video", video)
    assert f"stopped; {video} is still the earlier file" in done.err
    assert video.read_text() == "earlier" and list(tmp_path.iterdir()) == [video]


def test_clip_and_brush_are_compared_as_numbers_for_programs(cli, films, quick):
    done = cli("reenact", films / "one.mp4", "--brush", "graze", "--runs", 2, "--json")
    assert done.code == 0, done.err
    told = json.loads(done.out)
    assert told["met"] is False
    assert len(told["series"]["simulation"]["velocity error"]) == len(told["series"]["frame"]) == 20


def test_a_brush_of_birds_cannot_do_a_clip_again(cli, films, quick):
    done = cli("reenact", films / "one.mp4", "--brush", "boids-herd", "--runs", 1, "--json")
    assert done.code == 0 and json.loads(done.out)["brush"] == "boids-herd"
    done = cli("reenact", films / "one.mp4", "--brush", "geese")
    assert done.code == 1 and "a brush of the model herd" in done.err
    assert cli("reenact", films / "one.mp4", "--brush", "starlings").code == 1
    done = cli("reenact", films / "one.mp4", "--brush", "grase")
    assert done.code == 1 and "did you mean 'graze'" in done.err
    done = cli("reenact", films / "one.mp4", "--brush", "graze", "--export", "x.txt")
    assert done.code == 1 and ".csv" in done.err

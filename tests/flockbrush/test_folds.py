"""Several clips or parts of one: what is refused together, and what the report of a refitted brush shows."""

from dataclasses import replace
from types import SimpleNamespace

import pytest
from flockbrush.engine.problems import ProblemsError

import flockbrush
from benchmarks.foreign_herds import herd
from benchmarks.herd_film import evidence_of_truth
from flockbrush.learning import learn as learning
from flockbrush.learning.learn import BrushTask, LearnOptions, _compare, _refitted, _refuse_strangers
from flockbrush.learning.learned_parameters import Learned
from flockbrush.learning.result import Findings
from flockbrush.learning.rollout import theta_of
from flockbrush.learning.verdict import judge


@pytest.fixture(scope="module")
def clips():
    """A marching herd and a mill."""
    made = [evidence_of_truth(herd(f"own:{name}", 30, 2.4, 12.5, 2), name=name) for name in ("march", "mill-filled")]
    return dict(zip(("march", "mill"), made, strict=True))


@pytest.fixture(scope="module")
def march():
    return flockbrush.shipped().get("march")


def test_a_march_and_a_mill_are_refused_together_with_the_evidence(clips, march):
    wholes = [clips["march"], clips["mill"]]
    checks = [judge(clip, march, {}, runs=2) for clip in wholes]
    with pytest.raises(ProblemsError) as told:
        _refuse_strangers(wholes, checks)
    assert "mill-filled: no single brush fits these clips" in str(told.value)
    assert "simulated; learn from each clip separately" in str(told.value)


def test_two_clips_of_one_herd_are_learned_together(clips, march):
    wholes = [clips["march"], evidence_of_truth(herd("own:march", 30, 2.4, 12.5, 9), name="march 2")]
    _refuse_strangers(wholes, [judge(clip, march, {}, runs=2) for clip in wholes])
    with pytest.raises(ProblemsError):  # and one alone is never refused
        _refuse_strangers([clips["mill"]] * 2, [judge(clips["mill"], march, {}, runs=2)] * 2)
    _refuse_strangers([clips["mill"]], [judge(clips["mill"], march, {}, runs=2)])


def learned_as(brush):
    return Learned(brush.params, brush.speed, brush.body, brush.vision, theta_of(brush.params))


def test_the_held_out_table_shows_the_brush_that_knew_nothing_of_these_frames(clips, march, monkeypatch, tmp_path):
    """The judged brush is a march, the refitted one a swarm; the frames held out are of a march."""
    clip, swarm = clips["march"], flockbrush.shipped().get("swarm")
    wishes = LearnOptions([tmp_path / "a.mp4"], tmp_path / "a.brush.toml")
    verdict = judge(clip, march, {}, runs=2)
    first = Findings(march, [clip], clip, learned_as(march), clip, judgement=verdict)
    refit = Findings(swarm, [clip], clip, learned_as(swarm), clip)
    monkeypatch.setattr(learning, "_learned", lambda *_, **__: refit.learned)
    monkeypatch.setattr(learning, "_found", lambda *_: refit)
    monkeypatch.setattr(learning, "_judged", lambda *_: verdict)
    task, nobody_asks = BrushTask(wishes.out, [SimpleNamespace(whole=clip)]), SimpleNamespace(asked=0)
    found = _refitted(task, [first, first], wishes, nobody_asks)
    assert found.brush is swarm and found.judged_brush is march
    quickly = _refitted(task, [first], replace(wishes, quick=True), nobody_asks)
    assert quickly.brush is march and quickly.judged_brush is None and "--quick" in quickly.notes[0]
    _compare(found, wishes, None, False)
    shown = found.comparison.verdict("polarization")
    assert shown.met and shown.herd > 0.9, shown
    assert found.counts[-1]["polarization"] < 0.5  # other numbers of animals: the brush of the file


@pytest.mark.parametrize("begun", ["march", "swarm"])
def test_a_fit_to_all_frames_is_saved_unless_the_first_does_better(begun, clips, march, monkeypatch, tmp_path):
    """Which of the two is the fit to all frames is turned round; the frames are of a march."""
    clip, swarm = clips["march"], flockbrush.shipped().get("swarm")
    verdicts = {brush.name: judge(clip, brush, {}, runs=2) for brush in (march, swarm)}
    one, other = (march, swarm) if begun == "march" else (swarm, march)
    first = Findings(one, [clip], clip, learned_as(one), clip, judgement=verdicts[one.name])
    refit = Findings(other, [clip], clip, learned_as(other), clip)
    monkeypatch.setattr(learning, "_learned", lambda *_, **__: refit.learned)
    monkeypatch.setattr(learning, "_found", lambda *_: refit)
    monkeypatch.setattr(learning, "_judged", lambda _, found, *__: verdicts[found.brush.name])
    wishes = LearnOptions([tmp_path / "a.mp4"], tmp_path / "a.brush.toml")
    task = BrushTask(wishes.out, [SimpleNamespace(whole=clip)])
    found = _refitted(task, [first, first], wishes, SimpleNamespace(asked=0))
    assert found.brush is march and found.judgement.kind == verdicts[one.name].kind
    assert ("a fit to all frames was worse" in found.notes[0]) == (begun == "march")


@pytest.mark.parametrize("quick", [False, True])
def test_the_report_says_from_which_starts_a_brush_holds(clips, march, monkeypatch, tmp_path, quick):
    row = {"start": "ring", "words": "a turning ring", "animals": 30, "polarization": [0.98, 0.2], "milling": [0.1] * 2}
    monkeypatch.setattr(learning, "with_other_starts", lambda *_: [row])
    monkeypatch.setattr(learning, "with_other_numbers", lambda *_: [])
    clip = clips["march"]
    found = Findings(march, [clip], clip, learned_as(march), clip)
    _compare(found, LearnOptions([tmp_path / "a.mp4"], tmp_path / "a.brush.toml", quick=quick), None, False)
    said = any("1 from a turning ring" in words for _, words in found.checks())
    assert said is not quick

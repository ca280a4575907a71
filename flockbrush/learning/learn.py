"""Learning brushes from clips: from the options of a user to the written files."""

from __future__ import annotations

import time
from contextlib import nullcontext
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from flockbrush.behaviours.brush import Brush, load_brush, shipped
from flockbrush.behaviours.brush_writer import brush_to_toml
from flockbrush.engine.files import held, refused, write_text
from flockbrush.film.observations import CannotObserve
from flockbrush.film.open_clip import facts_of, look_at, looked_apart, tell_notes, training_begun
from flockbrush.film.track_files import is_tracks
from flockbrush.learning.ablation import ablated
from flockbrush.learning.comparison import compared
from flockbrush.learning.folds import ClipFolds, Fold, folds_of, seen_within
from flockbrush.learning.group_size_test import with_other_numbers
from flockbrush.learning.helpers import Helpers
from flockbrush.learning.initial_conditions import start_of
from flockbrush.learning.learn_options import (
    QUICK_STARTS,
    LearnOptions,
    brush_files,
    check_fields,
    check_photo,
    checked,
    region_out,
    state_of,
)
from flockbrush.learning.learn_tables import show_findings
from flockbrush.learning.learned_brush import brush_of, name_of
from flockbrush.learning.learned_parameters import Learned
from flockbrush.learning.learned_program import program_of
from flockbrush.learning.model_choice import AUTO, comparison_of, hopeless, kind_of, nearest
from flockbrush.learning.model_fit import learned_model
from flockbrush.learning.other_starts import with_other_starts
from flockbrush.learning.photo import SPEED, standing
from flockbrush.learning.recipe import USE, SearchSettings, learn
from flockbrush.learning.regions import Region
from flockbrush.learning.report import as_json, write_overview, write_partial, write_report
from flockbrush.learning.report_folder import make_folder
from flockbrush.learning.result import Findings
from flockbrush.learning.side_by_side import moments_beside
from flockbrush.learning.simulate import simulated
from flockbrush.learning.verdict import RUNS as JUDGED_RUNS
from flockbrush.learning.verdict import combined, judge, once_fitted
from flockbrush.learning.which_model import HERD, ModelComparison
from flockbrush.learning.words_of_tracks import words_for
from flockbrush.runs.cluster import cluster
from flockbrush.runs.compile_ahead import compiling_for
from flockbrush.runs.terminal import Interrupts, Stopped, measure, number, print_json, progress, say

RUNS = 3  # simulations compared with the clip
MOMENTS, MOMENTS_OF_PHOTO = 4, 2  # pictures of a report
BUDGET, QUICK_BUDGET = 150.0, 12.0  # s of learning, as `learn` counts them
THOROUGH = 4.0  # times the usual budget
ONE_KIND, STRANGE = ("polarization", "milling", "speeds"), 2.5  # limits beyond which a clip shows another herd
RIVAL_WORK = 400_000  # animals times frames, above which fewer of the shipped brushes are tried


@dataclass
class BrushTask:
    """One brush to be learned: from whole clips, or from a region of one."""

    out: Path
    seen: list[ClipFolds]
    region: Region | None = None
    notes: list[str] = field(default_factory=list)
    kind: str = HERD  # of model
    hopeless: float = np.inf  # score beyond which a search of another kind ends soon
    program: Path | None = None  # of its states, if animals stand and walk by turns

    def state(self, number=0) -> Path:
        """Where the learning of the so-manieth part keeps what it has, to go on after an interruption."""
        return state_of(self.out, number)

    def forget(self, parts):
        """Remove what the learning of the first parts kept."""
        for part in range(parts):
            self.state(part).unlink(missing_ok=True)


def learn_brushes(wishes: LearnOptions) -> list[Findings]:
    """Learn the brushes, write them and their reports, print what came of it, and return it.

    Raises
    ------
    ProblemsError
        When a clip or a mask cannot be learned from; a partial report tells what was seen.
    Stopped
        When the user interrupts it: the best so far is written.
    """
    regions = checked(wishes)
    outputs = [*brush_files(wishes, regions), *([wishes.report] if wishes.report else [])]
    crew = cluster(*wishes.workers) if wishes.workers else nullcontext()
    rehearsed = compiling_for("flockbrush.learning.rehearsal:rehearse")
    helpers = wishes.helpers if wishes.helpers.jobs == wishes.jobs else Helpers(wishes.jobs)
    with Interrupts() as interrupts, rehearsed, held(*outputs), crew as wishes.crew, helpers as wishes.helpers:
        try:
            seen = [_looked(clip, wishes) for clip in wishes.clips]
        except KeyboardInterrupt:
            say("stopped before learning began; no file was written")
            raise Stopped from None
        herds = _herds(wishes, seen, regions)
        learned_from = [part for herd in herds for one in herd.seen for part, _ in one.parts]
        check_fields(learned_from + [one.whole for herd in herds for one in herd.seen], wishes)
        found: list[Findings] = []
        for herd in herds:
            found.append(_learned_herd(herd, wishes, interrupts))
            if found[-1].learned.interrupted or interrupts.asked:
                break
        if wishes.report is not None and regions:
            write_overview(wishes.report, wishes.clips[0], wishes.looking.regions, found)
    if not wishes.silent:
        _tell(wishes, found, herds)
    if interrupts.asked:
        if missing := [name_of(herd.out) for herd in herds[len(found) :]]:
            say(f"stopped; no brush was learned for {', '.join(missing)}")
        raise Stopped
    return found


# what the clips show ---------------------------------------------------------------------------


def _looked(clip, wishes) -> ClipFolds:
    """The observations of one clip; if it shows too little, the report gives the reason."""
    try:
        looking = wishes.looking if is_tracks(clip) else replace(wishes.looking, body_length_m=None)  # see `length_m`
        how = clip, looking
        apart, alone = (wishes.share, not wishes.quick), len(wishes.clips) == 1  # of several clips each is held out
        begun = training_begun(*how, *apart, wishes.helpers) if alone else []
        whole = look_at(*how)
        parts = looked_apart(*how, whole, *apart, begun) if alone else []
    except CannotObserve as error:
        facts = getattr(error, "seen", None)
        if wishes.report is not None and facts:
            make_folder(wishes.report)
            page = write_partial(wishes.report, clip, str(error), _all_seen(clip, facts), wishes.command)
            say(f"wrote {page}, with the observations so far")
        raise
    if not wishes.silent:
        tell_notes(clip, whole)
    if whole.still:
        check_photo(clip, wishes)
        return ClipFolds(standing(whole, SPEED if wishes.speed is None else wishes.speed))
    return ClipFolds(whole, tuple(parts))


def _all_seen(clip, seen):
    """Facts of the file and of its observation."""
    facts = facts_of(clip)
    return facts | seen | {"pictures": facts.get("pictures", {}) | seen.get("pictures", {})}


def _herds(wishes, seen: list[ClipFolds], regions) -> list[BrushTask]:
    if not regions:
        return [BrushTask(wishes.out, seen)]
    made = []
    for region in regions:
        part = seen_within(seen[0], region)
        if part is None:
            say(f"{region.colour}: almost no animals are in this region; no brush is learned from it")
            continue
        made.append(BrushTask(region_out(wishes.out, region), [part], region))
    if not made:
        raise refused(wishes.looking.regions, "none of its regions contains animals")
    return made


# one brush ------------------------------------------------------------------------------------


def _learned_herd(herd: BrushTask, wishes: LearnOptions, interrupts) -> Findings:
    """Learn a brush of each fold and judge it by what was held out, then fit all frames, and write brush and report."""
    began = time.perf_counter()
    photo, folds = _is_photo(herd.seen[0].whole), folds_of(herd.seen)
    interrupts.gently()
    wished = HERD if wishes.model == AUTO and (wishes.quick or wishes.ablate) else wishes.model
    kind = kind_of(wished, [seen.whole for seen in herd.seen], photo)
    later = wishes.helpers.later(comparison_of, folds[0].clips, wishes.seed) if kind == AUTO else None
    herd.kind, models, judged = HERD if kind == AUTO else kind, None, []
    for k, fold in enumerate(folds):
        learned = _learned(fold.clips, herd, wishes, interrupts, photo, part=k, of=len(folds))
        if k == 0 and later is not None and not interrupts.asked:
            models = later.result()
            learned = _nearest_kind(learned, models, fold, herd, wishes, interrupts, len(folds))
        judged.append(_found(herd, fold, learned, wishes))
        if k == 0 and len(herd.seen) == 1:
            write_text(herd.out, brush_to_toml(judged[0].brush))  # what was learned is safe from here on
        if not photo and not interrupts.asked:
            judged[-1].judgement = _judged(fold, judged[-1], wishes, interrupts)
        if interrupts.asked:
            break
    found = judged[0]
    found.models = models
    found.seconds["learning"] = time.perf_counter() - began
    if not interrupts.asked:
        found = _refitted(herd, judged, wishes, interrupts)
    if not interrupts.asked:
        began = time.perf_counter()
        _compare(found, wishes, interrupts, photo)
        if wishes.ablate:
            _ablate(found, folds, wishes, interrupts, herd)
        found.seconds["comparing"] = time.perf_counter() - began
        notes = [*found.notes, *filter(None, [found.counts_sentence(), found.starts_sentence()])]
        found.brush = _brush(herd, found.learned, found.clips, wishes, found.figures(), notes)
    elif not found.learned.interrupted:  # a part that comes after it was
        found.learned = replace(found.learned, interrupted=True)
        found.brush = _brush(herd, found.learned, found.clips, wishes)
    write_text(herd.out, brush_to_toml(found.brush))
    load_brush(herd.out)  # it reads back
    program = program_of(found.brush, found.clips)
    herd.program = None if program is None else program.write(herd.out)[0]
    if not found.learned.interrupted and not (interrupts.asked and herd.region):  # other regions go on
        herd.forget(len(folds) + 1)
    if wishes.report is not None:
        make_folder(wishes.report)
        folder = wishes.report if herd.region is None else wishes.report / found.brush.name
        make_folder(folder)
        write_report(found, folder, wishes.helpers)
    return found


def _nearest_kind(learned, models: ModelComparison, fold, herd: BrushTask, wishes, interrupts, of) -> Learned:
    """What was learned as the herd or as kinds of models that contend with it: the `nearest`."""
    tried, herd.hopeless = [learned], hopeless(learned)
    for herd.kind in models.contenders:
        tried.append(_learned(fold.clips, herd, wishes, interrupts, False, of=of))
    learned = nearest(tried, models.likelier)
    herd.kind, herd.hopeless = learned.kind, np.inf
    models.learned = learned.kind
    herd.notes += [] if interrupts.asked else [models.sentence, models.decision]
    return learned


def _found(herd, fold: Fold, learned, wishes) -> Findings:
    brush = _brush(herd, learned, fold.clips, wishes)
    return Findings(brush, fold.clips, herd.seen[0].whole, learned, fold.held, command=wishes.command)


def _judged(fold: Fold, found: Findings, wishes, interrupts):
    """The judgement of a brush by the held-out frames, or by its own if there are none; None when interrupted."""
    frames = fold.held if fold.held is not None else fold.clips[0]
    beside = not wishes.quick if wishes.beside is None else wishes.beside
    rivals = _rivals(frames, found) if beside else {}
    with progress("testing the brush and others", 1000) as bar:

        def step(done, total):
            bar(1000 * done / total)
            interrupts.check()

        try:
            return judge(
                frames, found.brush, rivals, name=found.brush.name, seed=wishes.seed,
                runs=3 if wishes.quick else JUDGED_RUNS, say=step, helpers=wishes.helpers,
            )  # fmt: skip
        except (KeyboardInterrupt, Stopped):
            return None


def _refitted(herd: BrushTask, judged: list[Findings], wishes, interrupts) -> Findings:
    """The numbers fitted to all frames, begun with those of the folds; the first fold's if these do better there.

    Their judgement is that of the folds, whose brushes were learned without the frames they are judged by; the first
    fold's brush keeps its own.
    """
    first, wholes = judged[0], [seen.whole for seen in herd.seen]
    if first.judgement is None or (first.held is None and len(judged) == 1):
        return first
    together = combined([f.judgement for f in judged if f.judgement is not None])
    if wishes.quick and len(wholes) == 1:
        first.notes = ["Learned from the first part of the clip and tested on the rest: --quick fits no brush to all."]
        return first
    before = [f.learned for f in judged]
    learned = _learned(wholes, herd, wishes, interrupts, False, part=len(judged), of=len(judged), parts=before)
    again = _found(herd, Fold(wholes, first.held), learned, wishes)
    alone = replace(wishes, beside=False)
    checks, theirs = (
        [_judged(Fold([whole], None), found, alone, interrupts) for whole in wholes] for found in (again, first)
    )
    if interrupts.asked or None in (*checks, *theirs):
        return first
    herd.forget(len(judged) + 1)  # nothing is left to be continued
    _refuse_strangers(wholes, checks)
    parts = f"{len(judged)} parts of the clip" if len(judged) > 1 else "the second part"
    parts = "each clip" if len(wholes) > 1 else parts
    check, its = combined(checks), combined(theirs)
    if len(check.missed) > len(its.missed):
        first.judgement = once_fitted(first.judgement, its)
        first.notes = [
            f"Tested on {parts} in turn; a fit to all frames was worse, so the first of these fits was saved, with its "
            "own verdict."
        ]
        return first
    again.judgement, again.seconds, again.judged_brush = once_fitted(together, check), first.seconds, first.brush
    again.models = first.models
    again.notes = [f"Tested on {parts}, held out in turn; the parameters were then fitted to all frames."]
    return again


def _refuse_strangers(wholes, checks):
    """Refuse clips of which one is not met at all by the brush of all of them."""
    if len(wholes) < 2:
        return
    for whole, check in zip(wholes, checks, strict=True):
        far = [row for row in check.brush.rows if row.name in ONE_KIND and row.far > STRANGE]
        if far:
            told = ", ".join(f"{r.name} {measure(r.clip)} in this clip, {measure(r.herd)} simulated" for r in far)
            message = f"no single brush fits these clips: {told}; learn from each clip separately"
            raise refused(whole.name, words_for(whole)(message))


def _is_photo(whole):
    return bool((whole.fields.frames == whole.fields.frames[0]).all())


def _learned(
    clips, herd, wishes, interrupts, photo, use=USE, fresh=False, part=0, of=1, parts=(),
) -> Learned:  # fmt: skip
    """Run the recipe, and show the loss; ``part`` counts the runs for a brush, ``parts`` came of those before."""
    learnings = of if photo else 1 + of  # all frames are fitted at the end
    state, usual = herd.state(part), BUDGET / learnings
    budget = QUICK_BUDGET if wishes.quick else THOROUGH * usual if wishes.thorough else usual
    if herd.kind in (HERD, wishes.model) and not wishes.resume and not fresh:
        if state.exists():
            say(f"starting again: the state of an interrupted learning in {state} is discarded")
        state.unlink(missing_ok=True)
    if photo:
        use = use & {"density", "variance"}
    name = name_of(herd.out)
    with progress(f"learning {name}", 1000) as bar:

        def told(done, total, loss, text):
            bar(1000 * done / max(total, 1), f"{name}: {text}, loss {number(loss)}")

        starts = min(wishes.starts, QUICK_STARTS) if wishes.quick else wishes.starts
        how = {"jobs": wishes.helpers, "say": told, "stop": lambda: interrupts.asked > 0}
        if herd.kind != HERD:
            how |= {"quick": wishes.quick, "hopeless": herd.hopeless, "parts": [part.params for part in parts]}
            return learned_model(clips, herd.kind, wishes.seed, **how)
        begins = [(f"part {k + 1}", part.theta, part.extras) for k, part in enumerate(parts)] or None
        settings = SearchSettings(
            wishes.seed, starts, use, wishes.beta, budget, begins=begins, device=wishes.device, quick=wishes.quick,
        )  # fmt: skip
        return learn(clips, settings, cluster=wishes.crew, resume=None if fresh else state, **how)


def _brush(herd, learned, clips, wishes, figures={}, notes=()) -> Brush:  # noqa: B006  read only
    colour = herd.region.colour if herd.region is not None else None
    return brush_of(
        name_of(herd.out), learned, clips, seed=wishes.seed, figures=figures, length_m=wishes.length_m,
        licence=wishes.licence, colour=colour, notes=[*herd.notes, *notes],
    )  # fmt: skip


# how it does ------------------------------------------------------------------------------------


def _compare(found: Findings, wishes, interrupts, photo):
    """Fill in the results of simulations: on held-out frames, beside rivals, with other numbers of animals."""
    frames = found.held if found.held is not None else found.clips[0]
    brush = found.compared_brush
    asked, fields = (found.brush, start_of(frames, 0, 0, found.brush.body), wishes.seed), frames.fields
    starts = None if wishes.quick or photo or fields.enclosed else wishes.helpers.later(with_other_starts, *asked)
    sizes = *asked, fields
    counts = wishes.helpers.later(with_other_numbers, *sizes) if starts is None else None  # one thing beside the rest
    runs = [simulated(frames, brush, seed) for seed in range(1 if wishes.quick else RUNS)]
    found.comparison = compared(frames, runs)
    if wishes.report is not None:
        many = MOMENTS_OF_PHOTO if photo else MOMENTS
        found.moments = moments_beside(wishes.clips[0], frames, runs[0], brush, many)
    found.counts = with_other_numbers(*sizes) if counts is None else counts.result()
    found.starts = [] if starts is None else starts.result()


def _rivals(frames, found) -> dict[str, Brush]:
    """The shipped brushes of the model that were not learned, at the clip's speed; fewer for a large clip."""
    library = shipped()
    papers = {name: library.get(name) for name in library.names()}
    names = [name for name, brush in papers.items() if brush.model == "herd" and brush.provenance.kind != "learned"]
    if np.median(frames.fields.count) * len(frames.fields) > RIVAL_WORK / 10:
        names = names[:: max(1, len(names) // 4)]
    return {name: papers[name].model_copy(update={"speed": found.learned.speed}) for name in names}


def _ablate(found, folds, wishes, interrupts, herd):
    """Fill in what comes of the first fold without parts of the method: its brush is the one that is compared."""
    frames = found.held if found.held is not None else found.clips[0]

    def without(part):
        return _learned(folds[0].clips, herd, wishes, interrupts, False, USE - {part}, fresh=True, of=len(folds))

    found.ablations = ablated(wishes.ablate, frames, found.comparison, without, say)


# messages ----------------------------------------------------------------------------------------


def _tell(wishes, found: list[Findings], herds):
    if wishes.json:
        files = [{"file": str(h.out)} | ({"program": str(h.program)} if h.program else {}) for h in herds]
        print_json({"brushes": [as_json(f) | file for f, file in zip(found, files, strict=False)]})
    else:
        for findings in found:
            show_findings(findings)
    for findings, herd in zip(found, herds, strict=False):
        say(("" if len(herds) == 1 else f"{findings.brush.name}: ") + findings.verdict())
        resumable = findings.learned.interrupted and herd.state().exists()  # the search of no other kind is kept
        say(
            f"wrote {herd.out}"
            + (f"; continue with --resume ({herd.state()})" if resumable else "")
            + (f" and {herd.program}, with a brush of each state" if herd.program else "")
        )
    if wishes.report is not None:
        say(f"wrote {wishes.report / 'report.html'}")

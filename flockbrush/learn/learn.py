"""Learning brushes from clips, from what a person asked for to the files that come of it."""

from __future__ import annotations

import os
import time
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from behaviours.brush import Brush, load_brush, shipped
from behaviours.brush_writer import brush_to_toml
from behaviours.learning.evidence import CannotObserve, Evidence
from behaviours.learning.learned import Learned
from behaviours.learning.recipe import USE, learn
from behaviours.learning.rollout import NAMES, Run
from behaviours.learning.setting import start_of
from behaviours.problems import ProblemsError
from flockbrush.files import output_problems, refused, write_text
from flockbrush.learn.ablation import ablated
from flockbrush.learn.brush import brush_of, name_of
from flockbrush.learn.clips import Looking, facts_of, look_at, needs_torch, parted, pictures_of, tell_notes
from flockbrush.learn.comparison import JUDGED, Comparison, compared
from flockbrush.learn.counts import with_other_numbers
from flockbrush.learn.findings import Findings, Rival
from flockbrush.learn.photo import SPEED, standing
from flockbrush.learn.regions import Region, regions_of, within
from flockbrush.learn.report import as_json, write_overview, write_partial, write_report
from flockbrush.learn.simulate import longest_way, simulated
from flockbrush.learn.stage import Stage
from flockbrush.terminal import (
    Interrupts,
    Stopped,
    compiling,
    measure,
    number,
    print_json,
    progress,
    say,
    show,
    table,
)

RUNS = 3  # simulations compared with the clip
MOMENTS, MOMENTS_OF_PHOTO = 4, 2  # pictures of a report
BUDGET, QUICK_BUDGET = 90.0, 12.0  # s of learning, as `learn` counts them
QUICK_STARTS = 2
RIVAL_WORK = 400_000  # animals times frames, above which fewer of the shipped brushes are tried


@dataclass
class Wishes:
    """What a person asked for."""

    clips: list[Path]
    out: Path
    looking: Looking = field(default_factory=Looking)
    beta: float = 0.5
    seed: int = 0
    starts: int = 5
    jobs: int = 1
    share: float = 0.5  # of a clip that is learned from
    report: Path | None = None
    ablate: tuple[str, ...] = ()
    speed: float | None = None
    length_m: float = 1.0
    licence: str | None = None
    resume: bool = False
    quick: bool = False
    json: bool = False
    command: str = ""


@dataclass
class Herd:
    """One brush to be learned: from whole clips, or from a region of one."""

    out: Path
    whole: list[Evidence]
    region: Region | None = None
    notes: list[str] = field(default_factory=list)

    @property
    def state(self) -> Path:
        """Where the learning keeps what it has, to go on after an interruption."""
        return self.out.with_name(name_of(self.out) + ".learning")


def learn_brushes(wishes: Wishes):
    """Learn the brushes, write them and their reports, and print what came of it.

    Raises
    ------
    ProblemsError
        When a clip or a mask cannot be learned from; a partial report tells what was seen.
    Stopped
        When somebody interrupted it: the best so far is written.
    """
    needs_torch()
    regions = _checked(wishes)
    with Interrupts() as interrupts, compiling():
        try:
            evidences = [_looked(clip, wishes) for clip in wishes.clips]
        except KeyboardInterrupt:
            say("stopped before anything was learned: nothing was written")
            raise Stopped from None
        herds = _herds(wishes, evidences, regions)
        found: list[Findings] = []
        for herd in herds:
            found.append(_learned_herd(herd, wishes, interrupts))
            if found[-1].learned.interrupted or interrupts.asked:
                break
    if wishes.report is not None and regions:
        write_overview(wishes.report, wishes.clips[0], wishes.looking.regions, found)
    _tell(wishes, found, herds)
    if interrupts.asked:
        raise Stopped


# before the work begins ---------------------------------------------------------------------


def _checked(wishes) -> list[Region]:
    """The regions of the mask, when all that can be known to be wrong is right."""
    name = name_of(wishes.out)
    looking = wishes.looking
    regions = regions_of(looking.regions) if looking.regions else []
    if regions and len(wishes.clips) > 1:
        raise refused(looking.regions, "a mask of regions belongs to one clip; several were given")
    outs = [_region_out(wishes.out, region) for region in regions] or [wishes.out]
    for out in outs:
        name_of(out)
    inputs = [*wishes.clips, *(p for p in (looking.regions, looking.obstacles) if p)]
    problems = output_problems(outs, inputs)
    if wishes.report is not None:
        problems += _folder_problems(wishes.report)
    state = Herd(outs[0], []).state
    if wishes.resume and not any(Herd(out, []).state.exists() for out in outs):
        problems += refused(state, f"there is nothing to resume of {name}; leave out --resume").problems
    if problems:
        raise ProblemsError(problems)
    return regions


def _folder_problems(folder):
    if folder.is_dir():
        return []
    if folder.exists():
        return refused(folder, "is a file; a report needs a folder").problems
    if folder.parent.is_dir() and not os.access(folder.parent, os.W_OK):
        return refused(folder, f"the folder {str(folder.parent)!r} may not be written to").problems
    if not folder.parent.is_dir():
        return refused(folder, f"there is no folder {str(folder.parent)!r} to make it in").problems
    return []


def _make_folder(folder):
    try:
        folder.mkdir(exist_ok=True)
    except OSError as error:
        raise refused(folder, f"cannot be made: {error.strerror}") from None


def _region_out(out, region):
    return out.with_name(f"{name_of(out)}-{region.word}.brush.toml")


# what the clips show ---------------------------------------------------------------------------


def _looked(clip, wishes) -> Evidence:
    """What one clip tells; where it tells nothing, the report says why."""
    try:
        seen = look_at(clip, wishes.looking)
    except CannotObserve as error:
        facts = getattr(error, "seen", None)
        if wishes.report is not None and facts:
            _make_folder(wishes.report)
            page = write_partial(wishes.report, clip, str(error), _all_seen(clip, facts), wishes.command)
            say(f"wrote {page}: what was seen up to there")
        raise
    tell_notes(clip, seen)
    if seen.still:
        return standing(seen, SPEED if wishes.speed is None else wishes.speed)
    if wishes.speed is not None:
        say(f"{clip}: --speed was left out: it is for photographs, and a film tells how fast its animals go")
    return seen


def _all_seen(clip, seen):
    """What the file is, and what was seen of it."""
    facts = facts_of(clip)
    return facts | seen | {"pictures": facts.get("pictures", {}) | seen.get("pictures", {})}


def _herds(wishes, evidences, regions) -> list[Herd]:
    if not regions:
        return [Herd(wishes.out, evidences)]
    made = []
    for region in regions:
        part = within(evidences[0], region)
        if part is None:
            say(f"{region.colour}: hardly an animal is in this region; no brush is learned of it")
            continue
        made.append(Herd(_region_out(wishes.out, region), [part], region))
    if not made:
        raise refused(wishes.looking.regions, "no animals are in any of its regions")
    return made


# one brush ------------------------------------------------------------------------------------


def _learned_herd(herd: Herd, wishes: Wishes, interrupts) -> Findings:
    """Learn one brush, write it, compare it, write it again with what was found, and its report."""
    began = time.perf_counter()
    photo = _is_photo(herd.whole[0])
    parts = [(whole, None) if photo else parted(whole, wishes.share) for whole in herd.whole]
    clips, held = [first for first, _ in parts], parts[0][1]
    interrupts.gently()
    learned = _learned(clips, herd, wishes, interrupts, photo)
    found = Findings(_brush(herd, learned, clips, wishes), clips, herd.whole[0], learned, held, command=wishes.command)
    found.seconds["learning"] = time.perf_counter() - began
    write_text(herd.out, brush_to_toml(found.brush))  # what was learned is safe from here on
    if not interrupts.asked:
        began = time.perf_counter()
        _compare(found, wishes, interrupts, photo)
        if wishes.ablate and photo:
            say("nothing was ablated: one picture tells too little for that")
        elif wishes.ablate:
            _ablate(found, wishes, interrupts, herd)
        found.seconds["comparing"] = time.perf_counter() - began
        found.brush = _brush(herd, learned, clips, wishes, found.figures(), _counted(found))
        write_text(herd.out, brush_to_toml(found.brush))
    load_brush(herd.out)  # it reads back
    if not learned.interrupted:
        herd.state.unlink(missing_ok=True)
    if wishes.report is not None:
        _make_folder(wishes.report)
        folder = wishes.report if herd.region is None else wishes.report / found.brush.name
        _make_folder(folder)
        write_report(found, folder)
    return found


def _is_photo(whole):
    return bool((whole.fields.frames == whole.fields.frames[0]).all())


def _learned(clips, herd, wishes, interrupts, photo, use=USE, fresh=False) -> Learned:
    """The recipe, with a bar that tells the loss."""
    if not wishes.resume and not fresh:
        if herd.state.exists():
            say(f"begun anew: what was kept of an interrupted learning in {herd.state} is given up")
        herd.state.unlink(missing_ok=True)
    if photo:
        use = use & {"density", "variance"}
    name = name_of(herd.out)
    with progress(f"learning {name}", 1000) as bar:

        def told(done, total, loss, text):
            bar(1000 * done / max(total, 1), f"{name}: {text}, loss {number(loss)}")

        return learn(
            clips,
            seed=wishes.seed,
            starts=min(wishes.starts, QUICK_STARTS) if wishes.quick else wishes.starts,
            jobs=wishes.jobs,
            use=use,
            beta=wishes.beta,
            budget_s=QUICK_BUDGET if wishes.quick else BUDGET,
            say=told,
            stop=lambda: interrupts.asked > 0,
            resume=None if fresh else herd.state,
        )


def _brush(herd, learned, clips, wishes, figures={}, notes=()) -> Brush:  # noqa: B006  read only
    return brush_of(
        name_of(herd.out),
        learned,
        clips,
        seed=wishes.seed,
        figures=figures,
        length_m=wishes.length_m,
        licence=wishes.licence,
        colour=herd.region.colour if herd.region is not None else None,
        notes=[*herd.notes, *notes],
    )


def _counted(found):
    """A sentence about other numbers of animals."""

    def not_kept(row):
        strayed = found.strayed(row)
        return f" (not as in the clip: {strayed})" if strayed else ""

    if found.counts:
        told = "; ".join(
            f"{r['animals']} animals: polarization {r['polarization']:.2f}, milling {r['milling']:.2f}, nearest "
            f"neighbour {r['spacing']:.2f} BL{not_kept(r)}"
            for r in found.counts
        )
        yield f"On an endless plane, 10 to 20 s after a start like the clip's: {told}."


# how it does ------------------------------------------------------------------------------------


def _compare(found: Findings, wishes, interrupts, photo):
    """Fill in what simulations say: on the frames held out, against others, with other numbers."""
    frames = found.held if found.held is not None else found.clips[0]
    frames = replace(frames, sightings=None) if photo else frames  # axes are no headings
    runs = [simulated(frames, found.brush, seed) for seed in range(1 if wishes.quick else RUNS)]
    found.comparison = compared(frames, runs)
    if not photo:
        found.rivals = _rivals(frames, found, interrupts)
    if interrupts.asked:
        return
    found.counts = with_other_numbers(found.brush, start_of(frames, 0, 0, found.brush.body), wishes.seed)
    if wishes.report is not None:
        many = MOMENTS_OF_PHOTO if photo else MOMENTS
        found.moments = moments_of(wishes.clips[0], frames, runs[0], found.brush, many)


def _rivals(frames, found, interrupts) -> list[Rival]:
    """The brush, random numbers, and the shipped brushes of the model that were not learned, on the same frames."""
    learned = found.learned
    library = shipped()
    papers = {name: library.get(name) for name in library.names()}
    names = [name for name, brush in papers.items() if brush.model == "herd" and brush.provenance.kind != "learned"]
    if np.median(frames.fields.count) * len(frames.fields) > RIVAL_WORK / 10:
        names = names[:: max(1, len(names) // 4)]
    tried = {"random numbers": found.brush.with_parameters(**_random())}
    tried |= {name: library.get(name).model_copy(update={"speed": learned.speed}) for name in names}
    rows = [_rival(found.brush.name, found.comparison)]
    with progress("trying other brushes", len(tried)) as bar:
        for k, (name, brush) in enumerate(tried.items()):
            if interrupts.asked:
                break
            rows.append(_rival(name, compared(frames, [simulated(frames, brush)])))
            bar(k + 1)
    return rows


def _random():
    theta = np.random.default_rng(1).uniform(0.05, 1.0, 12)
    return dict(zip(NAMES, theta.tolist(), strict=True))


def _rival(name, comparison: Comparison) -> Rival:
    errors = {measure: comparison.verdict(measure).off for measure in JUDGED}
    figures = comparison.figures("-")
    wrong, velocity = (figures[f"- {error}"] for error in ("symmetric density error", "velocity error"))
    return Rival(name, errors, wrong, velocity, comparison.unlike)


def _ablate(found, wishes, interrupts, herd):
    frames = found.held if found.held is not None else found.clips[0]

    def without(part):
        return _learned(found.clips, herd, wishes, interrupts, False, USE - {part}, fresh=True)

    found.ablations = ablated(wishes.ablate, frames, found.comparison, without, say)


def moments_of(clip, frames: Evidence, run: Run, brush, count=MOMENTS) -> list[np.ndarray]:
    """Clip beside simulation at some moments, (h, w, 3) RGB."""
    total = len(frames.fields)
    chosen = np.unique(np.linspace(0, total - 1, count).round().astype(int))
    pictures, scale = pictures_of(clip, frames, chosen)
    stage = Stage(frames, brush, [longest_way(run)], scale)
    made = []
    for t in range(total):  # every frame, for the trails
        rows = run.of(t)
        seconds = float(run.times[t])
        if t in pictures:
            filmed = "photograph" if _is_photo(frames) else f"clip, frame {frames.fields.frames[t]}"
            words = (filmed, f"{brush.name}, after {seconds:.1f} s")
            made.append(stage.beside(pictures[t], t, run.xy[rows], run.forward[rows], seconds, words, run.ids[rows]))
        else:
            stage.herd(run.xy[rows], run.forward[rows], seconds, run.ids[rows])
    return made


# what a person is told -----------------------------------------------------------------------------


def _tell(wishes, found: list[Findings], herds):
    if wishes.json:
        print_json({"brushes": [as_json(f) | {"file": str(h.out)} for f, h in zip(found, herds, strict=False)]})
    else:
        for findings in found:
            _show(findings)
    for findings, herd in zip(found, herds, strict=False):
        say(("" if len(herds) == 1 else f"{findings.brush.name}: ") + findings.verdict())
        say(f"wrote {herd.out}" + (f"; go on with --resume ({herd.state})" if findings.learned.interrupted else ""))
    if wishes.report is not None:
        say(f"wrote {wishes.report / 'report.html'}")


def _show(findings: Findings):
    """The chief figures as tables."""
    if findings.comparison is not None:
        show(_against_film(findings) if findings.motion else _against_photograph(findings))
    for title, rows in (
        ("with other numbers of animals", [r | {"not kept": findings.strayed(r) or "-"} for r in findings.counts]),
        ("left out, one at a time: mean errors", findings.ablations),
    ):
        if rows:
            columns = list(rows[0])
            made = table(*columns, title=title, right=columns[1:])
            for row in rows:
                made.add_row(*(_word(column, value) for column, value in row.items()))
            show(made)


def _against_film(findings):
    comparison = findings.comparison
    what = "frames held out" if findings.held is not None else "frames learned from"
    title = f"{findings.brush.name}: {what}, {comparison.times[-1]:.1f} s"
    made = table("measure", "clip", "±", "simulated", "off by", "allowed", "", title=title, right=_NUMBERS)
    for v in comparison.verdicts():
        judged = v.name in JUDGED
        met = ("met" if v.met else "MISSED") if judged else ""
        allowed = measure(v.allowed) if judged else ""
        cells = [measure(x) for x in (v.clip, v.clip_deviation, v.herd, v.off)]
        made.add_row(v.name, *cells, allowed, met)
    return made


def _against_photograph(findings):
    title = f"{findings.brush.name}: against the photograph, {findings.comparison.times[-1]:.1f} s simulated"
    made = table("measure", "photograph", "simulated", "off by", title=title, right=_NUMBERS)
    for v in findings.comparison.verdicts():
        made.add_row(v.name, *map(measure, (v.clip, v.herd, v.off)))
    return made


def _word(column, value):
    """A cell of a table."""
    if isinstance(value, str):
        return value
    return number(value) if isinstance(value, int) or column == "factor" else measure(value)


_NUMBERS = "clip", "photograph", "±", "simulated", "off by", "allowed"

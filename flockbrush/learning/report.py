"""The report of a learned brush: a self-contained HTML page, its pictures as files, and figures.json."""

from __future__ import annotations

import json
import shlex
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from flockbrush.behaviours.brush_writer import brush_to_toml
from flockbrush.engine.files import whole, write_text
from flockbrush.learning.ablation import PARTS
from flockbrush.learning.comparison import ERRORS, TITLES
from flockbrush.learning.confounding import estimates_of
from flockbrush.learning.group_size_test import SECONDS
from flockbrush.learning.helpers import Helpers
from flockbrush.learning.html_page import ReportPage
from flockbrush.learning.learned_brush import sentence
from flockbrush.learning.learning_charts import ORDER, is_told, panels_of
from flockbrush.learning.model_choice import add_models
from flockbrush.learning.model_choice import as_json as models_as_json
from flockbrush.learning.report_folder import FIGURES, MOMENTS, OWN, PAGE
from flockbrush.learning.report_judgement import add_judgement, judgement_as_json
from flockbrush.learning.report_parameters import add_parameters
from flockbrush.learning.result import KEPT, Findings
from flockbrush.learning.side_by_side import halves_of
from flockbrush.output.figures import ChartPanel, CurveChart, figure_of, pixels_of
from flockbrush.render import write_png
from flockbrush.render.style import theme_of
from flockbrush.runs.terminal import finite, measure, number

ON_PAGE = replace(theme_of("light"), paper=(255, 255, 255))
SCALE = 2  # pixels of a chart to one of the page: sharp on paper
SEARCHED = 10  # starts in the table, the best first
WORDS = {
    "moments": "Left: the stabilised clip. Right: a simulation with the learned brush, from the same start, with the "
    "same scale and camera. The simulation runs freely: its animals do not correspond to single animals of the clip.",
    "photograph": "Left: the photograph. Right: the simulated herd, which starts with the density of the photograph in "
    "each cell.",
    "order": "Uncoloured: the clip, with the band of values that count as equal (two standard deviations of the clip, "
    "at least .05). Red: the simulations; the thick line is their mean. Polarization is 1 if all animals head in one "
    "direction. Milling is 1 if all animals rotate about the centre.",
    "errors": "Growth of the density and velocity errors with time, as means over the simulations; always quote them "
    "with their horizon. The density error of the paper counts only cells that the simulation occupies; the share of "
    "animals in the wrong cell counts all cells.",
    "crowd": "Spacing and order of neighbours. Uncoloured: the clip. Red: the simulations.",
    "parameters": "Large discs: the brush. Small discs: other starts of the search, connected if they fit the clip "
    "about equally well. Red: identifiable from the clip. Grey: not identifiable from this clip; other values fit "
    "equally well, so grey values are not facts about the species.",
    "loss": "All starts of the search; the chosen start is red.",
    "neighbours": "Positions of neighbours around an animal that faces up, seen from above (the radial density "
    "histogram).",
}

PAPER = (
    'Model, measures, "the paper": Gong, X. et al. (2025). Herds from video: learning a microscopic herd model from '
    "macroscopic motion data. Computer Graphics Forum 44(6), e70225."
)
FACTS = {"share of the picture": "share detected as animals", "share that differs": "share that moves"}
LOOKED_AT = {"ground": "The ground without the moving animals."}  # what pictures of a refused clip show


def write_report(findings: Findings, folder, helpers: Helpers | None = None) -> list[Path]:
    """Write report.html, its pictures and figures.json.

    Parameters
    ----------
    folder : path
        Must be there.
    helpers : Helpers, optional
        Processes that draw a part of the charts.

    Returns
    -------
    list of Path
        The page first.
    """
    folder, helpers = Path(folder), helpers or Helpers()
    panels = panels_of(findings)
    drawn = dict(helpers.run(_drawn, [(panel,) for some in panels.values() for panel in some]))
    drawings = (drawn[k] for k in range(len(drawn)))
    charts = {name: [(panel, next(drawings)) for panel in some] for name, some in panels.items()}
    pictures = {f"moment-{k + 1}": image for k, image in enumerate(findings.moments)}
    pictures |= {name: _sheet([drawing for _, drawing in some]) for name, some in charts.items()}
    for name in {*OWN, *MOMENTS} - pictures.keys():  # of a report that was here before
        (folder / f"{name}.png").unlink(missing_ok=True)
    written = [folder / PAGE]
    write_text(written[0], page_of(findings, charts).text())
    for name, image in pictures.items():
        written.append(folder / f"{name}.png")
        with whole(written[-1]) as temporary:
            write_png(temporary, image)
    written.append(folder / FIGURES)
    write_text(written[-1], json.dumps(finite(as_json(findings)), indent=1, ensure_ascii=False) + "\n")
    return written


def _drawn(panel):
    """A chart of the page, (h, w, 3)."""
    return pixels_of(figure_of([panel], theme=ON_PAGE))


def _sheet(drawings):
    """Drawings of one width on a sheet, two beside one another, (h, w, 3)."""
    rows = [drawings[k : k + 2] for k in range(0, len(drawings), 2)]
    heights, wide = [max(len(one) for one in row) for row in rows], drawings[0].shape[1]
    sheet = np.empty((sum(heights), wide * min(2, len(drawings)), 3), np.uint8)
    sheet[:] = ON_PAGE.paper
    for row, top in zip(rows, np.cumsum([0, *heights]), strict=False):
        for k, one in enumerate(row):
            sheet[top : top + len(one), k * wide : (k + 1) * wide] = one
    return sheet


def as_json(findings: Findings) -> dict:
    """What --json prints of one brush."""
    learned, comparison = findings.learned, findings.comparison
    found: dict[str, Any] = {
        "brush": findings.brush.name,
        "verdict": findings.verdict(),
        "interrupted": learned.interrupted,
        "parameters": dict(zip(learned.names, np.asarray(learned.values).tolist(), strict=True)),
        "identifiable": [n for n, sure in zip(learned.names, learned.identifiable, strict=True) if sure],
        "spread": dict(zip(learned.names, np.asarray(learned.spread).tolist(), strict=True)),
        "estimates": [vars(one) | {"told": one.told} for one in estimates_of(learned)],
        "extras": learned.extras,
        "speed": learned.speed.model_dump(),
        "starts": [
            {"name": a.name, "seed": a.seed, "score": a.score, "theta": a.theta, "steps": len(a.loss)}
            for a in learned.starts
        ],
        "chosen": learned.chosen,
        "figures": findings.figures(),
        "counts": findings.counts,
        "other_starts": findings.starts,
        "ablations": findings.ablations,
        "judgement": judgement_as_json(findings.judgement),
        "model": learned.kind,
        "models": models_as_json(findings.models, findings.words),
        "seconds": findings.seconds,
        "command": findings.command,
    }
    if findings.judgement is not None:
        found["met"] = findings.judgement.kind == "like"
    if comparison is not None:
        found["compared"] = [vars(v) | {"off": v.off, "met": v.met} for v in comparison.verdicts()]
        found["series"] = {"time": comparison.times, "frame": comparison.frames, "clip": comparison.clip}
        found["series"]["simulation"] = {name: comparison.herd(name) for name in comparison.herds[0]}
    return found


# the page -----------------------------------------------------------------------------------


def page_of(findings: Findings, charts: dict[str, list[tuple[ChartPanel, np.ndarray]]]) -> ReportPage:
    """The report as a page; ``charts`` are the panels of `panels_of`, each with its drawing."""
    page = ReportPage(f"{findings.brush.name}: a brush learned from {Path(findings.whole.name).name}", findings.words)
    page.say(findings.verdict(), "lead")
    page.checks(findings.checks())
    page.say(findings.brush.description, "small")
    page.contents()
    _moments(page, findings)
    if findings.comparison is not None:
        _compared(page, findings, charts)
    add_judgement(page, findings.judgement)
    add_models(page, findings.models)
    add_parameters(page, findings, lambda: _show(page, charts, "parameters"))
    _searched(page, findings, charts)
    _counts(page, findings)
    _ablations(page, findings)
    _seen(page, findings)
    _again(page, findings)
    return page


def _moments(page, findings):
    if not findings.moments:
        return
    page.head("Clip and simulation" if findings.motion else "Photograph and simulation")
    last = len(findings.moments) - 1
    times = findings.comparison.times if findings.comparison is not None else [0.0]
    whole = "The clip" if findings.motion else "The photograph"
    for k, image in enumerate(findings.moments):
        after = f"{times[-1] * k / max(last, 1):.1f} s after the start"
        told = zip(halves_of(image), (f"{whole}, {after}", f"The simulated herd, {after}"), strict=True)
        words = WORDS["moments" if findings.motion else "photograph"] if k == last else ""
        page.pictures(list(told), words, photograph=True)


def _show(page, charts, name, more=""):
    if name in charts:
        drawings = [(drawing, f"{panel.title}. {_lines_in(panel)}".strip()) for panel, drawing in charts[name]]
        page.pictures(drawings, f"{WORDS[name]} {more}".strip(), SCALE)


def _lines_in(panel):
    """The means of a chart's curves, as text for readers who cannot see the chart."""
    if not isinstance(panel, CurveChart):
        return ""
    last = {
        line.name: line
        for line in panel.curves
        if len(line.y) and line.name in ("clip", "tracks", "photograph", "simulation", "mean of simulations")
    }
    said = {"mean of simulations": "simulations"}
    told = ", ".join(
        f"{said.get(name, name)} {measure(np.nanmean(line.y))}"
        for name, line in last.items()
        if np.isfinite(line.y).any()
    )
    return f"Mean: {told}." if told else ""


def _compared(page, findings, charts):
    comparison = findings.comparison
    page.head(
        "Comparison on the held-out frames" if findings.held is not None
        else "Comparison on the frames it was learned from" if findings.motion else "Comparison with the photograph"
    )  # fmt: skip
    page.say(_frames_compared(findings))
    _measures(page, findings)
    page.say(_explained(findings), "small")
    _show(page, charts, "order", _untold(findings))
    _errors(page, comparison)
    for name in ("errors", "crowd", "neighbours"):
        _show(page, charts, name)


def _measures(page, findings):
    comparison = findings.comparison
    if not findings.motion:
        rows = [
            [TITLES[v.name], *map(measure, (v.clip, v.herd, v.herd_deviation, v.off))] for v in comparison.verdicts()
        ]
        page.table(["measure", "photograph", "simulated", "±", "difference"], rows)
        return
    rows = []
    for v in comparison.verdicts():
        met = (("met", "good") if v.met else ("missed", "bad")) if v.name in ORDER else ""
        cells = [v.clip, v.clip_deviation, v.herd, v.herd_deviation, v.off]
        rows.append(
            [TITLES[v.name], met, *map(measure, cells), measure(v.allowed) if met else "", measure(v.frame_error)]
        )
    columns = ["measure", "", "clip", "±", "simulated", "±", "difference", "allowed", "per-frame error"]
    page.table(columns, rows, words=2)


def _frames_compared(findings):
    comparison = findings.comparison
    first, last = comparison.frames[[0, -1]]
    runs = len(comparison.herds)
    made = "One simulation" if runs == 1 else f"{runs} simulations with different random seeds, each"
    if not findings.motion:
        return f"{made} of {comparison.times[-1]:.1f} s, started with the density of the photograph."
    told = f"Frames {first} to {last}, {comparison.times[-1]:.2f} s. {made} started from the first of these frames."
    if len(findings.clips) > 1:
        told += f" Of the {len(findings.clips)} clips, the first is used for this comparison."
    if findings.judged_brush is not None:
        told += (
            " The brush shown here was learned from the other frames alone; the parameters in the file were fitted to "
            "all frames afterwards."
        )
    if findings.held is None:
        told += " The clip was too short to hold out a part: these figures are optimistic."
    return told


def _explained(findings):
    if not findings.motion:
        return (
            "±: standard deviation over the time. Directions: local variance of the body axes; random axes have about "
            "2700, and the paper assumes 3000 if the variance is not known."
        )
    return (
        "BL: body lengths. ±: standard deviation over the frames. Allowed: two standard deviations of the clip, at "
        "least .05. Per-frame error: mean difference between clip and simulation at the same time."
    )


def _untold(findings):
    """Names of the measures that this clip does not determine, with the reason."""
    comparison = findings.comparison
    missing = [TITLES[name].lower() for name in ORDER if not is_told(comparison, name)]
    if not missing or not findings.motion:
        return ""
    reasons = {TITLES["aspect"].lower(): " (needs a common direction)"}
    return "Not measurable in this clip: " + ", ".join(name + reasons.get(name, "") for name in missing) + "."


def _errors(page, comparison):
    """Density and velocity errors after some time."""
    told = {name: comparison.at_horizons(name) for name in ERRORS if np.isfinite(comparison.herd(name)).any()}
    if not told:
        return
    times = [time for time, _ in next(iter(told.values()))]
    rows = [
        [TITLES[name], *(measure(error) for _, error in series), measure(comparison.figures("-")[f"- {name}"])]
        for name, series in told.items()
    ]
    page.table(["error", *(f"after {time:.2f} s" for time in times), "mean"], rows)


def _searched(page, findings, charts):
    learned = findings.learned
    if not learned.starts:
        return
    page.head("The search")
    chosen = learned.starts[learned.chosen]
    bare = f"The chosen start, {chosen.name}, has no curve: it was used without a search."
    _show(page, charts, "loss", "" if len(chosen.loss) else bare)
    shown = sorted((a for a in learned.starts if np.isfinite(a.score)), key=lambda a: a.score)[:SEARCHED] or [chosen]
    rows = [[a.name, len(a.loss), measure(a.score, 2)] for a in shown]
    page.table(["start", "steps", "distance to the clip"], rows, chief=[k for k, a in enumerate(shown) if a is chosen])
    left = len(learned.starts) - len(shown)
    page.say(
        "Distance to the clip: on the frames learned from, in standard deviations of the clip."
        + (f" {left} other starts were worse or were dropped; figures.json lists all." if left else ""), "small",
    )  # fmt: skip


def _counts(page, findings):
    if not findings.counts:
        return
    page.head("With other numbers of animals")
    page.say(
        f"Herds of the same density, simulated for {SECONDS:g} s {findings.ground}; means over the last ten seconds. "
        + (
            f"Not kept: measures that differ from the clip by more than {KEPT:g}, corrected for chance in small herds."
            if findings.motion
            else ""
        )
    )
    rows = []
    for r in findings.counts:
        strayed = findings.strayed(r)
        kept = [(strayed, "bad") if strayed else ("nothing", "good")] if findings.motion else []
        figures = [measure(r[name]) for name in ("polarization", "milling", "spacing", "together")]
        rows.append([f"{r['factor']:g} times", f"{r['animals']:,}", *figures, *kept])
    columns = ["", "animals", "polarization", "milling", "nearest neighbour, BL", "share in one herd"]
    page.table([*columns, *(["not kept"] if findings.motion else [])], rows)


def _ablations(page, findings):
    if not findings.ablations:
        return
    page.head("Ablations")
    page.say(
        "Learned again without one part of the method; mean errors over the frames, as in the table of the paper. The "
        "growth of the errors shows the contribution of the part."
    )
    columns = list(findings.ablations[0])
    rows = [[row[c] if isinstance(row[c], str) else measure(row[c]) for c in columns] for row in findings.ablations]
    page.table([c.replace("_", " ") for c in columns], rows, chief=[0])
    parts = [(f"without {part}", f"not used: {words}") for part, words in PARTS.items()]
    page.facts(pair for pair in parts if any(row["method"] == pair[0] for row in findings.ablations))


def _seen(page, findings):
    page.head("Observations")
    for clip in findings.clips:
        f = clip.fields
        facts = [
            ("clip", Path(clip.name).name),
            ("SHA-256", clip.sha256),
            ("frames", f"{f.frames[0]} to {f.frames[-1]} at {clip.fps:g} per second"),
            ("animals in the picture", f"{np.median(f.count):.0f} ({f.count.min():.0f} to {f.count.max():.0f})"),
            ("one body length", clip.length_told),
            ("half body width", f"{clip.radius_bl:.2f} body lengths"),
            ("grid", f"{f.shape[1]} x {f.shape[0]} cells of {f.cell:.2g} body lengths"),
            ("single animals", _single(clip)),
        ]
        if clip.speed is not None:
            reversion = clip.speed.reversion
            told = "not identifiable" if reversion is None else f"{reversion:.2g} 1/s"
            facts.append(("speed", f"{clip.speed.mean:.3g} ± {clip.speed.deviation:.2g} body lengths/s"))
            facts.append(("reversion rate of the speed", told))
            if clip.speed.individual > 0:
                facts.append(("usual speeds of animals", f"differ by {clip.speed.individual:.2g} body lengths/s"))
            if clip.speed.common > 0:
                often = f"for about {clip.speed.common_time:.2g} s"
                facts.append(("common changes of speed", f"{clip.speed.common:.2g} body lengths/s, {often}"))
        page.facts(facts)
    notes = [*(note for clip in findings.clips for note in clip.notes), *findings.learned.notes]
    page.notes(dict.fromkeys(map(sentence, notes)))


def _single(clip):
    if clip.sightings is None or not len(clip.sightings.xy):
        return "could not be separated"
    return f"{len(clip.sightings.xy) / max(len(clip.sightings), 1):.0f} separated per frame"


def _again(page, findings):
    page.head("Reproduction")
    page.lines(findings.command)
    told = findings.brush.provenance
    facts = [("brush", f"{findings.brush.name}, of the model {findings.brush.model}"), ("learned on", str(told.date))]
    facts += [("by", told.by), ("seed", str(told.seed)), ("licence of the clip", told.licence or "not given")]
    page.facts([*facts, *((f"time for {name}", f"{value:.0f} s") for name, value in findings.seconds.items())])
    versions = told.versions
    page.say("Made with " + ", ".join(f"{name} {version}" for name, version in versions.items()) + ".", "small")
    page.say(PAPER, "small")
    page.lines(brush_to_toml(findings.brush), "The brush file")


# the report of a failed learning -------------------------------------------------------------


def write_partial(folder, clip, message: str, seen: dict, command="") -> Path:
    """Write a page about a clip that no brush could be learned from, with the observations so far.

    Parameters
    ----------
    folder : path
        Must be there.
    clip : path
    message : str
        What went wrong.
    seen : dict
        Facts by name; under "pictures" pictures by title, BGR.
    command : str
        That came to this.
    """
    page = ReportPage(f"No brush learned from {Path(clip).name}")
    page.say(message, "lead")
    seen = dict(seen)
    pictures = seen.pop("pictures", {})
    page.head("Observations")
    told = {name: number(value, 3) if isinstance(value, float) else value for name, value in seen.items()}
    page.facts((FACTS.get(name, name.replace("_", " ")), value) for name, value in told.items())
    for title, image in pictures.items():
        scale = max(1.0, image.shape[1] / 720)
        words, filmed = LOOKED_AT.get(title, title), image.ndim == 3
        page.pictures([(_coloured(image), title)], words, scale, photograph=filmed, paper=False)
    page.head("Suggestions")
    page.notes([sentence(message.split("; ", 1)[1])] if "; " in message else [])
    if pictures:
        page.say("Open the clip; pick the colour and the length of an animal; mark things that do not move:")
        page.lines(shlex.join(["flockbrush", "play", "--clip", str(clip)]))
        page.say("Then check with these options what is detected as animals, before learning:")
        page.lines(shlex.join(["flockbrush", "fields", str(clip), "--out", "seen.npz", "--preview", "seen.mp4"]))
    if command:
        page.head("Command")
        page.lines(command)
    path = Path(folder) / PAGE
    write_text(path, page.text())
    return path


def write_overview(folder, clip, mask, found: list[Findings]) -> Path:
    """Write a page with links to the reports of the regions of one clip, each in its own folder."""
    page = ReportPage(f"Brushes learned from regions of {Path(clip).name}")
    kept = sum(f.judgement is not None and f.judgement.kind == "like" for f in found)
    page.say(f"{kept} of {len(found)} simulated herds move like the film.", "lead")
    page.links((f"{f.brush.name}/report.html", f.brush.name, f.verdict()) for f in found)
    page.say(f"Region mask: {Path(mask).name}.", "small")
    for f in found:
        if f.moments:
            told = "The clip; other regions are pale", f"The simulated herd of {f.brush.name}"
            page.pictures(
                list(zip(halves_of(f.moments[len(f.moments) // 2]), told, strict=True)), f.brush.name, photograph=True
            )
    path = Path(folder) / PAGE
    write_text(path, page.text())
    return path


def _coloured(image):
    """Any picture as (h, w, 3) RGB uint8."""
    image = np.asarray(image)
    if image.dtype == bool:
        image = image.astype(np.uint8) * 255
    if image.ndim == 2:
        image = np.repeat(image[:, :, None], 3, axis=2)
    return np.ascontiguousarray(image[:, :, ::-1].astype(np.uint8))

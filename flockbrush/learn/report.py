"""The report of a learned brush: one page that needs nothing but itself, and its pictures as files."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np

from behaviours.brush_writer import brush_to_toml
from behaviours.learning.rollout import FORCES, NAMES
from flockbrush.draw import write_png
from flockbrush.files import whole, write_text
from flockbrush.learn.brush import plain, sentence
from flockbrush.learn.comparison import ERRORS, REACH, TITLES
from flockbrush.learn.findings import KEPT, Findings
from flockbrush.learn.page import Page
from flockbrush.learn.panels import CLIP, HERD, OTHER, SCALE, Chart, Line, Maps, Row, Rows, sheet
from flockbrush.terminal import finite, number

ORDER = "polarization", "milling", "milling in the picture", "aspect"
OWN = "order", "errors", "crowd", "neighbours", "parameters", "loss"  # pictures of a report, besides its moments
CROWD = "nearest neighbour", "density", "order nearby", "largest part"
WORDS = {
    "moments": "Left: the clip, stabilised. Right: the simulation with the learned brush, from the same start, at the "
    "same scale and camera. It is left alone: animals are not the same ones one by one.",
    "order": "Black: the clip, with the band that counts as the same (two of its own standard deviations, or .05). "
    "Red: the simulations. Polarization: 1 when all head one way. Milling: 1 when all go round.",
    "errors": "How far density and velocity drift from the clip as time goes on: quote the horizon with it. The "
    "paper's density error counts only cells the simulation occupies; the share of animals in the wrong cell is fair "
    "to both.",
    "crowd": "How the animals keep to one another.",
    "parameters": "Discs: the brush. Small discs: where other starts of the search ended. Grey: not told by the clip, "
    "other values describe it as well; do not read them as facts about the species.",
    "loss": "Every start of the search; red the one that was chosen.",
    "neighbours": "Where others stand about an animal that looks up, from above (the radial density histogram).",
}


def write_report(findings: Findings, folder) -> list[Path]:
    """Write report.html, its pictures and figures.json.

    Parameters
    ----------
    findings : Findings
    folder : path
        Must be there.

    Returns
    -------
    list of Path
        The page first.
    """
    folder = Path(folder)
    pictures = _pictures(findings)
    for name in {*OWN, *(f"moment-{k}" for k in range(1, 10))} - pictures.keys():  # of a report that was here before
        (folder / f"{name}.png").unlink(missing_ok=True)
    written = [folder / "report.html"]
    write_text(written[0], page_of(findings, pictures).text())
    for name, image in pictures.items():
        written.append(folder / f"{name}.png")
        with whole(written[-1]) as temporary:
            write_png(temporary, image)
    written.append(folder / "figures.json")
    write_text(written[-1], json.dumps(finite(as_json(findings)), indent=1, ensure_ascii=False) + "\n")
    return written


def as_json(findings: Findings) -> dict:
    """What --json prints of one brush."""
    learned, comparison = findings.learned, findings.comparison
    found: dict[str, Any] = {
        "brush": findings.brush.name,
        "verdict": findings.verdict(),
        "interrupted": learned.interrupted,
        "parameters": dict(zip(NAMES, np.asarray(learned.theta).tolist(), strict=True)),
        "identifiable": [n for n, sure in zip(NAMES, learned.identifiable, strict=True) if sure],
        "spread": dict(zip(NAMES, np.asarray(learned.spread).tolist(), strict=True)),
        "extras": learned.extras,
        "speed": learned.speed.model_dump(),
        "starts": [
            {"name": a.name, "seed": a.seed, "score": a.score, "theta": a.theta, "steps": len(a.loss)}
            for a in learned.starts
        ],
        "chosen": learned.chosen,
        "figures": findings.figures(),
        "counts": findings.counts,
        "ablations": findings.ablations,
        "rivals": [vars(r) | r.errors for r in findings.rivals],
        "seconds": findings.seconds,
        "command": findings.command,
    }
    if comparison is not None:
        found["met"] = comparison.met
        found["compared"] = [vars(v) | {"off": v.off, "met": v.met} for v in comparison.verdicts()]
        found["series"] = {"time": comparison.times, "frame": comparison.frames, "clip": comparison.clip}
        found["series"]["simulation"] = {name: comparison.herd(name) for name in comparison.herds[0]}
    return found


# pictures ---------------------------------------------------------------------------------


def _pictures(findings):
    """{name: image} of what there is to show."""
    made = {f"moment-{k + 1}": image for k, image in enumerate(findings.moments)}
    comparison = findings.comparison
    if comparison is not None:
        order = [_chart(comparison, name, (0.0, 1.0)) for name in ORDER if _told(comparison, name)]
        if order:
            made["order"] = sheet(order)
        made["errors"] = sheet([_error_chart(comparison, name) for name in ERRORS])
        crowd = [_chart(comparison, name, _from_zero(comparison, name)) for name in CROWD if _told(comparison, name)]
        crowd.append(_speeds(comparison))
        made["crowd"] = sheet(crowd)
        if comparison.maps:
            made["neighbours"] = sheet([_maps(comparison)], 1)
    made["parameters"] = sheet([parameter_rows(findings.learned)], 1)
    if any(len(attempt.loss) for attempt in findings.learned.starts):
        made["loss"] = sheet([_losses(findings.learned)], 1)
    return made


def _told(comparison, name):
    return bool(np.isfinite(comparison.clip[name]).any())


def _from_zero(comparison, name):
    """An axis that does not make much of little."""
    return 0.0, max(float(np.nanmax(comparison.clip[name])), float(np.nanmax(comparison.herd(name), initial=0.0)))


def _chart(comparison, name, span=None):
    """The clip with its band, and the simulations."""
    verdict, clip, times = comparison.verdict(name), comparison.clip[name], comparison.times
    band = (clip - verdict.allowed, clip + verdict.allowed) if name in ORDER else None
    if name == "aspect" and np.nanmax(clip) > 1:
        span = None
    herds = [Line("each simulation", times, h[name], HERD, width=1.0, alpha=0.35) for h in comparison.herds]
    lines = [Line("clip", times, clip, CLIP, band), *(herds if len(herds) > 1 else [])]
    lines.append(Line("simulation", times, comparison.herd(name), HERD))
    return Chart(TITLES[name], "seconds from the start of the simulation", lines, span)


def _error_chart(comparison, name):
    times = comparison.times
    each = [Line("each simulation", times, h[name], OTHER, width=1.0, alpha=0.35) for h in comparison.herds]
    lines = [*(each if len(each) > 1 else []), Line("mean", times, comparison.herd(name), OTHER)]
    return Chart(TITLES[name], "horizon, seconds", lines)


def _speeds(comparison):
    lines = [
        Line(name, *comparison.speeds[name], colour, marks=True)
        for name, colour in (("clip", CLIP), ("simulation", HERD))
    ]
    most = max((float(line.y.max()) for line in lines if len(line.y)), default=1.0)
    return Chart("Speed against density, BL/s", "animals per BL²", lines, (0.0, most))


def _maps(comparison):
    squares = [comparison.maps[name] for name in ("clip", "simulation")]
    return Maps("Where the others stand", ["clip", "simulation"], squares, REACH, "per BL²")


def parameter_rows(learned) -> Rows:
    """The twelve numbers, with what other starts came to."""
    others = np.array([a.theta for k, a in enumerate(learned.starts) if k != learned.chosen]).reshape(-1, 12)
    rows = [
        Row(plain(name), float(value), others[:, k], bool(learned.identifiable[k]), name.split("_")[0])
        for k, (name, value) in enumerate(zip(NAMES, learned.theta, strict=True))
    ]
    return Rows("Parameters, normalised to 0..1", rows)


def _losses(learned):
    lines = [
        Line("other starts", np.arange(len(a.loss)), a.loss, OTHER, width=1.2, alpha=0.6)
        for k, a in enumerate(learned.starts)
        if k != learned.chosen and len(a.loss)
    ]
    if len(learned.loss):
        lines.append(Line("the start chosen", np.arange(len(learned.loss)), learned.loss, HERD))
    every = np.concatenate([line.y for line in lines])
    return Chart("Loss", "steps", lines, logarithmic=bool((every[np.isfinite(every)] > 0).all()))


# the page -----------------------------------------------------------------------------------


def page_of(findings: Findings, pictures: dict[str, np.ndarray]) -> Page:
    """The report as a page."""
    page = Page(f"{findings.brush.name}: a brush learned from {Path(findings.whole.name).name}")
    page.say(findings.verdict(), "lead")
    page.say(findings.brush.description, "small")
    if findings.moments:
        page.head("Clip and simulation")
        for k, image in enumerate(findings.moments):
            page.picture(image, WORDS["moments"] if k == len(findings.moments) - 1 else "", 1.0, photograph=True)
    if findings.comparison is not None:
        _compared(page, findings, pictures)
    _rivals(page, findings)
    _parameters(page, findings, pictures)
    _counts(page, findings)
    _ablations(page, findings)
    _seen(page, findings)
    _again(page, findings)
    return page


def _show(page, pictures, name):
    if name in pictures:
        page.picture(pictures[name], WORDS[name], SCALE)


def _compared(page, findings, pictures):
    comparison = findings.comparison
    first, last = comparison.frames[[0, -1]]
    held = findings.held is not None
    page.head("Held out: the frames nothing was learned from" if held else "The frames it was learned from")
    page.say(
        f"Frames {first} to {last}, {comparison.times[-1]:.2f} s; {len(comparison.herds)} simulations with "
        "different chance, each begun as the first of these frames. "
        + ("" if held else "The clip was too short to hold a part of it back: these figures flatter the brush.")
    )
    columns = ["measure", "clip", "±", "simulated", "±", "off by", "allowed", "frame by frame"]
    rows = []
    for v in comparison.verdicts():
        judged = v.name in ORDER
        kind = ("good" if v.met else "bad") if judged else ""
        rows.append(
            [TITLES[v.name], _n(v.clip), _n(v.clip_deviation), _n(v.herd), _n(v.herd_deviation), (_n(v.off), kind)]
            + [_n(v.allowed) if judged else "", _n(v.frame_error)]
        )
    page.table(columns, rows)
    for name in ("order", "errors", "crowd", "neighbours"):
        _show(page, pictures, name)


def _n(value, digits=3):
    return number(float(value), digits)


def _rivals(page, findings):
    if not findings.rivals:
        return
    page.head("Against other brushes, chosen blindly")
    page.say(
        "The same frames with random numbers and with the brushes that come with Flockbrush, all at the clip's speed, "
        "the likest first. The last column counts everything: order, milling, shape, spacing, neighbours, in the "
        "clip's own standard deviations; differences of a few tenths are chance."
    )
    own = findings.brush.name
    rows = sorted(findings.rivals, key=lambda rival: rival.unlike)
    cells = [
        [r.name, _n(r.errors["polarization"]), _n(r.errors["milling"]), _n(r.density), _n(r.velocity), _n(r.unlike)]
        for r in rows
    ]
    columns = ["brush", "polarization off by", "milling off by", "in the wrong cell", "velocity error"]
    page.table([*columns, "unlike the clip by"], cells, chief=[k for k, r in enumerate(rows) if r.name == own])


def _parameters(page, findings, pictures):
    learned = findings.learned
    page.head("The numbers, and which of them the clip tells")
    _show(page, pictures, "parameters")
    rows = []
    for force in FORCES:
        for name in (n for n in NAMES if n.startswith(force)):
            k = NAMES.index(name)
            told = ("told", "good") if learned.identifiable[k] else ("not told", "quiet")
            deviation = "" if learned.deviation is None else _n(learned.deviation[k])
            rows.append([plain(name), told, _n(learned.theta[k]), _n(learned.spread[k]), deviation])
    page.table(["parameter", "by the clip", "value", "spread of starts", "deviation"], rows, words=2)
    if learned.extras:
        page.say("Set from the clip besides: " + ", ".join(f"{k} {_word(v)}" for k, v in learned.extras.items()) + ".")
    speed = learned.speed
    page.say(
        f"Speed: {speed.mean:.3g} body lengths a second, noise {speed.deviation:.3g} (speeds spread by "
        f"{speed.deviation / math.sqrt(2 * speed.reversion):.3g}), reversion {speed.reversion:.3g} a second"
        + (f", a table of {len(speed.by_density)} densities." if speed.by_density else ".")
    )
    _show(page, pictures, "loss")
    scores = [[a.name, str(a.seed), len(a.loss), _n(a.score)] for a in learned.starts]
    if scores:
        page.table(["start", "seed", "steps", "unlike the clip by"], scores, words=2, chief=[learned.chosen])


def _word(value):
    return _n(value) if isinstance(value, float) else str(value)


def _counts(page, findings):
    if not findings.counts:
        return
    page.head("With other numbers of animals")
    page.say(
        "Herds of the same density on an endless plane, 20 s; means over the last ten. Not kept: what is farther than "
        f"{KEPT:g} from the clip's."
    )
    rows = [
        [f"{r['factor']:g} times", r["animals"], _n(r["polarization"]), _n(r["milling"]), _n(r["spacing"])]
        + [_n(r["together"]), (strayed, "bad") if (strayed := findings.strayed(r)) else ("nothing", "good")]
        for r in findings.counts
    ]
    page.table(["", "animals", "polarization", "milling", "nearest neighbour, BL", "in one herd", "not kept"], rows)


def _ablations(page, findings):
    if not findings.ablations:
        return
    page.head("Left out, one thing at a time")
    page.say("Learned again without one part of the method; mean error over the frames, as the paper tabulates it.")
    columns = list(findings.ablations[0])
    rows = [[row[c] if isinstance(row[c], str) else _n(row[c]) for c in columns] for row in findings.ablations]
    page.table([c.replace("_", " ") for c in columns], rows, chief=[0])


def _seen(page, findings):
    page.head("What was seen")
    for clip in findings.clips:
        f = clip.fields
        how = "given" if clip.length_source == "given" else "estimated from the bodies seen"
        facts = [
            ("clip", Path(clip.name).name),
            ("SHA-256", clip.sha256),
            ("learned from frames", f"{f.frames[0]} to {f.frames[-1]} at {clip.fps:g} a second"),
            ("animals in the picture", f"{np.median(f.count):.0f} ({f.count.min():.0f} to {f.count.max():.0f})"),
            ("one body length", f"{clip.clip_body_px:.1f} pixels, {how}"),
            ("half the width of a body", f"{clip.radius_bl:.2f} body lengths"),
            ("grid", f"{f.shape[1]} x {f.shape[0]} cells of {f.cell:.2g} body lengths"),
            ("single animals", _single(clip)),
        ]
        if clip.speed is not None:
            reversion = clip.speed.reversion
            told = "not told by the clip" if reversion is None else f"{reversion:.2g} a second"
            facts.append(("speed", f"{clip.speed.mean:.3g} ± {clip.speed.deviation:.2g} body lengths a second"))
            facts.append(("speed returns to its mean", told))
        page.facts(facts)
    notes = [*(note for clip in findings.clips for note in clip.notes), *findings.learned.notes]
    page.notes(dict.fromkeys(map(sentence, notes)))


def _single(clip):
    if clip.sightings is None:
        return "could not be told apart"
    return f"{len(clip.sightings.xy) / max(len(clip.sightings), 1):.0f} a frame told apart"


def _again(page, findings):
    page.head("To do it again")
    page.lines(findings.command)
    versions = findings.brush.provenance.versions
    page.facts((f"{name} took", f"{value:.0f} s") for name, value in findings.seconds.items())
    page.say("Made with " + ", ".join(f"{name} {version}" for name, version in versions.items()) + ".", "small")
    page.say("The brush:", "small")
    page.lines(brush_to_toml(findings.brush))


# what can be told when nothing was learned -----------------------------------------------------


def write_partial(folder, clip, message: str, seen: dict) -> Path:
    """A page about a clip that nothing could be learned from: what was seen up to there.

    Parameters
    ----------
    folder : path
        Must be there.
    clip : path
    message : str
        What went wrong.
    seen : dict
        Facts by name; under "pictures" pictures by title, BGR.
    """
    page = Page(f"Nothing learned from {Path(clip).name}")
    page.say(message, "lead")
    seen = dict(seen)
    pictures = seen.pop("pictures", {})
    if seen:
        page.head("What was seen")
        page.facts((name.replace("_", " "), _word(value)) for name, value in seen.items())
    for title, image in pictures.items():
        page.picture(_coloured(image), title, max(1.0, image.shape[1] / 920), photograph=image.ndim == 3)
    path = Path(folder) / "report.html"
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

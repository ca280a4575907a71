"""The charts of a report: what the findings of one brush have to show."""

from __future__ import annotations

import numpy as np

from flockbrush.learning.comparison import ERRORS, REACH, TITLES
from flockbrush.learning.learned_brush import plain
from flockbrush.learning.result import Findings
from flockbrush.output.figures import CLIP, HERD, OTHER, ChartCurve, CurveChart, Maps, ParamRow, Rows

ORDER = "polarization", "milling", "milling in the picture", "aspect"
CROWD = "nearest neighbour", "density", "order nearby", "largest part", "directions"
ALIKE = 1.25, 0.1  # as good as the best: its score so many times, and so much more (the recipe's own rule)


def panels_of(findings: Findings) -> dict[str, list]:
    """{name: panels} of what there is to show."""
    made: dict[str, list] = {}
    comparison = findings.comparison
    if comparison is not None:
        made["order"] = [_chart(comparison, name, (0.0, 1.0)) for name in ORDER if is_told(comparison, name)]
        made["errors"] = [_error_chart(comparison, n) for n in ERRORS if np.isfinite(comparison.herd(n)).any()]
        made["crowd"] = [
            _chart(comparison, name, _from_zero(comparison, name)) for name in CROWD if is_told(comparison, name)
        ]
        if all(len(x) for x, _ in comparison.speeds.values()):
            made["crowd"].append(_speeds(comparison))
        if comparison.maps:
            made["neighbours"] = [_maps(comparison)]
    made["parameters"] = [parameter_rows(findings.learned)]
    made["loss"] = _losses(findings.learned, findings.words)
    return {name: panels for name, panels in made.items() if panels}


def is_told(comparison, name) -> bool:
    """Whether a clip determines a measure."""
    return name in comparison.clip and bool(np.isfinite(comparison.clip[name]).any())


def _from_zero(comparison, name):
    """An axis that does not make much of little."""
    values = np.concatenate([[0.0], comparison.clip[name], *(herd[name] for herd in comparison.herds)])
    return float(np.nanmin(values)), float(np.nanmax(values))


def _chart(comparison, name, span=None):
    """The clip with its band, and the simulations."""
    verdict, clip, times = comparison.verdict(name), comparison.clip[name], comparison.times
    most = np.inf if name == "aspect" else 1.0
    band = np.maximum(clip - verdict.allowed, 0.0), np.minimum(clip + verdict.allowed, most)
    if name == "aspect" and np.nanmax(clip) > 1:
        span = None
    seen = ChartCurve(comparison.subject, times, clip, band=band if name in ORDER else None, colour=CLIP)
    lines = [seen, *_simulations(comparison, name, HERD)]
    return CurveChart(TITLES[name], "seconds from the start of the simulation", lines, span=span)


def _error_chart(comparison, name):
    most = float(np.nanmax([herd[name] for herd in comparison.herds]))
    return CurveChart(TITLES[name], "horizon, seconds", _simulations(comparison, name, OTHER), span=(0.0, most))


def _simulations(comparison, name, colour):
    """The single simulations, if they are several, and their mean."""
    times, mean, herds = comparison.times, comparison.herd(name), comparison.herds
    if len(herds) == 1:
        return [ChartCurve("simulation", times, mean, colour=colour)]
    single = [ChartCurve("single simulations", times, h[name], colour=colour, width=0.8, alpha=0.35) for h in herds]
    return [*single, ChartCurve("mean of simulations", times, mean, colour=colour)]


def _speeds(comparison):
    lines = [
        ChartCurve(name, *comparison.speeds[kind], colour=colour, marker="o")
        for name, kind, colour in ((comparison.subject, "clip", CLIP), ("simulation", "simulation", HERD))
    ]
    most = max((float(line.y.max()) for line in lines if len(line.y)), default=1.0)
    return CurveChart("Speed against density, BL/s", "animals per BL²", lines, span=(0.0, most))


def _maps(comparison):
    squares = [comparison.maps[name] for name in ("clip", "simulation")]
    return Maps("Positions of neighbours", [comparison.subject, "simulation"], squares, REACH, "per BL²")


def others_of(learned) -> tuple[list, list]:
    """(starts besides the chosen that describe the clip about as well, those that describe it worse)."""
    if not learned.starts:
        return [], []
    times, more = ALIKE
    limit = times * learned.starts[learned.chosen].score + more
    tried = [a for k, a in enumerate(learned.starts) if k != learned.chosen and np.isfinite(a.score)]
    return [a for a in tried if a.score <= limit], [a for a in tried if a.score > limit]


def parameter_rows(learned) -> Rows:
    """The numbers, with what other starts came to."""
    near, far = others_of(learned)
    alike, others = (np.array([a.theta for a in some]).reshape(-1, len(learned.names)) for some in (near, far))
    rows = []
    for k, (name, value) in enumerate(zip(learned.names, learned.theta, strict=True)):
        told, force = bool(learned.identifiable[k]), name.split("_")[0]
        rows.append(ParamRow(plain(name), float(value), others[:, k], told, force, alike[:, k]))
    return Rows("Parameters, normalised to 0..1", rows)


def _losses(learned, words) -> list[CurveChart]:
    """Descents and evolutions, each with a loss of its own."""
    curves = [(k, a) for k, a in enumerate(learned.starts) if len(a.loss)]
    evolved = [(k, a) for k, a in curves if ", evolved" in a.name]
    fitted = [(k, a) for k, a in curves if ", evolved" not in a.name]
    titles = ("Descent: loss", "steps"), (words("Evolution: smallest distance to the clip"), "generations")
    made = []
    for (title, across), some in zip(titles, (fitted, evolved), strict=True):
        lines = [_loss(a, k == learned.chosen) for k, a in sorted(some, key=lambda pair: pair[0] == learned.chosen)]
        if lines:
            every = np.concatenate([line.y for line in lines])
            made.append(CurveChart(title, across, lines, logarithmic=bool((every[np.isfinite(every)] > 0).all())))
    return made


def _loss(attempt, chosen):
    steps = np.arange(len(attempt.loss))
    if chosen:
        return ChartCurve("chosen start", steps, attempt.loss, colour=HERD)
    return ChartCurve("other starts", steps, attempt.loss, colour=OTHER, width=1.0, alpha=0.6)

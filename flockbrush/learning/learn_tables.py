"""The chief figures of a learned brush as tables in the terminal."""

from __future__ import annotations

from flockbrush.learning.comparison import JUDGED
from flockbrush.learning.model_choice import table_of
from flockbrush.learning.report_judgement import judged_rows
from flockbrush.learning.result import Findings
from flockbrush.learning.verdict import ALONE
from flockbrush.runs.terminal import measure, number, say, show, table


def show_findings(findings: Findings):
    """The chief figures as tables."""
    if findings.models is not None:
        if findings.models.contenders:
            show(table_of(findings.models))
        say(findings.words(findings.models.decision))
    if findings.comparison is not None:
        made = _against_photograph if not findings.motion else _against_film if findings.judgement is None else _judged
        show(made(findings))
    for title, rows in (
        ("with other numbers of animals", [r | {"not kept": findings.strayed(r) or "-"} for r in findings.counts]),
        ("ablations: mean errors", findings.ablations),
    ):
        if rows:
            columns = list(rows[0])
            cells = ([_word(column, value) for column, value in row.items()] for row in rows)
            show(table(*columns, rows=cells, title=title, right=columns[1:]))


def _judged(findings):
    """What the verdict is based on, as much as fits into 80 columns."""
    judgement = findings.judgement
    what = "held-out frames" if findings.held is not None else "frames it was learned from"
    short = {"inconclusive": "-", "persists": "kept", "does not persist": "lost"}
    seen = findings.words("clip")
    made = table(
        "measure", seen, "herd", "off", "limit", "", f"{ALONE:g} s alone", right=(seen, "herd", "off", "limit"),
        title=f"{findings.brush.name}: {what}, {judgement.seconds:.1f} s",
    )  # fmt: skip
    for row, cells in zip(judgement.brush.rows, judged_rows(judgement), strict=True):
        _, met, clip, herd, off, limit, _, later, lasts = cells
        made.add_row(row.name, clip, herd, off, limit, short.get(met, met), f"{later} {short.get(lasts, lasts)}")
    return made


def _against_film(findings):
    comparison = findings.comparison
    what = "held-out frames" if findings.held is not None else "frames it was learned from"
    title = f"{findings.brush.name}: {what}, {comparison.times[-1]:.1f} s"
    made = table(
        "measure", comparison.subject, "±", "simulated", "difference", "allowed", "", title=title, right=_NUMBERS
    )
    for v in comparison.verdicts():
        judged = v.name in JUDGED
        met = ("met" if v.met else "MISSED") if judged else ""
        allowed = measure(v.allowed) if judged else ""
        cells = [measure(x) for x in (v.clip, v.clip_deviation, v.herd, v.off)]
        made.add_row(v.name, *cells, allowed, met)
    return made


def _against_photograph(findings):
    title = f"{findings.brush.name}: comparison with the photograph, {findings.comparison.times[-1]:.1f} s simulated"
    rows = ((v.name, *map(measure, (v.clip, v.herd, v.off))) for v in findings.comparison.verdicts())
    return table("measure", "photograph", "simulated", "difference", rows=rows, title=title, right=_NUMBERS)


def _word(column, value):
    """A cell of a table."""
    if isinstance(value, str):
        return value
    return number(value) if isinstance(value, int) or column == "factor" else measure(value)


_NUMBERS = "clip", "tracks", "photograph", "±", "simulated", "difference", "allowed"

"""The chief figures of a learned brush as tables in the terminal."""

from __future__ import annotations

from flockbrush.learning.comparison import JUDGED
from flockbrush.learning.model_choice import table_of
from flockbrush.learning.result import Findings
from flockbrush.runs.terminal import measure, number, say, show, table


def show_findings(findings: Findings):
    """The chief figures as tables."""
    if findings.models is not None:
        if findings.models.contenders:
            show(table_of(findings.models))
        say(findings.models.decision)
    if findings.comparison is not None:
        show(_against_film(findings) if findings.motion else _against_photograph(findings))
    for title, rows in (
        ("with other numbers of animals", [r | {"not kept": findings.strayed(r) or "-"} for r in findings.counts]),
        ("ablations: mean errors", findings.ablations),
    ):
        if rows:
            columns = list(rows[0])
            cells = ([_word(column, value) for column, value in row.items()] for row in rows)
            show(table(*columns, rows=cells, title=title, right=columns[1:]))


def _against_film(findings):
    comparison = findings.comparison
    what = "held-out frames" if findings.held is not None else "frames it was learned from"
    title = f"{findings.brush.name}: {what}, {comparison.times[-1]:.1f} s"
    made = table("measure", "clip", "±", "simulated", "difference", "allowed", "", title=title, right=_NUMBERS)
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


_NUMBERS = "clip", "photograph", "±", "simulated", "difference", "allowed"

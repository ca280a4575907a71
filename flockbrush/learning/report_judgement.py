"""The section of a report about the test of a brush: measures, limits, and other herds for comparison."""

from __future__ import annotations

from flockbrush.learning.battery import MEASURES
from flockbrush.learning.verdict import ALONE
from flockbrush.runs.terminal import measure


def judgement_as_json(judgement):
    """What --json prints of a judgement."""
    if judgement is None:
        return None

    def contender(one):
        rows = {row.name: vars(row) | {"limits off": row.far, "met": row.met} for row in one.rows}
        lasting = {row.name: vars(row) | {"met": row.met} for row in one.lasting}
        return {"name": one.name, "distance": one.distance(judgement.told), "measures": rows, "alone": lasting}

    return {
        "kind": judgement.kind, "sentence": judgement.sentence, "told": judgement.told, "missed": judgement.missed,
        "brush": contender(judgement.brush), "rivals": [contender(r) for r in judgement.rivals],
    }  # fmt: skip


COLUMNS = "measure", "", "clip", "simulated", "difference", "limit", "by chance", f"after {ALONE:g} s alone", ""


def judged_rows(judgement) -> list[list[str]]:
    """The measures that a verdict is based on, by `COLUMNS`."""
    alone = {row.name: row for row in judgement.brush.lasting}
    rows = []
    for row in judgement.brush.rows:
        met = ("met" if row.met else "missed") if row.name in judgement.told else "inconclusive"
        later = alone.get(row.name)
        lasts = ["", ""] if later is None else [measure(later.herd), "persists" if later.met else "does not persist"]
        cells = [measure(value) for value in (row.clip, row.herd, row.off, row.limit, row.by_chance)]
        rows.append([f"{row.name} {MEASURES[row.name].unit}".strip(), met, *cells, *lasts])
    return rows


def add_judgement(page, judgement):
    """Add the measures with their limits, and the rivals, to a page."""
    if judgement is None:
        return
    page.head("Measures and their limits")
    page.say(
        "The verdict is based on these measures. The limit of a measure combines the uncertainty of the clip "
        "(bootstrap over its samples), the scatter between simulations and the smallest difference that counts. The "
        "first third of the time is left out, because it depends on the start, and distances, speeds and turning are "
        "means of quantiles: so some values differ from those of the comparison. By chance: the value of as many "
        "animals that do not interact. A measure is conclusive if at least one of the other herds misses it."
    )
    colours = {"met": "good", "missed": "bad", "persists": "good", "does not persist": "bad", "inconclusive": "quiet"}
    rows = [[(cell, colours[cell]) if cell in colours else cell for cell in row] for row in judged_rows(judgement)]
    page.table(COLUMNS, rows, words=2)
    page.say(
        "Other herds on the same frames: herds that stand, herds that go straight ahead, random parameters, and the "
        "shipped brushes at the speed of the clip; the nearest first. Distance: root mean square of the differences, "
        "in units of the limits."
    )
    everybody = sorted([judgement.brush, *judgement.rivals], key=lambda one: one.distance(judgement.told))
    told = judgement.told
    cells = [
        [one.name, measure(one.distance(told), 2), str(len(one.missed(told))), ", ".join(one.missed(told))]
        for one in everybody
    ]
    chief = [k for k, one in enumerate(everybody) if one is judgement.brush]
    page.table(["herd", "distance", "missed", ""], cells, chief=chief)

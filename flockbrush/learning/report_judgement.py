"""What a report says of a judgement: the measures, their limits, and others beside the brush."""

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


def add_judgement(page, judgement):
    """Add the measures with their limits, and the rivals, to a page."""
    if judgement is None:
        return
    page.head("Measures and their limits")
    page.say(
        "What the first sentence goes by. A limit is what the clip (by a bootstrap over its moments), the chance of "
        "the runs, and the least difference that counts leave open; the first third, which is the clip's own start, is "
        "left out. By chance: what as many animals would have that know nothing of each other. A measure is told if "
        "one of the others misses it."
    )
    alone = {row.name: row for row in judgement.brush.lasting}
    rows = []
    for row in judgement.brush.rows:
        met = (
            (("met", "good") if row.met else ("missed", "bad")) if row.name in judgement.told else ("not told", "quiet")
        )
        later = alone.get(row.name)
        lasts = "" if later is None else ("lasts", "good") if later.met else ("does not last", "bad")
        cells = [_n(value) for value in (row.clip, row.herd, row.off, row.limit, row.by_chance)]
        rows.append(
            [
                f"{row.name} {MEASURES[row.name].unit}".strip(),
                met,
                *cells,
                "" if later is None else _n(later.herd),
                lasts,
            ]
        )
    columns = ["measure", "", "clip", "simulated", "off by", "limit", "by chance", f"after {ALONE:g} s alone", ""]
    page.table(columns, rows, words=2)
    page.say(
        "The same frames with others: herds that stand, that go on straight ahead, random numbers, and the brushes "
        "that come with Flockbrush at the clip's speed, the likest first. Distance: the root mean square of the "
        "limits it is off."
    )
    everybody = sorted([judgement.brush, *judgement.rivals], key=lambda one: one.distance(judgement.told))
    told = judgement.told
    cells = [
        [one.name, _n(one.distance(told), 2), str(len(one.missed(told))), ", ".join(one.missed(told))]
        for one in everybody
    ]
    chief = [k for k, one in enumerate(everybody) if one is judgement.brush]
    page.table(["herd", "distance", "missed", ""], cells, chief=chief)


def _n(value, digits=3):
    return measure(float(value), digits)

"""The section of a report about the parameters of a learned brush: values, uncertainties and confounded ones."""

from __future__ import annotations

import math

from flockbrush.behaviours.models.herd import Params
from flockbrush.learning.confounding import estimates_of
from flockbrush.learning.learned_brush import plain
from flockbrush.learning.learning_charts import others_of
from flockbrush.learning.rollout import NAMES
from flockbrush.runs.terminal import measure, number

UNITS = {"radial": "BL", "angular": "°", "weight": "/s"}


def add_parameters(page, findings, show):
    """Add the table of the numbers; ``show`` draws them."""
    learned = findings.learned
    page.head("Parameters, and which of them are identifiable")
    show()
    sure, alone = learned.deviation is not None, not others_of(learned)[0]
    confounded = {one.name: ", ".join(map(plain, one.confounded_with)) for one in estimates_of(learned)}
    rows = []
    for k, name in enumerate(learned.names):
        told = ("identifiable", "good") if learned.identifiable[k] else ("not identifiable", "quiet")
        more = (
            [measure(learned.deviation[k] if learned.deviation[k] < 1 else math.nan), confounded[name]] if sure else []
        )
        spread = measure(math.nan if alone else learned.spread[k])
        rows.append([plain(name), told, measure(learned.theta[k]), _real(learned, k), spread, *more])
    columns = ["parameter", "from the clip", "value", "physical value", "spread of starts"]
    page.table(columns + (["deviation", "confounded with"] if sure else []), rows, words=2)
    page.say(_meaning(learned.names == NAMES, sure, alone), "small")
    if learned.extras:
        page.say("Also set from the clip:")
        page.facts((name.replace("_", " "), _extra(name, value)) for name, value in learned.extras.items())
    speed = learned.speed
    page.say(
        f"Speed: {speed.mean:.3g} body lengths/s, noise {speed.deviation:.3g} (speeds spread by "
        f"{speed.own_spread:.3g}), reversion {speed.reversion:.3g} 1/s"
        + (f", usual speeds of animals differ by {speed.individual:.0%}" if speed.individual > 0 else "")
        + (f", common changes {speed.common:.3g} for {speed.common_time:.3g} s" if speed.common > 0 else "")
        + (f", a table of {len(speed.by_density)} densities." if speed.by_density else ".")
    )


def _meaning(herd, sure, alone):
    """What the columns are: of the herd model or of another; with the errors of turns; with one start that fits."""
    value = (
        "Value: 0 to 1, as in the paper and in the brush. Physical value: the strength (weight times sensitivity Ω), "
        "or the standard deviation of the Gaussian in distance or angle. " if herd else
        "Value: 0 to 1, the place in the range that is searched. Physical value: the parameter as in the brush. "
    )  # fmt: skip
    spread = "Spread: standard deviation over the starts that fit the clip about equally well"
    words = value + spread + ("; only this start does." if alone else ".")
    if not sure:
        return words
    bound = "at least the Cramér-Rao bound" if herd else "the Cramér-Rao bound, which is too small"
    words += (
        f" Deviation: uncertainty given the turns of the animals ({bound}); - if the turns contain no information. "
        "Confounded: a change of these parameters fits about equally well (correlation of the errors .7 or more)."
    )
    return words + " Weights are always confounded with the sensitivity Ω: only their product acts." * herd


def _real(learned, k):
    """A normalised number in its unit."""
    if learned.names != NAMES:
        more = type(learned.params).model_fields[learned.names[k]].json_schema_extra
        unit = more.get("unit", "") if isinstance(more, dict) else ""
        return f"{number(float(learned.values[k]), 3)} {'' if unit == '1' else unit}".strip()
    kind = NAMES[k].split("_")[1]
    scale = {"weight": learned.params.sensitivity, "radial": 4.0, "angular": 180.0}[kind]
    value = learned.theta[k] * scale
    return f"{value:.0f}°" if kind == "angular" else f"{value:.2f} {UNITS[kind]}"


def _extra(name, value):
    """A parameter of the model with its unit and meaning."""
    told, field = number(value, 3) if isinstance(value, float) else str(value), Params.model_fields.get(name)
    if field is None:
        return told
    more = field.json_schema_extra if isinstance(field.json_schema_extra, dict) else {}
    return f"{told} {more.get('unit', '')}: {field.description}"

"""The kind of model to learn: of ``--model``, or chosen by ``auto`` from a table."""

from __future__ import annotations

import math
from collections.abc import Sequence

from flockbrush.behaviours.behaviour import behaviours
from flockbrush.engine.files import refused
from flockbrush.engine.problems import Problem, ProblemsError, did_you_mean
from flockbrush.film.observations import Evidence
from flockbrush.learning.learned_parameters import Learned
from flockbrush.learning.likelihood import likelihoods
from flockbrush.learning.model_fit import add_distances, kinds_of_models
from flockbrush.learning.which_model import HERD, ModelComparison, compare_models, problem_of
from flockbrush.learning.words_of_tracks import Words
from flockbrush.runs.terminal import measure, table

AUTO = "auto"
TIE = 1.1  # times as far as others: a kind of model by which turns are likelier counts as no farther
HOPELESS = 1.3  # times the score of the herd: a kind that does not come below it soon is given up
ONE_PICTURE = "it is one picture, and models are compared by the turns of animals"
COLUMNS = "model", "perception", "log score", "±", "behind", "± ", "distinct", "battery"


def check_kind(name: str) -> None:
    """ProblemsError where ``--model`` cannot be this."""
    kinds = [AUTO, *kinds_of_models()]
    if name not in kinds:
        message = f"no model {name!r} can be learned{did_you_mean(name, kinds)}; models: {', '.join(kinds)}"
        raise ProblemsError([Problem("--model", None, None, message)])


def kind_of(name: str, clips: Sequence[Evidence], photo: bool = False) -> str:
    """The kind of model to learn from these clips; `AUTO` if `comparison_of` them tells which.

    Parameters
    ----------
    name : str
        As ``--model`` names it; auto is the herd where others cannot be learned.
    photo : bool
        Whether the clip is one picture.

    Raises
    ------
    ProblemsError
        When the clips do not tell what the model needs.
    """
    if name == HERD:
        return HERD
    kind = likelihoods().get(name)
    model = kind.behaviour if kind else behaviours().get(name)
    problem = ONE_PICTURE if photo else problem_of(clips, model)
    if problem and name != AUTO:
        raise refused(clips[0].name, f"{problem}: leave out --model {name}")
    return HERD if problem else name


def comparison_of(clips: Sequence[Evidence], seed: int) -> ModelComparison:
    """All kinds of models that have a likelihood, compared on these clips."""
    found = compare_models(clips, seed=seed)
    if found.rows:
        add_distances(found.rows, clips, seed)
    return found


def nearest(tried: Sequence[Learned], likelier: Sequence[str] = ()) -> Learned:
    """The one of several kinds whose simulated herds are nearest to the clip; the first, if none is known.

    Kinds by which turns are clearly likelier are preferred to one that is hardly nearer.
    """
    return min(tried, key=lambda learned: _merit(learned) * (1.0 if learned.kind in likelier else TIE))


def hopeless(learned: Learned) -> float:
    """The score beyond which another kind of model is not expected to become as near as what was learned."""
    return HOPELESS * learned.starts[learned.chosen].score


def _merit(learned):
    merit = learned.starts[learned.chosen].merit
    return merit if math.isfinite(merit) else math.inf


def cells_of(found: ModelComparison) -> list[list[str]]:
    """The rows of the table, as words."""
    best = found.rows[0]
    return [
        [
            row.name, row.perception, measure(row.score, 3), measure(row.error, 3),
            "" if row is best else measure(row.behind, 3), "" if row is best else measure(row.behind_error, 3),
            "" if row is best else "yes" if row.told_apart else "no", measure(row.distance),
        ]
        for row in found.rows
    ]  # fmt: skip


def table_of(found: ModelComparison):
    """The models beside each other, for the terminal."""
    title = f"models, on {found.blocks} held-out blocks"
    return table(*COLUMNS, rows=cells_of(found), title=title, right=COLUMNS[2:6] + COLUMNS[7:])


def as_json(found: ModelComparison | None, words: Words = str) -> dict | None:
    """What --json prints of the comparison, sentences in the `Words` for what was compared on."""
    if found is None or not found.rows:
        return None
    rows = [
        {
            "model": row.name, "perception": row.perception, "vision": row.vision.model_dump(), "log_score": row.score,
            "error": row.error, "behind": row.behind, "behind_error": row.behind_error, "told_apart": row.told_apart,
            "battery": row.distance if math.isfinite(row.distance) else None,
        }
        for row in found.rows
    ]  # fmt: skip
    return {
        "chosen": found.learned, "contenders": found.contenders, "equal": found.equal,
        "sentence": words(found.sentence), "decision": words(found.decision), "blocks": found.blocks,
        "straight_on": found.straight, "rows": rows,
    }  # fmt: skip


def add_models(page, found: ModelComparison | None) -> None:
    """The section of a report."""
    if found is None or not found.rows:
        return
    page.head("Comparison of models")
    page.say(f"{found.sentence} {found.decision}")
    page.table(list(COLUMNS), cells_of(found), words=2)
    page.say(
        "Log score: mean logarithm of the likelihood of the next step of an animal, in blocks of the clip that the "
        "model was not fitted to; the error is computed over the blocks. Behind: difference to the best log score, and "
        "the error of that difference. Distinct: behind by more than three errors. Battery: root mean square "
        "difference "
        "between its simulated herds and the clip, in units of the limits.",
        "small",
    )

"""What each part of the method is good for: learned again without it (paper section 7.2)."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from flockbrush.film.observations import Evidence
from flockbrush.learning.comparison import Comparison, compared
from flockbrush.learning.learned_parameters import Learned
from flockbrush.learning.simulate import simulated

PARTS = {
    "occlusion": "nearer bodies hide farther ones",
    "angular": "each force has its own angle of view",
    "density": "density is fitted, not only motion",
    "variance": "the variance of directions is fitted",
}
RUNS = 3  # simulations of each


def ablated(
    parts: Iterable[str],
    held: Evidence,
    whole: Comparison,
    learn_without: Callable[[str], Learned],
    said: Callable[[str], None] = print,
) -> list[dict]:
    """One row for the whole method and one for each part left out: mean errors over the frames, as the paper's table 4.

    Parameters
    ----------
    parts : names of `PARTS`
    held : Evidence
        The frames compared on.
    whole : Comparison
        Of the whole method.
    learn_without : callable
        Learns without a part.
    said : callable
        Called with the progress.
    """
    rows = [_row("full method", whole)]
    for part in parts:
        said(f"learning without {part}")
        learned = learn_without(part)
        if learned.interrupted:
            break
        rows.append(_row(f"without {part}", compared(held, [simulated(held, learned, seed) for seed in range(RUNS)])))
    return rows


def _row(name, comparison):
    found = {verdict.name: verdict.frame_error for verdict in comparison.verdicts()}
    errors = comparison.figures("-")
    return {
        "method": name,
        "density": errors.get("- density error", float("nan")),
        "wrong cell": errors.get("- symmetric density error", float("nan")),
        "velocity": errors.get("- velocity error", float("nan")),
        "polarization": found.get("polarization", float("nan")),
        "milling": found.get("milling", float("nan")),
        "aspect": found.get("aspect", float("nan")),
        "neighbours": found.get("nearest neighbour", float("nan")),
    }

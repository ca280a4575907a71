"""The numbers of a learned herd with their uncertainty, and which of them can stand in for one another.

Two numbers are confounded if the turns of the animals leave their errors correlated: raising one and changing the other
fits about as well.  The correlation comes from the inverse of the Fisher information of the turns.  Weights are besides
confounded with the sensitivity Ω, since only their product acts on a turn.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flockbrush.learning.learned_parameters import Learned

CONFOUNDED = 0.7  # absolute correlation of errors, from which one number can stand in for another
WIDEST = 1.0  # the range of a normalised number: a larger error says nothing


@dataclass(frozen=True)
class Estimate:
    """Estimate of one number of the model from the data.

    Attributes
    ----------
    name : str
        Such as "alignment_weight".
    value : float
        Of the herd normalised, 0 to 1; of other models as the model has it.
    error : float
        Standard error: the larger of what the turns leave open (Cramér-Rao) and the spread over the starts that fit
        about as well; NaN unknown.
    identifiable : bool
        Whether the data say it at all.
    confounded_with : tuple of str
        Other numbers that it is confounded with, the strongest first.
    correlation : tuple of float
        Of the errors, one for each of these.
    """

    name: str
    value: float
    error: float
    identifiable: bool
    confounded_with: tuple[str, ...] = ()
    correlation: tuple[float, ...] = ()

    @property
    def told(self) -> str:
        """The value with its error, or that it is not identifiable."""
        return f"{self.value:.3f} ± {self.error:.3f}" if self.identifiable else "not identifiable"


def estimates_of(learned: Learned) -> list[Estimate]:
    """Each of the numbers, in the order of ``learned.names``."""
    names, values = learned.names, np.asarray(learned.values, float)
    deviation = np.full(len(names), np.nan) if learned.deviation is None else np.asarray(learned.deviation, float)
    spread = np.asarray(learned.spread, float)
    error = np.fmax(deviation, spread)
    error = np.where(error < WIDEST, error, np.nan) * (1.0 if learned.scales is None else learned.scales)
    made = []
    for k, name in enumerate(names):
        others = _confounded(learned.correlation, k)
        alike, size = tuple(names[j] for j, _ in others), tuple(round(r, 3) for _, r in others)
        made.append(Estimate(name, float(values[k]), float(error[k]), bool(learned.identifiable[k]), alike, size))
    return made


def _confounded(correlation, k):
    """[(row, correlation)] of the numbers whose errors correlate with those of the k-th, the strongest first."""
    if correlation is None:
        return []
    row = np.asarray(correlation, float)[k]
    others = [(j, float(row[j])) for j in range(len(row)) if j != k and np.abs(row[j]) >= CONFOUNDED]
    return sorted(others, key=lambda pair: -abs(pair[1]))


def correlation_of(information) -> np.ndarray:
    """(k, k) correlation of the errors of estimates with this Fisher information; NaN where nothing is known."""
    scale = np.sqrt(np.diag(information))
    known = scale > 1e-9
    out = np.full(information.shape, np.nan)
    if known.any():
        at = np.ix_(known, known)
        values, vectors = np.linalg.eigh(information[at] / np.outer(scale[known], scale[known]))
        covariance = (vectors / np.maximum(values, 1e-12)) @ vectors.T
        size = np.sqrt(np.diag(covariance))
        out[at] = covariance / np.outer(size, size)
    return out

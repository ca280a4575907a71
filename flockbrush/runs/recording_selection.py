"""Selection of animals at one time of a run: by id, box, distance to a point, species, brush or state."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flockbrush.engine.problems import did_you_mean

REACH = 5.0  # m; a click farther from every animal chooses none


@dataclass(frozen=True)
class Selection:
    """The conditions of a selection; empty ones are ignored."""

    ids: tuple[int, ...] = ()
    box: tuple[float, float, float, float] | None = None  # (west, south, east, north), optional; metres
    near: tuple[float, float] | None = None  # (x, y), optional; the animal nearest to this point, m
    species: str = ""
    brush: str = ""
    state: str = ""

    def __bool__(self):
        return self != Selection()

    def __str__(self):
        conditions = [f"{name} {value}" for name in ("species", "brush", "state") if (value := getattr(self, name))]
        placed = [f"{name} {getattr(self, name)}" for name in ("box", "near") if getattr(self, name) is not None]
        return ", ".join([*(["ids"] if self.ids else []), *conditions, *placed]) or "all"


def chosen(selection: Selection, moment, words) -> np.ndarray:
    """Ids (k,) of the animals of a moment that fit; `words` as of `words_of`.

    Raises
    ------
    ValueError
        For names that this run does not have.
    """
    fits = np.ones(len(moment), bool)
    codes = {"species": moment.species, "brush": moment.brush, **moment.labels}
    for name in ("species", "brush", "state"):
        value = getattr(selection, name)
        if value:
            known = words[name]
            if value not in known:
                raise ValueError(f"there is no {name} {value!r} in this run{did_you_mean(value, known)}")
            fits &= codes[name] == known.index(value)
    if selection.ids:
        fits &= np.isin(moment.ids, selection.ids)
    if selection.box is not None:
        west, south, east, north = selection.box
        x, y = moment.xyz[:, 0], moment.xyz[:, 1]
        fits &= (west <= x) & (x <= east) & (south <= y) & (y <= north)
    if selection.near is not None and fits.any():
        away = np.where(fits, np.hypot(*(moment.xyz[:, :2] - selection.near).T), np.inf)
        fits = (np.arange(len(moment)) == np.argmin(away)) & (away <= REACH)
    return moment.ids[fits]

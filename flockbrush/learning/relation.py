"""What one animal of a recording is to the others: from how far it is noticed as a danger, and how strongly.

The turning of each animal of the herd is explained by three directions: that of its neighbours' mean heading, that to
their middle, and that away from the danger.  The last counts as the simulation's fear does
(`flockbrush.systems.noticing.fear_`): fully within half the distance at which the danger is noticed, and linearly less
up to that distance.  For each distance on a grid the three weights follow by least squares with Student's t; the
distance is the likeliest one.  The strength is the share of the steering that the danger takes when it is near: what
the drive `flee` takes of the body.  Errors come from a bootstrap over recordings, or over blocks of one recording.

A reaction is reported if it is clear beside its error and says the turns better than in nearly all tables in which
blocks have, by chance, the danger on the other side (a test by random signs; the distance is chosen in each).

References
----------
.. [1] Jadhav, V. et al. (2024). Collective responses of flocking sheep (Ovis aries) to a herding dog (border collie).
   Communications Biology 7, 1543.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from flockbrush.behaviours.brush import name_like
from flockbrush.engine.files import refused
from flockbrush.engine.problems import did_you_mean
from flockbrush.film.open_clip import Looking, read_tracks_of
from flockbrush.film.track_evidence import evidence_of_tracks
from flockbrush.film.track_files import Trajectories
from flockbrush.learning.normal_equations import normal_equations
from flockbrush.runs.terminal import print_json, print_line, say

SPAN = 0.5  # s over which a turn is taken
NEIGHBOURS = 6  # that are aligned with and approached
SLOWEST = 0.2  # BL/s: slower animals have no sure heading
DISTANCES = 32  # on the grid
FREEDOM = 4.0  # of Student's t
RESAMPLED, FLIPPED = 60, 99
BY_CHANCE = 2  # of the tables that are turned over, that may say the turns as well
BLOCK = 5.0  # s of one recording that are drawn together
CLEAR = 3.0  # standard errors above 0 for a reaction to be reported
FEWEST, FEWEST_OTHERS = 100, 3  # turns; animals besides the danger
EDGE = 0.9  # of the farthest distance seen: a notice distance beyond it is not reported


@dataclass(frozen=True)
class LearnedRelation:
    """A danger as the herd takes it."""

    danger: str  # its id in the tracks
    notice: float  # distance at which it is noticed, in ``unit``
    notice_range: tuple[float, float]  # two thirds of the bootstrap
    strength: float  # share of the steering that it takes when it is near, 0 to 1
    strength_error: float  # standard error
    told: bool  # whether the herd reacts at all, beyond chance
    reaches_beyond: bool  # the likeliest distance is about the farthest that the tracks show: it may be larger
    unit: str
    turns: int  # that it rests on

    @property
    def line(self) -> str | None:
        """A line for the table ``[relations]`` of a species, for a danger called about by its id.

        None where the herd does not react, or the tracks are not in metres, as distances of species are.
        """
        if not self.told or self.unit != "m":
            return None
        return f'{name_like(self.danger)} = {{ fear = {self.strength:.2f}, notice = "{self._rounded(self.notice)} m" }}'

    def _rounded(self, distance, fewest=0):
        """A distance with as many places after the point as two digits of `notice` need, and at least so many."""
        return f"{distance:.{max(fewest, 1 - math.floor(math.log10(self.notice)))}f}"

    @property
    def sentence(self) -> str:
        """The result in words."""
        if not self.told:
            return (
                f"These tracks show no reaction to {self.danger} beyond reactions to neighbours: "
                f"{self.strength:.2f} ± {self.strength_error:.2f} of the steering."
            )
        at, low, high = (self._rounded(distance, 1) for distance in (self.notice, *self.notice_range))
        beyond = "; the distance may be larger, because the tracks contain no larger one" if self.reaches_beyond else ""
        return (
            f"Animals notice {self.danger} at {at} {self.unit} ({low} to {high}); near by, it takes "
            f"{self.strength:.2f} ± {self.strength_error:.2f} of the steering{beyond}."
        )


def learn_relation(recordings: list[Trajectories], danger: str, length: float, leave_out=(), seed: int = 0):
    """The relation of a herd to one animal of its recordings.

    Parameters
    ----------
    recordings : list of Trajectories
        Each with the herd and the danger.
    danger : str
        Its id.
    length : float
        One body length of the herd's animals, in the unit of the tracks.
    leave_out : iterable of str
        Ids that are neither (a shepherd).
    seed : int
        Of the bootstrap.

    Returns
    -------
    LearnedRelation

    Raises
    ------
    ValueError
        When no recording has the danger, or an animal that is left out; or too few animals or turns are seen.
    """
    leave_out = tuple(leave_out)
    _check_ids(recordings, danger, leave_out)
    rows = [row for one in recordings for row in _turns(one, danger, length, leave_out)]
    if not rows:
        raise ValueError(f"no file has tracks of {danger!r} and other animals at the same time")
    if sum(len(r) for r in rows) < FEWEST:
        raise ValueError(f"{sum(len(r) for r in rows)} turns near {danger!r} are too few; at least {FEWEST} are needed")
    table = np.concatenate(rows)
    grid = np.geomspace(max(np.quantile(table[:, 4], 0.02), 0.05), np.quantile(table[:, 4], 0.995), DISTANCES)
    loss, notice, strength = _fitted(table, grid)
    rng = np.random.default_rng(seed)
    drawn = [
        _fitted(np.concatenate([rows[k] for k in rng.integers(len(rows), size=len(rows))]), grid)
        for _ in range(RESAMPLED)
    ]
    _, distances, strengths = np.array(drawn).T
    error = float(strengths.std(ddof=1))
    low, high = np.quantile(distances, [1 / 6, 5 / 6]) * length
    as_good = sum(_fitted(other, grid)[0] <= loss for other in _turned_over(rows, rng))
    told = strength > CLEAR * error and as_good <= BY_CHANCE
    return LearnedRelation(
        danger, float(notice * length), (float(low), float(high)), float(strength), error,
        bool(told), bool(notice > EDGE * grid[-1]), recordings[0].unit, len(table),
    )  # fmt: skip


def _check_ids(recordings, danger, leave_out):
    """ValueError unless all animals that are named are there, and enough others beside the danger."""
    ids = {name for one in recordings for name in one.ids}
    for name, told in ((danger, ""), *((name, ", which is to be left out") for name in leave_out)):
        if name not in ids:
            raise ValueError(f"no file has tracks of animal {name!r}{told}{did_you_mean(name, ids)}")
    most = max(len(_others(one, danger, leave_out)) for one in recordings if danger in one.ids)
    if most < FEWEST_OTHERS:
        told = f"at least {FEWEST_OTHERS} animals besides {danger!r} and those left out are needed"
        raise ValueError(f"{told}; no file has more than {most}")


def _others(tracks, danger, leave_out):
    """The columns of the herd."""
    return [k for k, name in enumerate(tracks.ids) if name != danger and name not in leave_out]


def _turned_over(rows, rng):
    """Tables in which blocks, by chance, have the danger on the other side: as likely if no animal reacts to it."""
    for _ in range(FLIPPED):
        signs = rng.choice([-1.0, 1.0], len(rows))
        yield np.concatenate([row * (1.0, 1.0, 1.0, sign, 1.0) for row, sign in zip(rows, signs, strict=True)])


def relation_of_files(paths, danger: str, looking: Looking, leave_out=(), seed=0, as_json=False):
    """Learn the relation from files of tracks and print it.

    Raises
    ------
    ProblemsError
        When a file cannot be read, or the danger is in none of them.
    """
    read = [read_tracks_of(path, looking) for path in paths]
    for path, (tracks, _) in zip(paths, read, strict=True):
        for note in tracks.notes:
            say(f"{path}: {note}")
    try:
        length = float(np.median([length for _, length in read]))
        found = learn_relation([tracks for tracks, _ in read], danger, length, leave_out, seed)
    except ValueError as error:
        raise refused(paths[0], str(error)) from None
    if as_json:
        print_json(vars(found) | {"sentence": found.sentence, "line": found.line})
        return
    say(found.sentence)
    if found.line is not None:
        print_line(found.line)


def _turns(tracks, danger, length, leave_out):
    """Blocks of rows (turn rate, sines to the mean heading, to the middle, away from the danger; its distance, BL)."""
    if danger not in tracks.ids:
        return
    own = _others(tracks, danger, leave_out)
    if len(own) < FEWEST_OTHERS:
        return
    herd = replace(
        tracks, xy=tracks.xy[:, own], ids=tuple(tracks.ids[k] for k in own),
        heading=None if tracks.heading is None else tracks.heading[:, own],
    )  # fmt: skip
    seen = evidence_of_tracks(herd, length).sightings
    at = tracks.xy[:, tracks.ids.index(danger)] / length
    ahead = max(1, round(SPAN * tracks.fps))
    found, block = [], max(1, round(BLOCK * tracks.fps))
    for t in range(0, len(seen) - ahead, ahead):
        if np.isfinite(at[t, 0]):
            found.append((t // block, _rows_of_frame(seen, t, ahead, at[t], tracks.fps)))
    for number in sorted({b for b, _ in found}):
        rows = np.concatenate([r for b, r in found if b == number])
        if len(rows):
            yield rows


def _rows_of_frame(seen, t, ahead, danger, fps):
    here, there = seen.of(t), seen.of(t + ahead)
    xy, forward, speed, who = seen.xy[here], seen.forward[here], seen.speed[here], seen.track[here]
    _, mine, later = np.intersect1d(who, seen.track[there], return_indices=True)
    if len(xy) < 3 or not len(mine):
        return np.zeros((0, 5))
    near = cKDTree(xy).query(xy, k=min(NEIGHBOURS + 1, len(xy)))[1][:, 1:]
    wanted = forward[near].sum(1), xy[near].mean(1) - xy, xy - danger
    sines = [_sine(forward, way) for way in wanted]
    after = seen.forward[there][later]
    turn = np.arctan2(forward[mine, 0] * after[:, 1] - forward[mine, 1] * after[:, 0], (forward[mine] * after).sum(1))
    far = np.hypot(*(xy - danger).T)
    rows = np.column_stack([turn * fps / ahead, *(sine[mine] for sine in sines), far[mine]])
    return rows[(speed[mine] > SLOWEST) & np.isfinite(rows).all(1)]


def _sine(forward, way):
    size = np.maximum(np.hypot(*way.T), 1e-9)
    return (forward[:, 0] * way[:, 1] - forward[:, 1] * way[:, 0]) / size


def _fear(distance, notice):
    """As the simulation has it, of weight 1 (`flockbrush.systems.noticing.fear_`)."""
    return np.clip(2.0 * (1.0 - distance / notice), 0.0, 1.0)


def _fitted(table, grid):
    """(loss, notice distance, BL; strength) of the best fit to the turns."""
    best = None
    for notice in grid:
        columns = np.column_stack([table[:, 1], table[:, 2], table[:, 3] * _fear(table[:, 4], notice)])
        weights, loss = _least(columns, table[:, 0])
        if best is None or loss < best[0]:
            best = loss, notice, weights
    loss, notice, (aligned, together, away) = best
    others = max(aligned, 0.0) + max(together, 0.0)
    away = max(away, 0.0)
    return loss, notice, away / max(away + others, 1e-12)


def _least(columns, turn):
    """(weights, negative logarithm of the likelihood a turn) by reweighted least squares, Student's t."""
    weight = np.ones(len(turn))
    for _ in range(5):
        pull, information = normal_equations(columns, weight, turn)
        found = np.linalg.solve(information + 1e-9 * np.eye(3), pull)
        off = turn - columns @ found
        spread = max(float(np.sqrt((weight * off**2).sum() / len(turn))), 1e-9)
        weight = (FREEDOM + 1.0) / (FREEDOM + (off / spread) ** 2)
    tail = np.log1p((off / spread) ** 2 / FREEDOM)
    return found, float((FREEDOM + 1.0) / 2 * tail.mean() + np.log(spread))

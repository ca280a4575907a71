"""Everything that came of learning one brush: what its report tells and its provenance keeps."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from behaviours.brush import Brush
from behaviours.learning.evidence import Evidence
from behaviours.learning.learned import Learned
from behaviours.learning.scores import CHANCE, beyond_chance
from flockbrush.learn.comparison import JUDGED, TITLES, Comparison, Verdict
from flockbrush.learn.counts import SECONDS

FEW = 10  # animals, below which polarization and milling say little
KEPT = 0.2  # polarization and milling of a herd of other size are the clip's within this


@dataclass
class Rival:
    """Other numbers on the same frames: chance, or a brush set by hand."""

    name: str
    errors: dict[str, float]  # of the means, by measure
    density: float  # share of animals in the wrong cell
    velocity: float
    unlike: float  # in all measures, in the clip's own deviations


@dataclass
class Findings:
    """One brush, and how far it can be trusted.

    Attributes
    ----------
    brush : Brush
    clips : list of Evidence
        What it was learned from.
    whole : Evidence
        All frames of the first clip, with those held out.
    learned : Learned
    held : Evidence or None
        The frames held out; None when the clip was too short, or is a photograph.
    comparison : Comparison or None
        On the frames held out, or without those on the frames learned from.
    rivals : list of Rival
    counts : list of dict
        With other numbers of animals (`flockbrush.learn.counts`).
    ablations : list of dict
        `flockbrush.learn.ablation`.
    command : str
        That makes it again.
    seconds : dict of str to float
        What took how long.
    moments : list of ndarray
        Clip beside simulation, (h, w, 3) RGB.
    """

    brush: Brush
    clips: list[Evidence]
    whole: Evidence
    learned: Learned
    held: Evidence | None = None
    comparison: Comparison | None = None
    rivals: list[Rival] = field(default_factory=list)
    counts: list[dict] = field(default_factory=list)
    ablations: list[dict] = field(default_factory=list)
    command: str = ""
    seconds: dict[str, float] = field(default_factory=dict)
    moments: list[np.ndarray] = field(default_factory=list)

    @property
    def prefix(self) -> str:
        """What the figures of the comparison are called by."""
        return "held-out" if self.held is not None else "same frames"

    def figures(self) -> dict[str, float]:
        """Numbers by name, for the provenance and for --json."""
        found = {f"learning: {name}": value for name, value in self.learned.held_out.items()}
        loss = self.learned.loss
        if len(loss):
            found["loss"] = float(loss[-1])
        if self.comparison is not None:
            found |= self.comparison.figures(self.prefix)
        for row in self.counts:
            words = f"with {row['factor']:g} times the animals"
            found |= {f"{words}, {name}": row[name] for name in ("polarization", "milling", "spacing", "together")}
        return {name: value for name, value in found.items() if math.isfinite(value)}

    def strayed(self, row: dict) -> str:
        """What a herd of other size does not keep of the clip, of one row of `counts`; "" where it keeps all.

        Few animals are by chance more polarized than many: that is taken out of both.
        """
        if self.comparison is None:
            return ""
        seen = float(np.median(self.whole.fields.count))
        lost = []
        for name in JUDGED:
            clip = self.comparison.verdict(name).clip
            herd = beyond_chance(row[name], row["animals"], CHANCE[name])
            if math.isfinite(clip) and abs(herd - beyond_chance(clip, seen, CHANCE[name])) > KEPT:
                lost.append(name)
        return ", ".join(lost)

    @property
    def motion(self) -> bool:
        """Whether the clip shows any; one picture does not."""
        return bool(np.isfinite(self.whole.fields.velocity).any())

    def verdict(self) -> str:
        """One sentence: does the brush do what the clip shows?"""
        if self.learned.interrupted and self.comparison is None:
            return "The learning was interrupted: this is the best so far, and nothing was compared."
        if self.comparison is None:
            return "Learned from one picture: there is no motion to compare with."
        if not self.motion:
            v = self.comparison.verdict("density")
            return (
                f"Learned from one picture: {v.clip:.2f} animals a square body length in it, {v.herd:.2f} in the "
                "simulated herd; there is no motion to compare with."
            )
        missed = [v for v in self.judged() if not v.met]
        told = " and ".join(f"{TITLES[v.name].lower()} by {v.off:.2f} (allowed: {v.allowed:.2f})" for v in missed)
        lasting = f"left alone for {self.comparison.times[-1]:.1f} s"
        did = f"it misses {told}" if missed else (
            "its polarization and milling stay within what the clip itself varies by"
        )  # fmt: skip
        if self.held is None:
            return (
                f"Nothing was held back to show whether the simulated herd keeps to the film: begun as the very frames "
                f"it learned from begin and {lasting}, {did}."
            )
        keeps = "does not keep" if missed else "keeps"
        return (
            f"The simulated herd {keeps} to the film: begun as the part of the clip that was held out begins and "
            f"{lasting}, {did}."
        )

    def judged(self) -> list[Verdict]:
        """What the verdict goes by, as far as the clip tells it."""
        if self.comparison is None:
            return []
        return [v for v in map(self.comparison.verdict, JUDGED) if math.isfinite(v.clip)]

    def place(self) -> tuple[int, list[str]]:
        """(how many were tried on the same frames, the names of those that are nearer to the clip)."""
        own = [rival.unlike for rival in self.rivals if rival.name == self.brush.name]
        return len(self.rivals), [r.name for r in self.rivals if own and r.unlike < own[0]]

    def checks(self) -> list[tuple[bool | None, str]]:
        """The chief findings as (met or missed or neither, sentence)."""
        told: list[tuple[bool | None, str]] = [(v.met, _judgement(v)) for v in self.judged()]
        tried, nearer = self.place()
        if tried:
            told.append((not nearer, _ranked(self.brush.name, tried, nearer)))
        if self.counts and self.motion:
            strayed = [(r, words) for r in self.counts if (words := self.strayed(r))]
            told.append((not strayed, _resized(self.counts, strayed)))
        count = float(np.median(self.whole.fields.count))
        if count < FEW:
            told.append((None, f"Only about {count:.0f} animals are seen: too few to say much of a herd."))
        sure = int(np.sum(self.learned.identifiable))
        told.append((None, f"The clip tells {_of_twelve(sure)}"))
        if self.learned.interrupted:
            told.append((False, "The learning was interrupted: these are the best numbers up to then."))
        return told


def _of_twelve(sure) -> str:
    """How many of the model's numbers are told."""
    if sure == 0:
        return "none of the 12 numbers of the model: others describe it as well, and they are no facts."
    return f"{sure} of the 12 numbers of the model{'; the others are no facts' if sure < 12 else ''}."


def _judgement(v: Verdict) -> str:
    met = "met" if v.met else "missed"
    return (
        f"{TITLES[v.name]}: {v.clip:.3f} in the clip, {v.herd:.3f} simulated; {met}, off by {v.off:.3f} where "
        f"{v.allowed:.3f} is allowed."
    )


def _ranked(name, tried, nearer) -> str:
    if not nearer:
        return f"Nearer to the clip than all of the {tried - 1} others tried on the same frames."
    are = "is" if len(nearer) == 1 else "are"
    who = ", ".join(nearer)
    return f"Of {tried} tried on the same frames, {len(nearer)} {are} nearer to the clip than {name}: {who}."


def _resized(counts, strayed) -> str:
    sizes = ", ".join(str(row["animals"]) for row in counts)
    begun = f"Left alone for {SECONDS:g} s on a plane, herds of {sizes} animals "
    if not strayed:
        return begun + "keep the clip's polarization and milling."
    told = "; ".join(f"with {r['animals']} animals {words.replace(', ', ' and ')} changed" for r, words in strayed)
    return f"{begun}do not all keep the clip's polarization and milling: {told}."

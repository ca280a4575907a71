"""The result of learning one brush: the content of its report and its provenance."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from flockbrush.behaviours.brush import Brush
from flockbrush.film.observations import Evidence
from flockbrush.learning.battery import MEASURES
from flockbrush.learning.comparison import JUDGED, Comparison, Verdict
from flockbrush.learning.group_size_test import SECONDS
from flockbrush.learning.learned_parameters import Learned
from flockbrush.learning.other_starts import SECONDS as ALONE_FROM
from flockbrush.learning.scores import CHANCE, beyond_chance
from flockbrush.learning.verdict import ALONE, Judgement
from flockbrush.learning.which_model import ModelComparison
from flockbrush.learning.words_of_tracks import Words, words_for

FEW = 10  # animals, below which polarization and milling say little
KEPT = 0.2  # polarization and milling of a herd of other size are the clip's within this


@dataclass
class Findings:
    """One brush, and how far it can be trusted."""

    brush: Brush
    clips: list[Evidence]  # what it was learned from
    whole: Evidence  # all frames of the first clip, with those held out
    learned: Learned
    held: Evidence | None = None  # the frames held out; None when the clip was too short, or is a photograph
    comparison: Comparison | None = None  # on the frames held out, or without those on the frames learned from
    judgement: Judgement | None = None  # by the frames held out of each part of the clip, or of each clip, in turn
    # with other numbers of animals (`flockbrush.learning.group_size_test`)
    counts: list[dict] = field(default_factory=list)
    # from other starts than the clip's (`flockbrush.learning.other_starts`)
    starts: list[dict] = field(default_factory=list)
    ablations: list[dict] = field(default_factory=list)  # `flockbrush.learning.ablation`
    command: str = ""  # that makes it again
    seconds: dict[str, float] = field(default_factory=dict)  # what took how long
    moments: list[np.ndarray] = field(default_factory=list)  # clip beside simulation, (h, w, 3) RGB
    notes: list[str] = field(default_factory=list)  # on how it was judged and fitted
    # what the comparison is of: learned without the frames held out. None: `brush` itself.
    judged_brush: Brush | None = None
    models: ModelComparison | None = None  # of kinds of models, where `auto` chose one

    @property
    def compared_brush(self) -> Brush:
        """The brush of the comparison, which knows nothing of the frames held out."""
        return self.brush if self.judged_brush is None else self.judged_brush

    @property
    def words(self) -> Words:
        """What turns texts about a clip into those about what the brush was learned from."""
        return words_for(self.whole)

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
        if self.judgement is not None:
            found |= {f"{self.prefix} {row.name}, limits off": row.far for row in self.judgement.brush.rows}
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

    def counts_sentence(self) -> str:
        """What herds of other sizes do; "" if none were run."""

        def not_kept(row):
            strayed = self.strayed(row)
            return f" (differs from the clip in {strayed})" if strayed else ""

        told = "; ".join(
            f"{r['animals']} animals: polarization {r['polarization']:.2f}, milling {r['milling']:.2f}, nearest "
            f"neighbour {r['spacing']:.2f} BL{not_kept(r)}"
            for r in self.counts
        )
        return f"{self.ground.capitalize()}, 10 to 20 s after a start like that of the clip: {told}." if told else ""

    @property
    def ground(self) -> str:
        """Where herds of other sizes are simulated, in words."""
        if self.whole.fields.enclosed:
            return "in an arena that grows with the herd"
        return "among obstacles that grow with the herd" if self.whole.fields.obstacle.any() else "on an endless plane"

    def starts_sentence(self) -> str:
        """From which other starts herds come to the clip's polarization and milling; "" where that is not known."""
        if not self.starts or self.comparison is None or not self.motion:
            return ""
        herds, told = len(self.starts[0]["milling"]), []
        for row in self.starts:
            each = ({"animals": row["animals"]} | {name: row[name][k] for name in JUDGED} for k in range(herds))
            told.append(f"{sum(not self.strayed(one) for one in each)} from {row['words']}")
        return (
            f"Herds that reach the polarization and milling of the clip after {ALONE_FROM:g} s alone on a plane, "
            f"of {herds} herds of {self.starts[0]['animals']} animals for each start: {', '.join(told)}."
        )

    @property
    def motion(self) -> bool:
        """Whether the clip shows any; one picture does not."""
        return bool(np.isfinite(self.whole.fields.velocity).any())

    def verdict(self) -> str:
        """One sentence: does the brush do what the clip shows?"""
        if self.learned.interrupted and self.comparison is None:
            tested = "It was not tested." if self.judgement is None else self.judgement.sentence
            return f"Learning was interrupted; this is the best brush so far. {tested}"
        if self.comparison is None:
            return "Learned from one picture: there is no motion to compare with."
        if not self.motion:
            v = self.comparison.verdict("density")
            return (
                f"Learned from one picture: {v.clip:.2f} animals per square body length in it, {v.herd:.2f} in the "
                "simulated herd; there is no motion to compare with."
            )
        if self.judgement is None:
            return "The brush was not tested."
        by = (
            ""
            if self.held is not None
            else " No frames were held out: it was tested on the frames it was learned from."
        )
        return self.judgement.sentence + by

    def judged(self) -> list[Verdict]:
        """The measures of the verdict that the clip determines."""
        if self.comparison is None:
            return []
        return [v for v in map(self.comparison.verdict, JUDGED) if math.isfinite(v.clip)]

    def place(self) -> tuple[int, list[str]]:
        """(how many others were tried on the same frames, the names of those that are nearer to the clip)."""
        if self.judgement is None:
            return 0, []
        own = self.judgement.brush.distance(self.judgement.told)
        nearer = [r.name for r in self.judgement.rivals if r.distance(self.judgement.told) < own]
        return len(self.judgement.rivals), nearer

    def checks(self) -> list[tuple[bool | None, str]]:
        """The chief findings as (met or missed or neither, sentence)."""
        told: list[tuple[bool | None, str]] = []
        if self.judgement is not None:
            rows = [(row, "") for row in self.judgement.brush.rows if row.name in self.judgement.told]
            rows += [(row, f" after {ALONE:g} s alone") for row in self.judgement.brush.lasting]
            told += [(row.met, _judgement(row, after)) for row, after in rows]
        tried, nearer = self.place()
        if tried:
            told.append((not nearer, _ranked(tried, nearer)))
        told += [(None, note) for note in self.notes]
        if self.counts and self.motion:
            strayed = [(r, words) for r in self.counts if (words := self.strayed(r))]
            told.append((not strayed, _resized(self.counts, strayed, self.ground)))
        if self.starts_sentence():
            told.append((None, self.starts_sentence()))
        count = float(np.median(self.whole.fields.count))
        if count < FEW:
            told.append((None, f"Only about {count:.0f} animals are visible: too few for conclusions about a herd."))
        sure = int(np.sum(self.learned.identifiable))
        told.append((None, f"The clip constrains {_of_all(sure, len(self.learned.names))}"))
        if self.learned.interrupted:
            told.append((False, "Learning was interrupted: these are the best parameters so far."))
        return told


def _of_all(sure, count) -> str:
    """A sentence on the number of identifiable parameters."""
    if sure == 0:
        return f"none of the {count} parameters: other values fit equally well, and all are guesses."
    return f"{sure} of {count} parameters{'; the rest are guesses' if sure < count else ''}."


def _judgement(row, after) -> str:
    unit = MEASURES[row.name].unit
    met = "met" if row.met else "missed"
    return (
        f"{row.name.capitalize()}{after}: {row.clip:z.2f} in the clip, {row.herd:z.2f} simulated"
        f"{f' ({unit})' if unit else ''}; {met}, off by {row.off:.3g}, limit {row.limit:.3g}."
    )


def _ranked(tried, nearer) -> str:
    if not nearer:
        return f"Nearer to the clip than all {tried} other herds on the same frames."
    are = "is" if len(nearer) == 1 else "are"
    return f"Of {tried} other herds on the same frames, {len(nearer)} {are} nearer to the clip: {', '.join(nearer)}."


def _resized(counts, strayed, ground) -> str:
    sizes = ", ".join(str(row["animals"]) for row in counts)
    begun = f"After {SECONDS:g} s alone {ground}, herds of {sizes} animals "
    if not strayed:
        return begun + "keep the polarization and milling of the clip."
    told = "; ".join(f"with {r['animals']} animals {words.replace(', ', ' and ')} changed" for r, words in strayed)
    return f"{begun}do not all keep the polarization and milling of the clip: {told}."

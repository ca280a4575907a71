"""What a brush is learned from and what judges it: parts of a clip, or whole clips, held out in turn."""

from __future__ import annotations

from dataclasses import dataclass

from flockbrush.film.observations import Evidence
from flockbrush.learning.regions import within


@dataclass(frozen=True)
class ClipFolds:
    """One clip: all its frames, and pairs of (learned from, held out), which know nothing of each other."""

    whole: Evidence
    parts: tuple[tuple[Evidence, Evidence], ...] = ()


@dataclass(frozen=True)
class Fold:
    """What a brush is learned from, and what judges it; None where nothing could be held out."""

    clips: list[Evidence]
    held: Evidence | None


def seen_within(seen: ClipFolds, region) -> ClipFolds | None:
    """The observations of one region; None if it has too few animals."""
    whole = within(seen.whole, region)
    parts = [tuple(within(part, region) for part in pair) for pair in seen.parts]
    if whole is None or any(training is None for training, _ in parts):
        return None
    return ClipFolds(
        whole, tuple((training, held) for training, held in parts if training is not None and held is not None)
    )


def folds_of(seen: list[ClipFolds]) -> list[Fold]:
    """Every clip held out in turn; of one clip its parts."""
    if len(seen) > 1:
        return [Fold([o.whole for o in seen if o is not one], one.whole) for one in seen]
    return [Fold([training], held) for training, held in seen[0].parts] or [Fold([seen[0].whole], None)]

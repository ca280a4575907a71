"""From what was learned to a brush: numbers, animals and speed, and where they come from."""

from __future__ import annotations

import datetime
import math
import zlib
from collections.abc import Iterable, Mapping
from importlib import metadata
from pathlib import Path

import numpy as np

import flockbrush
from flockbrush.behaviours.brush import SUFFIX, BodySpec, Brush, Provenance, name_like
from flockbrush.behaviours.file_library import NAME
from flockbrush.engine.files import refused
from flockbrush.film.observations import Evidence
from flockbrush.learning.herd_views import view_of
from flockbrush.learning.learned_parameters import Learned
from flockbrush.learning.rollout import NAMES
from flockbrush.learning.scores import measures_of
from flockbrush.learning.words_of_tracks import words_for
from flockbrush.render.style import PALETTE
from flockbrush.runs.run import versions

TOOLS = "torch", "opencv-contrib-python-headless", "scipy"  # besides those a run depends on
WORDS = {"weight": "weight", "radial": "reach", "angular": "angle"}
MARCH, MILL, AGREED = 0.8, 0.6, 0.5  # of polarization and milling, from where on a herd is called so


def name_of(path) -> str:
    """The name of the brush in a file that is to be written.

    Raises
    ------
    ProblemsError
        When no brush can have that name.
    """
    base = Path(path).name
    if not base.endswith(SUFFIX):
        raise refused(path, f"the name of a brush file must be NAME{SUFFIX}")
    name = base.removesuffix(SUFFIX)
    if not NAME.fullmatch(name):
        told = "letters without accents, digits, - and _, at most 64, beginning with a letter or digit"
        raise refused(path, f"invalid brush name {name!r}: {told}; try {name_like(name)}{SUFFIX}")
    return name


def brush_of(
    name: str,
    learned: Learned,
    evidences: list[Evidence],
    *,
    seed: int,
    figures: Mapping[str, float] = {},
    length_m: float | None = None,
    licence: str | None = None,
    colour: str | None = None,
    notes: Iterable[str] = (),
) -> Brush:
    """The brush of what was learned.

    Parameters
    ----------
    evidences : list of Evidence
        What it was learned from; the first gives clip, frames and SHA-256.
    seed : int
        Of the learning.
    figures : dict of str to float
        What was measured, for the provenance.
    length_m : float
        Length of one animal, metres: that of tracks in metres by default, else 1, since a film does not show it.
    licence : str, optional
        Of the clip.
    colour : "#rrggbb", optional
        Of the painted ground; by the name by default.
    notes : sentences
        More to know.
    """
    clip, frames = evidences[0], evidences[0].fields.frames
    length_m = length_m or (clip.body_length_px if clip.length_unit == "m" else 1.0)
    body = learned.body
    radius = min(body.radius / body.length, 0.5) * length_m
    provenance = Provenance(
        kind="learned",
        source=_line(_source(evidences)),
        date=datetime.date.today(),
        by=f"flockbrush {flockbrush.__version__} learn",
        notes="\n".join(map(words_for(clip), [*_sentences(learned, evidences), *notes]))[:20_000],
        seed=seed,
        clip=_line(Path(clip.name).name),
        frames=(int(frames[0]), int(frames[-1])),
        clip_sha256=clip.sha256 or None,
        licence=_line(licence) if licence else None,
        versions=tool_versions(),
        report={_line(key): float(f"{value:.4g}") for key, value in figures.items() if math.isfinite(value)},
    )
    return Brush(
        name=name,
        title=_line(f"Learned: {Path(clip.name).stem}"),
        description=description(clip, learned),
        model=learned.model,
        colour=colour or PALETTE[zlib.crc32(name.encode()) % len(PALETTE)],
        params=learned.params,
        speed=learned.speed,
        body=BodySpec(length=length_m, radius=radius, contact=body.contact),
        vision=learned.vision,
        provenance=provenance,
    )


def _line(text) -> str:
    """Text as one line of a provenance."""
    return "".join(c if c.isprintable() else " " for c in str(text))[:200]


def _source(evidences):
    return f"learned from the {_shown_as(evidences[0])} {', '.join(Path(e.name).name for e in evidences)}"


def _shown_as(evidence):
    return "photograph" if evidence.still else "tracks" if evidence.from_tracks else "clip"


def description(clip: Evidence, learned: Learned) -> str:
    """What the animals do, from what was measured of the clip."""
    count = float(np.median(clip.fields.count))
    speed = learned.speed.mean
    where, pace = Path(clip.name).name, f"{speed:.2g} body lengths/s"
    if not np.isfinite(clip.fields.velocity).any():
        return f"Like about {count:.0f} animals in {where}; {pace} (the picture does not show the speed)."
    return f"Like about {count:.0f} animals in {where}, which move {_manner(clip)} at {pace}."


def _manner(clip):
    """March, mill or neither, by polarization and milling about the middle of the herd."""
    polarization, milling = order_of(clip)
    if milling >= MILL and milling > polarization:
        return "in a circle"
    if polarization >= MARCH:
        return "in one direction"
    if polarization >= AGREED:
        return "mostly in one direction"
    return "in no common direction"


def order_of(clip: Evidence) -> tuple[float, float]:
    """(polarization, milling) of a clip, means over the frames; NaN if no animal moves."""
    found = measures_of(view_of(clip), max(1, len(clip.fields) // 40))
    known = {name: found[name][np.isfinite(found[name])] for name in ("polarization", "milling")}
    means = {name: float(values.mean()) if len(values) else math.nan for name, values in known.items()}
    return means["polarization"], means["milling"]


def plain(name: str) -> str:
    """A parameter in words: "reach of cohesion"."""
    force, _, kind = name.partition("_")
    return f"{WORDS[kind]} of {force}" if name in NAMES else name.replace("_", " ")


def _sentences(learned, evidences):
    """What is known of the numbers, and what is not."""
    names, shown = np.array([plain(name) for name in learned.names]), _shown_as(evidences[0])
    sure = names[np.asarray(learned.identifiable, bool)]
    unsure = names[~np.asarray(learned.identifiable, bool)]
    if learned.interrupted:
        yield "Learning was interrupted; these are the best parameters so far."
    if len(sure):
        yield f"Identifiable from the {shown}: {', '.join(sure)}."
    if len(unsure):
        yield f"Not identifiable from the {shown} (other values fit equally well): {', '.join(unsure)}."
    if learned.extras:
        told = ", ".join(f"{key} {value:.3g}" if isinstance(value, float) else f"{key} {value}"
                         for key, value in learned.extras.items())  # fmt: skip
        yield f"Also set from the {shown}: {told}."
    clip = evidences[0]
    yield f"One body length is {clip.length_told}; {clip.fps:g} frames per second."
    if clip.sightings is None and not clip.still:
        yield "Single animals could not be separated: learned from density and flow only."
    for other in evidences[1:]:
        yield f"Also from {Path(other.name).name} (SHA-256 {other.sha256})."
    seen = dict.fromkeys([*(note for evidence in evidences for note in evidence.notes), *learned.notes])
    yield from map(sentence, seen)


def sentence(note: str) -> str:
    """A note as a sentence."""
    note = note.strip()
    return note[:1].upper() + note[1:] + ("" if note.endswith((".", "!", "?")) else ".")


def tool_versions() -> dict[str, str]:
    """What it was made with."""
    found = versions()
    for tool in TOOLS:
        try:
            found[tool] = metadata.version(tool)
        except metadata.PackageNotFoundError:
            continue
    return {name: str(version) for name, version in found.items()}

"""Brushes of before there were species: their ``[body]`` becomes a species, and ``made_for`` names it.

The text of the file is kept as it is but for those lines.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from flockbrush.behaviours.brush import Brush, default_body, flies_free, load_brush
from flockbrush.behaviours.brush_writer import toml_value
from flockbrush.behaviours.species import SUFFIX, BodySpec, SpeciesLibrary, load_species
from flockbrush.engine.problems import Problem, ProblemsError, did_you_mean

_SECTION = re.compile(r"^\[body\][^\n]*\n(?:(?!\[)[^\n]*\n?)*", re.MULTILINE)
_HEADER = re.compile(r"^\[", re.MULTILINE)


@dataclass(frozen=True)
class Converted:
    """What a brush file becomes."""

    text: str  # of the brush
    made_for: tuple[str, ...]
    species: str = ""  # text of a species file of the brush's own name; "" where a shipped species has its body


def convert(source: bytes, file: str, library: SpeciesLibrary, species: str = "") -> Converted | None:
    """A brush file with ``made_for`` instead of its body; None when it has nothing to convert.

    Parameters
    ----------
    source, file
        What is in the file, and its name for messages.
    library : SpeciesLibrary
        Where a species with the same body is looked for.
    species : str
        The species it is made for, whatever its body was; "" finds one with the same body or writes one.

    Raises
    ------
    ProblemsError
        When the brush is damaged, or there is no such species.
    """
    brush = load_brush(source, file)
    text = source.decode("utf-8-sig").replace("\r\n", "\n")
    if brush.made_for or _SECTION.search(text) is None:
        return None
    if species and library.find(species) is None:
        message = f"there is no species {species!r}{did_you_mean(species, library.names())}"
        raise ProblemsError([Problem(file, None, None, message)])
    species_names = (species,) if species else _like(brush, library)
    new = ""
    if not species_names:
        new, species_names = species_for(brush), (brush.name,)
        load_species(new.encode(), f"{brush.name}{SUFFIX}")  # what is written can be read
    body = default_body(species_names)
    keeps_body = brush.body != body and not species and not new
    text = text if keeps_body else _SECTION.sub("", text, count=1)
    text = _with_made_for(text, species_names)
    load_brush(text.encode(), file)
    return Converted(text, species_names, new)


def _like(brush: Brush, library: SpeciesLibrary) -> tuple[str, ...]:
    """Species of the same body that can move as the brush does; herds of a metre fit all who herd."""
    if brush.body == BodySpec():
        return ("herd",) if not flies_free(brush) else ()
    flies = flies_free(brush)
    same = [one for one in map(library.get, library.names()) if one.body == brush.body]
    return tuple(one.name for one in same if (one.can("fly") if flies else one.can("walk") or one.can("swim")))


def species_for(brush: Brush) -> str:
    """The text of a species with a brush's body."""
    flies = flies_free(brush)
    lines = [
        'schema = "flockbrush.species/1"',
        f'title = {toml_value(brush.title or brush.name)}',
        f'description = {toml_value(f"The animals of the brush {brush.name}; limits are the usual ones.")}',
        f'look = "{"bird" if flies else "beast"}"',
        f'gait = "{"flapping" if flies else "quadruped"}"',
        f'media = {toml_value(["walk", "fly"] if flies else ["walk"])}',
        f'tags = {toml_value(["bird"] if flies else ["herd"])}',
        "", "[body]",
        *(f"{name} = {toml_value(value)}" for name, value in brush.body.model_dump().items()),
        "", "[relations]", '"*" = { avoid = 1.0 }',
    ]  # fmt: skip
    return "\n".join(lines) + "\n"


def _with_made_for(text: str, made_for: tuple[str, ...]) -> str:
    """The text with ``made_for`` after the last line before the first table."""
    first = _HEADER.search(text)
    at = len(text) if first is None else first.start()
    head = text[:at].rstrip("\n")
    return f"{head}\nmade_for = {toml_value(made_for)}  # species or tags that paint of it binds\n\n{text[at:]}"

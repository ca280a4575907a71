"""Species: the body, its limits, its eyes, how individuals differ, and what it makes of other species.

A species is a file ``NAME.species.toml`` (``behaviours/fauna`` has the shipped ones), and its name is the file's.
What the animals *do* is said by brushes (`flockbrush.behaviours.brush`).

    schema = "flockbrush.species/1"
    media = ["walk"]

    [body]
    length = 1.2  # m

    [walk]
    speed = 20.0  # m/s

    [relations]
    wolf = { fear = 1.0, notice = "40 m" }
    "*" = { avoid = 1.0 }

Relations name a species, a tag, or ``"*"`` for everybody else; the most specific one counts.
"""

from __future__ import annotations

import functools
import os
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Any, Literal

from flockbrush.behaviours.file_library import NAME, FileLibrary, check_schema, name_in, read_source
from flockbrush.behaviours.spec import FileSpec, Line, Spec, Text, spec_field
from flockbrush.behaviours.tomlfile import TomlFile
from flockbrush.behaviours.validation import shown, validated
from flockbrush.engine.problems import Problem, ProblemsError, did_you_mean
from pydantic import BeforeValidator, Field, model_validator

SCHEMA = "flockbrush.species/1"
SUFFIX = ".species.toml"
MEDIA = ("walk", "fly", "swim")
Medium = Literal["walk", "fly", "swim"]
VERBS = ("kin", "fear", "hunt", "follow", "avoid", "ignore")
Look = Literal["beast", "bird", "fish", "insect", "person"]
Gait = Literal["quadruped", "biped", "hexapod", "flapping", "swimming"]


class BodySpec(Spec):
    """A body."""

    length: float = spec_field(1.0, "nose to tail; one body length (BL)", "m", gt=0, le=50)
    radius: float = spec_field(0.2, "half the width", "m", gt=0, le=25)
    contact: Literal["capsule", "disc"] = spec_field(
        "capsule", "shape that never overlaps others: the whole body, or a disc of the radius at its centre"
    )

    @model_validator(mode="after")
    def _slender(self):
        if self.radius > self.length / 2:
            raise ValueError(f"radius must be at most half the length ({self.length / 2:g} m), got {self.radius:g}")
        return self


class WalkSpec(Spec):
    """What the legs allow."""

    speed: float = spec_field(5.0, "top speed on the ground", "m/s", gt=0, le=100)
    flee: float = spec_field(5.0, "running speed at full fear", "m/s", gt=0, le=100)
    acceleration: float = spec_field(
        4.0, "largest acceleration for speeding up, braking and turning", "m/s²", gt=0, le=200
    )
    turn: float = spec_field(10.0, "fastest turn", "rad/s", gt=0, le=200)
    steepest: float = spec_field(
        2.0, "slope of the steepest ground that it walks on; it goes round steeper ground", "m/m", gt=0, le=100
    )


class FlySpec(Spec):
    """What the wings allow."""

    speed: float = spec_field(20.0, "top speed in the air", "m/s", gt=0, le=200)
    flee: float = spec_field(20.0, "flying speed at full fear", "m/s", gt=0, le=200)
    slowest: float = spec_field(
        5.0, "lowest flying speed; it takes off and touches down at it, and no speed limit holds it below", "m/s", ge=0
    )
    acceleration: float = spec_field(
        10.0, "largest acceleration for speeding up, braking, turning and climbing", "m/s²", gt=0, le=500
    )
    turn: float = spec_field(3.0, "fastest turn", "rad/s", gt=0, le=200)
    climb: float = spec_field(2.0, "fastest climb", "m/s", gt=0, le=100)
    sink: float = spec_field(3.0, "fastest sink rate when landing", "m/s", gt=0, le=100)
    height: float = spec_field(30.0, "usual flying height above the ground", "m", gt=0)


class SwimSpec(Spec):
    """What fins or feet allow in water."""

    speed: float = spec_field(2.0, "top speed in water", "m/s", gt=0, le=100)
    flee: float = spec_field(2.0, "swimming speed at full fear", "m/s", gt=0, le=100)
    acceleration: float = spec_field(
        3.0, "largest acceleration for speeding up, braking and turning", "m/s²", gt=0, le=200
    )
    turn: float = spec_field(10.0, "fastest turn", "rad/s", gt=0, le=200)


class EyesSpec(Spec):
    """How it notices those whom it fears, hunts or follows; what brushes perceive is in their ``[vision]``."""

    field_of_view: float = spec_field(
        300.0, "full angle, centred ahead; an alarmed animal sees all round", "degrees", gt=0, le=360
    )
    height: float = spec_field(1.0, "height of the eyes above the feet, in body lengths", "BL", ge=0, le=5)


class SpreadSpec(Spec):
    """How individuals differ: standard deviations, drawn once for each animal and cut at two of them."""

    size: float = spec_field(0.0, "standard deviation of the body length, as a share of it", "1", ge=0, le=0.3)
    speed: float = spec_field(0.0, "standard deviation of the preferred speed, as a share of it", "1", ge=0, le=0.3)
    boldness: float = spec_field(
        0.0,
        "standard deviation of boldness; the distance at which danger is noticed is divided by boldness",
        "1",
        ge=0,
        le=0.4,
    )


def _metres(value: Any):
    """``"30 m"`` as 30.0; anything else is left to the check."""
    match = re.fullmatch(r"\s*(\d+(?:\.\d*)?)\s*(m|km)\s*", value) if isinstance(value, str) else None
    if match is None and isinstance(value, str):
        raise ValueError('must be a distance such as "30 m"')
    return float(match[1]) * {"m": 1.0, "km": 1000.0}[match[2]] if match else value


Metres = Annotated[float, BeforeValidator(_metres), Field(gt=0, le=10_000)]
Weight = Annotated[float, Field(ge=0, le=1)]


class Relation(Spec):
    """What one species makes of another: exactly one of kin, fear, hunt, follow, avoid, ignore."""

    kin: Weight | None = spec_field(None, "aligns with it and stays near it, as with its own species")
    fear: Weight | None = spec_field(None, "flees from it; 1: with full effort")
    hunt: Weight | None = spec_field(None, "attacks it if its brush hunts")
    follow: Weight | None = spec_field(None, "follows it if its brush follows")
    avoid: Weight | None = spec_field(None, "gives way to it, and otherwise ignores it")
    ignore: Weight | None = spec_field(None, "does not even give way to it")
    notice: Metres | None = spec_field(None, 'a distance such as "30 m": nearer than this it is noticed', "m")
    catch: Literal["none", "remove"] | None = spec_field(None, "what happens to prey that is caught")

    @model_validator(mode="after")
    def _one_verb(self):
        verbs = [verb for verb in VERBS if getattr(self, verb) is not None]
        if len(verbs) != 1:
            raise ValueError(f"must be exactly one of {', '.join(VERBS)}, got {', '.join(verbs) or 'none'}")
        if self.catch is not None and self.hunt is None:
            raise ValueError("catch can only be used with hunt")
        if self.notice is not None and verbs[0] not in ("fear", "hunt", "follow"):
            raise ValueError(f"notice can only be used with fear, hunt or follow, not with {verbs[0]}")
        if self.notice is None and verbs[0] in ("fear", "hunt", "follow"):
            raise ValueError(f'{verbs[0]} needs a distance: notice = "30 m"')
        return self

    @property
    def verb(self) -> str:
        """Which of the six it is."""
        return next(verb for verb in VERBS if getattr(self, verb) is not None)

    @property
    def weight(self) -> float:
        """How much, 0 to 1."""
        return float(getattr(self, self.verb))


class SpeciesSpec(FileSpec):
    """A kind of animal.

    Examples
    --------
    >>> sheep = shipped_species().get("sheep")
    >>> sheep.relation_to("wolf", ("hunter",)).verb
    'fear'
    """

    name: Annotated[str, Field(pattern=f"^{NAME.pattern}$")] = spec_field(..., "the file's name without .species.toml")
    title: Line = spec_field("", "the name for people")
    description: Text = spec_field("", "what it is, and where its numbers come from")
    look: Look = spec_field("beast", "how it is drawn and exported without a mesh of its own")
    mesh: Line = spec_field("", "a mesh file beside this one, or empty for the built-in look")
    gait: Gait = spec_field("quadruped", "how its body moves")
    media: tuple[Medium, ...] = spec_field(..., "what it can move in")
    tags: tuple[Annotated[str, Field(pattern=f"^{NAME.pattern}$")], ...] = spec_field(
        (), "other names by which brushes and relations refer to it", max_length=16
    )
    body: BodySpec = spec_field(..., "the body")
    walk: WalkSpec = spec_field(WalkSpec(), "limits on the ground")
    fly: FlySpec = spec_field(FlySpec(), "limits in the air")
    swim: SwimSpec = spec_field(SwimSpec(), "limits in water")
    eyes: EyesSpec = spec_field(EyesSpec(), "how it notices others")
    spread: SpreadSpec = spec_field(SpreadSpec(), "how individuals differ")
    calm: float = spec_field(
        6.0,
        "time in which alarm falls to 37 % after the danger was last seen; after 4 times as long it ends",
        "s",
        ge=0,
        le=600,
    )
    relations: dict[str, Relation] = spec_field({}, "relations to others, by species, tag or *", max_length=200)

    @model_validator(mode="after")
    def _moves(self):
        if not self.media:
            raise ValueError("media must name what it can move in: walk, fly, swim")
        return self

    def relation_to(self, name: str, tags: Iterable[str] = ()) -> Relation | None:
        """The relation to another species: by its name, else by its first tag that is told, else by ``"*"``."""
        for key in (name, *tags, "*"):
            if key in self.relations:
                return self.relations[key]
        return None

    def can(self, medium: str) -> bool:
        """Whether it moves in this medium."""
        return medium in self.media


def load_species(source: str | os.PathLike | bytes, file: str | None = None) -> SpeciesSpec:
    """Read a species.

    Parameters
    ----------
    source : path or bytes
        A ``NAME.species.toml`` file, or what is in it.
    file : str, optional
        Its name for messages; the species' name is its last part.  Needed with bytes.

    Raises
    ------
    ProblemsError
        With everything that is wrong with the file.
    """
    toml, source = read_source(source, file, SUFFIX)
    species = _read(toml)
    species._source = source
    return species


def _read(toml: TomlFile) -> SpeciesSpec:
    document = check_schema(toml, SCHEMA)
    document["name"], problems = name_in(toml, SUFFIX)
    if "name" in toml.data:
        problems.append(toml.problem(("name",), "the name of a species is its file name; remove this line"))
    species, mistakes = validated(SpeciesSpec, document)
    problems += [toml.problem(path, message) for path, message in mistakes]
    if species is not None:
        problems += [
            toml.problem((medium,), f"limits for a medium that media does not name; add {medium!r} to media")
            for medium in MEDIA
            if medium in toml.data and not species.can(medium)
        ]
    if species is None or problems:
        raise ProblemsError(sorted(problems, key=lambda problem: problem.line or 0))
    return species


class SpeciesLibrary(FileLibrary):
    """The species in some folders, by name."""

    suffix = SUFFIX

    def find(self, name: str) -> SpeciesSpec | None:
        """The species of this name; None when there is no file of it: then it is a name alone, and can do anything.

        Raises
        ------
        ProblemsError
            With everything that is wrong with its file.
        """
        file = self.file_of(name) if NAME.fullmatch(name) else None
        return _parsed(str(file), self.bytes_of(file)) if file else None

    def get(self, name: str) -> SpeciesSpec:
        """As `find`, with a ProblemsError when there is none."""
        species = self.find(name)
        if species is None:
            message = f"there is no species '{name}'{did_you_mean(name, self.names())}"
            raise ProblemsError([Problem(shown(name) + SUFFIX, None, None, message)])
        return species

    def named(self, key: str) -> list[SpeciesSpec]:
        """Those with this name or tag."""
        return [one for one in map(self.get, self.names()) if key == one.name or key in one.tags]


def usual_species(made_for: Iterable[str], library: SpeciesLibrary, present: Iterable[str] = ()) -> str:
    """The species that a brush moves when nobody says which: one that is present, else the first there is; or ""."""
    able = list(dict.fromkeys(one.name for key in made_for for one in library.named(key)))
    return next((name for name in present if name in able), able[0] if able else "")


@functools.lru_cache(maxsize=256)
def _parsed(file: str, source: bytes) -> SpeciesSpec:
    return load_species(source, file)


@functools.cache
def shipped_species() -> SpeciesLibrary:
    """The species that come with Flockbrush."""
    return SpeciesLibrary([Path(__file__).parent / "fauna"])

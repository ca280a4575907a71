"""Brushes: what a designer paints with.  A model of behaviour, its numbers, and where the numbers come from.

A brush is a file ``NAME.brush.toml`` (``behaviours/brushes`` has the shipped ones), and its name is the file's.
Parameters are written flat, under the names the model gives them::

    schema = "flockbrush.brush/1"
    model = "herd"

    [parameters]
    avoidance_weight = 0.742

    [speed]
    mean = 4.0  # body lengths per second
"""

from __future__ import annotations

import functools
import os
import re
import unicodedata
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Annotated, Any, Protocol, runtime_checkable

from flockbrush.behaviours.brush_tables import Provenance, SpeedSpec, VisionSpec
from flockbrush.behaviours.brush_writer import brush_to_toml
from flockbrush.behaviours.file_library import NAME, FileLibrary, check_schema, name_in, read_source
from flockbrush.behaviours.spec import FileSpec, Line, Text, spec_field
from flockbrush.behaviours.species import BodySpec, SpeciesLibrary, shipped_species
from flockbrush.behaviours.tomlfile import Key, TomlFile
from flockbrush.behaviours.validation import shown, validated
from flockbrush.engine.arguments import checked
from flockbrush.engine.files import write_bytes
from flockbrush.engine.problems import Problem, ProblemsError, did_you_mean
from pydantic import BaseModel, Field, SerializeAsAny, model_validator

SCHEMA = "flockbrush.brush/1"
SUFFIX = ".brush.toml"
PATH_SUFFIX = ".path.toml"  # of a measured path between two brushes


def name_like(text: str) -> str:
    """The name that a brush can have and that is nearest to a text: of "Mähende Schafe 1" "Mahende-Schafe-1"."""
    plain = unicodedata.normalize("NFKD", text).encode("ascii", "ignore").decode()
    return re.sub(r"[^A-Za-z0-9_]+", "-", plain).strip("-_")[:64].rstrip("-_") or "learned"


class _NoParams(BaseModel):
    """Stands for parameters that could not be read while the rest of the file is checked."""


class Brush(FileSpec):
    """A model of behaviour with its parameters, ready to paint with.

    Two brushes are equal when they say the same, however their files are laid out.

    Parameters
    ----------
    params : BaseModel
        The ``Params`` of the model.  In Python ``parameters={...}`` may be given instead.

    Examples
    --------
    >>> march = shipped().get("march")
    >>> slower = march.model_copy(update={"speed": SpeedSpec(mean=2)})
    """

    name: Annotated[str, Field(pattern=f"^{NAME.pattern}$")] = spec_field(..., "the file's name without .brush.toml")
    title: Line = spec_field("", "the name for people")
    description: Text = spec_field("", "what the animals do")
    model: Line = spec_field(..., "the model of behaviour")
    colour: Annotated[str, Field(pattern="^#[0-9a-fA-F]{6}$")] = spec_field(
        "#808080", "colour of the painted ground, #rrggbb", examples=["#c9a24b"]
    )
    transition: float = spec_field(0.5, "time in which an animal blends into this brush", "s", ge=0, le=60)
    params: SerializeAsAny[BaseModel] = spec_field(..., "the parameters of the model")
    speed: SpeedSpec = spec_field(..., "how fast")
    made_for: tuple[Annotated[str, Field(pattern=f"^{NAME.pattern}$")], ...] = spec_field(
        (),
        "species or tags that the painted brush acts on; the first species gives its body; empty: all",
        max_length=64,
    )
    body: BodySpec = spec_field(BodySpec(), "body that replaces the body of the species")
    vision: VisionSpec = spec_field(VisionSpec(), "what the animals see")
    drives: dict[str, SerializeAsAny[BaseModel]] = spec_field(
        {}, "drives that act on top of the model, in order of priority"
    )
    provenance: Provenance = spec_field(..., "where the numbers come from")

    @model_validator(mode="before")
    @classmethod
    def _from_parameters(cls, data: Any):
        if not isinstance(data, dict):
            return data
        data = dict(data)
        if "parameters" in data:
            params = _params_of(str(data.get("model")))
            data["params"] = params.model_validate(data.pop("parameters"), strict=True)
        if "body" not in data:
            data["body"] = default_body(data.get("made_for") or ())
        drives = data.get("drives") or {}
        if isinstance(drives, dict):
            known = _drives()
            data["drives"] = {name: known[name].Params.model_validate(table, strict=True)
                              if isinstance(table, dict) and name in known else table
                              for name, table in drives.items()}  # fmt: skip
        return data

    @property
    def has_own_body(self) -> bool:
        """Whether its body is its own, and stands for that of the species it moves."""
        return self.body != default_body(self.made_for)

    def is_made_for(self, species: str, tags: Iterable[str] = ()) -> bool:
        """Whether paint of it binds a species."""
        return not self.made_for or not {species, *tags}.isdisjoint(self.made_for)

    @property
    def parameters(self) -> dict[str, Any]:
        """The parameters of the model by name."""
        return self.params.model_dump()

    def _as_file(self) -> str:
        return brush_to_toml(self)

    def with_parameters(self, **changes) -> Brush:
        """The same brush with some parameters changed.

        Whole floats will do for whole numbers: commands and sliders know floats alone.

        Raises
        ------
        ProblemsError
            For unknown names and values out of bounds.
        """
        now = self.parameters
        for name, value in changes.items():
            whole = type(now.get(name)) is int and isinstance(value, float) and value.is_integer()
            now[name] = int(value) if whole else value
        params, mistakes = validated(type(self.params), now, ("parameters",))
        if mistakes:
            problems = [Problem(self.name, None, ".".join(map(str, path)), message) for path, message in mistakes]
            raise ProblemsError(problems)
        return self.model_copy(update={"params": params})

    def __repr__(self):
        title = f' "{self.title}"' if self.title else ""
        return f"<Brush {self.name}{title}: {self.model}, {self.speed.mean:g} BL/s, {self.provenance.kind}>"

    __str__ = __repr__

    def __eq__(self, other):
        return isinstance(other, Brush) and self.__dict__ == other.__dict__

    def __hash__(self):
        return hash((self.name, self.model, self.colour))


def default_body(made_for: Iterable[str], library: SpeciesLibrary | None = None) -> BodySpec:
    """The body of the first species that is named, a shipped one or of a library, or one metre of anything."""
    library = shipped_species() if library is None else library
    for name in made_for if isinstance(made_for, (list, tuple)) else ():
        species = library.find(name) if isinstance(name, str) else None
        if species is not None:
            return species.body
    return BodySpec()


def flies_free(brush: Brush) -> bool:
    """Whether a brush moves its animals through the air, and not along the ground."""
    model = _models()[brush.model]
    return model.flight is not None and not model.flight_of(brush.params).grounded


def can_move(species: Any, brush: Brush) -> bool:
    """Whether a species can move as a brush does; None, a mere name, can do anything."""
    if species is None:
        return True
    return species.can("fly") if flies_free(brush) else species.can("walk") or species.can("swim")


def cannot_move(name: str, species: Any, brush: Brush) -> str:
    """A sentence why a species of this name cannot move as a brush does; "" when it can."""
    if can_move(species, brush):
        return ""
    needs = "flies" if flies_free(brush) else "walks or swims"
    return f"species {name!r} cannot use brush {brush.name!r}, which {needs}: its media are {', '.join(species.media)}"


def cannot_rise(spawn: Any, species: Any, brush: Brush) -> str:
    """A sentence why the animals of a spawn cannot begin above the ground; "" when they can, or do not."""
    flies = species is None or species.can("fly") or flies_free(brush)
    if flies or not (spawn.altitude or spawn.depth):
        return ""
    return f"species {spawn.species!r} does not fly; altitude and depth must be 0"


def _drives() -> Mapping[str, Any]:
    from flockbrush.behaviours.drive import drives  # here: finding the drives imports them all

    return drives()


def _models() -> Mapping[str, Any]:
    from flockbrush.behaviours.behaviour import behaviours  # here: finding the models imports them all

    return behaviours()


def _params_of(model: str, models: Mapping[str, Any] | None = None) -> type[BaseModel]:
    models = _models() if models is None else models
    if model not in models:
        raise ValueError(f"there is no model '{model}'{did_you_mean(model, models)}")
    return models[model].Params


@checked()
def load_brush(
    source: str | os.PathLike | bytes, file: str | None = None, models: Mapping[str, Any] | None = None
) -> Brush:
    """Read a brush.

    Parameters
    ----------
    source : path or bytes
        A ``NAME.brush.toml`` file, or what is in it.
    file : str, optional
        Its name for messages; the brush's name is its last part.  Needed with bytes.
    models : mapping of str to Behaviour, optional
        The models there are; by default those installed.

    Raises
    ------
    ProblemsError
        With everything that is wrong with the file.
    """
    toml, source = read_source(source, file, SUFFIX)
    brush = _read(toml, _models() if models is None else models)
    brush._source = source
    return brush


def _read(toml: TomlFile, models: Mapping[str, Any]) -> Brush:
    if not toml.data:
        raise ProblemsError([Problem(toml.name, 1, None, f'is empty; a brush starts with: schema = "{SCHEMA}"')])
    document = check_schema(toml, SCHEMA)
    document["name"], problems = name_in(toml, SUFFIX)
    if "name" in toml.data:
        problems.append(toml.problem(("name",), "the name of a brush is its file name; remove this line"))
    document["params"], mistakes = _read_parameters(document, models)
    if "params" in toml.data:
        mistakes.append((("params",), "unknown name"))
    document["drives"], more = _read_drives(document.get("drives", {}))
    mistakes += more
    drives = document.pop("drives")  # objects already, which `validated` would take for tables
    brush, more = validated(Brush, document)
    brush = brush.model_copy(update={"drives": drives}) if brush is not None else None
    for path, message in mistakes + more:
        problems.append(toml.problem(path, _belongs(path, message, models, document)))
    if brush is None or problems:
        raise ProblemsError(sorted(problems, key=lambda problem: problem.line or 0))
    return brush


def _read_parameters(document: dict, models: Mapping[str, Any]) -> tuple[BaseModel, list[tuple[Key, str]]]:
    """The parameters as an object of their model, and what is wrong with them.

    An empty stand-in is returned with the mistakes, so that the rest of the file can still be checked.
    """
    written = document.pop("parameters", {})
    model = document.get("model")
    if not isinstance(model, str):
        return _NoParams(), []  # said by the check of `model`
    if model not in models:
        return _NoParams(), [(("model",), f"there is no model {shown(model)}{did_you_mean(model, models)}")]
    if not isinstance(written, dict):
        return _NoParams(), [(("parameters",), f"must be a table, got {shown(written)}")]
    params, mistakes = validated(models[model].Params, written, ("parameters",))
    return params or _NoParams(), [
        (path, _grouped(path, message, models[model], written)) for path, message in mistakes
    ]


def _read_drives(written: Any) -> tuple[dict[str, BaseModel], list[tuple[Key, str]]]:
    """The parameters of each drive, in the order of the file, and what is wrong with them."""
    if not isinstance(written, dict):
        return {}, [(("drives",), f"must be tables, [drives.NAME], got {shown(written)}")]
    known, params_by_name = _drives(), {}
    mistakes: list[tuple[Key, str]] = []
    for name, table in written.items():
        if name not in known:
            mistakes.append((("drives", name), f"there is no drive {shown(name)}{did_you_mean(name, known)}"))
        elif not isinstance(table, dict):
            mistakes.append((("drives", name), f"must be a table, got {shown(table)}"))
        else:
            params_by_name[name], more = validated(known[name].Params, table, ("drives", name))
            mistakes += more
    return {name: params for name, params in params_by_name.items() if params is not None}, mistakes


def _grouped(path: Key, message: str, model: Any, written: dict) -> str:
    """Say how parameters are spelled to somebody who wrote them as tables."""
    members = [name for name in model.Params.model_fields if name.startswith(f"{path[-1]}_")]
    if len(path) == 2 and isinstance(written.get(path[1]), dict) and members:
        return f"parameters are written without tables: {members[0]} = ..."
    return message


def _belongs(path: Key, message: str, models: Mapping[str, Any], document: dict) -> str:
    """Say where a name belongs that stands in the wrong table: in TOML a table goes on to the next header."""
    if not message.startswith("unknown name"):
        return message
    homes: dict[str, type[BaseModel]] = {
        "speed": SpeedSpec,
        "body": BodySpec,
        "vision": VisionSpec,
        "provenance": Provenance,
    }
    names = {table: list(model.model_fields) for table, model in homes.items()}
    names[""] = ["schema", "parameters", *(name for name in Brush.model_fields if name not in ("name", "params"))]
    model = document.get("model")
    if isinstance(model, str) and model in models:
        names["parameters"] = list(models[model].Params.model_fields)
    for table, inside in names.items():
        if path[-1] in inside:
            place = f"belongs in [{table}]" if table else "belongs at the top, before the first [table]"
            return f"unknown name here; '{path[-1]}' {place}"
    return f"unknown name{did_you_mean(str(path[0]), names[''])}" if len(path) == 1 else message


class BrushLibrary(FileLibrary):
    """The brushes in some folders, by name.

    When two folders have a brush of one name, the first folder wins: a level's own brushes come before the shipped
    ones.  Files are looked at anew at every call, and parsed only when they changed.

    Parameters
    ----------
    folders : sequence of path
        In order of precedence.
    files : mapping of str to bytes, optional
        Brush files by name or path, before all folders: those a recording has embedded.
    models : mapping of str to Behaviour, optional
        The models there are; by default those installed.
    species : SpeciesLibrary, optional
        Where the species of a level with these brushes are; by default the shipped ones.

    Raises
    ------
    ProblemsError
        When a folder is missing.
    """

    suffix = SUFFIX

    def __init__(
        self,
        folders: Iterable[str | os.PathLike] = (),
        files: Mapping[str, bytes] | None = None,
        models: Mapping[str, Any] | None = None,
        species: SpeciesLibrary | None = None,
    ):
        super().__init__(folders, files)
        self.species = species
        missing = [Problem(str(folder), None, None, "there is no such folder") for folder in self.folders]
        missing = [problem for problem, folder in zip(missing, self.folders, strict=True) if not folder.is_dir()]
        if missing:
            raise ProblemsError(missing)
        self._models = models

    def with_files(self, files: Mapping[str, bytes]) -> BrushLibrary:
        """The same with these brush files, by name, before all others."""
        if not files:
            return self
        return BrushLibrary(self.folders, {**self._files, **files}, self._models, self.species)

    def path(self, name: str) -> Path:
        """The file of a brush (just its name when the file is embedded in a recording).

        Raises
        ------
        ProblemsError
            When there is no such brush.
        """
        file = self.file_of(_safe(name))
        if file is None:
            message = f"there is no brush '{name}'{did_you_mean(name, self.names())}"
            raise ProblemsError([Problem(name + SUFFIX, None, None, message)])
        return file

    def get(self, name: str) -> Brush:
        """A brush by name.

        Raises
        ------
        ProblemsError
            When there is no such brush, or with everything that is wrong with its file.
        """
        path = self.path(name)
        return _parsed(str(path), self.bytes_of(path), _models() if self._models is None else self._models)

    def path_between(self, start: str, end: str) -> tuple[Path, bytes] | None:
        """(file, bytes) of the measured path between two brushes, either way; None if it was not measured."""
        file = self.file_called(f"{start}--{end}{PATH_SUFFIX}", f"{end}--{start}{PATH_SUFFIX}")
        return (file, self.bytes_of(file)) if file else None

    def problems(self) -> list[Problem]:
        """Everything that is wrong with any brush of the library."""
        problems = []
        for name in self.names():
            try:
                self.get(name)
            except ProblemsError as error:
                problems += error.problems
        return problems


@runtime_checkable
class BrushSource(Protocol):
    """Where brushes are looked up: a `BrushLibrary`, or what gives some as it does."""

    def get(self, name: str) -> Brush:
        """The brush of this name; ProblemsError where there is none."""


_PARSED: dict[tuple[str, bytes], tuple[Brush, Any]] = {}  # with the model it was checked by
MOST_PARSED = 1024


def _parsed(file: str, source: bytes, models: Mapping[str, Any]) -> Brush:
    """What is in a brush file, parsed once however many libraries hold it."""
    brush, model = _PARSED.get((file, source), (None, None))
    if brush is None or models.get(brush.model) is not model:
        brush = load_brush(source, file, models)
        if len(_PARSED) >= MOST_PARSED:
            _PARSED.clear()
        _PARSED[file, source] = brush, models[brush.model]
    return brush


def _safe(name: str) -> str:
    """A name that stays inside its folder."""
    if isinstance(name, str) and NAME.fullmatch(name):
        return name
    hint = "; leave out '.brush.toml'" if isinstance(name, str) and NAME.fullmatch(name.removesuffix(SUFFIX)) else ""
    message = f"invalid brush name {shown(name)}: letters, digits, - and _, at most 64{hint}"
    raise ProblemsError([Problem("brush", None, None, message)])


@functools.cache
def shipped() -> BrushLibrary:
    """The brushes that come with Flockbrush."""
    return BrushLibrary([Path(__file__).parent / "brushes"])


@checked(brush="a Brush, such as flockbrush.shipped().get('march')")
def save_brush(brush: Brush, folder: str | os.PathLike, overwrite: bool = False) -> Path:
    """Save a brush as ``NAME.brush.toml``, all of it or nothing.

    Parameters
    ----------
    brush : Brush
    folder : path
        Must be there.
    overwrite : bool
        Replace a file that is there.

    Returns
    -------
    Path
        The file written.

    Raises
    ------
    ProblemsError
        When the file is there already, or cannot be written.
    """
    return write_bytes(Path(folder) / (_safe(brush.name) + SUFFIX), brush_to_toml(brush).encode(), overwrite)

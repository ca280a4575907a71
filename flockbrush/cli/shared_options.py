"""Options shared by several commands."""

from __future__ import annotations

import enum
import inspect
import itertools
from collections.abc import Callable
from dataclasses import MISSING, dataclass, fields, is_dataclass
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, get_type_hints

import typer

from flockbrush.engine.files import refused
from flockbrush.film.looking import Looking

if TYPE_CHECKING:
    from flockbrush.runs.cluster import Tls


def option(*words: str, **more):
    """A typer option: names if they differ from the parameter's, metavar if it differs from the type's, help."""
    names = [word for word in words if word.startswith("-")]
    *metavar, text = words[len(names) :]
    return typer.Option(*names, metavar=metavar[0] if metavar else None, help=text, **more)


def wrong(name: str, message: str) -> typer.BadParameter:
    """The error that a value of an option is wrong."""
    return typer.BadParameter(message, param_hint=name)


def argument(metavar: str, text: str):
    """A typer argument with its metavar and help."""
    return typer.Argument(metavar=metavar, help=text)


ThemeName = enum.Enum("ThemeName", {"light": "light", "dark": "dark", "vivid": "vivid"}, type=str)
PaletteName = enum.Enum("PaletteName", {"own": "own", "okabe_ito": "okabe-ito", "tol": "tol"}, type=str)
LevelName = Annotated[str, argument("LEVEL", "Level: a .tmj file, or the name of a shipped level.")]


def no_export(path: Path | None) -> Path | None:
    """A recording to write; its name must not have the extension of an export."""
    from flockbrush.output.exporter import exporter_of

    if path is not None and exporter_of(path) is not None:
        name = f"name it {path.stem}.flock; flockbrush export makes other files of it"
        raise refused(path, f"would be a recording, not a {path.suffix} file: {name}")
    return path


RecordFile = Annotated[Path | None, option("FILE", "Recording to write (.flock), for replay.", callback=no_export)]
RecordingPath = Annotated[Path, argument("RECORDING", "Recording: a file made with --record.")]
Events = Annotated[
    list[str] | None,
    option("S:NAME", "Event for programs at S seconds, such as 2.5:alarm or 2.5:alarm@X,Y,RADIUS; may be repeated."),
]
BrushOfAll = Annotated[
    str | None,
    option(
        "NAME", "Brush of all spawned animals, in place of their brushes and programs: a name or a .brush.toml file."
    ),
]
Json = Annotated[bool, option("--json", "Print one JSON object instead of a table.")]
Seconds = Annotated[float | None, option("S", "Duration, simulated seconds.", min=0)]
Seed = Annotated[int | None, option("K", "Random seed; default: the seed of the level.", min=0, max=2**63 - 1)]
Agents = Annotated[
    int | None,
    option("N", "Total number of animals, at the density of the level; default: the counts of the level.", min=1),
]
Threads = Annotated[int | None, option("N", "Largest number of threads; results do not depend on it.", min=1, max=1024)]
ReportFolder = Annotated[
    Path | None, option("--report", "DIR", "Folder for the report and both states if two runs differ.")
]
Fps = Annotated[
    float | None, option("F", "Frames per second of exports; the default depends on the format (export --help).")
]
WindowTheme = Annotated[ThemeName | None, option("Colours of the window; default: those of the last session.")]
WindowSize = Annotated[str, option("WxH", "Window size, pixels.")]
Frames = Annotated[int | None, option("N", "Close the window after N drawn frames.", min=0)]
ThemeOption = Annotated[ThemeName, option("Colours of pictures and videos.")]
PaletteOption = Annotated[PaletteName, option("Colours of brushes: their own, or a palette for colour-blind viewers.")]
TrackUnit = Annotated[str | None, option("m|px|bl", "Unit of x and y in tracks, if their file does not name it.")]
TrackFps = Annotated[float | None, option("F", "Frames per second of tracks without times.", min=0.001, max=10_000)]


@dataclass(frozen=True)
class TrackOptions:
    """Options for files of tracks that lack these values."""

    unit: TrackUnit = None
    fps: TrackFps = None
    body_length_m: Annotated[
        float | None, option("M", "Body length of tracked animals, nose to tail, m.", min=0.001, max=50)
    ] = None
    body_length_px: Annotated[
        float | None, option("L", "Body length of tracked animals, nose to tail, pixels.", min=0.01, max=2000)
    ] = None

    def read(self) -> Looking:
        """The same with the unit understood; typer.BadParameter where it cannot be."""
        return Looking(
            unit=unit_of(self.unit), fps=self.fps, body_length_m=self.body_length_m, body_length_px=self.body_length_px
        )


def given_options(options, *used: str) -> list[str]:
    """Names of the options given, but for those used."""
    given = [f.name for f in fields(options) if getattr(options, f.name) != f.default]
    return [name for name in given if name not in used]


def refuse_unused(what: str, *unused: list[str]) -> None:
    """Refuse options that would be ignored; typer.BadParameter."""
    for name in itertools.chain(*unused):
        raise wrong(f"--{name.replace('_', '-')}", f"does not apply to {what}")


def unit_of(text: str | None) -> str | None:
    """The unit of tracks; typer.BadParameter for anything but m, px and bl."""
    if text not in (None, "m", "px", "bl"):
        raise wrong("--unit", f"must be m, px or bl, got {text!r}")
    return text


@dataclass(frozen=True)
class WorkOptions:
    """Options of commands that distribute work: local processes, or a cluster."""

    jobs: Annotated[int | None, option("N", "Number of local processes; default: one per core.", min=1, max=1024)] = (
        None
    )
    cluster: Annotated[str | None, option("ADDRESS", "Address of a Dask scheduler, such as tcp://host:8786.")] = None
    tls_ca: Annotated[Path | None, option("FILE", "CA certificate of the cluster, PEM (tls://).")] = None
    tls_cert: Annotated[Path | None, option("FILE", "Client certificate for the cluster, PEM.")] = None
    tls_key: Annotated[Path | None, option("FILE", "Key of the client certificate, PEM.")] = None

    def read(self) -> tuple[int, tuple[str, Tls] | None]:
        """(processes, (cluster address, certificates) or None); typer.BadParameter for conflicting options."""
        from flockbrush.engine.parallel import cores
        from flockbrush.runs.cluster import Tls

        tls = Tls(self.tls_ca, self.tls_cert, self.tls_key)
        if self.jobs is not None and self.cluster is not None:
            raise wrong("--jobs", "give --jobs or --cluster, not both")
        if self.cluster is None and tls != Tls():
            raise wrong("--tls-ca", "certificates can only be used with --cluster tls://HOST:PORT")
        return self.jobs or cores(), None if self.cluster is None else (self.cluster, tls)


def _default(field):
    """What an option is when it is not given; nothing where it must be."""
    return inspect.Parameter.empty if field.default is MISSING else field.default


def told_by_hand(context: typer.Context) -> frozenset[str]:
    """Names of the parameters that are given on the command line, also with their default value."""
    sources = {name: context.get_parameter_source(name) for name in context.params}
    return frozenset(name for name, source in sources.items() if source is not None and source.name == "COMMANDLINE")


def grouped(command: Callable) -> Callable:
    """The command with each dataclass parameter replaced by options, one for each of its fields."""
    own = inspect.signature(command, eval_str=True)
    options = {
        name: [
            inspect.Parameter(f.name, inspect.Parameter.KEYWORD_ONLY, default=_default(f), annotation=hints[f.name])
            for hints in [get_type_hints(p.annotation, include_extras=True)]
            for f in fields(p.annotation)
        ]
        for name, p in own.parameters.items()
        if is_dataclass(p.annotation)
    }

    @wraps(command)
    def with_options(**given):
        groups = {
            name: own.parameters[name].annotation(**{option.name: given.pop(option.name) for option in group})
            for name, group in options.items()
        }
        return command(**groups, **given)

    parameters = [
        each
        for p in own.parameters.values()
        for each in options.get(p.name, [p.replace(kind=inspect.Parameter.KEYWORD_ONLY)])
    ]
    with_options.__signature__ = own.replace(parameters=parameters)  # type: ignore[attr-defined]
    with_options.__annotations__ = {p.name: p.annotation for p in parameters}
    return with_options

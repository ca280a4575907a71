"""The commands of learning: a clip becomes a brush, and the brush is tried on the clip."""

from __future__ import annotations

import re
import shlex
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from flockbrush.cli.shared_options import TrackOptions, WorkOptions, grouped, unit_of

if TYPE_CHECKING:
    from flockbrush.film.open_clip import Looking

PARTS = ("occlusion", "angular", "density", "variance")
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object instead of a table.")]


@dataclass
class WrittenOptions:
    """Options that can be written as a person would."""

    def words(self) -> dict[str, object]:
        """{option: value} of what is not at its default."""
        asked = {field.name: (getattr(self, field.name), field.default) for field in fields(self)}
        return {
            "--" + name.replace("_", "-"): value for name, (value, usual) in asked.items() if value not in (usual, [])
        }


@dataclass
class ClipOptions(WrittenOptions):
    """How a person wants a clip to be looked at, as it was written: an option each of every command that looks."""

    frames: Annotated[str | None, typer.Option(metavar="A:B", help="Only these frames, both included.")] = None
    landmark: Annotated[
        list[str] | None,
        typer.Option(
            metavar="FRAME:x,y,w,h",
            help="Rectangle in pixels around something that stands still; give it in two frames.",
        ),
    ] = None
    body_colour: Annotated[str, typer.Option(metavar="R,G,B", help="Colour of the animals, or auto.")] = "auto"
    body_length_px: Annotated[
        float | None, typer.Option(min=2, max=2000, metavar="L", help="Length of an animal from nose to tail, pixels.")
    ] = None
    grid: Annotated[int, typer.Option(min=5, max=200, metavar="N", help="Number of cells across the picture.")] = 30
    obstacles: Annotated[
        Path | None,
        typer.Option(metavar="PNG", help="Mask of the first used frame, white where animals cannot go."),
    ] = None

    unit: Annotated[str | None, typer.Option(metavar="m|px|bl", help="Of tracks whose file does not say it.")] = None
    fps: Annotated[
        float | None, typer.Option(min=0.001, max=10_000, metavar="F", help="Frames a second of tracks without times.")
    ] = None
    body_length_m: Annotated[
        float | None,
        typer.Option(
            min=0.001, max=50, metavar="M", help="Length of an animal from nose to tail, metres; 1 unless given."
        ),
    ] = None

    def read(self) -> Looking:
        """The same with everything understood; typer.BadParameter where it cannot be."""
        understood = frames_of(self.frames), landmarks_of(self.landmark), colour_of(self.body_colour)
        from flockbrush.film.open_clip import Looking  # takes a second, which a mistake need not wait for

        return Looking(
            *understood, self.body_length_px, self.grid, self.obstacles, getattr(self, "regions", None),
            unit_of(self.unit), self.fps, self.body_length_m,
        )  # fmt: skip


@dataclass
class LookByRegion(ClipOptions):
    """The same where the ground may be parted."""

    regions: Annotated[
        Path | None,
        typer.Option(metavar="PNG", help="Mask of the first used frame, with a colour for each region."),
    ] = None


@dataclass
class FitOptions(WrittenOptions):
    """How a brush is fitted to a clip."""

    share: Annotated[
        float,
        typer.Option(min=0.1, max=1, metavar="S", help="Share of the frames to learn from; the rest is for the test."),
    ] = 0.5
    speed: Annotated[
        float | None,
        typer.Option(min=0, max=50, metavar="V", help="Speed of the animals of a photograph, body lengths/s."),
    ] = None
    beta: Annotated[
        float, typer.Option(min=0, max=1, metavar="B", help="Weight of density (1) against motion (0) in the loss.")
    ] = 0.5
    seed: Annotated[int, typer.Option(min=0, max=2**31, metavar="K", help="Random seed.")] = 0
    starts: Annotated[int, typer.Option(min=1, max=100, metavar="N", help="Number of random starts of the search.")] = 5
    model: Annotated[
        str,
        typer.Option(
            metavar="NAME",
            help="Model to fit: herd, zones, topological, boids, another on the ground; or auto, which compares them.",
        ),
    ] = "herd"
    ablate: Annotated[
        str | None,
        typer.Option(
            metavar="PARTS",
            help="Learn again without each of these parts, separated by commas: occlusion, angular, density, variance.",
        ),
    ] = None
    licence: Annotated[
        str | None, typer.Option(metavar="TEXT", help="Licence of the clip, kept in the provenance of the brush.")
    ] = None
    resume: Annotated[bool, typer.Option("--resume", help="Continue an interrupted learning.")] = False
    quick: Annotated[bool, typer.Option("--quick", help="Two starts and less time, for a first impression.")] = False
    device: Annotated[
        str,
        typer.Option(
            metavar="NAME", help="Device for learning from fields alone: cpu, cuda, or auto for the best available."
        ),
    ] = "auto"


def register(app: typer.Typer):
    """Add the commands to the program."""
    app.command()(learn)
    app.command()(reenact)
    app.command()(relation)
    app.command("fields")(measure)


# what a person writes --------------------------------------------------------------------


def frames_of(text: str | None) -> tuple[int, int] | None:
    """(first, last) of "A:B"; typer.BadParameter for anything else."""
    if text is None:
        return None
    found = re.fullmatch(r"(\d+):(\d+)", text.strip())
    if not found or int(found[1]) > int(found[2]):
        raise typer.BadParameter(f"frames are FIRST:LAST, such as 0:99, the last not before the first; got {text!r}",
                                 param_hint="--frames")  # fmt: skip
    return int(found[1]), int(found[2])


def landmark_of(text: str) -> tuple[int, tuple[float, float, float, float]]:
    """(frame, (x, y, w, h)) of "FRAME:x,y,w,h"."""
    number = r"\s*(\d+(?:\.\d*)?)\s*"
    found = re.fullmatch(rf"\s*(\d+)\s*:{number},{number},{number},{number}", text)
    if not found or not (float(found[4]) > 0 and float(found[5]) > 0):
        raise typer.BadParameter(
            f"a landmark is FRAME:x,y,w,h in pixels, such as 0:120,80,60,60; got {text!r}", param_hint="--landmark"
        )
    return int(found[1]), (float(found[2]), float(found[3]), float(found[4]), float(found[5]))


def landmarks_of(texts: list[str] | None) -> tuple:
    """All of them, of which there are none or at least two."""
    if texts is not None and len(texts) == 1:
        landmark_of(texts[0])
        raise typer.BadParameter("a landmark is given twice: what stands still, in two frames", param_hint="--landmark")
    return tuple(landmark_of(text) for text in texts or ())


def colour_of(text: str) -> str | tuple[int, int, int]:
    """ "auto", or (red, green, blue)."""
    if text.strip().lower() == "auto":
        return "auto"
    parts = text.split(",")
    if len(parts) != 3 or not all(re.fullmatch(r"\s*\d{1,3}\s*", p) and int(p) <= 255 for p in parts):
        raise typer.BadParameter(
            f"a colour is R,G,B from 0 to 255, such as 240,240,235, or auto; got {text!r}", param_hint="--body-colour"
        )
    red, green, blue = (int(part) for part in parts)
    return red, green, blue


def parts_of(text: str | None) -> tuple[str, ...]:
    """Names of what is left out, in the order given."""
    if not text:
        return ()
    named = [part.strip() for part in text.split(",") if part.strip()]
    for part in named:
        if part not in PARTS:
            from flockbrush.engine.problems import did_you_mean

            raise typer.BadParameter(
                f"there is no part {part!r}{did_you_mean(part, PARTS)}",
                param_hint="--ablate",
            )
    return tuple(dict.fromkeys(named))


def command_line(name: str, arguments, options: dict) -> str:
    """The command that does the same again; what was left at its default is left out."""
    words = ["flockbrush", name, *map(str, arguments)]
    for option, value in options.items():
        for one in value if isinstance(value, list) else [value]:
            if one is True:
                words.append(option)
            elif one is not None and one is not False:
                words += [option, str(one)]
    return shlex.join(words)


# learn -----------------------------------------------------------------------------------


@grouped
def learn(
    clips: Annotated[
        list[Path], typer.Argument(metavar="CLIP", help="Films or tracks of one herd from above, or one photograph.")
    ],
    out: Annotated[Path, typer.Option("-o", "--out", metavar="X.brush.toml", help="Brush file to write.")],
    report: Annotated[Path | None, typer.Option(metavar="DIR", help="Folder for a report with pictures.")] = None,
    look: LookByRegion = LookByRegion(),  # noqa: B008  its fields become the options
    fit: FitOptions = FitOptions(),  # noqa: B008
    work: WorkOptions = WorkOptions(),  # noqa: B008
    json: Json = False,
):
    """Learn a brush from a film of a herd, from tracks of its animals, or from one photograph.

    Each half of the clip is learned from and judged on the other half; then all frames are fitted.
    Ctrl-C keeps the best so far; --resume continues.
    """
    how, without, (jobs, workers) = look.read(), parts_of(fit.ablate), work.read()
    if not re.fullmatch(r"auto|cpu|cuda(:\d+)?", fit.device):
        raise typer.BadParameter(f"it is auto, cpu, cuda or cuda:0; got {fit.device!r}", param_hint="--device")
    options = {"--out": out, **look.words(), **fit.words(), "--seed": fit.seed, "--resume": None, "--report": report}
    from flockbrush.learning.learn import LearnOptions, learn_brushes

    learn_brushes(
        LearnOptions(
            clips=clips, out=out, looking=how, jobs=jobs, workers=workers, report=report, json=json,
            length_m=look.body_length_m or 1.0, command=command_line("learn", clips, options),
            **vars(fit) | {"ablate": without},
        )
    )  # fmt: skip


# reenact -----------------------------------------------------------------------------------


@grouped
def reenact(
    clip: Annotated[Path, typer.Argument(metavar="CLIP", help="A film of a herd from above, or tracks.")],
    brush: Annotated[str, typer.Option(metavar="NAME", help="A brush, or a .brush.toml file.")],
    look: ClipOptions = ClipOptions(),  # noqa: B008  its fields become the options
    runs: Annotated[
        int, typer.Option(min=1, max=100, metavar="N", help="Number of simulations, each with its own random seed.")
    ] = 3,
    seed: Annotated[int, typer.Option(min=0, max=2**31, metavar="K", help="Random seed of the first simulation.")] = 0,
    export: Annotated[Path | None, typer.Option(metavar="F.csv", help="Trajectory to write, frame by frame.")] = None,
    video: Annotated[
        Path | None,
        typer.Option(metavar="F.mp4", help="Video to write: clip left, simulation right, at the same scale."),
    ] = None,
    json: Json = False,
):
    """Start animals as a clip begins, let a brush move them, and compare with the clip frame by frame."""
    from flockbrush.learning.reenact import reenact_clip

    reenact_clip(clip, brush, look.read(), runs, seed, export, video, json)


# relation ----------------------------------------------------------------------------------


@grouped
def relation(
    tracks: Annotated[list[Path], typer.Argument(metavar="TRACKS", help="Recordings of the herd and the danger.")],
    danger: Annotated[str, typer.Option(metavar="ID", help="Which animal of the tracks the others may fear.")],
    leave_out: Annotated[
        list[str] | None, typer.Option(metavar="ID", help="Somebody else, such as a shepherd; may be repeated.")
    ] = None,
    look: TrackOptions = TrackOptions(),  # noqa: B008  its fields become the options
    seed: Annotated[int, typer.Option(min=0, max=2**31, metavar="K", help="Of the bootstrap.")] = 0,
    json: Json = False,
):
    """Learn from how far and how strongly a herd fears one animal of its tracks, such as a dog."""
    from flockbrush.learning.relation import relation_of_files

    relation_of_files(tracks, danger, look.read(), tuple(leave_out or ()), seed, json)


# fields ------------------------------------------------------------------------------------


@grouped
def measure(
    clip: Annotated[Path, typer.Argument(metavar="CLIP", help="A film of a herd from above, or a photograph.")],
    out: Annotated[Path, typer.Option("-o", "--out", metavar="F.npz", help="Fields file to write.")],
    preview: Annotated[
        Path | None, typer.Option(metavar="F.mp4", help="Video to write, with detected bodies, motion and density.")
    ] = None,
    look: LookByRegion = LookByRegion(),  # noqa: B008  its fields become the options
    json: Json = False,
):
    """Measure a herd in a film: density, motion and single animals, without learning anything yet."""
    from flockbrush.cli.field_commands import fields_of_clip

    fields_of_clip(clip, out, look.read(), preview, json)

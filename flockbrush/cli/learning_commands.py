"""The commands ``learn``, ``reenact``, ``relation`` and ``fields``, and their options."""

from __future__ import annotations

import re
import shlex
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Annotated

import typer

from flockbrush.cli.shared_options import (
    Json,
    TrackFps,
    TrackOptions,
    TrackUnit,
    WorkOptions,
    argument,
    grouped,
    option,
    told_by_hand,
    unit_of,
    wrong,
)
from flockbrush.film.looking import LENGTHS_PX, Looking

PARTS = ("occlusion", "angular", "density", "variance")


@dataclass
class WrittenOptions:
    """Options that can be written as a person would."""

    def words(self) -> dict[str, object]:
        """{option: value} of the options that differ from their defaults."""
        values = {field.name: (getattr(self, field.name), field.default) for field in fields(self)}
        return {
            "--" + name.replace("_", "-"): value for name, (value, usual) in values.items() if value not in (usual, [])
        }


@dataclass
class ClipOptions(WrittenOptions):
    """Options of all commands that read a clip, as given on the command line."""

    frames: Annotated[str | None, option("A:B", "First and last frame to use, both included, such as 0:99.")] = None
    landmark: Annotated[
        list[str] | None,
        option("FRAME:x,y,w,h", "Rectangle around something that does not move, pixels; needed in two frames."),
    ] = None
    body_colour: Annotated[str, option("R,G,B", "Colour of the animals, 0 to 255 each; auto: detected.")] = "auto"
    body_length_px: Annotated[
        float | None,
        option(
            "L",
            "Body length of an animal, nose to tail, pixels; default: measured.",
            min=LENGTHS_PX[0],
            max=LENGTHS_PX[1],
        ),
    ] = None
    grid: Annotated[int, option("N", "Number of cells across the width of the picture.", min=5, max=200)] = 30
    obstacles: Annotated[
        Path | None, option("PNG", "Obstacle mask for the first used frame; white: animals cannot go there.")
    ] = None

    unit: TrackUnit = None
    fps: TrackFps = None
    body_length_m: Annotated[
        float | None,
        option("M", "Body length of an animal, nose to tail, m; default: as tracks say, else 1.", min=0.001, max=50),
    ] = None
    arena: Annotated[
        str | None,
        option(
            "SHAPE",
            "Wall around tracked animals: circle or rectangle (the smallest that holds them), circle:X,Y,R or "
            "rectangle:X0,Y0,X1,Y1 in the unit of the tracks.",
        ),
    ] = None

    def read(self) -> Looking:
        """The parsed options; typer.BadParameter for an invalid value."""
        understood = frames_of(self.frames), landmarks_of(self.landmark), colour_of(self.body_colour)
        return Looking(
            *understood, self.body_length_px, self.grid, self.obstacles, getattr(self, "regions", None),
            unit_of(self.unit), self.fps, self.body_length_m, arena_of(self.arena),
        )  # fmt: skip


@dataclass
class LookByRegion(ClipOptions):
    """The options of clips, and a mask of regions."""

    regions: Annotated[Path | None, option("PNG", "Region mask for the first used frame; each colour is a region.")] = (
        None
    )


@dataclass
class FitOptions(WrittenOptions):
    """How a brush is fitted to a clip."""

    share: Annotated[
        float,
        option(
            "S", "Share of the frames of one clip to learn from; the rest is held out for the test.", min=0.1, max=1
        ),
    ] = 0.5
    speed: Annotated[
        float | None, option("V", "Speed of the animals in a photograph, body lengths/s.", min=0, max=50)
    ] = None
    beta: Annotated[
        float,
        option("B", "Weight in the loss when learning from fields alone: 1 density only, 0 motion only.", min=0, max=1),
    ] = 0.5
    seed: Annotated[int, option("K", "Random seed.", min=0, max=2**31)] = 0
    starts: Annotated[
        int,
        option("N", "Number of random starts of the search of the herd model; with --quick at most 2.", min=1, max=100),
    ] = 5
    model: Annotated[
        str,
        option(
            "NAME",
            "Model to learn: herd, zones, morse, force_map, topological, boids or another on the ground; "
            "auto: chosen from the clip.",
        ),
    ] = "auto"
    ablate: Annotated[
        str | None,
        option(
            "PARTS",
            "Also learn without each of these parts, separated by commas: occlusion, angular, density, variance.",
        ),
    ] = None
    licence: Annotated[str | None, option("TEXT", "Licence of the clip, stored in the provenance of the brush.")] = None
    resume: Annotated[bool, option("--resume", "Continue after an interruption.")] = False
    quick: Annotated[bool, option("--quick", "Fast, less exact search: two starts, fewer steps.")] = False
    thorough: Annotated[bool, option("--thorough", "Search with four times as much work.")] = False
    device: Annotated[
        str, option("NAME", "Device for learning from fields alone: cpu, cuda, cuda:0, or auto (the best available).")
    ] = "auto"


# what a person writes --------------------------------------------------------------------


def frames_of(text: str | None) -> tuple[int, int] | None:
    """(first, last) of "A:B"; typer.BadParameter for anything else."""
    if text is None:
        return None
    match = re.fullmatch(r"(\d+):(\d+)", text.strip())
    if not match or int(match[1]) > int(match[2]):
        raise wrong("--frames", f"frames must be FIRST:LAST with FIRST <= LAST, such as 0:99; got {text!r}")
    return int(match[1]), int(match[2])


def arena_of(text: str | None):
    """The `Arena`; typer.BadParameter for what is none."""
    if text is None:
        return None
    from flockbrush.film.arena import Arena  # with OpenCV

    try:
        return Arena.read(text)
    except ValueError as error:
        raise wrong("--arena", str(error)) from None


def landmark_of(text: str) -> tuple[int, tuple[float, float, float, float]]:
    """(frame, (x, y, w, h)) of "FRAME:x,y,w,h"."""
    number = r"\s*(\d+(?:\.\d*)?)\s*"
    match = re.fullmatch(rf"\s*(\d+)\s*:{number},{number},{number},{number}", text)
    if not match or not (float(match[4]) > 0 and float(match[5]) > 0):
        raise wrong("--landmark", f"a landmark must be FRAME:x,y,w,h in pixels, such as 0:120,80,60,60; got {text!r}")
    return int(match[1]), (float(match[2]), float(match[3]), float(match[4]), float(match[5]))


def landmarks_of(texts: list[str] | None) -> tuple:
    """The parsed landmarks; typer.BadParameter if there is only one."""
    if texts is not None and len(texts) == 1:
        landmark_of(texts[0])
        raise wrong(
            "--landmark", "at least two landmarks are needed: rectangles around things that do not move, in two frames"
        )
    return tuple(landmark_of(text) for text in texts or ())


def colour_of(text: str) -> str | tuple[int, int, int]:
    """ "auto", or (red, green, blue) of "R,G,B"; typer.BadParameter for anything else."""
    if text.strip().lower() == "auto":
        return "auto"
    parts = text.split(",")
    if len(parts) != 3 or not all(re.fullmatch(r"\s*\d{1,3}\s*", p) and int(p) <= 255 for p in parts):
        raise wrong("--body-colour", f"must be R,G,B from 0 to 255, such as 240,240,235, or auto; got {text!r}")
    red, green, blue = (int(part) for part in parts)
    return red, green, blue


def parts_of(text: str | None) -> tuple[str, ...]:
    """The names of --ablate, in the order given."""
    if not text:
        return ()
    names = [part.strip() for part in text.split(",") if part.strip()]
    for part in names:
        if part not in PARTS:
            from flockbrush.engine.problems import did_you_mean

            raise wrong("--ablate", f"unknown part {part!r}{did_you_mean(part, PARTS)}")
    return tuple(dict.fromkeys(names))


def command_line(name: str, arguments, options: dict) -> str:
    """The command line that repeats this call; options at their default are left out."""
    words = ["flockbrush", name, *map(str, arguments)]
    for flag, value in options.items():
        for one in value if isinstance(value, list) else [value]:
            if one is True:
                words.append(flag)
            elif one is not None and one is not False:
                words += [flag, str(one)]
    return shlex.join(words)


# learn -----------------------------------------------------------------------------------


@grouped
def learn(
    context: typer.Context,
    clips: Annotated[
        list[Path], argument("CLIP", "Clips (videos or tracks) of one herd from above, or one photograph.")
    ],
    out: Annotated[Path, option("-o", "--out", "X.brush.toml", "Brush file to write.")],
    report: Annotated[Path | None, option("DIR", "Folder for an HTML report with pictures.")] = None,
    look: LookByRegion = LookByRegion(),  # noqa: B008  its fields become the options
    fit: FitOptions = FitOptions(),  # noqa: B008
    work: WorkOptions = WorkOptions(),  # noqa: B008
    json: Json = False,
):
    """Learn a brush from a clip of a herd, from tracks of its animals, or from one photograph.

    The brush is learned from each half of the clip and tested on the other half, then fitted to all frames.
    Ctrl-C writes the best brush so far; --resume continues.
    """
    how, without, (jobs, workers) = look.read(), parts_of(fit.ablate), work.read()
    if not re.fullmatch(r"auto|cpu|cuda(:\d+)?", fit.device):
        raise wrong("--device", f"it is auto, cpu, cuda or cuda:0; got {fit.device!r}")
    options = {"--out": out, **look.words(), **fit.words(), "--seed": fit.seed, "--resume": None, "--report": report}
    from flockbrush.learning.helpers import Helpers

    helpers = Helpers(jobs)
    if all(map(Path.is_file, clips)):  # importing takes as long as looking at some frames
        helpers.begin("flockbrush.learning.learn")
    from flockbrush.learning.learn import LearnOptions, learn_brushes

    learn_brushes(
        LearnOptions(
            clips=clips, out=out, looking=how, jobs=jobs, helpers=helpers, workers=workers, report=report, json=json,
            length_m=look.body_length_m, command=command_line("learn", clips, options),
            told=told_by_hand(context), **vars(fit) | {"ablate": without},
        )
    )  # fmt: skip


# reenact -----------------------------------------------------------------------------------


@grouped
def reenact(
    clip: Annotated[Path, argument("CLIP", "Clip (video or tracks) of a herd from above.")],
    brush: Annotated[str, option("NAME", "Brush: a name or a .brush.toml file.")],
    look: ClipOptions = ClipOptions(),  # noqa: B008  its fields become the options
    runs: Annotated[int, option("N", "Number of simulations, each with its own random seed.", min=1, max=100)] = 3,
    seed: Annotated[int, option("K", "Random seed of the first simulation.", min=0, max=2**31)] = 0,
    export: Annotated[Path | None, option("F.csv", "Trajectory to write, one row per animal and frame.")] = None,
    video: Annotated[
        Path | None, option("F.mp4", "Video to write: clip on the left, simulation on the right, same scale.")
    ] = None,
    json: Json = False,
):
    """Start a simulation from the first frame of a clip and compare it with the clip, frame by frame."""
    from flockbrush.learning.reenact import reenact_clip

    return reenact_clip(clip, brush, look.read(), runs, seed, export, video, json)


# relation ----------------------------------------------------------------------------------


@grouped
def relation(
    tracks: Annotated[list[Path], argument("TRACKS", "Files of tracks of the herd and the danger.")],
    danger: Annotated[str, option("ID", "Id of the animal that the others may fear.")],
    leave_out: Annotated[list[str] | None, option("ID", "Id to ignore, such as a shepherd; may be repeated.")] = None,
    look: TrackOptions = TrackOptions(),  # noqa: B008  its fields become the options
    seed: Annotated[int, option("K", "Random seed of the bootstrap.", min=0, max=2**31)] = 0,
    json: Json = False,
):
    """Measure from tracks at what distance and how strongly a herd reacts to one animal, such as a dog."""
    from flockbrush.learning.relation import relation_of_files

    relation_of_files(tracks, danger, look.read(), tuple(leave_out or ()), seed, json)


# fields ------------------------------------------------------------------------------------


@grouped
def measure_fields(
    clip: Annotated[Path, argument("CLIP", "Clip (video) of a herd from above, or a photograph.")],
    out: Annotated[Path, option("-o", "--out", "F.npz", "Fields file to write.")],
    preview: Annotated[Path | None, option("F.mp4", "Video to write: detected bodies, motion and density.")] = None,
    look: LookByRegion = LookByRegion(),  # noqa: B008  its fields become the options
    json: Json = False,
):
    """Measure density, motion and single animals in a clip of a herd, without learning a brush."""
    from flockbrush.cli.field_commands import fields_of_clip

    fields_of_clip(clip, out, look.read(), preview, json)

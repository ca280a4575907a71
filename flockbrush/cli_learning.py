"""The commands of learning: a clip becomes a brush, and the brush is tried on the clip."""

from __future__ import annotations

import os
import re
import shlex
from pathlib import Path
from typing import Annotated, Any

import typer

PARTS = ("occlusion", "angular", "density", "variance")
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object instead of a table.")]
Frames = Annotated[str | None, typer.Option(metavar="A:B", help="Only these frames, both included.")]
Landmarks = Annotated[
    list[str] | None,
    typer.Option(metavar="FRAME:x,y,w,h", help="Something that stands still, pixels; give it twice."),
]
BodyColour = Annotated[str, typer.Option(metavar="R,G,B", help="Of the animals, or auto.")]
BodyLength = Annotated[
    float | None, typer.Option(min=2, max=2000, metavar="L", help="One animal nose to tail, pixels.")
]
Grid = Annotated[int, typer.Option(min=5, max=200, metavar="N", help="Cells across the picture.")]
Obstacles = Annotated[Path | None, typer.Option(metavar="PNG", help="White where nobody can go.")]


def register(app: typer.Typer):
    """Add the commands to the program."""
    app.command()(learn)
    app.command()(reenact)
    app.command()(fields)


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
            from behaviours.problems import did_you_mean

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


def learn(
    clips: Annotated[
        list[Path], typer.Argument(metavar="CLIP", help="Films of one herd from above, or one photograph.")
    ],
    out: Annotated[Path, typer.Option("-o", "--out", metavar="X.brush.toml", help="Where the brush goes.")],
    report: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Write a page with pictures that tells how good it is.")
    ] = None,
    frames: Frames = None,
    landmark: Landmarks = None,
    body_colour: BodyColour = "auto",
    body_length_px: BodyLength = None,
    body_length_m: Annotated[
        float, typer.Option(min=0.001, max=50, metavar="M", help="The same in metres: a film does not tell.")
    ] = 1.0,
    grid: Grid = 30,
    obstacles: Obstacles = None,
    regions: Annotated[
        Path | None, typer.Option(metavar="PNG", help="A colour for each region; each gets a brush of its own.")
    ] = None,
    share: Annotated[
        float, typer.Option(min=0.1, max=1, metavar="S", help="Of the frames that are learned from; the rest tests.")
    ] = 0.5,
    speed: Annotated[
        float | None, typer.Option(min=0, max=50, metavar="V", help="Of a photograph's animals, body lengths/s.")
    ] = None,
    beta: Annotated[
        float, typer.Option(min=0, max=1, metavar="B", help="Between motion (0) and density (1) as what is matched.")
    ] = 0.5,
    seed: Annotated[int, typer.Option(min=0, max=2**31, metavar="K", help="Of chance.")] = 0,
    starts: Annotated[int, typer.Option(min=1, max=100, metavar="N", help="Random starts of the search.")] = 5,
    jobs: Annotated[
        int | None, typer.Option(min=1, max=256, metavar="N", help="Processes; one for each core unless told.")
    ] = None,
    ablate: Annotated[
        str | None,
        typer.Option(metavar="PARTS", help="Learn again without each of these: occlusion,angular,density,variance."),
    ] = None,
    licence: Annotated[str | None, typer.Option(metavar="TEXT", help="Of the clip, for the brush's papers.")] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Go on where an interrupted learning stopped.")] = False,
    quick: Annotated[bool, typer.Option("--quick", help="Two starts and little time: a first impression.")] = False,
    json: Json = False,
):
    """Learn a brush from a film of a herd, or from one photograph.

    The first half of the clip is learned from, the second tests what was learned.
    Ctrl-C keeps the best so far; --resume goes on.
    """
    looking: dict[str, Any] = {
        "frames": frames_of(frames),
        "landmarks": landmarks_of(landmark),
        "body_colour": colour_of(body_colour),
        "body_length_px": body_length_px,
        "grid": grid,
        "obstacles": obstacles,
        "regions": regions,
    }
    without = parts_of(ablate)
    options = {
        "--out": out, "--frames": frames, "--landmark": landmark, "--body-length-px": body_length_px,
        "--body-colour": body_colour if body_colour != "auto" else None,
        "--body-length-m": body_length_m if body_length_m != 1 else None, "--grid": grid if grid != 30 else None,
        "--obstacles": obstacles, "--regions": regions, "--share": share if share != 0.5 else None, "--speed": speed,
        "--beta": beta if beta != 0.5 else None, "--seed": seed, "--starts": starts if starts != 5 else None,
        "--ablate": ablate, "--licence": licence, "--quick": quick, "--report": report,
    }  # fmt: skip
    from flockbrush.learn.clips import Looking, needs_torch

    needs_torch()
    from flockbrush.learn.learn import Wishes, learn_brushes

    learn_brushes(
        Wishes(
            clips=clips, out=out, looking=Looking(**looking), beta=beta, seed=seed, starts=starts,
            jobs=jobs or os.cpu_count() or 1, share=share, report=report, ablate=without, speed=speed,
            length_m=body_length_m, licence=licence, resume=resume, quick=quick, json=json,
            command=command_line("learn", clips, options),
        )
    )  # fmt: skip


# reenact -----------------------------------------------------------------------------------


def reenact(
    clip: Annotated[Path, typer.Argument(metavar="CLIP", help="A film of a herd from above.")],
    brush: Annotated[str, typer.Option(metavar="NAME", help="A brush, or a .brush.toml file.")],
    frames: Frames = None,
    landmark: Landmarks = None,
    body_colour: BodyColour = "auto",
    body_length_px: BodyLength = None,
    grid: Grid = 30,
    obstacles: Obstacles = None,
    runs: Annotated[int, typer.Option(min=1, max=100, metavar="N", help="Simulations with different chance.")] = 3,
    seed: Annotated[int, typer.Option(min=0, max=2**31, metavar="K", help="Of the first.")] = 0,
    export: Annotated[
        Path | None, typer.Option(metavar="F.csv", help="Where the simulated animals were, frame by frame.")
    ] = None,
    video: Annotated[
        Path | None, typer.Option(metavar="F.mp4", help="Clip left, simulation right, at the same scale.")
    ] = None,
    json: Json = False,
):
    """Start animals as a clip begins, let a brush move them, and compare with the clip frame by frame."""
    from flockbrush.learn.clips import Looking
    from flockbrush.learn.reenact import reenact_clip

    looking = Looking(
        frames_of(frames), landmarks_of(landmark), colour_of(body_colour),
        body_length_px, grid, obstacles,
    )  # fmt: skip
    reenact_clip(clip, brush, looking, runs, seed, export, video, json)


# fields ------------------------------------------------------------------------------------


def fields(
    clip: Annotated[Path, typer.Argument(metavar="CLIP", help="A film of a herd from above, or a photograph.")],
    out: Annotated[Path, typer.Option("-o", "--out", metavar="F.npz", help="Where the fields go.")],
    preview: Annotated[
        Path | None, typer.Option(metavar="F.mp4", help="A film of what was seen: bodies, motion, density.")
    ] = None,
    frames: Frames = None,
    landmark: Landmarks = None,
    body_colour: BodyColour = "auto",
    body_length_px: BodyLength = None,
    grid: Grid = 30,
    obstacles: Obstacles = None,
    regions: Annotated[Path | None, typer.Option(metavar="PNG", help="A colour for each region.")] = None,
    json: Json = False,
):
    """Measure a herd in a film: density, motion and single animals, without learning anything yet."""
    from flockbrush.fields import fields_of_clip

    fields_of_clip(
        clip, out, preview, json, frames=frames_of(frames),
        landmarks=landmarks_of(landmark), body_colour=colour_of(body_colour),
        body_length_px=body_length_px, grid=grid, obstacles=obstacles, regions=regions,
    )  # fmt: skip

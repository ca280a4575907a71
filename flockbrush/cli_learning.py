"""The commands of learning: a clip becomes a brush, and the brush is tried on the clip."""

from __future__ import annotations

import inspect
import os
import re
import shlex
from collections.abc import Callable
from dataclasses import dataclass, fields
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, get_type_hints

import typer

if TYPE_CHECKING:
    from flockbrush.learn.clips import Looking

PARTS = ("occlusion", "angular", "density", "variance")
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object instead of a table.")]


@dataclass
class Look:
    """How a person wants a clip to be looked at, as it was written: an option each of every command that looks."""

    frames: Annotated[str | None, typer.Option(metavar="A:B", help="Only these frames, both included.")] = None
    landmark: Annotated[
        list[str] | None,
        typer.Option(metavar="FRAME:x,y,w,h", help="Something that stands still, pixels; give it twice."),
    ] = None
    body_colour: Annotated[str, typer.Option(metavar="R,G,B", help="Of the animals, or auto.")] = "auto"
    body_length_px: Annotated[
        float | None, typer.Option(min=2, max=2000, metavar="L", help="One animal nose to tail, pixels.")
    ] = None
    grid: Annotated[int, typer.Option(min=5, max=200, metavar="N", help="Cells across the picture.")] = 30
    obstacles: Annotated[Path | None, typer.Option(metavar="PNG", help="White where nobody can go.")] = None

    def read(self) -> Looking:
        """The same with everything understood; typer.BadParameter where it cannot be."""
        understood = frames_of(self.frames), landmarks_of(self.landmark), colour_of(self.body_colour)
        from flockbrush.learn.clips import Looking  # takes a second, which a mistake need not wait for

        return Looking(*understood, self.body_length_px, self.grid, self.obstacles, getattr(self, "regions", None))

    def words(self) -> dict[str, object]:
        """{option: value} of what is not at its default."""
        asked = {field.name: (getattr(self, field.name), field.default) for field in fields(self)}
        return {
            "--" + name.replace("_", "-"): value for name, (value, usual) in asked.items() if value not in (usual, [])
        }


@dataclass
class LookByRegion(Look):
    """The same where the ground may be parted."""

    regions: Annotated[
        Path | None, typer.Option(metavar="PNG", help="A colour for each region; `learn` makes a brush of each.")
    ] = None


def looking(command: Callable) -> Callable:
    """The command with the options of its parameter ``look`` in that one's place."""
    own = inspect.signature(command, eval_str=True)
    kind = own.parameters["look"].annotation
    hints = get_type_hints(kind, include_extras=True)
    options = [
        inspect.Parameter(f.name, inspect.Parameter.KEYWORD_ONLY, default=f.default, annotation=hints[f.name])
        for f in fields(kind)
    ]

    @wraps(command)
    def with_options(**given):
        return command(look=kind(**{option.name: given.pop(option.name) for option in options}), **given)

    parameters = [
        each
        for p in own.parameters.values()
        for each in (options if p.name == "look" else [p.replace(kind=inspect.Parameter.KEYWORD_ONLY)])
    ]
    with_options.__signature__ = own.replace(parameters=parameters)  # type: ignore[attr-defined]
    with_options.__annotations__ = {p.name: p.annotation for p in parameters}
    return with_options


def register(app: typer.Typer):
    """Add the commands to the program."""
    app.command()(learn)
    app.command()(reenact)
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


@looking
def learn(
    clips: Annotated[
        list[Path], typer.Argument(metavar="CLIP", help="Films of one herd from above, or one photograph.")
    ],
    out: Annotated[Path, typer.Option("-o", "--out", metavar="X.brush.toml", help="Where the brush goes.")],
    report: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Write a page with pictures that tells how good it is.")
    ] = None,
    look: LookByRegion = LookByRegion(),  # noqa: B008  its fields become the options
    body_length_m: Annotated[
        float, typer.Option(min=0.001, max=50, metavar="M", help="Nose to tail in metres: a film does not tell.")
    ] = 1.0,
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
        typer.Option(
            metavar="PARTS",
            help="Learn again without each, commas between: occlusion angular density variance.",
        ),
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
    how, without = look.read(), parts_of(ablate)
    options = {
        "--out": out, **look.words(), "--body-length-m": body_length_m if body_length_m != 1 else None,
        "--share": share if share != 0.5 else None, "--speed": speed,
        "--beta": beta if beta != 0.5 else None, "--seed": seed, "--starts": starts if starts != 5 else None,
        "--ablate": ablate, "--licence": licence, "--quick": quick, "--report": report,
    }  # fmt: skip
    from flockbrush.learn.clips import needs_torch

    needs_torch()
    from flockbrush.learn.learn import Wishes, learn_brushes

    learn_brushes(
        Wishes(
            clips=clips, out=out, looking=how, beta=beta, seed=seed, starts=starts,
            jobs=jobs or os.cpu_count() or 1, share=share, report=report, ablate=without, speed=speed,
            length_m=body_length_m, licence=licence, resume=resume, quick=quick, json=json,
            command=command_line("learn", clips, options),
        )
    )  # fmt: skip


# reenact -----------------------------------------------------------------------------------


@looking
def reenact(
    clip: Annotated[Path, typer.Argument(metavar="CLIP", help="A film of a herd from above.")],
    brush: Annotated[str, typer.Option(metavar="NAME", help="A brush, or a .brush.toml file.")],
    look: Look = Look(),  # noqa: B008  its fields become the options
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
    from flockbrush.learn.reenact import reenact_clip

    reenact_clip(clip, brush, look.read(), runs, seed, export, video, json)


# fields ------------------------------------------------------------------------------------


@looking
def measure(
    clip: Annotated[Path, typer.Argument(metavar="CLIP", help="A film of a herd from above, or a photograph.")],
    out: Annotated[Path, typer.Option("-o", "--out", metavar="F.npz", help="Where the fields go.")],
    preview: Annotated[
        Path | None, typer.Option(metavar="F.mp4", help="A film of what was seen: bodies, motion, density.")
    ] = None,
    look: LookByRegion = LookByRegion(),  # noqa: B008  its fields become the options
    json: Json = False,
):
    """Measure a herd in a film: density, motion and single animals, without learning anything yet."""
    from flockbrush.fields import fields_of_clip

    fields_of_clip(clip, out, look.read(), preview, json)

"""The file with the marks of a film, ``NAME.marks.toml``: what it may say, read and checked."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

from flockbrush.behaviours.file_library import check_schema
from flockbrush.behaviours.tomlfile import parse_toml, read_bytes
from flockbrush.behaviours.validation import validated
from flockbrush.engine import limits
from flockbrush.engine.problems import ProblemsError
from flockbrush.film.flight_sketch import USUAL
from flockbrush.film.landmarks import MOST
from flockbrush.film.looking import LENGTHS_PX

SCHEMA = "flockbrush.marks/1"
SKETCHED = 100_000  # frames of a sketch, unless the film is longer

Byte = Annotated[int, Field(ge=0, le=255)]
Frame = Annotated[int, Field(ge=0)]


class MarkedRectangle(BaseModel):
    """A landmark."""

    model_config = ConfigDict(frozen=True)

    frame: Frame = Field(description="frame in which it was drawn")
    box: tuple[float, float, float, float] = Field(description="x, y, width, height, pixels")


class MarkedPath(BaseModel):
    """What was sketched for one bird."""

    model_config = ConfigDict(frozen=True)

    bird: int = Field(description="number of the bird")
    points: tuple[tuple[float, float, float], ...] = Field(min_length=2, description="x, y, pixels, and seconds")


class FilmMarks(BaseModel):
    """All that a file of marks may say."""

    model_config = ConfigDict(frozen=True)

    clip: str | None = Field(None, description="name of the film")
    first: Frame | None = Field(None, description="first frame that is used")
    last: Frame | None = Field(None, description="last frame that is used")
    body_colour: tuple[Byte, Byte, Byte] | None = Field(None, description="red, green, blue")
    body_length_px: float | None = Field(None, ge=LENGTHS_PX[0], le=LENGTHS_PX[1], description="pixels")
    pending: Frame | None = Field(None, description="corrected frame from which tracking has not continued yet")
    sketch_frames: int | None = Field(None, ge=1, description="frames of the sketch")
    sketch_even: bool = Field(True, description="whether birds fly at even speed")
    sketch_smooth: float = Field(USUAL, ge=0, le=1, description="smoothness of paths")
    landmark: tuple[MarkedRectangle, ...] = Field((), max_length=MOST, description="landmarks")
    path: tuple[MarkedPath, ...] = Field((), description="sketched paths")


def read_film_marks(path, film) -> FilmMarks:
    """The marks of a film.

    Raises
    ------
    ProblemsError
        With file, line and name of every value that makes no sense for this film.
    """
    file = parse_toml(read_bytes(path, limits.MARKED_FILM_BYTES), str(path), limits.MARKED_FILM_BYTES)
    data = check_schema(file, SCHEMA, needed=False)
    if data.get("clip", film.name) != film.name:
        message = f"has marks of {data['clip']!r}, not of {film.name!r}; choose another folder with --out"
        raise ProblemsError([file.problem(("clip",), message)])
    marks, mistakes = validated(FilmMarks, data)
    if marks is not None:
        mistakes += _unlike(marks, film)
    if marks is None or mistakes:
        raise ProblemsError([file.problem(key, message) for key, message in mistakes])
    return marks


def _unlike(marks, film):
    """(key, message) of what a film with so many frames of this size does not have."""
    frames, (wide, high) = len(film), film.size
    named = [((name,), getattr(marks, name)) for name in ("first", "last", "pending")]
    named += [(("landmark", k, "frame"), row.frame) for k, row in enumerate(marks.landmark)]
    for key, frame in named:
        if frame is not None and frame >= frames:
            yield key, f"has marks in frame {frame}, but {film.name} ends at frame {frames - 1}; is it of another clip?"
    if marks.first is not None and marks.last is not None and marks.first > marks.last:
        yield ("first",), f"must not be after last, {marks.last}, got {marks.first}"
    for k, (x, y, w, h) in enumerate(row.box for row in marks.landmark):
        if x < 0 or y < 0 or w < 1 or h < 1 or x + w > wide or y + h > high:
            yield (
                ("landmark", k, "box"),
                f"must be a rectangle x, y, width, height inside the picture of {wide} x {high} pixels, got "
                f"{x:g}, {y:g}, {w:g}, {h:g}",
            )
    if marks.sketch_frames is not None and marks.sketch_frames > max(SKETCHED, frames):
        yield ("sketch_frames",), f"must be at most {max(SKETCHED, frames)}, got {marks.sketch_frames}"
    birds = [row.bird for row in marks.path]
    for k, bird in enumerate(birds):
        if bird in birds[:k]:
            yield ("path", k, "bird"), f"bird {bird} has another path before"

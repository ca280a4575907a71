"""All that a person marks in a film: one state, one list of steps to undo, and the files it goes into."""

from __future__ import annotations

import shlex
import shutil
from dataclasses import dataclass, replace
from itertools import count
from pathlib import Path
from typing import NamedTuple

import numpy as np

from flockbrush.behaviours.brush import SUFFIX, name_like
from flockbrush.engine.files import refused, write_text
from flockbrush.film.bird_marks import Birds
from flockbrush.film.clip_layers import MaskLayer, read_obstacles, read_regions, write_obstacles, write_regions
from flockbrush.film.flight_sketch import FlightSketch
from flockbrush.film.flight_sketch import Path as Drawn
from flockbrush.film.landmarks import Landmark, between
from flockbrush.film.marks_file import SCHEMA, read_film_marks
from flockbrush.film.track_clip import table_of
from flockbrush.film.track_table import unevenness
from flockbrush.film.tracks import read_marks, read_tracks
from flockbrush.levels.steps import StateStack

UNDONE = 100  # steps that can be taken back


@dataclass(frozen=True)
class ClipMarks:
    """What `flockbrush learn` takes as options."""

    landmarks: tuple[Landmark, ...] = ()
    # (int, int, int), optional; red, green, blue; found by the command unless given
    body_colour: tuple[int, int, int] | None = None
    body_length: float | None = None  # pixels
    # first, last: the frames that are used, both included
    first: int | None = None
    last: int | None = None


class ClipState(NamedTuple):
    """Everything at one moment; none of it is ever changed, only replaced."""

    marks: ClipMarks
    obstacles: MaskLayer
    regions: MaskLayer
    birds: Birds
    sketch: FlightSketch


class Book(StateStack):
    """The marks of one film.

    Parameters
    ----------
    film : Film or Sky
    folder : path
        Where files go: ``NAME.marks.toml``, ``NAME.obstacles.png``, ``NAME.regions.png``, ``NAME.tracks.csv``,
        ``NAME.corrections.csv`` and ``NAME.sketch.csv``, with the name of the film.
    """

    def __init__(self, film, folder):
        empty = MaskLayer.empty(film.size)
        state = ClipState(ClipMarks(), empty, empty, Birds.none(len(film)), FlightSketch(frames=len(film)))
        super().__init__(state, UNDONE)
        self.film, self.folder = film, Path(folder)
        self.stem = Path(film.name).stem
        self.followed: dict[Landmark, np.ndarray] = {}  # (F, 4) x, y, w, h of landmarks that were followed
        self._ours: set[Path] = set()  # files that were read or written here

    # doing --------------------------------------------------------------------------------

    def do(self, label, mode, frame, **changes):
        """Take a step: parts of the state, by their names, are replaced."""
        if all(getattr(self.state, part) is value for part, value in changes.items()):
            return
        self.replace(label, (mode, frame), self.state._replace(**changes))

    def mark(self, label, mode, frame, **changes):
        """Take a step that changes something of the marks."""
        self.do(label, mode, frame, marks=replace(self.state.marks, **changes))

    # what it is for -------------------------------------------------------------------------

    def place(self, part) -> Path:
        """Where a part is saved: "marks.toml", "obstacles.png", "tracks.csv", ..."""
        return self.folder / f"{self.stem}.{part}"

    def learn_line(self, state=None) -> str:
        """The command that learns from this film with all that was marked, now or in another state."""
        state = self.state if state is None else state
        marks, words = state.marks, ["flockbrush", "learn", str(self.film.path or self.film.name)]
        words += ["--out", name_like(self.stem) + SUFFIX]
        if marks.first is not None or marks.last is not None:
            used = self._used(marks)
            words += ["--frames", f"{used[0]}:{used[-1]}"]
        for landmark in marks.landmarks if len(marks.landmarks) > 1 else ():  # one alone holds nothing still
            words += ["--landmark", self._in_used_frames(landmark, marks).argument]
        if marks.body_colour is not None:
            words += ["--body-colour", ",".join(map(str, marks.body_colour))]
        if marks.body_length is not None:
            words += ["--body-length-px", f"{marks.body_length:.1f}"]
        for part, layer in (("obstacles", state.obstacles), ("regions", state.regions)):
            if not layer.blank:
                words += [f"--{part}", str(self.place(f"{part}.png"))]
        return shlex.join(words)

    def _used(self, marks) -> range:
        """The frames that are used."""
        return range(marks.first or 0, len(self.film) if marks.last is None else marks.last + 1)

    def _in_used_frames(self, landmark, marks):
        """A landmark as it is in the nearest used frame in which it was found; itself if in none."""
        used = self._used(marks)
        if landmark in self.followed and landmark.frame not in used:
            for k in sorted(used, key=lambda k: abs(k - landmark.frame)):
                x, y, w, h = self.followed[landmark][k]
                carried = between(k, (x, y), (x + w, y + h), self.film.size) if np.isfinite(x) else None
                if carried is not None:
                    return carried
        return landmark

    def unused_landmarks(self) -> list[Landmark]:
        """Landmarks that `flockbrush learn` refuses, since they are in no used frame."""
        marks = self.state.marks
        found = (self._in_used_frames(landmark, marks) for landmark in marks.landmarks)
        return [landmark for landmark in found if landmark.frame not in self._used(marks)]

    @property
    def learns(self) -> bool:
        """Whether what was saved is for `flockbrush learn`, and not only for lifting."""
        marks, obstacles, regions, birds, sketch = self.saved
        masks = not (obstacles.blank and regions.blank)
        return masks or marks != ClipMarks() or not (birds.ids or sketch.paths)

    def lift_lines(self, camera=None) -> list[str]:
        """The commands that lift the birds and the sketch that were saved; none without a camera."""
        camera = self.place("camera.toml") if camera is None else Path(camera)
        if not camera.is_file():
            return []
        saved = [part for part in ("tracks", "sketch") if self.place(f"{part}.csv").is_file()]
        lines = []
        for k, part in enumerate(saved):
            out = self.place("sketch-flock.csv" if k else "flock.csv")
            words = [self.place(f"{part}.csv"), "--camera", camera, "--out", out]
            lines.append(shlex.join(["flockbrush", "lift", *map(str, words)]))
        return lines

    # files ------------------------------------------------------------------------------------

    def go_to(self, folder):
        """Save into another folder from now on."""
        self.folder = Path(folder)

    def save(self) -> list[Path]:
        """Write everything there is, each file whole or not at all; which files.

        A file that was there before and is not ours is kept beside as ``.bak``, ``.bak1`` and so on.

        Raises
        ------
        ProblemsError, OSError
        """
        state, written = self.state, []
        self.folder.mkdir(parents=True, exist_ok=True)
        sketched = bool(state.sketch.paths)
        for part, there, write in (
            ("obstacles.png", not state.obstacles.blank, lambda path: write_obstacles(path, state.obstacles)),
            ("regions.png", not state.regions.blank, lambda path: write_regions(path, state.regions)),
            ("tracks.csv", bool(state.birds.ids), lambda path: write_text(path, table_of(self._tracks(state)))),
            ("corrections.csv", bool(state.birds.corrections), self._write_corrections),
            ("sketch.csv", sketched, lambda path: write_text(path, table_of(state.sketch.tracks))),
            ("marks.toml", True, lambda path: write_text(path, self.text())),
        ):
            path = self.place(part)
            if there:
                self._spare(path)
                write(path)
                self._ours.add(path)
                written.append(path)
            elif path in self._ours:
                path.unlink(missing_ok=True)
        self.saved = state
        return written

    def save_unfinished(self) -> list[Path]:
        """Write everything there is when the program is interrupted; which files, none if there is nothing to keep.

        Raises
        ------
        ProblemsError, OSError
        """
        return self.save()

    def _tracks(self, state):
        """The birds as tracks, with the times of their frames where these are not evenly spaced."""
        tracks, times = state.birds.tracks(), self.film.times
        own = times[tracks.first :][: len(tracks.px)] if unevenness(times) else None
        return replace(tracks, times=own)

    def _write_corrections(self, path):
        write_text(path, self.state.birds.corrections_text())

    def _spare(self, path):
        if path not in self._ours and path.exists():
            places = (path.with_name(f"{path.name}.bak{k or ''}") for k in count())
            shutil.copy2(path, next(place for place in places if not place.exists()))

    def text(self) -> str:
        """The marks as TOML."""
        marks, sketch = self.state.marks, self.state.sketch
        quoted = self.film.name.replace("\\", "\\\\").replace('"', '\\"')
        lines = ["# marks of a clip, made with flockbrush play --clip", f"# {self.learn_line()}"]
        lines += [f'schema = "{SCHEMA}"', f'clip = "{quoted}"']
        lines += [
            f"{name} = {value}" for name, value in (("first", marks.first), ("last", marks.last)) if value is not None
        ]
        if marks.body_colour is not None:
            lines.append(f"body_colour = {list(marks.body_colour)}  # red, green, blue")
        if marks.body_length is not None:
            lines.append(f"body_length_px = {marks.body_length:.2f}")
        if self.state.birds.pending is not None:
            lines.append(
                f"pending = {self.state.birds.pending}  # corrected frame from which tracking has not continued yet"
            )
        lines += [f"sketch_frames = {sketch.frames}", f"sketch_even = {str(sketch.even).lower()}"]
        lines.append(f"sketch_smooth = {sketch.smooth:.3f}")
        for landmark in marks.landmarks:
            box = ", ".join(f"{part:g}" for part in landmark[1:])
            lines += ["", "[[landmark]]", f"frame = {landmark.frame}", f"box = [{box}]  # x, y, width, height, pixels"]
        for path in sketch.paths:
            points = ", ".join(f"[{x:.1f}, {y:.1f}, {t:.3f}]" for x, y, t in path.points)
            lines += ["", "[[path]]", f"bird = {path.bird}", f"points = [{points}]  # x, y, pixels, and seconds"]
        return "\n".join(lines) + "\n"

    def load(self, tracks=None, say=lambda text: None):
        """Take up what was saved before, and tracks from a file if none were saved.

        Raises
        ------
        ProblemsError
            With file and line of what is wrong; where tracks are given and others were saved; where what was saved is
            of another film.
        """
        state, place = self.state, self.place("tracks.csv")
        if tracks is not None and place.is_file() and Path(tracks).is_file():
            if not place.samefile(tracks):
                raise refused(
                    tracks,
                    f"tracks of this film were saved in {place} before: leave out --tracks to go on with these, or "
                    "choose another folder with --out to begin with others",
                )
            tracks = None
        birds = self._birds(tracks)
        marks, sketch, pending = state.marks, state.sketch, None
        path = self.place("marks.toml")
        if path.is_file():
            self._ours.add(path)
            marks, sketch, pending = self._read(path)
        layers = {}
        for part, read in (("obstacles", read_obstacles), ("regions", read_regions)):
            path = self.place(f"{part}.png")
            if path.is_file():
                self._ours.add(path)
                layers[part] = read(path, self.film.size)
        birds = replace(birds, pending=pending if birds.ids and tracks is None else None)
        if sketch.paths:  # its tracks are written anew from them
            self._ours.add(self.place("sketch.csv"))
        self.state = ClipState(
            marks, layers.get("obstacles", state.obstacles), layers.get("regions", state.regions), birds, sketch
        )
        self.saved = self.state

    def _birds(self, tracks):
        """The birds of a file, or those saved before."""
        place, corrections = self.place("tracks.csv"), self.place("corrections.csv")
        path = Path(tracks) if tracks is not None else place if place.is_file() else None
        birds = self.state.birds
        if path is not None:
            trajectories = read_tracks(path, least=1)
            if trajectories.first + len(trajectories.px) > len(self.film) or trajectories.first < 0:
                last = trajectories.first + len(trajectories.px) - 1
                raise refused(
                    path, f"has frames {trajectories.first} to {last}; the clip has frames 0 to {len(self.film) - 1}"
                )
            self._in_picture(path, trajectories)
            birds = Birds.of(trajectories, len(self.film))
            self._ours.add(path)
        if tracks is None and corrections.is_file():
            birds = birds.with_corrections(read_marks(corrections))
            self._ours.add(corrections)
        return birds

    def _in_picture(self, path, tracks):
        """ProblemsError where most sights of a bird are outside the picture: they are of another film."""
        size, seen = np.array(self.film.size), tracks.seen
        away = ((tracks.px < 0) | (tracks.px > size)).any(-1) & seen
        if away.sum() > 0.5 * seen.sum():
            row, bird = np.argwhere(away)[0]
            x, y = tracks.px[row, bird]
            raise refused(
                path,
                f"frame {tracks.first + row}: bird {tracks.ids[bird]} is at {x:.0f}, {y:.0f}, outside the picture of "
                f"{size[0]} x {size[1]} pixels, as most birds are; are these tracks of another film?",
            )

    def _read(self, path):
        """(Marks, Sketch, frame that is pending) of a file that was saved before."""
        read = read_film_marks(path, self.film)
        landmarks = tuple(Landmark(row.frame, *row.box) for row in read.landmark)
        marks = ClipMarks(landmarks, read.body_colour, read.body_length_px, read.first, read.last)
        paths = tuple(Drawn(row.bird, row.points) for row in read.path)
        frames = read.sketch_frames or len(self.film)
        return marks, FlightSketch(paths, frames, read.sketch_even, read.sketch_smooth), read.pending

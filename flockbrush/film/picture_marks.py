"""Birds marked in pictures: the pictures as a film, the formation that is seen in them, and the file with the marks."""

from __future__ import annotations

import csv
import io
import shlex
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np

from flockbrush.behaviours.formation.curves import ALL_UP_TO
from flockbrush.behaviours.formation.extraction import extract_frame
from flockbrush.behaviours.formation.marked_birds import HEADINGS, guess_heading, read_marks
from flockbrush.engine.files import refused, write_text
from flockbrush.engine.problems import ProblemsError
from flockbrush.film.bird_marks import Birds, PictureFollower
from flockbrush.film.birds_in_sky import find_birds, is_found, read_pictures
from flockbrush.film.clip_document import Book
from flockbrush.film.clip_frames import TimedFrames

UNKNOWN_SPAN = 1 / 30  # of the picture's shorter side, where no bird was found
QUALITY = 93  # of the pictures that are kept
GUESSING = 40  # birds: with more the heading is guessed from some of them
SAMPLES = 4000  # of larger flocks
COLUMNS = ("frame", "bird", "x_px", "y_px", "wingspan_px", "by")


class PictureFilm(TimedFrames):
    """Pictures, and frames of clips, as a film, with the birds that are found in them.

    Attributes
    ----------
    found : list of list of Patch
    size : (int, int)
        Width and height of the largest, pixels.
    wingspan : float
        Pixels; the median of what was found.
    """

    fps = 1.0

    def __init__(self, paths, every=1, say=lambda done: None):
        self.path = Path(paths[0])
        self.name, self.names, self.found = self.path.name, [], []
        self._packed, sizes, times = [], [], {}
        for name, image in read_pictures(paths, every):
            times[name] = times.get(name, 0) + 1
            self.names.append(name if times[name] == 1 else f"{name} ({times[name]})")
            self._packed.append(cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])[1])
            sizes.append(image.shape[1::-1])
            self.found.append(find_birds(image))
            say(len(self.names))
        self.times = np.arange(len(self.names)) / self.fps
        self.size = tuple(map(max, zip(*sizes, strict=True)))
        spans = [patch.span for patches in self.found for patch in patches]
        self.wingspan = float(np.median(spans)) if spans else UNKNOWN_SPAN * min(self.size)

    def frame(self, k) -> np.ndarray:
        """Blue, green and red of a picture, (h, w, 3) uint8."""
        return cv2.imdecode(self._packed[k], cv2.IMREAD_COLOR)  # type: ignore[return-value]

    def caption(self, k) -> str:
        """Which picture it is."""
        return f"{k + 1} of {len(self)}   {self.names[k]}"


class MarkedShape(NamedTuple):
    """The formation of a picture, in pixels."""

    kind: str
    why: str
    curve: np.ndarray  # (k, 2), empty where there is none
    leader: int | None  # bird
    outliers: frozenset
    heading: float  # degrees counter-clockwise from the right


class PictureBook(Book):
    """The birds of pictures; what a person corrects is followed on at once, up to the next picture with corrections.

    Parameters
    ----------
    film : PictureFilm
    out : path
        Where the marks are saved; marks that are there are loaded.

    Raises
    ------
    ProblemsError
        When the marks cannot be read, or are not of these pictures.
    """

    def __init__(self, film, out):
        self.out, self.wingspan = Path(out), film.wingspan
        super().__init__(film, self.out.parent)
        self._follower, self._shapes = PictureFollower(film), {}
        birds = self._read_birds() if self.out.exists() else self._follower.follow(self.state.birds, 0)
        self.state = self.saved = self.state._replace(birds=birds)

    def do(self, label, mode, frame, **changes):
        birds = changes.get("birds")
        if birds is not None:
            changes["birds"] = self._followed(birds)
        super().do(label, mode, frame, **changes)

    def _followed(self, birds):
        if birds.pending is None:
            return birds
        return replace(self._follower.follow(birds, birds.pending + 1), pending=None)

    # the formation --------------------------------------------------------------------------

    def shape(self, birds, heading="auto") -> MarkedShape | None:
        """The formation of birds at places in a picture, {bird: (x, y)}; None without birds."""
        if not birds:
            return None
        key = (heading, tuple(birds.items()))
        if key not in self._shapes:
            if len(self._shapes) > 500:
                self._shapes.clear()
            self._shapes[key] = self._extracted(birds, heading)
        return self._shapes[key]

    def _extracted(self, birds, heading):
        span = self.wingspan
        xy = np.array([(x, -y) for x, y in birds.values()]) / span
        turn = self._turn(xy, heading)
        c, s = np.cos(np.radians(turn)), np.sin(np.radians(turn))
        x, y = xy[:, 0] * s - xy[:, 1] * c, xy[:, 0] * c + xy[:, 1] * s
        names = [str(bird) for bird in birds]
        frame = extract_frame(x, y, "0", names, SAMPLES if len(x) > ALL_UP_TO else None)
        leader = int(frame.birds[frame.leader])
        curve = np.zeros((0, 2))
        if frame.curve is not None:
            near = np.delete(frame.x, np.array(frame.outliers, int))
            across = np.linspace(near.min() - 0.4, near.max() + 0.4, 161)
            along = frame.curve.y(across)
            row = names.index(str(leader))
            across, along = across + x[row], along + y[row]
            curve = np.stack([across * s + along * c, across * c - along * s], axis=1) * span
        outliers = frozenset(int(frame.birds[i]) for i in frame.outliers)
        return MarkedShape(frame.kind, frame.why, curve, leader, outliers, turn)

    @staticmethod
    def _turn(xy, heading):
        """Flight direction, degrees; up if unknown."""
        if heading in HEADINGS:
            return HEADINGS[heading]
        some = xy[:: -(-len(xy) // GUESSING)]
        try:
            return guess_heading(some) if len(some) > 4 else HEADINGS["up"]
        except ProblemsError:
            return HEADINGS["up"]

    # files ----------------------------------------------------------------------------------

    def go_to(self, folder):
        super().go_to(folder)
        self.out = self.folder / self.out.name

    def learn_line(self, state=None) -> str:
        """The command that finds the formation in the marks."""
        return shlex.join(["flockbrush", "formation", "extract", str(self.out)])

    def text(self, gaps=False) -> str:
        """The marks of all birds that are in every picture, as `flockbrush formation extract` reads them.

        With gaps, of all birds; this window alone reads them then.
        """
        birds, out = self.state.birds, io.StringIO()
        partly = () if gaps else birds.partly()
        writer = csv.writer(out, lineterminator="\n")
        writer.writerow(COLUMNS)
        for k, name in enumerate(self.film.names):
            for bird, (x, y) in sorted(birds.at(k).items()):
                if bird not in partly:
                    row = name, bird, f"{x:.1f}", f"{y:.1f}", f"{self.wingspan:.1f}", self._by(k, bird, x, y)
                    writer.writerow(row)
        return out.getvalue()

    def _by(self, k, bird, x, y):
        """Who says that a bird is there: "hand", "found" or "carried"."""
        if is_found(x, y, self.film.found[k]):
            return "found"
        return "hand" if bird in self.state.birds.corrections.get(k, {}) else "carried"

    def save(self) -> list[Path]:
        """Write the marks, whole or not at all.

        Raises
        ------
        ProblemsError, OSError
            When there is nothing to write, or it cannot be written.
        """
        birds = self.state.birds
        if not set(birds.ids) - set(birds.partly()):
            raise refused(self.out, "was not written: at least one bird must be marked in every frame")
        return self._write(self.text())

    def save_unfinished(self) -> list[Path]:
        return self._write(self.text(gaps=True)) if self.state.birds.ids else []

    def _write(self, text):
        write_text(self.out, text)
        self.saved = self.state
        return [self.out]

    def _read_birds(self) -> Birds:
        """The birds that were saved before; all their pictures are then as a person left them."""
        marks, used = read_marks(self.out, "up", self.wingspan, gaps=True)
        if used["wingspan_px"] is None or not set(marks.frames) <= set(self.film.names):
            why = "already exists and has no marks for these pictures; choose another name with --out"
            raise refused(self.out, why)
        numbers = {name: int(name) for name in marks.birds if name.isdecimal()}
        if len(numbers) < len(marks.birds):
            raise refused(self.out, "has bird names that are not numbers; choose another name with --out")
        place = {name: k for k, name in enumerate(self.film.names)}
        ids = sorted(numbers.values())
        px, corrections = np.full((len(place), len(ids), 2), np.nan), {}
        for name, xs, ys in zip(marks.frames, marks.x * self.wingspan, -marks.y * self.wingspan, strict=True):
            here = dict(zip((numbers[bird] for bird in marks.birds), zip(xs, ys, strict=True), strict=True))
            px[place[name]] = [here[bird] for bird in ids]
            seen = {bird: at for bird, at in sorted(here.items()) if np.isfinite(at[0])}
            corrections[place[name]] = {bird: (float(x), float(y), False) for bird, (x, y) in seen.items()}
        birds = Birds(px, tuple(ids), corrections)
        for k in sorted(corrections):
            birds = self._follower.follow(birds, k + 1)
        return birds

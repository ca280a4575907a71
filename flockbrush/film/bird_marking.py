"""Marks of birds in the frames of a film, as a person corrects them: who is where, carried on, undone, and saved.

A mark that a person has set is carried on to the frames after it, as far as nobody has touched those.
"""

from __future__ import annotations

import csv
import io
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np

from flockbrush.behaviours.formation.curves import ALL_UP_TO
from flockbrush.behaviours.formation.extraction import extract_frame
from flockbrush.behaviours.formation.marks import HEADINGS, guess_heading, read_marks
from flockbrush.engine.files import refused, write_text
from flockbrush.engine.problems import ProblemsError
from flockbrush.film.birds_in_sky import Patch, carry, find_birds, read_pictures
from flockbrush.levels.steps import StateStack

REACH = 2.0  # wingspans that a bird may leave the flock's movement from one frame to the next
NEAR = 0.6  # wingspans: a mark so near to a bird that was found is on it
UNKNOWN_SPAN = 1 / 30  # of the picture's shorter side, where no bird was found
QUALITY = 93  # of the frames that are kept
GUESSING = 40  # birds: with more the heading is guessed from some of them
SAMPLES = 4000  # of larger flocks
COLUMNS = ("frame", "bird", "x_px", "y_px", "wingspan_px", "by")


class Mark(NamedTuple):
    """Where a bird is in one frame."""

    x: float  # pixels
    y: float
    by: str = "found"  # found | hand | carried: who says so
    gone: bool = False  # a person has said that this is no bird; it is followed so that it does not come back


class MarkedShape(NamedTuple):
    """The formation of one frame, in pixels of its picture."""

    kind: str
    why: str
    curve: np.ndarray  # (k, 2), empty where there is none
    leader: int | None  # bird
    outliers: frozenset
    heading: float  # degrees counter-clockwise from the right


class MarkingState(NamedTuple):
    """All marks, and which frames a person has touched: what undo brings back."""

    frames: tuple
    touched: frozenset


@dataclass
class MarkedFrame:
    """A picture, and what was found in it."""

    name: str
    packed: np.ndarray  # jpeg
    size: tuple[int, int]  # width and height, pixels
    found: list[Patch]

    def picture(self) -> np.ndarray:
        """Red, green and blue, (h, w, 3) uint8."""
        return cv2.cvtColor(cv2.imdecode(self.packed, cv2.IMREAD_COLOR), cv2.COLOR_BGR2RGB)  # type: ignore[arg-type]


def read_frames(paths, every=1, say=lambda done: None) -> list[MarkedFrame]:
    """The frames of pictures and clips, with the birds that are found in them.

    Raises
    ------
    ProblemsError
        When a file is neither picture nor clip.
    """
    frames: list[MarkedFrame] = []
    names: dict[str, int] = {}
    for name, image in read_pictures(paths, every):
        names[name] = names.get(name, 0) + 1
        once = name if names[name] == 1 else f"{name} ({names[name]})"
        packed = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])[1]
        frames.append(MarkedFrame(once, packed, image.shape[1::-1], find_birds(image)))
        say(len(frames))
    return frames


class Album(StateStack):
    """The marks of all frames.

    Parameters
    ----------
    frames : list of Frame
    wingspan : float, optional
        Pixels; the median of what was found unless told.

    Attributes
    ----------
    state : State
    dirty : bool
        Whether there is something that is not saved.
    """

    def __init__(self, frames, wingspan=None):
        self.frames = frames
        spans = [patch.span for frame in frames for patch in frame.found]
        usual = float(np.median(spans)) if spans else UNKNOWN_SPAN * min(frames[0].size)
        self.wingspan = float(wingspan or usual)
        first = {k: Mark(patch.x, patch.y) for k, patch in enumerate(frames[0].found)}
        super().__init__(self._carried_on(MarkingState((first,) + ({},) * (len(frames) - 1), frozenset()), 0))
        self._shapes: dict = {}

    def __len__(self):
        return len(self.frames)

    def birds(self, k) -> dict[int, Mark]:
        """The birds of frame k by number."""
        return {bird: mark for bird, mark in self.state.frames[k].items() if not mark.gone}

    def partly(self) -> dict[int, int]:
        """In how many frames those birds are that are not in all of them."""
        count: dict[int, int] = {}
        for k in range(len(self)):
            for bird in self.birds(k):
                count[bird] = count.get(bird, 0) + 1
        return {bird: n for bird, n in sorted(count.items()) if n < len(self)}

    # what a person does -----------------------------------------------------------------

    def add(self, k, x, y) -> int:
        """A bird at a place of frame k: one that was lost there, if one was, else a new one.  Its number."""
        x, y = self._inside(k, x, y)
        bird = self._lost(k, x, y)
        bird = self._next() if bird is None else bird
        self._edit(f"bird {bird} added", k, self.state.frames[k] | {bird: Mark(x, y, "hand")})
        return bird

    def remove(self, k, bird):
        """This is no bird, here and in the frames after this one."""
        here = self.state.frames[k]
        self._edit(f"bird {bird} removed", k, here | {bird: here[bird]._replace(gone=True)})

    def move(self, k, bird, x, y):
        """The bird is there; what it was taken for is no bird of its own."""
        here = dict(self.state.frames[k])
        old, new = here[bird], Mark(*self._inside(k, x, y), "hand")
        if np.hypot(old.x - new.x, old.y - new.y) > NEAR * self.wingspan and old.by == "found":
            here[self._next()] = old._replace(gone=True)
        here[bird] = new
        self._edit(f"bird {bird} moved", k, here)

    def swap(self, k, one, other):
        """The two birds have each other's numbers from this frame on."""
        here = dict(self.state.frames[k])
        here[one], here[other] = here[other], here[one]
        self._edit(f"birds {one} and {other} swapped", k, here)

    def _edit(self, label, k, marks):
        frames = (*self.state.frames[:k], dict(sorted(marks.items())), *self.state.frames[k + 1 :])
        self.replace(label, k, self._carried_on(MarkingState(frames, self.state.touched | {k}), k))

    def _inside(self, k, x, y):
        wide, tall = self.frames[k].size
        return float(np.clip(x, 0, wide - 1)), float(np.clip(y, 0, tall - 1))

    def _next(self):
        """A number that no bird has."""
        return 1 + max((bird for marks in self.state.frames for bird in marks), default=-1)

    def _lost(self, k, x, y):
        """The bird of the frame before that is missing here and would be about at this place."""
        if not k:
            return None
        before, here = self.birds(k - 1), self.state.frames[k]
        shift = self._shift(before, here)
        missing = {
            bird: np.hypot(mark.x + shift[0] - x, mark.y + shift[1] - y)
            for bird, mark in before.items()
            if bird not in here
        }
        near = {bird: far for bird, far in missing.items() if far <= REACH * self.wingspan}
        return min(near, key=lambda bird: near[bird], default=None)

    # carrying on ------------------------------------------------------------------------

    def _carried_on(self, state, k):
        """A state with the frames after frame k that nobody has touched, up to the first that somebody has."""
        frames = list(state.frames)
        for j in range(k + 1, len(frames)):
            if j in state.touched:
                break
            fresh = 1 + max((bird for marks in frames for bird in marks), default=-1)
            frames[j] = self._carried(frames[j - 1], self.frames[j], frames[j], fresh)
        return state._replace(frames=tuple(frames))

    def _carried(self, before, frame, was, fresh):
        """The marks of a frame, from those of the frame before and what was found; new birds keep their number."""
        names = list(before)
        marks = {}
        match = carry(list(before.values()), frame.found, REACH * self.wingspan)
        for patch, old in zip(frame.found, match, strict=True):
            if old >= 0:
                marks[names[old]] = Mark(patch.x, patch.y, "found", before[names[old]].gone)
        shift = self._shift(before, marks)
        wide, tall = frame.size
        for bird, mark in before.items():  # those a person put where nothing is found
            x, y = mark.x + shift[0], mark.y + shift[1]
            if bird not in marks and mark.by != "found" and 0 <= x < wide and 0 <= y < tall:
                marks[bird] = Mark(x, y, "carried", mark.gone)
        known = {(mark.x, mark.y): bird for bird, mark in was.items()}
        for patch, old in zip(frame.found, match, strict=True):
            if old < 0:
                bird = known.get((patch.x, patch.y))
                if bird is None or bird in marks or bird in before:
                    bird, fresh = fresh, fresh + 1
                marks[bird] = Mark(patch.x, patch.y)
        return dict(sorted(marks.items()))

    @staticmethod
    def _shift(before, after):
        """The flock's movement between two frames, pixels."""
        ways = [(after[b].x - mark.x, after[b].y - mark.y) for b, mark in before.items() if b in after]
        return np.median(ways, axis=0) if ways else np.zeros(2)

    # what is to be seen ---------------------------------------------------------------------

    def shape(self, k, heading="auto", marks=None) -> MarkedShape | None:
        """The formation of a frame, or of marks that are not done yet; None without birds."""
        birds = self.birds(k) if marks is None else marks
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
        xy = np.array([(mark.x, -mark.y) for mark in birds.values()]) / span
        turn = self._turn(xy, heading)
        c, s = np.cos(np.radians(turn)), np.sin(np.radians(turn))
        x, y = xy[:, 0] * s - xy[:, 1] * c, xy[:, 0] * c + xy[:, 1] * s
        names = [str(bird) for bird in birds]
        seen = extract_frame(x, y, "0", names, SAMPLES if len(x) > ALL_UP_TO else None)
        leader = int(seen.birds[seen.leader])
        curve = np.zeros((0, 2))
        if seen.curve is not None:
            near = np.delete(seen.x, seen.outliers) if seen.outliers else np.array(seen.x)
            across = np.linspace(near.min() - 0.4, near.max() + 0.4, 161)
            along = seen.curve.y(across)
            row = names.index(str(leader))
            across, along = across + x[row], along + y[row]
            curve = np.stack([across * s + along * c, across * c - along * s], axis=1) * span
        outliers = frozenset(int(seen.birds[i]) for i in seen.outliers)
        return MarkedShape(seen.kind, seen.why, curve, leader, outliers, turn)

    @staticmethod
    def _turn(xy, heading):
        """The way they fly, degrees; up where it cannot be told."""
        if heading in HEADINGS:
            return HEADINGS[heading]
        some = xy[:: -(-len(xy) // GUESSING)]
        try:
            return guess_heading(some) if len(some) > 4 else HEADINGS["up"]
        except ProblemsError:
            return HEADINGS["up"]

    # files ------------------------------------------------------------------------------------

    def text(self) -> str:
        """The marks of all birds that are in every frame, as `flockbrush formation extract` reads them."""
        out, partly = io.StringIO(), self.partly()
        writer = csv.writer(out, lineterminator="\n")
        writer.writerow(COLUMNS)
        for k, frame in enumerate(self.frames):
            for bird, mark in self.birds(k).items():
                if bird not in partly:
                    place = f"{mark.x:.1f}", f"{mark.y:.1f}"
                    writer.writerow([frame.name, bird, *place, f"{self.wingspan:.1f}", mark.by])
        return out.getvalue()

    def save(self, path):
        """Write the marks, whole or not at all.

        Raises
        ------
        ProblemsError, OSError
            When there is nothing to write, or it cannot be written.
        """
        partly = self.partly()
        if not set(self.birds(0)) - set(partly):
            raise refused(path, "was not written: at least one bird must be marked in every frame")
        write_text(path, self.text())
        self.saved = self.state

    def load(self, path):
        """Take up marks that were saved before; all their frames are then as a person left them.

        Raises
        ------
        ProblemsError
            When they cannot be read, or are not of these pictures.
        """
        marks, said = read_marks(path, "up", self.wingspan)
        if said["wingspan_px"] is None or not set(marks.frames) <= {frame.name for frame in self.frames}:
            raise refused(path, "already exists and has no marks for these pictures; choose another name with --out")
        frames, touched = list(self.state.frames), set()
        place = {frame.name: k for k, frame in enumerate(self.frames)}
        numbers = {name: int(name) for name in marks.birds if name.isdecimal()}
        if len(numbers) < len(marks.birds):
            raise refused(path, "has bird names that are not numbers; choose another name with --out")
        for name, xs, ys in zip(marks.frames, marks.x, marks.y, strict=True):
            k = place[name]
            touched.add(k)
            here = {
                numbers[b]: Mark(float(x * self.wingspan), float(-y * self.wingspan), "hand")
                for b, x, y in zip(marks.birds, xs, ys, strict=True)
            }
            frames[k] = dict(sorted((bird, self._on_found(k, mark)) for bird, mark in here.items()))
        self.state = MarkingState(tuple(frames), frozenset(touched))
        for k in sorted(touched):
            self.state = self._carried_on(self.state, k)
        self.saved = self.state

    def _on_found(self, k, mark):
        """Whether a mark that was read is that of a bird that was found."""
        near = any(abs(p.x - mark.x) < 0.1 and abs(p.y - mark.y) < 0.1 for p in self.frames[k].found)
        return mark._replace(by="found") if near else mark


def name_for(paths) -> Path:
    """Where marks go that were given no name."""
    return Path(f"{Path(paths[0]).stem}.marks.csv")

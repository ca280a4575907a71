"""Marks of birds in the frames of a film: corrected by hand, carried to later frames, undone, and saved.

A mark set by hand is carried to the following frames, up to the first frame with a correction of its own.
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
from flockbrush.behaviours.formation.marked_birds import HEADINGS, guess_heading, read_marks
from flockbrush.engine.files import refused, write_text
from flockbrush.engine.problems import ProblemsError
from flockbrush.film.birds_in_sky import Patch, carry, find_birds, read_pictures
from flockbrush.levels.steps import Steps

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
    by: str = "found"  # found | hand | carried: the source of the mark
    gone: bool = False  # marked as no bird by hand; it is tracked so that it is not detected again


class MarkedShape(NamedTuple):
    """The formation of one frame, in pixels of its picture."""

    kind: str
    why: str
    curve: np.ndarray  # (k, 2), empty where there is none
    leader: int | None  # bird
    outliers: frozenset
    heading: float  # degrees counter-clockwise from the right


class MarkingState(NamedTuple):
    """All marks, and the frames corrected by hand: the state that undo restores."""

    frames: tuple
    touched: frozenset


class MarkingStep(NamedTuple):
    """One undoable step: its name, its frame, and the state before it."""

    label: str
    k: int
    before: MarkingState


@dataclass
class MarkedFrame:
    """A picture and the birds detected in it."""

    name: str
    packed: np.ndarray  # jpeg
    size: tuple[int, int]  # width and height, pixels
    found: list[Patch]

    def picture(self) -> np.ndarray:
        """Red, green and blue, (h, w, 3) uint8."""
        return cv2.cvtColor(cv2.imdecode(self.packed, cv2.IMREAD_COLOR), cv2.COLOR_BGR2RGB)  # type: ignore[arg-type]


def read_frames(paths, every=1, say=lambda done: None) -> list[MarkedFrame]:
    """The frames of pictures and clips, with the birds detected in them.

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


class Album(Steps):
    """The marks of all frames.

    Parameters
    ----------
    frames : list of Frame
    wingspan : float, optional
        Pixels; default: the median of the detected birds.

    Attributes
    ----------
    state : State
    dirty : bool
        Whether there are unsaved changes.
    """

    def __init__(self, frames, wingspan=None):
        super().__init__()
        self.frames = frames
        spans = [patch.span for frame in frames for patch in frame.found]
        usual = float(np.median(spans)) if spans else UNKNOWN_SPAN * min(frames[0].size)
        self.wingspan = float(wingspan or usual)
        first = {k: Mark(patch.x, patch.y) for k, patch in enumerate(frames[0].found)}
        self.state = MarkingState((first,) + ({},) * (len(frames) - 1), frozenset())
        self._carry_from(0)
        self._saved = self.state
        self._shapes: dict = {}

    def __len__(self):
        return len(self.frames)

    def birds(self, k) -> dict[int, Mark]:
        """The birds of frame k by number."""
        return {bird: mark for bird, mark in self.state.frames[k].items() if not mark.gone}

    @property
    def dirty(self):
        """Whether there are corrections that are not saved."""
        return self.state != self._saved

    def partly(self) -> dict[int, int]:
        """{bird: number of its frames} of the birds that are missing in some frame."""
        count: dict[int, int] = {}
        for k in range(len(self)):
            for bird in self.birds(k):
                count[bird] = count.get(bird, 0) + 1
        return {bird: n for bird, n in sorted(count.items()) if n < len(self)}

    # what a person does -----------------------------------------------------------------

    def add(self, k, x, y) -> int:
        """Add a bird at a place of frame k and return its number: that of a bird lost near there, or a new one."""
        x, y = self._inside(k, x, y)
        bird = self._lost(k, x, y)
        bird = self._next() if bird is None else bird
        self._edit(f"bird {bird} added", k, self.state.frames[k] | {bird: Mark(x, y, "hand")})
        return bird

    def remove(self, k, bird):
        """Mark a detection as no bird, in this frame and the following ones."""
        here = self.state.frames[k]
        self._edit(f"bird {bird} removed", k, here | {bird: here[bird]._replace(gone=True)})

    def move(self, k, bird, x, y):
        """Move the mark of a bird; a detection at its old place is no longer a bird of its own."""
        here = dict(self.state.frames[k])
        old, new = here[bird], Mark(*self._inside(k, x, y), "hand")
        if np.hypot(old.x - new.x, old.y - new.y) > NEAR * self.wingspan and old.by == "found":
            here[self._next()] = old._replace(gone=True)
        here[bird] = new
        self._edit(f"bird {bird} moved", k, here)

    def swap(self, k, one, other):
        """Swap the numbers of two birds from this frame on."""
        here = dict(self.state.frames[k])
        here[one], here[other] = here[other], here[one]
        self._edit(f"birds {one} and {other} swapped", k, here)

    def undo(self) -> tuple[str, int] | None:
        """Undo the last correction; returns its name and its frame."""
        return self._step(self._done, self._undone)

    def redo(self) -> tuple[str, int] | None:
        """Redo the correction that was undone last."""
        return self._step(self._undone, self._done)

    def _step(self, source, target):
        if not source:
            return None
        label, k, state = source.pop()
        target.append(MarkingStep(label, k, self.state))
        self.state = state
        return label, k

    def _edit(self, label, k, marks):
        self._done.append(MarkingStep(label, k, self.state))
        self._undone.clear()
        frames = (*self.state.frames[:k], dict(sorted(marks.items())), *self.state.frames[k + 1 :])
        self.state = MarkingState(frames, self.state.touched | {k})
        self._carry_from(k)

    def _inside(self, k, x, y):
        wide, tall = self.frames[k].size
        return float(np.clip(x, 0, wide - 1)), float(np.clip(y, 0, tall - 1))

    def _next(self):
        """The next unused number of a bird."""
        return 1 + max((bird for marks in self.state.frames for bird in marks), default=-1)

    def _lost(self, k, x, y):
        """The bird of the previous frame that is missing here and is expected near this place."""
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

    def _carry_from(self, k):
        """Recompute the frames after frame k, up to the first that was corrected by hand."""
        frames = list(self.state.frames)
        for j in range(k + 1, len(frames)):
            if j in self.state.touched:
                break
            fresh = 1 + max((bird for marks in frames for bird in marks), default=-1)
            frames[j] = self._carried(frames[j - 1], self.frames[j], frames[j], fresh)
        self.state = self.state._replace(frames=tuple(frames))

    def _carried(self, before, frame, was, fresh):
        """The marks of a frame from those of the previous frame and the detections; new birds keep their numbers."""
        names = list(before)
        marks = {}
        match = carry(list(before.values()), frame.found, REACH * self.wingspan)
        for patch, old in zip(frame.found, match, strict=True):
            if old >= 0:
                marks[names[old]] = Mark(patch.x, patch.y, "found", before[names[old]].gone)
        shift = self._shift(before, marks)
        wide, tall = frame.size
        for bird, mark in before.items():  # marks set by hand where nothing is detected
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
        """The formation of a frame, or of marks that are being edited; None without birds."""
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
        """Direction of flight, degrees; up if it cannot be determined."""
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
        self._saved = self.state

    def load(self, path):
        """Load saved marks; all their frames then count as corrected by hand.

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
            self._carry_from(k)
        self._saved = self.state

    def _on_found(self, k, mark):
        """Whether a mark from a file lies on a detected bird."""
        near = any(abs(p.x - mark.x) < 0.1 and abs(p.y - mark.y) < 0.1 for p in self.frames[k].found)
        return mark._replace(by="found") if near else mark


def name_for(paths) -> Path:
    """Default file name of the marks."""
    return Path(f"{Path(paths[0]).stem}.marks.csv")

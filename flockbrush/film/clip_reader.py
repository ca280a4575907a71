"""Films and photographs of herds as a row of pictures: upright, evenly timed, and refused where they cannot be read.

Frames are numbered from 0 in the order in which they are shown.  Rotation that a camera has noted is obeyed.  A film
whose frames are unevenly timed is thinned by its time stamps to an even row; frames that repeat the one before are left
out.  Pictures larger than `WORK` pixels are made smaller.  A clip with a cut is refused: a herd is learned from one
shot.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import cv2
import numpy as np

from flockbrush.engine.files import sha256_of
from flockbrush.engine.problems import ProblemsError
from flockbrush.film.looking import frames_missing
from flockbrush.film.media import FilmReader, check_file, is_picture, read_picture
from flockbrush.film.observations import CannotObserve
from flockbrush.film.track_table import unevenness

WORK = 1280  # px, the longer side of the pictures that are worked on
FPS = 25.0  # frames a second of a film that does not say
KEEP = 256 << 20  # bytes of pictures that are held in memory rather than read again
THUMB = 96  # px, the longer side of the pictures that are compared to find cuts
REPEATED = 0.35  # grey levels: two thumbnails that differ less on average show the same frame, if others do not
CUT, CUT_OVER_USUAL = 0.38, 5.0  # distance of colour histograms between neighbours, and over the usual distance


def silent(text: str, done: int, total: int):
    """A progress function that does nothing."""


Say = Callable[[str, int, int], None]  # what is done, how many are done, of how many


@dataclass
class Clip:
    """One shot, ready to be read."""

    path: Path
    name: str  # as the user named it
    sha256: str  # of the file
    size: tuple[int, int]  # width and height of the pictures read, px
    full: tuple[int, int]  # of the clip itself, upright, px
    fps: float  # pictures a second
    numbers: np.ndarray  # (n,) int; frames of the clip that are used
    times: np.ndarray  # (n,); when they are shown, s
    still: bool = False  # one picture: motion is unknown
    notes: list[str] = field(default_factory=list)
    _kept: dict[int, np.ndarray] = field(default_factory=dict, repr=False)

    def __len__(self):
        return len(self.numbers)

    @property
    def scale(self) -> float:
        """Pixels of the pictures read for one of the clip's."""
        return self.size[0] / self.full[0]

    def read(self, chosen=None) -> Iterator[tuple[int, np.ndarray]]:
        """(k, picture) in order: the k-th of `numbers`, (h, w, 3) uint8 BGR.

        Parameters
        ----------
        chosen : iterable of int, optional
            Which k; all unless given.
        """
        wanted = range(len(self)) if chosen is None else sorted({int(k) for k in chosen})
        if all(int(self.numbers[k]) in self._kept for k in wanted):
            yield from ((k, self._kept[int(self.numbers[k])]) for k in wanted)
            return
        place = {int(self.numbers[k]): k for k in wanted}
        with _Film(self.name, self.path) as film:
            for number, _, picture in film.pictures(set(place), max(place)):
                yield place[number], _smaller(picture, self.size)


def open_clip(path, frames: tuple[int | None, int | None] | None = None, say: Say = silent, work: int = WORK) -> Clip:
    """Open a film or a photograph, and scan it once.

    Parameters
    ----------
    path : path
        Whatever ffmpeg reads, or a picture.
    frames : (first, last), optional
        Numbers of the frames to use, both included; None is the clip's own end.
    say : callable
        Called with the progress.
    work : int
        Pixels of the longer side that pictures are made smaller to.

    Raises
    ------
    CannotObserve
        When it cannot be read, is not one shot, or has no such frames.
    """
    name, path = str(path), Path(path)
    raw_sha = _sha256(name, path)
    photo = _photo(name, path)
    if photo is not None:
        return _photograph(name, path, raw_sha, photo, frames, work)
    clip, apart, change, last = _look_through(name, path, raw_sha, frames, say, work)
    if len(clip) == 1:
        clip.still = True
        clip.notes.append("it has only one frame: the density of the animals is known, but not their motion")
        return clip
    _refuse_cuts(clip, cuts(apart, change), last)
    clip.numbers, clip.times, clip.fps, notes = evenly(clip.numbers, clip.times, _repeats(change))
    clip.notes += notes
    return clip


def _sha256(name, path):
    """Of the file's bytes; reports why it cannot be read."""
    try:
        check_file(path)
    except ProblemsError as error:
        seen = {"bytes of the file": 0} if path.is_file() and not path.stat().st_size else {}
        raise CannotObserve(name, error.problems[0].message, seen) from None
    return sha256_of(path)


# photographs -----------------------------------------------------------------------------


def _photo(name, path):
    """The picture of a file that is one, turned upright as its camera noted; None of a film."""
    try:
        return read_picture(path) if is_picture(path) else None
    except ProblemsError as error:
        raise CannotObserve(name, error.problems[0].message, _of_file(path)) from None


def _photograph(name, path, sha256, picture, frames, work):
    if _bounds(name, frames)[0] > 0:
        raise CannotObserve(name, "is a single picture, with frame number 0; leave out --frames")
    full = picture.shape[1::-1]
    size = work_size(full, work)
    notes = ["it is a photograph: the density of the animals is known, but not their motion"]
    notes += frames_missing(0, 0, _bounds(name, frames))
    pictures = {0: _smaller(picture, size)}
    return Clip(
        path, name, sha256, size, full, FPS, np.array([0]), np.zeros(1), True, notes + _shrunk(full, size), pictures
    )


# films -----------------------------------------------------------------------------------


class _Film(FilmReader):
    """A film that is read picture by picture."""

    def __init__(self, name, path):
        self.ended = ""  # why it was not read to its end
        try:
            super().__init__(path)
        except ProblemsError as error:
            raise CannotObserve(name, error.problems[0].message, _of_file(path)) from None

    def pictures(self, wanted=None, last=None):
        """(number, seconds, picture) of the frames wanted, up to the last; stops where the film is damaged."""
        k = 0
        while last is None or k <= last:
            picture = self.read() if wanted is None or k in wanted else self.skip()
            if picture is None or picture is False:
                self.ended = self.damage
                return
            if self.number > k:
                later = f"the {self.length - k} later frames are" if self.length > k + 1 else "later frames are"
                self.ended = f"it is damaged after frame {k - 1}; {later} ignored"
                return
            if picture is not True:
                yield k, self.time, picture
            k += 1


def _of_file(path):
    """An error message for a file that is not a film."""
    with open(path, "rb") as file:
        begin = file.read(16)
    return {"bytes of the file": path.stat().st_size, "it begins with": " ".join(f"{byte:02x}" for byte in begin)}


def _repeats(change):
    """(n,) bool: repeats the previous frame, in a film whose other frames differ."""
    same = change < min(REPEATED, 0.2 * np.median(change[1:]))
    same[0] = False
    return same


def _look_through(name, path, sha256, frames, say, work):
    """(clip of all frames at the rate it claims, `_changes` of its thumbnails, its last picture) of one pass."""
    first, last = _bounds(name, frames)
    numbers, times, thumbs, pictures, room, number = [], [], [], {}, KEEP, -1
    with _Film(name, path) as film:
        total = max(0, min(film.length, (last if last is not None else film.length) + 1) - first)
        for number, time, picture in film.pictures(last=last):
            if number < first:
                continue
            full = picture.shape[1::-1]
            size = work_size(full, work)
            small = _smaller(picture, size)
            numbers.append(number)
            times.append(time)
            thumbs.append(cv2.resize(small, _fit(size, THUMB), interpolation=cv2.INTER_AREA))
            room -= small.nbytes
            if room > 0:
                pictures[number] = small
            say("reading the clip", len(numbers), total)
    if not numbers:
        raise CannotObserve(name, _no_frames(number + 1, first, last, film.ended))
    notes = [film.ended] if film.ended else []
    notes += frames_missing(0, number, (first, last))
    if film.turned:
        notes.append(f"the clip is marked as rotated by {film.turned} degrees; it was turned upright")
    times, clock_notes = _clock(times, film.fps)
    apart, change = _changes(thumbs)
    clip = Clip(path, name, sha256, size, full, FPS, np.array(numbers), times, False,
                notes + clock_notes + _shrunk(full, size), pictures if room > 0 else {})  # fmt: skip
    return clip, apart, change, _smaller(picture, size)


def _bounds(name, frames):
    """(first, last or None) of the requested frames."""
    first, last = frames or (None, None)
    first = 0 if first is None else first
    if first < 0 or (last is not None and last < first):
        raise CannotObserve(
            name, f"frames are numbered from 0, and the first must not be after the last; got {first}:{last}"
        )
    return first, last


def _no_frames(total, first, last, damage):
    """The error message for a film of which no frame is left."""
    if total == 0:
        return damage
    return f"has frames 0 to {total - 1}, but none in {first}:{'' if last is None else last}"


def _clock(times, fps):
    """((n,) seconds, notes) of frames whose times may not be known."""
    times = np.array(times)
    if np.isfinite(times).all() and (np.diff(times) > 0).all():
        return times, []
    known = 0.1 <= fps <= 1000
    notes = [] if known else [f"the clip does not contain its frame rate; {FPS:g} is assumed"]
    return np.arange(len(times)) / (fps if known else FPS), notes


def _changes(thumbs):
    """(distance of colour histograms, mean difference, grey levels) of each thumbnail to the one before, (n,) both."""
    counts = [_histogram(thumb) for thumb in thumbs]
    apart, change = np.zeros(len(thumbs)), np.zeros(len(thumbs))
    for k in range(1, len(thumbs)):
        apart[k] = cv2.compareHist(counts[k - 1], counts[k], cv2.HISTCMP_BHATTACHARYYA)
        change[k] = cv2.absdiff(thumbs[k - 1], thumbs[k]).mean()
    return apart, change


def _histogram(thumb):
    counts = cv2.calcHist([cv2.GaussianBlur(thumb, (3, 3), 0)], [0, 1, 2], None, [8, 8, 8], [0, 256] * 3)
    return cv2.normalize(counts, None, 1.0, 0.0, cv2.NORM_L1)


def cuts(apart, change) -> np.ndarray:
    """Rows of frames that begin another shot: colours and picture differ all at once from the frame before.

    A herd that walks into the picture changes it a little every frame, a cut changes it once.

    Parameters
    ----------
    apart, change : (n,) ndarray
        Distance of colour histograms, and mean difference, to the frame before.
    """
    if len(apart) < 3:
        return np.flatnonzero(apart > 2 * CUT)
    sudden = apart > max(CUT, CUT_OVER_USUAL * float(np.median(apart[1:])))
    return np.flatnonzero(sudden & (change > 3.0 * np.median(change[1:])))


def _refuse_cuts(clip, rows, last):
    """Refuse a clip with cuts in these rows; ``last`` is its last picture."""
    if not len(rows):
        return
    numbers = clip.numbers
    edges = [0, *rows.tolist(), len(numbers)]
    shots = [f"{numbers[a]}:{numbers[b - 1]}" for a, b in zip(edges, edges[1:], strict=False)]
    where = ", ".join(f"{numbers[k - 1]} and {numbers[k]}" for k in rows[:5])
    ways = " or ".join(f"--frames {shot}" for shot in sorted(shots, key=_length, reverse=True)[:3])
    raise CannotObserve(
        clip.name, f"there is a cut between frames {where}; a clip must be one shot: try {ways}",
        {"cuts": [int(numbers[k]) for k in rows], "pictures": {"last frame": last}},
    )  # fmt: skip


def _length(shot):
    first, last = shot.split(":")
    return int(last) - int(first)


def evenly(numbers, times, repeats):
    """An evenly timed subset of unevenly timed frames.

    Parameters
    ----------
    numbers : (n,) int ndarray
    times : (n,) ndarray
        Seconds, rising.
    repeats : (n,) bool ndarray
        Frames that repeat the previous one.

    Returns
    -------
    numbers, times : (m,) ndarray
    fps : float
    notes : list of str
    """
    notes = []
    if 0.02 <= repeats.mean() <= 0.9 and (~repeats).sum() > 2:
        span = float(times[-1] - times[0])
        notes.append(f"{int(repeats.sum())} of {len(times)} frames are identical to the frame before and were left out")
        numbers = numbers[~repeats]
        times = times[0] + np.linspace(0, span, len(numbers))
    steps = np.diff(times)
    uneven = unevenness(times)
    if not uneven:
        return numbers, times, (len(times) - 1) / float(times[-1] - times[0]), notes
    step = float(np.quantile(steps, 0.9))
    row = _nearest(times, np.arange(times[0], times[-1] + 0.5 * step, step))
    if len(row) == len(numbers):
        return numbers, times, (len(times) - 1) / float(times[-1] - times[0]), notes
    notes.append(f"{uneven}; {len(row)} of {len(times)} were used, {step:.3g} s apart")
    return numbers[row], times[row], 1.0 / step, notes


def _nearest(times, moments):
    """Rows of the times nearest to given moments, each once."""
    after = np.clip(np.searchsorted(times, moments), 1, len(times) - 1)
    nearer = np.where(moments - times[after - 1] < times[after] - moments, after - 1, after)
    return np.unique(nearer)


# sizes -----------------------------------------------------------------------------------


def work_size(full, work=WORK) -> tuple[int, int]:
    """Width and height at which a picture is processed, px."""
    return (int(full[0]), int(full[1])) if max(full) <= work else _fit(full, work)


def _fit(size, longer):
    """The size with its longer side as given."""
    return tuple(max(1, round(side * longer / max(size))) for side in size)


def _smaller(picture, size):
    if picture.shape[1::-1] == tuple(size):
        return picture
    return cv2.resize(picture, size, interpolation=cv2.INTER_AREA)


def _shrunk(full, size):
    if tuple(full) == tuple(size):
        return []
    return [f"its pictures are {full[0]} x {full[1]}; they were reduced to {size[0]} x {size[1]}"]

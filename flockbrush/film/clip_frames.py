"""A film with random access to its frames."""

from __future__ import annotations

import math
from collections import OrderedDict
from pathlib import Path

import numpy as np

from flockbrush.engine.files import refused
from flockbrush.film.media import FilmReader
from flockbrush.film.track_table import SAME_RATE, unevenness

KEPT = 192 << 20  # bytes of decoded frames that are kept
LEAPS = (0, 96, 400, 1600)  # frames a seek begins before what is wanted, one after the other until it lands before it
BACK = 32  # frames that are decoded at once by who goes backwards
AHEAD = 60  # frames: no farther ahead, decoding on is quicker than seeking
SAMPLE = (1280, 720)  # pixels of the empty sky
SKY = "sky"  # what an empty sky is called on the command line


class TimedFrames:
    """Frames at times, s from the first: (F,) ``times``; ``notes`` say what is wrong with them."""

    times: np.ndarray
    notes: list[str] | tuple = ()

    def __len__(self):
        return len(self.times)

    def time(self, k) -> float:
        """Seconds of frame k from the first."""
        return float(self.times[k])

    def caption(self, k) -> str:
        """Which frame it is, and when."""
        return f"frame {k} of {len(self) - 1}   {self.time(k):.2f} s"


class Film(TimedFrames):
    """The frames of a clip.

    All frames are gone through once at the beginning: only then their number and times are known for certain.  A frame
    that is asked for out of order is decoded from the key frame before it; all that is decoded on the way is kept, so
    that going backwards is quick.

    Parameters
    ----------
    path : path
        Anything that `flockbrush.film.media` opens.
    say : callable, optional
        Told how many frames have been gone through.

    Raises
    ------
    ProblemsError
        When it is no film.
    """

    def __init__(self, path, say=lambda done: None):
        self.path, self.name = Path(path), Path(path).name
        self._reader, self._next = FilmReader(self.path), 0
        self._stamps = _stamps(self._reader, say)
        self.lost, damage = frozenset(self._reader.lost), self._reader.damage
        if not len(self._stamps):
            raise refused(path, damage)
        self.notes = [damage] if damage else []
        self.fps = _fps(self._reader.fps, self._stamps)
        steps = np.diff(self._stamps)
        self._step = float(steps.min()) if len(steps) else 0.0  # s; 0 where times do not tell frames apart
        # (F,); seconds from the first frame
        self.times = self._stamps - self._stamps[0] if self._step > 0 else np.arange(len(self._stamps)) / self.fps
        self._kept: OrderedDict[int, np.ndarray] = OrderedDict()
        self._most = 8  # frames
        self._rewind()
        first = self._read()
        self.size = first.shape[1], first.shape[0]  # width and height, pixels
        self._most = max(8, KEPT // first.nbytes)

    def frame(self, k) -> np.ndarray:
        """Frame k as blue, green, red, (h, w, 3) uint8; the last good one where it is broken."""
        k = min(max(int(k), 0), len(self) - 1)
        if k not in self._kept:
            self._decode(k)
        if k in self._kept:
            self._kept.move_to_end(k)
            return self._kept[k]
        return self._nearest(k)

    def again(self) -> Film:
        """The same film with a reader of its own, for another thread."""
        other = object.__new__(Film)
        other.__dict__.update(self.__dict__)
        other._reader, other._kept, other._next = FilmReader(self.path), OrderedDict(), 0
        other._most = 16
        return other

    def close(self):
        """Let the file go."""
        self._reader.close()
        self._kept.clear()

    # decoding -------------------------------------------------------------------------------

    def _decode(self, k):
        if not 0 <= k - self._next <= AHEAD:
            steps_back = k + 1 in self._kept
            self._seek(max(0, k - min(BACK, self._most // 2) + 1) if steps_back else k)
        while self._next <= k and self._read() is not None:
            pass

    def _read(self):
        """The next frame, kept; None at the end."""
        image = self._reader.read()
        if image is not None:
            self._keep(image)
        return image

    def _keep(self, image):
        k = self._reader.number
        self._kept[k] = image
        self._kept.move_to_end(k)
        self._next = k + 1
        while len(self._kept) > self._most:
            self._kept.popitem(last=False)

    def _rewind(self):
        self._reader.close()
        self._reader, self._next = FilmReader(self.path), 0

    def _seek(self, k):
        """Stand at or before frame k, knowing at which frame."""
        for leap in LEAPS if self._step > 0 else ():
            if k - leap <= 0:
                break
            self._reader.seek(float(self._stamps[k - leap]))
            image = self._reader.read()
            at = None if image is None else self._at()
            if at is not None and at <= k:
                self._reader.number = at
                self._keep(image)
                return
        self._rewind()

    def _at(self):
        """Which frame was read last, by its time; None when it has the time of none."""
        now = self._reader.time
        k = int(np.argmin(np.abs(self._stamps - now)))
        return k if abs(self._stamps[k] - now) < 0.3 * self._step else None

    def _nearest(self, k):
        """A frame near one that cannot be decoded."""
        if not self._kept:
            self._rewind()
            self._read()
        best = min(self._kept, key=lambda j: abs(j - k), default=None)
        return np.zeros((self.size[1], self.size[0], 3), np.uint8) if best is None else self._kept[best]


class Sky(TimedFrames):
    """An empty sky, to sketch on: every frame the same.

    Parameters
    ----------
    size : (int, int)
    frames : int
    fps : float
    """

    path = None
    name = "sky"

    def __init__(self, size=SAMPLE, frames=200, fps=30.0):
        self.size, self.fps = size, float(fps)
        self.lasts(frames)
        rows = np.linspace(0, 1, size[1])[:, None]
        colours = np.array([226, 196, 158]) * (1 - rows) + np.array([240, 232, 220]) * rows  # blue, green, red
        self._picture = np.repeat(np.round(colours).astype(np.uint8)[:, None], size[0], axis=1)

    def lasts(self, frames):
        """Be so many frames long."""
        self.times = np.arange(frames) / self.fps

    def frame(self, k) -> np.ndarray:
        """The sky, (h, w, 3) uint8."""
        return self._picture

    def again(self) -> Sky:
        """The same sky."""
        return self

    def close(self):
        """Nothing is held."""


def _stamps(reader, say):
    """Seconds of all frames by going through them, those that are lost too, (F,)."""
    stamps: list[float] = []
    while reader.skip():
        stamps += [*reader.gap, reader.time]
        say(len(stamps))
    return np.nan_to_num(np.array(stamps))


def _fps(nominal, stamps):
    """Frames a second: as the film states, unless its even times differ; 30 if neither is plausible."""
    span = float(stamps[-1] - stamps[0]) if (np.diff(stamps) > 0).all() else 0.0
    timed = (len(stamps) - 1) / span if span > 0 else math.nan
    known = math.isfinite(nominal) and 0.1 <= nominal <= 1000
    if known and (unevenness(stamps) or not abs(timed / nominal - 1.0) > SAME_RATE):
        return nominal
    return timed if math.isfinite(timed) else 30.0

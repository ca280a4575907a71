"""Videos of the canvas while one plays: frames go through a short queue to a thread that writes them."""

from __future__ import annotations

import queue
import threading
from pathlib import Path

import cv2
import numpy as np

from flockbrush.render import Video

FPS = 30
WAITING = 12  # frames at most between window and writer; more are left out rather than waited for


class RunningVideo:
    """A video that is being made.

    Parameters
    ----------
    size : (int, int)
        Pixels; frames of another size are fitted in.
    """

    def __init__(self, path, size):
        self.path, self.size = Path(path), (size[0] - size[0] % 2, size[1] - size[1] % 2)
        self.taken = self.left_out = 0
        self.problem = ""
        self._due = 0.0
        self._queue: queue.Queue = queue.Queue(WAITING)
        self._thread = threading.Thread(target=self._write, name="film", daemon=True)
        self._thread.start()

    def take(self, frame, dt):
        """Keep a frame (h, w, 3) if one is due, `dt` seconds after the last call."""
        self._due += dt * FPS
        if self._due < 1:
            return
        self._due %= 1.0
        try:
            self._queue.put_nowait(fitted(frame, self.size))
            self.taken += 1
        except queue.Full:
            self.left_out += 1

    def close(self) -> str:
        """End the video; returns the message about it."""
        self._queue.put(None)
        self._thread.join(30)
        if self.problem:
            return self.problem
        less = f"; {self.left_out} frames are missing because the machine was too slow" if self.left_out else ""
        return f"wrote {self.path}: {self.taken / FPS:.1f} s{less}"

    def _write(self):
        frame = None
        try:
            with Video(self.path, FPS, self.size) as video:
                while (frame := self._queue.get()) is not None:
                    video.write(frame)
        except (OSError, ValueError) as error:
            self.problem = f"the video could not be written: {error}"
            while frame is not None:  # whoever waits for us must not wait for ever
                frame = self._queue.get()


def fitted(frame, size):
    """A copy of the frame in another size, with bars where the proportions differ."""
    height, width = frame.shape[:2]
    if (width, height) == size:
        return frame.copy()
    if 0 <= width - size[0] <= 1 and 0 <= height - size[1] <= 1:
        return np.ascontiguousarray(frame[: size[1], : size[0]])
    share = min(size[0] / width, size[1] / height)
    small = cv2.resize(frame, (max(1, round(width * share)), max(1, round(height * share))))
    whole = np.zeros((size[1], size[0], 3), np.uint8)
    top, left = (size[1] - small.shape[0]) // 2, (size[0] - small.shape[1]) // 2
    whole[top : top + small.shape[0], left : left + small.shape[1]] = small
    return whole

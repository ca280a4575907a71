"""Reading pictures and films: only formats listed here are opened, and sizes are checked before decoding.

Every picture and every film that a person names goes through this file.  FFmpeg knows some three hundred formats, and
a few of them (playlists, concatenations) open further files or the network; only those in `FILMS` are opened.
"""

from __future__ import annotations

import os
from heapq import heappop, heappush
from pathlib import Path

import av
import cv2
import numpy as np

from flockbrush.behaviours.tomlfile import read_bytes
from flockbrush.engine import limits, picture_decoding
from flockbrush.engine.files import refused
from flockbrush.engine.picture_decoding import picture_size
from flockbrush.engine.problems import ProblemsError

FILMS = ("mov", "matroska", "avi", "mpegts", "mpeg", "m4v", "ogg", "asf", "flv", "gif")  # FFmpeg's names of formats
FILM_ENDINGS = "MP4, MOV, MKV, WebM, AVI, MPEG, OGG, WMV, FLV and GIF"
PICTURES = "PNG, JPEG, WebP and BMP"
BROKEN = 500  # packets of a film that cannot be decoded, one after the other: no more are tried


# pictures --------------------------------------------------------------------------------------


def read_picture(path, hint="", flags=cv2.IMREAD_COLOR) -> np.ndarray:
    """The picture in a file, as OpenCV decodes it: (h, w, 3) uint8 BGR unless the flags say otherwise.

    Parameters
    ----------
    hint : str
        Added to the error if it is not a picture: what would be right.

    Raises
    ------
    ProblemsError
        When there is no such file, it is no picture, or it has more pixels than `limits.PICTURE_PIXELS`.
    """
    return decoded(read_bytes(path, limits.PICTURE_BYTES), path, hint, flags)


def decoded(data: bytes, path, hint="", flags=cv2.IMREAD_COLOR) -> np.ndarray:
    """The picture in the bytes of a file; see `read_picture`."""
    size = picture_size(data)
    what = f"is not a readable picture (formats: {PICTURES}){hint and '; '}{hint}"
    if size is None:
        raise refused(path, what)
    width, height = size
    if width * height > limits.PICTURE_PIXELS:
        raise refused(path, f"has {width:,} x {height:,} pixels; the maximum is {limits.PICTURE_PIXELS.text}")
    picture = picture_decoding.decoded(data, flags)
    if picture is None:
        raise refused(path, what)
    return picture


def is_picture(path) -> bool:
    """Whether a file begins as a picture does that `read_picture` reads."""
    with open(path, "rb") as file:
        begin = file.read(16)
    return begin.startswith((b"\x89PNG\r\n\x1a\n", b"\xff\xd8", b"BM")) or begin[8:12] == b"WEBP"


# films -----------------------------------------------------------------------------------------


def open_container(path):
    """A film opened by PyAV, in one of the formats of `FILMS` alone, from this file alone; ProblemsError."""
    options = {
        "format_whitelist": ",".join(FILMS),
        "protocol_whitelist": "file",
        "max_pixels": str(int(limits.FILM_PIXELS)),
    }
    try:
        return av.open(f"file:{os.path.abspath(path)}", options=options)
    except (av.error.FFmpegError, OSError, ValueError):
        told = f"is not a readable video (formats: {FILM_ENDINGS}); it may be the wrong file, or incomplete"
        raise refused(path, told) from None


def check_file(path):
    """ProblemsError unless there is something to read in a file that should be a clip."""
    path = Path(path)
    if not path.is_file():
        raise refused(path, "is a folder, not a clip" if path.is_dir() else "there is no such file")
    if not os.access(path, os.R_OK):
        raise refused(path, "is not readable: permission denied")
    if not path.stat().st_size:
        raise refused(path, "is empty (0 bytes); copy it again")


def pictures_of(container, path):
    """The stream of a container that has its pictures, decoded with several threads.

    Raises
    ------
    ProblemsError
        When there is none, it is of a kind that FFmpeg does not know, or its frames are too large.
    """
    streams = container.streams
    if not streams.video:
        kinds = sorted({stream.type for stream in streams}) or ["nothing"]
        raise refused(path, f"has no video stream, only {' and '.join(kinds)}; it may be the wrong file")
    stream = streams.video[0]
    if stream.codec_context is None:
        raise refused(path, "has frames in a pixel format that cannot be read")
    check_frame_size(path, stream.width, stream.height)
    stream.thread_type = "AUTO"
    return stream


def check_frame_size(path, width, height):
    """ProblemsError when the frames of a film are larger than `limits.FILM_PIXELS`."""
    if width * height > limits.FILM_PIXELS:
        message = f"has frames of {width:,} x {height:,} pixels; the maximum is {limits.FILM_PIXELS.text}"
        raise refused(path, message)


def upright(picture, turned):
    """The picture upright, ``turned`` degrees counter-clockwise from how it is stored."""
    quarter = round(turned / 90) % 4
    return np.ascontiguousarray(np.rot90(picture, quarter)) if quarter else picture


class FilmReader:
    """The frames of a film in order, upright; frames that cannot be decoded are skipped, and keep their numbers.

    Attributes
    ----------
    number : int
        Of the frame that was read last, from 0 at the first that can be read; -1 before.
    gap : list of float
        Seconds of the frames between that and the one read before it that could not be decoded.
    lost : list of int
        Numbers of all those so far.
    turned : int
        Degrees counter-clockwise by which the frame that was read last was turned upright.
    size : (int, int)
        Width and height, pixels, upright.
    fps : float
        Frames a second that the film claims; 0 where it does not say.
    length : int
        Frames that the film claims to have, or about so many; 0 where it does not say.
    time : float
        Seconds of the frame that was read last; NaN where the film does not say.

    Raises
    ------
    ProblemsError
        When there is no such file, it is no film, or its frames are too large.
    """

    def __init__(self, path):
        check_file(path)
        self.path = Path(path)
        self._container = open_container(path)
        try:
            self._stream = pictures_of(self._container, path)
        except ProblemsError:
            self._container.close()
            raise
        rate = self._stream.guessed_rate or self._stream.average_rate
        self.fps, self.time = float(rate or 0), float("nan")
        self.size = self._stream.width, self._stream.height
        seconds = float(self._stream.duration * self._stream.time_base) if self._stream.duration else 0.0
        self.length = int(self._stream.frames or round(max(0.0, seconds * self.fps)))
        indexed = "mov" in self._container.format.name  # less what an edit has cut off
        self._claimed = len(self._stream.index_entries) if indexed else int(self._stream.frames)
        self.number, self.turned, self._count, self._missing = -1, 0, 0, 0
        self.gap: list[float] = []
        self.lost: list[int] = []
        self._frames = self._decoded()

    @property
    def damage(self) -> str:
        """What could not be read, of a film that was read to its end; "" of a whole one."""
        missing = len(self.lost) + self._missing
        if not missing:
            return "" if self._count else "has a video stream without a frame that can be read"
        can = f"{self._count} can" if self._count else "none can"
        first = f", the first that is lost is frame {self.lost[0]}" if self.lost else ""
        return f"the file says it has {self._count + missing} frames, {can} be read{first}: it is incomplete or damaged"

    def read(self) -> np.ndarray | None:
        """The next frame, (h, w, 3) uint8 BGR; None at the end."""
        frame = self._next()
        if frame is None:
            return None
        self.turned = int(getattr(frame, "rotation", 0) or 0) % 360
        picture = upright(frame.to_ndarray(format="bgr24"), self.turned)
        self.size = picture.shape[1], picture.shape[0]
        return picture

    def skip(self) -> bool:
        """Skip the next frame without decoding its picture; False at the end."""
        return self._next() is not None

    def seek(self, seconds):
        """Continue at a frame at or before this time, as near as the film allows; its `number` is not known."""
        try:
            self._container.seek(round(seconds / float(self._stream.time_base)), stream=self._stream)
        except (av.error.FFmpegError, OSError, ValueError, OverflowError):
            return
        self._frames = self._decoded()

    def close(self):
        """Close the file."""
        self._frames = iter(())
        self._container.close()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

    def _next(self):
        frame = next(self._frames, None)
        if frame is not None:
            stamp = frame.pts if frame.pts is not None else frame.dts
            self.time = float("nan") if stamp is None else float(stamp * self._stream.time_base)
        return frame

    def _decoded(self):
        """The frames from here on.

        Each packet has a frame.  A few kinds of film have packets without one: packets without frames count as lost
        frames only where the decoder has found a mistake before, or packets are missing at the end.
        """
        packets, waiting = self._container.demux(self._stream), []  # waiting: times of packets whose frames are to come
        broken, damaged, begun, taken, before = 0, False, False, 0, 0
        while broken < BROKEN:
            try:
                packet = next(packets, None)
                if packet is not None and (packet.size or packet.dts is not None):
                    taken += 1
                    if packet.pts is not None and not packet.is_discard:
                        heappush(waiting, packet.pts)
                frames = [] if packet is None else packet.decode()
            except (av.error.FFmpegError, ValueError):
                broken, damaged = broken + 1, True
                continue
            if packet is None:
                break
            for frame in frames:
                broken = 0
                check_frame_size(self.path, frame.width, frame.height)
                passed = []
                while waiting and frame.pts is not None and waiting[0] <= frame.pts:
                    passed.append(heappop(waiting))
                lost = [time for time in passed if time < frame.pts] if damaged else []
                before = before if begun else len(lost)  # of the first that can be read: they have no number
                self._pass(lost if begun else [])
                begun = True
                yield frame
        short = max(0, self._claimed - taken)
        self._missing = before + short + (len(waiting) if damaged or short else 0)

    def _pass(self, lost):
        """Count a frame and those before it that were lost, by their times."""
        self.gap = [float(time * self._stream.time_base) for time in lost]
        self.lost += range(self.number + 1, self.number + 1 + len(lost))
        self.number += 1 + len(lost)
        self._count += 1

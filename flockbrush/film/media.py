"""Reading pictures and films: only formats listed here are opened, and sizes are checked before decoding.

Every picture and every film that a person names goes through this file.  FFmpeg knows some three hundred formats, and
a few of them (playlists, concatenations) open further files or the network; only those in `FILMS` are opened.
"""

from __future__ import annotations

import os
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
    """A film opened by PyAV, in one of the formats of `FILMS` alone, from this file alone.

    Raises
    ------
    av.error.FFmpegError, OSError, ValueError
        When it cannot be opened.
    """
    options = {
        "format_whitelist": ",".join(FILMS),
        "protocol_whitelist": "file",
        "max_pixels": str(int(limits.FILM_PIXELS)),
    }
    return av.open(f"file:{os.path.abspath(path)}", options=options)


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
    """The frames of a film in order, upright; damaged frames are skipped.

    Attributes
    ----------
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
        self.path = Path(path)
        if not self.path.is_file():
            raise refused(path, "is a folder, not a clip" if self.path.is_dir() else "there is no such file")
        try:
            self._container = open_container(path)
        except (av.error.FFmpegError, OSError, ValueError):
            raise refused(path, f"is not a readable video (formats: {FILM_ENDINGS})") from None
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
        self._frames = self._decoded()

    def read(self) -> np.ndarray | None:
        """The next frame, (h, w, 3) uint8 BGR; None at the end."""
        frame = self._next()
        if frame is None:
            return None
        picture = upright(frame.to_ndarray(format="bgr24"), int(getattr(frame, "rotation", 0) or 0) % 360)
        self.size = picture.shape[1], picture.shape[0]
        return picture

    def skip(self) -> bool:
        """Skip the next frame without decoding its picture; False at the end."""
        return self._next() is not None

    def seek(self, seconds):
        """Continue at a frame at or before this time, as near as the film allows."""
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
        broken = 0
        packets = self._container.demux(self._stream)
        while broken < BROKEN:
            try:
                packet = next(packets, None)
                frames = [] if packet is None else packet.decode()
            except (av.error.FFmpegError, ValueError):
                broken += 1
                continue
            if packet is None:
                return
            for frame in frames:
                broken = 0
                check_frame_size(self.path, frame.width, frame.height)
                yield frame

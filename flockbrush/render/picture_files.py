"""Pictures and videos on disk: a file has its name only when it is complete."""

from __future__ import annotations

import platform
from fractions import Fraction
from pathlib import Path

import numpy as np

from flockbrush.engine.files import hold, write_bytes
from flockbrush.render.view_camera import checked_size

THREADS = 2  # of the encoder, whatever the machine has: the bytes depend on it
# with AVX-512 the lookahead of x264 reads memory that nobody has written, and no two films are the same
STEADY = {"x264-params": "asm=SSE4.2"} if platform.machine() in ("x86_64", "AMD64") else {}


def checked_frame(frame) -> np.ndarray:
    """The frame as a contiguous (h, w, 3) uint8 array; ValueError when it is none."""
    frame = np.asarray(frame)
    if frame.ndim != 3 or frame.shape[2] != 3 or frame.dtype != np.uint8:
        raise ValueError(f"a frame is a uint8 array of shape (height, width, 3), got {frame.dtype} {frame.shape}")
    return np.ascontiguousarray(frame)


def write_png(path, frame):
    """Write a picture (h, w, 3) uint8 as PNG, the same bytes for the same picture.

    Raises
    ------
    ValueError
        When the frame is not a picture.
    OSError
        When the file cannot be written; what was there before is still there.
    """
    write_bytes(Path(path), png_bytes(checked_frame(frame)))


def png_bytes(frame) -> bytes:
    """A picture (h, w, 3) or (h, w, 4) uint8 as PNG; opacity is the last channel."""
    import cv2

    turned = frame[:, :, ::-1] if frame.shape[2] == 3 else frame[:, :, (2, 1, 0, 3)]
    ok, data = cv2.imencode(".png", np.ascontiguousarray(turned), [cv2.IMWRITE_PNG_COMPRESSION, 4])
    if not ok:
        raise ValueError(f"a picture of {frame.shape[1]}x{frame.shape[0]} cannot be written as PNG")
    return data.tobytes()


class Video:
    """An H.264 video (MP4, yuv420p) that is written frame by frame; the same frames give the same bytes.

    ::

        with Video("herd.mp4", fps=30, size=(1280, 720)) as video:
            for frame in frames:
                video.write(frame)

    The file appears under its name when the block ends; an exception inside leaves no file, and what was there before
    is still there.  Nobody else can write it meanwhile.

    Parameters
    ----------
    fps : float
        Frames per second, 0.1 to 1000.
    size : (int, int)
        Width and height of the frames.  Odd sides are padded by a pixel, since the format halves its colours.
    quality : int
        Constant rate factor, 0 (exact) to 51; 18 is hard to tell from exact.
    """

    def __init__(self, path, fps=30, size=(1280, 720), quality=18):
        self.path, self.size = Path(path), checked_size(size)
        self.fps = Fraction(fps).limit_denominator(1001) if np.isfinite(fps) and 0.1 <= fps <= 1000 else None
        if self.fps is None:
            raise ValueError(f"{self.path}: a video has 0.1 to 1000 frames per second, got {fps}")
        if not 0 <= int(quality) <= 51:
            raise ValueError(f"{self.path}: quality is 0 to 51, got {quality}")
        self.quality, self.frames = int(quality), 0
        self._container = None

    def __enter__(self):
        import av

        self._work = hold(self.path)
        try:
            options = {"fflags": "+bitexact", "movflags": "+faststart"}
            self._container = av.open(str(self._work.new), "w", format="mp4", options=options)
            self._stream = self._open_stream(av)
        except BaseException:
            self._leave()
            raise
        return self

    def _open_stream(self, av):
        options = STEADY | {"preset": "veryfast", "crf": str(self.quality), "flags": "+bitexact"}
        options["threads"] = str(THREADS)
        stream = self._container.add_stream("libx264", rate=self.fps, options=options)
        stream.width, stream.height = (side + side % 2 for side in self.size)
        stream.pix_fmt = "yuv420p"
        context = stream.codec_context
        context.thread_count, context.time_base = THREADS, 1 / self.fps
        context.color_range, context.colorspace = 1, 1  # limited, BT.709
        context.color_primaries, context.color_trc = 1, 1
        return stream

    def write(self, frame):
        """Append a frame (h, w, 3) uint8."""
        import av

        if self._container is None:
            raise ValueError(f"{self.path}: the video is not open; write inside a with block")
        frame = checked_frame(frame)
        if frame.shape[1::-1] != self.size:
            got = f"{frame.shape[1]}x{frame.shape[0]}"
            raise ValueError(f"{self.path}: the video is {self.size[0]}x{self.size[1]}, got a frame of {got}")
        height, width = frame.shape[:2]
        if height % 2 or width % 2:
            frame = np.pad(frame, [(0, height % 2), (0, width % 2), (0, 0)], mode="edge")
        picture = av.VideoFrame.from_ndarray(frame, format="rgb24")
        picture = picture.reformat(format="yuv420p", dst_colorspace="ITU709", dst_color_range="MPEG")
        picture.pts, picture.time_base = self.frames, 1 / self.fps
        self._container.mux(self._stream.encode(picture))
        self.frames += 1

    def __exit__(self, kind, error, trace):
        try:
            if kind is None and not self.frames:
                raise ValueError(f"{self.path}: a video needs at least one frame")
            if kind is None:
                self._container.mux(self._stream.encode(None))
                self._container.close()
                self._container = None
                self._work.publish()
        finally:
            self._leave()
        return False

    def _leave(self):
        """Close and remove what is unfinished."""
        container, self._container = self._container, None
        try:
            if container is not None:
                container.close()
        except Exception:  # noqa: BLE001  an unfinished file may complain about being closed; it is thrown away
            pass
        finally:
            self._work.close()

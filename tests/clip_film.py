"""Small films with truth: numbered frames with a thing that moves, birds in the sky, and sound alone."""

from fractions import Fraction

import av
import cv2
import numpy as np

PLACES = [(80 + 3 * k % 90, 90 + 2 * (k % 20)) for k in range(256)]  # pixels of the thing in each frame
STARTS = [(40, 40), (40, 140), (60, 90)]  # pixels of the birds in frame 0
STEPS = [(5, 2), (5, -2), (6, 0)]  # pixels a frame


def numbered_film(path, frames, size=(192, 160), fps=30):
    """A film whose frames show their number in stripes of eight bits, and a square with a pattern that moves."""
    code = cv2.VideoWriter_fourcc(*("mp4v" if path.suffix == ".mp4" else "MJPG"))
    writer = cv2.VideoWriter(str(path), code, fps, size)
    pattern = np.kron(np.random.default_rng(3).integers(0, 2, (4, 4)), np.ones((6, 6))) * 255
    rough = np.random.default_rng(1).integers(90, 130, (size[1], size[0], 1)).astype(np.uint8)
    for k in range(frames):
        picture = np.repeat(rough, 3, axis=2)
        for bit in range(8):
            picture[8:32, 16 * bit : 16 * bit + 16] = 255 * (k >> bit & 1)
        x, y = PLACES[k]
        picture[y - 12 : y + 12, x - 12 : x + 12] = pattern[..., None]
        writer.write(picture)
    writer.release()
    return path


def birds_at(k, size=(320, 180)):
    """Three dark birds before a pale sky, straight ahead from `STARTS` by `STEPS`; the first two cross."""
    picture = np.full((size[1], size[0], 3), (225, 215, 205), np.uint8)
    for (x, y), (dx, dy) in zip(STARTS, STEPS, strict=True):
        cv2.ellipse(picture, (x + dx * k, y + dy * k), (5, 3), 0, 0, 360, (50, 45, 40), -1, cv2.LINE_AA)
    return picture


def bird_film(path, frames=40, size=(320, 180)):
    """The frames of `birds_at`."""
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"MJPG"), 30, size)
    for k in range(frames):
        writer.write(birds_at(k, size))
    writer.release()
    return path


def film(path, pictures, fps=10, at=None, **options):
    """An mp4 of these pictures, (h, w, 3) uint8 BGR; each lasts a frame, or begins ``at`` so many frames."""
    with av.open(str(path), "w", options={"movflags": "faststart"}) as out:
        stream = out.add_stream("libx264", rate=fps, options={"crf": "10", "preset": "ultrafast", "bf": "0"} | options)
        stream.height, stream.width, stream.pix_fmt = *pictures[0].shape[:2], "yuv420p"
        for k, picture in enumerate(pictures):
            frame = av.VideoFrame.from_ndarray(picture, format="bgr24")
            frame.pts, frame.time_base = k if at is None else at[k], Fraction(1, fps)
            out.mux(stream.encode(frame))
        out.mux(stream.encode(None))
    return path


def damaged(path, film, first, last=None):
    """A copy of a film in which these frames, both included, are zeros; without a last one it ends before the first."""
    data = bytearray(film.read_bytes())
    with av.open(str(film)) as container:
        places = [(packet.pos, packet.size) for packet in container.demux(video=0) if packet.size]
    for at, size in places[first : first + 1 if last is None else last + 1]:
        data[at : at + size] = bytes(size)
    path.write_bytes(data if last is not None else data[: places[first][0]])
    return path


def song(path):
    """A film that is sound alone."""
    with av.open(str(path), "w") as out:
        stream = out.add_stream("aac", rate=44100)
        stream.layout = "mono"
        silence = av.AudioFrame.from_ndarray(np.zeros((1, 4410), np.float32), format="fltp", layout="mono")
        silence.sample_rate, silence.pts = 44100, 0
        out.mux(stream.encode(silence))
        out.mux(stream.encode(None))

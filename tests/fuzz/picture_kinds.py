"""Pictures, films and files of fields."""

import struct
from functools import cached_property

import crafted
import mutations as m
import numpy as np
from kind import Kind


def changed_png(rng, data):
    """A PNG with one of its chunks changed, and right checksums."""
    chunks = crafted.png_chunks(data)
    at = rng.randrange(len(chunks))
    kind, content = chunks[at]
    how = rng.randrange(6)
    if how == 0:
        sides = [rng.choice([0, 1, 2, 24, 18, 53, 4000, 65535, 2**31 - 1, 2**32 - 1]) for _ in range(2)]
        modes = [rng.choice([0, 1, 2, 3, 4, 6, 8, 16, 255]) for _ in range(5)]
        chunks[0] = (
            b"IHDR",
            struct.pack(">IIBBBBB", *sides, *modes)
            if rng.random() < 0.5
            else (struct.pack(">II", *sides) + chunks[0][1][8:]),
        )
    elif how == 1:
        chunks = [(k, m.packed_again(rng, c, m.changed_bytes) if k == b"IDAT" else c) for k, c in chunks]
    elif how == 2:
        chunks.insert(
            at,
            (
                rng.choice([b"PLTE", b"tRNS", b"iCCP", b"zTXt", b"acTL", b"fcTL", b"IDAT", b"eXIf", b"IEND"]),
                rng.randbytes(20),
            ),
        )
    elif how == 3:
        del chunks[at]
    else:
        chunks[at] = kind, m.changed_bytes(rng, content)
    return crafted.png_of(chunks)


class Pictures(Kind):
    """Photographs and masks."""

    ending = ".png"

    @cached_property
    def sound(self):
        import cv2

        picture = np.full((80, 120, 3), 220, np.uint8)
        for k in range(5):
            cv2.ellipse(picture, (16 + 22 * k, 40), (4, 2), 0, 0, 360, (40, 40, 40), -1)
        return [cv2.imencode(ending, picture)[1].tobytes() for ending in (".png", ".jpg", ".webp", ".bmp")]

    def changed(self, rng, data):
        return changed_png(rng, data) if data[:4] == b"\x89PNG" else m.changed_bytes(rng, data, 8)

    def read(self, path):
        from flockbrush.film.birds_in_sky import mark
        from flockbrush.film.clip_reader import open_clip

        open_clip(path)
        mark([path])


class Films(Kind):
    """Films, their boxes changed where they stand."""

    ending, share = ".mp4", 0.7

    @cached_property
    def sound(self):
        from clip_film import film

        self.folder.mkdir(parents=True, exist_ok=True)
        pictures = [np.full((32, 48, 3), 200, np.uint8) for _ in range(8)]
        for k, picture in enumerate(pictures):
            picture[10:14, 4 + 3 * k : 9 + 3 * k] = 30
        found = []
        for name in ("a.mp4", "a.mkv", "a.avi"):
            film(self.folder / name, pictures)
            found.append((self.folder / name).read_bytes())
        return found

    def changed(self, rng, data):
        return m.changed_bytes(rng, data, 10)

    def read(self, path):
        from flockbrush.film.clip_frames import Film
        from flockbrush.film.clip_reader import open_clip

        film = Film(path)
        for k in (0, len(film) - 1, 3, 5, 4):
            film.frame(k)
        film.close()
        clip = open_clip(path)
        assert sum(1 for _ in clip.read()) <= 100_000


class FieldFiles(Kind):
    """Files of fields: zip archives of arrays, with right checksums."""

    ending, share = ".npz", 0.7
    changes = staticmethod(m.changed_archive)

    @cached_property
    def sound(self):
        from flockbrush.film.observations import Evidence, Fields

        self.folder.mkdir(parents=True, exist_ok=True)
        cells = 3, 4, 5
        grid = {name: np.ones(cells) for name in ("density", "speed_variance", "angular_variance", "speed")}
        made = Fields(
            fps=10.0, cell=1.0, origin=np.zeros(2), velocity=np.ones((*cells, 2)), seen=np.ones(cells, bool),
            obstacle=np.zeros(cells[1:], bool), region=np.zeros(cells[1:], np.uint8), count=np.ones(3),
            frames=np.arange(3), **grid,
        )  # fmt: skip
        evidence = Evidence("a.mp4", "0" * 64, 10.0, 20.0, "given", 0.2, made, picture=np.zeros((9, 9, 3), np.uint8))
        evidence.save(self.folder / "sound.npz")
        return [(self.folder / "sound.npz").read_bytes()]

    def read(self, path):
        from flockbrush.film.observations import Evidence

        Evidence.load(path)

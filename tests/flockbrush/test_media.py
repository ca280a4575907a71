"""Pictures and films: opened in the formats that are listed, and sized before they are decoded."""

import shutil
import struct
import time

import cv2
import numpy as np
import pytest
from clip_film import damaged, film
from crafted import plain_png, png_chunks, png_of
from flockbrush.engine import limits
from flockbrush.engine.problems import ProblemsError

from flockbrush.film.clip_frames import Film
from flockbrush.film.clip_reader import open_clip
from flockbrush.film.media import FilmReader, open_container, picture_size, read_picture
from flockbrush.film.observations import CannotObserve

PICTURE = np.random.default_rng(0).integers(0, 255, (37, 53, 3), np.uint8)


@pytest.fixture(scope="module")
def clip(tmp_path_factory):
    """A film of twelve frames of 64 x 48 pixels."""
    path = tmp_path_factory.mktemp("media") / "clip.mp4"
    film(path, [np.full((48, 64, 3), 10 * k, np.uint8) for k in range(12)])
    return path


# formats ---------------------------------------------------------------------------------------


def playlist(path, target):
    path.write_text(f"#EXTM3U\n#EXT-X-TARGETDURATION:10\n#EXTINF:10,\n{target}\n#EXT-X-ENDLIST\n")
    return path


def concatenation(path, target):
    path.write_text(f"ffconcat version 1.0\nfile {target.name}\n")
    return path


@pytest.mark.parametrize("name", ["list.m3u8", "list.mp4"])
@pytest.mark.parametrize("make", [playlist, concatenation])
@pytest.mark.parametrize(
    "words",
    [
        ("fields", "{clip}", "--out", "{folder}/x.npz"),
        ("track", "{clip}", "--out", "{folder}/x.csv"),
        ("formation", "detect", "{clip}", "-o", "{folder}/x.csv"),
        ("play", "--clip", "{clip}", "--frames", "1"),
    ],
    ids=lambda words: words[0],
)
def test_a_clip_never_opens_another_file(cli, clip, tmp_path, make, name, words):
    shutil.copy(clip, tmp_path / "other.mp4")
    listed = make(tmp_path / name, tmp_path / "other.mp4")
    done = cli(*(word.format(clip=listed, folder=tmp_path) for word in words))
    assert done.code == 1
    assert f"{listed}: is not a readable " in done.err
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted([name, "other.mp4"])


def test_only_listed_formats_are_opened(tmp_path, clip):
    with open_container(clip) as container:
        assert "mov" in container.format.name
    (tmp_path / "a.srt").write_text("1\n00:00:00,000 --> 00:00:01,000\nhello\n")
    with pytest.raises(ProblemsError, match="is not a readable video"):
        FilmReader(tmp_path / "a.srt")


@pytest.mark.parametrize("ending", ["tiff", "ppm", "hdr"])
def test_pictures_of_other_formats_are_refused_by_name(tmp_path, ending):
    path = tmp_path / f"a.{ending}"
    assert cv2.imwrite(str(path), PICTURE)
    with pytest.raises(ProblemsError, match=r"is not a readable picture \(formats: PNG, JPEG, WebP and BMP\)"):
        read_picture(path)


def test_a_reader_gives_what_opencv_gives(clip):
    film, reader = cv2.VideoCapture(str(clip)), FilmReader(clip)
    frames = [reader.read() for _ in range(12)]
    assert reader.read() is None
    assert (reader.size, reader.fps, reader.length) == ((64, 48), 10.0, 12)
    assert all(np.array_equal(frame, film.read()[1]) for frame in frames)
    reader.seek(0.5)
    assert np.array_equal(reader.read(), frames[round(10 * reader.time)])


# damage ----------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def keyed(tmp_path_factory):
    """As `clip`; each frame can be decoded without the others."""
    path = tmp_path_factory.mktemp("media") / "keyed.mp4"
    return film(path, [np.full((48, 64, 3), 10 * k, np.uint8) for k in range(12)], g="1")


def test_frames_after_damaged_ones_keep_their_numbers(keyed, tmp_path):
    hurt = damaged(tmp_path / "a.mp4", keyed, 4, 6)
    with FilmReader(hurt) as film:
        numbers = [film.number for _ in range(9) if film.skip()]
        assert numbers == [0, 1, 2, 3, 7, 8, 9, 10, 11] and film.lost == [4, 5, 6] and not film.skip()
        first = "the first that is lost is frame 4"
        assert film.damage == f"the file says it has 12 frames, 9 can be read, {first}: it is incomplete or damaged"
    shown = Film(hurt)
    order = [8, 3, 11, 5, 0, 7]
    grey = [shown.frame(k).mean() for k in order]
    assert np.allclose(grey, [10 * (4 if k == 5 else k) for k in order], atol=16) and len(shown) == 12
    assert [grey[n] for n in (0, 1, 2, 4, 5)] == [Film(keyed).frame(k).mean() for k in (8, 3, 11, 0, 7)]
    assert shown.lost == {4, 5, 6} and "9 can be read" in shown.notes[0]
    assert open_clip(hurt).notes[0] == "it is damaged after frame 3; the 8 later frames are ignored"


@pytest.mark.parametrize(("first", "can"), [(5, "5 can"), (0, "none can")])
def test_a_film_that_ends_too_early_says_how_much_is_there(keyed, tmp_path, first, can):
    hurt = damaged(tmp_path / "a.mp4", keyed, first)
    told = f"the file says it has 12 frames, {can} be read: it is incomplete or damaged"
    if first:
        assert Film(hurt).notes == [told] and open_clip(hurt).notes == [told]
    else:
        for opened in (Film, open_clip):
            with pytest.raises(ProblemsError if opened is Film else CannotObserve, match=told):
                opened(hurt)
    assert Film(keyed).notes == []


@pytest.mark.parametrize(("name", "text"), [("empty.mp4", ""), ("text.mp4", "hello"), ("gone.mp4", None)])
def test_all_commands_say_the_same_of_what_is_no_film(cli, tmp_path, name, text):
    if text is not None:
        (tmp_path / name).write_text(text)
    commands = ("track", "--out", tmp_path / "a.csv"), ("fields", "--out", tmp_path / "a.npz"), ("play", "--clip")
    told = {cli(*words, tmp_path / name).err for words in commands}
    assert len(told) == 1 and told.pop().startswith(f"{tmp_path / name}: ")


# sizes -----------------------------------------------------------------------------------------


def encoded(ending, *options):
    return cv2.imencode(ending, PICTURE, list(options))[1].tobytes()


def jpeg_with_much_before_its_size():
    plain, note = encoded(".jpg"), b"\xff\xe1" + struct.pack(">H", 60_000) + bytes(59_998)
    return plain[:2] + note * 30 + b"\xff\xff\xff" + plain[2:].removeprefix(b"\xff")


def extended_webp():
    simple = encoded(".webp", cv2.IMWRITE_WEBP_QUALITY, 80)
    size = (52).to_bytes(3, "little") + (36).to_bytes(3, "little")
    return (
        b"RIFF"
        + struct.pack("<I", len(simple) + 10)
        + b"WEBPVP8X"
        + struct.pack("<I", 10)
        + bytes(4)
        + size
        + simple[12:]
    )


@pytest.mark.parametrize(
    "data",
    [
        encoded(".png"),
        encoded(".jpg"),
        encoded(".jpg", cv2.IMWRITE_JPEG_PROGRESSIVE, 1),
        jpeg_with_much_before_its_size(),
        encoded(".webp", cv2.IMWRITE_WEBP_QUALITY, 80),
        encoded(".webp", cv2.IMWRITE_WEBP_QUALITY, 101),
        extended_webp(),
        encoded(".bmp"),
    ],
    ids=["png", "jpeg", "progressive", "long jpeg", "lossy webp", "lossless webp", "extended webp", "bmp"],
)
def test_a_size_is_known_before_decoding(data):
    assert cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR).shape[:2] == (37, 53)
    assert picture_size(data) == (53, 37)


@pytest.mark.parametrize("kept", range(0, 40, 3))
def test_a_beginning_without_a_size_has_none(kept):
    for data in (encoded(".png")[: min(kept, 23)], encoded(".jpg")[:kept], encoded(".bmp")[: min(kept, 24)]):
        assert picture_size(data) is None


@pytest.mark.parametrize(("width", "height"), [(65535, 65535), (16384, 16384), (limits.PICTURE_PIXELS + 1, 1)])
@pytest.mark.parametrize(
    "words",
    [
        ("formation", "detect", "{png}", "-o", "{folder}/x.csv"),
        ("fields", "{png}", "--out", "{folder}/x.npz"),
        ("fields", "{clip}", "--out", "{folder}/x.npz", "--obstacles", "{png}"),
    ],
    ids=["detect", "photograph", "mask"],
)
def test_a_picture_that_claims_too_many_pixels_is_refused_by_its_size(cli, clip, tmp_path, width, height, words):
    (tmp_path / "large.png").write_bytes(plain_png(width, height, lines=1))
    began = time.monotonic()
    done = cli(*(word.format(png=tmp_path / "large.png", clip=clip, folder=tmp_path) for word in words))
    assert done.code == 1
    assert f"has {width:,} x {height:,} pixels; the maximum is 51,000,000 pixels" in done.err
    assert time.monotonic() - began < 30


def test_a_picture_that_is_damaged_behind_its_size_is_refused(tmp_path):
    chunks = png_chunks(encoded(".png"))
    (tmp_path / "a.png").write_bytes(png_of([chunks[0], (b"IDAT", b"nothing"), chunks[-1]]))
    with pytest.raises(ProblemsError, match="is not a readable picture"):
        read_picture(tmp_path / "a.png")


def larger(path, clip, wide, high):
    """The film with other sizes in its description of the frames."""
    data = clip.read_bytes()
    at = data.index(b"avc1", data.index(b"stsd")) + 28
    assert struct.unpack(">HH", data[at : at + 4]) == (64, 48)
    path.write_bytes(data[:at] + struct.pack(">HH", wide, high) + data[at + 4 :])
    return path


def test_a_film_that_claims_too_large_frames_is_refused(monkeypatch, clip):
    monkeypatch.setattr("flockbrush.engine.limits.FILM_PIXELS", limits.Limit(1000, "pixels", "a frame"))
    with pytest.raises(ProblemsError, match=r"clip.mp4: (has frames of 64 x 48|is no film)"):
        FilmReader(clip)


def test_a_damaged_description_of_frames_ends_in_frames_or_a_sentence(tmp_path, clip):
    for wide, high in ((65535, 65535), (0, 0), (1, 1), (64, 65535)):
        try:
            with FilmReader(larger(tmp_path / "a.mp4", clip, wide, high)) as reader:
                while (frame := reader.read()) is not None:
                    assert frame.shape == (48, 64, 3)
        except ProblemsError as error:
            assert "a.mp4: " in str(error)

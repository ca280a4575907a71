"""Clips are read as they were meant, and those that cannot be used are refused with what was seen and what to try."""

import av
import cv2
import numpy as np
import pytest
from clip_film import song

from flockbrush.film.clip_reader import WORK, cuts, evenly, open_clip
from flockbrush.film.observations import CannotObserve

SIZE = (160, 120)


def meadow(seed=0, shift=0, tint=(60, 110, 80)):
    """A picture of grass, moved to the left."""
    grass = np.random.default_rng(seed).normal(size=(SIZE[1], SIZE[0] + 200, 1)).astype(np.float32)
    grass = cv2.GaussianBlur(grass, (0, 0), 2.0)[..., None] * 60 + np.array(tint, np.float32)
    return np.clip(grass[:, shift : shift + SIZE[0]], 0, 255).astype(np.uint8)


def film(path, pictures, fps=10, turned=0):
    """Write an mp4."""
    h, w = pictures[0].shape[:2]
    with av.open(str(path), "w") as out:
        stream = out.add_stream("libx264", rate=fps, options={"crf": "12", "preset": "ultrafast", "bf": "0"})
        stream.width, stream.height, stream.pix_fmt = w, h, "yuv420p"
        if turned:
            stream.set_display_rotation(turned)
        for picture in pictures:
            out.mux(stream.encode(av.VideoFrame.from_ndarray(picture, format="bgr24")))
        out.mux(stream.encode(None))
    return path


def refusal(path, **options):
    """What is said of a clip that cannot be used."""
    with pytest.raises(CannotObserve) as told:
        open_clip(path, **options)
    return str(told.value)


def test_a_film_is_read_frame_by_frame(tmp_path):
    clip = open_clip(film(tmp_path / "a.mp4", [meadow(shift=2 * k) for k in range(8)]))
    assert len(clip) == 8 and clip.fps == pytest.approx(10) and clip.size == SIZE and not clip.still
    shown = dict(clip.read([2, 5]))
    assert sorted(shown) == [2, 5]
    assert np.abs(shown[5].astype(int) - meadow(shift=10)).mean() < 6


def test_frames_are_chosen_by_their_numbers_both_included(tmp_path):
    path = film(tmp_path / "a.mp4", [meadow(shift=2 * k) for k in range(8)])
    assert open_clip(path, (2, 5)).numbers.tolist() == [2, 3, 4, 5]
    assert not [
        note for clip in (open_clip(path), open_clip(path, (2, 5))) for note in clip.notes if "not there" in note
    ]
    assert "has frames 0 to 7; 8 to 20 are not there" in open_clip(path, (2, 20)).notes
    assert "has frames 0 to 7, but none in 20:30" in refusal(path, frames=(20, 30))
    assert "numbered from 0, and the first must not be after the last" in refusal(path, frames=(5, 2))


@pytest.mark.parametrize("turned", [90, 180, 270])
def test_a_film_taken_with_the_camera_on_its_side_is_turned_upright_as_opencv_does(tmp_path, turned):
    path = film(tmp_path / "a.mp4", [meadow(shift=2 * k) for k in range(3)], turned=turned)
    clip = open_clip(path)
    _, other = cv2.VideoCapture(str(path)).read()
    mine = dict(clip.read([0]))[0]
    assert mine.shape == other.shape and np.abs(mine.astype(int) - other).mean() < 2
    assert any(f"rotated by {turned} degrees" in note for note in clip.notes)


def test_a_large_film_is_made_smaller_and_says_so(tmp_path):
    big = [cv2.resize(meadow(shift=2 * k), (2560, 1440)) for k in range(2)]
    clip = open_clip(film(tmp_path / "a.mp4", big))
    assert clip.size == (WORK, 720) and clip.full == (2560, 1440) and clip.scale == 0.5
    assert any("2560 x 1440" in note for note in clip.notes)


def test_a_photograph_and_a_film_of_one_frame_stand_still(tmp_path):
    cv2.imwrite(str(tmp_path / "a.png"), meadow())
    photo = open_clip(tmp_path / "a.png")
    assert photo.still and len(photo) == 1 and "photograph" in photo.notes[0]
    single = open_clip(film(tmp_path / "a.mp4", [meadow()]))
    assert single.still and any("only one frame" in note for note in single.notes)
    assert "leave out --frames" in refusal(tmp_path / "a.png", frames=(3, 5))


def test_what_is_no_film_is_refused_by_name(tmp_path):
    (tmp_path / "empty.mp4").write_bytes(b"")
    (tmp_path / "text.mp4").write_text("not a film at all " * 50)
    assert "there is no such file" in refusal(tmp_path / "none.mp4")
    assert "is a folder" in refusal(tmp_path)
    assert "is empty" in refusal(tmp_path / "empty.mp4")
    assert "is not a readable video (formats: " in refusal(tmp_path / "text.mp4")


def test_a_film_without_pictures_says_what_it_has(tmp_path):
    song(tmp_path / "song.mp4")
    assert "has no video stream, only audio" in refusal(tmp_path / "song.mp4")


def test_a_film_cut_off_in_the_middle_keeps_what_can_be_read(tmp_path):
    path = tmp_path / "a.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"MJPG"), 10, SIZE)
    for k in range(12):
        writer.write(meadow(shift=2 * k))
    writer.release()
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) * 2 // 3])
    assert 3 < len(open_clip(path)) < 12


def test_a_cut_is_told_with_the_frames_to_use_instead(tmp_path):
    shots = [meadow(shift=2 * k) for k in range(9)] + [meadow(7, 2 * k, (200, 180, 160)) for k in range(6)]
    said = refusal(film(tmp_path / "a.mp4", shots))
    assert "a cut between frames 8 and 9" in said and "--frames 0:8 or --frames 9:14" in said
    assert len(open_clip(tmp_path / "a.mp4", (0, 8))) == 9


def test_a_herd_that_walks_in_is_no_cut():
    change = np.full(30, 2.0)
    apart = np.full(30, 0.05)
    apart[15] = 0.2
    assert cuts(apart, change).tolist() == []
    apart[15], change[15] = 0.7, 30.0
    assert cuts(apart, change).tolist() == [15]


def test_uneven_times_become_an_even_row():
    times = np.array([0, 1, 2, 3, 7, 8, 9, 10, 14, 15, 16, 17, 21]) / 10.0
    numbers, chosen, fps, notes = evenly(np.arange(13), times, np.zeros(13, bool))
    assert fps == pytest.approx(2.5) and np.diff(chosen).min() > 0.2
    assert "not evenly spaced in time, 0.1 to 0.4 s" in notes[0]
    assert (times[numbers] == chosen).all()


def test_repeated_frames_are_left_out():
    repeats = np.arange(30) % 6 == 5
    numbers, times, fps, notes = evenly(np.arange(30), np.arange(30) / 30, repeats)
    assert len(numbers) == 25 and fps == pytest.approx(25, rel=0.05)
    assert "5 of 30 frames are identical to the frame before" in notes[0]
    np.testing.assert_allclose(np.diff(times), np.diff(times)[0])

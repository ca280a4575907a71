"""Pictures and videos on disk: what goes in comes out, the same bytes twice, and never half a file."""

import subprocess
import sys

import cv2
import numpy as np
import pytest

from flockbrush.render.picture_files import Video, write_png


def scene(count=12, size=(96, 64)):
    """Frames of a green ball that rolls over a grey field."""
    x, y = np.meshgrid(np.arange(size[0]), np.arange(size[1]))
    for k in range(count):
        frame = np.full((size[1], size[0], 3), 120, np.uint8)
        frame[np.hypot(x - 15 - 5 * k, y - 30) < 12] = (30, 200, 60)
        yield frame


def written(path, frames, fps=30, size=(96, 64)):
    with Video(path, fps, size) as video:
        for frame in frames:
            video.write(frame)
    return path


def frames_of(path):
    import av

    with av.open(str(path)) as container:
        return [frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)]


def test_a_video_comes_back_as_it_went_in(tmp_path):
    path = written(tmp_path / "herd.mp4", scene())
    back = frames_of(path)
    assert len(back) == 12
    for before, after in zip(scene(), back, strict=True):
        assert np.abs(before.astype(int) - after).mean() < 4
        field = after[50:, :10].reshape(-1, 3)  # far from the ball: half-sized colours do not run here
        assert field.mean(axis=0) == pytest.approx((120, 120, 120), abs=3)
        ball = (before == (30, 200, 60)).all(axis=2)
        assert np.median(after[ball], axis=0) == pytest.approx((30, 200, 60), abs=6)


def test_opencv_reads_it_too(tmp_path):
    video = cv2.VideoCapture(str(written(tmp_path / "herd.mp4", scene(), fps=25)))
    assert video.get(cv2.CAP_PROP_FPS) == pytest.approx(25)
    assert int(video.get(cv2.CAP_PROP_FRAME_COUNT)) == 12


def test_a_film_does_not_hang_on_what_memory_held_before(tmp_path):
    """As random as memory is once others used it; long enough for the encoder to look ahead."""
    rng = np.random.default_rng(0)
    ground = cv2.GaussianBlur(rng.integers(0, 255, (480, 480, 3), np.uint8), (0, 0), 3)
    ground = np.clip(3.0 * (ground.astype(float) - 128) + 128, 0, 255).astype(np.uint8)
    films = []
    for name in ("one.mp4", "two.mp4", "three.mp4"):
        used = [rng.integers(0, 255, int(rng.integers(1_000, 3_000_000)), np.uint8) for _ in range(40)]
        del used[::2]
        with Video(tmp_path / name, 25, (480, 480)) as film:
            for k in range(30):
                turned = cv2.warpAffine(ground, cv2.getRotationMatrix2D((240, 240), 0.6 * k, 1.0), (480, 480))
                film.write(turned)
        films.append((tmp_path / name).read_bytes())
    assert films[0] == films[1] == films[2]


def test_the_same_frames_give_the_same_bytes_in_another_process(tmp_path):
    here = written(tmp_path / "here.mp4", scene())
    code = (
        "import sys; sys.path[:0] = sys.argv[2:]\n"
        "from test_draw_files import scene, written\n"
        "written(sys.argv[1], scene())"
    )
    folder = __file__.rsplit("/", 1)[0] if "/" in __file__ else "."
    there = tmp_path / "there.mp4"
    subprocess.run([sys.executable, "-c", code, there, folder, folder + "/../.."], check=True)
    assert here.read_bytes() == there.read_bytes()


def test_odd_sizes_are_padded_by_a_pixel(tmp_path):
    path = written(tmp_path / "odd.mp4", scene(3, (95, 63)), size=(95, 63))
    assert frames_of(path)[0].shape == (64, 96, 3)


@pytest.mark.parametrize("fps", [1, 29.97, 32, 60, 0.5])
def test_a_video_lasts_as_long_as_its_frames(tmp_path, fps):
    import av

    with av.open(str(written(tmp_path / "herd.mp4", scene(), fps))) as container:
        assert container.duration / 1e6 == pytest.approx(12 / fps, rel=0.01)


def test_an_interrupted_run_leaves_no_file_and_keeps_the_old_one(tmp_path):
    path = tmp_path / "herd.mp4"
    path.write_bytes(b"the one before")
    with pytest.raises(KeyboardInterrupt), Video(path, 30, (96, 64)) as video:
        video.write(next(scene()))
        raise KeyboardInterrupt
    assert path.read_bytes() == b"the one before"
    assert list(tmp_path.iterdir()) == [path]


def test_a_video_of_nothing_is_refused(tmp_path):
    with pytest.raises(ValueError, match="at least one frame"), Video(tmp_path / "herd.mp4", 30, (96, 64)):
        pass
    assert not list(tmp_path.iterdir())


def test_a_frame_of_another_size_is_refused_and_nothing_is_left(tmp_path):
    with (
        pytest.raises(ValueError, match="96x64, got a frame of 10x10"),
        Video(tmp_path / "h.mp4", 30, (96, 64)) as video,
    ):
        video.write(np.zeros((10, 10, 3), np.uint8))
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("frame", [np.zeros((64, 96)), np.zeros((64, 96, 3)), np.zeros((64, 96, 4), np.uint8)])
def test_what_is_no_frame_is_refused(tmp_path, frame):
    with pytest.raises(ValueError, match="uint8 array of shape"):
        written(tmp_path / "herd.mp4", [frame])
    with pytest.raises(ValueError, match="uint8 array of shape"):
        write_png(tmp_path / "herd.png", frame)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("fps", [0, -1, float("nan"), float("inf"), 1e9])
def test_rates_nobody_can_show_are_refused(tmp_path, fps):
    with pytest.raises(ValueError, match="frames per second"):
        Video(tmp_path / "herd.mp4", fps, (96, 64))


def test_a_folder_that_is_not_there_is_named(tmp_path):
    with pytest.raises(OSError, match="there is no folder"):
        written(tmp_path / "nowhere" / "herd.mp4", scene())
    with pytest.raises(OSError, match="there is no folder"):
        write_png(tmp_path / "nowhere" / "herd.png", next(scene()))


def test_writing_outside_the_block_is_refused(tmp_path):
    with pytest.raises(ValueError, match="with block"):
        Video(tmp_path / "herd.mp4").write(next(scene()))


def test_a_picture_comes_back_exactly(tmp_path):
    frame = next(scene())
    write_png(tmp_path / "herd.png", frame)
    assert np.array_equal(cv2.imread(str(tmp_path / "herd.png"))[:, :, ::-1], frame)
    assert [path.name for path in tmp_path.iterdir()] == ["herd.png"]


def test_importing_the_painter_does_not_load_pygame_or_video():
    code = "import sys, flockbrush.render; print([m for m in ('pygame', 'av', 'torch') if m in sys.modules])"
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=_root())
    assert said.stdout.strip() == "[]"


def _root():
    from pathlib import Path

    return Path(__file__).parents[2]

"""Films and picture sequences: clean, transparent, with a camera that moves; and the same camera in scenes."""

import json
import shutil
import subprocess

import cv2
import numpy as np
import pytest
from flockbrush.components import Position
from flockbrush.engine.problems import ProblemsError
from test_gltf import Scene

from flockbrush.output.picture_exporter import matte
from flockbrush.output.pictures import painter_of
from flockbrush.render.camera_path import read_camera
from flockbrush.runs.run import start

ORBIT = """
[[keys]]
time = 0
target = [20, 15, 0]
distance = 50
azimuth = 90
elevation = 40
[[keys]]
time = 1
target = [10, 15, 0]
distance = 20
azimuth = 45
elevation = 15
fov = 50
"""


@pytest.fixture
def shot(tmp_path):
    path = tmp_path / "shot.camera.toml"
    path.write_text('schema = "flockbrush.camera/1"\n' + ORBIT)
    return path


def names(folder):
    return sorted(path.name for path in folder.glob("*.png"))


def test_a_sequence_has_a_numbered_picture_for_every_frame(cli, recording, tmp_path):
    done = cli("export", recording, "--to", tmp_path / "s.####.png", "--fps", 4, "--size", "320x240")
    assert done.code == 0, done.err
    assert names(tmp_path) == [f"s.{k:04d}.png" for k in range(6)]
    pictures = [cv2.imread(str(tmp_path / name)).astype(int) for name in names(tmp_path)]
    assert {picture.shape for picture in pictures} == {(240, 320, 3)}
    assert (np.abs(pictures[0] - pictures[-1]).max(axis=2) > 40).sum() > 100
    assert [path for path in tmp_path.iterdir() if path.name.startswith(".")] == []


def test_a_sequence_does_not_mix_with_another(cli, recording, tmp_path):
    (tmp_path / "s.0000.png").write_bytes(b"mine")
    done = cli("export", recording, "--to", tmp_path / "s.####.png", "--fps", 4)
    assert done.code == 1 and "s.0000.png already exists" in done.err
    assert (tmp_path / "s.0000.png").read_bytes() == b"mine" and names(tmp_path) == ["s.0000.png"]
    (tmp_path / "s.0000.png").rename(tmp_path / "s.0007.png")  # also one that comes later
    done = cli("export", recording, "--to", tmp_path / "s.####.png", "--fps", 4)
    assert done.code == 1 and "s.0007.png already exists" in done.err and names(tmp_path) == ["s.0007.png"]


def test_a_picture_whose_number_is_taken_meanwhile_is_not_overwritten(recording, level, tmp_path):
    from flockbrush.engine.files import NotWritten

    from flockbrush.output.export import Exports

    simulation = start(level)
    with pytest.raises((NotWritten, FileExistsError)):
        with Exports([tmp_path / "s.####.png"], simulation, 4, size=(64, 48)) as exports:
            exports.take()
            (tmp_path / "s.0000.png").write_bytes(b"mine")
    assert (tmp_path / "s.0000.png").read_bytes() == b"mine"
    assert [path.name for path in tmp_path.iterdir()] == ["s.0000.png"]


def test_frames_of_a_program_that_was_killed_are_cleared(level, tmp_path):
    from flockbrush.engine.files import clear_leftovers

    from flockbrush.output.formats.picture_sequence import PngSequence
    from flockbrush.runs.snapshots import moment_of

    simulation = start(level)
    made = PngSequence(tmp_path / "s.####.png", simulation, 4, size=(64, 48))
    made.open()
    made.take(moment_of(simulation))
    assert any(tmp_path.rglob("*.png"))
    made._work._lock.file.close()  # as when the program is no more
    clear_leftovers(tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_a_clean_picture_has_no_words_guides_and_trails(cli, recording, tmp_path):
    for name, more in (("a.png", ()), ("b.png", ("--no-overlays",))):
        assert cli("export", recording, "--to", tmp_path / name, "--fps", 8, "--size", "800x600", *more).code == 0
    full, clean = (cv2.imread(str(tmp_path / name)).astype(int) for name in ("a.png", "b.png"))
    ink = [(picture[:24].max(axis=2) < 110).sum() for picture in (full, clean)]
    assert ink[0] > 50 and ink[1] == 0  # the title
    scale = (800 - 8) / 40  # pixels a metre: a pen of 40 x 30 m fills it
    guide = clean[round(300 + 5 * scale) - 6 : round(300 + 5 * scale) + 6, 390:410]  # at (20, 10) m
    violet = np.array((200, 80, 120))  # roughly, blue first
    assert np.abs(guide - violet).sum(axis=2).min() > 100
    assert guide.reshape(-1, 3).std(axis=0).max() < 12  # grass alone


def test_transparent_pictures_over_black_and_white_are_those_that_were_drawn():
    rng = np.random.default_rng(3)
    colour, alpha = rng.uniform(0, 255, (20, 30, 3)), rng.uniform(0.2, 1, (20, 30, 1))
    told = matte(colour * alpha, colour * alpha + 255 * (1 - alpha)).astype(float)
    assert np.abs(told[..., :3] - colour).max() < 4 and np.abs(told[..., 3:] / 255 - alpha).max() < 0.01
    nothing = matte(np.zeros((2, 2, 3)), np.full((2, 2, 3), 255.0))
    assert not nothing.any()


@pytest.mark.parametrize("view", ["plan", "space"])
def test_alpha_is_opaque_on_animals_and_clear_elsewhere(cli, level, tmp_path, view):
    out = tmp_path / "s.####.png"
    done = cli("run", level, "--ticks", 1, "--export", out, "--fps", 16, "--alpha", "--view", view, "--size", "640x480")
    assert done.code == 0, done.err
    picture = cv2.imread(str(tmp_path / "s.0000.png"), cv2.IMREAD_UNCHANGED)
    assert picture.shape == (480, 640, 4)
    assert picture[..., 3].max() == 255 and 0.001 < (picture[..., 3] > 0).mean() < 0.7
    assert picture[0, 0, 3] == 0
    if view == "plan":
        simulation = start(level)
        camera = painter_of(simulation, (640, 480), clean=True).camera
        at = camera.pixels(simulation.agents[Position.xyz][:, :2]).astype(int)
        assert (picture[at[:, 1], at[:, 0], 3] > 200).all()  # everybody is there


def test_alpha_of_a_sequence_leaves_other_pictures_as_they_are(level, tmp_path):
    from flockbrush.output.export import Exports

    for names, alpha in ((["a.png"], False), (["b.png", "s.####.png"], True)):
        with Exports([tmp_path / name for name in names], start(level), 4, size=(320, 240), alpha=alpha) as exports:
            exports.take()
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()
    assert cv2.imread(str(tmp_path / "s.0000.png"), cv2.IMREAD_UNCHANGED).shape[2] == 4


def test_alpha_is_for_pictures_that_can_have_it(cli, recording, tmp_path):
    done = cli("export", recording, "--to", tmp_path / "a.mp4", "--alpha")
    assert done.code == 2 and "--alpha" in done.err


def test_a_camera_goes_through_its_keys_and_stands_before_and_after(shot):
    path = read_camera(shot)
    first, last, middle = path.at(0), path.at(1), path.at(0.5)
    assert np.allclose(first.eye, (20, 15 - 50 * np.cos(np.radians(40)), 50 * np.sin(np.radians(40))))
    assert np.allclose(last.target, (10, 15, 0)) and np.isclose(np.degrees(last.fov), 50)
    assert path.at(-5) == first and path.at(99) == last
    assert 20 < middle.distance < 50 and 45 < np.degrees(middle.azimuth) < 90


def test_an_eye_and_an_orbit_are_two_words_for_one_camera(tmp_path, shot):
    path = read_camera(shot)
    eyes = tmp_path / "eyes.camera.toml"
    keys = "".join(
        f"[[keys]]\ntime = {t}\ntarget = {list(path.at(t).target)}\neye = {path.at(t).eye.tolist()}\n"
        f"fov = {np.degrees(path.at(t).fov)}\n"
        for t in (0, 1)
    )
    eyes.write_text(f'ease = "linear"\n{keys}')
    other = read_camera(eyes)
    for time in (0, 1):
        assert np.allclose(other.at(time).eye, path.at(time).eye)
        assert np.allclose(other.at(time).axes, path.at(time).axes)
    half = other.at(0.5)
    assert np.allclose(half.eye, (path.at(0).eye + path.at(1).eye) / 2)


@pytest.mark.parametrize("ease", ["smooth", "linear", "hold"])
def test_a_smooth_camera_does_not_jump_or_overshoot(tmp_path, ease):
    text = "".join(
        f"[[keys]]\ntime = {t}\ntarget = [{x}, 0, 0]\ndistance = 10\nazimuth = 0\nelevation = 20\n"
        for t, x in ((0, 0), (1, 10), (2, 10), (3, 0))
    )
    (tmp_path / "a.camera.toml").write_text(f'ease = "{ease}"\n{text}')
    path = read_camera(tmp_path / "a.camera.toml")
    x = np.array([path.at(t).target[0] for t in np.linspace(0, 3, 301)])
    assert x.min() >= -1e-9 and x.max() <= 10 + 1e-9
    assert x[150] == pytest.approx(10)  # it stands between two keys at one place
    assert (np.abs(np.diff(x)).max() < 0.2) == (ease != "hold")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "at least one [[keys]]"),
        ("keys = 3", "at least one [[keys]]"),
        (ORBIT.replace("time = 1", "time = 0"), "more than that of the key before"),
        (ORBIT.replace("azimuth", "azimut"), "did you mean 'azimuth'"),
        (ORBIT.replace("elevation = 15", "elevation = 95"), "from -80 to 90"),
        (ORBIT.replace("[20, 15, 0]", "[20, 15]"), "three numbers"),
        (ORBIT.replace("distance = 20\nazimuth = 45\nelevation = 15", "eye = [1, 2, 3]"), "either all keys"),
        ("[[keys]]\ntime = 0\ntarget = [1, 1, 1]\neye = [1, 1, 1]", "0.1 m from the target"),
        ('ease = "swing"\n' + ORBIT, "smooth, linear, hold"),
        (ORBIT.replace("fov = 50", "fov = nan"), "fov"),
        ('schema = "flockbrush.camera/2"\n' + ORBIT, "is of a newer Flockbrush"),
        ('schema = "flockbrush.lens/1"\n' + ORBIT, "must be 'flockbrush.camera/1'"),
    ],
)
def test_what_is_wrong_with_a_camera_is_said_with_its_line(tmp_path, text, said):
    path = tmp_path / "bad.camera.toml"
    path.write_text(text)
    with pytest.raises(ProblemsError, match="bad.camera.toml:[0-9]+: .*") as error:
        read_camera(path)
    assert said in str(error.value)


@pytest.mark.parametrize("text", [None, "keys = 3"])
def test_a_bad_camera_is_refused_before_the_run(cli, recording, tmp_path, text):
    path = tmp_path / "shot.camera.toml"
    if text:
        path.write_text(text)
    for kind in ("mp4", "glb", "usdc", "####.png"):
        done = cli("export", recording, "--to", tmp_path / f"a.{kind}", "--camera", path)
        assert done.code == 1 and "shot.camera.toml" in done.err
    assert list(tmp_path.glob("a.*")) == []


@pytest.mark.parametrize("size", ["big", "1920", "4x4", "99999x20", "-3x9"])
def test_a_size_that_is_none_is_refused(cli, recording, tmp_path, size):
    done = cli("export", recording, "--to", tmp_path / "a.png", f"--size={size}")
    assert done.code == 1 and "--size must be WIDTHxHEIGHT" in done.err


def test_scenes_have_the_camera_of_the_film(cli, recording, tmp_path, shot):
    usd = pytest.importorskip("pxr.Usd")
    from pxr import UsdGeom

    paths = tmp_path / "a.usdc", tmp_path / "a.glb"
    done = cli("export", recording, "--to", paths[0], "--to", paths[1], "--fps", 8, "--camera", shot)
    assert done.code == 0, done.err
    stage, scene, path = usd.Stage.Open(str(paths[0])), Scene(paths[1]), read_camera(shot)
    camera = UsdGeom.Camera(stage.GetPrimAtPath("/World/Camera"))
    for frame in (0, 3, 8):
        view = path.at(frame / 8)
        told = camera.GetCamera(frame)
        assert np.allclose(told.frustum.position, view.eye, atol=1e-4)
        assert np.allclose(told.frustum.ComputeViewDirection(), view.axes[2], atol=1e-5)
        assert told.GetFieldOfView(told.FOVVertical) == pytest.approx(np.degrees(view.fov), abs=1e-3)
        matrix = scene.matrix(scene.node("Camera"), frame / 8)
        x, y, z = view.eye
        assert np.allclose(matrix[:3, 3], (x, z, -y), atol=1e-4)
        x, y, z = -view.axes[2]
        assert np.allclose(matrix[:3, 2], (x, z, -y), atol=1e-4)
    from test_usd import complaints

    assert [error.GetMessage() for error in complaints(paths[0])] == []


def test_a_film_shows_what_its_camera_sees(cli, recording, tmp_path, shot):
    """The stone is where the camera's projection says, in the first and the last frame."""
    done = cli("export", recording, "--to", tmp_path / "s.####.png", "--fps", 4, "--camera", shot, "--no-overlays")
    assert done.code == 0, done.err
    path = read_camera(shot)
    for frame in (0, 3):
        picture = cv2.imread(str(tmp_path / f"s.{frame:04d}.png")).astype(int)
        view = path.at(frame / 4, picture.shape[1::-1])
        (x, y), (u, v) = view.project(np.array([[24.0, 15.0, 1.6], [18.0, 25.0, 0.0]]))[0]
        on, off = picture[round(y), round(x)], picture[round(v), round(u)]
        assert np.ptp(on) < 30  # grey stone
        assert off[1] > off[0] + 10  # grass


@pytest.mark.tools
@pytest.mark.skipif(shutil.which("ffprobe") is None, reason="ffprobe is not installed (apt-get install ffmpeg)")
def test_ffprobe_finds_a_clean_film_of_the_size_that_was_asked_for(cli, recording, tmp_path):
    film = tmp_path / "a.mp4"
    assert cli("export", recording, "--to", film, "--fps", 8, "--size", "640x360", "--no-overlays").code == 0
    asked = ["ffprobe", "-v", "error", "-count_frames", "-show_streams", "-of", "json", str(film)]
    stream = json.loads(subprocess.run(asked, capture_output=True, text=True, timeout=60, check=True).stdout)[
        "streams"
    ][0]
    told = {name: stream[name] for name in ("codec_name", "width", "height", "r_frame_rate", "nb_read_frames")}
    assert told == {
        "codec_name": "h264", "width": 640, "height": 360, "r_frame_rate": "8/1", "nb_read_frames": "11",
    }  # fmt: skip
    assert cli("export", recording, "--to", tmp_path / "s.####.png", "--fps", 8, "--alpha", "--size", "64x48").code == 0
    asked = ["ffprobe", "-v", "error", "-show_streams", "-of", "json", str(tmp_path / "s.0000.png")]
    told = json.loads(subprocess.run(asked, capture_output=True, text=True, timeout=60, check=True).stdout)["streams"][
        0
    ]
    assert (told["codec_name"], told["pix_fmt"], told["width"]) == ("png", "rgba", 64)


def test_a_sequence_without_its_dots_is_refused_with_the_right_name(cli, recording, tmp_path):
    done = cli("export", recording, "--to", tmp_path / "shot####.png")
    assert done.code == 1 and "NAME.####.png" in done.err and not list(tmp_path.glob("shot*"))

"""Modes and cameras that `play --clip` takes, and those that it refuses in words."""

from typing import get_type_hints

import pytest
from flockbrush.engine.problems import ProblemsError
from typer.testing import CliRunner

from flockbrush.cli.main import app as commands
from flockbrush.cli.run_options import MarkOptions
from tests.clip_film import bird_film

from flockbrush.studio.film import clip_window  # isort: skip  # the window of the tests has no screen

MODES = "view, landmarks, mask, body, birds, sketch"
LENS = "height = 180\nhorizontal_fov_deg = 60\nmean_speed = 9\nnear = 2\nfar = 400\n"


def opened(tmp_path, clip, *words):
    return CliRunner().invoke(commands, ["play", "--clip", str(clip), "--out", str(tmp_path), "--frames", "1", *words])


def test_the_command_knows_the_modes_of_the_window():
    assert ", ".join(mode.name for mode in clip_window.MODES) == MODES
    option = get_type_hints(MarkOptions, include_extras=True)["mode"].__metadata__[0]
    assert option.help.endswith("in: view, landmarks, mask, body, birds or sketch.")


@pytest.mark.parametrize(("clip", "mode", "those"), [("sky", "birds", "view, sketch"), ("a.mp4", "look", MODES)])
def test_a_mode_that_a_clip_does_not_have_is_refused(tmp_path, clip, mode, those):
    done = opened(tmp_path, clip, "--mode", mode)
    assert done.exit_code == 2
    assert f"must be one of {those}, got '{mode}'" in " ".join(done.output.replace("│", " ").split())


@pytest.mark.parametrize("mode", clip_window.OF_THE_SKY)
def test_an_empty_sky_has_some_modes(tmp_path, mode):
    assert opened(tmp_path, "sky", "--mode", mode.name).exit_code == 0


@pytest.mark.parametrize(
    ("width", "fps", "said"),
    [
        (320, 25, "has 25 frames per second, but the clip has 30"),
        (640, 30, "has 640 x 180 pixels, but the clip has 320 x 180"),
        (320, 29.97, ""),
    ],
)
def test_a_camera_has_the_size_and_the_rate_of_the_clip(tmp_path, width, fps, said):
    camera = tmp_path / "cam.toml"
    camera.write_text(f"{LENS}width = {width}\nfps = {fps}\n")
    done = opened(tmp_path, bird_film(tmp_path / "birds.avi"), "--camera", str(camera))
    assert isinstance(done.exception, ProblemsError) == bool(said), done.output
    assert said in str(done.exception)


def test_a_camera_that_filmed_slow_motion_is_taken(tmp_path):
    camera = tmp_path / "cam.toml"
    camera.write_text(f"{LENS}width = 320\nfps = 240\n")
    done = opened(tmp_path, bird_film(tmp_path / "birds.avi"), "--camera", str(camera))
    assert done.exit_code == 0, done.output
    assert "has 240 frames per second and the clip 30: it is taken as slow motion, 8 times as fast" in done.output

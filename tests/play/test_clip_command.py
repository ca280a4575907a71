"""`flockbrush play --clip`: what it opens, what it refuses, and what an interruption leaves."""

from typing import get_type_hints

import pytest
from flockbrush.engine.problems import ProblemsError
from typer.testing import CliRunner

from flockbrush.cli.main import app as commands
from flockbrush.cli.run_options import MarkOptions
from flockbrush.film.looking import MODES, MODES_OF_SKY
from tests.clip_film import bird_film
from tests.play import window  # noqa: F401  without a screen

from flockbrush.studio.film import clip_window  # isort: skip  # the window of the tests has no screen
from flockbrush.studio.film.clip_window import ClipWindow  # isort: skip


@pytest.fixture(scope="module")
def sky_clip(tmp_path_factory):
    return bird_film(tmp_path_factory.mktemp("clips") / "birds.avi")


def test_the_command_opens_a_window_and_says_what_is_wrong(tmp_path, monkeypatch, sky_clip):
    runner, out = CliRunner(), ["--out", str(tmp_path / "marks")]
    done = runner.invoke(commands, ["play", "--clip", str(sky_clip), *out, "--frames", "2"])
    assert done.exit_code == 0, done.output
    assert runner.invoke(commands, ["play", "--clip", "sky", *out, "--frames", "2"]).exit_code == 0
    (tmp_path / "notes.mp4").write_text("no film")
    (tmp_path / "cam.toml").write_text("width = 3\n")
    slow, wide = (tmp_path / name for name in ("slow.toml", "wide.toml"))
    lens = "height = 180\nhorizontal_fov_deg = 60\nmean_speed = 9\nnear = 2\nfar = 400\n"
    slow.write_text(f"{lens}width = 320\nfps = 25\n")
    wide.write_text(f"{lens}width = 640\nfps = 30\n")
    for words, said in (
        (["--clip", str(tmp_path / "notes.mp4")], "is not a readable video"),
        (["--clip", str(tmp_path)], "is a folder"),
        (["--clip", str(sky_clip), "--tracks", str(tmp_path / "no.csv")], "no.csv"),
        (["--clip", str(sky_clip), "--camera", str(tmp_path / "cam.toml")], "height is missing"),
        (["--clip", str(sky_clip), "--camera", str(slow)], "has 25 frames per second, but the clip has 30"),
        (["--clip", str(sky_clip), "--camera", str(wide)], "has 640 x 180 pixels, but the clip has 320 x 180"),
        (["--clip", str(sky_clip), "--out", str(tmp_path / "notes.mp4")], "is a file"),
    ):
        done = runner.invoke(commands, ["play", *words])
        assert isinstance(done.exception, ProblemsError) and said in str(done.exception)
    (tmp_path / "t.csv").write_text("frame,id,x,y\n")
    for words, option, what in (
        (["--clip", str(sky_clip), "--record", "r.flock"], "--record", "a clip"),
        (["meadow", "--tracks", "t.csv"], "--tracks", "a level or a recording"),
        (["meadow", "--unit", "m"], "--unit", "a level or a recording"),
        ([str(tmp_path / "t.csv"), "--text-size", "90"], "--text-size", "tracks"),
    ):
        done = runner.invoke(commands, ["play", *words])
        assert done.exit_code == 2 and option in done.output and f"does not apply to {what}" in done.output
    for clip, mode, those in (("sky", "birds", "view, sketch"), (str(sky_clip), "look", ", ".join(MODES))):
        done = runner.invoke(commands, ["play", "--clip", clip, "--mode", mode, *out])
        told = " ".join(done.output.replace("│", " ").split())
        assert done.exit_code == 2 and f"must be one of {those}, got '{mode}'" in told
    monkeypatch.setattr("flockbrush.studio.start_clip.missing_display", lambda: "none")
    done = runner.invoke(commands, ["play", "--clip", str(sky_clip), *out], standalone_mode=False)
    assert done.return_value == 2


def test_the_command_knows_the_modes_of_the_window():
    assert tuple(mode.name for mode in clip_window.MODES) == MODES
    assert tuple(mode.name for mode in clip_window.OF_THE_SKY) == MODES_OF_SKY
    option = get_type_hints(MarkOptions, include_extras=True)["mode"].__metadata__[0]
    assert option.help.endswith("view, landmarks, mask, body, birds or sketch.")


def test_who_is_interrupted_loses_nothing(sky_clip, tmp_path, monkeypatch):
    from flockbrush.runs.terminal import Stopped
    from flockbrush.studio import start_clip

    def interrupted(clip, frames, stop):
        clip.book.mark("length", "body", 0, body_length=12.0)
        raise KeyboardInterrupt

    monkeypatch.setattr(ClipWindow, "run", interrupted)
    with pytest.raises((KeyboardInterrupt, Stopped)):
        start_clip.mark_clip(sky_clip, tmp_path / "out", frames=1)
    assert "body_length_px = 12" in (tmp_path / "out" / "birds.marks.toml").read_text()

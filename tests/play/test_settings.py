"""Settings: kept in the user's folder, and a broken file keeps nobody from working."""

import json
import os

import pytest

from flockbrush.studio.settings import Settings, config_folder, load_settings


@pytest.fixture
def path(tmp_path):
    return tmp_path / "deep" / "settings.json"


def test_what_was_chosen_is_there_the_next_day(path):
    chosen = Settings(theme="dark", ui_scale=1.25, brush_size=3.5, overlays={"trails": True, "links": False})
    assert chosen.save(path) == ""
    assert load_settings(path) == (chosen, "")


def test_without_a_file_the_playground_chooses(path):
    assert load_settings(path) == (Settings(), "")


@pytest.mark.parametrize("text", [b"", b"{", b"[1]", b"\xff\xfe", b"null", b"[" * 9000])
def test_a_file_that_is_no_settings_is_named_and_ignored(path, text):
    path.parent.mkdir()
    path.write_bytes(text)
    settings, said = load_settings(path)
    assert settings == Settings()
    assert str(path) in said and "\n" not in said


def test_an_overlay_that_an_earlier_file_does_not_know_is_shown_as_at_first(path):
    path.parent.mkdir()
    path.write_text(json.dumps({"overlays": ["trails", "links"]}))
    settings, said = load_settings(path)
    assert said == "" and settings.shown(("trails", "shadows", "dust")) == {"trails", "links", "dust"}
    settings.overlays |= {"dust": False}
    settings.save(path)
    assert load_settings(path)[0].shown(("trails", "shadows", "dust", "newer")) == {"trails", "links", "newer"}


def test_one_wrong_setting_leaves_the_others(path):
    path.parent.mkdir()
    path.write_text(json.dumps({"theme": "pink", "brush_size": 2.0, "colour": "red", "ui_scale": "big"}))
    settings, said = load_settings(path)
    assert settings == Settings(brush_size=2.0)
    assert "settings.json: " in said


def test_a_wrong_setting_says_what_would_be_right(path):
    path.parent.mkdir()
    path.write_text(json.dumps({"ui_scale": 40.0}))
    assert "from 0.5 to 4, got 40.0" in load_settings(path)[1]


@pytest.mark.skipif(os.name == "nt" or os.geteuid() == 0, reason="everybody may write everywhere here")
def test_a_folder_that_may_not_be_written_is_said(tmp_path):
    tmp_path.chmod(0o500)
    assert "cannot" in Settings().save(tmp_path / "deep" / "settings.json")


def test_a_file_in_the_place_of_the_folder_is_said(tmp_path):
    (tmp_path / "deep").write_text("a file")
    assert "cannot be saved" in Settings().save(tmp_path / "deep" / "settings.json")


def test_the_folder_is_where_the_system_wants_it(monkeypatch, tmp_path):
    monkeypatch.delenv("FLOCKBRUSH_CONFIG", raising=False)
    monkeypatch.setattr("sys.platform", "linux")
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    assert config_folder() == tmp_path / "flockbrush"

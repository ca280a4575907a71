"""A copy of a shipped level to be edited."""

import shutil
from pathlib import Path

import pytest

from flockbrush import levels

HERE = Path(levels.__file__).parent


@pytest.fixture
def meadow(tmp_path):
    """A copy of a shipped level with its project, as a designer has it."""
    shutil.copytree(HERE / "tilesets", tmp_path / "tilesets")
    shutil.copy(HERE / "flockbrush.tiled-project", tmp_path)
    (tmp_path / "shipped").mkdir()
    return Path(shutil.copy(HERE / "shipped" / "meadow.tmj", tmp_path / "shipped"))

"""Settings, journals and pictures of these tests, and of nobody else."""

import pytest
from small_pasture import pasture


@pytest.fixture(autouse=True)
def at_home(tmp_path, monkeypatch):
    """Whatever the playground keeps for its user goes into the test's own folder."""
    for name in ("FLOCKBRUSH_CONFIG", "FLOCKBRUSH_STATE", "FLOCKBRUSH_CACHE", "XDG_STATE_HOME", "XDG_CONFIG_HOME"):
        monkeypatch.setenv(name, str(tmp_path / "user" / name.lower()))
    monkeypatch.delenv("FLOCKBRUSH_SCALE", raising=False)


@pytest.fixture
def level(tmp_path):
    """A small level in a folder of its own."""
    return pasture(tmp_path / "levels")


@pytest.fixture
def session(level, tmp_path):
    """A session on the level of the tests."""
    from flockbrush.studio.session import Session

    made = Session.open(level, state_folder=tmp_path / "state")
    yield made
    made.close()


@pytest.fixture
def state(tmp_path):
    """Where sessions are kept."""
    return tmp_path / "state"


@pytest.fixture
def in_own_folder(tmp_path, monkeypatch):
    """What is written without a folder goes into the test's own."""
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def window(tmp_path, in_own_folder):
    """A window on a pasture of 24 x 16 m: nine sheep in the west, a stone in the east, a way through the middle."""
    from window import Window

    window = Window(pasture(tmp_path, script=False))
    window.set_size(1.5)
    yield window
    window.close()


@pytest.fixture
def shown():
    """``shown(window)``: the window with its first frame drawn, closed when the test is over."""
    import pygame

    windows = []

    def show(window):
        windows.append(window)
        pygame.event.get()
        window.frame(1 / 30)
        return window

    yield show
    for window in windows:
        window.close()

"""The command line in this process, and small levels for it."""

from types import SimpleNamespace

import pytest
from pens import pen
from processes import other_process


@pytest.fixture
def cli(capfd, monkeypatch):
    """``cli("run", "meadow")`` in this process: code, out and err."""
    from flockbrush.engine.parallel import set_threads, threads

    from flockbrush.cli.main import called

    monkeypatch.setenv("NO_COLOR", "1")
    monkeypatch.setenv("COLUMNS", "200")
    monkeypatch.delenv("FLOCKBRUSH_DEBUG", raising=False)
    before = threads()

    def run(*arguments):
        capfd.readouterr()
        code = called([str(argument) for argument in arguments])
        out, err = capfd.readouterr()
        assert "Traceback" not in out + err
        return SimpleNamespace(code=code, out=out, err=err)

    yield run
    set_threads(before)


@pytest.fixture(scope="session")
def shared(tmp_path_factory):
    """A folder for levels and recordings that no test changes."""
    return tmp_path_factory.mktemp("shared")


@pytest.fixture(scope="session")
def level(shared):
    """The path of a pen with 24 sheep."""
    return pen(shared)


@pytest.fixture(scope="session")
def recording(shared, level):
    """Forty ticks in the pen, recorded in a process of its own."""
    path = shared / "pen.flock"
    done = other_process("run", level, "--ticks", 40, "--record", path, "--json")
    assert done.returncode == 0, done.stderr
    return path

"""The command line in this process, and small levels for it."""

from types import SimpleNamespace

import pytest
from flockbrush.engine.recording import open_recording
from pens import pen
from processes import other_process

from flockbrush.runs.run import rebuild


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
def command():
    """``command("export", path, ...)`` in this process, for fixtures that tests share; it must succeed."""
    from flockbrush.cli.main import called

    def run(*arguments):
        assert called([str(argument) for argument in arguments]) == 0

    return run


@pytest.fixture(scope="module")
def lived(recording):
    """The simulation at the end of the recording (tick 40, 1.25 s)."""
    run = open_recording(recording)
    simulation = rebuild(run)
    simulation.run(40)
    return simulation


@pytest.fixture(scope="session")
def recording(shared, level):
    """Forty ticks in the pen, recorded in a process of its own, which compiles each kernel once and without helpers."""
    path = shared / "pen.flock"
    done = other_process("run", level, "--ticks", 40, "--record", path, "--json", FLOCKBRUSH_THREADS=1)
    assert done.returncode == 0, done.stderr
    return path

"""The command line in this process and in another, and small levels for it."""

import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
from pens import pen

HOUSE = Path(__file__).parents[2]


@pytest.fixture
def cli(capfd, monkeypatch):
    """``cli("run", "meadow")`` in this process: code, out and err."""
    from engine.parallel import set_threads, threads
    from flockbrush.cli import called

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


def environment(**variables):
    """The environment of another process that finds this house."""
    plain = {name: value for name, value in os.environ.items() if not name.startswith("FLOCKBRUSH")}
    return plain | {"PYTHONPATH": str(HOUSE), "NO_COLOR": "1", "COLUMNS": "200"} | variables


def other_process(*arguments, cwd=None, timeout=300, **variables):
    """``python -m flockbrush`` in a process of its own, with these environment variables."""
    return subprocess.run(
        [sys.executable, "-m", "flockbrush", *map(str, arguments)],
        cwd=cwd, env=environment(**variables), capture_output=True, text=True, timeout=timeout, check=False,
    )  # fmt: skip


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

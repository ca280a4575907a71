"""What a user gets: a wheel that lives beside their own folders, has types, is complete and goes without a trace."""

import os
import re
import subprocess
import sys
import tarfile
import venv
import zipfile
from pathlib import Path

import pytest

HOUSE = Path(__file__).parents[1]
ROOMS = ("engine", "components", "behaviours", "systems", "levels", "flockbrush")
pytestmark = [pytest.mark.slow, pytest.mark.tools]

PROGRAM = """
import sys
import flockbrush
import components.wool, levels, systems.shearing
from flockbrush.components import Position

meadow = flockbrush.start(levels.LEVEL, seed=7, agents=20)
meadow.run(ticks=8)
assert "site-packages" in flockbrush.__file__, flockbrush.__file__
print(len(meadow.agents[Position.xyz]), components.wool.MASS, systems.shearing.__name__)
"""

TYPED = """
import flockbrush
from flockbrush.behaviours.brush import Brush, load_brush
from flockbrush.levels.build import Simulation

meadow: Simulation = flockbrush.start("meadow", seed=7)
walk: Brush = load_brush("walk.brush.toml")
meadow.run(ticks="eight")
reveal_type(walk.speed.mean)
"""
CHECKED = """[mypy]
[mypy-av.*,cv2.*,distributed.*,numba.*,numpy.*,pydantic.*,rich.*,scipy.*,torch.*,typer.*]
follow_imports = skip
follow_imports_for_stubs = True
"""  # the types of others take most of the time


def run(*command, cwd=None, **environment):
    """Output of a program that must go well; the tests' own environment is not passed on."""
    names = ("PATH", "HOME", "SYSTEMROOT", "TEMP", "TMP")
    env = {name: value for name, value in os.environ.items() if name in names or name.startswith("PIP_")}
    done = subprocess.run(
        [*map(str, command)], cwd=cwd, env=env | environment, capture_output=True, text=True, timeout=900, check=False
    )
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]
    return done.stdout


@pytest.fixture(scope="session")
def built(tmp_path_factory):
    """(sdist, wheel) of the files that git knows, the wheel built from the sdist, as a package index would do."""
    source, dist = tmp_path_factory.mktemp("source"), tmp_path_factory.mktemp("dist")
    listed = run("git", "ls-files", "-co", "--exclude-standard", "-z", cwd=HOUSE).split("\0")
    for name in filter(None, listed):
        if (HOUSE / name).is_file():
            (source / name).parent.mkdir(parents=True, exist_ok=True)
            (source / name).write_bytes((HOUSE / name).read_bytes())
    build = "import sys, setuptools.build_meta as b; getattr(b, sys.argv[1])(sys.argv[2])"
    run(sys.executable, "-c", build, "build_sdist", dist, cwd=source)
    (sdist,) = dist.glob("*.tar.gz")
    with tarfile.open(sdist) as archive:
        archive.extractall(dist, filter="data")
    (unpacked,) = [path for path in dist.iterdir() if path.is_dir()]
    run(sys.executable, "-c", build, "build_wheel", dist, cwd=unpacked)
    (wheel,) = dist.glob("*.whl")
    return sdist, wheel


@pytest.fixture(scope="module")
def user(built, tmp_path_factory):
    """(python, project folder, home, files of the environment before) of a user who has installed the wheel.

    Requirements come from the packages of the tests, which takes no time and no network.
    """
    root = tmp_path_factory.mktemp("user")
    venv.create(root / "env", symlinks=True, with_pip=False)
    python = root / "env" / ("Scripts/python.exe" if sys.platform == "win32" else "bin/python")
    packages = Path(run(python, "-c", "import sysconfig; print(sysconfig.get_path('purelib'))").strip())
    ours = [path for path in sys.path if path.endswith(("site-packages", "dist-packages"))]
    (packages / "of_the_tests.pth").write_text("\n".join(ours))
    before = files_below(root / "env")
    run(sys.executable, "-m", "pip", "--python", python, "install", "--no-deps", "--no-index", built[1])
    project = root / "game"
    for name, text in {
        "systems/__init__.py": "",
        "systems/shearing.py": "",
        "components/__init__.py": "",
        "components/wool.py": "MASS = 2.5",
        "levels.py": "LEVEL = 'meadow'",
        "main.py": PROGRAM,
        "typed.py": TYPED,
        "typed.ini": CHECKED,
    }.items():
        (project / name).parent.mkdir(parents=True, exist_ok=True)
        (project / name).write_text(text)
    return python, project, root / "home", before


def files_below(folder):
    return {str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file()}


def test_the_wheel_holds_every_module_and_nothing_outside_of_flockbrush(built):
    names = set(zipfile.ZipFile(built[1]).namelist())
    assert {name.split("/")[0] for name in names if ".dist-info/" not in name} == {"flockbrush"}
    ours = run("git", "ls-files", *ROOMS, cwd=HOUSE).split()
    wanted = {name if name.startswith("flockbrush/") else f"flockbrush/{name}" for name in ours}
    assert wanted - names == set()


def test_its_page_on_a_package_index_has_no_relative_links(built):
    archive = zipfile.ZipFile(built[1])
    (name,) = [name for name in archive.namelist() if name.endswith(".dist-info/METADATA")]
    metadata = archive.read(name).decode()
    assert "License-Expression: Apache-2.0" in metadata and "Author: Flockbrush contributors" in metadata
    assert "## Install" in metadata and re.findall(r"\]\((?!https://)[^)]*\)", metadata) == []


def test_the_sdist_is_complete(built):
    with tarfile.open(built[0]) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}
    wanted = {name for name in run("git", "ls-files", "-z", cwd=HOUSE).split("\0") if name and not name.startswith(".")}
    assert wanted - names == set()


def test_it_runs_beside_a_project_with_folders_of_the_same_names_and_goes_without_a_trace(user):
    python, project, home, before = user
    plain = {"HOME": str(home), "NUMBA_DISABLE_JIT": "1"}  # 20 animals are done before their kernels were compiled
    assert run(python, "main.py", cwd=project, **plain).split() == ["20", "2.5", "systems.shearing"]
    once = [python.parent / "flockbrush", "run", "meadow", "--ticks", "2", "--agents", "20"]
    assert "state" in run(*once, cwd=project, **plain)
    one_kernel = "from flockbrush.engine.maths import sincos_; print(sincos_(0.0)[0])"
    assert run(python, "-c", one_kernel, cwd=project, HOME=str(home)).strip() == "0.0"
    assert list(home.rglob("*.nbc")), "compiled kernels should be kept in the user's cache folder"
    run(sys.executable, "-m", "pip", "--python", python, "uninstall", "--yes", "flockbrush")
    left = {name for name in files_below(python.parents[1]) - before if "of_the_tests" not in name}
    assert left == set()


def test_a_users_mypy_sees_our_types(user, built):
    python, project, home, _ = user
    install = ["install", "--no-deps", "--no-index", "--no-compile", built[1]]
    run(sys.executable, "-m", "pip", "--python", python, *install)
    checker = [sys.executable, "-m", "mypy", "--python-executable", python, "--config-file", "typed.ini", "typed.py"]
    done = subprocess.run([*map(str, checker)], cwd=project, capture_output=True, text=True, timeout=900, check=False)
    assert 'Revealed type is "float"' in done.stdout.replace("builtins.", ""), done.stdout + done.stderr
    assert 'incompatible type "str"; expected "int"' in done.stdout, done.stdout
    assert "py.typed" not in done.stdout

"""A package and a home that nobody can write, as in containers: everything works, and one is told where things go."""

import os
import shutil
import subprocess
import sys
import textwrap
import types
from pathlib import Path

import pytest
from flockbrush.engine import files, kernel_cache

HOUSE = Path(__file__).parents[2]
ROOMS = ("engine", "components", "behaviours", "systems", "levels")
unix = pytest.mark.skipif(os.name != "posix", reason="homes are found in another way")


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    """A folder with the package as a wheel lays it out, in which no kernel can be kept, not even by root."""
    root = tmp_path_factory.mktemp("installed")
    plain = shutil.ignore_patterns("__pycache__")
    shutil.copytree(HOUSE / "flockbrush", root / "flockbrush", ignore=plain)
    for room in ROOMS:
        shutil.copytree(HOUSE / room, root / "flockbrush" / room, ignore=plain)
    for folder in {path.parent for path in root.rglob("*.py")}:
        (folder / "__pycache__").write_text("a file, where a folder is wanted")
    return root


def python(installed, tmp_path, code, *arguments, **environment):
    """A program in an environment without a home; (exit code, stdout, stderr)."""
    (tmp_path / "tmp").mkdir(exist_ok=True)
    env = {name: value for name, value in os.environ.items() if not name.startswith(("FLOCKBRUSH", "NUMBA", "XDG"))}
    env |= {"PYTHONPATH": str(installed), "HOME": "/dev/null", "TMPDIR": str(tmp_path / "tmp")} | environment
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(code), *arguments],
        cwd=tmp_path, env=env, capture_output=True, text=True, timeout=300, check=False,
    )  # fmt: skip
    return done.returncode, done.stdout, done.stderr


EXP = """
    import flockbrush
    from flockbrush.engine.maths import exp_
    print(exp_(0.0), flockbrush.__file__, flockbrush.KERNEL_CACHE, sep="\\n")
"""


@unix
def test_kernels_are_kept_in_a_temporary_folder_that_only_we_can_write(installed, tmp_path):
    code, out, err = python(installed, tmp_path, EXP)
    assert code == 0, err
    place = tmp_path / "tmp" / f"flockbrush-{os.getuid()}"
    value, home, told = out.splitlines()
    assert value == "1.0" and home.startswith(str(installed))
    assert (
        told.startswith(f"compiled kernels are stored in {place / 'kernels'}: not writable: ")
        and "NUMBA_CACHE_DIR" in told
    )
    assert place.stat().st_mode & 0o777 == 0o700 and list(place.rglob("*.nbc"))


@unix
def test_a_temporary_folder_that_others_can_write_is_not_trusted(installed, tmp_path):
    place = tmp_path / "tmp" / f"flockbrush-{os.getuid()}"
    place.mkdir(parents=True)
    place.chmod(0o777)
    code, out, err = python(installed, tmp_path, EXP)
    assert code == 0, err
    assert out.startswith("1.0\n") and "compiled kernels cannot be stored" in out and not list(place.iterdir())


def test_without_any_place_kernels_are_compiled_and_not_kept(installed, tmp_path):
    nowhere = 'import tempfile\ntempfile.tempdir = "/dev/null/x"\n' + textwrap.dedent(EXP)
    code, out, err = python(installed, tmp_path, nowhere)
    assert code == 0, err
    assert (
        out.startswith("1.0\n")
        and "compiled kernels cannot be stored, every start compiles them again: not writable: " in out
    )


def test_the_doctor_comes_to_its_end_and_says_it(installed, tmp_path):
    code, out, err = python(installed, tmp_path, "from flockbrush.cli.main import main; main()", "doctor")
    assert "Traceback" not in out + err and "shipped files" in out
    assert "warn  compile cache" in out and "compiled kernels are stored in" in out.replace("\n", " ")
    assert code == 0, out


def test_a_check_that_fails_does_not_end_the_doctor(cli, monkeypatch):
    from flockbrush.cli import doctor

    def broken():
        yield doctor.OK, "one", "found"
        raise RuntimeError("no locator available")

    monkeypatch.setattr(doctor, "CHECKS", (broken, *doctor.CHECKS[-1:]))
    done = cli("doctor")
    assert done.code == 1
    assert "problem  broken" in done.out and "no locator available" in done.out and "levels and" in done.out


def test_who_waits_for_the_compiler_is_told_where_kernels_go(monkeypatch, capsys):
    import flockbrush
    from flockbrush.runs.terminal import compiling

    with compiling():
        assert capsys.readouterr().err == ""
    monkeypatch.setattr(flockbrush, "KERNEL_CACHE", "compiled kernels are kept elsewhere")
    with compiling():
        assert capsys.readouterr().err == "compiled kernels are kept elsewhere\n"


@pytest.fixture
def places(tmp_path, monkeypatch):
    """The folders that kernels may go to, and which of them can be written."""
    writable = set()
    monkeypatch.setattr(kernel_cache, "can_write", lambda folder: str(folder) in writable)
    monkeypatch.setattr(kernel_cache, "_keep_nothing", lambda: None)
    monkeypatch.setattr(kernel_cache, "_use", lambda place: monkeypatch.setenv("NUMBA_CACHE_DIR", str(place)))
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr(files.tempfile, "tempdir", str(tmp_path))
    return writable


@pytest.mark.skipif(sys.platform != "linux", reason="caches of users lie elsewhere")
def test_the_first_place_that_can_be_written_is_taken(places, tmp_path, monkeypatch):
    prepare = kernel_cache.prepare
    assert "cannot be stored" in prepare(tmp_path, "1")
    places.add(str(tmp_path / f"flockbrush-{os.getuid()}" / "kernels"))
    assert "are stored in" in prepare(tmp_path, "1") and os.environ["NUMBA_CACHE_DIR"] in places
    assert prepare(tmp_path, "1") == ""  # a process that this one has started
    monkeypatch.delenv("NUMBA_CACHE_DIR")
    places.add(str(tmp_path / "cache" / "numba"))
    assert prepare(tmp_path, "1") == "" and "NUMBA_CACHE_DIR" not in os.environ and kernel_cache.folder()
    places.add(str(kernel_cache.BESIDE))
    assert prepare(tmp_path, "1") == "" and kernel_cache.folder() == kernel_cache.BESIDE
    monkeypatch.setenv("NUMBA_CACHE_DIR", "/read/only")
    assert prepare(tmp_path, "1") == "" and kernel_cache.folder() == kernel_cache.BESIDE
    places.clear()
    assert "not writable: /read/only and" in prepare(tmp_path, "1")


def test_who_has_no_home_gets_a_folder_of_ones_own(tmp_path, monkeypatch):
    def homeless():
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.setattr(files.Path, "home", homeless)
    monkeypatch.setattr(files.tempfile, "tempdir", str(tmp_path))
    assert files.home().parent == tmp_path and files.home().is_dir()
    monkeypatch.setattr(files.tempfile, "tempdir", str(tmp_path / "none"))
    with pytest.raises(OSError):
        (files.home() / "settings").mkdir(parents=True)


def test_kernels_stored_for_a_class_that_is_gone_are_compiled_again(tmp_path, monkeypatch):
    """Numba reads the classes of the arguments before it looks whether the sources are new."""
    from numba.core.caching import IndexDataCacheFile

    module = types.ModuleType("renamed")
    module.Old = type("Old", (), {"__module__": "renamed"})
    monkeypatch.setitem(sys.modules, "renamed", module)
    stored = IndexDataCacheFile(str(tmp_path), "kernel", "stamp")
    stored._save_index({module.Old: "kernel.1.nbc"})
    assert stored._load_index()
    del module.Old
    kernel_cache.forget_stale_kernels()
    assert stored.load("key") is None
    stored.save("key", "compiled")
    assert stored.load("key") == "compiled"

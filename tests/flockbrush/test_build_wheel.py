"""``flockbrush build-wheel``: a wheel that brings its kernels compiled."""

import os
import subprocess
import sys
import venv
import zipfile
from pathlib import Path

import llvmlite.binding
import pytest
from flockbrush.engine.shipped_kernels import CPUS, machine
from processes import environment

from flockbrush.cli import build_wheel

ONE = "from flockbrush.engine.maths import exp_; exp_(1.0)"
LOADS = (
    f"{ONE}; import os; print(os.environ['NUMBA_CPU_NAME'], len(exp_.stats.cache_hits), len(exp_.stats.cache_misses))"
)


def test_a_folder_without_sources_is_refused(cli, tmp_path, monkeypatch):
    monkeypatch.setattr(build_wheel.build, "__defaults__", (tmp_path,))
    done = cli("build-wheel", tmp_path / "out")
    assert done.code == 1 and "this folder has no sources" in done.err and not (tmp_path / "out").exists()


def test_a_missing_build_tool_is_named(cli, tmp_path, monkeypatch):
    monkeypatch.setattr(build_wheel.importlib.util, "find_spec", lambda name: None)
    done = cli("build-wheel", tmp_path / "out")
    assert (
        done.code == 1
        and "built with setuptools, which is not installed" in done.err
        and not (tmp_path / "out").exists()
    )


def test_an_unknown_processor_or_level_is_refused(cli, tmp_path):
    done = cli("build-wheel", tmp_path / "out", "--cpu", "z80")
    assert done.code == 2 and "z80" in done.err and "x86-64-v3" in done.err
    done = cli("build-wheel", tmp_path / "out", "--level", "nowhere")
    assert done.code and "nowhere" in done.err and not (tmp_path / "out").exists()


@pytest.mark.slow
@pytest.mark.tools
@pytest.mark.skipif(machine() != "x86_64", reason="kernels are shipped for x86-64")
def test_a_user_of_the_wheel_does_not_compile(tmp_path, monkeypatch):
    able = llvmlite.binding.get_host_cpu_features()
    cpu = next((cpu for cpu in CPUS if all(map(able.get, CPUS[cpu]))), None)
    if cpu is None:
        pytest.skip("this processor is older than x86-64-v3")

    def compile_one(site, kernels, cpu, levels):
        cache = {"NUMBA_CACHE_DIR": kernels, "NUMBA_CPU_NAME": cpu, "NUMBA_CPU_FEATURES": "", "PYTHONPATH": site}
        subprocess.run([sys.executable, "-P", "-c", ONE], env=environment() | cache, check=True, timeout=300)

    monkeypatch.setattr(build_wheel, "_compile", compile_one)
    wheel = build_wheel.build(tmp_path / "out", ["meadow"], [cpu])
    assert [path.name for path in (tmp_path / "out").iterdir()] == [wheel.name] and "none-any" not in wheel.name
    assert any(name.endswith(".nbc") for name in zipfile.ZipFile(wheel).namelist())
    python = _installed(wheel, tmp_path / "env")
    home = {"HOME": tmp_path, "XDG_CACHE_HOME": tmp_path / "cache"}
    plain = {name: value for name, value in os.environ.items() if name in ("PATH", "SYSTEMROOT")}
    done = subprocess.run(
        [python, "-P", "-c", LOADS], env=plain | home, cwd=tmp_path, capture_output=True, text=True, timeout=300
    )
    assert done.stdout.split() == [cpu, "1", "0"], done.stderr


def _installed(wheel, folder):
    """The Python of an environment that has the wheel, and what it needs from the packages of the tests."""
    venv.create(folder, symlinks=True, with_pip=False)
    python = folder / ("Scripts/python.exe" if sys.platform == "win32" else "bin/python")
    find = [python, "-c", "import sysconfig; print(sysconfig.get_path('purelib'))"]
    packages = Path(subprocess.run(find, capture_output=True, text=True, check=True, timeout=60).stdout.strip())
    ours = [path for path in sys.path if path.endswith(("site-packages", "dist-packages"))]
    (packages / "of_the_tests.pth").write_text("\n".join(ours))
    pip = [sys.executable, "-m", "pip", "--python", python, "install", "--no-deps", "--no-index", wheel]
    subprocess.run([*map(str, pip)], check=True, capture_output=True, timeout=300)
    return python

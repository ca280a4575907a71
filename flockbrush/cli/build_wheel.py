"""Builds a wheel that contains compiled kernels, so that the first run need not compile them."""

from __future__ import annotations

import base64
import hashlib
import importlib.util
import json
import os
import shutil
import subprocess
import sys
import sysconfig
import tempfile
import tomllib
import zipfile
from pathlib import Path

import typer

import flockbrush
from flockbrush.cli.shared_options import wrong
from flockbrush.engine import shipped_kernels
from flockbrush.engine.files import whole
from flockbrush.engine.shipped_kernels import CPUS, FOLDER, TABLE
from flockbrush.runs.terminal import PROBLEM, print_line, say

HOUSE = Path(flockbrush.__file__).parent.parent
BUILD = "import sys, setuptools.build_meta as b; b.build_wheel(sys.argv[1])"
NEEDED = ("pyproject.toml", "setup.py", "README.md", "LICENSE", "MANIFEST.in")


def build(out, levels, cpus, house=HOUSE):
    """Write a wheel with the kernels that the levels need at their start, compiled for each CPU; returns its path."""
    _check(house, levels, cpus)
    out.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=out, prefix=".building-") as work:
        work = Path(os.path.abspath(work))
        plain = _plain_wheel(house, work)
        site, kernels = work / "site", work / "kernels"
        with zipfile.ZipFile(plain) as archive:
            archive.extractall(site)
        for cpu in cpus:
            say(f"compiling kernels for {cpu}; this takes a minute or more ...")
            _compile(site, kernels, cpu, levels)
        count = _ship(kernels, site, cpus)
        tag = f"{sys.implementation.cache_tag.replace('cpython-', 'cp')}"
        name = plain.name.replace("py3-none-any", f"{tag}-{tag}-{_platform()}")
        _set_tag(site, f"{tag}-{tag}-{_platform()}")
        path = out / name
        with whole(path) as temporary:
            _pack(site, temporary)
    print_line(f"{path}: {count} compiled kernels, {path.stat().st_size / 1e6:.1f} MB")
    return path


def _check(house, levels, cpus):
    """Raise typer.BadParameter or typer.Exit, before anything is written, if the wheel cannot be built."""
    from flockbrush.runs.run import find_level

    if not all((house / name).is_file() for name in NEEDED):
        say(f"{house}: this folder has no sources to build a wheel from; install from a checkout (pip install -e .)")
        raise typer.Exit(PROBLEM)
    if importlib.util.find_spec("setuptools") is None:
        say("the wheel is built with setuptools, which is not installed: pip install 'setuptools>=77'")
        raise typer.Exit(PROBLEM)
    for level in levels:
        find_level(level)
    for cpu in cpus:
        if cpu not in CPUS or shipped_kernels.machine() != "x86_64":
            message = (
                f"kernels can be compiled for {', '.join(CPUS)} on x86_64, got {cpu!r} on {shipped_kernels.machine()}"
            )
            raise wrong("--cpu", message)


def _plain_wheel(house, work):
    """Build the wheel without kernels, from a copy of the sources; returns its path."""
    source, dist = work / "source", work / "dist"
    dist.mkdir()
    ours = tomllib.loads((house / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["setuptools"]["package-dir"]
    for folder in ours.values():
        shutil.copytree(house / folder, source / folder, ignore=shutil.ignore_patterns("__pycache__", "*.nb[ic]"))
    for name in NEEDED:
        shutil.copyfile(house / name, source / name)
    _run([sys.executable, "-c", BUILD, str(dist)], source, os.environ, "setuptools could not build the wheel")
    return next(dist.glob("*.whl"))


def _compile(site, kernels, cpu, levels):
    own = {name: value for name, value in os.environ.items() if not name.startswith(("NUMBA_", "FLOCKBRUSH_"))}
    cache = {"NUMBA_CACHE_DIR": str(kernels), "NUMBA_CPU_NAME": cpu, "NUMBA_CPU_FEATURES": ""}
    command = [sys.executable, "-P", "-m", "flockbrush.cli.wheel_kernels", str(site), *levels]
    _run(command, site, own | cache | {"PYTHONPATH": str(site)}, f"kernels could not be compiled for {cpu}")


def _run(command, folder, environment, problem):
    """Run a program without showing its output; on failure, print the last lines of its output and exit."""
    process = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    if process.returncode:
        say(f"{problem}: {' '.join((process.stderr or process.stdout).strip().splitlines()[-3:])}")
        raise typer.Exit(PROBLEM)


def _ship(kernels, site, cpus):
    """Copy compiled kernels into the package; returns their number."""
    target = site / FOLDER
    target.mkdir()
    count = 0
    for folder in [site / "flockbrush", *(path for path in (site / "flockbrush").rglob("*") if path.is_dir())]:
        for path in (kernels / shipped_kernels.cache_name(folder)).glob("*.nb[ic]"):
            place = target / folder.relative_to(site / "flockbrush") / path.name
            place.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(path, place)
            count += path.suffix == ".nbc"
    table = {"kind": shipped_kernels.kind(), "cpus": list(cpus)}
    (target / TABLE).write_text(json.dumps(table, indent=1) + "\n", encoding="utf-8")
    return count


def _platform():
    return sysconfig.get_platform().replace("-", "_").replace(".", "_")


def _set_tag(site, tag):
    (path,) = site.glob("*.dist-info/WHEEL")
    lines = path.read_text(encoding="utf-8").splitlines()
    path.write_text("\n".join([*(x for x in lines if x and not x.startswith("Tag:")), f"Tag: {tag}", ""]), "utf-8")


def _pack(site, target):
    """Write a wheel of all files of a folder, with the list of the files (RECORD)."""
    (record,) = site.glob("*.dist-info/RECORD")
    listed = record.relative_to(site).as_posix()
    rows = []
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as archive:
        for path in sorted(site.rglob("*")):
            name = path.relative_to(site).as_posix()
            if path.is_file() and path != record:
                data = path.read_bytes()
                digest = base64.urlsafe_b64encode(hashlib.sha256(data).digest()).rstrip(b"=").decode()
                rows.append(f"{name},sha256={digest},{len(data)}")
                archive.writestr(name, data)
        archive.writestr(listed, "\n".join([*rows, f"{listed},,", ""]))

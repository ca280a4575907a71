"""The command ``flockbrush doctor``: checks of the installation, one line each, with what to do about a problem."""

from __future__ import annotations

import os
import platform
import re
import shutil
import subprocess
import sys
from importlib import metadata
from pathlib import Path

import typer

import flockbrush
from flockbrush import systems
from flockbrush.engine import kernel_cache
from flockbrush.runs.terminal import PROBLEM, print_json, show, styled

HOUSE = Path(flockbrush.__file__).parent.parent
OPTIONAL = {
    "pyarrow": "Parquet exports",
    "usd-core": "USD exports",
    "distributed": "sweeps and learning on a cluster",
    "matplotlib": "charts",
}
TILED = 1, 10  # the first version that knows projects with classes
OK, WARN, BAD = "ok", "warn", "problem"
_COLOURS = {OK: "green", WARN: "yellow", BAD: "red"}


def examine(json):
    """Run all checks and print the findings; exit code 1 if there is a problem."""
    findings = [finding for check in CHECKS for finding in _findings(check)]
    if json:
        print_json([{"state": state, "what": what, "found": text} for state, what, text in findings])
    else:
        for state, what, text in findings:
            show(styled(f"[{_COLOURS[state]}]{{}}[/]  {{}} {{}}", f"{state:>7}", f"{what:<31}", text))
    if any(state == BAD for state, _, _ in findings):
        raise typer.Exit(PROBLEM)


def _findings(check):
    """The findings of one check; an exception in it is a finding too, so that the other checks still run."""
    try:
        yield from check()
    except Exception as error:  # noqa: BLE001
        yield BAD, check.__name__.strip("_"), f"this check failed: {type(error).__name__}: {error}"


def _python():
    old = "" if sys.version_info >= (3, 11) else "; Python 3.11 or later is needed"
    yield BAD if old else OK, "python", platform.python_version() + old
    yield OK, "flockbrush", f"{flockbrush.__version__} in {HOUSE}"


def pinned_versions(text):
    """{name: version} of the lines ``name==version`` of constraints.txt."""
    pins = (line.split("==") for line in text.splitlines() if "==" in line and not line.startswith("#"))
    return {_canonical(name.strip()): version.strip() for name, version in pins}


def _canonical(name):
    return re.sub(r"[-_.]+", "-", name).lower()


def _packages():
    needed = _requirements()
    file = HOUSE / "constraints.txt"
    tested = pinned_versions(file.read_text(encoding="utf-8")) if file.is_file() else {}
    for name in needed:
        yield _package(name, tested.get(name), BAD, "not installed: run pip install -e . in the folder of the project")
    for name, what in OPTIONAL.items():
        yield _package(name, tested.get(name), WARN, f"not installed; needed for {what}: pip install {name}")


def _requirements():
    """Names of the required packages."""
    try:
        lines = metadata.requires("flockbrush") or []
    except metadata.PackageNotFoundError:
        import tomllib

        file = HOUSE / "pyproject.toml"
        lines = tomllib.loads(file.read_text(encoding="utf-8"))["project"]["dependencies"] if file.is_file() else []
    plain = [line for line in lines if "extra ==" not in line]
    return sorted(_canonical(re.match(r"[\w.-]+", line).group()) for line in plain)


def _package(name, tested, state, message):
    try:
        version = metadata.version(name)
    except metadata.PackageNotFoundError:
        return state, name, message
    if tested and version != tested:
        told = f"{version}; tested with {tested}: results may differ from other installations in the last bits"
        return WARN, name, told
    return OK, name, version


def _numba():
    try:
        import llvmlite.binding
        import numba
    except ImportError as error:
        yield BAD, "numba", f"cannot be imported: {error}"
        return
    from flockbrush.engine.parallel import threads

    name = numba.config.CPU_NAME or llvmlite.binding.get_host_cpu_name()
    yield OK, "target CPU", f"{name}{' (NUMBA_CPU_NAME)' if numba.config.CPU_NAME else ''}"
    if numba.config.DISABLE_JIT:
        yield WARN, "compiler", "NUMBA_DISABLE_JIT is set: kernels run in Python, many times slower"
    yield OK, "threads", f"{threads()} of {os.cpu_count()} CPUs; change with --threads or FLOCKBRUSH_THREADS"
    yield _cache(kernel_cache.folder())


def _cache(folder):
    """The finding about the folder of compiled kernels."""
    if flockbrush.KERNEL_CACHE or folder is None:
        return WARN, "compile cache", flockbrush.KERNEL_CACHE or "none"
    beside = folder == kernel_cache.BESIDE
    places = [Path(path) / "__pycache__" for path in systems.__path__] if beside else [folder]
    count = sum(1 for place in places for _ in place.rglob("*.nbc"))
    first = "" if count else "; the first run compiles kernels, which takes about a minute"
    return OK, "compile cache", f"{places[0]}, {count} kernels{first}"


def _display():
    own = platform.system() if platform.system() in ("Windows", "Darwin") else ""
    display = own or os.environ.get("WAYLAND_DISPLAY") or os.environ.get("DISPLAY")
    yield OK, "display", display or "none; `flockbrush play` needs one, runs and exports do not"


def _programs():
    tiled = shutil.which("tiled")
    if tiled:
        said = _first_line([tiled, "--version"])
        version = tuple(int(part) for part in re.findall(r"\d+", said)[:2])
        old = "" if version >= TILED else f"; the project of `level init` needs {TILED[0]}.{TILED[1]} or newer"
        yield WARN if old else OK, "tiled", f"{said}  ({tiled}){old}"
    else:
        yield WARN, "tiled", "not found; needed to edit levels (Debian: apt install tiled; or mapeditor.org)"
    ffmpeg = shutil.which("ffmpeg")
    found = " ".join(_first_line([ffmpeg, "-version"]).split()[:3]) if ffmpeg else "not found"
    yield OK, "ffmpeg", f"{found}; not needed, the package av writes videos"


def _first_line(command):
    environment = os.environ | {"QT_QPA_PLATFORM": "offscreen"}
    try:
        process = subprocess.run(command, capture_output=True, text=True, timeout=20, env=environment, check=False)
        return (process.stdout or process.stderr).strip().split("\n")[0] or "prints no version"
    except (OSError, subprocess.SubprocessError) as error:
        return f"cannot be run: {error}"


def _shipped():
    from flockbrush.behaviours.brush import shipped
    from flockbrush.engine.plugins import package_problems
    from flockbrush.engine.problems import ProblemsError
    from flockbrush.levels.reader import read_level
    from flockbrush.runs.run import SHIPPED, shipped_levels

    problems = shipped().problems()
    for name in shipped_levels():
        try:
            read_level(SHIPPED / f"{name}.tmj")
        except ProblemsError as error:
            problems += error.problems
    broken = package_problems()
    yield from ((BAD, "packages", str(problem)) for problem in broken)
    others = [problem for problem in problems if problem.file not in {one.file for one in broken}]
    yield from ((BAD, "shipped files", str(problem)) for problem in dict.fromkeys(others))
    if not problems:
        yield OK, "shipped files", f"{len(shipped_levels())} levels and {len(shipped().names())} brushes"


CHECKS = (_python, _packages, _numba, _display, _programs, _shipped)

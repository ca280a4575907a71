"""Kernels that a wheel brings with it, compiled for a few kinds of processors, as `flockbrush build-wheel` makes it.

They are copied into the user's own cache before the first start, where numba finds them; it compares hashes of the
sources.  Read before numba is imported, so it must not import it.
"""

from __future__ import annotations

import hashlib
import json
import os
import platform
import shutil
import sys
from importlib import metadata
from pathlib import Path

FOLDER = "flockbrush/shipped_kernels"  # below the folder that the package is installed in
TABLE = "kernels.json"
_V3 = ("avx", "avx2", "bmi", "bmi2", "f16c", "fma", "lzcnt", "movbe")
_V4 = ("avx512f", "avx512bw", "avx512cd", "avx512dq", "avx512vl")
CPUS = {"x86-64-v4": (*_V3, *_V4), "x86-64-v3": _V3}  # LLVM's names, and what a processor must be able to do


def kind() -> dict[str, str]:
    """What compiled kernels can be used with, their processor apart."""
    packages = {name: metadata.version(name) for name in ("llvmlite", "numba")}
    return packages | {"python": sys.implementation.cache_tag, "system": platform.system(), "machine": machine()}


def machine():
    """The family of this processor, by one name on all systems."""
    return platform.machine().lower().replace("amd64", "x86_64")


def cache_name(folder):
    """The name that numba gives the kernels of a source folder below NUMBA_CACHE_DIR."""
    path = os.path.abspath(folder)
    return f"{os.path.basename(path)}_{hashlib.sha1(path.encode()).hexdigest()}"


def use_shipped_kernels(house, place):
    """Have numba use the kernels that came with the package, if they are for this machine.

    Parameters
    ----------
    house : path
        The folder that the package is installed in.
    place : path
        The folder that kernels are kept in (NUMBA_CACHE_DIR).
    """
    shipped = Path(house) / FOLDER
    cpu = _cpu_of(shipped / TABLE)
    if cpu is None or os.environ.get("NUMBA_CPU_NAME"):
        return
    try:
        _copy(shipped, Path(house), Path(place))
    except OSError:  # no room: what is missing is compiled
        return
    os.environ |= {"NUMBA_CPU_NAME": cpu, "NUMBA_CPU_FEATURES": ""}


def _cpu_of(table):
    """The best processor of a table that this one can stand in for; None where there is none, or no table."""
    try:
        names = json.loads(table.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return None
    if names["kind"] != kind():
        return None
    import llvmlite.binding

    able = llvmlite.binding.get_host_cpu_features()
    return next((cpu for cpu in CPUS if cpu in names["cpus"] and all(map(able.get, CPUS[cpu]))), None)


def _copy(shipped, house, place):
    """Copy what is shipped to where numba looks for it; once."""
    marker = place / f"{cache_name(house)}.json"
    if marker.exists():
        return
    files = [path for path in shipped.rglob("*") if path.is_file() and path.parent != shipped]
    for path in sorted(files, key=lambda path: path.suffix):  # what an index names is there before it
        sources = house / "flockbrush" / path.parent.relative_to(shipped)
        _copy_whole(path, place / cache_name(sources) / path.name)
    _copy_whole(shipped / TABLE, marker)


def _copy_whole(path, to):
    to.parent.mkdir(exist_ok=True)
    part = to.with_name(f".{to.name}.{os.getpid()}")
    shutil.copyfile(path, part)
    os.replace(part, to)

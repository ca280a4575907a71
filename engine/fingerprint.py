"""The build that made something: its sources, the libraries that may change its bits, the processor.

Two builds with the same ``code`` run the same sources, those of the user's own models and measures included.
Libraries are compared by version.  The processor is recorded for people and is never a reason to refuse anything.
"""

from __future__ import annotations

import hashlib
import importlib.util
import platform
import sys
from dataclasses import asdict, dataclass, field
from functools import cache
from importlib import metadata
from pathlib import Path

PACKAGES = ("esper", "llvmlite", "numba", "numpy", "scipy")  # what may change the bits of a run
SHOWN = 5  # files that a sentence names


@dataclass(frozen=True)
class Build:
    """What a process runs."""

    code: str  # SHA-256 over all of `sources`
    sources: dict[str, str] = field(repr=False)  # {file: the first 8 hexadecimal digits of its SHA-256}
    packages: dict[str, str]  # {name: version}, Python too
    cpu: str  # what kernels are compiled for

    def as_json(self):
        """The build as a table that JSON can hold."""
        return asdict(self)


def build_of(packages, modules=()):
    """The build of this process.

    Files are read once: what changes on the disk later is not what this process runs.

    Parameters
    ----------
    packages : iterable of str
        Our own packages, by import name.
    modules : iterable of str
        Modules of users; for one inside a package, the whole package counts.  One that has no file, such as what is
        typed into a notebook, cannot be compared and is left out.

    Returns
    -------
    Build
    """
    packages = tuple(packages)
    foreign = {name.split(".")[0] for name in modules} - {package.split(".")[0] for package in packages}
    sources, whole = {}, hashlib.sha256()
    for name in sorted((*packages, *foreign)):
        for file, digest in _sources(name, tuple(p for p in packages if p.startswith(f"{name}."))):
            sources[file] = digest[:8]
            whole.update(f"{file} {digest}\n".encode())
    return Build(whole.hexdigest(), sources, package_versions(), cpu())


@cache
def _sources(name, without=()):
    """((file, SHA-256), ...) of a module or of all modules of a package, but of these packages below it."""
    folders, files = _places(name)
    others = [folder for package in without for folder in _places(package)[0]]
    stem = name.replace(".", "/")
    sources = [(file.name, file) for file in files]
    for folder in folders:
        within = [path for path in folder.rglob("*.py") if not any(path.is_relative_to(other) for other in others)]
        sources += [(f"{stem}/{path.relative_to(folder).as_posix()}", path) for path in within]
    return tuple(sorted((file, _digest(path)) for file, path in sources))


def _places(name):
    """([folders of a package], [the file of a module, if it has one])."""
    try:
        spec = importlib.util.find_spec(name)
    except (ImportError, ValueError):  # ``__main__`` has none
        spec = None
    if spec is not None and spec.submodule_search_locations:
        return [Path(folder) for folder in spec.submodule_search_locations], []
    origin = spec.origin if spec is not None else getattr(sys.modules.get(name), "__file__", None)
    return [], [Path(origin)] if origin else []


def _digest(path):
    """SHA-256 of a file with the line ends of every system alike; of nothing when it cannot be read."""
    try:
        data = path.read_bytes()
    except OSError:
        data = b""
    return hashlib.sha256(data.replace(b"\r\n", b"\n")).hexdigest()


@cache
def package_versions():
    """{name: version} of Python and of the packages that may change the bits of a run."""
    versions = {"python": platform.python_version()}
    for name in PACKAGES:
        try:
            versions[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            continue
    return versions


def cpu():
    """The processor that kernels are compiled for, such as "znver3, x86_64, Linux"."""
    import llvmlite.binding
    import numba

    name = numba.config.CPU_NAME or llvmlite.binding.get_host_cpu_name()
    return f"{name}, {platform.machine()}, {platform.system()}"


# what differs ------------------------------------------------------------------------------


def differing_files(recorded, current, own=None):
    """["systems/pace.py", "mine.py (not here)", ...]: sources that are not the same in two builds.

    Parameters
    ----------
    there, here : dict of str to str
        `Build.sources` of the other build and of this one.
    own : collection of str, optional
        First folders of files that count when they are only here; all of them by default.
    """
    differing = [
        name if name in current else f"{name} (not here)" for name in recorded if current.get(name) != recorded[name]
    ]
    new = [name for name in current if name not in recorded and (own is None or name.split("/")[0] in own)]
    return sorted(differing + [f"{name} (only here)" for name in new])


def differing_packages(recorded, current):
    """["numpy 2.1 (here 2.4)", ...]: versions that are not the same in two builds."""
    return [
        f"{name} {recorded[name]} (here {current.get(name)})"
        for name in sorted(recorded)
        if recorded[name] != current.get(name)
    ]


def first_names(names):
    """The first few names of many, in words."""
    more = len(names) - SHOWN
    return ", ".join(names[:SHOWN]) + (f" and {more} more" if more > 0 else "")

"""Comparison of builds: of recordings, sweep journals and workers."""

from __future__ import annotations

from functools import cache
from importlib.metadata import entry_points

from flockbrush.engine.commands import commands
from flockbrush.engine.fingerprint import Build, build_of, differing_files, differing_packages, first_names

RUNNING = tuple(f"flockbrush.{room}" for room in ("engine", "components", "behaviours", "systems", "levels"))
OURS = ("flockbrush", *RUNNING)  # RUNNING: what a tick and the beginning of a run are made of
LOOKS = ("flockbrush.overlays", "flockbrush.exporters")  # entry points that change no number
NUMBERS = ("flockbrush.experiments", "flockbrush.measures")  # and those that change no herd


def build_of_run() -> Build:
    """The build of a run: the sources that run levels, and those of the user's models, systems and commands."""
    from flockbrush.levels.build import systems

    classes = [*map(type, systems()), *commands().values()]
    modules = _installed((*LOOKS, *NUMBERS)) | _registered() | {kind.__module__ for kind in classes}
    return build_of(RUNNING, modules)


@cache
def build_of_worker() -> Build:
    """The build of a process that does the work of others: our sources, and those of packages that add to them.

    It is taken once: whatever is edited on the disk later is not what this process runs.  A model that a program
    registers by itself is not in it: a worker that lacks one says so when it is asked for.
    """
    return build_of(OURS, _installed(LOOKS))


def build_of_sweep(experiment: str = "") -> Build:
    """The build that makes the rows of a sweep: that of a worker, and what this program has registered.

    Parameters
    ----------
    experiment : str
        The module of the sweep's experiment.
    """
    from flockbrush.systems.measures import measures

    own = {one.compute.__module__ for one in measures().values()} | ({experiment} if experiment else set())
    return _built(frozenset(_installed(LOOKS) | _registered() | own))


@cache
def _built(modules):
    return build_of(OURS, modules)


@cache
def _installed(without):
    """Modules of the entry points of users, but of these groups."""
    points = entry_points()
    groups = {name for name in points.groups if name.startswith("flockbrush.")} - set(without)
    return {point.module for name in groups for point in points.select(group=name)}


def _registered():
    """Modules of models, drives and conditions, also of those that were registered without an entry point."""
    from flockbrush.behaviours.behaviour import behaviours
    from flockbrush.behaviours.drive import drives
    from flockbrush.behaviours.trigger import conditions

    functions = [*(one.steer for one in behaviours().values()), *(one.urge for one in drives().values())]
    return {thing.__module__ for thing in (*functions, *conditions().values())}


def differences(there, build: Build, own=None):
    """Differences between another build and this one, as text.

    Parameters
    ----------
    there : dict
        `Build.as_json`, from a file or another process; parts of it may be missing or of another shape.
    build : Build
        Of this process.
    own : collection of str, optional
        First folders of files that count when they are only here; all of them by default.

    Returns
    -------
    dict of str to str
        Of "code", "libraries" and "cpu" those that differ.
    """
    differing = {}
    sources, packages = (_texts(there.get(name)) for name in ("sources", "packages"))
    files = differing_files(sources, build.sources, own)
    if not isinstance(there.get("code"), str) or not sources:
        differing["code"] = "unknown code"
    elif there["code"] != build.code and files:
        differing["code"] = f"other code: {first_names(files)}"
    libraries = differing_packages(packages, build.packages)
    if libraries:
        differing["libraries"] = ", ".join(libraries)
    if isinstance(there.get("cpu"), str) and there["cpu"] != build.cpu:
        differing["cpu"] = f"{there['cpu']} (here {build.cpu})"
    return differing


def _texts(table):
    """The texts of an untrusted table."""
    table = table if isinstance(table, dict) else {}
    return {str(k)[:200]: v[:200] for k, v in table.items() if isinstance(v, str)}

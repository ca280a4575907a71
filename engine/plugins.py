"""Finds what registers itself: the modules of a package of this repository, and those that installed packages name."""

from __future__ import annotations

import importlib
import pkgutil
import sys
import traceback
from contextlib import contextmanager
from importlib.metadata import entry_points
from types import ModuleType
from typing import Any

from flockbrush.engine.plain_text import one_line
from flockbrush.engine.problems import Problem, ProblemsError


class PluginError(ProblemsError):
    """What is registered failed in a run; ``str()`` says what, with file and line."""


@contextmanager
def blaming(kind, name, module, passes=()):
    """Call what is registered, and check what it returns: what is raised meanwhile becomes a `PluginError`.

    Errors of what this repository registers stay as they are, as do ProblemsError and MemoryError.

    Parameters
    ----------
    kind, name : str
        Such as "drive" and the name of the drive; a check names both by itself.
    module : str
        Where it is from.
    passes : tuple of exception classes
        Others that stay as they are.
    """
    try:
        yield
    except (PluginError, ProblemsError, MemoryError, *passes):
        raise
    except Exception as error:
        if is_ours(module):
            raise
        (file, line), said = _place(error, module), one_line(str(error))
        if line or repr(name) not in said:
            said = f"{kind} {name!r} of {module} failed: {type(error).__name__}: {said}"
        raise PluginError([Problem(file, line, None, said)]) from error


def is_ours(module: str) -> bool:
    """Whether a module is of this repository."""
    return module.startswith("flockbrush.")


def _place(error, module):
    """(file, line) where a module raised an error; without the line where it did not."""
    for frame, line in reversed([*traceback.walk_tb(error.__traceback__)]):
        if frame.f_globals.get("__name__") == module:
            return frame.f_code.co_filename, line
    return file_of(module), None


def file_of(module: str) -> str:
    """The file of a module that is loaded, or the module's name where it has none."""
    return getattr(sys.modules.get(module), "__file__", None) or f"module {module}"


def load_modules(package: ModuleType) -> None:
    """Import every module of a package, in order of name."""
    for name in sorted(module.name for module in pkgutil.iter_modules(package.__path__)):
        importlib.import_module(f"{package.__name__}.{name}")


def load_entry_points(group: str) -> list[Any]:
    """What installed packages offer under an entry point group, in order of name.

    Raises
    ------
    ProblemsError
        When one of them cannot be loaded, with the package and its entry point.
    """
    return [_loaded(point) for point in sorted(entry_points(group=group), key=lambda point: point.name)]


def package_problems() -> list[Problem]:
    """What is wrong with any entry point that an installed package offers to Flockbrush."""
    problems = []
    for group in sorted(name for name in entry_points().groups if name.startswith("flockbrush.")):
        for point in entry_points(group=group):
            try:
                _loaded(point)
            except ProblemsError as error:
                problems += error.problems
    return problems


def _loaded(point):
    try:
        return point.load()
    except Exception as error:
        package = f"package {point.dist.name}" if point.dist else "an installed package"
        where = f"entry point {point.name} = {point.value} in group {point.group}"
        message = f"cannot be loaded ({type(error).__name__}: {error}); repair or uninstall the package"
        raise ProblemsError([Problem(package, None, where, message)]) from error

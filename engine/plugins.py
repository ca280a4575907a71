"""Finds what registers itself: the modules of a package of this repository, and those that installed packages name."""

from __future__ import annotations

import importlib
import pkgutil
from importlib.metadata import entry_points
from types import ModuleType
from typing import Any

from flockbrush.engine.problems import Problem, ProblemsError


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

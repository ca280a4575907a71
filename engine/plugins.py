"""Finds what registers itself: the modules of a package of this repository, and those that installed packages name."""

from __future__ import annotations

import importlib
import pkgutil
from importlib.metadata import entry_points
from types import ModuleType
from typing import Any


def load_modules(package: ModuleType) -> None:
    """Import every module of a package, in order of name."""
    for name in sorted(module.name for module in pkgutil.iter_modules(package.__path__)):
        importlib.import_module(f"{package.__name__}.{name}")


def load_entry_points(group: str) -> list[Any]:
    """What installed packages offer under an entry point group, in order of name."""
    return [point.load() for point in sorted(entry_points(group=group), key=lambda point: point.name)]

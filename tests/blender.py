"""Blender as a Python module, in this Python or in one that BLENDER_PYTHON names (bpy 5.2 needs Python 3.13)."""

import functools
import importlib.util
import os
import sys

WITHOUT_BLENDER = "no package bpy: install it, or name a Python that has it in BLENDER_PYTHON"


@functools.cache
def blender_python():
    """The Python that has bpy, or None."""
    return os.environ.get("BLENDER_PYTHON") or (sys.executable if importlib.util.find_spec("bpy") else None)

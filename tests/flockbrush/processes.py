"""The command in a process of its own."""

import os
import subprocess
import sys
from pathlib import Path

HOUSE = Path(__file__).parents[2]


def environment(**variables):
    """The environment of another process that finds this house."""
    plain = {name: value for name, value in os.environ.items() if not name.startswith("FLOCKBRUSH")}
    plain.pop("PYTHONDONTWRITEBYTECODE", None)  # each process would compile every module anew
    fixed = {"PYTHONPATH": str(HOUSE), "NO_COLOR": "1", "COLUMNS": "200"}
    return plain | fixed | {name: str(value) for name, value in variables.items()}


def other_process(*arguments, cwd=None, timeout=300, **variables):
    """``python -m flockbrush`` in a process of its own, with these environment variables."""
    return subprocess.run(
        [sys.executable, "-m", "flockbrush", *map(str, arguments)],
        cwd=cwd, env=environment(**variables), capture_output=True, text=True, timeout=timeout, check=False,
    )  # fmt: skip

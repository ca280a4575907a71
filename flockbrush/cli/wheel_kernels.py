"""Compiles the kernels that some levels need at their start; `build-wheel` runs it for each CPU in a process."""

from __future__ import annotations

import sys


def main(house, *levels):
    """Compile the kernels of levels with the package in the folder `house`."""
    import flockbrush
    from flockbrush.runs.compile_ahead import CompileAhead

    if not flockbrush.__file__.startswith(house):
        sys.exit(f"{flockbrush.__file__} is not in {house}")
    for level in levels:
        CompileAhead({"name": level, "seed": None, "agents": None, "brush": None}).compile_now()


if __name__ == "__main__":
    main(*sys.argv[1:])

"""Lists the packages of all rooms, and makes the text for a package index of README.md.

Pictures and links of README.md are relative to the repository.
With an address in ``REPOSITORY`` pictures and links lead there; without one pictures are left out, and links are text.
Everything else about the package is in pyproject.toml.
"""

import re
import tomllib
from pathlib import Path

from setuptools import setup

HERE = Path(__file__).parent

REPOSITORY = ""  # such as https://example.org/flockbrush/blob/main, once the repository has a public address


def for_an_index(text: str, repository: str = REPOSITORY) -> str:
    """README.md without relative links.

    >>> for_an_index("![A herd](docs/herd.png) [Pages](docs/a.md), [Tiled](https://tiled.org)")
    ' Pages, [Tiled](https://tiled.org)'
    >>> for_an_index("![A herd](docs/herd.png)", "https://example.org/blob/main")
    '![A herd](https://example.org/raw/main/docs/herd.png)'
    """
    raw = repository.replace("/blob/", "/raw/")
    text = re.sub(r"(!\[[^]]*\]\()(?!http)([^)]*\))", rf"\g<1>{raw}/\2" if raw else "", text)
    return re.sub(r"(?<!!)\[([^]]*)\]\((?!http)([^)]*)\)", rf"[\1]({repository}/\2)" if repository else r"\1", text)


def packages() -> list[str]:
    """Dotted names of all folders with an ``__init__.py`` in the rooms that pyproject.toml maps."""
    rooms = tomllib.loads((HERE / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["setuptools"]["package-dir"]
    return sorted(
        ".".join((name, *init.parent.relative_to(HERE / folder).parts))
        for name, folder in rooms.items()
        for init in (HERE / folder).rglob("__init__.py")
    )


if __name__ == "__main__":
    readme = for_an_index((HERE / "README.md").read_text(encoding="utf-8"))
    setup(packages=packages(), long_description=readme, long_description_content_type="text/markdown")

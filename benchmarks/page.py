"""Frames per second of the shared page in headless Chromium with software rendering, at 1280 x 720.

    python benchmarks/page.py [--animals 2000] [--seconds 4]

A run of `crowded` is exported as a page and played; frames are counted three times.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests"))

from browser import Browser, chromium

from flockbrush.cli.bench import machine

COUNT = """window.flockbrush.then(async (page) => {
    page.playing = true;
    const first = page.frames, begin = performance.now();
    while (performance.now() - begin < %d) {
        page.dirty = true;
        await new Promise(requestAnimationFrame);
    }
    return 1000 * (page.frames - first) / (performance.now() - begin);
})"""


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--animals", type=int, default=2000)
    parser.add_argument("--seconds", type=float, default=4)
    options = parser.parse_args()
    if chromium() is None:
        sys.exit("there is no Chromium here")
    with tempfile.TemporaryDirectory() as folder, Browser() as browser:
        path = Path(folder) / "run.html"
        words = ["run", "crowded", "--agents", str(options.animals), "--seconds", "6", "--export", str(path)]
        subprocess.run([sys.executable, "-m", "flockbrush", *words], check=True, stdout=subprocess.DEVNULL)
        browser.open(path)
        browser.evaluate("new Promise((done) => setTimeout(done, 3000))")
        rates = [browser.evaluate(COUNT % (1000 * options.seconds)) for _ in range(3)]
    print(f"{options.animals:,} animals: {', '.join(f'{rate:.1f}' for rate in rates)} frames per second; {machine()}")


if __name__ == "__main__":
    main()

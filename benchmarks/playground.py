"""Time a frame of the playground, split into simulation, drawing and interface, and compare it with a lower bound.

    python benchmarks/playground.py [--counts 2000 10000] [--frames 180] [--level meadow] [--space] [--cpu] [--json]

The window is 1280 x 720 on SDL's dummy driver, with the panels and overlays that are open by default.  It runs at 60
frames per second and sleeps after faster frames.  Ticks (32 per second) run in parallel with the drawing, as in the
main loop; "simulation" is the time spent waiting for them.  In the same run, round by round, two references are
measured:

* headless ticks: the same level and number of animals without drawing;
* bare blit: a picture of the size of the window copied onto the screen, and a flip.

Their sum ("floor") is the lower bound for a program that ticks and draws one after the other.

``--cpu`` measures CPU time instead of wall time, for busy machines: of the drawing thread, and of all threads for
headless ticks.  ``--space`` shows the whole herd in the 3D view and follows it; use it with a level of birds, such as
``--level pillars --counts 1000 10000``.

Goals: a mean over all frames of 12 ms for 2,000 animals and 30 ms for 10,000, and 25 ms for 99 % of the frames with
10,000.
"""

from __future__ import annotations

import argparse
import gc
import json
import os
import sys
import tempfile
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

SIZE = (1280, 720)
FPS = 60
PARTS = ("simulation", "drawing", "interface")
GOALS = {2_000: 12.0, 10_000: 30.0}  # ms
FRAMES, TICKS = (SimpleNamespace(perf_counter=time.perf_counter) for _ in range(2))  # what times are taken with


def silent(folder):
    """Use no display, no sound and default settings."""
    os.environ |= {"SDL_VIDEODRIVER": "dummy", "SDL_AUDIODRIVER": "dummy", "FLOCKBRUSH_CONFIG": folder}
    os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")


class Playground:
    """The playground with a running herd."""

    def __init__(self, level, count, folder, space=False):
        import flockbrush.studio.app as window
        from flockbrush.studio.app import App
        from flockbrush.studio.session import Session

        window.time = FRAMES
        self.session = Session.open(level, agents=count, state_folder=folder)
        self.session.play()
        self.app = App(self.session, SIZE, "light")
        self.app.notify, self.app.patience = _silent, 0.0
        if space != self.app.canvas.in_space:  # levels of birds open in space
            self.app.toggle_space()
        if space and not self.app.canvas.follows:
            self.app.toggle_follow()

    def frames(self, count):
        """Return (ms of each part, whether it shows a new tick) of each frame."""
        found = []
        for _ in range(count):
            begin, before = time.perf_counter(), self.session.moment
            self.app.frame(1 / FPS)
            found.append((*(1000 * self.app.seconds[part] for part in PARTS), self.session.moment is not before))
            time.sleep(max(0.0, begin + 1 / FPS - time.perf_counter()))
        self.session.timeline  # noqa: B018  the last tick has ended: it does not run beside what is measured next
        return found


class Headless:
    """The same level without drawing."""

    def __init__(self, level, count):
        from flockbrush.runs.run import start

        self.simulation = start(level, agents=count)

    def ticks(self, count):
        """Return the milliseconds of each tick."""
        return [timed(self.simulation.tick) for _ in range(count)]


class Blit:
    """A picture copied onto the screen."""

    def __init__(self):
        import pygame

        self.screen, self.flip = pygame.display.get_surface(), pygame.display.flip
        self.picture = np.random.default_rng(1).integers(0, 255, (SIZE[1], SIZE[0], 3), np.uint8)
        self.surface = pygame.image.frombuffer(self.picture, SIZE, "RGB")

    def show(self):
        """Show one frame with the picture alone."""
        self.screen.blit(self.surface, (0, 0))
        self.flip()

    def frames(self, count):
        """Return the milliseconds of each frame."""
        return [timed(self.show) for _ in range(count)]


def _silent(text, kind="info"):
    """Ignore notifications, which would be drawn."""


def timed(do):
    """Return the milliseconds of one call."""
    begin = TICKS.perf_counter()
    do()
    return 1000 * (TICKS.perf_counter() - begin)


def measured(level, count, frames, space=False, rounds=6):
    """Return the means for one number of animals, ms."""
    with tempfile.TemporaryDirectory() as folder:
        playground, headless = Playground(level, count, folder, space), Headless(level, count)
        blit = Blit()
        playground.frames(40)  # compiled, drawn once, warm
        headless.ticks(8)
        ours, ticks, blits = [], [], []
        gc.collect()
        for _ in range(rounds):
            ours += playground.frames(max(1, frames // rounds))
            ticks += headless.ticks(max(1, frames * 32 // FPS // rounds))
            blits += blit.frames(max(1, frames // rounds))
        playground.app.close()
    return summed(np.array(ours), float(np.mean(ticks)), float(np.mean(blits)))


def summed(frames, tick, blit):
    """Return means over all frames and over frames that show a new tick, with the floor of each."""
    with_tick = frames[:, 3] > 0

    def means(rows, ticks_a_frame):
        parts = rows[:, :3].mean(0) if len(rows) else np.full(3, np.nan)
        whole = rows[:, :3].sum(1) if len(rows) else np.full(1, np.nan)
        found = dict(zip(PARTS, map(float, parts), strict=True))
        floor = tick * ticks_a_frame + blit
        return found | {"together": float(whole.mean()), "99 % below": float(np.quantile(whole, 0.99)), "floor": floor}

    share = float(with_tick.mean())
    return {
        "all frames": means(frames, share),
        "after a tick": means(frames[with_tick], 1.0),
        "peers": {"headless tick": tick, "bare blit": blit, "frames with a tick": share},
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--counts", type=int, nargs="+", default=[2_000, 10_000])
    parser.add_argument("--frames", type=int, default=180)
    parser.add_argument("--level", default="meadow")
    parser.add_argument("--space", action="store_true", help="the 3D view")
    parser.add_argument("--cpu", action="store_true", help="CPU time")
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    if options.cpu:  # of the drawing thread; the other threads run the tick
        FRAMES.perf_counter, TICKS.perf_counter = time.thread_time, time.process_time
    with tempfile.TemporaryDirectory() as folder:
        silent(folder)
        table = {count: measured(options.level, count, options.frames, options.space) for count in options.counts}
    if options.json:
        print(json.dumps(table, indent=2))
        return
    show(table, options)


def show(table, options):
    """Print the table, with the goal beside the mean of all frames."""
    from flockbrush.engine.parallel import threads

    load = f"load {os.getloadavg()[0]:.2f}" if hasattr(os, "getloadavg") else "load unknown"
    level = options.level + " in 3D" * options.space
    of = f"{level}, {threads()} threads, {options.frames} frames, {os.cpu_count()} cores, {load}"
    print(f"{'ms CPU' if options.cpu else 'ms'} per frame at {SIZE[0]} x {SIZE[1]}: {of}")
    names = [*PARTS, "together", "99 % below", "floor"]
    print(f"{'animals':>9}  {'':<12}" + "".join(f"{name:>12}" for name in names) + f"{'goal':>8}")
    for count, rows in table.items():
        for kind in ("all frames", "after a tick"):
            goal = f"{GOALS[count]:.0f}" if count in GOALS and not options.space and kind == "all frames" else ""
            cells = "".join(f"{rows[kind][name]:>12.2f}" for name in names)
            print(f"{count:>9,}  {kind:<12}{cells}{goal:>8}")
        peers = rows["peers"]
        print(
            f"{'':>9}  headless tick {peers['headless tick']:.2f}, bare blit {peers['bare blit']:.2f}, "
            f"{100 * peers['frames with a tick']:.0f} % of the frames show a new tick, "
            f"{1000 / rows['all frames']['together']:.0f} frames per second"
        )


if __name__ == "__main__":
    main()

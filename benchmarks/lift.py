"""Compare lifted flocks and tracks with the truth: ``python benchmarks/lift.py depth|order|pigeons|tracking``.

``depth``, ``order`` and ``tracking`` use simulated boids filmed by a virtual camera.  ``pigeons`` uses pigeons with GPS
(Nagy et al.  2010 [1]_) filmed by a virtual camera; it is skipped if ``../shared/data`` does not have them.

.. [1] Nagy, M., Akos, Z., Biro, D., Vicsek, T. (2010). Hierarchical group dynamics in pigeon flocks. Nature 464,
   890-893.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import least_squares

sys.path.insert(0, str(Path(__file__).parents[1]))

from flockbrush.behaviours.brush import BrushLibrary, shipped
from flockbrush.components import Position
from flockbrush.levels.build import build
from flockbrush.levels.schema import Level, Spawn

from benchmarks.sky_film import compute_tracking, film
from flockbrush.film.tracking import Tracker
from flockbrush.film.tracks import Tracks
from flockbrush.lifting.lens import Camera
from flockbrush.lifting.lift_solver import TOSS, LiftError, lift
from flockbrush.lifting.lift_thesis import lift_by_thesis

FRAMES, FPS, WARM = 200, 32, 256  # frames, frames per second (every tick), ticks before the film starts
TRACKED = (("crossing", 20), ("crossing", 80), ("tight", 20), ("starlings", 5), ("starlings", 20), ("starlings", 50))
UNSEEN = 12  # first seed of flights that the confidence in the order was not tuned on
MARGIN = 1.05  # of the picture's half width and height
PITCHES = (0, 20, 40, 60)  # degrees that the camera looks up, one after the other
PIGEONS = Path(__file__).parents[2] / "shared" / "data" / "pigeons_ff11"
ALOFT = (55, 258)  # s of that flight during which all ten fly
CIRCLING = 100  # degrees turned in a film, above which a flock is circling

# Changes of the brush starlings, (parameters, speed).  "tight" gives the flocks of the goals: birds 2 to 3 m apart that
# keep changing speed, at a polarization of about .99.
FLOCKS = {
    "tight": ({"separation": 14, "matching_time": 1.0, "height_strength": 0.0}, {"deviation": 12.0}),
    "loose": (
        {"separation": 14, "matching_time": 2.5, "matching_strength": 0.7, "height_strength": 0.0},
        {"deviation": 12.0},
    ),
    "very loose": (
        {"separation": 14, "matching_time": 6.0, "matching_strength": 0.15, "height_strength": 0.0},
        {"deviation": 15.0},
    ),
    "starlings": ({}, {}),
}

# goals for tight flocks, a field of view of 60 degrees, noise up to 2 px, at least 12 cases
BARS = {
    5: {"error": 0.07, "p90": 0.13, "ratio": 0.7, "correlation": 0.85, "order": 0.70, "direction": 16, "time": 0.2},
    10: {"error": 0.06, "p90": 0.10, "ratio": 0.5, "correlation": 0.90, "order": 0.65, "direction": 12, "time": 0.5},
    20: {"error": 0.05, "p90": 0.07, "ratio": 0.5, "correlation": 0.90, "order": 0.65, "direction": 8, "time": 1.0},
    50: {"error": 0.05, "p90": 0.07, "ratio": 0.45, "correlation": 0.90, "order": 0.65, "direction": 6, "time": 4.0},
}
HIGHER = ("correlation", "order")  # larger is better


def flight(birds, seed, kind="starlings"):
    """Return a flight of boids about its centre, (FRAMES, birds, 3) m."""
    side = 2.0 * birds ** (1 / 3)
    square = np.array([(1000, 1000), (1000 + side, 1000), (1000 + side, 1000 + side), (1000, 1000 + side)])
    heading = 0.7 * seed
    spawn = Spawn(1, "flock", square, "starling", "starlings", birds, heading, altitude=60.0, depth=side)
    parameters, speed = FLOCKS[kind]
    brush = shipped().get("starlings").with_parameters(**parameters)
    brush = brush.model_copy(update={"speed": brush.speed.model_copy(update=speed)})
    library = BrushLibrary(files={"starlings.brush.toml": brush.source})
    simulation = build(Level("sky", None, 2000, 2000, 20.0, "open", seed, spawns=[spawn]), library=library)
    simulation.run(WARM)
    path = []
    for _ in range(FRAMES):
        path.append(simulation.agents[Position.xyz].copy())
        simulation.tick()
    simulation.close()
    xyz = np.array(path)
    return xyz - xyz.mean((0, 1))


def turned(xyz, seed):
    """Return the flight rotated, for a camera that looks up by one of `PITCHES`, (F, N, 3) m."""
    yaw, pitch = 1.7 * seed, np.radians(PITCHES[seed % len(PITCHES)])
    about_z = np.array([[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]])
    about_x = np.array([[1, 0, 0], [0, np.cos(pitch), np.sin(pitch)], [0, -np.sin(pitch), np.cos(pitch)]])
    return (xyz - xyz.mean((0, 1))) @ about_z.T @ about_x.T


def crossing(birds, seed):
    """Return (xyz relative to the camera, camera) of birds with the same mean course that wander and cross."""
    chance = np.random.default_rng(100 + seed)
    camera = Camera(width=1280, height=720, horizontal_fov_deg=60, fps=30, mean_speed=5, near=1, far=1000)
    at = np.column_stack([chance.uniform(-12, -2, birds), chance.uniform(35, 60, birds), chance.uniform(-8, 8, birds)])
    velocity = [5.0, 0, 0] + chance.normal(0, 1, (birds, 3)) * [0.6, 0.6, 0.8]
    gust, path = np.zeros((birds, 3)), []
    for _ in range(FRAMES):
        gust += chance.normal(0, 0.09, (birds, 3)) - 0.02 * gust
        velocity[:, 2] -= 0.002 * at[:, 2]
        at = at + (velocity + gust) / camera.fps
        path.append(at)
    return np.array(path), camera


def filmed(xyz, least=40.0, fov=60, fps=FPS):
    """Return (xyz relative to the camera, camera); the distance in m is the least that shows the whole flight."""
    speed = float(np.linalg.norm(np.diff(xyz, axis=0), axis=-1).mean() * fps)
    camera = Camera(width=1280, height=720, horizontal_fov_deg=fov, fps=fps, mean_speed=speed, near=1, far=10_000)
    half = 0.5 * np.array([camera.width, camera.height]) / camera.focal
    needs = np.abs(xyz[..., [0, 2]]) * MARGIN / half - xyz[..., 1:2]
    return xyz + [0, max(least, float(needs.max())), 0], camera


def seen(xyz, camera, noise, seed):
    """Return the tracks of birds with noise in pixels."""
    px = camera.project(xyz)
    return Tracks(px + noise * np.random.default_rng(seed).normal(size=px.shape), np.arange(px.shape[1]))


def in_part(tracks, what, seed):
    """Return tracks with gaps of up to half a second, or with birds that enter late and leave early."""
    chance = np.random.default_rng(seed)
    px = tracks.px.copy()
    frames, birds = px.shape[:2]
    for n in range(birds):
        if what == "gaps":
            for begin in chance.integers(1, frames - 20, 6):
                px[begin : begin + chance.integers(2, 16), n] = np.nan
        elif n:  # the first bird is always visible
            stays = chance.integers(frames // 4, frames)
            begin = chance.integers(0, frames - stays + 1)
            px[:begin, n] = px[begin + stays :, n] = np.nan
    return Tracks(px, tracks.ids)


def compute_flock(xyz, fps=FPS):
    """Return (polarization, distance to the nearest neighbour, degrees turned) of a flight."""
    way = np.diff(xyz, axis=0)
    ahead = (way / np.linalg.norm(way, axis=-1, keepdims=True)).mean(1)
    gaps = np.linalg.norm(xyz[:, :, None] - xyz[:, None], axis=-1) + np.diag(np.full(xyz.shape[1], np.inf))
    middle = way.mean(1)
    heading = np.unwrap(np.arctan2(middle[:, 1], middle[:, 0]))
    return np.linalg.norm(ahead, axis=-1).mean(), gaps.min(2).mean(), float(np.degrees(np.ptp(heading)))


def compute_depth(truth, flight):
    """Return the errors of depths, after fitting the one scale that a camera cannot know.

    Returns
    -------
    dict
        error and constant: root mean square error over the mean depth, of the flight and of one constant depth;
        correlation; order: share of pairs more than .5 m apart in the right order; direction: degrees.
    """
    found = flight.depth
    deep = np.where(np.isfinite(found), np.linalg.norm(truth, axis=-1), np.nan)
    scaled = found * np.nansum(deep * found) / np.nansum(found**2)
    i, j = np.triu_indices(deep.shape[1], 1)
    apart = np.abs(deep[:, i] - deep[:, j]) > 0.5
    order = (np.sign(deep[:, i] - deep[:, j]) == np.sign(found[:, i] - found[:, j]))[apart]
    a, b = np.diff(truth, axis=0), np.diff(flight.xyz, axis=0)
    cosine = (a * b).sum(-1) / np.maximum(np.linalg.norm(a, axis=-1) * np.linalg.norm(b, axis=-1), 1e-12)
    there = np.isfinite(found)
    return {
        "error": np.sqrt(np.nanmean((scaled - deep) ** 2)) / np.nanmean(deep),
        "constant": np.nanstd(deep) / np.nanmean(deep),
        "correlation": np.corrcoef(deep[there], found[there])[0, 1] if np.ptp(found[there]) > 0 else 0.0,
        "order": order.mean() if len(order) else np.nan,
        "direction": np.degrees(np.nanmean(np.arccos(np.clip(cosine, -1, 1)))),
    }


class Tally:
    """Measurements over several flights."""

    def __init__(self):
        self.rows, self.seconds, self.failed = [], [], []

    def add(self, truth, tracks, camera, method=lift):
        """Lift a flight and measure it."""
        begin = time.process_time()
        try:
            found = method(tracks, camera)
        except LiftError as error:
            self.failed.append(str(error))
            return
        self.seconds.append(time.process_time() - begin)
        self.rows.append(compute_depth(truth, found))

    def told(self):
        """Return the measures of a table row."""
        every = {key: np.array([row[key] for row in self.rows]) for key in self.rows[0]}
        return {
            "constant": np.median(every["constant"]),
            "error": np.median(every["error"]),
            "p90": np.percentile(every["error"], 90),
            "ratio": every["error"].mean() / every["constant"].mean(),
            "correlation": np.median(every["correlation"]),
            "order": np.nanmean(every["order"]),
            "direction": every["direction"].mean(),
            "time": np.median(self.seconds),
        }

    def line(self, bars=None):
        """Return a row of the table; with goals, also the missed ones."""
        told = self.told()
        text = (
            f"{told['constant']:.3f} | {told['error']:.3f} | {told['p90']:.3f} | {told['ratio']:.2f} "
            f"| {told['correlation']:.2f} | {told['order']:.2f} | {told['direction']:.1f}° | {told['time']:.2f} s |"
        )
        if bars:
            missed = [
                f"{key} {told[key]:.2f}, goal {bar:g}"
                for key, bar in bars.items()
                if (told[key] < bar if key in HIGHER else told[key] > bar)
            ]
            text += f" {'missed: ' + '; '.join(missed) if missed else 'all reached'} |"
        return text + (f" {len(self.failed)} refused: {self.failed[0]}" if self.failed else "")


MEASURES = "constant | error | p90 | / constant | correlation | order | direction | time |"


def depth(cases):
    """Print the tables of depths."""
    flights = {n: [flight(n, seed, "tight") for seed in range(cases)] for n in BARS}
    print(f"tight flocks, {cases} of each size, {FRAMES} frames, field of view 60 degrees:\n")
    for n in BARS:
        print(f"* {n} birds: {_of([compute_flock(xyz) for xyz in flights[n]])}")
    _times(flights[5][0], flights[50][0])
    print()
    print(f"| birds | noise, px | {MEASURES} goals |\n|{'---|' * 11}")
    for birds in BARS:
        for noise in (0, 0.5, 1, 2):
            tally = _tally(flights[birds], noise)
            print(f"| {birds} | {noise:g} | {tally.line(BARS[birds])}", flush=True)
    print(f"\nLin's method\n\n| birds | noise, px | {MEASURES}\n|{'---|' * 10}")
    for birds in (5, 10):
        print(f"| {birds} | 0.5 | {_tally(flights[birds], 0.5, method=lift_by_thesis).line()}", flush=True)
    print(f"\n10 birds, 0.5 px, other lenses\n\n| field of view | {MEASURES}\n|{'---|' * 9}")
    for fov in (15, 30, 60, 90):
        print(f"| {fov}° | {_tally(flights[10], 0.5, fov).line()}", flush=True)
    _coming_and_going(flights[10])
    print(f"\n20 birds, 0.5 px, other flocks\n\n| flock | {MEASURES}\n|{'---|' * 9}")
    for kind in FLOCKS:
        flown = flights[20] if kind == "tight" else [flight(20, seed, kind) for seed in range(cases)]
        print(f"| {kind}: {_of([compute_flock(xyz) for xyz in flown])} | {_tally(flown, 0.5).line()}", flush=True)


def order(cases):
    """Print how often the order in depth is right, by how often it is expected to be, in small tight flocks."""
    rows = []
    for birds in (5, 10):
        for seed in range(UNSEEN, UNSEEN + cases):
            truth, camera = filmed(turned(flight(birds, seed, "tight"), seed))
            found = lift(seen(truth, camera, 0.5, seed), camera)
            rows.append((found.order, compute_depth(truth, found)["order"], compute_within(truth, found)))
    print(f"flocks of 5 and 10 birds, {cases} each, 0.5 px, seeds from {UNSEEN}\n")
    print("| expected | flocks | expected, mean | right, mean | correlation within the flock | mirrored |")
    print("|---|---|---|---|---|---|")
    for name, low, high in (("below 0.6", 0.0, TOSS), ("0.6 to 0.7", TOSS, 0.7), ("above 0.7", 0.7, 1.01)):
        some = np.array([row for row in rows if low <= row[0] < high])
        if len(some):
            expected, right, within = some.mean(0)
            print(f"| {name} | {len(some)} | {expected:.2f} | {right:.2f} | {within:.2f} | {(some[:, 2] < 0).sum()} |")


def compute_within(truth, flight):
    """Return the correlation of true and found depths relative to the middle of the flock."""
    deep, found = np.linalg.norm(truth, axis=-1), flight.depth
    deep, found = (values - values.mean(1, keepdims=True) for values in (deep, found))
    return float(np.corrcoef(deep.ravel(), found.ravel())[0, 1])


def _coming_and_going(flights):
    """Print the table of birds that are not always visible."""
    print(f"\n10 birds, 0.5 px, not always visible\n\n| visible | {MEASURES}\n|{'---|' * 9}")
    for what, told in (
        ("all the time", "always"),
        ("gaps", "with six gaps per bird of up to half a second"),
        ("part", "for a quarter to all of the film, one bird always"),
    ):
        tally = Tally()
        for seed, xyz in enumerate(flights):
            truth, camera = filmed(turned(xyz, seed), 20.0)
            tracks = seen(truth, camera, 0.5, seed)
            tally.add(truth, tracks if what == "all the time" else in_part(tracks, what, seed), camera)
        print(f"| {told} | {tally.line()}", flush=True)


def _times(few, many):
    """Print the time of lifting with smoothing; the goals are 1 s for 5 birds (Lin's own) and 10 s for 50."""
    for birds, xyz, goal in ((5, few, 1), (50, many, 10)):
        truth, camera = filmed(turned(xyz, 0), 20.0)
        tally = Tally()
        tally.add(truth, seen(truth, camera, 0.5, 0), camera)
        print(f"* {birds} birds x {FRAMES} frames: {tally.seconds[0]:.2f} s CPU time, goal {goal} s")


def _of(flown):
    polarization, gap, turn = np.median(flown, axis=0)
    return f"polarization {polarization:.3f}, {gap:.1f} m to the nearest neighbour, turns by {turn:.0f}°"


def _tally(flights, noise, fov=60, method=lift):
    tally = Tally()
    for seed, xyz in enumerate(flights):
        truth, camera = filmed(turned(xyz, seed), 20.0, fov)
        tally.add(truth, seen(truth, camera, noise, seed), camera, method)
    return tally


# pigeons -----------------------------------------------------------------------------


def pigeon_films(seconds=8.0, fps=25, folder=PIGEONS):
    """Return consecutive films of the ten pigeons: [(seconds from the start, (F, 10, 3) m)].

    The data have five positions per second, smoothed with a Gaussian of .4 s; cubic splines interpolate them.
    """
    birds = [np.loadtxt(path, encoding="latin-1", comments="#") for path in sorted(Path(folder).glob("ff11_?.txt"))]
    begin = max(bird[0, 0] for bird in birds)
    length = min(len(bird[bird[:, 0] >= begin]) for bird in birds)
    places = np.stack([bird[bird[:, 0] >= begin][:length, 1:4] for bird in birds], axis=1)
    path = CubicSpline(np.arange(length) / 5, places)
    begins = np.arange(ALOFT[0], ALOFT[1] - seconds + 1e-9, seconds)
    return [(float(t), path(t + np.arange(round(seconds * fps)) / fps)) for t in begins]


def compute_wind(xyz, fps):
    """Return m/s: deviation of the ground speed, the wind that makes the airspeed most even, its deviation."""
    velocity = np.diff(xyz.mean(1), axis=0)[:, :2] * fps

    def uneven(guess):
        return np.linalg.norm(velocity - guess[:2], axis=1) - guess[2]

    found = least_squares(uneven, [0.0, 0.0, 15.0]).x
    return np.linalg.norm(velocity, axis=1).std(), float(np.hypot(*found[:2])), uneven(found).std()


def pigeons(noise):
    """Print the table of pigeons."""
    if not PIGEONS.is_dir():
        print(f"skipped: there is no {PIGEONS}")
        return
    print(f"ten pigeons with GPS, virtual camera, field of view 60°, {noise:g} px\n")
    ground, wind, air = np.median([compute_wind(xyz, 5) for _, xyz in pigeon_films(40.0, 5)], axis=0)
    print(f"ground speed ± {ground:.1f} m/s; airspeed with a wind of {wind:.1f} m/s: ± {air:.1f} m/s\n")
    print(f"| film | phase | films | polarization | {MEASURES}\n|{'---|' * 12}")
    for seconds, fps in ((4.0, 50), (8.0, 25), (40.0, 5)):
        films = [xyz for _, xyz in pigeon_films(seconds, fps)]
        turns = [compute_flock(xyz, fps) for xyz in films]
        for phase, chosen in (
            ("straight", [k for k, turn in enumerate(turns) if turn[2] < CIRCLING]),
            ("circling", [k for k, turn in enumerate(turns) if turn[2] >= CIRCLING]),
        ):
            if not chosen:
                continue
            tally = Tally()
            for k in chosen:
                truth, camera = filmed(turned(films[k], k), 40.0, fps=fps)
                tally.add(truth, seen(truth, camera, noise, k), camera)
            name = f"{FRAMES} frames, {seconds:g} s"
            polar = np.median([turns[k][0] for k in chosen])
            print(f"| {name} | {phase} | {len(chosen)} | {polar:.2f} | {tally.line()}", flush=True)


def tracking(cases):
    """Print the table of tracking."""
    print("| flock | birds | tracks | recall | precision | switches | IDF1 | ms per frame |")
    print("|---|---|---|---|---|---|---|---|")
    for flock, birds in TRACKED:
        for seed in range(cases):
            xyz, camera = crossing(birds, seed) if flock == "crossing" else filmed(flight(birds, seed, flock))
            px = camera.project(xyz)
            visible = ((px > 4) & (px < (camera.width - 4, camera.height - 4))).all(-1)
            tracker, spent = Tracker(), 0.0
            for picture in film(xyz, camera, seed):
                tick = time.process_time()
                tracker.step(picture)
                spent += time.process_time() - tick
            told = compute_tracking(px, visible, tracker.tracks())
            print(
                f"| {flock} | {birds} | {told['tracks']} | {told['recall']:.3f} | {told['precision']:.3f} "
                f"| {told['switches']} | {told['idf1']:.3f} | {1e3 * spent / FRAMES:.0f} |",
                flush=True,
            )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("what", choices=["depth", "order", "pigeons", "tracking"])
    parser.add_argument("--cases", type=int, default=12)
    parser.add_argument("--noise", type=float, default=0.5, help="noise of the pigeons' tracks, pixels")
    options = parser.parse_args()
    if options.what == "depth":
        depth(options.cases)
    elif options.what == "order":
        order(options.cases)
    elif options.what == "pigeons":
        pigeons(options.noise)
    else:
        tracking(min(options.cases, 3))

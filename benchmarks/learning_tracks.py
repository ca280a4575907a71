"""Learn brushes from open tracks of real animals, judge them by held-out frames, and write the page of the results.

    python benchmarks/learning.py tracks --data DIR [--only NAME ...] [--quick] [--brushes DIR] [--write]

``DIR`` has the folders sheep_and_dog, zebrafish_100, pigeons_ff11 and pedestrians_eth as published by their authors.
None of the data is stored: results are figures (learning_tracks.json) and, with --brushes, the learned brushes.  With
--write each data set is stored as soon as it is done, and a second call continues with the missing ones.
"""

from __future__ import annotations

import json
import tempfile
import textwrap
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
NEWEST = {"response to neighbours", "scatter of turns"}  # measures that figures of an earlier version do not have
SHIPPED = "sheep-gps", "zebrafish"
RESULTS, PAGE = HERE / "learning_tracks.json", HERE.parent / "docs" / "benchmark-tracks.md"


@dataclass(frozen=True)
class Data:
    """One data set: how it is read, and the assumptions about what its files do not state."""

    name: str
    title: str
    length: float  # in `unit`
    unit: str
    fps: float
    frames: tuple[int, int] | None
    licence: str
    assumed: str
    arena: str | None = None


DATA = {
    d.name: d
    for d in (
        Data("sheep-gps", "14 sheep driven by a dog: the longest drive of trials 2, 3 and 4", 1.2, "m", 10.0, None,
             "data GPL-3.0, Jadhav et al. 2024, Communications Biology 7, 1543",
             "Assumed length of a sheep: 1.2 m. The brush does not include the dog."),
        Data("zebrafish", "100 zebrafish in a round tank, frames 0 to 149", 55.0, "px", 32.0, (0, 149),
             "data GPL-3.0, test data of trajectorytools",
             "The frame rate of 32/s and the body length of 55 px come from descriptions of such films, not from the "
             "file. Nor is the wall of the tank: it is assumed to be the smallest circle that holds all positions "
             "(`--arena circle`).", "circle"),
        Data("pigeons", "10 pigeons with GPS, horizontal positions, 30 s of a free flight", 0.35, "m", 5.0, (0, 149),
             "free with citation, Nagy et al. 2010, Nature 464, 890",
             "Assumed length of a pigeon: .35 m. Heights are ignored."),
        Data("pedestrians", "Pedestrians in front of a building, the 60 s with the most people", 0.45, "m", 2.5, None,
             "research use, Pellegrini et al. 2009 (ETH Walking Pedestrians)",
             "Assumed body length: .45 m. People enter and leave the scene. The brush does not include walls."),
    )
}  # fmt: skip


def add(commands):
    """Add the command's options."""
    parser = commands.add_parser("tracks", help="learn brushes from open tracks of real animals")
    parser.add_argument("--data", type=Path, required=True, help="folder with the data sets")
    parser.add_argument("--only", nargs="+", choices=sorted(DATA), default=sorted(DATA))
    parser.add_argument("--quick", action="store_true", help="learn in less time")
    parser.add_argument("--brushes", type=Path, help="folder for the learned brushes")
    parser.add_argument("--write", action="store_true", help="store the figures and write the page")
    parser.set_defaults(run=run)


def run(options):
    """Learn from each data set; print a line for each."""
    done = json.loads(RESULTS.read_text()) if options.write and RESULTS.exists() else {}
    for name in options.only:
        if name in done and not options.brushes:
            continue
        done[name] = learned(DATA[name], options)
        print(json.dumps({name: {k: done[name][k] for k in ("verdict", "learned", "rivals", "seconds")}}), flush=True)
        if options.write:
            RESULTS.write_text(json.dumps(done, indent=1) + "\n")
            PAGE.write_text(page(done))
    if "sheep-gps" in options.only:
        done["dog"] = relation(options.data)
        print(done["dog"], flush=True)
        if options.write:
            RESULTS.write_text(json.dumps(done, indent=1) + "\n")
            PAGE.write_text(page(done))
    return done


# data ---------------------------------------------------------------------------------------------


def drives(folder):
    """Return {(trial, drive): (frames, 16, 2) m} of sheep_and_dog: 14 sheep, the dog, the shepherd."""
    from scipy.io import loadmat

    found, read = {}, loadmat(folder / "sheep_and_dog" / "drives_dev.mat")
    for trial in (1, 2, 3, 4, 5):
        xy = np.moveaxis(read[f"pos_ev_{trial}"], 2, 0)
        long = (read[f"ev_et_{trial}"] - read[f"ev_st_{trial}"]).ravel() + 1
        for number, part in enumerate(np.split(xy, np.cumsum(long)[:-1])):
            found[trial, number] = part
    return found


def sheep(folder):
    """Yield the longest drive of each of three trials, without dog and shepherd."""
    all_drives = drives(folder)
    for trial in (2, 3, 4):
        best = max((key for key in all_drives if key[0] == trial), key=lambda key: len(all_drives[key]))
        yield f"sheep-trial-{trial}.npy", all_drives[best][:, :14]


def zebrafish(folder):
    """Yield the tracks of all fish."""
    yield "zebrafish.npy", np.load(folder / "zebrafish_100" / "test_trajectories.npy", allow_pickle=False)


def pigeons(folder):
    """Yield the east and north coordinates of all birds at their common times."""
    birds = []
    for path in sorted((folder / "pigeons_ff11").glob("ff11_?.txt")):
        rows = np.loadtxt(path, encoding="latin-1", comments="#", usecols=(0, 1, 2))
        birds.append({round(t * 5 if t < 1e5 else t / 20): xy for t, *xy in rows.tolist()})
    common = sorted(set.intersection(*(set(bird) for bird in birds)))
    middle = len(common) // 3
    yield "pigeons.npy", np.array([[bird[t] for bird in birds] for t in common[middle : middle + 150]])


def pedestrians(folder):
    """Yield the minute with the most people."""
    rows = np.loadtxt(folder / "pedestrians_eth" / "ETH" / "seq_eth" / "obsmat.txt")
    frame, who = np.round(rows[:, 0] / 6).astype(int), rows[:, 1].astype(int)
    frame -= frame.min()
    begin = max(range(0, frame.max() - 149, 25), key=lambda b: ((frame >= b) & (frame < b + 150)).sum())
    chosen = (frame >= begin) & (frame < begin + 150)
    ids, column = np.unique(who[chosen], return_inverse=True)
    xy = np.full((150, len(ids), 2), np.nan)
    xy[frame[chosen] - begin, column] = rows[chosen][:, [2, 4]]
    yield "pedestrians.npy", xy


READ = {"sheep-gps": sheep, "zebrafish": zebrafish, "pigeons": pigeons, "pedestrians": pedestrians}


# learning -------------------------------------------------------------------------------------------


def learned(data: Data, options):
    """Return the figures of one data set."""
    import flockbrush

    begun = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        paths = []
        for name, xy in READ[data.name](options.data):
            paths.append(Path(folder) / name)
            np.save(paths[-1], xy)
        result = flockbrush.learn(
            paths, unit=data.unit, fps=data.fps, body_length=data.length, frames=data.frames, name=data.name,
            arena=data.arena, quick=options.quick, starts=3, licence=data.licence, beside=True,
        )  # fmt: skip
    if options.brushes:
        options.brushes.mkdir(exist_ok=True)
        flockbrush.save_brush(result.brush, options.brushes, overwrite=True)
    judgement = result.findings.judgement
    told = [] if judgement is None else judgement.told
    rivals = {} if judgement is None else {one.name: one.distance(told) for one in judgement.rivals}
    own = None if judgement is None else judgement.brush.distance(told)
    return {
        "verdict": result.verdict, "kind": result.kind, "learned": own, "rivals": rivals, "measures": result.measures,
        "parameters": [vars(one) | {"told": one.told} for one in result.parameters], "notes": result.notes,
        "quick": options.quick, "seconds": time.perf_counter() - begun, "date": time.strftime("%Y-%m-%d"),
    }  # fmt: skip


def relation(folder):
    """Return the learned reaction of the sheep to the dog, from all drives."""
    from flockbrush.film.track_files import Trajectories
    from flockbrush.learning.relation import learn_relation

    ids = (*(f"sheep {k + 1}" for k in range(14)), "dog", "shepherd")
    every = [Trajectories(xy, ids, 10.0, "m", name=f"trial {key[0]}") for key, xy in drives(folder).items()]
    found = learn_relation(every, "dog", DATA["sheep-gps"].length, ["shepherd"])
    return {"sentence": found.sentence, "line": found.line, "told": found.told, "turns": found.turns}


# the page -------------------------------------------------------------------------------------------


def page(done):
    """Return the text of docs/benchmark-tracks.md."""
    return (
        "\n".join([*_head(done), *_table(done), *(line for name in DATA if name in done for line in _of(name, done))])
        + "\n"
    )


def _head(done):
    dates = sorted({one["date"] for name, one in done.items() if name in DATA})
    return [
        "# Brushes learned from tracks of real animals", "",
        _prose(
            "How well do brushes learned from the tracks of real animals move? This page compares simulated herds with "
            "open data that are not part of Flockbrush; [tracks](tracks.md) says how to learn from your own. Each "
            "brush is judged by frames or recordings that it was not learned from, with the [measures of the "
            "report](learning.md#the-report). `python benchmarks/learning.py tracks --data DIR --write` writes the "
            f"page. The figures are of {' and '.join(dates)}; other versions learn other brushes. "
            f"{' and '.join(SHIPPED)} are the shipped brushes, which an earlier version learned."
        ), "",
        _prose(
            "The table shows the distance of a simulated herd from the tracks: the root mean square of the differences "
            "of the measures, each divided by its limit; 1 is the limit. Measures that the tracks do not constrain "
            "are left out. *Constant velocity* means that all animals keep their velocity, *standing still* that none "
            "moves. In the other tables *tracks* and *simulated* are means over the held-out parts and, for distances, "
            "speeds and turns, over quantiles; *difference* is the root mean square over the parts of the mean "
            "difference of the quantiles, so it may be larger than the difference of the two columns."
        ), "",
    ]  # fmt: skip


def _prose(text):
    """Return a paragraph wrapped to the width of a page."""
    return textwrap.fill(text, 100, break_long_words=False, break_on_hyphens=False)


def _table(done):
    from flockbrush.learning.verdict import ONWARDS, RANDOM, STILL

    rows = [
        "| data | learned | constant velocity | standing still | best shipped brush | verdict |",
        "|---|---|---|---|---|---|",
    ]
    for name in DATA:
        if name in done:
            one, rivals = done[name], dict(done[name]["rivals"])
            fixed = [rivals.pop(rival, None) for rival in (ONWARDS, STILL, RANDOM)]
            best = min(rivals, key=rivals.get) if rivals else None
            shipped = f"{rivals[best]:.2f} ({best})" if best else "not tried"
            rows.append(
                f"| {name} | {_n(one['learned'])} | {_n(fixed[0])} | {_n(fixed[1])} | {shipped} | {one['verdict']} |"
            )
    return [*rows, ""]


def _n(value):
    return "-" if value is None else f"{value:.2f}"


def _of(name, done):
    data, one = DATA[name], done[name]
    yield from (f"## {name}", "", _prose(f"{data.title}; {data.licence}. {data.assumed}"), "")
    yield from ("| measure | tracks | simulated | difference | limit | |", "|---|---|---|---|---|---|")
    for row in one["measures"]:
        met = ("met" if row["met"] else "missed") if row["told"] else "not constrained"
        numbers = " | ".join(f"{row[key]:.3g}" for key in ("clip", "herd", "off", "limit"))
        yield f"| {row['name']} | {numbers} | {met} |"
    if NEWEST.isdisjoint(row["name"] for row in one["measures"]):
        yield from ("", _prose(f"Not judged by {' or '.join(sorted(NEWEST))}."))
    yield from ("", "| parameter | value | confounded with |", "|---|---|---|")
    for row in one["parameters"]:
        if data.arena or not row["name"].startswith("obstacle"):
            others = ", ".join(n.replace("_", " ") for n in row["confounded_with"]) or "-"
            yield f"| {row['name'].replace('_', ' ')} | {row['told']} | {others} |"
    yield ""
    if name == "sheep-gps" and "dog" in done:
        dog = done["dog"]
        yield from (_prose(f"Reaction to the dog, from all 19 drives ({dog['turns']} turns): {dog['sentence']}"), "")
    yield from (f"Learned in {one['seconds']:.0f} s{' with --quick' if one['quick'] else ''}.", "")

"""A program beside a learned brush: where animals stand and walk, or run, by turns, states and what leads to them.

Each pair of states that animals of a clip change between becomes a trigger at random: its rate grows with the number
of visible neighbours that are in the other state already [1]_.  Rate and growth are those of maximum likelihood.

.. [1] Ginelli, F. et al. (2015). Intermittent collective dynamics emerge from conflicting imperatives in sheep herds.
   PNAS 112, 12729-12734.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from flockbrush.behaviours.brush import SUFFIX, Brush
from flockbrush.behaviours.brush_writer import brush_to_toml
from flockbrush.behaviours.program import SUFFIX as PROGRAM
from flockbrush.behaviours.program import Program, load_program
from flockbrush.behaviours.program_writer import toml
from flockbrush.engine.files import write_text
from flockbrush.film.observations import Evidence
from flockbrush.film.pauses import CLEARLY, FEWEST, limits_of, states_of
from flockbrush.learning.herd_views import told_apart
from flockbrush.learning.perceive import perceive
from flockbrush.systems.pace import COMPANY

STATES = "stand", "walk", "run"
COLOURS = "#5566b0", "#d8b23c", "#b0432c"
VERBS = "stands still, as neighbours do", "sets out, as neighbours do", "runs, as neighbours do"
GAINS = 0.0, 0.125, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0
RARE = 0.15  # of the changes out of a state: rarer ones are errors of sighting
LOOKS = 2000  # frames of a clip whose neighbours are looked at
STOPPING = 20.0  # 1/s, how soon an animal that stands has lost its speed


@dataclass(frozen=True)
class StateChange:
    """From one state to another."""

    source: int
    to: int
    rate: float  # 1/s, of an animal of which no neighbour is in the other state
    gain: float  # factor by which each neighbour there makes it likelier
    changes: int  # that it is estimated from


@dataclass(frozen=True)
class LearnedProgram:
    """States of speed, what leads from one to another, and the brushes of the states."""

    program: Program
    text: str  # of its file
    brushes: dict[str, Brush]  # by name
    shares: list[float]  # of the sights in each state
    changes: list[StateChange]

    def write(self, out: Path) -> list[Path]:
        """Write the program and its brushes beside the brush ``out``; the program's path first."""
        folder = out.parent.with_name("programs") if out.parent.name == "brushes" else out.parent
        folder.mkdir(exist_ok=True)
        written = [folder / f"{self.program.name}{PROGRAM}"]
        for name, brush in self.brushes.items():
            written.append(out.with_name(f"{name}{SUFFIX}"))
            write_text(written[-1], brush_to_toml(brush))
        write_text(written[0], self.text)
        return written


def program_of(brush: Brush, evidences: list[Evidence]) -> LearnedProgram | None:
    """The program of a brush that was learned from these clips; None if their speeds have no states."""
    clips = [clip for clip in evidences if told_apart(clip) and clip.speed is not None]
    if brush.speed.stops <= 0.0 or not clips:
        return None
    limits = max((limits_of(clip.sightings) for clip in clips), key=len)
    if not limits:
        return None
    changes, shares, speeds = _seen(clips, limits, brush)
    while stuck := {c.to for c in changes} ^ {c.source for c in changes}:  # states that are only left, or only reached
        changes = [change for change in changes if not {change.source, change.to} & stuck]
    reached = {change.source for change in changes}
    if 0 not in reached:
        return None
    brushes = {f"{brush.name}-{STATES[k]}": _brush(brush, k, speeds[k], len(reached)) for k in sorted(reached)}
    text = _text(brush, brushes, shares, changes)
    program = load_program(text.encode(), f"{brush.name}{PROGRAM}")
    return LearnedProgram(program, text, brushes, shares, changes)


def _seen(clips, limits, brush):
    """(changes between states, share of the sights in each, (mean, standard deviation) of the speeds there)."""
    many, now, then, company, seconds, speed, state = len(limits) + 1, [], [], [], [], [], []
    for clip in clips:
        states, before, after = states_of(clip.sightings, clip.fps, limits)
        beside = _neighbours(clip, states, many, brush)
        known = beside[before, 0] >= 0
        before, after = before[known], after[known]
        now, then = [*now, states[before]], [*then, states[after]]
        company, seconds = [*company, beside[before]], [*seconds, np.full(len(before), 1.0 / clip.fps)]
        seen = states >= 0
        speed, state = [*speed, clip.sightings.speed[seen]], [*state, states[seen]]
    now, then, company, seconds = (np.concatenate(part) for part in (now, then, company, seconds))
    speed, state = np.concatenate(speed), np.concatenate(state)
    shares = [float((state == k).mean()) for k in range(many)]
    moving = [speed[state == k] if (state == k).any() else np.zeros(1) for k in range(many)]
    pairs = [(a, b) for a in range(many) for b in range(many) if a != b]
    found = [_fitted(a, b, then[now == a] == b, company[now == a][:, b], seconds[now == a]) for a, b in pairs]
    left = {a: sum(change.changes for change in found if change.source == a) for a in range(many)}
    found = [change for change in found if change.changes >= max(FEWEST, RARE * left[change.source])]
    return found, shares, [(v.mean(), v.std()) for v in moving]


def _neighbours(clip, states, many, brush):
    """(m, many) visible neighbours of each animal in each state; -1 in frames that are not looked at."""
    seen, found = clip.sightings, np.full((len(states), many), -1)
    every = max(1, -(-len(seen) // LOOKS))
    for t in range(0, len(seen), every):
        rows = np.arange(seen.first[t], seen.first[t + 1])
        if not len(rows):
            continue
        percept = perceive(seen.xy[rows], seen.forward[rows], brush.body, brush.vision, brush.params)
        close = np.hypot(*percept.offset.T) <= COMPANY
        who = np.repeat(np.arange(len(rows)), np.diff(percept.first))[close]
        other = states[rows[percept.near[close]]]
        found[rows] = [[0] * many] * len(rows)
        np.add.at(found, (rows[who[other >= 0]], other[other >= 0]), 1)
    return found


def _fitted(a, b, changed, company, seconds) -> StateChange:
    """The likeliest rate of a change, and how much each neighbour in the other state adds."""
    fits, events = [], int(changed.sum())
    for gain in GAINS:
        weight = 1.0 + gain * company
        rate = events / max(float((weight * seconds).sum()), 1e-9)
        fits.append((float(np.log(np.maximum(rate * weight[changed], 1e-12)).sum()), rate, gain))
    best = max(fits)
    _, rate, gain = best if best[0] > fits[0][0] + CLEARLY else fits[0]
    return StateChange(a, b, rate, gain, events)


def _brush(brush, k, speeds, many):
    """The brush of one state; with two states, those that walk have the speed of the learned brush."""
    rest = {"stops": 0.0, "starts": 0.0, "imitation": 0.0}
    if k == 0:
        rest |= {"mean": 0.0, "deviation": 0.0, "reversion": STOPPING, "common": 0.0, "by_density": ()}
    elif many > 2:
        rest |= {"mean": float(speeds[0]), "deviation": float(speeds[1] * np.sqrt(2.0 * brush.speed.reversion))}
    state = {"name": f"{brush.name}-{STATES[k]}", "title": f"{brush.title}, {STATES[k]}"[:200], "colour": COLOURS[k]}
    return brush.model_copy(update=state | {"speed": brush.speed.model_copy(update=rest), "transition": 0.0})


def _text(brush, brushes, shares, changes):
    states = [name.removeprefix(f"{brush.name}-") for name in brushes]
    told = f"Animals {', '.join(states[:-1])} and {states[-1]} by turns, by chance and as neighbours do."
    start = {name: round(shares[STATES.index(name)], 3) for name in states}
    head = {"title": brush.title, "description": told, "source": brush.provenance.source, "start": start}
    lines = ['schema = "flockbrush.program/1"', *(f"{key} = {toml(value)}" for key, value in head.items())]
    for name in states:
        colour = COLOURS[STATES.index(name)]
        lines += ["", f"[state.{name}]", f"brush = {toml(f'{brush.name}-{name}')}", f"colour = {toml(colour)}"]
    for change in changes:
        when = {"rate": f"{change.rate:.4g} /s"}
        if change.gain:
            when |= {"imitating": STATES[change.to], "gain": change.gain, "within": f"{COMPANY:g} BL"}
        lines += ["", "[[trigger]]"]
        told = {"name": VERBS[change.to], "from": STATES[change.source], "to": STATES[change.to], "when": when}
        lines += [f"{key} = {toml(value)}" for key, value in told.items()]
        lines[-1] += f"  # {change.changes} changes"
    return "\n".join(lines) + "\n"

"""Judge known herds by their own noisy tracks: the true model must be said to move like them.

    python benchmarks/learning.py observed

Two dozen animals of three models for 6 s, with positions that are off by so many body lengths.  ``alike``: simulated
herds get the noise and the smoother of the tracks, as everywhere in learning; ``white noise``: only noise that is new
in each frame, as before 2026-11-29.
"""

from __future__ import annotations

from dataclasses import replace

HERDS, NOISES = ("herd", "zones", "morse"), (0.005, 0.03, 0.1)  # BL
ANIMALS, FRAMES = 24, 96


def add(commands):
    """Add the command's options."""
    parser = commands.add_parser("observed", help="judge known herds by their own noisy tracks")
    parser.set_defaults(run=run)


def run(_options):
    """Print a line for each herd and noise; returns the rows."""
    from benchmarks.learning_models import evidence_of, tracks_of, truths
    from flockbrush.learning.verdict import judge

    rows = []
    print("model | noise, BL | alike: missed | white noise: missed")
    for name in HERDS:
        _, brush = truths()[name]
        tracks = tracks_of(brush, ANIMALS)[:FRAMES]
        for noise in NOISES:
            clip = evidence_of(tracks, noise=noise)
            verdicts = [judge(seen, brush, {}) for seen in (clip, replace(clip, smoothing=None))]
            told = [", ".join(verdict.missed) or "-" for verdict in verdicts]
            rows.append({"model": name, "noise": noise, "alike": verdicts[0].kind, "white noise": verdicts[1].kind})
            print(" | ".join([name, f"{noise:g}", *told]), flush=True)
    for how in ("alike", "white noise"):
        print(f"{how}: {sum(row[how] == 'like' for row in rows)} of {len(rows)} are said to move like the tracks")
    return rows

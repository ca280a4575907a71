"""Compare the evolution strategy used in learning with the package ``cmaes`` (pip install cmaes).

    python benchmarks/evolution.py [--seeds 20]

Prints the median over the seeds of the final distance above the optimum, for twelve numbers between 0 and 1 (as in
learning) and 60 generations of 8 and of 16 candidates.  In ``edge`` a third of the optimum lies on the border.  In
``noisy`` each candidate is measured with noise of .01; the result is evaluated without noise.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))
from flockbrush.learning.evolution import Evolution

COUNT, GENERATIONS, STEP, CHANCE = 12, 60, 0.15, 0.01


def problem(kind, seed):
    """Return (objective of the search, objective of the final evaluation), functions of (12,) numbers."""
    optimum = np.random.default_rng(seed).uniform(0.3, 0.7, COUNT)
    turned = np.linalg.qr(np.random.default_rng(0).normal(size=(COUNT, COUNT)))[0] * np.logspace(-1, 1, COUNT)[:, None]
    chance = np.random.default_rng(seed + 1)
    on_border = np.where(np.arange(COUNT) % 3 == 0, 0.0, optimum)
    true = {
        "sphere": lambda x: ((x - optimum) ** 2).sum(),
        "ellipsoid": lambda x: ((turned @ (x - optimum)) ** 2).sum(),
        "edge": lambda x: np.abs(x - on_border).sum(),
        "noisy": lambda x: ((x - optimum) ** 2).sum(),
    }[kind]
    return (lambda x: true(x) + CHANCE * chance.normal()) if kind == "noisy" else true, true


def ours(worth, size, seed):
    """Return the final point of Flockbrush's strategy."""
    search = Evolution(np.full(COUNT, 0.5), STEP, size, (seed,))
    for _ in range(GENERATIONS):
        search.tell([worth(x) for x in search.ask()])
    return search.mean


def theirs(worth, size, seed):
    """Return the final point of the package."""
    from cmaes import CMA

    bounds = np.tile([0.0, 1.0], (COUNT, 1))
    search = CMA(mean=np.full(COUNT, 0.5), sigma=STEP, bounds=bounds, seed=seed, population_size=size)
    for _ in range(GENERATIONS):
        asked = [search.ask() for _ in range(size)]
        search.tell([(x, worth(x)) for x in asked])
    return search.mean


def main():
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("--seeds", type=int, default=20)
    seeds = parser.parse_args().seeds
    print(f"{'problem':10} {'candidates':>10} {'ours':>10} {'cmaes':>10}")
    for kind in ("sphere", "ellipsoid", "edge", "noisy"):
        for size in (8, 16):
            ends = []
            for search in (ours, theirs):
                problems = [problem(kind, seed) for seed in range(seeds)]
                found = [np.clip(search(told, size, seed), 0, 1) for seed, (told, _) in enumerate(problems)]
                ends.append(np.median([true(x) for x, (_, true) in zip(found, problems, strict=True)]))
            print(f"{kind:10} {size:10} {ends[0]:10.1e} {ends[1]:10.1e}")


if __name__ == "__main__":
    main()

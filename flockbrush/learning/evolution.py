"""An evolution strategy for a dozen numbers between 0 and 1: the covariance matrix adaptation of Hansen.

Ask for a generation, tell what each was worth, repeat.  Chance comes from a seed alone.

.. [1] Hansen, N. (2016). The CMA evolution strategy: a tutorial. arXiv:1604.00772.
"""

from __future__ import annotations

import numpy as np


class Evolution:
    """A cloud of candidates that moves to where they are better, and takes the shape of what is good.

    Parameters
    ----------
    centre : (d,) array_like
        Where it begins, in 0 to 1.
    step : float
        Its first width.
    size : int
        Candidates to a generation.
    seed : sequence of int
    shape : (d, d) array_like, optional
        Covariance of the first generation, in squares of the step.
    """

    def __init__(self, centre, step=0.15, size=8, seed=(0,), shape=None):
        self.mean, self.step, self.size = np.array(centre, float), float(step), int(size)
        d, self.rng = len(self.mean), np.random.default_rng(list(seed))
        weights = np.log(0.5 * (size + 1)) - np.log(np.arange(1, size // 2 + 1))
        self.weights = weights / weights.sum()
        self.mass = 1.0 / (self.weights**2).sum()
        m = self.mass
        self.c_step, self.c_path = (m + 2) / (d + m + 5), (4 + m / d) / (d + 4 + 2 * m / d)
        self.c_one = 2 / ((d + 1.3) ** 2 + m)
        self.c_many = min(1 - self.c_one, 2 * (m - 2 + 1 / m) / ((d + 2) ** 2 + m))
        self.damp = 1 + 2 * max(0.0, np.sqrt((m - 1) / (d + 1)) - 1) + self.c_step
        self.usual = np.sqrt(d) * (1 - 1 / (4 * d) + 1 / (21 * d * d))
        self.shape = np.eye(d) if shape is None else np.array(shape, float)
        self.path, self.step_path, self.generation = np.zeros(d), np.zeros(d), 0

    def ask(self):
        """(size, d) candidates; what lies outside 0 to 1 is put at the bound."""
        self.values, self.axes = np.linalg.eigh(self.shape)
        self.values = np.sqrt(np.maximum(self.values, 1e-14))
        z = self.rng.normal(size=(self.size, len(self.mean)))
        self.asked = self.mean + self.step * (z * self.values) @ self.axes.T
        self.asked = np.clip(self.asked, 0.0, 1.0)
        return self.asked.copy()

    def tell(self, worth):
        """The loss of each candidate, (size,)."""
        order = np.argsort(np.asarray(worth), kind="stable")[: len(self.weights)]
        steps = (self.asked[order] - self.mean) / self.step
        move = self.weights @ steps
        self.mean = self.mean + self.step * move
        self.generation += 1
        white = (self.axes / self.values) @ (self.axes.T @ move)
        self.step_path = (1 - self.c_step) * self.step_path + np.sqrt(
            self.c_step * (2 - self.c_step) * self.mass
        ) * white
        length = np.linalg.norm(self.step_path)
        settled = length / np.sqrt(1 - (1 - self.c_step) ** (2 * self.generation)) / self.usual
        straight = float(settled < 1.4 + 2 / (len(self.mean) + 1))
        self.path = (1 - self.c_path) * self.path + straight * np.sqrt(
            self.c_path * (2 - self.c_path) * self.mass
        ) * move
        self.shape = (
            (1 - self.c_one - self.c_many) * self.shape
            + self.c_one * np.outer(self.path, self.path)
            + self.c_many * (steps.T * self.weights) @ steps
        )
        self.step = float(np.clip(self.step * np.exp(self.c_step / self.damp * (length / self.usual - 1)), 1e-3, 0.4))

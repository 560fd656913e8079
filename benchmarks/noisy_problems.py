"""The problems that optimizers.py searches: noisy functions and chambers.

The functions have three parameters and a known best value. The best of a chamber is known from a
fine sweep. A problem is maximised over the unit cube. Its scores are of the size of
uniform_coverage, from 0 to 0.8, and are means of four replicas, so that each score has its own,
badly known, error.
"""

from __future__ import annotations

import csv
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

RESULTS = Path(__file__).parent / "results"
REPLICAS = 4
NOISES = (0.02, 0.1)

# Hartmann's function of three parameters, with four local maxima, the best 3.86278: L. C. W. Dixon
# and G. P. Szegö, "Towards Global Optimization 2", North-Holland 1978.
HARTMANN_HEIGHT = np.array([1.0, 1.2, 3.0, 3.2])
HARTMANN_STEEP = np.array([[3.0, 10, 30], [0.1, 10, 35], [3.0, 10, 30], [0.1, 10, 35]])
HARTMANN_PLACE = 1e-4 * np.array(
    [[3689, 1170, 2673], [4699, 4387, 7470], [1091, 8732, 5547], [381, 5743, 8828]]
)


@dataclass(frozen=True)
class Problem:
    """A function to maximise, measured with noise.

    ``truth(point (d,))`` is the true score of a point, ``best`` is the highest true score, and
    ``noise`` is the standard error of a measured one. ``start`` is where the design stands. If it
    is None, each seed starts at another place near the middle.
    """

    name: str
    parameters: int
    truth: Callable[[np.ndarray], float]
    best: float
    noise: float
    start: tuple[float, ...] | None = None

    def measured(self, seed: int) -> Callable[[np.ndarray], tuple[float, float]]:
        """Returns score(point) -> mean of the replicas and its squared standard error.

        The same point always gets the same answer.
        """

        def score(point: np.ndarray) -> tuple[float, float]:
            bits = np.frombuffer(
                np.ascontiguousarray(point, dtype=float).tobytes(), dtype=np.uint32
            )
            scatter = np.random.default_rng([seed, *bits]).normal(
                0.0, self.noise * np.sqrt(REPLICAS), REPLICAS
            )
            return self.truth(point) + float(scatter.mean()), float(scatter.var(ddof=1)) / REPLICAS

        return score

    def begin(self, seed: int) -> np.ndarray:
        """The start of the search with this seed."""
        if self.start is not None:
            return np.array(self.start)
        return np.random.default_rng([7, seed]).uniform(0.2, 0.8, self.parameters)


def ridge(x: np.ndarray) -> float:
    """A curved ridge, steep across and gentle along: 0.8 on it, at x0 = 0.65."""
    across = x[1] - (0.25 + 0.9 * (x[0] - 0.2) ** 2)
    return float(
        0.8 - 1.6 * across**2 - 0.25 * (x[0] - 0.65) ** 2 - 0.5 * (x[2] - 0.35 - 0.2 * x[0]) ** 2
    )


def hartmann(x: np.ndarray) -> float:
    """Hartmann's function with its best at 0.8."""
    near = np.exp(-(HARTMANN_STEEP * (x - HARTMANN_PLACE) ** 2).sum(axis=1))
    return float(0.8 / 3.86278 * (HARTMANN_HEIGHT @ near))


def corner(x: np.ndarray) -> float:
    """Best on two bounds, with 0.8 at (1, 0, 0.6).

    It saturates in one parameter and has a kink in another.
    """
    return float(
        0.8 * np.expm1(-3.0 * x[0]) / np.expm1(-3.0) - 0.4 * x[1] ** 1.5 - 0.6 * (x[2] - 0.6) ** 2
    )


FUNCTIONS = {"ridge": ridge, "hartmann": hartmann, "corner": corner}


def functions() -> list[Problem]:
    """The three functions with little and with much noise."""
    return [
        Problem(f"{name} ±{noise}", 3, truth, 0.8, noise)
        for name, truth in FUNCTIONS.items()
        for noise in NOISES
    ]


def chamber(name: str) -> Problem:
    """A swept chamber (chamber_sweep.py) with the noise that was measured.

    It is interpolated linearly between the points of the sweep, because there are cliffs.
    """
    from scipy.interpolate import RegularGridInterpolator

    with (RESULTS / f"sweep_{name}.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    one, two = (np.array(sorted({float(row[axis]) for row in rows})) for axis in ("u", "v"))
    found = {(float(row["u"]), float(row["v"])): float(row["uniform_coverage"]) for row in rows}
    values = np.array([[found[u, v] for v in two] for u in one])
    between = RegularGridInterpolator((one, two), values)
    start = tuple(float(rows[0][axis]) for axis in ("start_u", "start_v"))
    noise = float(np.mean([float(row["search_error"]) for row in rows]))
    return Problem(name, 2, lambda x: float(between(x)[0]), float(values.max()), noise, start)


def chambers() -> list[Problem]:
    """The chambers that were swept."""
    return [
        chamber(path.stem.removeprefix("sweep_")) for path in sorted(RESULTS.glob("sweep_*.csv"))
    ]

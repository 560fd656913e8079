"""The problems that optimizers.py searches: noisy functions, and chambers from tables.

A problem is maximised over the unit cube. Scores are of the size of uniform_coverage, from 0 to
0.8, and are means of eight replicas, so that each has its own, badly known, error. A figure that is
limited must not be above 0; it is measured with noise too. PROBLEMS are those that the search was
developed with, ASIDE those that were kept aside to check it.
"""

from __future__ import annotations

import csv
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np

from chamberopt.coverage.metrics import highest_uniform_coverage
from chamberopt.search.optimiser.domain import Axis, Domain

RESULTS = Path(__file__).parent / "results"
REPLICAS = 8
NUMBER = Axis()

# Hartmann's function of three parameters, with four local maxima, the best 3.86278: L. C. W. Dixon
# and G. P. Szegö, "Towards Global Optimization 2", North-Holland 1978.
HARTMANN_HEIGHT = np.array([1.0, 1.2, 3.0, 3.2])
HARTMANN_STEEP = np.array([[3.0, 10, 30], [0.1, 10, 35], [3.0, 10, 30], [0.1, 10, 35]])
HARTMANN_PLACE = 1e-4 * np.array(
    [[3689, 1170, 2673], [4699, 4387, 7470], [1091, 8732, 5547], [381, 5743, 8828]]
)


class Measured(NamedTuple):
    """The replicas of one evaluation: of the score, and of the limited figure or nothing."""

    score: np.ndarray
    figure: np.ndarray | None


@dataclass(frozen=True)
class Problem:
    """A function to maximise, measured with noise.

    Attributes:
        truth: true score of a point (d,).
        best: the highest true score within the limit.
        noise: standard error of a score; a function of the point where it differs.
        axes: which values each parameter can have.
        start: where the design stands, (d,); drawn near the middle if None.
        figure: true value of the limited figure at a point; None without limit.
        figure_noise: its standard error.
        bound: what geometry alone knows about a point: the score is not above it.
    """

    name: str
    truth: Callable[[np.ndarray], float]
    best: float
    noise: float | Callable[[np.ndarray], float]
    axes: tuple[Axis, ...] = (NUMBER, NUMBER, NUMBER)
    start: tuple[float, ...] | None = None
    figure: Callable[[np.ndarray], float] | None = None
    figure_noise: float = 0.02
    bound: Callable[[np.ndarray], float] | None = None

    @property
    def domain(self) -> Domain:
        return Domain(self.axes)

    def measure(self, point: np.ndarray, seed: tuple[int, ...], replicas: int) -> Measured:
        """So many replicas at a point (d,). The same point and seed get the same answer."""
        noise = self.noise(point) if callable(self.noise) else self.noise
        bits = np.frombuffer(np.ascontiguousarray(point, dtype=float).tobytes(), dtype=np.uint32)
        scatter = np.random.default_rng([*seed, *bits]).normal(size=(2, replicas))
        scatter *= np.sqrt(REPLICAS)
        figure = self.figure and self.figure(point) + self.figure_noise * scatter[1]
        return Measured(self.truth(point) + noise * scatter[0], figure)

    def is_feasible(self, point: np.ndarray) -> bool:
        return self.figure is None or self.figure(point) <= 0.0

    def begin(self, seed: int) -> np.ndarray:
        """The start of the search with this seed."""
        if self.start is not None:
            return np.array(self.start)
        point = np.random.default_rng([7, seed]).uniform(0.2, 0.8, len(self.axes))
        snapped: np.ndarray = self.domain.snap(point[None])[0]
        return snapped


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


def cliff(x: np.ndarray) -> float:
    """Rises to 0.8 at the edge of a cliff, where half of it is lost, as where a ceiling touches."""
    edge = 0.55 + 0.25 * x[1]
    below = x[0] - edge
    on_top = 0.8 - 0.9 * abs(below) - 0.5 * (x[1] - 0.4) ** 2 - 0.3 * (x[2] - 0.7) ** 2
    return float(on_top if below <= 0.0 else 0.5 * on_top - 0.3 * below)


def limited_ridge(x: np.ndarray) -> float:
    """Four parameters; without its limit it would be best at 0.9 of each."""
    return float(0.8 - 0.6 * ((x[:2] - 0.9) ** 2).sum() - 0.35 * ((x[2:] - 0.5) ** 2).sum()
                 - 0.6 * (x[0] - x[1]) ** 2)  # fmt: skip


def over_the_ridge(x: np.ndarray) -> float:
    """Its limit x0 + x1 <= 1.2 + ...: the best is on it."""
    return float(x[0] + x[1] - 1.2 + 0.3 * (x[2] - 0.5) ** 2 - 0.1 * (x[3] - 0.5))


def slope(x: np.ndarray) -> float:
    """A score that rises with x0, and one place in the others."""
    return float(0.25 + 0.55 * x[0] - 0.7 * (x[1] - 0.3) ** 2 - 0.4 * (x[2] - 0.6) ** 2)


def over_the_slope(x: np.ndarray) -> float:
    """A limit that is crossed slowly: 6 % over where 0.03 of the score would be won."""
    return float(x[0] - 0.62 - 0.5 * (x[1] - 0.2) ** 2)


def levels_and_choice(x: np.ndarray) -> float:
    """A number, a whole number from 1 to 8 and one of three choices, each with its own best."""
    choice = round(2.0 * x[2])
    place, height = ((0.3, 0.74), (0.7, 0.8), (0.5, 0.68))[choice]
    level = (4.0, 6.0, 2.0)[choice] / 7.0
    return float(height - 1.2 * (x[0] - place) ** 2 - 0.9 * (x[1] - level) ** 2
                 - 0.4 * (x[3] - 0.5 * x[0]) ** 2)  # fmt: skip


def noisier_where_low(x: np.ndarray) -> float:
    """Standard error of a score of the ridge: 0.01 at the top, 0.12 far from it."""
    return float(np.clip(0.01 + 0.25 * (0.8 - ridge(x)), 0.01, 0.12))


def bowl(x: np.ndarray) -> float:
    """A plain maximum at (0.3, 0.6, 0.5)."""
    return float(0.8 - 0.9 * ((x - np.array([0.3, 0.6, 0.5])) ** 2).sum())


def two_basins(x: np.ndarray) -> float:
    """A broad maximum of 0.7 and a narrow one of 0.8."""
    broad = 0.7 * np.exp(-2.0 * ((x - np.array([0.25, 0.3, 0.5])) ** 2).sum())
    narrow = 0.8 * np.exp(-12.0 * ((x - np.array([0.8, 0.75, 0.4])) ** 2).sum())
    return float(max(broad, narrow))


def valley(x: np.ndarray) -> float:
    """Rosenbrock's curved valley, turned over, over [-1.5, 1.5] and [-0.5, 2.5]; x2 is gentle."""
    u, v = 3.0 * x[0] - 1.5, 3.0 * x[1] - 0.5
    return float(0.8 - 0.15 * np.log1p(20.0 * (v - u * u) ** 2 + (1.0 - u) ** 2)
                 - 0.3 * (x[2] - 0.5) ** 2)  # fmt: skip


def over_the_bowl(x: np.ndarray) -> float:
    """A curved limit that cuts the bowl's maximum off."""
    return float(0.25 - np.linalg.norm(x[:2] - np.array([0.3, 0.6])))


def highest(problem: Problem, points: int = 2**14) -> float:
    """The best true score within the limit, from evenly spread points and climbing."""
    from scipy.optimize import minimize
    from scipy.stats.qmc import Sobol

    spread = problem.domain.snap(Sobol(len(problem.axes), seed=0).random(points))
    scores = np.array([problem.truth(x) if problem.is_feasible(x) else -np.inf for x in spread])

    def lost(x: np.ndarray) -> float:
        x = problem.domain.snap(np.clip(x, 0.0, 1.0)[None])[0]
        return -problem.truth(x) if problem.is_feasible(x) else 1.0

    best = spread[np.argsort(-scores)[:5]]
    found = [minimize(lost, x, method="Nelder-Mead", options={"xatol": 1e-6}).fun for x in best]
    return -min(found)


def chamber(name: str) -> Problem:
    """A swept chamber (chamber_sweep.py) with the noise that was measured.

    It is interpolated linearly between the points of the sweep, because there are cliffs. What the
    balls can touch of the target is known without a simulation, and bounds the score.
    """
    from scipy.interpolate import RegularGridInterpolator

    with (RESULTS / f"sweep_{name}.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    one, two = (np.array(sorted({float(row[axis]) for row in rows})) for axis in ("u", "v"))
    found = {(float(row["u"]), float(row["v"])): row for row in rows}

    def table(column: str) -> RegularGridInterpolator:
        values = np.array([[float(found[u, v][column]) for v in two] for u in one])
        return RegularGridInterpolator((one, two), values)

    between, reachable = table("uniform_coverage"), table("reachable")
    start = tuple(float(rows[0][axis]) for axis in ("start_u", "start_v"))
    noise = float(np.mean([float(row["search_error"]) for row in rows]))

    def bound(x: np.ndarray) -> float:
        return highest_uniform_coverage(float(reachable(x)[0]))

    def truth(x: np.ndarray) -> float:
        return float(between(x)[0])

    return Problem(name, truth, float(between.values.max()), noise, (NUMBER,) * 2, start,
                   bound=bound)  # fmt: skip


@cache
def problems() -> dict[str, Problem]:
    """The problems by name."""
    four, kinds = (NUMBER,) * 4, (NUMBER, Axis(8), Axis(3, ordered=False), NUMBER)
    made = [
        *(Problem(f"{f.__name__} ±{noise}", f, 0.8, noise)
          for f in (ridge, hartmann) for noise in (0.02, 0.1)),
        Problem("corner ±0.1", corner, 0.8, 0.1),
        Problem("cliff", cliff, 0.0, 0.03),
        Problem("limited ridge", limited_ridge, 0.0, 0.03, four, (0.4,) * 4, over_the_ridge),
        Problem("soft limit", slope, 0.0, 0.03, start=(0.3, 0.5, 0.5), figure=over_the_slope),
        Problem("levels and choice", levels_and_choice, 0.0, 0.04, kinds),
        Problem("uneven noise", ridge, 0.8, noisier_where_low),
        *map(chamber, CHAMBERS),
        Problem("bowl", bowl, 0.8, 0.1),
        Problem("two basins", two_basins, 0.0, 0.1),
        Problem("valley", valley, 0.0, 0.1),
        Problem("cut bowl", bowl, 0.0, 0.05, start=(0.8, 0.2, 0.4), figure=over_the_bowl,
                figure_noise=0.03),
    ]  # fmt: skip
    known = (one if one.best else replace(one, best=highest(one)) for one in made)
    return {one.name: one for one in known}


CHAMBERS = ("gear",)
ASIDE = ("bowl", "two basins", "valley", "cut bowl")

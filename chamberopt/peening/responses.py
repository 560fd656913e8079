"""How the figures of a design respond to changes of its numbers, from paired runs.

Notation
    m    a figure, such as mean_coverage
    L    the scale on which m is nearly a straight line: ln(-ln(1 - m)) for a share of the area,
         ln m for another positive figure, m itself for the others          (FigureScale)
    h    size of a change: ln(x / x0) of a number, or whatever the caller counts in   (step)
    g    dL/dh, an elasticity where h is a logarithm                        (response)

The nominal design and each changed one run in the same replicas on the same seeds, so that
g = (L(changed) - L(nominal)) / h has the interval of their paired differences. A chamber is
chaotic and pairs correlate little: the interval falls as 1/h, and curvature makes g wrong by a
share that grows as h. benchmarks/response_steps.py measures both.

Avrami's coverage is 1 - exp(-x) with the dent density x, which goes with powers of amplitude, mass
and time: hence the scale of shares.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

from chamberopt.chamber.analytic import analytic_cavity
from chamberopt.chamber.build import build_chamber
from chamberopt.common.estimate import FIRST_OF_CALIBRATION, Estimate
from chamberopt.coverage.coverage_intervals import NOT_RESOLVED
from chamberopt.coverage.metrics import ObjectiveFunction, find_metric
from chamberopt.peening.calibration_errors import evaluate_calibrated
from chamberopt.simulation.estimates import weighted_sum
from chamberopt.simulation.evaluate import ReplicaPlan, evaluate

if TYPE_CHECKING:
    from collections.abc import Mapping

    from chamberopt.chamber.build import Chamber
    from chamberopt.common.progress import Progress
    from chamberopt.design.load import Design
    from chamberopt.simulation.evaluation import Evaluation
    from chamberopt.simulation.replicas import Replica

TREATMENT_TIME = "process.treatment_time_s"


class FigureScale(NamedTuple):
    """A scale L(m) with its inverse and its slope dL/dm."""

    forward: Callable[[float], float]
    inverse: Callable[[float], float]
    slope: Callable[[float], float]


IDENTITY = FigureScale(lambda m: m, lambda value: value, lambda m: 1.0)
LOGARITHM = FigureScale(math.log, math.exp, lambda m: 1.0 / m)
SHARE = FigureScale(
    lambda m: math.log(-math.log1p(-m)),
    lambda value: -math.expm1(-math.exp(value)),
    lambda m: 1.0 / (math.log1p(-m) * (m - 1.0)),
)


class PairedRuns:
    """Simulates a design, and changed ones in the same replicas on the same seeds.

    What a calibration leaves open is found for the nominal design alone, see `with_errors_of`.

    Attributes:
        design, chamber: the nominal ones.
        nominal: the evaluation of the nominal design.
    """

    def __init__(
        self,
        design: Design,
        chamber: Chamber,
        executor: Executor,
        progress: Progress | None = None,
        analytic: bool = False,
        runs: int = 1,
    ) -> None:
        """Simulate the nominal design.

        Args:
            progress: called over all `runs`, of which this is one.
            analytic: simulate in exact cavities instead of meshes.
        """
        self.design, self.chamber = design, chamber
        self._executor, self._analytic = executor, analytic
        self._progress, self._runs, self._done = progress, runs, 0
        self._replicas: list[Replica] = []
        self.nominal = self._evaluate(design, chamber, None, self._replicas)

    def evaluate(self, design: Design) -> Evaluation:
        """Evaluate a changed design. InputError or an error of sim_core if it cannot be simulated.

        A design that is only peened for another time has the nominal impacts: nothing is simulated.
        """
        plan = ReplicaPlan(self.nominal.replicas, self.nominal.stream)
        same = {TREATMENT_TIME: self.design.value(TREATMENT_TIME), "tolerances": None}
        if design.changed(same) == self.design.changed(same):
            return self._evaluate(design, self.chamber, plan, list(self._replicas))
        return self._evaluate(design, self.build(design), plan, [])

    def build(self, design: Design) -> Chamber:
        """The chamber of a changed design; a target that the shot's reach decides is kept."""
        keeps = self.design.part.target.reachable
        return build_chamber(design, self.chamber.part.target if keeps else None)

    def _evaluate(
        self, design: Design, chamber: Chamber, plan: ReplicaPlan | None, done: list[Replica]
    ) -> Evaluation:
        cavity = analytic_cavity(design, chamber) if self._analytic else None
        first, ended = self._done, 0
        self._runs -= 1

        def progress(finished: int, total: int, best: float | None) -> None:
            nonlocal ended
            ended = finished
            if self._progress:
                to_come = self._runs * max(len(self._replicas), design.process.accuracy.replicas)
                self._progress(first + finished, first + total + to_come, best)

        run = evaluate if plan else evaluate_calibrated
        found = run(design, chamber, self._executor, progress, plan, cavity, done)
        self._done = first + ended
        return found


def scale_of(name: str) -> FigureScale:
    """The scale of a metric."""
    metric = find_metric(name)
    if metric is None or metric.lowest < 0.0:
        return IDENTITY
    return SHARE if metric.highest == 1.0 else LOGARITHM


def on_scale(figure: Estimate, scale: FigureScale) -> Estimate:
    """The estimate of L from that of m; without an interval where there is none of m.

    The half-width is that whose wider side is the one of m, as `back_from_scale` gives it: near
    full coverage the slope would make it far wider. Pseudo-values and shared errors are carried
    over by the slope, as far as the half-width has room for them. A logarithm has no interval where
    that of m reaches 0.
    """
    if not math.isfinite(figure.half_width):
        return figure.not_known(figure.in_words or NOT_RESOLVED)
    try:
        value, slope = scale.forward(figure.value), abs(scale.slope(figure.value))
        half_width = value - scale.forward(figure.low)
    except (ValueError, ZeroDivisionError):
        return figure.not_known(figure.in_words or NOT_RESOLVED)
    with contextlib.suppress(ValueError):  # a share has no value on its scale from 1 on
        half_width = min(half_width, scale.forward(figure.high) - value)
    scatter = figure.half_width - figure.beyond_scatter
    if scatter > 0.0:
        slope = min(slope, half_width / scatter)
    return replace(
        figure,
        value=value,
        half_width=half_width,
        pseudovalues=tuple(value + slope * (y - figure.value) for y in figure.pseudovalues),
        bias=max(0.0, half_width - slope * scatter),
        shared=tuple(slope * one for one in figure.shared),
        in_words="",
    )


def with_errors_of(nominal: Estimate, changed: Estimate) -> Estimate:
    """A changed design's L with the errors of the nominal one's calibration: they move together.

    A figure that the change leaves as it is has them already.
    """
    errors = nominal.shared[FIRST_OF_CALIBRATION:]
    if not errors or changed.shared[FIRST_OF_CALIBRATION:]:
        return changed
    return changed.with_shared(FIRST_OF_CALIBRATION, errors)


def back_from_scale(value: Estimate, scale: FigureScale) -> Estimate:
    """The estimate of m from that of L; the wider side of its interval is the half-width."""
    middle = scale.inverse(value.value)
    if value.in_words or not math.isfinite(value.half_width):
        return Estimate(middle, math.inf, in_words=value.in_words or NOT_RESOLVED)
    sides = (abs(scale.inverse(one) - middle) for one in (value.low, value.high))
    return Estimate(middle, max(sides))


def combine(figures: Mapping[str, Estimate], weights: Mapping[str, float]) -> Estimate:
    """Weighted sum of paired estimates; what has no weight does not count."""
    used = {name: weight for name, weight in weights.items() if weight}
    if not used:
        return Estimate(0.0, 0.0)
    return weighted_sum(ObjectiveFunction("", "", used), dict(figures))


def response(changed: Estimate, nominal: Estimate, step: float) -> Estimate:
    """g of one figure from its paired estimates, both on its scale, and the step h."""
    pair = {"changed": changed, "nominal": nominal}
    return combine(pair, {"changed": 1.0 / step, "nominal": -1.0 / step})

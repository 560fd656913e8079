"""The figures of a design over the box of its tolerances, to first order from 1 + k paired runs.

Notation
    x_i    a number with a tolerance; any value from low to high is as likely  (ToleratedNumber)
    u_i    change of x_i: ln(x_i / nominal) where the number is positive, x_i - nominal otherwise
    L      a figure on its scale, see responses.py
    g_i    dL/du_i, from a run in which x_i alone is changed
    L(u) = L(0) + sum of g_i u_i

The slope of a quantile of L over g_i is the mean of u_i where L has this quantile, because the
share of the box below the quantile stays. So a quantile is a weighted sum of the runs, and has an
interval like any other sum. An effect that drowns in noise counts with its estimate, which makes
the box look wider rather than narrower.

A further run in the worst corner, on the same seeds, shows whether first order is enough.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Executor
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from chamberopt.chamber.analytic import analytic_cavity
from chamberopt.chamber.build import build_chamber
from chamberopt.common.errors import InputError, UnreadableError
from chamberopt.common.estimate import (
    CONFIDENCE,
    FIRST_OF_CALIBRATION,
    ZERO_TOLERANCE,
    Estimate,
    paired_difference,
)
from chamberopt.coverage.metrics import find_metric
from chamberopt.design.tolerances import require_tolerances, tolerance_box
from chamberopt.peening.calibration_errors import moved_designs, with_open_errors
from chamberopt.peening.responses import (
    back_from_scale,
    combine,
    on_scale,
    scale_of,
    with_errors_of,
)
from chamberopt.peening.tolerance_result import (
    EffectEnds,
    InCorner,
    ToleranceResult,
    ToleratedFigure,
    ToleratedRange,
)
from chamberopt.simulation.variations import RunsProgress, Variations

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from chamberopt.common.progress import Progress
    from chamberopt.design.load import Design
    from chamberopt.simulation.evaluation import Evaluation

# A change of five times the tolerance has a fifth of the noise, at the price of curvature. Beyond
# a third of the number, curvature would be the larger error (benchmarks/response_steps.py).
STRETCH, MOST = 5.0, 0.3
MASS, TREATMENT_TIME = "shot.mass_g", "process.treatment_time_s"
SAMPLE_EXPONENT = 12  # the box has 2^12 points


@dataclass(frozen=True)
class ToleratedNumber:
    """A number of a design that has a tolerance, with its range and the changed design to simulate.

    low, nominal, high: least, designed and largest value in the unit of the design file.
    """

    name: str
    low: float
    nominal: float
    high: float
    changed: Design  # with this number alone changed
    step: float  # u of this change; for the shot's mass, of its whole balls

    def moved(self, value: float) -> float:
        """Return by how much a value of this number differs from the nominal one.

        That is the logarithm of their ratio where the range is positive, else their difference.
        """
        return _moved(self.nominal, self.low, value)


def plan_tolerances(design: Design) -> tuple[ToleratedNumber, ...]:
    """Return the numbers of a design that have tolerances, each with the change to simulate.

    Raises InputError if no number has a tolerance, or if the design cannot have the least or the
    largest value that a tolerance allows.
    """
    box = tolerance_box(design)
    if not box:
        remedy = 'add a table [tolerances], such as "shot.mass_g" = "2 %"'
        raise InputError(f"tolerances: the design has none; {remedy}")
    require_tolerances(design)
    return tuple(_planned(design, name, *ends) for name, ends in box.items())


def effective_move(design: Design, number: ToleratedNumber) -> float:
    """Return by how much a number in a design differs from its nominal value.

    For the shot's mass, the mass of the whole balls counts. The difference is measured as by
    `ToleratedNumber.moved`: the logarithm of the ratio where the range is positive.
    """
    if number.name != MASS:
        return number.moved(design.value(number.name))
    return number.moved(1e3 * design.shot.count * design.shot.ball_mass)


def box_points(numbers: tuple[ToleratedNumber, ...]) -> np.ndarray:
    """Return changes (n, k) of all numbers at points spread evenly over their tolerances.

    A change is the logarithm of a number's ratio to its nominal value where its range is positive,
    else the difference of both.
    """
    from scipy.stats.qmc import Sobol

    sample = Sobol(len(numbers), seed=0).random_base2(SAMPLE_EXPONENT)
    columns = []
    for x, share in zip(numbers, sample.T, strict=True):
        values = x.low + share * (x.high - x.low)
        is_log = _is_logarithmic(x.nominal, x.low)
        columns.append(np.log(values / x.nominal) if is_log else values - x.nominal)
    return np.array(columns).T


def ball_notes(design: Design, numbers: tuple[ToleratedNumber, ...]) -> list[str]:
    """Return a note with the number of whole balls at the least and largest tolerated shot mass.

    The list is empty where the shot's mass has no tolerance.
    """
    for one in numbers:
        if one.name == MASS:
            ends = ({MASS: end, "tolerances": None} for end in (one.low, one.high))
            few, many = (design.changed(end).shot.count for end in ends)
            return [
                f"{MASS} from {one.low:.4g} to {one.high:.4g} is {few} to {many} whole balls; its "
                "effects are those of the mass that is really there"
            ]
    return []


def _planned(design: Design, name: str, low: float, high: float) -> ToleratedNumber:
    """Plan the widest change of a number that the design allows, to the wider side if possible."""
    nominal = design.value(name)
    logarithmic = _is_logarithmic(nominal, low)
    sides = sorted((_moved(nominal, low, end) for end in (low, high)), key=abs)
    least = abs(sides[1])
    most = max(least, min(MOST, STRETCH * least)) if logarithmic else STRETCH * least
    if name == MASS:  # by one ball at least
        most = max(most, 1.0 / design.shot.count)
    sizes = (most, 0.5 * most, 0.25 * most, least)
    for size in (one for one in sizes if one >= least):
        for sign in (math.copysign(1.0, sides[1]), -math.copysign(1.0, sides[1])):
            value = nominal * math.exp(sign * size) if logarithmic else nominal + sign * size
            try:
                changed = design.changed({name: value, "tolerances": None})
            except InputError:
                continue
            number = ToleratedNumber(name, low, nominal, high, changed, sign * size)
            step = effective_move(changed, number) - effective_move(design, number)
            if step:
                return ToleratedNumber(name, low, nominal, high, changed, step)
    text = "no change of this number can be simulated; leave it out"
    raise InputError(f"tolerances.{name}: {text}")


def _moved(nominal: float, low: float, value: float) -> float:
    return math.log(value / nominal) if _is_logarithmic(nominal, low) else value - nominal


def _is_logarithmic(nominal: float, low: float) -> bool:
    """Return whether changes of a number are measured as logarithms of its ratio to nominal."""
    return nominal > 0.0 and low > 0.0


NOMINAL = "nominal design"
QUANTILES = (0.05, 0.95)
BENT = 0.1  # share of the change in the worst corner that curvature may have
NEAR = 0.02  # share of the points that count as near to a quantile, for its slopes
NAMED = 3  # largest number of unresolved figures that a note names, instead of their number
# The worst corner is that of the first figure in this list that is resolved.
DECIDING = ("p05_coverage", "mean_coverage", "impacts_per_mm2_s")


def simulate_tolerances(
    design: Design,
    chamber: Chamber,
    executor: Executor,
    progress: Progress | None = None,
    analytic: bool = False,
) -> tuple[Evaluation, ToleranceResult]:
    """Simulate a design, and what its tolerances do to its figures; return both.

    Args:
        analytic: whether the chamber has its exact shape in the simulation, instead of a mesh.
    Raises:
        InputError: the design has no tolerances, or cannot have a value that they allow.
        sim_core.SimulationError: a run must stop.
    """
    numbers = plan_tolerances(design)
    target = chamber.part.target if design.part.target.reachable else None
    for one in numbers:  # before the design itself is simulated
        with _run_named(one):
            build_chamber(one.changed, target)
    moved = [one for one in numbers if one.name != TREATMENT_TIME]
    count = 1 + len(moved_designs(design)) + len(moved) + bool(moved)
    of_all = RunsProgress(progress, count)
    cavity = analytic_cavity(design, chamber) if analytic else None
    runs = Variations(design, chamber, executor, of_all, cavity=cavity)
    nominal = with_open_errors(runs)

    def evaluate(changed: Design) -> Evaluation:
        same = {TREATMENT_TIME: design.value(TREATMENT_TIME), "tolerances": None}
        if changed.changed(same) == design.changed(same):  # the impacts are those of the design
            return runs.run(changed, replicas=runs.known.replicas)
        return runs.run(changed, build_chamber(changed, target))

    return nominal, find_tolerances(design, numbers, nominal, evaluate)


@contextmanager
def _run_named(number: ToleratedNumber) -> Iterator[None]:
    """Add to the message of an error in which run it happened: the changed number and its value."""
    try:
        yield
    except Exception as error:
        error.add_note(f"in the run with {number.name} = {number.changed.value(number.name):g}")
        raise


def find_tolerances(
    design: Design,
    numbers: tuple[ToleratedNumber, ...],
    nominal: Evaluation,
    evaluate: Callable[[Design], Evaluation],
) -> ToleranceResult:
    """Simulate each change of a number, then the worst corner, and return all figures over the box.

    The box holds all values that the tolerances allow. The worst corner is that in which coverage,
    or the rate of impacts where no coverage is resolved, is lowest to first order.

    Args:
        nominal: evaluation of the design as it is.
        evaluate: evaluates a changed design in the replicas and on the seeds of `nominal`.
    """
    changed = {}
    for one in numbers:
        with _run_named(one):
            changed[one.name] = evaluate(one.changed)
    figures = {
        name: _Figure(name, numbers, on)
        for name in nominal.metrics
        if (on := _resolved(name, nominal, changed))
    }
    unknown = [
        name
        for name, one in nominal.metrics.items()
        if name not in figures and one.half_width and one.in_words != "never"
    ]
    notes = []
    if unknown:
        which = ", ".join(unknown) if len(unknown) <= NAMED else f"{len(unknown)} figures"
        notes.append(
            f"not resolved over the tolerances: {which}; raise process.accuracy.simulated_time_s "
            "or replicas"
        )
    notes += ball_notes(design, numbers)
    worst_for = next((name for name in DECIDING if name in figures), "")
    found = {name: one.over_the_box() for name, one in figures.items()}
    if not worst_for:
        return _result(numbers, found, "", {}, notes)
    slopes = figures[worst_for].slopes
    corner = {
        one.name: one.low if slope > 0.0 else one.high
        for one, slope in zip(numbers, slopes, strict=True)
    }
    try:
        there = design.changed({**corner, "tolerances": None})  # which would lie about the corner
        simulated = evaluate(there)
    except UnreadableError:
        raise
    except InputError as error:
        notes.append(f"the worst corner cannot be simulated, so first order is unchecked: {error}")
        return _result(numbers, found, worst_for, corner, notes)
    at = np.array([effective_move(there, one) - effective_move(design, one) for one in numbers])
    confidence = 1.0 - (1.0 - CONFIDENCE) / len(figures)  # of all figures together (Bonferroni)
    found = {
        name: figures[name].with_corner(one, at, simulated.metrics[name], confidence)
        for name, one in found.items()
    }
    bent = [name for name, one in found.items() if one.corner and not one.corner.agrees]
    if bent:
        notes.append(
            f"in the worst corner {', '.join(bent)}: not as first order in the tolerances says, by "
            f"more than noise and {BENT:.0%} of the change; what is simulated there counts, and "
            "q05 and q95 are rough"
        )
    return _result(numbers, found, worst_for, corner, notes)


def _result(
    numbers: tuple[ToleratedNumber, ...],
    figures: dict[str, ToleratedFigure],
    worst_for: str,
    corner: dict[str, float],
    notes: list[str],
) -> ToleranceResult:
    return ToleranceResult(
        box={
            one.name: ToleratedRange(
                low=one.low,
                nominal=one.nominal,
                high=one.high,
                changed_to=one.changed.value(one.name),
            )
            for one in numbers
        },
        worst_for=worst_for,
        corner=corner,
        figures=figures,
        notes=notes,
    )


class _Figure:
    """One figure in all runs, on the scale on which it responds nearly in a straight line."""

    def __init__(
        self, name: str, numbers: tuple[ToleratedNumber, ...], runs: dict[str, Estimate]
    ) -> None:
        """Bring the figure of each run to its scale, and find its slope by each number.

        Args:
            runs: the figure of the nominal design, and of the run in which each number is changed.
        """
        metric, self._scale = find_metric(name), scale_of(name)
        if name.rpartition(".")[2] == "time_to_98_s" and TREATMENT_TIME in runs:
            # It does not depend on the treatment time, but its estimate does, by chance.
            runs = runs | {TREATMENT_TIME: runs[NOMINAL]}
        self._range = (metric.lowest, metric.highest) if metric else (-math.inf, math.inf)
        self._numbers, self._nominal = numbers, runs[NOMINAL]
        nominal = on_scale(self._nominal, self._scale)
        self._on = {NOMINAL: nominal}
        for x in numbers:
            self._on[x.name] = with_errors_of(nominal, on_scale(runs[x.name], self._scale))
        at_nominal = nominal.value
        self.slopes = np.array([(self._on[x.name].value - at_nominal) / x.step for x in numbers])

    def over_the_box(self) -> ToleratedFigure:
        """Return quantiles, extremes and effects of the figure over the box of tolerances.

        The values in the worst corner are left out.
        """
        ends = np.array([[x.moved(x.low), x.moved(x.high)] for x in self._numbers])
        points = box_points(self._numbers)
        order = np.argsort(points @ self.slopes, kind="stable")
        quantiles = []
        for share in QUANTILES:
            first = round(len(points) * (share - 0.5 * NEAR))
            near = order[first : first + round(len(points) * NEAR)]
            quantiles.append(self._possible(self._at(points[near].mean(axis=0))))
        lowest = np.where(self.slopes > 0.0, *ends.T)
        highest = np.where(self.slopes > 0.0, *ends.T[::-1])
        extremes = [self._possible(self._at(corner)) for corner in (lowest, highest)]
        effects = {
            x.name: EffectEnds(low=self._change(k, ends[k, 0]), high=self._change(k, ends[k, 1]))
            for k, x in enumerate(self._numbers)
        }
        return ToleratedFigure(
            nominal=_without_replicas(self._nominal),
            q05=quantiles[0],
            q95=quantiles[1],
            lowest=extremes[0],
            highest=extremes[1],
            effects=effects,
            corner=None,
        )

    def with_corner(
        self, found: ToleratedFigure, u: np.ndarray, simulated: Estimate, confidence: float
    ) -> ToleratedFigure:
        """Add to a figure its values in the worst corner: by first order, and as simulated.

        Args:
            found: the figure over the box of tolerances.
            u: changes of the numbers in the corner, (k,).
            simulated: the figure as simulated in the corner.
            confidence: confidence with which both values must differ to disagree.
        """
        predicted = self._at(u)
        there, shown = on_scale(simulated, self._scale), self._back(predicted)
        agrees, simulated = True, _without_replicas(simulated)
        if _is_resolved(there):
            if self._on[NOMINAL].shared[FIRST_OF_CALIBRATION:]:
                there = with_errors_of(self._on[NOMINAL], there)
                simulated = self._back(there)
            gap = paired_difference(there, predicted, confidence)
            change = abs(predicted.value - self._on[NOMINAL].value)
            agrees = bool(abs(gap.value) <= max(gap.half_width, BENT * change))
        corner = InCorner(predicted=shown, simulated=simulated, agrees=agrees)
        return found.model_copy(update={"corner": corner})

    def _at(self, u: np.ndarray) -> Estimate:
        """Return the figure on its scale after changes u (k,) of the numbers, to first order."""
        shares = [float(one) / x.step for one, x in zip(u, self._numbers, strict=True)]
        weights = {x.name: share for x, share in zip(self._numbers, shares, strict=True)}
        return combine(self._on, {NOMINAL: 1.0 - sum(shares), **weights})

    def _change(self, number: int, u: float) -> Estimate:
        """Return the change of the figure when only one number changes.

        Its error comes from the change on the scale, and from the value on the scale where the
        change starts.

        Args:
            number: position of the number.
            u: change of the number.
        """
        x, nominal = self._numbers[number], self._on[NOMINAL]
        share, changed = u / x.step, self._on[x.name]
        change = combine(self._on, {x.name: share, NOMINAL: -share})
        reach = change.half_width
        if x.name == TREATMENT_TIME:  # both runs have the same impacts, and the same bias
            reach -= 2.0 * abs(share) * min(nominal.beyond_scatter, changed.beyond_scatter)
        there = self._back(Estimate(nominal.value + change.value, max(0.0, reach)))

        def moved(start: float) -> float:
            return self._scale.inverse(start + change.value) - self._scale.inverse(start)

        value = moved(nominal.value)
        half_width = there.half_width + max(
            abs(moved(start) - value) for start in (nominal.low, nominal.high)
        )
        rounding = ZERO_TOLERANCE * abs(there.value)
        return (
            Estimate(0.0, 0.0)
            if abs(value) + half_width < rounding
            else Estimate(value, half_width)
        )

    def _possible(self, value: Estimate) -> Estimate:
        """Return the figure from its value on the scale, limited to values that it can have."""
        found = self._back(value)
        return replace(found, value=min(max(found.value, self._range[0]), self._range[1]))

    def _back(self, value: Estimate) -> Estimate:
        return back_from_scale(value, self._scale)


def _resolved(
    name: str, nominal: Evaluation, changed: Mapping[str, Evaluation]
) -> dict[str, Estimate]:
    """Return the estimate of a figure in each run.

    Return nothing where a run does not resolve the figure, or where the figure has no scatter.
    """
    runs = {NOMINAL: nominal, **changed}
    figures = {run: one.metrics[name] for run, one in runs.items() if name in one.metrics}
    known = all(_is_resolved(on_scale(one, scale_of(name))) for one in figures.values())
    is_random = any(one.half_width for one in figures.values())
    return figures if known and is_random and len(figures) == len(runs) else {}


def _without_replicas(figure: Estimate) -> Estimate:
    return Estimate(figure.value, figure.half_width, in_words=figure.in_words)


def _is_resolved(figure: Estimate) -> bool:
    return math.isfinite(figure.half_width) and not figure.in_words

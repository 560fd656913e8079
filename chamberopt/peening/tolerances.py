"""Find how far the figures of a design, such as mean coverage, may be off within its tolerances.

The box of the tolerances holds all values that they allow. 1 + k runs are simulated on the same
seeds: a run of the design, and for each of its k toleranced numbers a run with that number changed.
The figures in the box follow from the runs to first order.

Notation
    x_i    a number with a tolerance; all values from low to high are as likely  (ToleratedNumber)
    u_i    change of x_i: ln(x_i / nominal) where the number is positive, x_i - nominal otherwise
    L      a figure on a scale (e.g. logarithmic) on which it changes linearly, see responses.py
    g_i    dL/du_i, from a run in which x_i alone is changed
    L(u) = L(0) + sum of g_i u_i

If g_i changes, a quantile of L changes by the mean of u_i over the points of the box where L equals
the quantile, because the share of the box below the quantile stays the same. A quantile is
therefore a weighted sum of the runs, and its interval is that of the sum. An effect within the
noise counts with its estimate, which makes the spread over the box look too wide rather than too
narrow.

A further run on the same seeds, with all numbers in the worst corner of the box, shows whether
first order is enough.
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
from chamberopt.design.tolerances import USUAL, require_tolerances, tolerance_box
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

    low, high: least and largest allowed value, in the unit of the design file.
    nominal: value in the design.
    """

    name: str
    low: float
    nominal: float
    high: float
    changed: Design  # with this number alone changed
    step: float  # u of this change; for the shot's mass, of its whole balls

    def moved(self, value: float) -> float:
        """Return by how much a value of this number differs from the nominal value.

        If all values of the range are positive, this is the logarithm of value / nominal, else it
        is value - nominal.
        """
        return _moved(self.nominal, self.low, value)


def plan_tolerances(design: Design) -> tuple[ToleratedNumber, ...]:
    """Return the numbers of a design that have tolerances, each with the change that is simulated.

    Raises InputError if the table of tolerances is empty, or if the design cannot have the least
    or the largest value that a tolerance allows.
    """
    design = with_usual_tolerances(design)
    box = tolerance_box(design)
    if not box:
        remedy = 'give one, such as "shot.mass_g" = "2 %", or leave the table out'
        raise InputError(f"tolerances: the table is empty; {remedy}")
    require_tolerances(design)
    return tuple(_planned(design, name, *ends) for name, ends in box.items())


def with_usual_tolerances(design: Design) -> Design:
    """Return the design with the usual tolerance of its amplitude if it has no [tolerances]."""
    return design.changed({"tolerances": USUAL}) if design.tolerances is None else design


def effective_move(design: Design, number: ToleratedNumber) -> float:
    """Return by how much a number in a design differs from its nominal value.

    The difference is measured as in `ToleratedNumber.moved`. The number of balls is whole, so the
    mass of the shot is the mass of these balls.
    """
    if number.name != MASS:
        return number.moved(design.value(number.name))
    return number.moved(1e3 * design.shot.count * design.shot.ball_mass)


def box_points(numbers: tuple[ToleratedNumber, ...]) -> np.ndarray:
    """Return changes (n, k) of the k numbers at n points spread evenly over their tolerances.

    A change is measured as in `ToleratedNumber.moved`.
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
    """Return a note that gives the whole number of balls at the least and largest mass of the shot.

    The list is empty if the shot's mass has no tolerance.
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
    """Plan the change of a number for its run: the widest that the design allows.

    A change towards the wider side of the tolerance is tried first. The change may exceed the
    tolerance (see STRETCH), so that it stands out from the noise.
    """
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
    """Return True if changes of a number are ln(value / nominal), False if value - nominal."""
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
    """Simulate a design, and the effect of its tolerances on its figures. Return both results.

    Args:
        analytic: True to simulate the exact cylinder, box or prism instead of the chamber's mesh.
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
    """Add a note to an error of the `with` block: the changed number of the run, and its value."""
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

    The box holds all values that the tolerances allow. The worst corner is the corner of the box
    with the lowest value, to first order, of the first figure in DECIDING (coverage, then rate of
    impacts) that is known in all runs.

    Args:
        nominal: evaluation of the design as it is.
        evaluate: function that simulates a changed design on the seeds of `nominal`.
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
    """One figure (e.g. mean coverage) in all runs, on a scale on which it is nearly linear."""

    def __init__(
        self, name: str, numbers: tuple[ToleratedNumber, ...], runs: dict[str, Estimate]
    ) -> None:
        """Convert the figure of each run to its scale, and find the slope along each number.

        Args:
            name: name of the figure.
            runs: the figure in each run: the nominal design's under NOMINAL, the others under the
                name of the changed number.
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
        """Return the figure's quantiles, extremes and effects of the numbers, over the tolerances.

        The box holds all values that the tolerances allow. Values in its worst corner are left out.
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
        """Return `found` with two values in the worst corner: to first order, and as simulated.

        Args:
            found: the figure over the box of tolerances.
            u: changes of the numbers from nominal to the corner, shape (k,).
            simulated: the figure as simulated in the corner.
            confidence: confidence with which the two values must differ to count as disagreeing.
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
        """Return the figure on its scale after changes u (k,) of the k numbers, to first order."""
        shares = [float(one) / x.step for one, x in zip(u, self._numbers, strict=True)]
        weights = {x.name: share for x, share in zip(self._numbers, shares, strict=True)}
        return combine(self._on, {NOMINAL: 1.0 - sum(shares), **weights})

    def _change(self, number: int, u: float) -> Estimate:
        """Return the change of the figure, in its own unit, when only one number changes.

        The error of this change has two sources: the error of the change on the scale, and the
        error of the nominal value on the scale, from which the change starts.

        Args:
            number: position of the number.
            u: change of the number, as from `ToleratedNumber.moved`.
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
        """Convert a value on the scale back to the figure, limited to its possible values."""
        found = self._back(value)
        return replace(found, value=min(max(found.value, self._range[0]), self._range[1]))

    def _back(self, value: Estimate) -> Estimate:
        return back_from_scale(value, self._scale)


def _resolved(
    name: str, nominal: Evaluation, changed: Mapping[str, Evaluation]
) -> dict[str, Estimate]:
    """Return the estimate of the figure `name` in each run, by the name of the run.

    Return an empty table if the figure is unknown or too noisy in a run, or has no scatter in any.
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

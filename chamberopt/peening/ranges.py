"""Find how far the figures of a design may be off because of numbers that nobody has measured.

Friction, yield speeds v0 and slopes of faces are groups of numbers (design/ranges.py), each number
between two bounds. Copies of the design with one group at its low or high end are
simulated in some replicas, with the seeds of the design's own first replicas. The range of a figure
follows from its changes.

Notation
    L     a figure on a scale on which it changes nearly in a straight line, see responses.py
    n     replicas of the figures themselves; r <= n replicas at each end
    d     change of L at an end: its value there less its value in the design's first r replicas
    s     standard error of d by the scatter of the replicas: sqrt(2 n / r) times that of L
    d'    change without what noise adds on average, sign(d) sqrt(max(0, d^2 - s^2))
    range = L - root of the sum of the squares of the most negative d' of each group
            to L + root of the sum of the squares of the most positive d' of each group

A chamber is chaotic, so that two runs with equal seeds scatter as two with others do, and the mean
of d^2 is the square of the true change plus s^2. Both values of d come from equally many dents, so
that errors by few dents cancel in it. The scatter s is that of the n replicas, because the scatter
of so few as r is hardly known.

Percentiles over the area scatter much more than means. Where the number of dents changes alike
everywhere they go with the mean dose, and so does the time to full coverage. Their change is that
of the dose and, apart from it, what they change beside it. Noise is taken off each of the two.

The groups are independent of one another, so their changes are added in quadrature: all groups are
hardly at their worst ends at once. A figure that has no number at an end, such as a time that is
never, has the range of its values at the ends.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np

from chamberopt.chamber.analytic import analytic_cavity
from chamberopt.chamber.scene import chamber_mesh
from chamberopt.common.estimate import Estimate, student_quantile
from chamberopt.coverage.metrics import find_metric, highest_objective
from chamberopt.design.ranges import Unknown, calibrated, unknowns, variants
from chamberopt.peening.range_result import (
    NEVER_IN_WORDS,
    GainAtEnd,
    RangedFigure,
    RangeResult,
    RivalAtEnds,
)
from chamberopt.peening.responses import IDENTITY, FigureScale, on_scale, scale_of
from chamberopt.peening.tolerance_result import EffectEnds
from chamberopt.simulation.evaluate import ReplicaPlan, prepare_target, window_setting
from chamberopt.simulation.replicas import Replica, ReplicaSet
from chamberopt.simulation.trapped_balls import NOT_TRAPPED
from chamberopt.simulation.variations import RunsProgress, Variations

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from chamberopt.common.progress import Progress
    from chamberopt.design.load import Design
    from chamberopt.simulation.evaluation import Evaluation

LEAST_REPLICAS = 2  # at each end, and 1/2k of the design's own if that is more
# Figures of single places are told at the ends from this number of dents in the median window on.
# They take 25 for an interval of their own, but the errors by few dents cancel in changes.
LEAST_DENTS = 5.0
# Figures that go with the mean dose of dents, and the power of it, by Avrami's equation: where all
# places get twice the dents, x doubles in 1 - exp(-x) and the time to 98 % halves.
DOSE = "exposure"
WITH_DOSE = {"p05_coverage": 1.0, "p95_coverage": 1.0, "p95_exposure": 1.0, "time_to_98_s": -1.0}


@dataclass(frozen=True)
class EndRuns:
    """Evaluations of a design, and of copies with one group of numbers at an end.

    whole: evaluation of the design in all its replicas.
    few: evaluation of the design in as many of its replicas as each end has, on the same seeds.
    ends: evaluations at the low and at the high end of each group, by its name.
    """

    groups: Sequence[Unknown]
    calibrated: list[str]
    whole: Evaluation
    few: Evaluation
    ends: dict[str, tuple[Evaluation, Evaluation]]

    @property
    def cost(self) -> float:
        """Simulated time of all ends over that of the design itself."""
        return 2.0 * len(self.groups) * self.few.replicas / self.whole.replicas

    @property
    def noise(self) -> float:
        """Standard error of the difference of two runs of `few` replicas, over that of `whole`."""
        return math.sqrt(2.0 * self.whole.replicas / self.few.replicas)


def replicas_at_ends(replicas: int, groups: int) -> int:
    """Return the number of replicas at each end of `groups` groups of unknown numbers.

    All ends together take as many as the design itself, or two each if it has few.
    """
    return min(replicas, max(LEAST_REPLICAS, replicas // (2 * max(groups, 1))))


def simulate_ends(
    design: Design,
    chamber: Chamber,
    whole: Evaluation,
    executor: Executor,
    progress: Progress | None = None,
    replicas: int | None = None,
) -> EndRuns | None:
    """Simulate a design with each group of unknown numbers at both ends of its range.

    Return None if no group is unknown.

    Args:
        whole: evaluation of the design. Its first replicas are compared with those at the ends.
        progress: called as progress(done, total, None) after each replica of all ends.
        replicas: number of replicas at each end; by default as `replicas_at_ends` says.
    Raises:
        InputError: the design cannot have an end of a range.
    """
    groups, at_ends = unknowns(design), variants(design)
    if not groups:
        return None
    count = replicas or replicas_at_ends(whole.replicas, len(groups))
    # What was hit in which step is not kept, so that a design with steps is simulated again.
    kept = () if design.steps else whole.hits[:count]
    first = [Replica({}, None, NOT_TRAPPED, hits) for hits in kept]
    plan = ReplicaPlan(count, whole.stream, whole.objective_name, wide_windows=False)
    cavity = analytic_cavity(design, chamber) if whole.analytic else None
    of_all = RunsProgress(progress, 2 * len(groups), ended=-1)  # the design itself takes none
    # The chamber is the same at all ends, so that one target serves them all.
    target = prepare_target(design, chamber, chamber_mesh(chamber))
    runs = Variations(design, chamber, executor, of_all, plan, cavity, ReplicaSet(first, target))

    def run(group: Unknown, changed: Design, end: str) -> Evaluation:
        try:
            largest_dent = window_setting(changed, chamber).largest_dent
            return runs.run(changed, target=target.with_largest_dent(largest_dent))
        except Exception as error:
            error.add_note(f"in the run at the {end} end of {group.name}")
            raise

    ends = {}
    for one in groups:
        low, high = at_ends[one.name]
        ends[one.name] = run(one, low, "low"), run(one, high, "high")
    return EndRuns(groups, calibrated(design), whole, runs.nominal, ends)


def find_ranges(runs: EndRuns) -> RangeResult:
    """Return the ranges of a design's figures, from its runs at the ends of unknown numbers.

    Figures that have no interval of their own, because they are exact or not resolved, have none.
    """
    whole = runs.whole
    names = dict.fromkeys((whole.objective_name, *whole.metrics))
    wanted = [name for name in names if _is_known(_figure(whole, name))]
    found = {name: _ranged(name, runs) for name in wanted}
    return RangeResult(
        groups={one.name: one.numbers for one in runs.groups},
        calibrated=runs.calibrated,
        replicas=runs.few.replicas,
        cost=runs.cost,
        figures={name: one for name, one in found.items() if one},
        not_resolved=[name for name, one in found.items() if one is None],
    )


def best_at_ends(
    best: EndRuns, rival: EndRuns, which: Literal["start", "runner-up"]
) -> RivalAtEnds:
    """Return the gain of a study's best design over another at each end of each group.

    The half-widths are those of the paired replicas of both designs in all their replicas, as wide
    as the fewer replicas at the ends make them.
    """
    both = [one.whole.objective for one in (best, rival)]
    values = [np.array(one.pseudovalues) for one in both]
    count = min(map(len, values))
    alike = len(values[0]) == len(values[1])
    gaps = values[0] - values[1] if alike else np.concatenate([v - v.mean() for v in values])
    scatter = float(gaps.std(ddof=1)) * (1.0 if alike else math.sqrt(2.0))
    of_whole = student_quantile(count - 1) * scatter / math.sqrt(count)
    wider = math.sqrt(min(best.whole.replicas, rival.whole.replicas) / best.few.replicas)
    gains = []
    for name in (one for one in best.ends if one in rival.ends):
        sides: tuple[Literal["low", "high"], ...] = ("low", "high")
        for end, ours, theirs in zip(sides, best.ends[name], rival.ends[name], strict=True):
            gain = Estimate(ours.objective.value - theirs.objective.value, wider * of_whole)
            gains.append(GainAtEnd(group=name, end=end, gain=gain))
    return RivalAtEnds(rival=which, gains=gains)


def _figure(evaluation: Evaluation, name: str) -> Estimate:
    """Return a metric, or the objective, of an evaluation."""
    return evaluation.metrics.get(name, evaluation.objective)


def _is_known(figure: Estimate) -> bool:
    """Return if a figure has an interval, or is never reached."""
    is_random = 0.0 < figure.half_width < math.inf and figure.has_number
    return is_random or figure.in_words == NEVER_IN_WORDS


def _ranged(name: str, runs: EndRuns) -> RangedFigure | None:
    """Return the range of a figure; None if the runs at the ends do not resolve it."""
    few = _figure(runs.few, name)
    ends = {one: tuple(_figure(e, name) for e in pair) for one, pair in runs.ends.items()}
    every = [few, *(one for pair in ends.values() for one in pair)]
    if any(not _can_be_told(name, one, runs.few.resolution.dents) for one in every):
        return None
    known = _figure(runs.whole, name)
    if NEVER_IN_WORDS in (known.in_words, *(one.in_words for one in every)):
        return _between_ends(known, few, ends)
    found = _changes_with_dose(name, runs) or _changes(name, runs)
    metric, start = find_metric(name), found.start
    highest = metric.highest if metric else highest_objective(name, runs.whole.reachable)
    back = _BackFromScale(found.scale, metric.lowest if metric else -math.inf, highest)
    # The most negative and the most positive change of each group, shape (k,), and its noise.
    groups = np.arange(len(runs.groups))
    sides = []
    for at, sign in ((found.true.argmin(axis=1), -1.0), (found.true.argmax(axis=1), 1.0)):
        change = sign * np.maximum(sign * found.true[groups, at], 0.0)
        sides.append(back.end(start, change, found.half_width[groups, at], sign))
    squares = np.minimum(found.true.min(axis=1), 0.0) ** 2
    squares = squares + np.maximum(found.true.max(axis=1), 0.0) ** 2
    whole = float(squares.sum())
    rows = zip(ends, found.shown, found.half_width, strict=True)
    return RangedFigure(
        low=sides[0],
        high=sides[1],
        effects={
            one: EffectEnds(
                low=back.change(start, float(change[0]), float(noise[0])),
                high=back.change(start, float(change[1]), float(noise[1])),
            )
            for one, change, noise in rows
        },
        shares={one: float(x) / whole for one, x in zip(ends, squares, strict=True)}
        if whole
        else {},
    )


class _Changes(NamedTuple):
    """Changes of a figure at the ends of the groups, on its scale; arrays have the shape (k, 2).

    start: place of the figure itself.
    scatter: its pseudo-values over the replicas of the design, (g,).
    shown: the changes.
    true: the changes without what noise adds on average.
    half_width: of their 95 % intervals.
    """

    scale: FigureScale
    start: float
    scatter: np.ndarray
    shown: np.ndarray
    true: np.ndarray
    half_width: np.ndarray


def _changes(name: str, runs: EndRuns) -> _Changes:
    few, known = _figure(runs.few, name), _figure(runs.whole, name)
    every = [few, *(_figure(end, name) for pair in runs.ends.values() for end in pair)]
    scale = scale_of(name) if find_metric(name) else IDENTITY
    if on_scale(known, scale).in_words or not all(_has_place(scale, one.value) for one in every):
        scale = IDENTITY  # a share of 0 or of 1, for example, has no place on the other scale
    whole = on_scale(known, scale)
    places = np.array([scale.forward(one.value) for one in every])
    scatter = np.array(whole.pseudovalues)
    shown = places[1:].reshape(-1, 2) - places[0]
    true, half_width = _without_noise(shown, scatter, runs.noise)
    return _Changes(scale, whole.value, scatter, shown, true, half_width)


def _changes_with_dose(name: str, runs: EndRuns) -> _Changes | None:
    """Return the changes of a figure that goes with the dose; None for other figures.

    They are those of the dose and, apart from these, what the figure changes beside them.
    """
    zone, _, metric = name.rpartition(".")
    dose = f"{zone}.{DOSE}" if zone else DOSE
    if metric not in WITH_DOSE or dose not in runs.whole.metrics:
        return None
    own, of_dose, power = _changes(name, runs), _changes(dose, runs), WITH_DOSE[metric]
    if IDENTITY in (own.scale, of_dose.scale) or len(own.scatter) != len(of_dose.scatter):
        return None
    # Too few dents tell nothing of single places: what a percentile seems to change beside the dose
    # would be noise, without bound where the percentile is near 0.
    few = [runs.few, *(end for pair in runs.ends.values() for end in pair)]
    are_known = all(_figure(one, name).has_number for one in few)
    beside = (own.shown - power * of_dose.shown) * are_known
    scatter = own.scatter - power * of_dose.scatter
    true, half_width = _without_noise(beside, scatter, runs.noise)
    shown = power * of_dose.shown + true
    noise = np.hypot(of_dose.half_width, np.where(true == 0.0, 0.0, half_width))
    return own._replace(shown=shown, true=power * of_dose.true + true, half_width=noise)


def _without_noise(
    changes: np.ndarray, scatter: np.ndarray, wider: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return changes (k, 2) without what noise adds, and half-widths of the changes (k, 2).

    Args:
        scatter: pseudo-values of the figure in all replicas, (g,).
        wider: standard error of a change over that of the figure.
    """
    error = wider * float(scatter.std(ddof=1)) / math.sqrt(len(scatter))
    true = np.sign(changes) * np.sqrt(np.maximum(changes**2 - error**2, 0.0))
    return true, np.full_like(changes, student_quantile(len(scatter) - 1) * error)


def _can_be_told(name: str, figure: Estimate, dents: float) -> bool:
    """Return if a figure of few replicas can be compared, even if it has no interval there.

    Args:
        dents: number in the median window of the target.
    """
    if figure.has_number or figure.in_words == NEVER_IN_WORDS:
        return True
    return math.isfinite(figure.value) and dents >= LEAST_DENTS and "." not in name


def _has_place(scale: FigureScale, value: float) -> bool:
    try:
        scale.forward(value)
    except (ValueError, ZeroDivisionError):
        return False
    return True


@dataclass(frozen=True)
class _BackFromScale:
    """Converts places on a scale back to a figure, between its least and largest value."""

    scale: FigureScale
    lowest: float
    highest: float

    def value(self, place: float) -> float:
        return min(max(self.scale.inverse(place), self.lowest), self.highest)

    def interval(self, place: float, half_width: float) -> Estimate:
        middle = self.value(place)
        sides = (abs(self.value(place + one) - middle) for one in (-half_width, half_width))
        return Estimate(middle, max(sides))

    def end(
        self, start: float, changes: np.ndarray, half_widths: np.ndarray, sign: float
    ) -> Estimate:
        """Return the end of a range on one side, by the changes (k,) of the groups to that side."""
        size = float(np.linalg.norm(changes))
        noise = float(np.linalg.norm(changes * half_widths)) / size if size else 0.0
        return self.interval(start + sign * size, noise or float(half_widths.max()))

    def change(self, start: float, change: float, half_width: float) -> Estimate:
        """Return the change of the figure that starts at a place on its scale."""
        there = self.interval(start + change, half_width)
        return Estimate(there.value - self.value(start), there.half_width)


def _between_ends(
    whole: Estimate, few: Estimate, ends: dict[str, tuple[Estimate, ...]]
) -> RangedFigure:
    """Return the range of a figure that is never reached in a run: from least to largest value."""

    def noise(figure: Estimate) -> float:
        return figure.half_width if math.isfinite(figure.half_width) else abs(figure.value)

    def shown(figure: Estimate) -> Estimate:
        is_never = figure.in_words == NEVER_IN_WORDS
        words, half_width = (NEVER_IN_WORDS, math.inf) if is_never else ("", noise(figure))
        return Estimate(figure.value, half_width, in_words=words)

    def change(end: Estimate) -> Estimate:
        never = [one.in_words == NEVER_IN_WORDS for one in (end, few)]
        if all(never):
            return Estimate(0.0, 0.0)
        gap = end.value - few.value
        if any(never):
            return Estimate(gap, math.inf, in_words=NEVER_IN_WORDS)
        return Estimate(gap, math.hypot(noise(end), noise(few)))

    every = [whole, *(one for pair in ends.values() for one in pair)]
    low, high = (shown(pick(every, key=lambda one: one.value)) for pick in (min, max))
    return RangedFigure(
        low=low,
        high=high,
        effects={
            name: EffectEnds(low=change(pair[0]), high=change(pair[1]))
            for name, pair in ends.items()
        },
        shares={},
    )

"""Find how far the figures of a design may be off because of numbers that nobody has measured.

Friction, yield speeds v0 and slopes of faces are groups of numbers (design/ranges.py), each between
two factors of the design's numbers. Copies of the design with one group at its low or high end are
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

The groups are independent of one another, so their changes are added in quadrature: all groups are
hardly at their worst ends at once. A figure that has no number at an end, such as a time that is
never, has the range of its values at the ends.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from chamberopt.chamber.analytic import analytic_cavity
from chamberopt.common.estimate import Estimate, student_quantile
from chamberopt.coverage.metrics import find_metric, highest_objective
from chamberopt.design.ranges import Unknown, calibrated, unknowns, variants
from chamberopt.peening.range_result import (
    NEVER_IN_WORDS,
    GainAtEnd,
    RangedFigure,
    RangeResult,
    RivalAtEnds,
    UnknownGroup,
)
from chamberopt.peening.responses import IDENTITY, FigureScale, on_scale, scale_of
from chamberopt.peening.tolerance_result import EffectEnds
from chamberopt.simulation.evaluate import ReplicaPlan
from chamberopt.simulation.replicas import Replica, ReplicaSet
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
    groups, changed = unknowns(design), variants(design)
    if not groups:
        return None
    count = replicas or replicas_at_ends(whole.replicas, len(groups))
    first = [Replica({}, None, 0.0, hits) for hits in whole.hits[:count]]
    plan = ReplicaPlan(count, whole.stream, whole.objective_name)
    cavity = analytic_cavity(design, chamber) if whole.analytic else None
    of_all = RunsProgress(progress, 2 * len(groups), ended=-1)  # the design itself takes none
    runs = Variations(design, chamber, executor, of_all, plan, cavity, ReplicaSet(first))
    ends = {name: (runs.run(low), runs.run(high)) for name, (low, high) in changed.items()}
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
        groups={
            one.name: UnknownGroup(low=one.low, high=one.high, numbers=one.numbers)
            for one in runs.groups
        },
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
    metric = find_metric(name)
    scale = scale_of(name) if metric else IDENTITY
    if on_scale(known, scale).in_words or not all(_has_place(scale, one.value) for one in every):
        scale = IDENTITY  # a share of 0 or of 1, for example, has no place on the other scale
    whole = on_scale(known, scale)
    places = [scale.forward(one.value) for one in every]
    highest = highest_objective(name, runs.whole.reachable) if not metric else metric.highest
    lowest = metric.lowest if metric else -math.inf
    changes = np.array(places[1:], dtype=float).reshape(-1, 2) - places[0]  # (k, 2)
    scatter = np.array(whole.pseudovalues)
    error = runs.noise * float(scatter.std(ddof=1)) / math.sqrt(len(scatter))
    half_width = student_quantile(len(scatter) - 1) * error
    true = np.sign(changes) * np.sqrt(np.maximum(changes**2 - error**2, 0.0))
    sides = np.minimum(true.min(axis=1), 0.0), np.maximum(true.max(axis=1), 0.0)  # (k,) each
    back = _BackFromScale(scale, lowest, highest)
    low, high = (back.end(whole.value, side, half_width) for side in sides)
    squares = sides[0] ** 2 + sides[1] ** 2
    whole_square = float(squares.sum())
    return RangedFigure(
        low=low,
        high=high,
        effects={
            one: EffectEnds(
                low=back.change(whole.value, float(at_low), half_width),
                high=back.change(whole.value, float(at_high), half_width),
            )
            for one, (at_low, at_high) in zip(ends, changes, strict=True)
        },
        shares={
            one: float(square) / whole_square for one, square in zip(ends, squares, strict=True)
        }
        if whole_square
        else {},
    )


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

    def end(self, start: float, changes: np.ndarray, half_width: float) -> Estimate:
        """Return the end of a range on the side of these changes (k,) of the groups."""
        size = float(np.linalg.norm(changes))
        return self.interval(start + math.copysign(size, float(changes.sum())), half_width)

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

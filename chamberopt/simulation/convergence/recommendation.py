"""The price of accuracy: what the ladder says to set for 5 %, 1 % and 0.1 %, and what that should cost."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from chamberopt.coverage.statistics.confidence_interval import student_quantile
from chamberopt.simulation.convergence.error_law import NORMAL, front
from chamberopt.simulation.convergence.parameters import (
    DESIGNED,
    FACETS,
    REFERENCE,
    TIME,
    WARM_UP,
    shown,
)
from chamberopt.simulation.convergence.runs import Run
from chamberopt.simulation.convergence.study import ConvergenceStudy

ASKED = (0.05, 0.01, 0.001)  # half-width of the objective, absolute
SHARE = 1.0 / 3.0  # of it, that the bias of one knob may be
MOST = 100_000  # replicas that a design may ask for


@dataclass(frozen=True)
class Recommendation:
    """Settings for one accuracy.

    settings: by knob · replicas: 0 where not reachable · cpu_s, half_width: predicted CPU seconds and their 95 %
    interval · remarks: what to know of it.
    """

    accuracy: float
    settings: dict[str, Any]
    replicas: int
    cpu_s: float
    half_width: float
    remarks: tuple[str, ...]

    @property
    def lines(self) -> tuple[str, ...]:
        """To paste into a design; what is no key of [process.accuracy] as a comment."""
        if not self.replicas:
            return (
                f"# ± {self.accuracy:g}: not reachable within the ladder",
                *(f"# {text}" for text in self.remarks),
            )
        table = "process.accuracy."
        inside = [
            f"{k.removeprefix(table)} = {shown(v)}"
            for k, v in self.settings.items()
            if k.startswith(table)
        ]
        outside = ", ".join(
            f"{k} = {_toml(v)}" for k, v in self.settings.items() if not k.startswith(table)
        )
        said = f"# ± {self.accuracy:g}: {_seconds(self.cpu_s)} ± {_seconds(self.half_width)} CPU seconds predicted"
        lines = (
            said,
            f"# with {outside}",
            "[process.accuracy]",
            f"replicas = {self.replicas}",
            *inside,
        )
        return (*lines, *(f"# {text}" for text in self.remarks))


@dataclass(frozen=True)
class Choice:
    """A way to spend CPU seconds: so many replicas with one knob off the reference. error: 95 %, bias in it."""

    name: str
    cpu_s: float
    error: float


def _seconds(value: float) -> str:
    return f"{value:,.0f}" if value >= 10.0 else f"{value:.2g}"


def _toml(value: Any) -> str:
    return f'"{value}"' if isinstance(value, str) else shown(value)


@dataclass(frozen=True)
class Cost:
    """CPU seconds of a replica: fixed + pace · simulated time [s], warm-up included; each with its half-width."""

    fixed: float
    pace: float
    fixed_half_width: float
    pace_half_width: float

    def of(self, seconds: float) -> float:
        return self.fixed + self.pace * seconds


def cost(ladder: ConvergenceStudy) -> Cost:
    """A line through the rungs of warm-up and simulated time, each weighted with its own interval."""
    rungs = [
        rung
        for rung in (ladder.reference, *ladder.rungs)
        if rung.knob in (REFERENCE, TIME, WARM_UP)
    ]
    settings = [
        ladder.settings | ({} if rung is ladder.reference else {rung.knob: rung.setting})
        for rung in rungs
    ]
    x = np.array([float(one[TIME]) + float(one[WARM_UP]) for one in settings])
    y, half_width = (
        np.array(column)
        for column in zip(*((r.cpu.value, r.cpu.half_width) for r in rungs), strict=True)
    )
    error = np.maximum(half_width / NORMAL, 1e-3 * y)
    rows = np.stack([np.ones_like(x), x], axis=1) / error[:, None]
    covariance = np.linalg.inv(rows.T @ rows)
    fixed, pace = covariance @ rows.T @ (y / error)
    # A wider scatter about the line than the intervals say is in the line's interval too.
    scatter = max(1.0, float(np.sum(((y - fixed - pace * x) / error) ** 2) / (len(x) - 2)))
    wide = NORMAL * np.sqrt(scatter * np.diag(covariance))
    return Cost(max(0.0, float(fixed)), float(pace), float(wide[0]), float(wide[1]))


def replicas_for(ladder: ConvergenceStudy, accuracy: float, seconds: float) -> int:
    """Replicas of so many simulated seconds until the interval said is within this accuracy.

    Their variance goes with 1/seconds; where the ladder has sub-pools as inaccurate as that, what these said of
    themselves counts too, for in few replicas triangles are taken together.
    """
    stretch = float(ladder.settings[TIME]) / seconds
    levels = ladder.levels
    said = np.maximum.accumulate([-math.log(one.said) for one in levels])
    floor = 0.0
    if accuracy >= levels[-1].said:
        floor = math.exp(
            np.interp(-math.log(accuracy), said, [math.log(one.replicas) for one in levels])
        )
    sigma = math.sqrt(_variance(ladder.reference) * stretch)
    low, high = 3, MOST + 1
    while low < high:
        middle = (low + high) // 2
        enough = student_quantile(middle - 1) * sigma / math.sqrt(middle) <= accuracy
        low, high = (low, middle) if enough else (middle + 1, high)
    return max(low, math.ceil(round(floor * stretch, 6)))


def _variance(rung: Run) -> float:
    """Of the objective from replica to replica."""
    return float(np.var(rung.objective.pseudovalues, ddof=1))


def recommend(ladder: ConvergenceStudy, accuracy: float) -> Recommendation:
    """For each knob the cheapest setting whose bias is, at the end of its interval, within a third of the accuracy.

    A coarser setting is taken only where it saves CPU seconds by more than chance. Savings of several knobs multiply,
    times add; the simulated time is the cheapest for this accuracy.
    """
    reference = ladder.reference
    settings, saving, remarks = dict(ladder.settings), 1.0, []
    for knob in settings:
        cheaper = [rung for rung in ladder.rungs if rung.knob == knob and _saves(ladder, rung)]
        good = [rung for rung in cheaper if knob != TIME and rung.bound <= SHARE * accuracy]
        if good:
            best = min(good, key=lambda rung: rung.cpu.value)
            settings[knob] = type(ladder.settings[knob])(best.setting)
            saving *= best.cpu.value / reference.cpu.value if knob != WARM_UP else 1.0
        elif knob != TIME and any(not rung.known for rung in cheaper):
            remarks.append(
                f"{knob}: cheaper settings may do, but the ladder cannot tell; raise --budget-s"
            )
    remarks += _model_remarks(ladder, accuracy)
    times = [float(rung.setting) for rung in ladder.rungs if rung.knob == TIME] + [
        ladder.settings[TIME]
    ]
    line = cost(ladder)
    price, replicas, settings[TIME] = min(
        (count * saving * line.of(seconds + settings[WARM_UP]), count, seconds)
        for seconds in times
        for count in [replicas_for(ladder, accuracy, seconds)]
    )
    if replicas > MOST:
        remarks.append(f"more than {MOST:,} replicas would be needed, the most that are supported")
        return Recommendation(accuracy, settings, 0, math.inf, math.inf, tuple(remarks))
    # A half-width from n replicas is known to 1/sqrt(2 n) of itself, what it costs to twice that.
    unsure = math.hypot(
        NORMAL * math.sqrt(2.0 / reference.replicas), line.pace_half_width / line.pace
    )
    return Recommendation(accuracy, settings, replicas, price, price * unsure, tuple(remarks))


def _saves(ladder: ConvergenceStudy, rung: Run) -> bool:
    """Whether a rung is cheaper than the reference by more than chance."""
    return rung.cpu.high < ladder.reference.cpu.low


def _model_remarks(ladder: ConvergenceStudy, accuracy: float) -> Iterator[str]:
    """Whether rates are good enough for coverage itself. Its mean alone: the spread of single dents is another one."""
    if not ladder.dents:
        yield "dents one by one were not tried: process.accuracy.sample_mm takes too many points; raise it"
        return
    rates, *spacings = ladder.dents
    off = f"{rates.mean_bias.value:+.4f} ± {rates.mean_bias.half_width:.2g}"
    if abs(rates.mean_bias.value) + rates.mean_bias.half_width > SHARE * accuracy:
        good = [
            one
            for one in spacings
            if abs(one.mean_bias.value) + one.mean_bias.half_width <= SHARE * accuracy
        ]
        cheapest = min(good, key=lambda rung: rung.cpu.value)
        yield (
            f"rates give {off} of mean coverage against dents one by one after {ladder.dent_time:.3g} s; for what "
            f'parts come out with: coverage_model = "dents", sample_mm = {cheapest.setting.split()[-1]}, '
            f"{cheapest.cpu.value / ladder.dent_time:.2g} CPU seconds a replica and second of treatment"
        )


def choices(ladder: ConvergenceStudy) -> list[Choice]:
    """The Pareto front: sub-pools of every level, with at most one knob off the reference, where that saves time."""
    others = [
        rung
        for rung in ladder.rungs
        if rung.knob == TIME or (rung.knob != DESIGNED and _saves(ladder, rung))
    ]
    every = []
    for level in ladder.levels:
        for rung in (ladder.reference, *others):
            wide = (
                math.sqrt(ladder.settings[TIME] / float(rung.setting)) if rung.knob == TIME else 1.0
            )
            bias = (
                0.0
                if rung.knob in (REFERENCE, TIME)
                else abs(rung.bias.value)
                if rung.known
                else rung.bound
            )
            name = f"{level.replicas} replicas"
            name += "" if rung.knob == REFERENCE else f", {short(rung.knob)} {rung.setting}"
            cost = level.cpu_s * rung.cpu.value / ladder.reference.cpu.value
            every.append(Choice(name, cost, math.hypot(level.error * wide, bias)))
    return [every[i] for i in front([one.cpu_s for one in every], [one.error for one in every])]


def short(knob: str) -> str:
    """The key without its table or unit."""
    key = knob.rsplit(".", 1)[-1]
    for unit in ("_mm_s", "_ms", "_s"):
        key = key.removesuffix(unit)
    return key.replace("_", " ")


def explained(ladder: ConvergenceStudy) -> str:
    """The cost of halving the error, and why it is not 4 where it is not."""
    law, levels = ladder.law, ladder.levels
    middle, low, high = law.halving
    said = f"more replicas alone: halving the error costs {middle:.2f} times as much ({low:.2f} to {high:.2f})"
    joined = [str(one.replicas) for one in levels if one.joined]
    if low <= 4.0 <= high:
        why = "independent replicas promise 4"
    elif middle < 4.0:
        why = "less than the 4 of independent replicas"
        if len(joined) > len(levels) - 2:
            why += ": with few dents triangles are taken together, and more replicas end that"
    else:
        estimating = 1.0 - levels[-1].replicas * ladder.reference.cpu.value / levels[-1].cpu_s
        why = "more than the 4 of independent replicas: some differ much from the others, or estimating them, which "
        why += f"takes {estimating:.0%} of the largest sub-pool's time"
    if joined and len(joined) <= len(levels) - 2:
        why += f"; {', '.join(joined)} replicas, where triangles are taken together for want of dents, are left out"
    return f"{said}; {why} (error ~ cost^-{law.power:.2f} ± {law.half_width:.2f})"


def unrecorded(ladder: ConvergenceStudy) -> str:
    """What a replica costs, and how much of that is not recorded time."""
    line, accuracy = cost(ladder), ladder.design.process.accuracy
    whole = line.of(accuracy.warmup_time + accuracy.simulated_time)
    return (
        f"a replica costs {line.fixed:.3f} ± {line.fixed_half_width:.2g} CPU s and {line.pace:.3f} ± "
        f"{line.pace_half_width:.1g} for each simulated second: of one as designed {line.fixed / whole:.0%} are fixed, "
        f"{line.pace * accuracy.warmup_time / whole:.0%} go to the warm-up, however many replicas there are"
    )


def described(ladder: ConvergenceStudy) -> str:
    """What the reference is."""
    pool = ladder.reference
    finest = ", ".join(f"{short(knob)} {shown(value)}" for knob, value in ladder.settings.items())
    took = pool.replicas * pool.cpu.value
    walls = (
        f"; there is no chamber with a round wall to compare {FACETS} with, only the finest facets"
    )
    return (
        f"reference: {pool.replicas} replicas with {finest}: objective {pool.objective.value:.4f} ± "
        f"{pool.objective.half_width:.2g}, mean coverage {pool.mean.value:.4f} ± {pool.mean.half_width:.2g}, in "
        f"{took:.0f} CPU s{walls if FACETS in ladder.settings else ''}"
    )

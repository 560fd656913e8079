"""Recommend numerical settings (simulated time, replicas, ...) for an accuracy, with their cost."""

from __future__ import annotations

import math
from bisect import bisect_left
from dataclasses import dataclass
from typing import Any

import numpy as np

from chamberopt.common.estimate import shared_half_width, student_quantile
from chamberopt.simulation.convergence import ConvergenceStudy
from chamberopt.simulation.effort import points_remedy
from chamberopt.simulation.numerical_parameters import (
    GAUGE,
    POINTS,
    REFERENCE,
    TIME,
    WARM_UP,
    setting_text,
)

ACCURACIES = (0.05, 0.01, 0.001)  # half-width of the objective, absolute
BIAS_SHARE = 1.0 / 3.0  # share of the accuracy that the bias of each parameter may take
MAX_REPLICAS = 100_000  # largest number in a design
SURE = 0.9  # probability that the interval of a recommended simulation is narrow enough
TABLE = "process.accuracy."


@dataclass(frozen=True)
class Recommendation:
    """The numerical settings of a design that reach one accuracy of the objective."""

    accuracy: float
    settings: dict[str, Any]  # by numerical parameter
    replicas: int  # 0 if the accuracy is out of reach
    cpu_s: float  # predicted CPU seconds: building, simulating, all figures
    remarks: tuple[str, ...]  # sentences on what limits the recommendation

    @property
    def lines(self) -> tuple[str, ...]:
        """Lines to paste into a design file: its table [process.accuracy].

        Settings of other tables are written as comments.
        """
        remarks = tuple(f"# {text}" for text in self.remarks)
        if not self.replicas:
            return f"# ± {self.accuracy:g}: not reachable with these settings", *remarks
        seconds = f"{self.cpu_s:,.0f}" if self.cpu_s >= 10.0 else f"{self.cpu_s:.2g}"
        lines = [
            f'{name} = "{value}"' if isinstance(value, str) else f"{name} = {setting_text(value)}"
            for name, value in self.settings.items()
        ]
        return (
            f"# ± {self.accuracy:g}: about {seconds} CPU s, but for start, ranges and pictures",
            f"# with {', '.join(line for line in lines if not line.startswith(TABLE))}",
            "[process.accuracy]",
            f"replicas = {self.replicas}",
            *(line.removeprefix(TABLE) for line in lines if line.startswith(TABLE)),
            *remarks,
        )


def recommend(study: ConvergenceStudy, accuracy: float) -> Recommendation:
    """Choose for each numerical parameter the cheapest setting that is accurate enough.

    The bias of a setting, its difference from the finest settings, must be certainly within a third
    of the accuracy. A coarser setting is chosen only if its CPU time is significantly less. Savings
    of several parameters multiply. The simulated time of a replica is the time with the cheapest
    total.
    """
    settings, remarks, unsure = dict(study.settings), list[str](), list[str]()
    reference = study.reference.cpu.value
    factor, warm_up_saving = 1.0, 0.0
    for name in settings:
        if name in (TIME, GAUGE):  # another gauge is another figure, not another accuracy
            continue
        # Settings that are cheaper than the reference by more than the intervals.
        tried = [run for run in study.runs if run.parameter == name]
        cheaper = [run for run in tried if run.cpu.high < study.reference.cpu.low]
        if good := [run for run in cheaper if run.max_bias <= BIAS_SHARE * accuracy]:
            best = min(good, key=lambda run: run.cpu.value)
            settings[name] = type(study.settings[name])(best.setting)
            if name == WARM_UP:  # the same for every simulated time
                warm_up_saving = reference - best.cpu.value
            else:
                factor *= best.cpu.value / reference
        elif not all(run.is_biased for run in cheaper):
            unsure.append(name)
    if unsure:
        text = "cheaper settings may do, but their bias is not known well enough"
        remarks.append(f"{', '.join(unsure)}: {text}; raise --budget-s")
    options = []
    for run in (study.reference, *study.runs):
        if run.parameter in (REFERENCE, TIME):
            seconds = float(run.setting or study.settings[TIME])
            count = replicas_for(study, accuracy, seconds)
            each = factor * (run.cpu.value - warm_up_saving)
            each += study.cost.figures * seconds / study.design.process.recorded_time
            options.append((study.cost.fixed + count * each, count, seconds))
    cpu_s, replicas, settings[TIME] = min(options)
    if replicas > MAX_REPLICAS:
        shared = shared_half_width(study.reference.objective.shared)
        points = int(study.settings[POINTS])
        remarks.append(
            f"± {shared:.2g} comes from the choice of points: "
            f"{points_remedy(points, shared, accuracy)}"
            if shared >= accuracy
            else f"this would need more than {MAX_REPLICAS:,} replicas, the largest number"
        )
        replicas, cpu_s = 0, math.inf
    return Recommendation(accuracy, settings, replicas, cpu_s, tuple(remarks))


def replicas_for(study: ConvergenceStudy, accuracy: float, seconds: float) -> int:
    """Return how many replicas give the objective an interval within the accuracy, nearly surely.

    Each replica has `seconds` of simulated time, and a variance proportional to 1 / seconds. The
    interval comes from the scatter of so few replicas, which is too large by chance as often as too
    small. So the number is such that it is narrow enough with the probability SURE. What all
    replicas share, the choice of the points, stays. Intervals from few replicas may be wider than
    this law says. So the intervals of the study's batches of replicas, measured at several sizes,
    count as well; and the windows need their dents.
    """
    time_ratio = float(study.settings[TIME]) / seconds
    reference = study.reference
    pseudovalues = reference.objective.pseudovalues  # a batch each, if there are many replicas
    variance = np.var(pseudovalues, ddof=1) * time_ratio * reference.replicas / len(pseudovalues)
    shared = shared_half_width(reference.objective.shared)
    for_dents = max(3, math.ceil(study.resolved_s / seconds))
    needed = for_dents + bisect_left(
        range(for_dents, MAX_REPLICAS + 1),
        -accuracy,
        key=lambda n: -math.hypot(_scatter_factor(n) * math.sqrt(variance / n), shared),
    )
    sizes = study.sizes
    widths = [size.half_width * _surely(size.replicas) for size in sizes]
    if accuracy < widths[-1]:
        return needed
    negative_logs = np.maximum.accumulate([-math.log(width) for width in widths])
    logs = [math.log(size.replicas) for size in sizes]
    batch = math.exp(np.interp(-math.log(accuracy), negative_logs, logs))
    return max(needed, math.ceil(round(batch * time_ratio, 6)))


def _scatter_factor(replicas: int) -> float:
    """Return the half-width of an interval from some replicas over its standard error, with the
    probability SURE at most.
    """
    return student_quantile(replicas - 1) * _surely(replicas)


def _surely(replicas: int) -> float:
    """Return the standard deviation of some replicas, with the probability SURE at most, over that
    of all replicas.
    """
    from scipy.special import chdtri  # inverse of the upper tail of chi-square

    return math.sqrt(float(chdtri(replicas - 1, 1.0 - SURE)) / (replicas - 1))

"""Replicas whose cost is measured, and the figures from parts of them, for a convergence study."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

from chamberopt.chamber.replica_seed import replica_seed
from chamberopt.common.estimate import Estimate, estimate, paired_difference
from chamberopt.coverage.coverage_from_impacts import Prints, batches_of, footprints_again
from chamberopt.coverage.coverage_intervals import Resolution, WindowTally, find_resolution
from chamberopt.coverage.field.target_field import TargetField
from chamberopt.coverage.metrics import parse_objective
from chamberopt.simulation.estimates import least_half_width, weighted_sum
from chamberopt.simulation.replicas import ReplicaSetting, simulate_replica

ZERO = Estimate(0.0, 0.0)


@dataclass(frozen=True)
class Run:
    """The result of simulations in which one numerical parameter has one of its settings."""

    parameter: str  # dotted name of the numerical parameter that differs from the reference
    setting: str  # its value as text
    replicas: int
    cpu: Estimate  # CPU seconds of a replica
    objective: Estimate
    mean: Estimate  # mean coverage
    bias: Estimate = ZERO  # objective less the reference's
    mean_bias: Estimate = ZERO  # mean coverage less the reference's

    @property
    def is_biased(self) -> bool:
        """True if the bias, the difference from the reference, is certainly not 0."""
        return abs(self.bias.value) > self.bias.half_width

    @property
    def max_bias(self) -> float:
        """Largest absolute value that the bias may have by its interval."""
        return max(self.bias.high, -self.bias.low)


class TimedReplica(NamedTuple):
    """The dents of a replica, as their footprints in windows, and the CPU seconds that it took.

    A window is a disc of the surface in which dents are counted.
    """

    footprints: Prints
    cpu_s: float


class Figures(NamedTuple):
    """Objective and mean coverage from some replicas, and the dents that they have and need."""

    objective: Estimate
    mean: Estimate
    resolution: Resolution


@dataclass
class Replicas:
    """The replicas of one design that have been simulated so far, and their figures."""

    setting: ReplicaSetting
    target: TargetField
    skipped: int = 0  # number of first replicas without a time, because they build a search tree
    started: int = 0  # number of replicas that are simulated or under way
    done: list[TimedReplica] = field(default_factory=list)

    @property
    def length(self) -> float:
        """Simulated time of a replica [s], warm-up included, to which its cost is proportional."""
        process = self.setting.design.process
        return process.recorded_time + process.accuracy.warmup_time

    @property
    def timed(self) -> list[float]:
        """CPU seconds of the replicas that have a time."""
        return [one.cpu_s for one in self.done[self.skipped :]]

    def figures(self, parts: Sequence[range]) -> tuple[list[Figures], float]:
        """Return the figures from several parts of the replicas, and the CPU seconds of a replica.

        The dents of each replica are found in the windows once, for all parts that have it. The CPU
        seconds are those of this and of adding them to one part.
        """
        tallies: dict[range, WindowTally] = {}
        found: dict[range, Figures] = {}
        seconds = 0.0
        points = len(self.target.gauge.area)
        process = self.setting.design.process
        for number, replica in enumerate(self.done):
            begin = time.thread_time()
            pairs = tuple(replica.footprints.pairs())
            for position, part in enumerate(one for one in parts if number in one):
                if number == part[0]:
                    time_ratio = process.treatment_time / process.recorded_time
                    tallies[part] = WindowTally(len(part), points, time_ratio)
                tallies[part].add(pairs)
                if position == 0:
                    seconds += time.thread_time() - begin
                if number == part[-1]:
                    found[part] = self._figures(tallies.pop(part), part)
        return [found[part] for part in parts], seconds / max(len(self.done), 1)

    def _figures(self, tally: WindowTally, part: range) -> Figures:
        prints = [self.done[number].footprints for number in part]
        process, least = self.setting.design.process, least_half_width(self.target.reach, prints)
        mean, std = (one.at_least_as_wide(least) for one in tally.mean_and_std(self.target.reach))
        objective = weighted_sum(
            parse_objective("uniform_coverage"), {"mean_coverage": mean, "std_coverage": std}
        )
        time_ratio = process.treatment_time / process.recorded_time
        batches, gauge = batches_of(prints), self.target.gauge
        found = find_resolution(batches, tally.sums, gauge, time_ratio, process.recorded_time)
        return Figures(objective, mean, found)

    def run(
        self, key: tuple[str, str], figures: Figures, seconds: float, reference: Run | None = None
    ) -> Run:
        """Return the result of all replicas, with its difference from the result of a reference.

        Args:
            key: name of the parameter that differs from the reference, and its value.
            figures: figures of all replicas.
            seconds: CPU seconds of a replica that the figures took.
            reference: result of the reference; None if these replicas are the reference themselves.
        """
        cpu = estimate([one + seconds for one in self.timed], 0.0)
        run = Run(*key, len(self.done), cpu, figures.objective, figures.mean)
        if reference is None:
            return run
        bias = paired_difference(figures.objective, reference.objective)
        return replace(run, bias=bias, mean_bias=paired_difference(figures.mean, reference.mean))


def simulate_timed(setting: ReplicaSetting, target: TargetField, number: int) -> TimedReplica:
    """Simulate the replica with this number, and return its dents and the CPU seconds.

    Its other results are dropped, so that hundreds of replicas fit into memory.
    """
    begin = time.thread_time()
    replica = simulate_replica(setting, replica_seed(setting.design.process.seed, number))
    found = footprints_again(target, target.gauge, target.in_sector(replica.hits))
    return TimedReplica(found, time.thread_time() - begin)


def timed_figures(one: Replicas, parts: Sequence[range]) -> tuple[list[Figures], float, float]:
    """Return the figures of parts of a design's replicas, the CPU seconds of a replica, and all."""
    begin = time.thread_time()
    found, seconds = one.figures(parts)
    return found, seconds, time.thread_time() - begin

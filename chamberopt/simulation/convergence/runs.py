"""One setting of a convergence study: its replicas, what they estimate and what they cost."""

from __future__ import annotations

import time
from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field, replace

import numpy as np

from chamberopt.chamber.scene import replica_seed
from chamberopt.common.estimate import Estimate, estimate, paired_difference
from chamberopt.coverage.coverage_from_impacts import Tally
from chamberopt.coverage.coverage_intervals import coverage_estimates, target_patches
from chamberopt.coverage.dent_marking import marked_share
from chamberopt.coverage.metrics import parse_objective
from chamberopt.simulation.evaluate import marked_coverage_estimates, weighted_sum
from chamberopt.simulation.replicas import ReplicaSetting, simulate_replica


@dataclass(frozen=True)
class Run:
    """Result of one setting.

    Args:
        parameter: dotted name of the numerical parameter that differs from the reference.
        setting: its value as text.
        replicas: number of replicas.
        cpu: CPU seconds of a replica.
        objective, mean: objective and mean coverage.
        bias, mean_bias: their differences from the reference; exactly 0 for the reference.
    """

    parameter: str
    setting: str
    replicas: int
    cpu: Estimate
    objective: Estimate
    mean: Estimate
    bias: Estimate
    mean_bias: Estimate

    @property
    def is_biased(self) -> bool:
        """Whether the bias differs from 0 by more than its interval."""
        return abs(self.bias.value) > self.bias.half_width

    @property
    def max_bias(self) -> float:
        """Absolute bias at the far end of its interval."""
        return abs(self.bias.value) + self.bias.half_width

    @property
    def max_mean_bias(self) -> float:
        """Absolute bias of the mean coverage at the far end of its interval."""
        return abs(self.mean_bias.value) + self.mean_bias.half_width


@dataclass
class Replicas:
    """The replicas of one design, in their order.

    Args:
        setting: without sample points coverage is estimated from dent rates.
        skipped: first replicas whose time does not count, because they build a search tree.
        tallies, shares: dents, and marked share of each triangle, of each replica.
        cpu: CPU seconds of each replica.
    """

    setting: ReplicaSetting
    skipped: int = 1
    tallies: list[Tally] = field(default_factory=list)
    shares: list[np.ndarray] = field(default_factory=list)
    cpu: list[float] = field(default_factory=list)

    @property
    def cost(self) -> Estimate:
        """CPU seconds of a replica."""
        return estimate(self.cpu[self.skipped :], 0.0)

    def estimates(self, part: slice = slice(None)) -> tuple[Estimate, Estimate, bool]:
        """Objective, mean coverage, and whether triangles were merged for lack of dents."""
        are_merged = False
        design, chamber, _, samples = self.setting
        if samples is None:
            tallies = self.tallies[part]
            patches = target_patches(tallies, chamber, design.process.treatment_time)
            metrics = coverage_estimates(tallies, chamber, patches)
            are_merged = patches.are_merged
        else:
            metrics = marked_coverage_estimates(self.shares[part], chamber)
        objective = weighted_sum(parse_objective("uniform_coverage"), metrics)
        return objective, metrics["mean_coverage"], are_merged

    def run(self, parameter: str, setting: str, reference: Replicas) -> Run:
        """The result of these replicas, compared with the reference's."""
        objective, mean, _ = self.estimates()
        bias = mean_bias = Estimate(0.0, 0.0)
        if self is not reference:
            reference_objective, reference_mean, _ = reference.estimates()
            bias = paired_difference(objective, reference_objective)
            mean_bias = paired_difference(mean, reference_mean)
        count = len(self.tallies)
        return Run(parameter, setting, count, self.cost, objective, mean, bias, mean_bias)


def add_replicas(designs: Sequence[Replicas], executor: Executor) -> float:
    """Simulate one more replica of each; of a design that is listed twice, two.

    Returns:
        CPU seconds.
    """
    futures = []
    for one in designs:
        number = len(one.cpu)
        one.cpu.append(0.0)
        futures.append((one, number, executor.submit(simulate_timed, one.setting, number)))
    spent = 0.0
    try:
        for one, number, future in futures:
            tally, share, one.cpu[number] = future.result()
            one.tallies.append(tally)
            if share is not None:
                one.shares.append(share)
            spent += one.cpu[number]
    finally:
        for _, _, future in futures:
            future.cancel()
    return spent


def simulate_timed(setting: ReplicaSetting, number: int) -> tuple[Tally, np.ndarray | None, float]:
    """Dents of one replica, marked share of each triangle, and CPU seconds of this thread."""
    begin = time.thread_time()
    process, samples = setting.design.process, setting.samples
    replica = simulate_replica(setting, replica_seed(process.seed, number))
    share = None
    if samples is not None and replica.first_marked is not None:
        triangles = len(setting.chamber.part.triangles)
        share = marked_share(samples, replica.first_marked, process.treatment_time, triangles)
    return _dents_only(replica.tally), share, time.thread_time() - begin


def _dents_only(tally: Tally) -> Tally:
    """The part of a tally that coverage needs, because hundreds of replicas are kept."""
    empty = np.zeros(0)
    return replace(
        tally, impacts=empty, dents=empty, dented_area=empty, speed_sum=empty, angle_sum=empty
    )

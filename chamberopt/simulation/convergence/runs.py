"""A setting of the ladder, simulated: its replicas, what they say, and what each cost."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from chamberopt.coverage.coverage_estimators import coverage_estimates, target_patches
from chamberopt.coverage.coverage_from_impacts import Tally
from chamberopt.coverage.metrics import parse_objective
from chamberopt.coverage.statistics.confidence_interval import Estimate, estimate, paired_difference
from chamberopt.design.design import Design
from chamberopt.simulation.evaluate import weighted_sum

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from sim_core import TriangleMesh


@dataclass(frozen=True)
class Run:
    """One setting, simulated. cpu: CPU seconds a replica · bias, mean_bias: objective and mean coverage, less those of
    the knob's finest setting; exactly 0 for that one.
    """

    knob: str
    setting: str
    replicas: int
    cpu: Estimate
    objective: Estimate
    mean: Estimate
    bias: Estimate
    mean_bias: Estimate

    @property
    def known(self) -> bool:
        """Whether the bias is told apart from none."""
        return abs(self.bias.value) > self.bias.half_width

    @property
    def bound(self) -> float:
        """The bias with its interval: it is hardly larger."""
        return abs(self.bias.value) + self.bias.half_width


class Pool:
    """Replicas of one design, added in their order: what they left, and CPU seconds of each."""

    def __init__(self, design: Design, chamber: Chamber, mesh: TriangleMesh) -> None:
        self.design, self.chamber, self.mesh = design, chamber, mesh
        self.tallies: list[Tally] = []
        self.cpu: list[float] = []

    @property
    def cost(self) -> Estimate:
        """CPU seconds a replica; the first, which builds the mesh's search tree, left out."""
        return estimate(self.cpu[1:], 0.0)

    def figures(self, part: slice = slice(None)) -> tuple[Estimate, Estimate, bool]:
        """Objective, mean coverage, and whether triangles were taken together."""
        return figures(self.tallies[part], self.chamber, self.design)

    def rung(self, knob: str, setting: str, reference: Pool) -> Run:
        goal, mean, _ = self.figures()
        base, base_mean, _ = reference.figures()
        bias, mean_bias = paired_difference(goal, base), paired_difference(mean, base_mean)
        return Run(knob, setting, len(self.tallies), self.cost, goal, mean, bias, mean_bias)


def figures(
    tallies: Sequence[Tally], chamber: Chamber, design: Design
) -> tuple[Estimate, Estimate, bool]:
    """Objective and mean coverage, as evaluate() has them, and whether triangles were taken together."""
    ground = target_patches(tallies, chamber, design.process.treatment_time)
    found = coverage_estimates(tallies, chamber, ground)
    return (
        weighted_sum(parse_objective("uniform_coverage"), found),
        found["mean_coverage"],
        ground.are_merged,
    )


def dents_alone(whole: Tally) -> Tally:
    """All that the figures of coverage need: hundreds of replicas are held at once."""
    none = np.zeros(0)
    return Tally(
        whole.simulated_time, none, none, none, none, none, whole.dent_triangle, whole.dent_area
    )

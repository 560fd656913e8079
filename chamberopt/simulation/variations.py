"""Evaluate a design and changed designs in equally many replicas with the same seeds.

The slope of a figure by a number of the design is the difference of two simulations over the step
of this number. A chamber is chaotic, so that two simulations with equal seeds correlate little. The
noise of the slope is proportional to 1 / step. Curvature makes the slope wrong by a share that
grows with the step (benchmarks/response_steps.py measures both).
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from chamberopt.chamber.analytic import analytic_cavity
from chamberopt.simulation.evaluate import ReplicaPlan, evaluate
from chamberopt.simulation.replicas import Replica, ReplicaSet

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from chamberopt.common.progress import Progress
    from chamberopt.coverage.field.target_field import TargetField
    from chamberopt.design.load import Design
    from chamberopt.simulation.evaluation import Evaluation
    from sim_core import AnalyticCavity


@dataclass
class RunsProgress:
    """Progress of several runs with equally many replicas, reported as a single run."""

    progress: Progress | None
    runs: int
    ended: int = 0  # number of runs before the present run

    def __call__(self, done: float, total: int, best: float | None) -> None:
        """Report the number of replicas done in the present run and all runs before it."""
        if self.progress:
            runs = max(self.runs, self.ended + 1)
            self.progress(self.ended * total + done, runs * total, best)


@dataclass
class Variations:
    """Simulations of a design and of changed designs, with as many replicas and the same seeds.

    The design itself is evaluated at once; `nominal` is its evaluation.
    """

    design: Design
    chamber: Chamber
    executor: Executor
    progress: RunsProgress
    plan: ReplicaPlan | None = None
    cavity: AnalyticCavity | None = None  # exact cavity in the place of the chamber's mesh
    known: ReplicaSet = field(default_factory=ReplicaSet)  # replicas of the design itself

    def __post_init__(self) -> None:
        how = self.executor, self.progress, self.plan, self.cavity, self.known
        self.nominal = evaluate(self.design, self.chamber, *how)

    def run(
        self,
        design: Design,
        chamber: Chamber | None = None,
        replicas: Sequence[Replica] = (),
        target: TargetField | None = None,
    ) -> Evaluation:
        """Evaluate a changed design.

        Raises InputError or an error of sim_core if it cannot be simulated.

        Args:
            chamber: the chamber of the changed design; None if it is the chamber of the design
                itself.
            replicas: replicas of the changed design that are known already, without a simulation.
            target: the target of the changed design with its windows, if it is prepared already.
        """
        self.progress.ended += not replicas
        nominal, known = self.nominal, ReplicaSet(list(replicas), target)
        plan = replace(self.plan or ReplicaPlan(), count=nominal.replicas)
        cavity = analytic_cavity(design, chamber) if self.cavity and chamber else self.cavity
        how = self.executor, self.progress, plan, cavity, known
        return evaluate(design, chamber or self.chamber, *how)

"""A design and changed ones, evaluated in the same replicas on the same seeds.

A chamber is chaotic, so that two runs on equal seeds correlate little. The noise of the slope
between them falls as one over the step, and curvature makes the slope wrong by a share that grows
with the step (benchmarks/response_steps.py measures both).
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from typing import TYPE_CHECKING

from chamberopt.chamber.analytic import analytic_cavity
from chamberopt.simulation.evaluate import ReplicaPlan, evaluate
from chamberopt.simulation.replicas import Replica, ReplicaSet

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from chamberopt.common.progress import Progress
    from chamberopt.design.load import Design
    from chamberopt.simulation.evaluation import Evaluation


class RunsProgress:
    """One progress over several runs; each is expected to take as many replicas as the present."""

    def __init__(self, progress: Progress | None, to_come: int) -> None:
        """Begin the first of the runs, after which others are to come."""
        self._progress, self._to_come, self._before, self._done = progress, to_come, 0, 0

    def begin_next(self) -> None:
        """Begin the next run."""
        self._before, self._done = self._before + self._done, 0
        self._to_come = max(0, self._to_come - 1)

    def __call__(self, done: int, total: int, best: float | None) -> None:
        """Tell how many replicas of the present run are done."""
        self._done = done
        if self._progress:
            self._progress(self._before + done, self._before + total * (1 + self._to_come), best)


class Variations:
    """The runs of a design, and of changed ones in the same replicas on the same seeds.

    Attributes:
        design, chamber: the nominal ones.
        nominal: the evaluation of the nominal design.
        replicas: of the nominal design.
    """

    def __init__(
        self,
        design: Design,
        chamber: Chamber,
        executor: Executor,
        progress: RunsProgress,
        plan: ReplicaPlan | None = None,
        analytic: bool = False,
        known: ReplicaSet | None = None,
    ) -> None:
        """Evaluate the nominal design.

        Args:
            progress: of all runs.
            analytic: simulate in exact cavities instead of meshes.
            known: as `evaluate` takes it, for the nominal design.
        """
        self.design, self.chamber = design, chamber
        self._executor, self._progress, self._analytic = executor, progress, analytic
        known = known or ReplicaSet()
        self.nominal = self._evaluate(design, chamber, plan, known)
        self.replicas = known.replicas

    def run(
        self, design: Design, chamber: Chamber | None = None, replicas: Sequence[Replica] = ()
    ) -> Evaluation:
        """Evaluate a changed design. InputError or an error of sim_core if it cannot be simulated.

        Args:
            chamber: of the changed design, if it is not the nominal one.
            replicas: of the changed design, if they follow from the nominal ones.
        """
        nominal, known = self.nominal, ReplicaSet(list(replicas))
        if not replicas:
            self._progress.begin_next()
        plan = ReplicaPlan(nominal.replicas, nominal.stream, nominal.objective_name)
        return self._evaluate(design, chamber or self.chamber, plan, known)

    def _evaluate(
        self, design: Design, chamber: Chamber, plan: ReplicaPlan | None, known: ReplicaSet
    ) -> Evaluation:
        cavity = analytic_cavity(design, chamber) if self._analytic else None
        return evaluate(design, chamber, self._executor, self._progress, plan, cavity, known)

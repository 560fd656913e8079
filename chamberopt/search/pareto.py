"""Find the Pareto front of a study with two objectives, by confirmed and by searched figures."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from chamberopt.common.files import csv_text
from chamberopt.search.study.constraints import FEASIBLE, INFEASIBLE

if TYPE_CHECKING:
    from chamberopt.common.estimate import Estimate
    from chamberopt.search.run_study import StudyResult


@dataclass(frozen=True)
class ParetoPoint:
    """A candidate of a study with two objectives, and whether it is on the Pareto front."""

    stage: str  # "search" or "confirm"
    parameters: dict[str, float | str]
    goals: tuple[Estimate, ...]
    feasibility: str
    # No other candidate of its stage is better in one objective and as good in the other.
    on_front: bool


def on_front(values: np.ndarray, among: np.ndarray | None = None) -> np.ndarray:
    """Return which candidates are on the Pareto front, shape (n,) bool.

    No other candidate beats them in an objective while it is at least equal in all others.

    Args:
        values: objectives, shape (n, k), to be maximised.
        among: candidates that count, shape (n,) bool; by default all. Other candidates are never on
            the front.
    """
    counts = np.ones(len(values), dtype=bool) if among is None else among
    as_good = (values[:, None] >= values[None]).all(axis=2)
    better = (values[:, None] > values[None]).any(axis=2)
    beaten = ((as_good & better) & counts[:, None]).any(axis=0)
    return counts & ~beaten


def pareto_points(result: StudyResult) -> list[ParetoPoint]:
    """Return the confirmed candidates of a study, then those of its search, with their objectives.

    The start, the unchanged design, comes first in both groups.
    """
    stages = {
        "confirm": [(one.parameters, one.goals, one.feasibility) for one in result.confirmed],
        "search": [
            (trial.parameters, trial.goals, FEASIBLE if trial.feasible else INFEASIBLE)
            for trial in result.trials
            if trial.stage == "search" and trial.goals
        ],
    }
    points = []
    for stage, rows in stages.items():
        values = np.array([[goal.value for goal in goals] for _, goals, _ in rows])
        values = values.reshape(-1, len(result.study.objective.goals))
        feasible = np.array([feasibility != INFEASIBLE for *_, feasibility in rows], dtype=bool)
        front = zip(rows, on_front(values, feasible).tolist(), strict=True)
        points += [ParetoPoint(stage, *row, there) for row, there in front]
    return points


def as_csv(result: StudyResult) -> str:
    """Return the confirmed and searched candidates of a study as CSV text.

    The column NAME_pm has the half-width of the objective NAME.
    """
    lines = []
    for one in pareto_points(result):
        line = {"stage": one.stage, "on_front": one.on_front, "standing": one.feasibility}
        for name, goal in zip(result.study.objective.goals, one.goals, strict=True):
            shown = (goal.in_words, "") if goal.in_words else (goal.value, goal.half_width)
            line |= dict(zip((name, f"{name}_pm"), shown, strict=True))
        lines.append({**line, **one.parameters})
    return csv_text(lines)

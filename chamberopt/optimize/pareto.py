"""The Pareto front of a study with two objectives: what was confirmed of it, and what the search saw."""

from __future__ import annotations

import csv
import io
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from chamberopt.optimize.constraints import INFEASIBLE

if TYPE_CHECKING:
    from chamberopt.coverage.statistics.confidence_interval import Estimate
    from chamberopt.optimize.run_study import StudyResult


@dataclass(frozen=True)
class ParetoPoint:
    """One candidate in the plane of the two objectives.

    stage: "search" or "confirm" · standing: of the constraints · on_front: no other of its stage beats it in both.
    """

    stage: str
    parameters: dict[str, float]
    goals: tuple[Estimate, ...]
    feasibility: str
    on_front: bool


def on_front(values: np.ndarray, among: np.ndarray | None = None) -> np.ndarray:
    """Which candidates (n,) bool no other is at least as good as in all of their values (n, k) and better in one.

    among (n,) bool: who counts at all; the others are not on the front.
    """
    counts = np.ones(len(values), dtype=bool) if among is None else among
    as_good = (values[:, None] >= values[None]).all(axis=2)
    better = (values[:, None] > values[None]).any(axis=2)
    beaten = ((as_good & better) & counts[:, None]).any(axis=0)
    return counts & ~beaten


def pareto_points(result: StudyResult) -> list[ParetoPoint]:
    """The candidates as confirmed, then those of the search; the start is the first of each."""
    names = result.study.objective.goals
    searched = [trial for trial in result.trials if trial.stage == "search" and trial.goals]
    stages = {
        "confirm": [(one.parameters, one.goals, one.feasibility) for one in result.confirmed],
        "search": [
            (trial.parameters, trial.goals, "feasible" if trial.feasible else INFEASIBLE)
            for trial in searched
        ],
    }
    made = []
    for stage, rows in stages.items():
        values = np.array([[goal.value for goal in goals] for _, goals, _ in rows]).reshape(
            -1, len(names)
        )
        front = on_front(
            values, np.array([standing != INFEASIBLE for *_, standing in rows], dtype=bool)
        )
        made += [
            ParetoPoint(stage, *row, bool(there)) for row, there in zip(rows, front, strict=True)
        ]
    return made


def as_csv(result: StudyResult) -> str:
    """The points as a table: NAME and NAME_pm, value and half-width, for each of the two objectives."""
    text, names = io.StringIO(), result.study.objective.goals
    goals = [column for name in names for column in (name, f"{name}_pm")]
    table = csv.writer(text, lineterminator="\n")
    table.writerow(["stage", "on_front", "standing", *goals, *result.study.vary])
    for one in pareto_points(result):
        figures = [number for goal in one.goals for number in (goal.value, goal.half_width)]
        table.writerow(
            [one.stage, one.on_front, one.feasibility, *figures, *one.parameters.values()]
        )
    return text.getvalue()


def as_json(result: StudyResult) -> list[dict[str, Any]]:
    """The confirmed front, from the best by the first objective to the best by the second."""
    front = [one for one in pareto_points(result) if one.on_front and one.stage == "confirm"]
    return [
        {
            "parameters": one.parameters,
            "standing": one.feasibility,
            "objectives": {
                name: {"value": goal.value, "half_width": goal.half_width}
                for name, goal in zip(result.study.objective.goals, one.goals, strict=True)
            },
        }
        for one in sorted(front, key=lambda one: -one.goals[0].value)
    ]

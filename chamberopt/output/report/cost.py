"""How well the figures are known, and what that cost: rows of (what, how much) for the page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from chamberopt.output.report.formatting import estimated, plain
from chamberopt.output.report.words import goal_words, metric_words

if TYPE_CHECKING:
    from chamberopt.output.results.load import Result

DOING = {
    "chamber": "to build the chamber",
    "simulate": "to simulate",
    "coverage": "to work out the coverage",
}
STOPPED = {
    "replicas": "the number of replicas asked for",
    "accuracy": "the accuracy asked for was reached",
    "max_replicas": "the most replicas allowed: the accuracy asked for was not reached",
}


def accuracy_reached(result: Result, study: Mapping[str, Any] | None) -> dict[str, str]:
    """The intervals of the answer, and the replicas behind them."""
    goal, cover = goal_words(result.objective_name), metric_words("mean_coverage")
    found = {
        f"95 % interval of the {goal.label}": estimated(result.objective, goal.factor, goal.unit),
        f"95 % interval of the {cover.label}": estimated(
            result.metrics["mean_coverage"], cover.factor, cover.unit
        ),
        "replicas, each of its own seed": f"{result.data['replicas']}",
    }
    why = result.data.get("stopped_by", "")
    found["replicas ended with"] = STOPPED.get(why, why)
    if study and "accuracy" in study:
        search = study["accuracy"]["search"]
        found["a candidate of the search"] = (
            f"± {search['coverage']:g} asked for"
            if "coverage" in search
            else f"up to {search['replicas']} replicas"
        ) + (f" of {plain(search['simulated_time_s'])} s" if "simulated_time_s" in search else "")
    found["chamber's walls"] = (
        "exact planes and cylinders" if result.data.get("analytic") else "triangles"
    )
    return {name: value for name, value in found.items() if value}


def price_paid(
    result: Result, study: Mapping[str, Any] | None, rows: Sequence[Mapping[str, Any]]
) -> dict[str, dict[str, str]]:
    """ "answer": simulated time, collisions, wall clock of its figures; and, of a study, those of all "evaluations"."""
    data = result.data
    hits = {
        "walls": "of walls and part",
        "balls": "of ball with ball",
        "sonotrode": "of the sonotrode",
    }
    told = [
        f"{_count(data['collisions'][name])} {what}"
        for name, what in hits.items()
        if name in data["collisions"]
    ]
    found = {
        "simulated time": f"{plain(data['simulated_time_s'])} s",
        "collisions": f"{_count(data['collisions'].get('total', 0))}: {', '.join(told)}",
        **{
            DOING.get(step, step): f"{seconds:.2f} s" for step, seconds in data["timings_s"].items()
        },
    }
    if not study:
        return {"answer": found}
    confirmed = sum(row["stage"] == "confirm" for row in rows)
    whole = {
        "in the search": _count(study["evaluations"]),
        "of these failed": _count(study.get("failed", 0)),
        "of these miss a constraint": _count(study.get("missing_a_constraint", 0)),
        "confirmations": _count(confirmed),
        "wall clock of all": f"{plain(study['seconds'], 3)} s",
    }
    return {"answer": found, "evaluations": whole}


def _count(number: float) -> str:
    return plain(float(number), 12)

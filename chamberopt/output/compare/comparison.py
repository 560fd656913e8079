"""Results side by side: what differs in the designs, and what that did to the part."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from chamberopt.coverage.metrics import NEVER, parse_objective
from chamberopt.coverage.statistics.confidence_interval import Estimate
from chamberopt.output.compare.difference import Difference, confidence_of_each, difference
from chamberopt.output.compare.inputs import require_one_time, require_same_part, require_several
from chamberopt.output.compare.parameters import differing, labels
from chamberopt.output.results.load import Result, load_result

TIME = "time_to_98_s"


@dataclass(frozen=True)
class Comparison:
    """Two or more results of the same part.

    parameters: the dotted design values that differ, one per result · metrics: the objective, then every
    metric, one Estimate per result · differences: each later result minus the first · confidence: of the interval of
    each difference, so that those of one figure hold all together with 95 %.
    """

    results: tuple[Result, ...]
    labels: tuple[str, ...]
    parameters: dict[str, tuple[Any, ...]]
    metrics: dict[str, tuple[Estimate, ...]]
    differences: dict[str, tuple[Difference, ...]]
    confidence: float

    def as_json(self) -> dict[str, Any]:
        """The comparison as plain JSON values."""
        return {
            "results": [str(result.folder) for result in self.results],
            "labels": list(self.labels),
            "parameters": {name: list(values) for name, values in self.parameters.items()},
            "metrics": {
                name: [{"value": e.value, "half_width": e.half_width} for e in values]
                for name, values in self.metrics.items()
            },
            "confidence_of_each_difference": self.confidence,
            "differences_to_first": {
                name: [gap.as_json() for gap in gaps] for name, gaps in self.differences.items()
            },
            "coverage_against_time": [
                result.data.get("coverage_against_time", []) for result in self.results
            ],
        }


def compare(paths: Sequence[str | Path]) -> Comparison:
    """Compare results folders of the same part and target; the first is what the others are measured against.

    Raises InputError for fewer than two, for one given twice, for folders that are no results, and for different parts,
    targets or treatment times.
    """
    folders = [Path(path) for path in paths]
    require_several(folders)
    return comparison_of([load_result(folder) for folder in folders], labels(folders))


def comparison_of(results: Sequence[Result], names: Sequence[str]) -> Comparison:
    """The comparison of results that were read, under these names. Raises InputError as `compare` does.

    Where two were run on the same seeds their replicas are compared pair by pair, else as independent (Welch).
    """
    first, places, designs = (
        results[0],
        [result.folder for result in results],
        [result.design for result in results],
    )
    require_same_part(
        places, designs, [(result.part_sha256, part_unit(result)) for result in results]
    )
    require_one_time(places, designs)
    same_goal = all(result.objective_name == first.objective_name for result in results)
    metrics = (
        {first.objective_name: tuple(result.objective for result in results)} if same_goal else {}
    )
    shared = [name for name in first.metrics if all(name in result.metrics for result in results)]
    metrics |= {name: tuple(result.metrics[name] for result in results) for name in shared}
    confidence = confidence_of_each(len(results) - 1)
    return Comparison(
        results=tuple(results),
        labels=tuple(names),
        parameters=differing(results),
        metrics=metrics,
        differences={
            name: tuple(_difference(name, first, other, confidence) for other in results[1:])
            for name in metrics
        },
        confidence=confidence,
    )


def part_unit(result: Result) -> str:
    """The unit that the numbers of its part's file were taken in."""
    return str(result.data.get("part_unit") or result.design.part.unit)


def _difference(name: str, first: Result, other: Result, confidence: float) -> Difference:
    of_goal = name == first.objective_name
    after, before = (one.objective if of_goal else one.metrics[name] for one in (other, first))
    gap = difference(after, before, other.seeds == first.seeds, confidence)
    terms = parse_objective(name).terms if of_goal else {name: 1.0}
    if TIME in terms and any(
        one.metrics[TIME].value >= NEVER for one in (first, other) if TIME in one.metrics
    ):
        return replace(
            gap, half_width=NEVER, times=None, replicas=None
        )  # "never" has no replicas that scatter
    return gap

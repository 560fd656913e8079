"""Results side by side: what differs in the designs, and what that did to the part."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from chamberopt.disk import new_folder, write_text
from chamberopt.errors import InputError
from chamberopt.estimate import Estimate, independent_difference, paired_difference
from chamberopt.results import Result, load_result, summary


@dataclass(frozen=True)
class Comparison:
    """Two or more results of the same part.

    parameters: the dotted design values that differ, one per result · metrics: the objective, then every
    metric, one Estimate per result · differences: each later result minus the first, with 95 % intervals.
    """

    results: tuple[Result, ...]
    labels: tuple[str, ...]
    parameters: dict[str, tuple[Any, ...]]
    metrics: dict[str, tuple[Estimate, ...]]
    differences: dict[str, tuple[Estimate, ...]]

    def as_json(self) -> dict[str, Any]:
        """The comparison as plain JSON values."""

        def plain(estimates: Sequence[Estimate]) -> list[dict[str, float]]:
            return [{"value": e.value, "half_width": e.half_width} for e in estimates]

        return {
            "results": [str(result.folder) for result in self.results],
            "labels": list(self.labels),
            "parameters": {name: list(values) for name, values in self.parameters.items()},
            "metrics": {name: plain(values) for name, values in self.metrics.items()},
            "differences_to_first": {name: plain(values) for name, values in self.differences.items()},
        }

    def as_text(self) -> str:
        """The comparison as a table; * marks a difference larger than its 95 % interval."""
        header = ["", *self.labels, *(f"{label} - {self.labels[0]}" for label in self.labels[1:])]
        rows = [[name, *(_shown(value) for value in values)] for name, values in self.parameters.items()]
        for name, values in self.metrics.items():
            cells = [f"{e.value:.4g} ± {e.half_width:.2g}" if e.half_width else f"{e.value:.4g}" for e in values]
            for gap in self.differences[name]:
                mark = " *" if abs(gap.value) > gap.half_width else ""
                interval = f" ± {gap.half_width:.2g}" if gap.half_width else ""
                cells.append(f"{gap.value:+.4g}{interval}{mark}")
            rows.append([name, *cells])
        if not self.parameters:
            rows.insert(0, ["the designs do not differ"])
        rows = [row + [""] * (len(header) - len(row)) for row in rows]
        widths = [max(len(row[i]) for row in [header, *rows]) for i in range(len(header))]
        lines = ["  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
                 for row in [header, *rows]]  # fmt: skip
        return "\n".join([*lines, "(± 95 % interval; * a difference larger than its interval)"])


def compare(paths: Sequence[str | Path]) -> Comparison:
    """Compare results folders of the same part and target; the first is what the others are measured against.

    Where two were run on the same seeds their replicas are compared pair by pair, else as independent
    (Welch). Raises InputError for fewer than two, for folders that are no results, and for different parts or
    targets.
    """
    if len(paths) < 2:
        raise InputError(f"compare: {len(paths)} result given; give two or more results folders")
    results = tuple(load_result(path) for path in paths)
    first = results[0]
    for other in results[1:]:
        _require_same_part(first, other)
    designs = [
        {**_flat(result.design.model_dump(mode="json", exclude={"part": {"mesh"}})), **_beside(result)}
        for result in results
    ]
    names = dict.fromkeys(name for design in designs for name in design)
    parameters = {name: tuple(design.get(name) for design in designs) for name in names}
    same_goal = all(result.objective_name == first.objective_name for result in results)
    metrics = {first.objective_name: tuple(result.objective for result in results)} if same_goal else {}
    shared = [name for name in first.metrics if all(name in result.metrics for result in results)]
    metrics |= {name: tuple(result.metrics[name] for result in results) for name in shared}
    return Comparison(
        results=results,
        labels=_labels([result.folder for result in results]),
        parameters={name: values for name, values in parameters.items() if len(set(map(str, values))) > 1},
        metrics=metrics,
        differences={
            name: tuple(
                _difference(other, first, after, values[0])
                for other, after in zip(results[1:], values[1:], strict=True)
            )
            for name, values in metrics.items()
        },
    )


def _beside(result: Result) -> dict[str, Any]:
    """What its design does not say: the content of a shape's own file, and whether the cavity had facets."""
    return {
        "shape_sha256": result.data.get("shape_sha256", "")[:12],
        "analytic": bool(result.data.get("analytic", False)),
    }


def write_comparison(folder: str | Path, comparison: Comparison) -> list[str]:
    """Leave compare.json, .txt and .png in a new or empty folder; returns remarks on the picture."""
    folder = new_folder(folder)
    write_text(folder / "compare.json", json.dumps(comparison.as_json(), indent=2, allow_nan=False) + "\n")
    write_text(folder / "compare.txt", comparison.as_text() + "\n")
    trouble = comparison_picture(folder / "compare.png", comparison)
    return [trouble] if trouble else []


def comparison_picture(picture: str | Path, comparison: Comparison) -> str | None:
    """The parts side by side on one colour scale, as .png; returns None or one line why there is none."""
    from chamberopt.viewer import coverage_picture

    titles = [
        f"{label}\n{summary(result)}" for label, result in zip(comparison.labels, comparison.results, strict=True)
    ]
    return coverage_picture([result.folder for result in comparison.results], titles, picture)


def _difference(other: Result, first: Result, after: Estimate, before: Estimate) -> Estimate:
    paired = other.seeds == first.seeds and len(after.pseudovalues) == len(before.pseudovalues)
    return paired_difference(after, before) if paired else independent_difference(after, before)


def _require_same_part(first: Result, other: Result) -> None:
    if first.part_sha256 != other.part_sha256:
        raise InputError(
            f"{other.folder}: another part ({other.design.part.mesh_path.name}) than in {first.folder} "
            f"({first.design.part.mesh_path.name}); only results of the same part mesh can be compared"
        )
    for name in ("unit", "target"):
        mine, theirs = getattr(first.design.part, name), getattr(other.design.part, name)
        if mine != theirs:
            raise InputError(
                f"{other.folder}: part.{name} differs from {first.folder} ({theirs} and {mine}): the figures "
                "would be of different surfaces; simulate both with the same"
            )


def _flat(table: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    flat: dict[str, Any] = {}
    for name, value in table.items():
        if isinstance(value, list | tuple) and any(isinstance(one, Mapping) for one in value):
            value = {str(place): one for place, one in enumerate(value)}
        if isinstance(value, Mapping):
            flat |= _flat(value, f"{prefix}{name}.")
        else:
            flat[prefix + name] = value
    return flat


def _labels(folders: Sequence[Path]) -> tuple[str, ...]:
    """The folders' names, with as much of the path before them as tells them apart."""
    resolved = [folder.resolve() for folder in folders]
    for depth in range(1, max(len(path.parts) for path in resolved) + 1):
        labels = tuple("/".join(path.parts[-depth:]) for path in resolved)
        if len(set(labels)) == len(labels):
            return labels
    return tuple(f"{path.name} ({i})" for i, path in enumerate(resolved, start=1))


def _shown(value: Any) -> str:
    return "-" if value is None else f"{value:g}" if isinstance(value, float) else str(value)

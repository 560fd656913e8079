"""Compare results: values in which their designs differ, and differences of their figures.

Figures are the objective and the metrics of a result, such as mean coverage.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.common.estimate import Estimate
from chamberopt.common.notebook import ShownInNotebook
from chamberopt.coverage.metrics import parse_objective
from chamberopt.coverage.stress_knowledge import stress_bands
from chamberopt.coverage.stress_model import measured_law
from chamberopt.design.shapes.base import is_custom
from chamberopt.results.compare.difference import Difference, confidence_of_each, difference
from chamberopt.results.load import Result, load_result

if TYPE_CHECKING:
    from collections.abc import Sequence

    from chamberopt.design.design import Design

# Checks whether candidates can be compared: the same surface, peened for the same time.


def require_several(paths: Sequence[Path]) -> None:
    """Raise InputError for fewer than two candidates, or for a candidate given twice."""
    if len(paths) < 2:
        raise InputError(
            f"compare: {len(paths)} candidate given; give two or more designs (.toml) or "
            "results folders"
        )
    seen: dict[Path, Path] = {}
    for path in paths:
        place = path.resolve()
        if place in seen:
            raise InputError(f"{path}: given twice (as {seen[place]}); leave one out")
        seen[place] = path


def require_same_time(paths: Sequence[Path], designs: Sequence[Design]) -> None:
    """Raise InputError if candidates were peened for different treatment times."""
    first = designs[0].process.treatment_time_s
    for path, design in zip(paths, designs, strict=True):
        seconds = design.process.treatment_time_s
        if seconds != first:
            raise InputError(
                f"{path}: peened for {seconds:g} s, {paths[0]} for {first:g} s: coverage after "
                "different times cannot be compared; give --treatment-time-s S to simulate the "
                "others again for S seconds"
            )


def require_same_gauge(paths: Sequence[Path], designs: Sequence[Design]) -> None:
    """Raise InputError if designs have different areas of the windows.

    Windows are the discs of the surface in which dents are counted for coverage.
    """
    first = designs[0].process.accuracy.gauge_mm2
    for path, design in zip(paths, designs, strict=True):
        gauge = design.process.accuracy.gauge_mm2
        if gauge != first:
            raise InputError(
                f"{path}: process.accuracy.gauge_mm2 is {gauge:g}, in {paths[0]} {first:g}: "
                "figures of windows of different areas cannot be compared; simulate both with one"
            )


def require_same_machine(paths: Sequence[Path], designs: Sequence[Design]) -> None:
    """Raise InputError if designs have calibrations of different machines.

    Errors of a calibration cancel in a difference only if both designs share the calibration.
    """
    calibrated = [pair for pair in zip(paths, designs, strict=True) if pair[1].calibration]
    for path, design in calibrated[1:]:
        if design.calibration != calibrated[0][1].calibration:
            raise InputError(
                f"{path}: another calibration than in {calibrated[0][0]}: what two calibrations "
                "leave open cannot be subtracted; simulate both designs with one"
            )


def require_same_part(
    paths: Sequence[Path], designs: Sequence[Design], meshes: Sequence[tuple[str, str]]
) -> None:
    """Raise InputError if a candidate has another part file, unit or target than the first.

    The part may stand in the chamber in different poses.

    Args:
        paths: paths of the candidates.
        designs: designs of the candidates.
        meshes: sha256 and unit of the part's file, for each candidate.
    """
    for path, design, mesh in zip(paths[1:], designs[1:], meshes[1:], strict=True):
        if mesh[0] != meshes[0][0]:
            raise InputError(
                f"{path}: another part ({design.part.mesh_path.name}) than in {paths[0]} "
                f"({designs[0].part.mesh_path.name}); give candidates for the same part mesh"
            )
        pairs = {
            "unit": (meshes[0][1], mesh[1]),
            "target": (designs[0].part.target, design.part.target),
        }
        ours, others = ({one.name: one.target for one in x.zones} for x in (designs[0], design))
        pairs |= {f"zone {k}": (ours[k], others[k]) for k in ours.keys() & others.keys()}
        for name, (mine, theirs) in pairs.items():
            if mine != theirs:
                raise InputError(
                    f"{path}: part.{name} differs from {paths[0]} ({theirs} and {mine}), so the "
                    "figures are of different surfaces; simulate both with the same one"
                )


def require_same_triangles(path: Path, target: np.ndarray, first: Path, wanted: np.ndarray) -> None:
    """Raise InputError if two targets, shape (m,) bool, are not the same triangles.

    This can happen with part.target.reachable, which depends on the chamber.
    """
    if len(target) != len(wanted) or (target != wanted).any():
        raise InputError(
            f"{path}: its target of {target.sum()} triangles is not that of {first}, of "
            f"{wanted.sum()} triangles (part.target.reachable depends on the chamber); give its "
            "design instead of the result, which is then simulated with the target of the first"
        )


TIME = "time_to_98_s"
# The number of replicas says more than the rule by which it was chosen.
REPLICAS = "process.accuracy.replicas"
STOPPING_RULES = ("process.accuracy.objective_half_width", "process.accuracy.max_replicas")
# A treatment time, and by what share it may differ: of 1202 s in place of 1200 s nothing is told.
TREATMENT_TIME, SAME_TIME = "process.treatment_time_s", 0.005
# Values of a design that make no other chamber or process.
NOT_COMPARED: dict[str, Any] = {"part": {"mesh", "unit"}, "to_settle": True, "settled": True}


@dataclass(frozen=True)
class Comparison(ShownInNotebook):
    """The comparison of two or more results of the same part with the first of them.

    Args:
        results: the results.
        labels: short names of the results.
        parameters: design values that differ, by dotted name, with a value for each result.
        metrics: the objective, then every metric, by name, with an Estimate for each result.
        differences: by metric, a difference for each later result: its value minus the first's.
        confidence: confidence of the interval of each difference. It is chosen so that all
            intervals of a figure hold together with 95 %.
    """

    results: tuple[Result, ...]
    labels: tuple[str, ...]
    parameters: dict[str, tuple[Any, ...]]
    metrics: dict[str, tuple[Estimate, ...]]
    differences: dict[str, tuple[Difference, ...]]
    confidence: float


def require_comparable(results: Sequence[Result]) -> None:
    """Raise InputError if parts, targets, windows or calibrations of results differ."""
    folders, designs = zip(*((one.folder, one.design) for one in results), strict=True)
    parts = [(result.record.part_sha256, part_unit(result)) for result in results]
    require_same_part(folders, designs, parts)
    require_same_gauge(folders, designs)
    require_same_machine(folders, designs)


def coverage_after(result: Result, seconds: float) -> Estimate | None:
    """Return the mean coverage of a result's target after a time [s]; None beyond what it tells."""
    rows = result.record.coverage_against_time
    if not rows or not result.metrics["mean_coverage"].has_number or seconds > rows[-1].time_s:
        return None
    times = [0.0, *(one.time_s for one in rows)]
    values = [0.0, *(one.mean_coverage for one in rows)]
    widths = [0.0, *(one.half_width for one in rows)]
    return Estimate(
        float(np.interp(seconds, times, values)), float(np.interp(seconds, times, widths))
    )


def compare(paths: Sequence[str | Path]) -> Comparison:
    """Compare results folders of the same part and target with the first of them.

    Raises:
        InputError: there are fewer than two results, a result is given twice, a folder is no
            result, or parts, targets or treatment times differ.
    """
    folders = [Path(path) for path in paths]
    require_several(folders)
    return comparison_of([load_result(folder) for folder in folders], labels(folders))


def comparison_of(results: Sequence[Result], names: Sequence[str]) -> Comparison:
    """Compare loaded results with the first of them. `names` are their names in the comparison.

    Raises InputError if parts, targets, windows, treatment times or calibrations differ.

    Results on the same seeds are compared replica by replica where their replicas correlate. Other
    results are compared as independent samples (Welch).
    """
    first, folders = results[0], [result.folder for result in results]
    require_same_time(folders, [result.design for result in results])
    require_comparable(results)
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
        parameters=differing_values(results),
        metrics=metrics,
        differences={
            name: tuple(_difference(name, first, other, confidence) for other in results[1:])
            for name in metrics
        },
        confidence=confidence,
    )


def part_unit(result: Result) -> str:
    """Return the unit of length in which the part's file was read."""
    return result.record.part_unit or result.design.part.unit


def _difference(name: str, first: Result, other: Result, confidence: float) -> Difference:
    of_goal = name == first.objective_name
    after, before = (one.objective if of_goal else one.metrics[name] for one in (other, first))
    found = difference(after, before, other.seeds == first.seeds, confidence)
    if _metal(other.design) != _metal(first.design):
        found = _of_two_metals(found, [_by_the_law(name, one) for one in (other, first)])
    if found.time_ratio is None:
        return found
    # An estimate stores batches of replicas, not the number of replicas.
    return replace(found, replicas=math.ceil(found.time_ratio * other.record.replicas))


def _by_the_law(name: str, result: Result) -> float:
    """Return by how much the law of the compressed layer may be wrong in a figure, or 0."""
    terms = parse_objective(name).terms if name == result.objective_name else {name: 1.0}
    bands = stress_bands(result.design)
    errors = (
        weight * (bands[plain] - 1.0) * result.metrics[term].value
        for term, weight in terms.items()
        if (plain := term.rpartition(".")[2]) in bands and term in result.metrics
    )
    return sum(map(abs, errors))


def _of_two_metals(found: Difference, errors: Sequence[float]) -> Difference:
    """Return a difference with an interval that holds the errors of the law for both metals."""
    if not any(errors):
        return found
    half_width = math.hypot(found.half_width, *errors)
    return replace(found, half_width=half_width, time_ratio=None, replicas=None)


def _metal(design: Design) -> tuple[object, ...]:
    """Return the part material, the balls and the factors of measured profiles, to be compared.

    Results alike in them share the errors of the law of the compressed layer, as a factor on both.
    """
    balls = design.shot.density, set(design.shot.diameters)
    return design.materials.part, *balls, measured_law(design)


def labels(paths: Sequence[Path]) -> tuple[str, ...]:
    """Return a short label for each path: as few of its last folder names as make it unique."""
    resolved = [path.resolve() for path in paths]
    for depth in range(1, max(len(path.parts) for path in resolved) + 1):
        names = tuple("/".join(path.parts[-depth:]) for path in resolved)
        if len(set(names)) == len(names):
            return names
    return tuple(f"{path.name} ({i})" for i, path in enumerate(resolved, start=1))


def differing_values(results: Sequence[Result]) -> dict[str, tuple[object, ...]]:
    """Return the design values that differ between the results, by dotted name.

    A value that a result lacks is None.
    """
    designs = [_design_values(result) for result in results]
    # v0_for repeats the values of v0_m_s, the ball, the hardness and C0.
    all_names = (name for design in designs for name in design)
    names = dict.fromkeys(name for name in all_names if not name.endswith(".v0_for"))
    rows = {name: tuple(design.get(name) for design in designs) for name in names}
    found = {name: values for name, values in rows.items() if len(set(map(str, values))) > 1}
    if "chamber.shape" in found:  # the name of the shape says it already
        found.pop("shape_sha256", None)
    return found


def _design_values(result: Result) -> dict[str, Any]:
    """Return all values of a result's design by dotted name.

    Three values are added from the result: the number of replicas, the digest of a custom shape,
    and whether the cavity is analytical.
    """
    return {
        **_values_of(result.design),
        REPLICAS: result.record.replicas,
        "shape_sha256": result.record.shape_sha256[:12],
        "analytic": result.record.analytic,
    }


def _values_of(design: Design) -> dict[str, object]:
    values = _flattened(design.model_dump(mode="json", exclude=NOT_COMPARED))
    for name in STOPPING_RULES:
        values.pop(name, None)
    if is_custom(values["chamber.shape"]):
        # shape_sha256 is for the content
        values["chamber.shape"] = Path(str(values["chamber.shape"])).name
    return values


def values_before(result: Result, design: Design) -> dict[str, object]:
    """Return the values of a result's design that a design has otherwise now, by dotted name.

    A value that the result lacks is None. Values of the accuracy are left out, and a treatment time
    that is nearly the same.
    """
    before, now = _values_of(result.design), _values_of(design)
    times = result.design.process.treatment_time, design.process.treatment_time
    same = {TREATMENT_TIME} if math.isclose(*times, rel_tol=SAME_TIME) else set()
    return {
        name: before.get(name)
        for name in dict.fromkeys([*before, *now])
        if str(before.get(name)) != str(now.get(name))
        and name not in same
        and not name.startswith(("process.accuracy.", "ranges."))
        and not name.endswith(".v0_for")
    }


def _flattened(table: Mapping[str, object], prefix: str = "") -> dict[str, object]:
    """Return nested tables and lists of tables as a single table with dotted names."""
    flat: dict[str, Any] = {}
    for name, value in table.items():
        if isinstance(value, list | tuple) and any(isinstance(one, Mapping) for one in value):
            value = {str(place): one for place, one in enumerate(value)}
        if isinstance(value, Mapping):
            flat |= _flattened(value, f"{prefix}{name}.")
        else:
            flat[prefix + name] = value
    return flat

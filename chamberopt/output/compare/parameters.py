"""Which values differ between designs, and what candidates are called."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from chamberopt.design.shapes.base import is_custom

if TYPE_CHECKING:
    from chamberopt.output.results.load import Result

# How many replicas there were says more than what was to decide it.
REPLICAS, DECIDED_BY = (
    "process.accuracy.replicas",
    ("process.accuracy.objective_half_width", "process.accuracy.max_replicas"),
)


def differing(results: Sequence[Result]) -> dict[str, tuple[Any, ...]]:
    """The dotted design values that are not the same in all results, one a result, None where a design has none."""
    designs = [_values(result) for result in results]
    names = dict.fromkeys(name for design in designs for name in design)
    rows = {name: tuple(design.get(name) for design in designs) for name in names}
    return {name: values for name, values in rows.items() if len(set(map(str, values))) > 1}


def labels(places: Sequence[Path]) -> tuple[str, ...]:
    """The names of folders or files, with as much of the path before them as tells them apart."""
    resolved = [place.resolve() for place in places]
    for depth in range(1, max(len(path.parts) for path in resolved) + 1):
        named = tuple("/".join(path.parts[-depth:]) for path in resolved)
        if len(set(named)) == len(named):
            return named
    return tuple(f"{path.name} ({i})" for i, path in enumerate(resolved, start=1))


def _values(result: Result) -> dict[str, Any]:
    """All of a design's, and what it does not say: the content of a shape's own file, and whether there were facets."""
    values = _flat(result.design.model_dump(mode="json", exclude={"part": {"mesh", "unit"}}))
    for name in DECIDED_BY:
        values.pop(name, None)
    if is_custom(values["chamber.shape"]):
        values["chamber.shape"] = Path(values["chamber.shape"]).name  # its content is shape_sha256
    return {
        **values,
        REPLICAS: result.data.get("replicas", values.get(REPLICAS)),
        "shape_sha256": result.data.get("shape_sha256", "")[:12],
        "analytic": bool(result.data.get("analytic", False)),
    }


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

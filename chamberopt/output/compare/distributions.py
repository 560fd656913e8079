"""How coverage, impact speeds and angles are spread over the target, of several results in the same bins."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from chamberopt.output.compare.covered import Covered

BINS = 40


@dataclass(frozen=True)
class Histogram:
    """edges (n + 1,) in the unit · shares: of each result (n,), 0..1 of its area or impacts, None where not known."""

    unit: str
    edges: np.ndarray
    shares: tuple[np.ndarray | None, ...]

    def as_json(self) -> dict[str, Any]:
        """Plain JSON values."""
        shares = [None if one is None else one.tolist() for one in self.shares]
        return {"unit": self.unit, "edges": self.edges.tolist(), "shares": shares}


@dataclass(frozen=True)
class Distributions:
    """coverage: shares of the target's area, what is hidden from the shot at 0 · speed, angle: shares of its impacts.

    impacts, mean_speed [m/s], mean_angle [degrees]: of each result, None where it has no single impacts · dents: a
    triangle of the target, of each.
    """

    coverage: Histogram
    speed: Histogram
    angle: Histogram
    impacts: tuple[int | None, ...]
    mean_speed: tuple[float | None, ...]
    mean_angle: tuple[float | None, ...]
    dents: tuple[float, ...]

    def as_json(self) -> dict[str, Any]:
        """Plain JSON values."""
        return {
            "coverage": self.coverage.as_json(),
            "normal_speed": self.speed.as_json(),
            "angle": self.angle.as_json(),
            "impacts": list(self.impacts),
            "mean_normal_speed_m_s": list(self.mean_speed),
            "mean_angle_deg": list(self.mean_angle),
            "dents_per_triangle": list(self.dents),
        }


def distributions(candidates: Sequence[Covered]) -> Distributions:
    """Of results of one part and target."""
    hits = [one.hits_on_target for one in candidates]
    speeds = [None if one is None else one.speed.astype(float) for one in hits]
    angles = [None if one is None else one.angle.astype(float) for one in hits]
    return Distributions(
        coverage=_of_coverage(candidates),
        speed=_of_impacts("m/s", np.linspace(0.0, _fastest(speeds), BINS + 1), speeds),
        angle=_of_impacts("degrees", np.linspace(0.0, 90.0, BINS - 4 + 1), angles),
        impacts=tuple(None if one is None else len(one) for one in hits),
        mean_speed=tuple(map(_mean, speeds)),
        mean_angle=tuple(map(_mean, angles)),
        dents=tuple(one.dents_a_triangle for one in candidates),
    )


def _of_coverage(candidates: Sequence[Covered]) -> Histogram:
    """Of a triangle that is partly hidden, that part is at 0."""
    columns = []
    for one in candidates:
        area, exposed = one.area[one.target], np.minimum(one.exposed, one.area)[one.target]
        value = 100.0 * np.concatenate([one.coverage[one.target], np.zeros(len(area))])
        weight = np.concatenate([exposed, area - exposed]) / area.sum()
        columns.append((value[weight > 1e-12], weight[weight > 1e-12]))
    values = np.concatenate([value for value, _ in columns])
    low, high = 5.0 * np.floor(values.min() / 5.0), 5.0 * np.ceil(values.max() / 5.0)
    edges = np.linspace(low, max(high, low + 5.0), BINS + 1)
    return Histogram(
        "%",
        edges,
        tuple(np.histogram(value, edges, weights=weight)[0] for value, weight in columns),
    )


def _of_impacts(unit: str, edges: np.ndarray, columns: Sequence[np.ndarray | None]) -> Histogram:
    """What is beyond the last edge is in the last bin; no impacts, no shares."""
    shares = [
        None
        if one is None
        else np.histogram(np.minimum(one, edges[-1]), edges)[0] / max(1, len(one))
        for one in columns
    ]
    return Histogram(unit, edges, tuple(shares))


def _fastest(speeds: Sequence[np.ndarray | None]) -> float:
    """The speed that one impact in a thousand exceeds, of the candidate where that is most; at least 0.1 m/s."""
    return max(
        [0.1, *(float(np.quantile(one, 0.999)) for one in speeds if one is not None and len(one))]
    )


def _mean(values: np.ndarray | None) -> float | None:
    return None if values is None or not len(values) else float(values.mean())

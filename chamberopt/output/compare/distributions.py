"""Histograms of coverage, impact speed and impact angle over the target, in common bins."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from chamberopt.output.compare.target_surface import TargetSurface

BINS = 40


@dataclass(frozen=True)
class Histogram:
    """A histogram of several results.

    Args:
        unit: of the edges.
        edges: of the bins, shape (n + 1,).
        shares: for each result the share of its area or impacts in each bin, shape (n,); None where
            it is unknown.
    """

    unit: str
    edges: np.ndarray
    shares: tuple[np.ndarray | None, ...]

    def as_json(self) -> dict[str, Any]:
        """Return plain JSON values."""
        shares = [None if one is None else one.tolist() for one in self.shares]
        return {"unit": self.unit, "edges": self.edges.tolist(), "shares": shares}


@dataclass(frozen=True)
class Distributions:
    """Distributions of several results over one target.

    Args:
        coverage: shares of the target's area; what lies outside the cavity has coverage 0.
        speed: shares of the impacts by normal speed.
        angle: shares of the impacts by angle.
        impacts: number of impacts of each result; None where it stores no single impacts.
        mean_speed: [m/s], of each result, or None.
        mean_angle: [degrees], of each result, or None.
        dents: mean number of dents per triangle of the target, of each result.
    """

    coverage: Histogram
    speed: Histogram
    angle: Histogram
    impacts: tuple[int | None, ...]
    mean_speed: tuple[float | None, ...]
    mean_angle: tuple[float | None, ...]
    dents: tuple[float, ...]

    def as_json(self) -> dict[str, Any]:
        """Return plain JSON values."""
        return {
            "coverage": self.coverage.as_json(),
            "normal_speed": self.speed.as_json(),
            "angle": self.angle.as_json(),
            "impacts": list(self.impacts),
            "mean_normal_speed_m_s": list(self.mean_speed),
            "mean_angle_deg": list(self.mean_angle),
            "dents_per_triangle": list(self.dents),
        }


def distributions(candidates: Sequence[TargetSurface]) -> Distributions:
    """Compute the distributions of results of one part and target."""
    hits = [one.hits_on_target for one in candidates]
    speeds = [None if one is None else one.speed.astype(float) for one in hits]
    angles = [None if one is None else one.angle.astype(float) for one in hits]
    return Distributions(
        coverage=_coverage_histogram(candidates),
        speed=_impact_histogram("m/s", np.linspace(0.0, _top_speed(speeds), BINS + 1), speeds),
        angle=_impact_histogram("degrees", np.linspace(0.0, 90.0, BINS - 4 + 1), angles),
        impacts=tuple(None if one is None else len(one) for one in hits),
        mean_speed=tuple(map(_mean, speeds)),
        mean_angle=tuple(map(_mean, angles)),
        dents=tuple(one.dents_per_triangle for one in candidates),
    )


def _coverage_histogram(candidates: Sequence[TargetSurface]) -> Histogram:
    """Shares of area by coverage; the part of a triangle outside the cavity counts as 0."""
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


def _impact_histogram(
    unit: str, edges: np.ndarray, columns: Sequence[np.ndarray | None]
) -> Histogram:
    """Shares of impacts; values beyond the last edge are in the last bin."""
    shares = [
        None
        if one is None
        else np.histogram(np.minimum(one, edges[-1]), edges)[0] / max(1, len(one))
        for one in columns
    ]
    return Histogram(unit, edges, tuple(shares))


def _top_speed(speeds: Sequence[np.ndarray | None]) -> float:
    """Return the largest 99.9 % quantile of the candidates' speeds, at least 0.1 m/s."""
    return max(
        [0.1, *(float(np.quantile(one, 0.999)) for one in speeds if one is not None and len(one))]
    )


def _mean(values: np.ndarray | None) -> float | None:
    return None if values is None or not len(values) else float(values.mean())

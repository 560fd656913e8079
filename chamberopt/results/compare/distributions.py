"""Compute histograms of coverage, impact speed and angle on the target for several results."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from chamberopt.results.compare.local_difference import TargetSurface

BINS = 40


@dataclass(frozen=True)
class Histogram:
    """A histogram of one quantity for several results, which share the bins.

    Args:
        unit: unit of the edges.
        edges: edges of the bins, shape (n + 1,).
        shares: share of the area or impacts in each bin, shape (n,), for each result.
    """

    unit: str
    edges: np.ndarray
    shares: tuple[np.ndarray, ...]


@dataclass(frozen=True)
class Distributions:
    """Histograms of coverage and of impacts on the target, for several results.

    Args:
        coverage: shares of the target's area. Area that no ball can touch has coverage 0.
        speed: shares of the impacts by speed along the surface normal.
        angle: shares of the impacts by angle.
        impacts: number of impacts of each result.
        mean_speed: mean normal speed of each result [m/s]. None for a result without impacts.
        mean_angle: mean angle of each result [degrees]. None for a result without impacts.
    """

    coverage: Histogram
    speed: Histogram
    angle: Histogram
    impacts: tuple[int, ...]
    mean_speed: tuple[float | None, ...]
    mean_angle: tuple[float | None, ...]


def distributions(candidates: Sequence[TargetSurface]) -> Distributions:
    """Return histograms of coverage, impact speed and angle for results with the same target."""
    speeds = [one.hits.speed.astype(float) for one in candidates]
    angles = [one.hits.angle.astype(float) for one in candidates]
    top_speed = max([0.1, *(float(np.quantile(one, 0.999)) for one in speeds if len(one))])
    return Distributions(
        coverage=_coverage_histogram(candidates),
        speed=_impact_histogram("m/s", np.linspace(0.0, top_speed, BINS + 1), speeds),
        angle=_impact_histogram("degrees", np.linspace(0.0, 90.0, BINS - 4 + 1), angles),
        impacts=tuple(map(len, speeds)),
        mean_speed=tuple(map(_mean, speeds)),
        mean_angle=tuple(map(_mean, angles)),
    )


def _coverage_histogram(candidates: Sequence[TargetSurface]) -> Histogram:
    """Return a histogram, for each candidate, of the target's area by coverage in per cent."""
    values = [100.0 * one.coverage for one in candidates]
    low = 5.0 * np.floor(min(one.min() for one in values) / 5.0)
    high = 5.0 * np.ceil(max(one.max() for one in values) / 5.0)
    edges = np.linspace(low, max(high, low + 5.0), BINS + 1)
    shares = [
        np.histogram(value, edges, weights=one.area)[0]
        for value, one in zip(values, candidates, strict=True)
    ]
    return Histogram("%", edges, tuple(shares))


def _impact_histogram(unit: str, edges: np.ndarray, columns: Sequence[np.ndarray]) -> Histogram:
    """Return a histogram of impact values for each candidate, in shares of its number of impacts.

    Values beyond the last edge count in the last bin.

    Args:
        columns: values of all impacts, an array for each candidate.
    """
    shares = [
        np.histogram(np.minimum(one, edges[-1]), edges)[0] / max(1, len(one)) for one in columns
    ]
    return Histogram(unit, edges, tuple(shares))


def _mean(values: np.ndarray) -> float | None:
    return float(values.mean()) if len(values) else None

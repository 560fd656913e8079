"""What is known of each part triangle: the fields of coverage.vtp.

Notation
    x   dent density of a triangle at the treatment time: area of its dents over its area
    s_i areas of the simulated dents on a triangle [m²]
    y   sum of s_i [m²]
    v   sum of s_i² [m⁴]
    C   coverage, 1 - exp(-x)
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from chamberopt.common.estimate import CONFIDENCE
from chamberopt.coverage.coverage_from_impacts import (
    coverage_at,
    coverage_from_dent_density,
    mean_angle_per_triangle,
    mean_speed_per_triangle,
)
from chamberopt.coverage.part_impacts import HitsByTriangle

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from chamberopt.design.load import Design
    from chamberopt.simulation.evaluation import Evaluation


def compute_triangle_fields(
    design: Design, chamber: Chamber, evaluation: Evaluation
) -> dict[str, np.ndarray]:
    """Compute the cell data of coverage.vtp; NaN for triangles not exposed or never hit.

    Returns:
        Arrays (m,) by name:

        coverage: at the treatment time, 0..1.
        impacts_per_mm2, energy_per_mm2: impacts and energy [mJ] per area at the treatment time.
        dent_density: area of dents over area at the treatment time.
        impacts, dents: simulated numbers.
        mean_normal_speed [m/s], mean_angle_deg: means over the impacts; 90 is head on.
        exposed_area_mm2, target, element: of the triangle; its number in the part's file.

        If single impacts were kept also:

        p90_normal_speed: 90th percentile of the normal speed [m/s].
        mean_dent_um: mean diameter of the dents [µm].
        coverage_interval: width of the 95 % interval of the coverage.
    """
    total, marked = evaluation.total, evaluation.marked
    exposed_mm2 = np.where(chamber.exposed_area > 0.0, chamber.exposed_area * 1e6, np.nan)
    treatment_time = design.process.treatment_time
    time_ratio = treatment_time / total.simulated_time
    computed = {
        "coverage": coverage_at(total, chamber, treatment_time) if marked is None else marked.share,
        "impacts_per_mm2": total.impacts * time_ratio / exposed_mm2,
        "dent_density": total.dented_area * 1e6 * time_ratio / exposed_mm2,
        "impacts": total.impacts,
        "dents": total.dents,
        "mean_normal_speed": mean_speed_per_triangle(total),
        "mean_angle_deg": mean_angle_per_triangle(total),
        "exposed_area_mm2": chamber.exposed_area * 1e6,
        "target": chamber.part.target.astype(np.uint8),
        "element": chamber.part.elements,
    }
    hits = evaluation.hits_by_triangle
    if hits is None:
        return computed
    if marked is None:
        low, high = coverage_bounds(hits, exposed_mm2 * 1e-6, time_ratio)
    return computed | {
        "energy_per_mm2": _sums(hits, hits.hits.energy) * 1e3 * time_ratio / exposed_mm2,
        "p90_normal_speed": _speed_quantile(hits, 0.9),
        "mean_dent_um": np.divide(
            1e6 * _sums(hits, hits.hits.dent),
            total.dents,
            out=np.full(len(exposed_mm2), np.nan),
            where=total.dents > 0,
        ),
        "coverage_interval": high - low if marked is None else marked.interval_width,
    }


def _sums(hits: HitsByTriangle, column: np.ndarray) -> np.ndarray:
    return np.bincount(hits.hits.triangle, column.astype(float), len(hits.first) - 1)


def _speed_quantile(hits: HitsByTriangle, share: float) -> np.ndarray:
    """Normal speed that this share of a triangle's impacts do not exceed, (m,); ranks round up."""
    speed = hits.hits.speed[np.lexsort((hits.hits.speed, hits.hits.triangle))]
    count = np.diff(hits.first)
    rank = np.maximum(np.ceil(share * count).astype(int) - 1, 0)
    hit = count > 0
    quantile = np.full(len(count), np.nan)
    quantile[hit] = speed[hits.first[:-1][hit] + rank[hit]]
    return quantile


def coverage_bounds(
    hits: HitsByTriangle,
    area: np.ndarray,
    time_ratio: float,
    over: Callable[[np.ndarray], np.ndarray] = np.asarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Ends of the 95 % interval of the coverage of each triangle by Avrami's equation.

    x is a sum of dents that fall as a Poisson process, each with a weight of its own. The gamma
    interval for such sums holds for few dents and for none. It does not know dents that come in
    series from a ball that bounces on its spot.

    Args:
        area: exposed area [m²], (m,).
        time_ratio: treatment time over simulated time.
        over: sums values (m,) over the neighbours of each triangle; `area` must be such sums too.

    Returns:
        Lower and upper ends, (m,) each.

    Source: M. P. Fay and E. J. Feuer, "Confidence intervals for directly standardized rates",
    Statistics in Medicine 16 (1997) 791.
    """
    from scipy.special import gammaincinv

    dent = np.pi / 4.0 * hits.hits.dent.astype(float) ** 2
    y, v = over(_sums(hits, dent)), over(_sums(hits, dent**2))
    largest = float(dent.max()) if len(dent) else 0.0
    if largest == 0.0:
        zero = np.where(np.isnan(area), np.nan, 0.0)
        return zero, zero + 1.0
    tail = 0.5 * (1.0 - CONFIDENCE)
    dented = v > 0.0
    low = np.zeros(len(y))
    low[dented] = v[dented] / y[dented] * gammaincinv(y[dented] ** 2 / v[dented], tail)
    # The upper end belongs to one more dent of the largest size.
    y_more, v_more = y + largest, v + largest**2
    high = v_more / y_more * gammaincinv(y_more**2 / v_more, 1.0 - tail)
    return (
        coverage_from_dent_density(low / area * time_ratio),
        coverage_from_dent_density(high / area * time_ratio),
    )

"""What can be shown of each triangle of the part: its name, unit and colours, and how it is computed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from chamberopt.coverage.coverage_from_impacts import (
    coverage_at,
    mean_angle_per_triangle,
    mean_speed_per_triangle,
)
from chamberopt.coverage.part_impacts import HitsByTriangle
from chamberopt.coverage.statistics.confidence_interval import CONFIDENCE

if TYPE_CHECKING:
    from collections.abc import Callable

    from chamberopt.chamber.build import Chamber
    from chamberopt.design.load import Design
    from chamberopt.simulation.evaluation import Evaluation

# Even steps of lightness, told apart by colour-blind readers too.
EVEN, COUNTS, DOUBT = "viridis", "cividis", "magma"


@dataclass(frozen=True)
class Quantity:
    """One number a triangle.

    column: its cell data in coverage.vtp · factor: from there to the unit that is shown · grows: in proportion to time.
    """

    name: str
    label: str
    unit: str
    column: str
    factor: float = 1.0
    colours: str = EVEN
    grows: bool = False

    @property
    def title(self) -> str:
        return f"{self.label} [{self.unit}]"


QUANTITIES = {
    one.name: one
    for one in (
        Quantity("coverage", "coverage", "%", "coverage", 100.0),
        Quantity(
            "impacts", "impacts per area", "1/mm²", "impacts_per_mm2", colours=COUNTS, grows=True
        ),
        Quantity("speed", "mean normal speed", "m/s", "mean_normal_speed"),
        Quantity("p90-speed", "normal speed, 90th percentile", "m/s", "p90_normal_speed"),
        Quantity("angle", "mean impact angle, 90° is head on", "°", "mean_angle_deg"),
        Quantity("dent", "mean dent diameter", "µm", "mean_dent_um"),
        Quantity(
            "energy",
            "energy of impacts per area",
            "mJ/mm²",
            "energy_per_mm2",
            colours=COUNTS,
            grows=True,
        ),
        Quantity(
            "interval", "width of coverage's 95 % interval", "%", "coverage_interval", 100.0, DOUBT
        ),
    )
}


def compute_triangle_fields(
    design: Design, chamber: Chamber, evaluation: Evaluation
) -> dict[str, np.ndarray]:
    """The cell data of coverage.vtp, (m,) each, NaN where not exposed or never hit.

    coverage (0..1), impacts_per_mm2 and energy_per_mm2 [mJ/mm²] at the treatment time; dent_density (dented area per
    area then: coverage is 1 - exp(-it), or the share of the triangle inside dents where every dent is marked);
    impacts, dents (simulated numbers), mean_normal_speed [m/s], mean_angle_deg (90 is head on), exposed_area_mm2,
    target, element (its number in the part's file). From single hits, where the evaluation has them: p90_normal_speed
    [m/s], mean_dent_um (of the impacts that leave one), coverage_interval (width of the 95 % interval).
    """
    total, marked = evaluation.total, evaluation.marked
    exposed_mm2 = np.where(chamber.exposed_area > 0.0, chamber.exposed_area * 1e6, np.nan)
    seconds = design.process.treatment_time
    times = seconds / total.simulated_time
    found = {
        "coverage": coverage_at(total, chamber, seconds) if marked is None else marked,
        "impacts_per_mm2": total.impacts * times / exposed_mm2,
        "dent_density": total.dented_area * 1e6 * times / exposed_mm2,
        "impacts": total.impacts,
        "dents": total.dents,
        "mean_normal_speed": mean_speed_per_triangle(total),
        "mean_angle_deg": mean_angle_per_triangle(total),
        "exposed_area_mm2": chamber.exposed_area * 1e6,
        "target": chamber.part.target.astype(np.uint8),
        "element": chamber.part.elements,
    }
    hits = evaluation.sorted_hits
    if hits is None:
        return found
    energy = _sums(hits, hits.hits.energy)
    found |= {
        "energy_per_mm2": energy * 1e3 * times / exposed_mm2,
        "p90_normal_speed": _quantile(hits, 0.9),
        "mean_dent_um": np.divide(
            1e6 * _sums(hits, hits.hits.dent),
            total.dents,
            out=np.full(len(energy), np.nan),
            where=total.dents > 0,
        ),
        "coverage_interval": evaluation.marked_interval
        if evaluation.marked_interval is not None
        else np.subtract(*reversed(coverage_bounds(hits, exposed_mm2 * 1e-6, times))),
    }
    return found


def _sums(hits: HitsByTriangle, column: np.ndarray) -> np.ndarray:
    return np.bincount(hits.hits.triangle, column.astype(float), len(hits.first) - 1)


def _quantile(hits: HitsByTriangle, share: float) -> np.ndarray:
    """The speed that this share of a triangle's impacts do not exceed (its rank is rounded up), (m,)."""
    speed = hits.hits.speed[np.lexsort((hits.hits.speed, hits.hits.triangle))]
    count = np.diff(hits.first)
    rank = np.maximum(np.ceil(share * count).astype(int) - 1, 0)
    there = count > 0
    found = np.full(len(count), np.nan)
    found[there] = speed[hits.first[:-1][there] + rank[there]]
    return found


def coverage_bounds(
    hits: HitsByTriangle,
    area: np.ndarray,
    times: float,
    over: Callable[[np.ndarray], np.ndarray] = np.asarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Ends (m,) of the 95 % interval of the coverage 1 - exp(-x), area (m,) m², times: treatment over simulated time.

    over: sums what the triangles have, (m,), over the neighbours of each; area then is such a sum too.

    x is a sum of dents that fall as Poisson has it, each with its own weight: the gamma interval of M. P. Fay and
    E. J. Feuer, "Confidence intervals for directly standardized rates", Statistics in Medicine 16 (1997) 791. It
    holds for few dents, and for none. Dents that come in series, of a ball that bounces on its spot, it does not know.
    """
    from scipy.special import gammaincinv

    dent = np.pi / 4.0 * hits.hits.dent.astype(float) ** 2
    y, v = over(_sums(hits, dent)), over(_sums(hits, dent**2))
    largest = float(dent.max()) if len(dent) else 0.0
    if largest == 0.0:
        nothing = np.where(np.isnan(area), np.nan, 0.0)
        return nothing, nothing + 1.0
    tail = 0.5 * (1.0 - CONFIDENCE)
    some = v > 0.0
    low = np.zeros(len(y))
    low[some] = v[some] / y[some] * gammaincinv(y[some] ** 2 / v[some], tail)
    more, wider = y + largest, v + largest**2
    high = wider / more * gammaincinv(more**2 / wider, 1.0 - tail)
    return -np.expm1(-low / area * times), -np.expm1(-high / area * times)

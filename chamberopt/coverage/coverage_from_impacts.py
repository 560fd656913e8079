"""From impacts to the coverage of each part triangle by Avrami's equation.

Notation
    C  coverage: share of an area that lies inside dents, 0..1
    x  dent density: area of all dents over the area they lie on      (dent_density)
    C = 1 - exp(-x) for dents that fall independently of one another (Avrami's equation)
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING

import numpy as np

from chamberopt.coverage.dents import dent_diameters, impact_angle_deg

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from chamberopt.design.load import Design
    from sim_core import ImpactLog


@dataclass(frozen=True)
class Tally:
    """Sums of the impacts on each part triangle, over one or more replicas.

    Every column is a plain sum, so tallies add: `a + b`. The tally of one replica also has its
    single dents, which sums of tallies do not keep.
    """

    simulated_time: float  # recorded time of all replicas together [s]
    impacts: np.ndarray  # number of impacts, (m,)
    dents: np.ndarray  # number of dents, (m,)
    dented_area: np.ndarray  # area of the dents [m²], (m,)
    speed_sum: np.ndarray  # sum of normal speeds [m/s], (m,)
    angle_sum: np.ndarray  # sum of impact angles [degrees], (m,)
    # Part triangle of each dent, (k,) int.
    dent_triangle: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=np.int32))
    # Area of each dent [m²], (k,).
    dent_area: np.ndarray = field(default_factory=lambda: np.zeros(0))

    def __add__(self, other: Tally) -> Tally:
        return Tally(*(getattr(self, name) + getattr(other, name) for name in _SUMS))

    def __sub__(self, other: Tally) -> Tally:
        """This tally without one of its replicas. Rounding errors below zero become zero."""
        return Tally(*(np.maximum(getattr(self, name) - getattr(other, name), 0) for name in _SUMS))


_SUMS = tuple(column.name for column in fields(Tally) if not column.name.startswith("dent_"))


def tally_impacts(impacts: ImpactLog, chamber: Chamber, design: Design) -> Tally:
    """Sum the impacts of one replica on each part triangle.

    A dent counts whole for the triangle under its contact point, even if it reaches over the edge.
    Neighbours trade what they lose, so sums over an area are unbiased, while a triangle much
    smaller than a dent is noisy. Impacts below the yield speed count as impacts without dents.
    """
    source = chamber.source[impacts.triangle]
    on_part = source >= 0
    triangle = source[on_part]
    speed = np.asarray(impacts.normal_speed)[on_part]
    dent = dent_diameters(impacts, design)[on_part]
    angle = impact_angle_deg(np.asarray(impacts.velocity)[on_part], speed)
    dented, area = dent > 0.0, np.pi / 4.0 * dent * dent
    count = len(chamber.part.triangles)
    return Tally(
        simulated_time=design.process.recorded_time,
        impacts=np.bincount(triangle, minlength=count),
        dents=np.bincount(triangle[dented], minlength=count),
        dented_area=np.bincount(triangle, area, count),
        speed_sum=np.bincount(triangle, speed, count),
        angle_sum=np.bincount(triangle, angle, count),
        dent_triangle=triangle[dented],
        dent_area=area[dented],
    )


def coverage_from_dent_density(dent_density: np.ndarray) -> np.ndarray:
    """Coverage 1 - exp(-x) of areas with dent density x, by Avrami's equation."""
    return np.asarray(-np.expm1(-dent_density))


def coverage_at(total: Tally, chamber: Chamber, time: float) -> np.ndarray:
    """Coverage of each part triangle after a peening time, dents falling at the simulated rate.

    Args:
        time: peening time [s].

    Returns:
        Coverage of the exposed area, (m,); NaN for triangles that are not exposed.
    """
    exposed = chamber.exposed_area > 0.0
    rate = np.full(len(exposed), np.nan)
    np.divide(
        total.dented_area, chamber.exposed_area * total.simulated_time, out=rate, where=exposed
    )
    return coverage_from_dent_density(rate * time)


def mean_speed_per_triangle(total: Tally) -> np.ndarray:
    """Mean normal speed of the impacts on each part triangle [m/s], (m,); NaN if nothing hit it."""
    return _per_impact(total.speed_sum, total.impacts)


def mean_angle_per_triangle(total: Tally) -> np.ndarray:
    """Mean angle of the impacts on each part triangle [degrees], (m,); NaN if nothing hit it."""
    return _per_impact(total.angle_sum, total.impacts)


def _per_impact(sums: np.ndarray, impacts: np.ndarray) -> np.ndarray:
    mean = np.full(len(impacts), np.nan)
    return np.divide(sums, impacts, out=mean, where=impacts > 0)

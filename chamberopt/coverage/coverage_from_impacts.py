"""ImpactLog -> what each triangle of the user's own mesh got: impacts, dents and coverage."""

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
    """What each part triangle got, summed over the simulated time of one or more replicas.

    simulated_time s · impacts (m,), dents (m,): numbers · dented_area (m,) m² · speed_sum (m,) m/s, of normal
    speeds · angle_sum (m,) degrees, of impact angles. Every column is a plain sum, so tallies add: `a + b`.

    One replica's also has its dents one by one: dent_triangle (k,) int, dent_area (k,) m²; sums are without.
    """

    simulated_time: float
    impacts: np.ndarray
    dents: np.ndarray
    dented_area: np.ndarray
    speed_sum: np.ndarray
    angle_sum: np.ndarray
    dent_triangle: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=np.int32))
    dent_area: np.ndarray = field(default_factory=lambda: np.zeros(0))

    def __add__(self, other: Tally) -> Tally:
        return Tally(*(getattr(self, name) + getattr(other, name) for name in SUMS))

    def __sub__(self, other: Tally) -> Tally:
        """This tally without one of its parts; what rounding leaves below zero is zero."""
        return Tally(*(np.maximum(getattr(self, name) - getattr(other, name), 0) for name in SUMS))


SUMS = tuple(column.name for column in fields(Tally) if not column.name.startswith("dent_"))


def tally_impacts(impacts: ImpactLog, chamber: Chamber, design: Design) -> Tally:
    """Book every impact on the part triangle it hit.

    A dent is booked whole on the triangle under the contact, even where it spills over the edge: neighbours
    trade what they lose, so sums over an area are unbiased, while a triangle much smaller than a dent is
    noisy. Speeds and angles are relative to the surface; impacts below the yield speed count as impacts
    without dents.
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


def coverage_at(total: Tally, chamber: Chamber, time: float) -> np.ndarray:
    """Share of each part triangle that is dented after `time` [s], shape (m,), 0..1; NaN where not exposed.

    C = 1 - exp(-dented area per exposed area and second · time): Avrami's equation for dents that fall
    independently of one another, at the rate seen in the simulated time.
    """
    exposed = chamber.exposed_area > 0.0
    rate = np.full(len(exposed), np.nan)
    np.divide(
        total.dented_area, chamber.exposed_area * total.simulated_time, out=rate, where=exposed
    )
    return -np.expm1(-rate * time)


def mean_speed_per_triangle(total: Tally) -> np.ndarray:
    """Mean normal speed of the impacts on each part triangle [m/s], shape (m,); NaN where nothing hit."""
    return _per_impact(total.speed_sum, total.impacts)


def mean_angle_per_triangle(total: Tally) -> np.ndarray:
    """Mean impact angle on each part triangle [degrees from the surface], (m,); NaN where nothing hit."""
    return _per_impact(total.angle_sum, total.impacts)


def _per_impact(sums: np.ndarray, impacts: np.ndarray) -> np.ndarray:
    mean = np.full(len(impacts), np.nan)
    return np.divide(sums, impacts, out=mean, where=impacts > 0)

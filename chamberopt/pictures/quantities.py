"""List the quantities that viewer and report can show on the part, with their colour maps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from chamberopt.coverage.metrics import FULL_COVERAGE
from chamberopt.pictures.charts.colours import COUNT_MAP, COVERAGE_MAP, WIDTH_MAP


@dataclass(frozen=True)
class Quantity:
    """A quantity that can be shown as colours on the part, such as coverage."""

    name: str
    label: str
    unit: str
    column: str  # field of a result, on its part and its mesh to draw
    factor: float = 1.0  # from the field to the shown unit
    colours: str = COVERAGE_MAP
    grows: bool = False  # true if it is proportional to the peening time

    @property
    def title(self) -> str:
        return f"{self.label} [{self.unit}]"


OTHER_NAMES = {"intensity": "strength", "p90": "p90-speed"}  # other accepted names
QUANTITIES = {
    one.name: one
    for one in (
        Quantity("coverage", "coverage", "%", "coverage", 100.0),
        Quantity("impacts", "impacts per area", "1/mm²", "impacts_per_mm2", 1.0, COUNT_MAP, True),
        Quantity("speed", "mean normal speed", "m/s", "mean_normal_speed"),
        Quantity("p90-speed", "normal speed, 90th percentile", "m/s", "p90_normal_speed"),
        Quantity("angle", "mean impact angle, 90° is head on", "°", "mean_angle_deg"),
        Quantity("dent", "mean dent diameter", "µm", "mean_dent_um"),
        Quantity(
            "energy", "energy of impacts per area", "mJ/mm²", "energy_per_mm2", 1.0, COUNT_MAP, True
        ),
        Quantity(
            "interval",
            "width of coverage's 95 % interval",
            "%",
            "coverage_interval",
            100.0,
            WIDTH_MAP,
        ),
        Quantity("strength", "peening strength", "µm", "strength_um"),
        Quantity("almen", "Almen intensity", "mmA", "almen_intensity_mmA"),
        Quantity("saturation", "saturation time of a strip", "s", "saturation_time_s"),
        Quantity("depth", "estimated depth of compression", "µm", "compression_depth_um"),
        Quantity("stress", "estimated stress at the surface", "MPa", "surface_stress_MPa"),
        Quantity("moved", "surface from the file's facets", "µm", "moved_um", 1.0, WIDTH_MAP),
        Quantity("zones", "zone", "", "zone"),
    )
}
# Of pages, which compute it; coverage is 1 - exp(-dent density · time / treatment time).
TIME_TO_98 = Quantity("time-98", "time to 98 % there", "s", "", colours=WIDTH_MAP)


def times_to_98(dent_density: np.ndarray, treatment_time: float) -> np.ndarray:
    """Return the time [s] after which each place is covered to 98 %; inf where no ball hits.

    >>> times_to_98(np.array([np.log(50.0)]), 60.0).round(6).tolist()
    [60.0]
    """
    with np.errstate(divide="ignore"):
        return np.asarray(-np.log1p(-FULL_COVERAGE) * treatment_time / dent_density)

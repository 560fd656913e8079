"""Zones: surfaces of the part, as a drawing gives them, each with its own results and limits.

A limit on a drawing holds at every point of a zone. So limits are on percentiles over the zone's
area: the least coverage on the 5th percentile, the largest coverage and the largest exposure on the
95th, and the band of the Almen intensity on both.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Annotated

from pydantic import Field

from chamberopt.common.toml_errors import Problem
from chamberopt.common.toml_fields import Pair, list_field, quantity
from chamberopt.design.calibration import Calibration, why_no_intensity
from chamberopt.design.part import Selection, Smoothing
from chamberopt.design.table_base import FileTable

MAX_ZONES = 20  # each zone is looked at through as many windows as the target
LID = "lid"
NAMES = (
    "a name in quotes of at most 40 letters, digits and _, no digit first, other than lid, which "
    "is the chamber's for chamberopt strip"
)
# The metric of a zone that each number of a key limits, and the limited end.
LIMITED = {
    "coverage_min": (("p05_coverage", "min"),),
    "coverage_max": (("p95_coverage", "max"),),
    "exposure_max": (("p95_exposure", "max"),),
    "intensity_mmA": (("almen_intensity_p05", "min"), ("almen_intensity_p95", "max")),
}


class Zone(FileTable):
    """A surface of the part with its own results and limits. It may lie outside the target."""

    name: Annotated[str, Field(pattern=r"^[A-Za-z_][A-Za-z0-9_]*$", max_length=40)] = Field(
        description="e.g. root: its figures are root.mean_coverage ...",
        json_schema_extra={"form": NAMES},
    )
    target: Selection = Field(description="its triangles, by the keys of [part.target]")
    smoothing: Smoothing | None = Field(
        default=None, description="as part.smoothing; absent: that of the part"
    )
    coverage_min: float | None = quantity(
        0, 1, "", "least coverage, of all but 5 % of the zone's area", None
    )
    coverage_max: float | None = quantity(
        0, 1, "", "largest coverage, of all but 5 % of the zone's area", None
    )
    exposure_max: float | None = quantity(
        0.001, 1000, "", "largest exposure, in times to 98 %; 2 is 200 %", None
    )
    intensity_mmA: Pair | None = list_field(  # noqa: N815
        "two numbers [low, high], 0 <= low < high",
        "band of the Almen intensity, of all but 5 % of the zone's area at each end",
        None,
    )

    @property
    def is_spared(self) -> bool:
        """True if the zone is to be spared: it has a largest coverage, but no least coverage."""
        return self.coverage_max is not None and self.coverage_min is None

    def _problems(self) -> Iterator[Problem]:
        if self.name == LID:
            yield Problem("name", f"given {LID!r}; allowed: {NAMES}")
        low, high = self.coverage_min, self.coverage_max
        if low is not None and high is not None and low > high:
            yield Problem("coverage_min", f"given {low:g}, above coverage_max = {high:g}")
        if (
            self.intensity_mmA is not None
            and not 0 <= self.intensity_mmA[0] < self.intensity_mmA[1]
        ):
            text = f"given {list(self.intensity_mmA)}; allowed: [low, high] with 0 <= low < high"
            yield Problem("intensity_mmA", text)


def zone_problems(zones: Sequence[Zone], calibration: Calibration | None) -> Iterator[Problem]:
    """Yield a problem for each zone whose name is taken or whose intensity is not calibrated.

    Limits on the Almen intensity of a zone need a calibration with measured strips.
    """
    names = [zone.name for zone in zones]
    for k, zone in enumerate(zones):
        if zone.name in names[:k]:
            text = f"given {zone.name!r}, as zones.{names.index(zone.name)} has; names must differ"
            yield Problem(f"zones.{k}.name", text)
        if zone.intensity_mmA and (reason := why_no_intensity(calibration)):
            yield Problem(f"zones.{k}.intensity_mmA", reason)

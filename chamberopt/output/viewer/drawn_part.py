"""The part of a result, ready to be drawn: its target coloured by one quantity, and the rest."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.coverage.coverage_from_impacts import coverage_from_dent_density
from chamberopt.output.disc_averages import average_over_discs
from chamberopt.output.plots.quantities import QUANTITIES, Quantity
from chamberopt.output.vtp_files import Surface, read_coverage_model


class DrawnPart:
    """The target of a part with the values of one quantity, and the rest of the part.

    target: exposed triangles of the target, with cell data "shown" in the quantity's unit.
    rest: all other triangles.
    marked: whether dents were marked one by one, so that coverage is known at one time only.
    quantity: the one in "shown".

    Target and rest have cell data "row", the number of the triangle in coverage.vtp.
    """

    def __init__(self, surface: Surface, quantity: Quantity = QUANTITIES["coverage"]) -> None:
        on_target = (surface["target"] > 0) & (surface["exposed_area_mm2"] > 0)
        surface["row"] = np.arange(surface.n_cells)
        self.target = surface.extract_cells(on_target).extract_surface(algorithm="dataset_surface")
        self.rest = surface.extract_cells(~on_target)
        self.marked = read_coverage_model(surface) == "dents"
        self.show(quantity)

    def show(self, quantity: Quantity, times: float = 1.0) -> None:
        """Put a quantity into "shown".

        times: the peening time over the treatment time; scales coverage and what grows with time.
        """
        self.quantity = quantity
        self.target["shown"] = self.values(quantity, times)

    def values(self, quantity: Quantity, times: float = 1.0) -> np.ndarray:
        """Values of the target's triangles in the quantity's unit; `times` as in show."""
        if quantity.column not in self.target.cell_data:
            raise InputError(
                f"coverage.vtp has no {quantity.column}: an older result; simulate again"
            )
        if quantity.name != "coverage":
            scale = quantity.factor * (times if quantity.grows else 1.0)
            return scale * np.asarray(self.target[quantity.column])
        value = self._averages[0]
        return 100.0 * (value if self.marked else coverage_from_dent_density(value * times))

    @property
    def averaging_radius(self) -> float:
        """Radius of the discs that coverage is averaged over [mm], 0 where it is not."""
        return self._averages[1]

    @cached_property
    def _averages(self) -> tuple[np.ndarray, float]:
        """Averages of the dent density, or of marked coverage, and the radius of their discs."""
        return average_over_discs(
            np.asarray(self.target.cell_centers().points),
            np.asarray(self.target.cell_normals),
            np.asarray(self.target["coverage" if self.marked else "dent_density"]),
            np.asarray(self.target["exposed_area_mm2"]),
            np.asarray(self.target["dents"]),
        )


def colour_range(parts: Sequence[DrawnPart]) -> tuple[float, float]:
    """Return round limits that hold nearly all values shown on all parts."""
    values = np.concatenate([part.target["shown"] for part in parts])
    values = values[np.isfinite(values)]
    if parts[0].quantity.unit != "%":
        return _round_range(*np.percentile(values, [1.0, 99.0])) if len(values) else (0.0, 1.0)
    low, high = np.percentile(values, [1.0, 99.5]) if len(values) else (0.0, 100.0)
    step = 5.0 if high - low < 20.0 else 10.0
    low = max(0.0, step * np.floor(low / step))
    return low, min(100.0, max(low + step, step * np.ceil(high / step)))


def _round_range(low: float, high: float) -> tuple[float, float]:
    """Widen limits to round numbers, and down to 0 if that is near."""
    span = high - low if high > low else max(abs(high), 1e-12)
    step = 10.0 ** np.floor(np.log10(span)) / 2.0
    low = 0.0 if 0.0 <= low < 0.4 * high else step * np.floor(low / step)
    return float(low), float(max(step * np.ceil(high / step), low + step))

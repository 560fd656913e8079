"""A part ready to be drawn: its target with one quantity on it, and the rest."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.coverage.coverage_from_impacts import coverage_from_dent_density
from chamberopt.output.disc_averages import average_over_discs
from chamberopt.output.vtp_files import Surface, read_coverage_model
from chamberopt.simulation.triangle_fields import QUANTITIES, Quantity


class DrawnPart:
    """A part ready to be drawn: `target` with one quantity as cell data "shown", in the unit shown, and the `rest`.

    Both have cell data "row", the triangle's row in coverage.vtp. reach [mm]: how far around a triangle coverage is
    averaged, 0 where it is not. marked: whether coverage is from dents marked one by one, known at one time only.
    """

    def __init__(self, surface: Surface, quantity: Quantity = QUANTITIES["coverage"]) -> None:
        wanted = (surface["target"] > 0) & (surface["exposed_area_mm2"] > 0)
        surface["row"] = np.arange(surface.n_cells)
        self.target = surface.extract_cells(wanted).extract_surface(algorithm="dataset_surface")
        self.rest = surface.extract_cells(~wanted)
        self.marked = read_coverage_model(surface) == "dents"
        self.show(quantity)

    def show(self, quantity: Quantity, times: float = 1.0) -> None:
        """Another quantity; coverage and what is counted per area at so many treatment times."""
        self.quantity = quantity
        self.reach = self.coverage_reach if quantity.name == "coverage" else 0.0
        self.target["shown"] = self.values(quantity, times)

    def values(self, quantity: Quantity, times: float = 1.0) -> np.ndarray:
        """Of the target's triangles, in the unit shown."""
        if quantity.column not in self.target.cell_data:
            raise InputError(
                f"coverage.vtp has no {quantity.column}: an older result; simulate again"
            )
        if quantity.name != "coverage":
            return (
                quantity.factor
                * np.asarray(self.target[quantity.column])
                * (times if quantity.grows else 1.0)
            )
        value = self._averages[0]
        return 100.0 * (value if self.marked else coverage_from_dent_density(value * times))

    @property
    def coverage_reach(self) -> float:
        """The reach of coverage, whatever is shown."""
        return self._averages[1]

    @cached_property
    def _averages(self) -> tuple[np.ndarray, float]:
        """What coverage is computed from, averaged: its dent density, or itself where dents are marked; and reach."""
        return average_over_discs(
            np.asarray(self.target.cell_centers().points),
            np.asarray(self.target.cell_normals),
            np.asarray(self.target["coverage" if self.marked else "dent_density"]),
            np.asarray(self.target["exposed_area_mm2"]),
            np.asarray(self.target["dents"]),
        )


def colour_range(parts: Sequence[DrawnPart]) -> tuple[float, float]:
    """Round limits that hold nearly all of what is shown on every part."""
    values = np.concatenate([part.target["shown"] for part in parts])
    values = values[np.isfinite(values)]
    if parts[0].quantity.unit != "%":
        return _round_range(*np.percentile(values, [1.0, 99.0])) if len(values) else (0.0, 1.0)
    low, high = np.percentile(values, [1.0, 99.5]) if len(values) else (0.0, 100.0)
    step = 5.0 if high - low < 20.0 else 10.0
    low = max(0.0, step * np.floor(low / step))
    return low, min(100.0, max(low + step, step * np.ceil(high / step)))


def _round_range(low: float, high: float) -> tuple[float, float]:
    """Limits outward to round numbers; 0 where it is not far."""
    span = high - low if high > low else max(abs(high), 1e-12)
    step = 10.0 ** np.floor(np.log10(span)) / 2.0
    low = 0.0 if 0.0 <= low < 0.4 * high else step * np.floor(low / step)
    return float(low), float(max(step * np.ceil(high / step), low + step))

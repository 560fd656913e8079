"""Open a result in the viewer: its surfaces and impacts, checked against its result.json."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.common.number_text import counted
from chamberopt.coverage.coverage_from_impacts import coverage_from_dent_density
from chamberopt.coverage.part_impacts import HITS_FILE, HitsByTriangle, load_matching_hits
from chamberopt.documents.coverage import summary
from chamberopt.pictures.drawn_part import DrawnPart, colour_range
from chamberopt.pictures.quantities import QUANTITIES
from chamberopt.results.arrays_file import ARRAYS_FILE, read_result_arrays
from chamberopt.results.load import Result, unchanged_file
from chamberopt.results.vtp_files import PART, ZONE
from chamberopt.viewer.view_state import ViewState

FULL_SCALE = (0.0, 100.0)  # % of coverage, fixed over time
_REMEDIES = {  # for a quantity that a result lacks
    "almen": "give the design a calibration to strips and simulate again",
    "zones": "give the design [[zones]] and simulate again",
}


@dataclass(frozen=True)
class ResultInfo:
    """The data of a result.json that the viewer needs; they can be sent to a drawing process.

    Attributes:
        treatment_s: peening time [s].
        longest_s: end of the time slider [s].
        sha256: digest of each data file by its name.
        zones: names of the part's zones.
    """

    folder: str
    title: str
    treatment_s: float
    longest_s: float
    sha256: dict[str, str]
    zones: Sequence[str] = ()


def result_info(result: Result) -> ResultInfo:
    """Return the data of a result that the viewer needs to open it."""
    treatment = result.design.process.treatment_time
    times = [row.time_s for row in result.record.coverage_against_time]
    return ResultInfo(
        folder=str(result.folder),
        title=f"{result.folder.resolve().name}\n{summary(result)}",
        treatment_s=treatment,
        longest_s=max([treatment, *times]),
        sha256=result.record.files,
        zones=[zone.name for zone in result.design.zones],
    )


class OpenedResult:
    """The surfaces and impacts of a result, read from its folder and ready to be drawn.

    Raises InputError if files are missing, damaged or of another result.
    """

    def __init__(self, info: ResultInfo) -> None:
        self.info = info
        self.folder = Path(info.folder)
        arrays = read_result_arrays(self._path(ARRAYS_FILE))
        self.surface, self.chamber = arrays.part, arrays.cavity
        self.part = DrawnPart(arrays.field, chamber=self.chamber)
        self._surface_name = arrays.chamber.part.surface_name

    def _path(self, name: str) -> Path:
        return unchanged_file(self.folder, name, self.info.sha256)

    @property
    def quantities(self) -> list[str]:
        there = [*self.part.whole.point_data, *([ZONE] if self.part.zones else [])]
        return [name for name, one in QUANTITIES.items() if one.column in there]

    @cached_property
    def hits(self) -> HitsByTriangle:
        """All impacts on the part, by triangle. As they are many, they are read on first use."""
        return load_matching_hits(self._path(HITS_FILE), np.asarray(self.surface["impacts"]))

    def time_ratio(self, state: ViewState) -> float:
        """Return the shown peening time over the result's treatment time.

        Args:
            state: what the viewer shows.
        """
        return 1.0 if state.time_s is None else state.time_s / self.info.treatment_s

    def show(self, state: ViewState) -> None:
        """Colour the part by the quantity, such as coverage, that the viewer is to show.

        Raises InputError if the result lacks the quantity.
        """
        if state.quantity not in self.quantities:
            remedy = _REMEDIES.get(state.quantity, "simulate again")
            raise InputError(
                f"--quantity {state.quantity}: {self.folder / ARRAYS_FILE} does not have it; "
                f"{remedy}, or choose one of {', '.join(self.quantities)}"
            )
        self.part.show(QUANTITIES[state.quantity], self.time_ratio(state))

    def above_threshold(self, state: ViewState) -> np.ndarray | None:
        """Return True for each triangle of the drawn target that is to be pale.

        The coverage of these triangles is at least `state.below`. The result is None if
        `state.below` is None.
        """
        if state.below is None:
            return None
        return self.part.covered_to(state.below, self.time_ratio(state))

    def describe_triangle(self, triangle: int, state: ViewState) -> list[str]:
        """Return lines of text about a triangle of the part, each with a value such as coverage.

        Raises InputError if there is no such triangle.
        """
        surface = self.surface
        if not 0 <= triangle < surface.n_cells:
            raise InputError(
                f"--triangle {triangle}: {self.folder} has triangles 0 to {surface.n_cells - 1}, "
                f"in the order of {PART}"
            )
        lines = [f"triangle {triangle}, element {surface['element'][triangle]}"]
        if not surface["exposed_area_mm2"][triangle] > 0.0:
            return [*lines, "outside the chamber or hidden"]
        if not surface["target"][triangle]:
            lines.append("not in the target")
        if name := self._surface_name(triangle):
            lines.append(f"surface {name}")
        of_zones = [name for name in self.info.zones if surface[f"{ZONE}_{name}"][triangle]]
        lines += [f"zone {name}" for name in of_zones]
        for name in self.quantities:
            if name == "zones":
                continue
            quantity, value = QUANTITIES[name], self._value(name, triangle, state)
            text = f"{value:.4g} {quantity.unit}" if np.isfinite(value) else "none"
            lines.append(f"{quantity.label}: {text}")
        lines.append(f"exposed area: {surface['exposed_area_mm2'][triangle]:.4g} mm²")
        impacts, dents = surface["impacts"][triangle], surface["dents"][triangle]
        return [*lines, f"simulated: {counted(impacts, 'impact')}, {counted(dents, 'dent')}"]

    def _value(self, name: str, triangle: int, state: ViewState) -> float:
        """Return the mean of a quantity over a triangle of the part, in the quantity's unit."""
        quantity, times = QUANTITIES[name], self.time_ratio(state)
        if name == "coverage" and state.time_s is not None:
            density = self.surface["dent_density"][triangle] * times
            return 100.0 * float(coverage_from_dent_density(density))
        scale = quantity.factor * (times if quantity.grows else 1.0)
        return scale * float(self.surface[quantity.column][triangle])


def common_quantities(results: Sequence[OpenedResult]) -> list[str]:
    """Return the names of the quantities that all results have."""
    return [name for name in QUANTITIES if all(name in one.quantities for one in results)]


def colour_limits(results: Sequence[OpenedResult], state: ViewState) -> tuple[float, float]:
    """Colour all results by the shown quantity; return the ends of the common colour scale."""
    for one in results:
        one.show(state)
    if state.quantity == "zones":
        return 0.0, 1.0  # each zone has a fixed colour
    if state.quantity == "coverage" and state.time_s is not None:
        return FULL_SCALE
    return colour_range([one.part for one in results])


def same_part(results: Sequence[OpenedResult]) -> bool:
    """Return True if the part of all results has the same triangles, wherever it stands."""
    first = results[0].surface
    return all(
        one.surface.n_cells == first.n_cells
        and one.surface.n_points == first.n_points
        and np.array_equal(one.surface.regular_faces, first.regular_faces)
        for one in results[1:]
    )

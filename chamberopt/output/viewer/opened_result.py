"""A result opened to be looked at: its surfaces, checked against what its result.json says, and its single impacts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.coverage.coverage_from_impacts import coverage_from_dent_density
from chamberopt.coverage.part_impacts import HitsByTriangle, load_matching_hits
from chamberopt.output.results.load import Result, require_matching_coverage, summary
from chamberopt.output.viewer.drawn_part import DrawnPart, colour_range
from chamberopt.output.viewer.view_state import ViewState
from chamberopt.output.vtp_files import CHAMBER, COVERAGE, Surface, read_surface
from chamberopt.simulation.triangle_fields import QUANTITIES

LATER = (0.0, 100.0)  # one scale for all times
NEEDED = (
    "coverage",
    "dent_density",
    "impacts_per_mm2",
    "impacts",
    "dents",
    "exposed_area_mm2",
    "target",
)


@dataclass(frozen=True)
class ResultInfo:
    """A result as the window wants it, plain enough for a drawing job.

    treatment_s: its peening time · longest_s: the last time worth looking at · triangles: how many of the target are
    exposed · impacts_per_mm2: at the treatment time, the mean of the target; both as result.json has them.
    """

    folder: str
    title: str
    treatment_s: float
    longest_s: float
    triangles: int
    impacts_per_mm2: float


def result_info(result: Result) -> ResultInfo:
    """Collect what the viewer needs of a result."""
    treatment = result.design.process.treatment_time
    return ResultInfo(
        folder=str(result.folder),
        title=f"{result.folder.resolve().name}\n{summary(result)}",
        treatment_s=treatment,
        longest_s=max(
            [treatment, *(row["time_s"] for row in result.data.get("coverage_against_time", []))]
        ),
        triangles=result.data["chamber"]["target_triangles"],
        impacts_per_mm2=result.metrics["impacts_per_mm2_s"].value * treatment,
    )


class OpenedResult:
    """A result opened. Raises InputError where files are missing or damaged, or are another result's."""

    def __init__(self, subject: ResultInfo) -> None:
        self.subject = subject
        self.folder = Path(subject.folder)
        self.surface = _with_columns(self.folder / COVERAGE, NEEDED)
        self.chamber = _with_columns(self.folder / CHAMBER, ("tag",))
        self.part = DrawnPart(self.surface)
        require_matching_coverage(
            self.folder, self.surface, subject.triangles, subject.impacts_per_mm2
        )

    @property
    def offered(self) -> list[str]:
        """The quantities it has."""
        return [name for name, one in QUANTITIES.items() if one.column in self.surface.cell_data]

    @cached_property
    def hits(self) -> HitsByTriangle | None:
        """Its single impacts, None where it has none. Read when first asked for: they are most of a result."""
        return load_matching_hits(self.folder, np.asarray(self.surface["impacts"]))

    def times(self, look: ViewState) -> float:
        """The time looked at in treatment times. InputError where dents are marked: their coverage has one time."""
        if look.time_s is None:
            return 1.0
        if self.part.marked and look.quantity == "coverage":
            raise InputError(
                f"--time-s: not supported for {self.folder}: its dents are marked one by one, at the treatment time of "
                f"{self.subject.treatment_s:g} s; simulate with that treatment time"
            )
        return look.time_s / self.subject.treatment_s

    def show(self, look: ViewState) -> None:
        """The quantity looked at becomes the part's "shown". InputError where the result does not have it."""
        if look.quantity not in self.offered:
            raise InputError(
                f"--quantity {look.quantity}: {self.folder / COVERAGE} does not have it: an older result, or an "
                "analytic one, which has no single impacts; simulate again"
            )
        self.part.show(QUANTITIES[look.quantity], self.times(look))

    def passed(self, look: ViewState) -> np.ndarray:
        """Triangles of the target that are covered as far as the threshold or farther, bool."""
        if look.below is None:
            return np.zeros(self.part.target.n_cells, dtype=bool)
        times = 1.0 if self.part.marked else self.times(look)
        return np.asarray(self.part.values(QUANTITIES["coverage"], times) >= look.below)

    def numbers(self, triangle: int, look: ViewState) -> list[str]:
        """All there is to say of a triangle, a line each. InputError where there is no such triangle."""
        if not 0 <= triangle < self.surface.n_cells:
            raise InputError(
                f"--triangle {triangle}: {self.folder} has triangles 0 to {self.surface.n_cells - 1}, in the order of "
                f"{COVERAGE}"
            )
        element = (
            f", element {self.surface['element'][triangle]}"
            if "element" in self.surface.cell_data
            else ""
        )
        lines = [f"triangle {triangle}{element}"]
        if not self.surface["exposed_area_mm2"][triangle] > 0.0:
            return [*lines, "outside the chamber or hidden"]
        if not self.surface["target"][triangle]:
            lines.append("not in the target")
        for name in self.offered:
            one, value = QUANTITIES[name], self._value(name, triangle, look)
            lines.append(
                f"{one.label}: {f'{value:.4g} {one.unit}' if np.isfinite(value) else 'none'}"
            )
        lines.append(f"exposed area: {self.surface['exposed_area_mm2'][triangle]:.4g} mm²")
        lines.append(
            f"simulated: {self.surface['impacts'][triangle]} impacts, {self.surface['dents'][triangle]} dents"
        )
        return lines

    def _value(self, name: str, triangle: int, look: ViewState) -> float:
        """The triangle's own, nothing averaged."""
        one = QUANTITIES[name]
        if name == "coverage" and not self.part.marked:
            density = self.surface["dent_density"][triangle] * self.times(look)
            return 100.0 * float(coverage_from_dent_density(density))
        return (
            one.factor
            * float(self.surface[one.column][triangle])
            * (self.times(look) if one.grows else 1.0)
        )


def _with_columns(path: Path, names: Sequence[str]) -> Surface:
    surface = read_surface(path)
    missing = [name for name in names if name not in surface.cell_data]
    if missing:
        raise InputError(
            f"{path}: has no {missing[0]}, so it is not the file that was written here; simulate again"
        )
    return surface


def offered(seen: Sequence[OpenedResult]) -> list[str]:
    """The quantities that all of them have."""
    return [name for name in QUANTITIES if all(name in one.offered for one in seen)]


def limits(seen: Sequence[OpenedResult], look: ViewState) -> tuple[float, float]:
    """The colour scale of what they all show."""
    for one in seen:
        one.show(look)
    return (
        LATER
        if look.quantity == "coverage" and look.time_s is not None
        else colour_range([s.part for s in seen])
    )


def same_part(seen: Sequence[OpenedResult]) -> bool:
    """Whether their triangles are the same ones, each in its place on the part: not if only a chamber differs."""
    first = seen[0].surface
    return all(
        one.surface.n_cells == first.n_cells
        and one.surface.n_points == first.n_points
        and np.array_equal(one.surface.regular_faces, first.regular_faces)
        for one in seen[1:]
    )

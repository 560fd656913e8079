"""A result opened to be looked at: what its window is told of it, and its part's surface, checked to be its own."""

from __future__ import annotations

from chamberopt.output.results.results import Result, summary
from chamberopt.output.viewer import COVERAGE, Subject, read_surface
from chamberopt.output.viewer.opened_result import require_own
from chamberopt.output.vtp_files import Surface


def subject(result: Result) -> Subject:
    """A result as inspect's window wants it."""
    treatment = result.design.process.treatment_time
    return Subject(
        folder=str(result.folder),
        title=f"{result.folder.resolve().name}\n{summary(result)}",
        treatment_s=treatment,
        longest_s=max(
            [treatment, *(row["time_s"] for row in result.data.get("coverage_against_time", []))]
        ),
        triangles=result.data["chamber"]["target_triangles"],
        impacts_per_mm2=result.metrics["impacts_per_mm2_s"].value * treatment,
    )


def own_coverage(result: Result) -> Surface:
    """Its coverage.vtp. InputError when that is not there, damaged, or another result's."""
    surface = read_surface(result.folder / COVERAGE)
    require_own(subject(result), surface)
    return surface

"""Write the folder of a comparison."""

from __future__ import annotations

from pathlib import Path

from chamberopt.common.errors import InputError
from chamberopt.common.files import make_folder, write_text
from chamberopt.documents.comparison import comparison_text
from chamberopt.pictures.comparison import draw_distributions
from chamberopt.pictures.coverage import draw_coverage
from chamberopt.pictures.difference import draw_difference, write_differences
from chamberopt.results.command_records import comparison_record, write_record
from chamberopt.results.compare.comparison import Comparison, require_same_triangles
from chamberopt.results.compare.distributions import distributions
from chamberopt.results.compare.local_difference import (
    LocalDifference,
    local_difference,
    read_target_surface,
)
from chamberopt.results.load import summary
from chamberopt.results.vtp_files import CHAMBER, COVERAGE

COMPARE, DIFFERENCE = "compare.json", "difference.vtp"


def write_comparison(folder: str | Path, comparison: Comparison) -> list[str]:
    """Write a comparison into a folder and return remarks, such as why an image was skipped.

    compare.txt: the comparison as text.
    compare.png: the parts side by side on one colour scale.
    distributions.png: histograms of the candidates.
    difference.vtp, difference.png: coverage of each later candidate minus coverage of the first.
    compare.json: the record, which is written last.
    """
    folder = Path(folder)
    if (folder / COMPARE).exists():
        raise InputError(
            f"{folder}: holds a comparison, and nothing is ever overwritten: choose another folder"
        )
    for result in comparison.results:
        result.path(CHAMBER)  # read for the picture at the end; the other surfaces are read next
    surfaces = [read_target_surface(result) for result in comparison.results]
    for result, one in zip(comparison.results[1:], surfaces[1:], strict=True):
        require_same_triangles(
            result.folder, one.target, comparison.results[0].folder, surfaces[0].target
        )
    make_folder(folder)
    write_text(folder / "compare.txt", comparison_text(comparison) + "\n")
    spread = distributions(surfaces)
    draw_distributions(folder / "distributions.png", comparison, spread)
    remarks = [comparison_picture(folder / "compare.png", comparison)]
    local = [local_difference(surfaces[0], other) for other in surfaces[1:]]
    remarks.append(_draw_differences(folder, comparison, local))
    write_record(folder / COMPARE, comparison_record(comparison, spread, local))
    return [text for text in remarks if text]


def comparison_picture(picture: str | Path, comparison: Comparison) -> str | None:
    """Draw the parts side by side on one colour scale. Return why there is no image, or None."""
    titles = [
        f"{label}\n{summary(result)}"
        for label, result in zip(comparison.labels, comparison.results, strict=True)
    ]
    return draw_coverage([result.folder for result in comparison.results], titles, picture)


def _draw_differences(
    folder: Path, comparison: Comparison, local: list[LocalDifference]
) -> str | None:
    """Write the map of differences and draw it. Return why there is no image, or None."""
    first, *later = comparison.labels
    columns = [(one.value, one.real) for one in local]
    write_differences(folder / DIFFERENCE, comparison.results[0].folder / COVERAGE, columns)
    titles = []
    for label, one in zip(later, local, strict=True):
        over = f"; averaged over {one.radius:.1f} mm" if one.radius else ""
        shares = f"more on {one.more:.0%}, less on {one.less:.0%} of the target{over}"
        shares = shares.replace("%", " %")
        titles.append(f"{label} minus {first}\n{shares}")
    return draw_difference(folder / DIFFERENCE, titles, folder / "difference.png")

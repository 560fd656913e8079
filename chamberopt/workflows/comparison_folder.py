"""Compare candidates and write the folder of the comparison: text, JSON and pictures."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from contextlib import AbstractContextManager
from pathlib import Path

from chamberopt.common.errors import InputError
from chamberopt.common.files import make_folder, write_text
from chamberopt.documents.comparison import comparison_lines
from chamberopt.documents.coverage import summary
from chamberopt.pictures.comparison import draw_distributions
from chamberopt.pictures.coverage import draw_coverage
from chamberopt.pictures.difference import draw_difference, write_differences
from chamberopt.printers import terminal
from chamberopt.results.command_records import comparison_record, write_record
from chamberopt.results.compare.comparison import Comparison, comparison_of, require_same_triangles
from chamberopt.results.compare.distributions import distributions
from chamberopt.results.compare.local_difference import (
    LocalDifference,
    local_difference,
    read_target_surface,
)
from chamberopt.workflows.compared_candidates import read_candidates, simulate_missing
from chamberopt.workflows.simulate import Teller

COMPARE, DIFFERENCE = "compare.json", "difference.vtp"


def compare_candidates(
    paths: Sequence[str | Path],
    folder: Path,
    open_workers: Callable[[], AbstractContextManager[Executor]],
    teller: Teller,
    treatment_time_s: float | None = None,
) -> tuple[Comparison, list[str]]:
    """Compare designs and results with the first of them, and write the comparison into a folder.

    Args:
        paths: design files, which are simulated, and results folders.
        open_workers: starts the executor; called only if a candidate has to be simulated.
        treatment_time_s: peening time of all candidates; results of another time are simulated
            again.

    Returns:
        The comparison, and remarks for the user.
    """
    with teller.step("reading and building"):
        candidates = read_candidates(paths, treatment_time_s)
    results = [one.result for one in candidates if one.result is not None]
    remarks: list[str] = []
    if any(one.missing for one in candidates):
        with open_workers() as executor:
            results, remarks = simulate_missing(candidates, folder, executor, teller)
    for text in remarks:
        teller.tell(text)
    with teller.step("comparing and drawing"):
        comparison = comparison_of(results, [one.label for one in candidates])
        return comparison, write_comparison(folder, comparison)


def write_comparison(folder: str | Path, comparison: Comparison) -> list[str]:
    """Write a comparison into a folder and return remarks, such as why an image was skipped.

    compare.txt: the comparison as text.
    compare.png: the parts side by side on one colour scale.
    distributions.png: histograms of the candidates.
    difference.vtp, difference.png: coverage of each later candidate minus coverage of the first.
    compare.json: all figures and differences. It is written last.
    """
    folder = Path(folder)
    if (folder / COMPARE).exists():
        raise InputError(
            f"{folder}: holds a comparison, and nothing is ever overwritten: choose another folder"
        )
    surfaces = [read_target_surface(result) for result in comparison.results]
    for result, one in zip(comparison.results[1:], surfaces[1:], strict=True):
        require_same_triangles(
            result.folder, one.target, comparison.results[0].folder, surfaces[0].target
        )
    make_folder(folder)
    write_text(folder / "compare.txt", terminal.text(comparison_lines(comparison)) + "\n")
    spread = distributions(surfaces)
    draw_distributions(folder / "distributions.png", comparison, spread)
    remarks = [comparison_picture(folder / "compare.png", comparison)]
    local = [local_difference(surfaces[0], other) for other in surfaces[1:]]
    remarks.append(_draw_differences(folder, comparison, local))
    write_record(folder / COMPARE, comparison_record(comparison, spread, local))
    return [text for text in remarks if text]


def comparison_picture(picture: str | Path, comparison: Comparison) -> str | None:
    """Draw the compared parts side by side on one colour scale.

    Return the reason if no image could be drawn, else None.
    """
    titles = [
        f"{label}\n{summary(result)}"
        for label, result in zip(comparison.labels, comparison.results, strict=True)
    ]
    return draw_coverage([result.folder for result in comparison.results], titles, picture)


def _draw_differences(
    folder: Path, comparison: Comparison, local: list[LocalDifference]
) -> str | None:
    """Write and draw the coverage of later candidates minus coverage of the first (difference.vtp).

    Return the reason if no image could be drawn, else None.
    """
    columns = [(one.value, one.real, one.told) for one in local]
    write_differences(folder / DIFFERENCE, comparison.results[0].folder, columns)
    return _draw_local(folder / "difference.png", comparison, local)


def draw_differences(picture: Path, comparison: Comparison) -> str | None:
    """Draw the coverage of later results minus coverage of the first, for a narrow page.

    Return the reason if no image could be drawn, else None.
    """
    first, *others = (read_target_surface(result) for result in comparison.results)
    for result, one in zip(comparison.results[1:], others, strict=True):
        require_same_triangles(
            result.folder, one.target, comparison.results[0].folder, first.target
        )
    local = [local_difference(first, other) for other in others]
    return _draw_local(picture, comparison, local, one_below_other=True)


def _draw_local(
    picture: Path,
    comparison: Comparison,
    local: Sequence[LocalDifference],
    one_below_other: bool = False,
) -> str | None:
    first, *later = comparison.labels
    columns = [(one.value, one.real, one.told) for one in local]
    titles = []
    for label, one in zip(later, local, strict=True):
        low, high = (f"{radius:.1f}" for radius in one.radii)
        radii = high if low == high else f"{low} to {high}" if low != "0.0" else f"up to {high}"
        over = f"; averaged over radii of {radii}\N{NO-BREAK SPACE}mm" if high != "0.0" else ""
        shares = f"more on {one.more:.0%}, less on {one.less:.0%} of the target{over}"
        shares = shares.replace("%", "\N{NO-BREAK SPACE}%")
        titles.append(f"{label} minus {first}\n{shares}")
    first_folder = comparison.results[0].folder
    return draw_difference(first_folder, columns, titles, picture, one_below_other)

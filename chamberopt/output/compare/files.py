"""What a comparison leaves in its folder."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from chamberopt.common.errors import InputError
from chamberopt.common.files import write_text
from chamberopt.output.compare.comparison import Comparison
from chamberopt.output.compare.covered import covered
from chamberopt.output.compare.distributions import distributions
from chamberopt.output.compare.inputs import require_same_triangles
from chamberopt.output.compare.local import LocalDifference, local_difference
from chamberopt.output.compare.pictures import draw_distributions
from chamberopt.output.compare.table import as_text
from chamberopt.output.results.load import summary
from chamberopt.output.viewer import draw_coverage, draw_difference, write_differences
from chamberopt.output.vtp_files import COVERAGE

COMPARE, DIFFERENCE = "compare.json", "difference.vtp"


def write_comparison(folder: str | Path, comparison: Comparison) -> list[str]:
    """Leave a comparison in a folder that has none; returns remarks, such as why a picture was skipped.

    compare.txt · compare.png, the parts side by side on one colour scale · distributions.png · difference.vtp and .png,
    each later candidate's coverage less the first's · compare.json, the last.
    """
    folder = Path(folder)
    if (folder / COMPARE).exists():
        raise InputError(
            f"{folder}: holds a comparison, and results are never overwritten: choose another folder"
        )
    seen = [covered(result) for result in comparison.results]
    for result, one in zip(comparison.results[1:], seen[1:], strict=True):
        require_same_triangles(
            result.folder, one.target, comparison.results[0].folder, seen[0].target
        )
    folder.mkdir(parents=True, exist_ok=True)
    write_text(folder / "compare.txt", as_text(comparison) + "\n")
    spread = distributions(seen)
    draw_distributions(folder / "distributions.png", comparison, spread)
    remarks = [comparison_picture(folder / "compare.png", comparison)]
    local: list[LocalDifference] | None = None
    if older := [
        label for label, one in zip(comparison.labels, seen, strict=True) if one.hits is None
    ]:
        remarks.append(
            f"difference.png skipped: {', '.join(older)}: no single impacts (hits.npz), results of an older version; "
            "simulate again"
        )
    else:
        local = [local_difference(seen[0], other) for other in seen[1:]]
        remarks.append(_draw_differences(folder, comparison, local))
    about: dict[str, Any] = comparison.as_json() | {"distributions": spread.as_json()}
    about["local_differences_to_first"] = (
        None if local is None else [one.as_json() for one in local]
    )
    write_text(folder / COMPARE, json.dumps(about, indent=2, allow_nan=False) + "\n")
    return [text for text in remarks if text]


def comparison_picture(picture: str | Path, comparison: Comparison) -> str | None:
    """The parts side by side on one colour scale, as .png; returns None or one line why there is none."""
    titles = [
        f"{label}\n{summary(result)}"
        for label, result in zip(comparison.labels, comparison.results, strict=True)
    ]
    return draw_coverage([result.folder for result in comparison.results], titles, picture)


def _draw_differences(
    folder: Path, comparison: Comparison, local: list[LocalDifference]
) -> str | None:
    """The map, as a surface and as a picture; None or one line why there is no picture."""
    first, *later = comparison.labels
    columns = [(one.value, one.real) for one in local]
    write_differences(folder / DIFFERENCE, comparison.results[0].folder / COVERAGE, columns)
    titles = []
    for label, one in zip(later, local, strict=True):
        over = f"; averaged over {one.reach:.1f} mm" if one.reach else ""
        shares = f"more on {100.0 * one.more:.0f} %, less on {100.0 * one.less:.0f} % of the target{over}"
        titles.append(f"{label} less {first}\n{shares}")
    return draw_difference(folder / DIFFERENCE, titles, folder / "difference.png")

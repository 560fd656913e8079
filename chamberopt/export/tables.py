"""Write tables for spreadsheets: effects of tolerances, and evaluations of a study or sweep."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from chamberopt.common.errors import InputError
from chamberopt.common.files import csv_text, write_text
from chamberopt.results.load import load_result, load_trials
from chamberopt.search.trial_log import trials_as_csv

if TYPE_CHECKING:
    from chamberopt.common.estimate import Estimate


def write_study_table(folder: Path, file: Path) -> None:
    """Write the evaluations that a study or sweep has so far as .csv.

    The column NAME_pm is the 95 % half-width of the column NAME.

    Raises:
        InputError: there are no evaluations.
    """
    write_text(file, trials_as_csv(load_trials(folder)))


def write_tolerance_table(folder: Path, file: Path) -> None:
    """Write the effects of tolerances as .csv.

    There is a row for each figure, such as mean coverage, and each toleranced number of the design.

    Raises InputError for a result without tolerances.
    """
    result = load_result(folder)
    found = result.record.tolerances
    if not found:
        remedy = "simulate a design that has [tolerances] with --tolerances"
        raise InputError(f"{folder}: this result is without tolerances; {remedy}")
    rows = []
    for name, figure in found.figures.items():
        corner = figure.corner
        values: dict[str, Estimate | None] = {
            "nominal": figure.nominal,
            "q05": figure.q05,
            "q95": figure.q95,
            "lowest": figure.lowest,
            "highest": figure.highest,
            "worst_corner_simulated": corner.simulated if corner else None,
            "worst_corner_predicted": corner.predicted if corner else None,
        }
        for number, ends in figure.effects.items():
            box = found.box[number]
            row: dict[str, Any] = {"figure": name, "number": number}
            row |= {"low": box.low, "high": box.high}
            changes = {"change_at_low": ends.low, "change_at_high": ends.high}
            for key, interval in (changes | values).items():
                row[key] = interval and interval.value
                row[f"{key}_half_width"] = interval and interval.half_width
            rows.append(row)
    write_text(file, csv_text(rows))

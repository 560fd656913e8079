"""What the tolerances of a result do, as a table."""

from __future__ import annotations

from pathlib import Path

from chamberopt.common.errors import InputError
from chamberopt.common.files import csv_text, write_text
from chamberopt.output.results.load import load_result

FIGURES = ("nominal", "q05", "q95", "lowest", "highest")


def write_tolerance_table(folder: Path, file: Path) -> None:
    """Write a row for each figure and number; InputError for a result without tolerances."""
    result = load_result(folder)
    found = result.data.get("tolerances")
    if not found:
        remedy = "simulate a design that has [tolerances] with --tolerances"
        raise InputError(f"{folder}: this result is without tolerances; {remedy}")
    rows = []
    for name, figure in found["figures"].items():
        corner = figure["corner"] or {}
        values = {key: figure[key] for key in FIGURES}
        values |= {f"worst_corner_{key}": corner.get(key) for key in ("simulated", "predicted")}
        for number, ends in figure["effects"].items():
            row = {"figure": name, "number": number}
            row |= {key: found["box"][number][key] for key in ("low", "high")}
            changes = {f"change_at_{end}": ends[end] for end in ("low", "high")}
            for key, interval in (changes | values).items():
                row |= {
                    key: interval and interval["value"],
                    f"{key}_half_width": interval and interval["half_width"],
                }
            rows.append(row)
    write_text(file, csv_text(rows))

"""Write tables for spreadsheets: effects of tolerances, and evaluations of a study or sweep."""

from __future__ import annotations

from pathlib import Path

from chamberopt.common.files import csv_text, write_text
from chamberopt.documents.tolerances import table_rows
from chamberopt.results.load import load_result, load_trials
from chamberopt.search.trial_log import read_seconds, trials_as_csv


def write_study_table(folder: Path, file: Path) -> None:
    """Write the evaluations that a study or sweep has so far as .csv.

    The column NAME_pm is the 95 % half-width of the column NAME.

    Raises:
        InputError: there are no evaluations.
    """
    write_text(file, trials_as_csv(load_trials(folder), read_seconds(folder)))


def write_tolerance_table(folder: Path, file: Path) -> None:
    """Write the effects of tolerances as .csv.

    There is a row for each figure, such as mean coverage, and each toleranced number of the design.

    Raises InputError for a result without tolerances.
    """
    write_text(file, csv_text(list(table_rows(load_result(folder)))))

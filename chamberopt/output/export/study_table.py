"""A study or sweep as a table, finished or not: a row an evaluation, NAME_pm the 95 % half-width of NAME."""

from pathlib import Path

from chamberopt.common.files import write_text
from chamberopt.optimize.storage.trial_log import read_trials, trials_as_csv


def write_study_table(folder: Path, file: Path) -> None:
    """The evaluations in a study's folder so far, as .csv. InputError where there are none."""
    write_text(file, trials_as_csv(read_trials(folder)))

"""The evaluations of a study or sweep as a table; NAME_pm is the 95 % half-width of NAME."""

from pathlib import Path

from chamberopt.common.files import write_text
from chamberopt.optimize.storage.trial_log import trials_as_csv
from chamberopt.output.results.load import load_trials


def write_study_table(folder: Path, file: Path) -> None:
    """Write the evaluations recorded so far as .csv; InputError where there are none."""
    write_text(file, trials_as_csv(load_trials(folder)))

"""Save a calibration: machine.toml for designs, text to read, the record as JSON, a picture."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from chamberopt.common.files import write_text
from chamberopt.design.load import save_design
from chamberopt.documents.calibration import calibration_lines, calibration_notes
from chamberopt.peening.next_measurement import predict
from chamberopt.pictures.charts.calibration import calibration_picture
from chamberopt.results.command_records import calibration_record, write_record

if TYPE_CHECKING:
    from chamberopt.design.calibration import Calibration
    from chamberopt.peening.calibrate import Calibrated

MACHINE = "machine.toml"
HEADER = """\
# A machine, as chamberopt calibrate found it. A design takes it by
#     calibration = "machine.toml"
# log_mean and log_covariance are of natural logarithms, in the order of parameters: factors on the
# numbers of a design, and K [mmA per mm of strength].
"""


def save_calibration(folder: Path, found: Calibrated) -> list[str]:
    """Write machine.toml, design.toml and calibration.txt, .png and .json into a folder.

    Returns:
        The lines of calibration.txt.
    """
    predictions = predict(found)
    lines = calibration_lines(found, predictions)
    calibrated = found.design.model_copy(update={"calibration": found.table})
    save_design(calibrated, folder / "design.toml")
    write_text(folder / MACHINE, machine_text(found.table))
    write_text(folder / "calibration.txt", "\n".join(lines) + "\n")
    calibration_picture(folder / "calibration.png", found)
    record = calibration_record(found, predictions, calibration_notes(found))
    write_record(folder / "calibration.json", record)
    return lines


def machine_text(table: Calibration) -> str:
    """The content of machine.toml."""
    import tomlkit

    return HEADER + tomlkit.dumps(table.model_dump())

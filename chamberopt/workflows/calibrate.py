"""Calibrate the model to a machine and save machine.toml for designs, text, JSON and a picture."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from chamberopt.common.files import private_folder, write_text
from chamberopt.design.load import save_design
from chamberopt.documents.calibration import calibration_lines, calibration_notes
from chamberopt.peening.calibrate import calibrate, prepare
from chamberopt.peening.next_measurement import predict
from chamberopt.peening.profile_fit import calibrate_law
from chamberopt.pictures.charts.calibration import calibration_picture
from chamberopt.results.command_records import calibration_record, write_record

if TYPE_CHECKING:
    from collections.abc import Mapping
    from concurrent.futures import Executor

    from chamberopt.design.calibration import Calibration
    from chamberopt.design.load import Design
    from chamberopt.peening.calibrate import Calibrated
    from chamberopt.peening.measured import Measured
    from chamberopt.peening.next_measurement import Prediction
    from chamberopt.workflows.simulate import Teller

MACHINE = "machine.toml"
HEADER = """\
# A machine, as chamberopt calibrate found it. A design takes it by
#     calibration = "machine.toml"
# log_mean and log_covariance are of natural logarithms, in the order of parameters: factors on the
# numbers of a design, and K [mmA per mm of strength].
"""


def calibrate_machine(
    measured: Measured,
    designs: Mapping[str, Design],
    folder: Path,
    executor: Executor,
    teller: Teller,
) -> tuple[Calibrated, list[Prediction]]:
    """Calibrate the model to measurements, and save the machine in a new or empty folder.

    Args:
        measured: the measurements, from load_measured.
        designs: the designs that were measured, by name, from load_measured.

    Returns:
        The calibration, and what it predicts of its design.
    """
    with teller.step("building the chambers"), private_folder() as lids:
        prepared = prepare(measured, designs, Path(lids))
    for one in prepared.setups:
        teller.compile(one.design, one.chamber, None)
    with teller.step("simulations") as progress:
        found = calibrate(measured, designs, prepared, executor, progress)
    if measured.profile:
        with teller.step("profiles of residual stress"):
            table = calibrate_law(measured, designs, found.table, executor)
            found = replace(found, table=table)
    with teller.step("writing and drawing"):
        predictions = save_calibration(folder, found)
    return found, predictions


def save_calibration(folder: Path, found: Calibrated) -> list[Prediction]:
    """Write machine.toml, design.toml and calibration.txt, .png and .json of a calibration.

    Returns:
        What the calibration predicts of its design.
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
    return predictions


def machine_text(table: Calibration) -> str:
    """Return the content of machine.toml for a calibration."""
    import tomlkit

    return HEADER + tomlkit.dumps(table.model_dump())

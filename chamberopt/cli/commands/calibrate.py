"""The command `calibrate`: estimate the parameters of a machine from measurements on it."""

from __future__ import annotations

from pathlib import Path

from chamberopt.cli import console
from chamberopt.cli.options import Cluster, Json, Out, Verbose, Workers, app


@app.command
def calibrate(
    measured: Path,
    /,
    *,
    workers: Workers = None,
    cluster: Cluster = None,
    json: Json = False,
    out: Out = None,
    verbose: Verbose = False,
) -> None:
    """Calibrate the model to a machine: strips, coupons, ball drops, amplitude, impact rates.

    The result's machine.toml is for designs: calibration = "machine.toml". From then on they have
    an Almen intensity, and intervals that hold what the calibration leaves open.

    Parameters
    ----------
    measured
        File of measurements (.toml), see docs/how_to/calibrate.md.
    """
    from chamberopt.cli.teller import TerminalTeller
    from chamberopt.common.executor import open_executor
    from chamberopt.documents.calibration import calibration_end
    from chamberopt.peening.measured import load_measured
    from chamberopt.workflows.calibrate import MACHINE, calibrate_machine

    loaded, designs = load_measured(measured)
    with (
        console.results_folder(out, measured.stem) as folder,
        open_executor(workers, cluster) as executor,
    ):
        found, known = calibrate_machine(loaded, designs, folder, executor, TerminalTeller())
    console.print_result(calibration_end(found, known, verbose), folder, json, "calibration.json")
    if not json:
        console.show([f'next: in your designs, calibration = "{folder / MACHINE}"'])

"""The command `calibrate`: the parameters of a machine, from measurements on it."""

from __future__ import annotations

from pathlib import Path

from chamberopt.cli import console
from chamberopt.cli.options import Cluster, Json, Out, Workers, app
from chamberopt.cli.prepare import compile_with_message


@app.command
def calibrate(
    measured: Path,
    /,
    *,
    workers: Workers = None,
    cluster: Cluster = None,
    json: Json = False,
    out: Out = None,
) -> None:
    """Calibrate the model to a machine: strips, coupons, ball drops, amplitude, impact rates.

    The result's machine.toml is for designs: calibration = "machine.toml". From then on they have
    an Almen intensity, and intervals that hold what the calibration leaves open.

    Parameters
    ----------
    measured
        File of measurements (.toml), see docs/peening.md.
    """
    from chamberopt.common.executor import open_executor
    from chamberopt.common.files import private_folder
    from chamberopt.common.progress import step
    from chamberopt.peening.calibrate import calibrate as find
    from chamberopt.peening.calibrate import prepare
    from chamberopt.peening.measured import load_measured
    from chamberopt.workflows.save_calibration import save_calibration

    loaded, designs = load_measured(measured)
    with (
        console.results_folder(out, measured.stem) as folder,
        open_executor(workers, cluster) as executor,
    ):
        with step("building the chambers"), private_folder() as lids:
            prepared = prepare(loaded, designs, Path(lids))
        for one in prepared.setups:
            compile_with_message(one.design, one.chamber)
        with step("simulations") as progress:
            found = find(loaded, designs, prepared, executor, progress)
        with step("writing and drawing"):
            lines = save_calibration(folder, found)
    console.print_result(lines, folder, json, "calibration.json")

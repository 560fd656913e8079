"""A result of the shipped plate, really simulated and short, for what simulates results again."""

from pathlib import Path
from unittest.mock import patch

from chamberopt.chamber.build import build_chamber
from chamberopt.common.executor import SerialExecutor
from chamberopt.results.load import Result, load_result
from chamberopt.simulation.evaluate import evaluate
from chamberopt.workflows import save_run
from chamberopt.workflows.save_run import save_simulation
from tests.helpers.synthetic import plate_design


def plate_result(folder: Path) -> Result:
    """Three replicas of 0.3 s, in a new folder, without its picture."""
    design = plate_design(
        process__accuracy__simulated_time_s=0.3,
        process__accuracy__warmup_time_s=0.05,
        process__accuracy__replicas=3,
    )
    chamber = build_chamber(design)
    with patch.object(save_run, "draw_coverage", lambda *_: None):
        save_simulation(folder, design, chamber, evaluate(design, chamber, SerialExecutor()))
    return load_result(folder)

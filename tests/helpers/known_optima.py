"""Studies of functions whose optimum is known: a bowl and a hill over the bounds of the gear."""

from pathlib import Path

import numpy as np

from chamberopt.common.executor import SerialExecutor
from chamberopt.design.load import load_design
from chamberopt.search.study import Study
from tests.helpers.studies import run_in_folder
from tests.helpers.synthetic import DESIGNS

GEAR = load_design(DESIGNS / "gear.toml")
VARY = {"chamber.height_mm": (35.0, 60.0), "shot.mass_g": (2.0, 10.0)}
NO_FRILLS = {"first_replicas": 0, "confirm_rounds": 1, "batch": 1}


def bowl_shares(design) -> np.ndarray:
    low, high = np.array(list(VARY.values())).T
    return (np.array([design.value(name) for name in VARY]) - low) / (high - low)


def run_bowl(
    folder: Path,
    simulator,
    optimizer: dict | None = None,
    design=GEAR,
    at_once=None,
    progress=None,
    **tables,
):
    settings = {
        "evaluations": 16,
        "confirm": 2,
        "confirm_replicas": 4,
        **NO_FRILLS,
        **(optimizer or {}),
    }
    return run_in_folder(
        Study(design=design, vary=VARY, optimizer=settings, **tables),
        folder,
        SerialExecutor(),
        progress,
        simulator,
        at_once=at_once,
    )


def bowl(x: np.ndarray) -> float:
    return 0.8 - float(((x - [0.7, 0.3]) ** 2).sum())


OPTIMUM = np.array([0.7, 0.3, 0.55])  # in shares of the bounds


PEAK = 0.8


def hill(x: np.ndarray) -> float:
    """One broad hill, steeper across than along, PEAK at OPTIMUM."""
    return PEAK - float(((x - OPTIMUM) ** 2 * [0.6, 1.5, 0.8]).sum())

"""A study of milliseconds that can be stopped anywhere.

Its simulator logs every call, and its answer is known.
"""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.common.executor import SerialExecutor
from chamberopt.design.load import Design, load_design
from chamberopt.search.run_study import StudyResult
from chamberopt.search.study import Study
from chamberopt.search.trial_log import JsonLines
from chamberopt.simulation.evaluation import Evaluation
from tests.helpers.studies import run_in_folder
from tests.helpers.synthetic import DESIGNS, judged

GEAR = load_design(DESIGNS / "gear.toml")
BOUNDS = {
    "chamber.height_mm": (35.0, 60.0),
    "chamber.sonotrode_distance_mm": (5.0, 25.0),
    "shot.mass_g": (2.0, 10.0),
}
CALLS = "calls.log"


def study(**optimizer: object) -> Study:
    """One call of the simulator a row, and one after another, unless asked otherwise."""
    once = {"first_replicas": 0, "confirm_rounds": 1, "batch": 1}
    settings = {"evaluations": 16, "confirm": 3, "confirm_replicas": 4, **once, **optimizer}
    return Study(design=GEAR, vary=BOUNDS, optimizer=settings)


def values(design: Design) -> dict[str, float]:
    return {name: design.value(name) for name in BOUNDS}


def noisy_hill(at: dict[str, float], stream: str, replicas: int | None) -> Evaluation:
    """A broad hill with noise that the candidate decides; one corner of the box cannot be built."""
    low, high = np.array(list(BOUNDS.values())).T
    x = (np.array(list(at.values())) - low) / (high - low)
    if x[0] > 0.9 and x[1] > 0.5:
        raise InputError("chamber.height_mm: too high for this test")
    rng = np.random.default_rng([int.from_bytes(x.tobytes(), "big") % 2**63, len(stream)])
    height = 0.8 - float(((x - [0.7, 0.3, 0.55]) ** 2 * [0.6, 1.5, 0.8]).sum())
    return judged(height + 0.02 * rng.normal(size=replicas or 4), mean_coverage=float(x[2]) / 3.0)


def logged(log: Path) -> Callable:
    """The same, each call first a row of `log`."""
    calls = JsonLines(log, survives_power_cut=False)

    def simulator(design: Design, stream: str, replicas: int | None) -> Evaluation:
        at = values(design)
        calls.append({"stage": stream, "parameters": at})
        return noisy_hill(at, stream, replicas)

    return simulator


def run(question: Study, folder: Path, **more: object) -> StudyResult:
    """In `folder`, with the log of the simulator's calls beside it."""
    more.setdefault("simulator", logged(folder.with_name(f"{folder.name}-{CALLS}")))
    return run_in_folder(question, folder, SerialExecutor(), **more)


def calls(folder: Path) -> list[dict]:
    """What was evaluated for a folder, in order, whether or not it came on record."""
    return JsonLines(folder.with_name(f"{folder.name}-{CALLS}")).rows()


def history(folder: Path) -> bytes:
    return (folder / "history.jsonl").read_bytes()

"""Results folders for reports: a simulation and a study of the plate with random dents."""

import os
import shutil
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from chamberopt.chamber.build import Chamber, build_chamber
from chamberopt.common.errors import InputError
from chamberopt.common.executor import SerialExecutor
from chamberopt.search.study import Study
from chamberopt.workflows.save_run import save_simulation, save_study
from tests.helpers.studies import run_in_folder
from tests.helpers.synthetic import plate_design, poisson_evaluation

DESIGN = plate_design(process__accuracy__points=1000)  # figures of a page need no more


def simulated(folder: Path, per_mm2: float = 60.0) -> tuple[Path, Chamber]:
    """A simulation's folder."""
    chamber = build_chamber(DESIGN)
    evaluation = poisson_evaluation(DESIGN, chamber, per_mm2)
    save_simulation(folder, DESIGN, chamber, evaluation)
    return folder, chamber


def studied(folder: Path, evaluations: int = 8) -> Path:
    """A study's folder.

    More shot makes more dents. Far sonotrodes cannot be simulated, near ones miss a constraint.
    """
    question = Study(
        design=DESIGN,
        vary={"shot.mass_g": (1.5, 8.0), "chamber.sonotrode_distance_mm": (8.0, 19.0)},
        optimizer={
            "evaluations": evaluations,
            "confirm": 2,
            "confirm_replicas": 4,
            "confirm_rounds": 1,
        },
        constraints={"chamber.sonotrode_distance_mm": {"min": 9.5}},
    )

    def simulator(design, stream, replicas):
        if design.chamber.sonotrode_distance_mm > 17:
            raise InputError("<b>not</b> this one")
        return poisson_evaluation(
            design, build_chamber(design), 10.0 * design.shot.mass_g, replicas or 4, len(stream)
        )

    save_study(folder, run_in_folder(question, folder, SerialExecutor(), simulator=simulator))
    return folder


def studied_once(factory: pytest.TempPathFactory) -> Path:
    """A copy of the folder of a study without the picture of its coverage.

    The study is made once for all workers: the first makes it while the others wait.
    """
    own = factory.getbasetemp()
    is_shared = "PYTEST_XDIST_WORKER" in os.environ and sys.platform != "win32"
    common = own.parent if is_shared else own
    made = common / "studied" / "study"
    with one_at_a_time(common / "studied.lock"):
        if not made.exists():
            with pytest.MonkeyPatch.context() as patch:
                patch.setattr("chamberopt.workflows.save_run.draw_coverage", lambda *_: None)
                studied(common / "begun" / "study")
            (common / "begun").rename(made.parent)
    return Path(shutil.copytree(made, factory.mktemp("report") / "study"))


@contextmanager
def one_at_a_time(lock: Path) -> Iterator[None]:
    """Wait until no other process is within such a block."""
    if sys.platform == "win32":  # it has no such locks, and each process its own folder
        yield
        return
    import fcntl

    with lock.open("w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield
